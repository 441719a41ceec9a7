"""Pictures of a workspace: what is drawn, with which words, and that it can be told apart without colors."""

import numpy as np
import pytest
from matplotlib.image import imread
from matplotlib.lines import Line2D
from numpy.testing import assert_allclose
from spaces import arm_of, found

from project import mostly_long
from rmrc.analysis.workspace import figure as workspace_figure
from rmrc.analysis.workspace.figure import draw
from rmrc.analysis.workspace.joint_map import joint_map


def drawn(space, measure=None):
    figure = workspace_figure._workspace(space, measure)
    return figure, figure.axes[0]


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
    figure, axes = drawn(found("planar_6_3"))
    assert words(figure) == [
        "reached without joint limits", "reached within the limits",
        "singular: elbow, boundary, beyond the limits", "singular: elbow, boundary", "q1 at a limit", "q2 at a limit", "the arm",
    ]  # fmt: skip
    kinds = styles(figure)
    assert len(set(kinds)) == len(kinds)
    assert axes.get_xlabel() == "$x$ [m]" and axes.get_ylabel() == "$y$ [m]"
    assert axes.get_title() == "planar_6_3: workspace of tip"
    assert axes.get_aspect() == 1.0
    limits = {text.get_text() for text in axes.texts}
    assert limits == {"q1 = 0°", "q1 = 135°", "q2 = 0°", "q2 = 120°"}
    radii = [np.hypot(*line.get_data()) for line in axes.lines if line.get_zorder() == 4]
    for radius in radii:
        known = radius[~np.isnan(radius)]
        assert_allclose(known, np.round(known), rtol=1e-12)
    home = next(line for line in axes.lines if line.get_label() == "the arm")
    x, y = home.get_data()
    assert_allclose(
        [x[-1], y[-1]], found("planar_6_3").task.arm.pose(found("planar_6_3").home)[:2], atol=1e-12
    )


@pytest.mark.parametrize(
    "cut",
    [
        {"cells": 50},
        pytest.param(
            {"plane": "xz", "through": (0.0, 0.0, 1.0), "cells": 40, "samples": 5000}, marks=pytest.mark.long
        ),
    ],
)
def test_families_differ_without_colors_too(cut):
    figure, _ = drawn(found("anthropomorphic", **cut))
    kinds = styles(figure)
    assert len(set(kinds)) == len(kinds)
    assert {"singular: shoulder, interior", "singular: elbow, boundary"} <= set(words(figure))


@pytest.mark.parametrize("measure", ["sigma_min", "manipulability", "condition", "postures"])
def test_a_map_has_a_colorbar_with_name_and_unit(measure):
    figure, _ = drawn(found("torus_3r"), measure)
    bar = figure.axes[1]
    assert bar.get_ylabel().startswith(workspace_figure.NAMES[measure])
    assert "[1]" in bar.get_ylabel()
    assert ("best posture" in bar.get_ylabel()) == (measure != "postures")


def test_a_half_plane_and_a_plane_through_a_point_say_what_they_are():
    _, axes = drawn(found("torus_3r"))
    assert axes.get_xlabel() == "distance from the axis of theta_1, $r$ [m]" and axes.get_xlim()[0] == 0.0
    figure, axes = drawn(found("torus_3r", None, "xz", (0.0, 0.5, 0.0), cells=30))
    assert axes.get_title() == "torus_3r: workspace of tip, y = 0.5 m"
    kinds = styles(figure)
    assert len(set(kinds)) == len(kinds)


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
    figure, _ = drawn(found("torus_3r"), measure)
    figure.draw_without_rendering()
    for one in (figure.legends[0], *figure.axes):
        box = one.get_tightbbox()
        assert box.x0 >= -1.0 and box.y0 >= -1.0
        assert box.x1 <= figure.bbox.x1 + 1.0 and box.y1 <= figure.bbox.y1 + 1.0


def test_a_map_over_two_joints_has_degrees_and_meters_and_the_determinant(tmp_path):
    space = joint_map(arm_of("stanford"), ("d_3", "theta_5"), cells=20)
    figure = workspace_figure._joint_map(space, "sigma_min")
    axes = figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("d_3 [m]", "theta_5 [°]")
    line = next(line for line in axes.lines if line.get_label() == "singular: wrist, interior")
    assert_allclose(line.get_ydata(), 0.0, atol=1e-9)
    draw(space, tmp_path / "map.png", "condition")
    assert imread(tmp_path / "map.png").shape[1] > 800
