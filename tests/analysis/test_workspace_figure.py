"""Pictures of a workspace: what is drawn, with which words, and that nothing is cut off."""

import numpy as np
import pytest
from matplotlib.lines import Line2D
from numpy.testing import assert_allclose
from spaces import arm_of, found

from project import mostly_long
from rmrc.analysis.workspace.report import draw, picture
from rmrc.analysis.workspace.workspace import workspace


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
    assert axes.get_title() == "planar_6_3: workspace of tip"
    assert {text.get_text() for text in axes.texts} == {"q1 = 0°", "q1 = 135°", "q2 = 0°", "q2 = 120°"}
    x, y = next(line for line in axes.lines if line.get_label() == "the arm").get_data()
    assert_allclose(
        [x[-1], y[-1]], found("planar_6_3").task.arm.pose(found("planar_6_3").home)[:2], atol=1e-12
    )


@pytest.mark.parametrize("name", ["anthropomorphic", "torus_3r_short", "planar_3link"])
def test_entries_of_the_legend_differ_without_colors_too(name):
    figure = picture(found(name))
    kinds = styles(figure)
    assert len(set(kinds)) == len(kinds) >= 4


@pytest.mark.parametrize("measure", ["sigma_min", "manipulability", "condition"])
def test_a_map_has_a_colorbar_with_name_and_unit(measure):
    label = picture(found("torus_3r"), measure).axes[1].get_ylabel()
    assert "[1]" in label and label.endswith("best posture")


@pytest.mark.long  # the picture of an arm, written in the same way, is tried in the ordinary suite
@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_equal_pictures_have_equal_bytes(tmp_path, suffix):
    paths = [tmp_path / f"{i}{suffix}" for i in range(2)]
    for path in paths:
        draw(found("planar_6_3"), path, "sigma_min")
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert suffix != ".png" or paths[0].stat().st_size < 300_000


@pytest.mark.parametrize("measure", mostly_long(["sigma_min", None], 2))
def test_nothing_is_cut_off(measure):
    figure = picture(found("torus_3r"), measure)
    assert figure.axes[0].get_xlabel() == "distance from the axis of theta_1, $r$ [m]"
    figure.draw_without_rendering()
    for part in (figure.legends[0], *figure.axes):
        box = part.get_tightbbox()
        assert box.x0 >= -1.0 and box.y0 >= -1.0
        assert box.x1 <= figure.bbox.x1 + 1.0 and box.y1 <= figure.bbox.y1 + 1.0


def test_a_map_over_two_joints_has_degrees_and_meters_and_the_determinant():
    axes = picture(workspace(arm_of("stanford"), over=("d_3", "theta_5"), cells=20)).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("d_3 [m]", "theta_5 [°]")
    line = next(line for line in axes.lines if line.get_label() == "singular: wrist, interior")
    assert_allclose(line.get_ydata(), 0.0, atol=1e-9)
    assert np.ptp(axes.get_ylim()) > 10.0
