"""The figure of a sweep: bars count the runs, and dots are where the values are."""

import re

import numpy as np
import pyarrow as pa
import pytest

from rmrc.study import pictures
from rmrc.study.swept import Swept
from rmrc.support.errors import QuestionError

RUNS = 37
UNITS = {"control.feedback": "1/s", "control.inverse.method": "", "position_error.max": "m", "sigma.min": "1"}


@pytest.fixture
def swept():
    rng = np.random.default_rng(3)
    rows = {
        "control.feedback": list(rng.uniform(5, 40, RUNS)),
        "control.inverse.method": ["damped", "inverse"] * (RUNS // 2) + [None],
        "position_error.max": 10.0 ** rng.uniform(-6, -1, RUNS),
        "sigma.min": np.r_[np.nan, rng.uniform(0.1, 0.2, RUNS - 1)],
    }
    figures = {name: rows[name] for name in list(rows)[2:]}
    return Swept("hand", rows, UNITS, list(rows)[:2], figures)


def test_bars_count_the_runs_that_have_a_figure_and_dots_are_at_their_values(swept):
    bars, other_bars, dots, words = pictures.sweep_figure(swept, None).get_axes()
    for axes, values in zip((bars, other_bars), swept.figures.values(), strict=True):
        assert sum(one.get_height() for one in axes.patches) == np.isfinite(values).sum()
        assert axes.get_xscale() == ("log" if "position" in axes.get_xlabel() else "linear")
    found = dots.collections[0].get_offsets()
    wanted = [swept.rows["control.feedback"], swept.figures["position_error.max"]]
    np.testing.assert_array_equal(found, np.transpose(wanted))
    assert (dots.get_xlabel(), dots.get_yscale()) == ("control.feedback [1/s]", "log")
    assert [one.get_text() for one in words.get_xticklabels()] == ["damped", "inverse", "None"]


def test_a_figure_has_the_size_and_the_panels_asked(swept, tmp_path):
    pictures.sweep_figure(swept, tmp_path / "x.svg", ["keys"], width=3.5)
    text = (tmp_path / "x.svg").read_text("utf-8")
    assert float(re.search(r'<svg[^>]* width="([\d.]+)pt"', text)[1]) == pytest.approx(72 * 3.5)
    assert all(name in text for name in list(UNITS)[:3])
    assert "sigma" not in text


def test_what_has_nothing_to_draw_is_refused(swept, tmp_path):
    bare = Swept("bare", swept.rows, UNITS, [], swept.figures)
    with pytest.raises(QuestionError, match="bare: no run has numbers"):
        pictures.sweep_figure(bare, tmp_path / "x.svg", ["keys"])
    with pytest.raises(QuestionError, match="not of a sweep"):
        Swept.of(tmp_path / "x.parquet", pa.table({"on_front": [True]}))
    assert list(tmp_path.iterdir()) == []
