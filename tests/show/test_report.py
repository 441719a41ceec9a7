"""Answers that are ready to be shown: plain values for JSON, notes below tables, and what the verbs print of them."""

import json

import numpy as np
import pytest

import rmrc
from project import ROOT, mostly_long
from rmrc.analysis.check.check import report as of_check
from rmrc.analysis.identify.report import report as of_identified
from rmrc.analysis.ik.report import report as of_ik
from rmrc.analysis.inspect.report import report as of_inspection
from rmrc.analysis.statics.report import report as of_statics
from rmrc.analysis.workspace.report import report as of_workspace
from rmrc.show.report import Report, plain

TWO = str(ROOT / "models/planar_2link.xml")


def test_plain_values_are_those_of_strict_json():
    value = {
        "array": np.array([[1.5, np.nan], [-np.inf, 0.0]]), "integers": np.arange(2), "flag": np.bool_(True),
        "one": np.float64(0.1), "pair": ("x", None), "nested": [{"text": "y", "inf": float("inf")}],
    }  # fmt: skip
    expected = {
        "array": [[1.5, None], [None, 0.0]], "integers": [0, 1], "flag": True, "one": 0.1, "pair": ["x", None],
        "nested": [{"text": "y", "inf": None}],
    }  # fmt: skip
    assert plain(value) == expected
    assert json.loads(json.dumps(plain(value), allow_nan=False)) == expected
    assert all(type(one) is int for one in plain(np.arange(2)))
    assert type(plain(np.bool_(True))) is bool


LOG = str(ROOT / "scenarios/arm_log.csv")
ASKED = {
    "check": ([], lambda: of_check(rmrc.check(TWO))),
    "inspect": (["--joint-error", "0.1"], lambda: of_inspection(rmrc.inspect(TWO, joint_error=[0.1, 0.1]))),
    "ik": (["--to", "1,1", "--all"], lambda: of_ik(rmrc.ik(TWO, [1, 1], every=True))),
    "statics": (["--wrench", "1,2,3"], lambda: of_statics(rmrc.statics(TWO, [1, 2, 3]))),
    "workspace": (["--cells", "10"], lambda: of_workspace(rmrc.workspace(TWO, cells=10))),
    "identify": ([], lambda: of_identified(rmrc.identify(LOG))),
}  # fmt: skip


# these take longest, and tests/test_docs.py asks both
@pytest.mark.parametrize("verb", mostly_long(ASKED, 1, ["identify", "workspace"]))
def test_a_verb_prints_what_python_returns(rmrc_verb, tmp_path, request, verb):
    options, ask = ASKED[verb]
    answer = ask()
    assert isinstance(answer, Report) and answer.met and not answer.problem
    if answer.draw is not None:
        answer.draw(tmp_path / "picture.svg")
        assert (tmp_path / "picture.svg").read_text("utf-8").startswith("<?xml")
    request.getfixturevalue("undrawn")  # once is enough
    about = LOG if verb == "identify" else TWO
    code, out, _ = rmrc_verb(verb, about, *options, "--json")
    printed = json.loads(out)
    printed.pop("files", None)
    assert code == 0 and printed == answer.json
    if verb in ("identify", "workspace"):
        return  # these take longest, and the lines of their tables are those of the pages about them
    code, out, _ = rmrc_verb(verb, about, *options)
    words = {word for sheet in answer.sheets for row in sheet.rows for cell in row for word in cell.split()}
    assert code == 0 and words and words <= set(out.split())


@pytest.fixture
def rmrc_verb(rmrc, tmp_path, monkeypatch):
    """Return the function that calls the command line, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return rmrc


def test_what_is_not_met_says_so():
    beyond = of_ik(rmrc.ik(TWO, [3, 0]))
    assert not beyond.met
    assert beyond.problem == "not reached: 1 m and 0 rad are left at the nearest of 201 starts"
    # Negative control: without a goal beyond reach, and of another kind of answer, nothing is missed.
    assert of_ik(rmrc.ik(TWO, [1, 1])).met and of_statics(rmrc.statics(TWO, [1, 2, 3])).met
