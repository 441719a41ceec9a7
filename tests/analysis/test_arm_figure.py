"""The picture of an arm: where it is, where its ellipses are, and that it can be read without colors."""

import re

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from numpy.testing import assert_allclose

import rmrc
from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.inspect.figure import draw_arm, ellipses, figure, moving_planes


def found(name, *configurations, site=None):
    arm = arms.load(ROOT / f"models/{name}.xml", site)
    return [rmrc.inspect(arm, q) for q in configurations]


def drawn(inspections):
    """Return the panels of the picture and the texts of its legend."""
    picture = figure(inspections)
    return picture.axes, [text.get_text() for text in picture.legends[0].get_texts()]


def lines(axes, style, points):
    """Return lines of a style with this many points."""
    return [line for line in axes.lines if line.get_linestyle() == style and len(line.get_xdata()) == points]


def outlines(axes):
    return [lines(axes, style, 181)[0].get_xydata() for style in ("-", "--")]


def test_a_planar_arm_is_drawn_in_its_plane_and_others_in_two(tmp_path):
    planes = {path.stem: moving_planes(arms.load(path)) for path in sorted((ROOT / "models").glob("*.xml"))}
    planar = {"planar_2link", "planar_3link", "planar_6_3", "planar_rp", "selig_211"}
    assert {name for name, both in planes.items() if both == [[0, 1]]} == planar
    assert planes["stanford"] == planes["spherical_wrist"] == [[0, 1], [0, 2]]
    upright = '<mujoco><worldbody><body><joint name="a" axis="0 1 0"/><geom size="0.1"/><site name="s" pos="1 0 0"/></body></worldbody></mujoco>'
    (tmp_path / "upright.xml").write_text(upright)
    assert moving_planes(arms.load(tmp_path / "upright.xml")) == [[0, 2]]


def test_the_stick_figure_joins_base_joints_and_site():
    (axes,), _ = drawn(found("planar_2link", [0.4, 0.7]))
    elbow, tip = [np.cos(0.4), np.sin(0.4)], [np.cos(0.4) + np.cos(1.1), np.sin(0.4) + np.sin(1.1)]
    (stick,) = lines(axes, "-", 4)
    assert_allclose(stick.get_xydata(), [[0, 0], [0, 0], elbow, tip], atol=1e-12)


def test_ellipses_are_around_the_tip_with_the_scale_of_the_legend():
    (one,) = found("planar_2link", [0.4, 1.2])
    (axes,), labels = drawn([one])
    scales = [float(re.search(rf"1 {unit} is ([0-9.]+) m", " ".join(labels))[1]) for unit in ("m/s", "N")]
    squares = one.jacobian[:2] @ one.jacobian[:2].T
    # xi^T (J J^T)^-1 xi = 1, and F^T (J J^T) F = 1
    for outline, scale, matrix in zip(outlines(axes), scales, (np.linalg.inv(squares), squares), strict=True):
        values = (outline - one.pose[:2]) / scale
        assert_allclose(np.einsum("ki,ij,kj->k", values, matrix, values), 1.0, atol=1e-9)


def test_at_a_singularity_velocities_are_a_line_and_forces_are_cut_off_where_the_legend_says():
    (axes,), labels = drawn(found("planar_2link", [0, 0]))
    velocity, force = outlines(axes)
    assert_allclose(velocity[:, 0], 2.0, atol=1e-12)
    cut = float(re.search(r"cut off at ([0-9.]+) m", " ".join(labels))[1])
    assert np.ptp(force[:, 0]) / 2 == pytest.approx(cut)


def test_the_shadow_of_a_spatial_ellipsoid():
    (one,) = found("stanford", [0.3, 1.0, 0.6, 0.7, 0.5, 0.2])
    velocity, _ = ellipses(one, [0, 2])
    whole = one.ellipsoids[0]
    # The shadow along an axis is as wide as the ellipsoid: the root of the diagonal of J J^T.
    for row, world in ((0, 0), (1, 2)):
        width = np.linalg.norm(velocity.axes[row] * velocity.half_axes)
        assert width == pytest.approx(
            np.linalg.norm(whole["directions"][:, world] * whole["velocity"]), abs=1e-12
        )


def test_several_configurations_are_numbered_and_get_lighter_but_stay_gray():
    (axes,), labels = drawn(found("planar_2link", [1.2, -2.4], [0.5, -1.0], [0.0, 0.0]))
    assert [text.get_text() for text in axes.texts] == ["1", "2", "3"]
    assert labels[2:] == [
        "base",
        "joint",
        "site",
        "1: $q$ = 1.200, -2.400",
        "2: $q$ = 0.5000, -1.000",
        "3: $q$ = 0, 0",
    ]
    shades = [to_rgb(line.get_color()) for line in lines(axes, "-", 4)]
    assert [shade[0] for shade in shades] == sorted({shade[0] for shade in shades}) and len(shades) == 3
    assert all(len(set(shade)) == 1 and shade[0] < 0.6 for shade in shades)


def test_a_site_that_only_turns_has_no_ellipses():
    for axes in drawn(found("spherical_wrist", [0.3, 0.4, 0.5], site="center"))[0]:
        assert all(np.ptp(outline, axis=0).max() < 1e-12 for outline in outlines(axes))


def test_files_are_whole_and_equal_for_equal_questions(tmp_path):
    for name in ("new/a.png", "new/a.svg", "new/b.svg"):
        draw_arm(found("planar_2link", [0.3, 0.4]), tmp_path / name)
    assert (tmp_path / "new/a.svg").read_bytes() == (tmp_path / "new/b.svg").read_bytes()
    assert ">planar_2link.xml, site tip<" in (tmp_path / "new/a.svg").read_text("utf-8")
