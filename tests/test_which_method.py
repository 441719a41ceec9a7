"""The page "Which method should I use?" has what its command measures."""

import re
import runpy

import pytest

from project import ROOT

TOOL = runpy.run_path(str(ROOT / "tools/methods.py"))
PAGE = (ROOT / "docs/which_method.md").read_text("utf-8")


def row_of(scenario, method):
    """Return the cells of a method's row in the table of a scenario."""
    block = re.split(f"`rmrc run {scenario}[` ]", PAGE, maxsplit=1)[1].partition("###")[0]
    (row,) = re.findall(rf"^\| {re.escape(method)} \| (.*) \|$", block, re.MULTILINE)
    return [cell.strip() for cell in row.split("|")]


# One situation that is quick to run; a figure has three digits, and servos on another processor end in other bits.
@pytest.mark.parametrize(
    "method", ["undamped", "damped by σ_min", "undamped, singularity-consistent", "damped, keep out"]
)
def test_a_row_is_what_its_scenario_gives(method):
    found = TOOL["measured"]("approach_singularity", [method])[method]
    for cell, value in zip(row_of("approach_singularity", method), found, strict=True):
        assert (cell == "") == (value != value)
        assert cell == "" or float(cell) == pytest.approx(value, rel=0.006, abs=2e-3)


def test_every_situation_and_method_has_its_row_and_the_decision_follows_from_them():
    for scenario in TOOL["SITUATIONS"]:
        found = {}
        for method in TOOL["METHODS"]:
            cells = row_of(scenario, method)
            is_run = bool(re.match(r"[\d.]", cells[0]))
            found[method] = tuple(float(cell or "nan") for cell in cells) if is_run else cells[0]
        assert TOOL["decision"](scenario, found) in PAGE
    assert all(f"`{one}`" in PAGE for sets in TOOL["METHODS"].values() for one in sets)
