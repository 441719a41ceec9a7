"""Pictures of an arm and of its workspace: where things are, how large, with which words, and nothing is cut off."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from spaces import found, gantry

import rmrc
from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.inspection_figure import figure
from rmrc.analysis.workspace_report import picture
from rmrc.show import figures
from rmrc.show.palette import sized


def drawn(inspection):
    """Return the lines of each panel: velocity, force, the arm, its site; and the texts of the legend."""
    panels = figure(inspection)
    lines = [[line.get_xydata() for line in axes.lines] for axes in panels.axes]
    return lines, " ".join(text.get_text() for text in panels.legends[0].get_texts())


def planar(q):
    return rmrc.inspect(arms.load(ROOT / "models/planar_2link.xml"), q)


def test_the_stick_figure_joins_base_joints_and_site_and_ellipses_have_the_scale_of_the_legend():
    inspection = planar([0.4, 1.2])
    ((*outlines, stick, _),), words = drawn(inspection)
    elbow, tip = [np.cos(0.4), np.sin(0.4)], [np.cos(0.4) + np.cos(1.6), np.sin(0.4) + np.sin(1.6)]
    assert_allclose(stick, [[0, 0], [0, 0], elbow, tip], atol=1e-12)
    scales = [float(re.search(rf"1 {unit} is ([0-9.]+) m", words)[1]) for unit in ("m/s", "N")]
    squares = inspection.jacobian[:2] @ inspection.jacobian[:2].T
    # xi^T (J J^T)^-1 xi = 1, and F^T (J J^T) F = 1
    for outline, scale, matrix in zip(outlines, scales, (np.linalg.inv(squares), squares), strict=True):
        values = (outline - inspection.pose[:2]) / scale
        assert_allclose(np.einsum("ki,ij,kj->k", values, matrix, values), 1.0, atol=1e-9)


def test_at_a_singularity_velocities_are_a_line_and_forces_are_cut_off_where_the_legend_says():
    ((velocity, force, *_),), words = drawn(planar([0, 0]))
    assert_allclose(velocity[:, 0], 2.0, atol=1e-12)
    cut = float(re.search(r"cut off at ([0-9.]+) m", words)[1])
    assert np.ptp(force[:, 0]) / 2 == pytest.approx(cut)


def test_a_workspace_shows_both_sets_circles_limits_and_the_arm():
    space = found("planar_6_3")
    shown = picture(space)
    axes = shown.axes[0]
    assert [text.get_text() for text in shown.legends[0].get_texts()] == [
        "reached without joint limits", "reached within the limits",
        "singular: elbow, boundary, beyond the limits", "singular: elbow, boundary", "a joint at its limit", "the arm",
    ]  # fmt: skip
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_aspect()) == ("$x$ [m]", "$y$ [m]", 1.0)
    x, y = next(line for line in axes.lines if line.get_label() == "the arm").get_data()
    assert_allclose([x[-1], y[-1]], space.task.arm.pose(space.home)[:2], atol=1e-12)


@pytest.mark.parametrize(
    ("name", "measure", "width"), [("torus_3r", "sigma_min", 3.5), ("gantry", None, None)]
)
def test_nothing_of_a_workspace_is_cut_off(tmp_path, name, measure, width):
    space = gantry(tmp_path) if name == "gantry" else found(name)
    with sized(width, None), figures.lettering():
        shown = picture(space, measure)
        shown.draw_without_rendering()
    assert measure is None or shown.axes[1].get_xlabel() == "best sigma_min [1]"
    for part in (shown.legends[0], *shown.axes):
        box = part.get_tightbbox()
        assert box.x0 >= -1.0 and box.y0 >= -1.0
        assert box.x1 <= shown.bbox.x1 + 1.0 and box.y1 <= shown.bbox.y1 + 1.0
    for axes in shown.axes[: 1 + len(space.others)]:
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        for line in axes.lines:  # curves and the arm are within the axes, and not on their border
            x, y = line.get_data()
            assert left < np.min(x) <= np.max(x) < right and low < np.min(y) <= np.max(y) < high
