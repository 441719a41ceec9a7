"""Pictures of a workspace: what is drawn, with which words, and that nothing is cut off."""

import numpy as np
import pytest
from matplotlib.lines import Line2D
from numpy.testing import assert_allclose
from spaces import found, gantry

from rmrc.analysis.workspace.report import picture
from rmrc.show import figures
from rmrc.show.asked import sized


def words(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def styles(figure):
    """What tells the entries of the legend apart without colors."""
    return [
        (handle._unscaled_dash_pattern, handle.get_marker(), handle.get_linewidth())
        if isinstance(handle, Line2D)
        else handle.get_hatch()
        for handle in figure.legends[0].legend_handles
    ]


def test_the_arm_of_6_and_3_shows_both_sets_circles_limits_and_the_arm():
    figure = picture(found("planar_6_3"))
    axes = figure.axes[0]
    assert words(figure) == [
        "reached without joint limits", "reached within the limits",
        "singular: elbow, boundary, beyond the limits", "singular: elbow, boundary", "a joint at its limit", "the arm",
    ]  # fmt: skip
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_aspect()) == ("$x$ [m]", "$y$ [m]", 1.0)
    assert figure.get_suptitle() == "planar_6_3: workspace of tip"
    x, y = next(line for line in axes.lines if line.get_label() == "the arm").get_data()
    assert_allclose(
        [x[-1], y[-1]], found("planar_6_3").task.arm.pose(found("planar_6_3").home)[:2], atol=1e-12
    )


@pytest.mark.parametrize("name", ["anthropomorphic", "torus_3r_short", "planar_3link"])
def test_entries_of_the_legend_differ_without_colors_too(name):
    figure = picture(found(name))
    kinds = styles(figure)
    assert len(set(kinds)) == len(kinds) >= 3


@pytest.mark.parametrize("measure", ["sigma_min", "manipulability"])
def test_a_map_has_a_colorbar_with_name_and_unit(measure):
    label = picture(found("torus_3r"), measure).axes[1].get_xlabel()
    assert label == f"best {measure} [1]"


@pytest.mark.parametrize("width", [None, 3.5])
@pytest.mark.parametrize(
    ("name", "measure"), [("torus_3r", "sigma_min"), ("planar_6_3", None), ("gantry", "sigma_min")]
)
def test_nothing_is_cut_off(tmp_path, name, measure, width):
    space = gantry(tmp_path) if name == "gantry" else found(name)
    with sized(width, None), figures.lettering():
        figure = picture(space, measure)
        figure.draw_without_rendering()
    for part in (figure.legends[0], *figure.axes):
        box = part.get_tightbbox()
        assert box.x0 >= -1.0 and box.y0 >= -1.0
        assert box.x1 <= figure.bbox.x1 + 1.0 and box.y1 <= figure.bbox.y1 + 1.0
    for axes in figure.axes[: 1 + len(space.others)]:
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        for line in axes.lines:  # curves and the arm are within the axes, and not on their border
            x, y = line.get_data()
            assert left < np.min(x) <= np.max(x) < right and low < np.min(y) <= np.max(y) < high
