"""The picture of filters: what is drawn, where, and that it can be read without colors."""

import itertools
import re

import numpy as np
import pytest
from matplotlib.image import imread

from project import mostly_long
from rmrc.show.palette import distinct
from rmrc.study import filter_figure
from rmrc.study.filter_figure import filter_factors
from rmrc.study.filters import FilterFactor


def curve(damping, sigma_min=0.05, low=1e-3):
    sigma = np.geomspace(low, 2.0, 60)
    gain = sigma / (sigma**2 + damping**2)
    return FilterFactor(sigma, gain, sigma_min, sigma_min / (sigma_min**2 + damping**2))


def some(count):
    return [(f"maximum={i / 10:g}", curve(0.1 * (i + 1), 0.02 * (i + 1))) for i in range(count)]


def axes_of(curves):
    return filter_figure._filter_factors("case", curves).axes[0]


def lines(axes, curves):
    """Return the line of each curve, by its label."""
    drawn = {line.get_label().partition("\n")[0]: line for line in axes.lines}
    return [drawn[label] for label, _ in curves]


@pytest.mark.parametrize("count", [1, 12])
def test_every_curve_is_drawn_with_its_mark_on_it_and_in_the_rug(count):
    curves = some(count)
    axes = axes_of(curves)
    rug = [line.get_xdata() for line in axes.lines if line.get_marker() == "|"]
    for (_, one), line, notch in zip(curves, lines(axes, curves), rug, strict=True):
        x, y = line.get_data()
        assert set(zip(one.sigma, one.gain, strict=True)) < set(zip(x, y, strict=True))
        (at,) = line.get_markevery()
        assert (x[at], y[at]) == (one.sigma_min, one.gain_min)
        assert (np.diff(x) >= 0.0).all()
        assert np.ravel(notch) == [one.sigma_min]
    ideal = next(line for line in axes.lines if line.get_label() == r"$1/\sigma$, exact")
    np.testing.assert_allclose(np.prod(ideal.get_data(), axis=0), 1.0, rtol=1e-15)


def test_a_run_that_came_nearer_than_the_picture_is_marked_at_its_edge():
    curves = [("a", curve(0.1, sigma_min=1e-7))]
    (line,) = lines(axes_of(curves), curves)
    (at,) = line.get_markevery()
    assert [data[at] for data in line.get_data()] == [curves[0][1].sigma[0], curves[0][1].gain[0]]
    assert line.get_label() == "a\n    $\\sigma_{\\min}$ = 1e-07"


def test_a_gain_of_zero_goes_to_the_bottom_and_not_out_of_the_picture():
    one = curve(0.1)
    one.gain[one.sigma < 0.1] = 0.0
    axes = axes_of([("truncated", one)])
    low, high = axes.get_ylim()
    assert 0.0 < low < one.gain[one.gain > 0.0].min() < one.gain.max() < high
    axes_of([("nothing", FilterFactor(one.sigma, 0.0 * one.sigma, 0.01, 0.0))])  # and no warning


@pytest.mark.parametrize("count", [2, 12])
def test_curves_differ_without_colors_and_in_colors(count):
    curves = some(count)
    drawn = lines(axes_of(curves), curves)
    assert len({(line.get_marker(), line._unscaled_dash_pattern) for line in drawn}) == count
    assert len({line.get_color() for line in drawn}) == count
    widths = [line.get_linewidth() for line in drawn]
    assert widths == sorted(widths, reverse=True)


def test_fifty_colors_are_all_different():
    assert len(set(distinct(50))) == 50
    assert all(color & 255 == 255 for color in distinct(50))


def test_the_words_name_scenario_axes_units_and_variants():
    axes = axes_of([("inverse", curve(0.1)), ("$x$", curve(0.2))])
    assert axes.get_title() == "case: the inverses as filters"
    assert axes.get_xlabel().startswith(r"$\sigma$ of the direction that is lost first [1]")
    assert axes.get_ylabel() == r"$g(\sigma)$, joint rate per unit task velocity [1]"
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    labels = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert labels == [
        "inverse\n    $\\sigma_{\\min}$ = 0.05",
        "\\$x\\$\n    $\\sigma_{\\min}$ = 0.05",
        r"$1/\sigma$, exact",
    ]


@pytest.mark.parametrize("count", mostly_long([12, 1], 2))
def test_the_legend_hides_nothing_and_is_not_cut_off(count):
    figure = filter_figure._filter_factors("case", some(count))
    figure.draw_without_rendering()
    legend, plot = figure.legends[0].get_window_extent(), figure.axes[0].get_window_extent()
    assert legend.x0 >= plot.x1
    assert figure.bbox.x0 <= legend.x0 and legend.x1 <= figure.bbox.x1
    assert figure.bbox.y0 <= legend.y0 and legend.y1 <= figure.bbox.y1
    for one, other in itertools.pairwise(figure.legends[0].get_texts()):
        assert other.get_window_extent().y1 <= one.get_window_extent().y0 + 1.0


def test_files_are_whole_pictures_with_text_as_text_and_equal_for_equal_curves(tmp_path):
    paths = [tmp_path / "new" / "a.png", tmp_path / "new" / "a.svg"]
    filter_factors("case", some(2), paths[1:])
    before = paths[1].read_bytes()
    filter_factors("case", some(2), paths[::-1])
    assert paths[1].read_bytes() == before
    assert sorted(tmp_path.glob("new/*")) == paths
    picture = imread(paths[0])
    assert picture.shape[0] > 500 and picture.shape[1] > 1000 and picture[..., :3].min() < 0.5
    text = paths[1].read_text("utf-8")
    assert re.search(r"<text[^>]*>maximum=0.1</text>|>maximum=0.1<", text)
