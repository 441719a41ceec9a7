"""The linter of prose: it finds what its rules name, in the places that people read, and nothing in good English."""

import json
import runpy
import tomllib

import pytest

from project import ROOT

PROSE = runpy.run_path(str(ROOT / "tools/prose.py"))
RULES = tomllib.loads((ROOT / "tools/prose.toml").read_text(encoding="utf-8"))


def kinds(suffix, source):
    """Return kind, place and line of each finding in a file."""
    using = PROSE["checks"](RULES)
    passages = PROSE["READERS"][suffix](source)
    return [(one.kind, one.place, one.line) for one in PROSE["findings"](passages, using)]


BAD = {
    "It prints a row a variant.": "distributive",
    "It shows what is sent, and the rest.": "what-clause",
    "It goes beyond what it reaches.": "noun-clause",
    "This needs a display. a display.": "repetition",
    "It shows rates of norm 1.": "unit-norm",
    "Nor does it move.": "inversion",
    "This is answered with a warning.": "idiom",
    "The model must be mended.": "idiom",
    "Each drive lags.": "term",
    "It works, in the last analysis.": "cliches",  # proselint's own
}


@pytest.mark.parametrize(("text", "kind"), BAD.items())
def test_a_rule_finds_its_pattern_in_every_place(text, kind):
    assert kinds(".md", f"# Title\n\n{text}\n") == [(kind, "markdown", 3)]
    cells = [
        {"cell_type": "code", "source": ["a row a variant"]},
        {"cell_type": "markdown", "source": [text]},
    ]
    assert kinds(".ipynb", json.dumps({"cells": cells})) == [(kind, "markdown", 1)]
    assert kinds(".yaml", f"# {text}\nname: x\n") == [(kind, "scenario", 1)]
    assert kinds(".py", f'"""Good.\n\n{text}\n"""\n') == [(kind, "docstring", 3)]
    assert kinds(".py", f'def _f():\n    """{text}"""\n') == [(kind, "private", 2)]
    assert kinds(".py", f"x = 1  # {text}\n") == [(kind, "comment", 1)]
    assert kinds(".py", f'x = f"{{y}} {text}"\n') == [(kind, "text", 1)]


@pytest.mark.parametrize(
    "text",
    [
        "It prints one row per variant.",
        "What is a singularity?",
        "The motor drives the joint.",
        "This triggers a warning.",
        "The same command resumes.",
    ],
)
def test_plain_sentences_pass(text):
    assert kinds(".md", text) == kinds(".py", f'"""{text}"""\n') == []


def test_code_is_not_prose():
    assert (
        kinds(".md", "```\na row a variant\n```\n\nThe key `what is sent, a row a variant` is code.\n") == []
    )
    assert kinds(".md", "Good.\n\nIt prints a\nrow a variant.\n") == [
        ("distributive", "markdown", 3)
    ]  # over lines
    assert kinds(".py", '"""Run.\n\n>>> "a row a variant"\n"""\n') == []


def test_a_rule_finds_its_pattern_in_every_passage_and_at_its_beginning():
    text = "Good.\n\nNor does it move.\n\nGood.\n\nSo is the arm.\n\nWhat damping does\n"
    assert kinds(".md", text) == [
        ("inversion", "markdown", 3),
        ("inversion", "markdown", 7),
        ("noun-clause", "markdown", 9),
    ]
