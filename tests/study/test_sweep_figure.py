"""The figure of a sweep: bars count the runs, lines pass where the values are, and letters do not overlap."""

import re

import numpy as np
import pytest

from rmrc.study import sweep_figure
from rmrc.study.dataset import Left
from rmrc.study.swept import Swept
from rmrc.support.errors import QuestionError

RUNS = 37
UNITS = {"control.feedback": "1/s", "control.inverse.damping.maximum": "as σ", "joint_rate.peak": "rad/s",
         "position_error.max": "m", "sigma.min": "1"}  # fmt: skip


@pytest.fixture
def swept():
    rng = np.random.default_rng(3)
    rows = {
        "control.feedback": rng.uniform(5, 40, RUNS), "control.inverse.damping.maximum": rng.uniform(0, 1, RUNS),
        "joint_rate.peak": rng.uniform(2, 3, RUNS), "position_error.max": 10.0 ** rng.uniform(-6, -1, RUNS),
        "sigma.min": np.r_[np.nan, rng.uniform(0.1, 0.2, RUNS - 1)],
    }  # fmt: skip
    figures = {name: rows[name] for name in list(rows)[2:]}
    return Swept("hand", {name: list(one) for name, one in rows.items()}, UNITS, list(rows)[:2], figures)


def test_bars_count_the_runs_that_have_a_figure(swept):
    for axes, values in zip(sweep_figure.histograms(swept).get_axes(), swept.figures.values(), strict=True):
        assert sum(one.get_height() for one in axes.patches) == np.isfinite(values).sum()
        (median,) = {line.get_xdata()[0] for line in axes.get_lines()}
        assert median == np.nanmedian(values)
        assert axes.get_xscale() == ("log" if "position" in axes.get_xlabel() else "linear")


def test_a_line_passes_where_the_values_of_its_run_are(swept):
    (lines,) = sweep_figure.parallel(swept).get_axes()[0].collections
    columns = np.array(list(swept.coordinates.values()))[:, 1:]  # without the run that lacks a figure
    columns[3] = np.log10(columns[3])  # over five decades
    low, high = columns.min(axis=1, keepdims=True), columns.max(axis=1, keepdims=True)
    wanted = ((columns - low) / (high - low)).T
    wanted = wanted[np.argsort(wanted[:, 2])]  # the largest rate last, as it is darkest
    found = np.array([one.vertices[:, 1] for one in lines.get_paths()])
    assert found.shape == wanted.shape == (RUNS - 1, 5)
    assert np.abs(found - wanted).max() < 1e-12  # rounding of numbers up to 1


@pytest.mark.parametrize(("width", "font"), [(3.5, 7.0), (3.5, 8.0), (7.16, 8.0)])
def test_a_figure_has_the_width_asked_and_its_letters_do_not_overlap(
    swept, tmp_path, monkeypatch, width, font
):
    kept = []
    monkeypatch.setattr(sweep_figure, "save", lambda picture, _: kept.append(picture))
    sweep_figure.plot(swept, tmp_path / "x.pdf", ["parallel"], width, font)
    (picture,) = kept
    assert picture.get_size_inches()[0] == width
    picture.canvas.draw()
    (axes,) = picture.get_axes()
    boxes = [text.get_window_extent() for text in axes.texts if text.get_rotation() % 90 == 0]
    inner = picture.bbox
    assert all(box.x0 >= inner.x0 - 1 and box.x1 <= inner.x1 + 1 for box in boxes)
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_a_size_in_a_file_is_that_asked(swept, tmp_path):
    sweep_figure.plot(swept, tmp_path / "x.svg", width=3.5)
    text = (tmp_path / "x.svg").read_text("utf-8")
    assert float(re.search(r'<svg[^>]* width="([\d.]+)pt"', text)[1]) == pytest.approx(72 * 3.5)
    assert all(f"{name} [" in text for name in swept.figures)


def test_what_has_nothing_to_draw_is_refused(swept, tmp_path):
    bare = Swept("bare", swept.rows, UNITS, [], swept.figures)
    with pytest.raises(QuestionError, match="bare: no run has numbers for parallel"):
        sweep_figure.plot(bare, tmp_path / "x.svg", ["parallel"])
    with pytest.raises(QuestionError, match="settings of a search"):
        Swept.of(tmp_path / "x.parquet", Left({"on_front": [True]}, ""))
    assert list(tmp_path.iterdir()) == []
