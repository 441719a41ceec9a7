"""Answers that are ready to be shown: plain values for JSON, and what the verbs print of them."""

import json

import numpy as np
import pytest

import rmrc as library
from project import ROOT
from rmrc.analysis.check.check import report as of_check
from rmrc.analysis.ik.report import report as of_ik
from rmrc.analysis.statics.report import report as of_statics
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


ASKED = {
    "check": ([], lambda: of_check(library.check(TWO))),
    "ik": (["--to", "1,1", "--all"], lambda: of_ik(library.ik(TWO, [1, 1], every=True))),
    "statics": (["--wrench", "1,2,3"], lambda: of_statics(library.statics(TWO, [1, 2, 3]))),
}


@pytest.mark.parametrize("verb", ASKED)
def test_a_verb_prints_what_python_returns(rmrc, verb):
    options, ask = ASKED[verb]
    answer = ask()
    assert isinstance(answer, Report) and answer.met and not answer.problem
    code, out, _ = rmrc(verb, TWO, *options, "--json")
    assert code == 0 and json.loads(out) == answer.json
    code, out, _ = rmrc(verb, TWO, *options)
    words = {word for sheet in answer.sheets for row in sheet.rows for cell in row for word in cell.split()}
    assert code == 0 and words and words <= set(out.split())
