"""The commands of the documents, run as they stand there, in the order of their page.

They run in a folder like a clone after `pip install -e .`. A block without a language that follows a command has lines
of its output, in which `…` stands for anything.
"""

import ctypes.util
import math
import os
import re
import shlex
import shutil
import subprocess
import sys

import pytest
import typer.main

from pages import blocks
from project import ROOT, undrawn
from rmrc import cli

DOCUMENTS = {
    str(path.relative_to(ROOT)): path.read_text("utf-8")
    for path in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("*/README.md")])
}

# The environment that the page describes is there already, without a download.
INSTALLED = "python3 -m venv .venv && .venv/bin/pip install -e . && "
# What no test runs as it stands, and why.
ELSEWHERE = {
    r"python3 -m venv .*dev": "downloads; `.ci/run` runs it",
    r"git clone|rmrc identify franka\.csv": "downloads the log of a robot",
    r".*pip install": "downloads",
    r".*pip wheel": "downloads; tests/test_wheel.py runs it where there is a package index",
    r".*-m rmrc replay": "opens a window or a browser; tests/recording looks at both",
    r"dask|rmrc sweep .* tcp://10": "needs other machines",
    r"systemd-run": "needs a session of systemd",
    r".*benchmarks/": "measures for minutes, on a quiet machine",
    r".*-m pytest": "runs tests that this suite has",
}
# What takes more than a few seconds; pictures need OpenGL as well.
SLOW = re.compile(r"\b(tune|margins|sweep|workspace|compare|render|report|plot|ik .*--all)\b")


def lines_of(block):
    """Yield the commands of a block, each a line, or more where quotes are open."""
    command = ""
    for line in block.splitlines():
        command += line
        try:
            shlex.split(command)
        except ValueError:
            command += "\n"
        else:
            yield command
            command = ""


def commands(text):
    """Return the commands of a document that a test can run, each with the lines that it is said to print."""
    found = []
    for language, block in blocks(text):
        if language == "sh":
            found += [(line.removeprefix(INSTALLED), []) for line in lines_of(block)]
        elif language == "" and found:
            found[-1][1].extend(filter(str.strip, block.splitlines()))
    return [(command, said) for command, said in found if not elsewhere(command)]


def elsewhere(command):
    return [pattern for pattern in ELSEWHERE if re.match(pattern, command)]


NUMBER = r"[-+]?\d+(?:,\d{3})*(?:\.\d+)?(?:e[-+]?\d+)?"


def near(said, printed):
    """Whether a printed number is what a page says: on another machine, last digits and rounding errors differ."""
    wanted, value = (float(number.replace(",", "")) for number in (said, printed))
    digits = re.search(r"\.(\d+)", said)
    unit = 10.0 ** -len(digits[1]) if digits and "e" not in said else 0.0
    return math.isclose(value, wanted, rel_tol=0.01, abs_tol=max(unit, 1e-8))


def agrees(said, printed):
    """Whether a printed line is the line of a page, but for widths of columns."""
    said, printed = (" ".join(line.split()) for line in (said, printed))
    pattern = re.escape(re.sub(NUMBER, "\0", said)).replace("\0", f"({NUMBER})").replace("…", ".*")
    found = re.fullmatch(pattern, printed)
    return bool(found) and all(map(near, re.findall(NUMBER, said), found.groups()))


def test_lines_agree_but_for_the_last_digits():
    assert agrees("rank  5 of 6;  sigma 1.85e-16 0.7245", "rank 5 of 6; sigma 2.2e-17  0.7246")
    assert agrees("got … of 8,629 refused", "got 4596 of 8629 refused")
    assert not agrees("5 of 6", "6 of 6") and not agrees("0.72 m", "0.75 m") and not agrees("a", "b")


@pytest.fixture
def clone(tmp_path):
    """Return a folder with copies of what a clone has, its `.venv`, and the files that readers bring."""
    for folder in ("models", "scenarios", "examples"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    programs = tmp_path / ".venv/bin"
    programs.mkdir(parents=True)
    for name, module in (("python", ""), ("rmrc", "-m rmrc")):
        text = f'#!/bin/sh\nPYTHONPATH="{ROOT}/src" exec "{sys.executable}" {module} "$@"\n'
        (programs / name).write_text(text)
        (programs / name).chmod(0o755)
    model = (ROOT / "models/planar_2link.xml").read_text("utf-8")
    (tmp_path / "my.xml").write_text(model.replace("common/", "models/common/"))
    ((_, scenario),) = (
        block for block in blocks(DOCUMENTS["docs/from_simulation_to_your_robot.md"]) if block[0] == "yaml"
    )
    (tmp_path / "loop.yaml").write_text(scenario)
    return tmp_path


def call(clone, rmrc, command):
    """Return the exit code of a command and all that it prints."""
    words = shlex.split(command)
    program = words[1:] if words[0] == "rmrc" else words[3:]
    in_process = words[0] == "rmrc" or words[:3] == [".venv/bin/python", "-m", "rmrc"]
    if (
        in_process
        and "render" not in words
        and not re.search("[|&;<>()$*]", re.sub(r"'.*?'|\".*?\"", "", command))
    ):
        code, out, err = rmrc(*program)
        return code, out + err
    environment = {**os.environ, "PATH": f"{clone}/.venv/bin:{os.environ['PATH']}", "MUJOCO_GL": "egl"}
    done = subprocess.run(
        ["bash", "-c", command], cwd=clone, env=environment, stdin=subprocess.DEVNULL, text=True, check=False,
        capture_output=True, timeout=600,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def run_all(clone, rmrc, chosen):
    for command, said in chosen:
        code, printed = call(clone, rmrc, command)
        printed = printed.splitlines()
        assert [line for line in said if not any(agrees(line, one) for one in printed)] == [], command
        fails = any(re.match("rmrc: (not reached|missed)", line) for line in printed)
        assert code == fails, (command, printed)


WITH_COMMANDS = [name for name, text in DOCUMENTS.items() if commands(text)]


@pytest.mark.parametrize("name", WITH_COMMANDS)
def test_the_commands_of_a_page_print_what_it_says(rmrc, clone, name):
    with undrawn():
        run_all(clone, rmrc, [one for one in commands(DOCUMENTS[name]) if not SLOW.search(one[0])])


@pytest.mark.long
@pytest.mark.parametrize(
    "name", [name for name in WITH_COMMANDS if SLOW.search(str(commands(DOCUMENTS[name])))]
)
def test_all_commands_of_a_page_print_what_it_says(rmrc, clone, name):
    if name == "docs/look.md":  # which goes on from the first page
        run_all(clone, rmrc, commands(DOCUMENTS["docs/start.md"])[:1])
    drawable = ctypes.util.find_library("EGL")
    run_all(clone, rmrc, [one for one in commands(DOCUMENTS[name]) if drawable or " render " not in one[0]])


def test_what_is_run_elsewhere_is_there():
    every = [
        line
        for text in DOCUMENTS.values()
        for kind, block in blocks(text)
        if kind == "sh"
        for line in lines_of(block)
    ]
    assert len(every) > 50
    assert [one for one in ELSEWHERE if not any(one in elsewhere(line) for line in every)] == []


VERBS = typer.main.get_command(cli.app).commands


@pytest.mark.parametrize("name", DOCUMENTS)
def test_commands_in_sentences_have_a_verb_and_options_that_exist(name):
    sentences = re.sub(r"^```.*?^```$", "", DOCUMENTS[name], flags=re.MULTILINE | re.DOTALL)
    for command in re.findall(r"`rmrc ([a-z][^`]*)`", sentences):
        verb, *words = command.split()
        assert verb in VERBS, command
        known = {
            option for parameter in VERBS[verb].params for option in parameter.opts + parameter.secondary_opts
        }
        used = {word.partition("=")[0] for word in words if re.match("--?[a-z]", word)}
        assert used - known - {"--help"} == set(), command
    assert re.findall(r"^ {4}(?:rmrc|python|dask|\.venv).*$", sentences, re.MULTILINE) == []
