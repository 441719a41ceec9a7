"""The page "Which method should I use?" has what its command measures."""

import runpy

import pytest

from project import ROOT

TOOL = runpy.run_path(str(ROOT / "tools/methods.py"))
PAGE = (ROOT / "docs/which_method.md").read_text("utf-8")


# One situation that is quick to run; a figure has three digits, and servos on another processor end in other bits.
@pytest.mark.parametrize(
    "method", ["undamped", "damped by σ_min", "undamped, singularity-consistent", "damped, keep out"]
)
def test_a_row_is_what_its_scenario_gives(method):
    found = TOOL["measured"]("approach_singularity", [method])[method]
    row = TOOL["rows"]()["approach_singularity"][method]
    assert row == pytest.approx(found, rel=0.006, abs=2e-3, nan_ok=True)


def test_every_situation_and_method_has_its_row_and_the_page_follows_from_them():
    assert {name: list(each) for name, each in TOOL["rows"]().items()} == {
        name: list(TOOL["METHODS"]) for name in TOOL["SITUATIONS"]
    }
    assert TOOL["with_tables"](PAGE) == PAGE
