"""At any width of a terminal no word is broken inside: what is printed at 200 columns is there, whole, at 80 and 60."""

import re

import pytest
import typer

from pages import page
from project import ROOT
from rmrc import cli

VERBS = typer.main.get_command(cli.app).commands
PUMA, TWO = str(ROOT / "models/puma560.xml"), str(ROOT / "models/planar_2link.xml")


def words(text):
    """Return the words of a text, rules of tables left out."""
    return {word for word in text.split() if not re.fullmatch("[─━]+", word)}


HELPS = {}


@pytest.fixture
def help_of(rmrc, monkeypatch):
    """Return a function: verb, width -> the help as a terminal of that width shows it, printed once."""

    def shown(verb, width):
        if (verb, width) not in HELPS:
            monkeypatch.setenv("COLUMNS", str(width))
            code, HELPS[verb, width], _ = rmrc(*filter(None, [verb]), "--help")
            assert code == 0
        return HELPS[verb, width]

    return shown


@pytest.mark.parametrize("verb", ["", *VERBS])
def test_no_word_of_a_help_is_broken_or_cut(help_of, verb):
    shown = {}
    for width in (200, 80, 60):
        shown[width] = help_of(verb, width)
        assert max(map(len, shown[width].splitlines())) <= width
        assert "..." not in shown[width].replace(",...", "").replace("[ARGS]...", "")
    for width in (80, 60):
        assert words(shown[200]) - words(shown[width]) == set()


@pytest.mark.parametrize("width", [0, 1, 5, 12, 19])
def test_a_terminal_of_next_to_no_columns_is_no_bug(rmrc, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    code, shown, err = rmrc("inspect", f"{ROOT}/models/planar_rp.xml")
    assert (code, err) == (0, "")
    assert "pivot" in shown


def test_the_list_of_verbs_and_the_exit_codes_are_in_the_help(rmrc):
    _, shown, _ = rmrc("--help")
    table = page("Commands").partition("| exit code |")[2].partition("\n\n")[0]
    codes = re.findall(r"^\| ([0-9]+) \|", table, re.MULTILINE)
    assert codes == ["0", "1", "2", "3", "70", "129", "130", "141", "143"]
    for code in codes:
        assert re.search(rf"\b{code}  ", shown), code
        assert re.search(rf"\b{code}  ", cli.__doc__), code
    for verb, command in VERBS.items():
        assert verb in shown and command.help.split("\n")[0].split(";")[0] in " ".join(shown.split())
