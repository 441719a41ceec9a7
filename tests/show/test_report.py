"""Answers that are ready to be shown have plain values for JSON."""

import json

import numpy as np

from rmrc.show.sheets import plain


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
