"""The picture of an arm: where it is, where its ellipses are, and that it can be read without colors."""

import re

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread
from numpy.testing import assert_allclose

from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.inspect.figure import MARKS, draw_arm, ellipses, figure, moving_planes, skeleton
from rmrc.analysis.inspect.inspection import inspect


def found(name, *configurations, site=None):
    arm = arms.load(ROOT / f"models/{name}.xml", site)
    return [inspect(arm, q) for q in configurations]


def lines(axes, style):
    return [line for line in axes.lines if line.get_linestyle() == style and len(line.get_xdata()) > 1]


def test_a_planar_arm_is_drawn_in_its_plane_and_others_in_two(tmp_path):
    planes = {path.stem: moving_planes(arms.load(path)) for path in sorted((ROOT / "models").glob("*.xml"))}
    assert {name for name, drawn in planes.items() if len(drawn) == 1} == {
        "planar_2link",
        "planar_3link",
        "planar_6_3",
        "planar_rp",
        "selig_211",
    }
    assert planes["planar_2link"] == [[0, 1]] and planes["stanford"] == [[0, 1], [0, 2]]
    upright = '<mujoco><worldbody><body><joint name="a" axis="0 1 0"/><geom size="0.1"/><site name="s" pos="1 0 0"/></body></worldbody></mujoco>'
    (tmp_path / "upright.xml").write_text(upright)
    assert moving_planes(arms.load(tmp_path / "upright.xml")) == [[0, 2]]
    (tmp_path / "tilted.xml").write_text(upright.replace('axis="0 1 0"', 'axis="0 1 1"'))
    assert moving_planes(arms.load(tmp_path / "tilted.xml")) == [[0, 1], [0, 2]]


def test_the_stick_figure_joins_base_joints_and_site():
    (one,) = found("planar_2link", [0.4, 0.7])
    elbow, tip = [np.cos(0.4), np.sin(0.4)], [np.cos(0.4) + np.cos(1.1), np.sin(0.4) + np.sin(1.1)]
    stick = skeleton(one)
    assert_allclose(stick[:, :2], [[0, 0], [0, 0], elbow, tip], atol=1e-12)
    drawn = figure([one]).axes[0].lines
    assert any(np.array_equal(line.get_xydata(), stick[:, :2]) for line in drawn)


def test_ellipses_are_around_the_tip_with_the_scale_of_the_legend():
    (one,) = found("planar_2link", [0.4, 1.2])
    picture = figure([one])
    (axes,) = picture.axes
    labels = [text.get_text() for text in picture.legends[0].get_texts()]
    velocity, force = (re.search(rf"1 {unit} is ([0-9.]+) m", " ".join(labels)) for unit in ("m/s", "N"))
    J = one.jacobian[:2]
    (outline,) = [line.get_xydata() for line in lines(axes, "-") if len(line.get_xdata()) > 10]
    speeds = (outline - one.pose[:2]) / float(velocity[1])
    # xi^T (J J^T)^-1 xi = 1, and F^T (J J^T) F = 1
    assert_allclose(np.einsum("ki,ij,kj->k", speeds, np.linalg.inv(J @ J.T), speeds), 1.0, atol=1e-9)
    (outline,) = [line.get_xydata() for line in lines(axes, "--")]
    forces = (outline - one.pose[:2]) / float(force[1])
    assert_allclose(np.einsum("ki,ij,kj->k", forces, J @ J.T, forces), 1.0, atol=1e-9)


def test_at_a_singularity_velocities_are_a_line_and_forces_are_cut_off_where_the_legend_says():
    (one,) = found("planar_2link", [0, 0])
    picture = figure([one])
    labels = " ".join(text.get_text() for text in picture.legends[0].get_texts())
    (axes,) = picture.axes
    (velocity,) = [line.get_xydata() for line in lines(axes, "-") if len(line.get_xdata()) > 10]
    (force,) = [line.get_xydata() for line in lines(axes, "--")]
    assert_allclose(velocity[:, 0], 2.0, atol=1e-12)
    assert np.ptp(force[:, 0]) / 2 == pytest.approx(float(re.search(r"cut off at ([0-9.]+) m", labels)[1]))


def test_the_shadow_of_a_spatial_ellipsoid():
    (one,) = found("stanford", [0.3, 1.0, 0.6, 0.7, 0.5, 0.2])
    velocity, _ = ellipses(one, [0, 2])
    whole = one.ellipsoids[0].velocity
    # The shadow along an axis is as wide as the ellipsoid: the root of the diagonal of J J^T.
    for row, world in ((0, 0), (1, 2)):
        width = np.linalg.norm(velocity.axes[row] * velocity.half_axes)
        assert width == pytest.approx(np.linalg.norm(whole.axes[world] * whole.half_axes), abs=1e-12)


def test_several_configurations_are_numbered_and_get_lighter_but_stay_gray():
    picture = figure(found("planar_2link", [1.2, -2.4], [0.5, -1.0], [0.0, 0.0]))
    (axes,) = picture.axes
    assert [text.get_text() for text in axes.texts] == ["1", "2", "3"]
    labels = [text.get_text() for text in picture.legends[0].get_texts()]
    assert labels[-3:] == ["1: $q$ = 1.200, -2.400", "2: $q$ = 0.5000, -1.000", "3: $q$ = 0, 0"]
    shades = [to_rgb(line.get_color()) for line in lines(axes, "-") if len(line.get_xdata()) == 4]
    assert [shade[0] for shade in shades] == sorted({shade[0] for shade in shades}) and len(shades) == 3
    assert all(len(set(shade)) == 1 and shade[0] < 0.6 for shade in shades)


def test_words_name_model_site_axes_units_and_kinds():
    picture = figure(found("helical", [0.5, 0.7, 0.2]))
    assert [(axes.get_xlabel(), axes.get_ylabel()) for axes in picture.axes] == [
        ("$x$ [m]", "$y$ [m]"),
        ("$x$ [m]", "$z$ [m]"),
    ]
    assert picture.get_suptitle() == "helical.xml, site tip"
    labels = [text.get_text() for text in picture.legends[0].get_texts()]
    assert labels[:5] == ["base", *MARKS, "site"]
    assert all(axes.get_aspect() == 1.0 for axes in picture.axes)


def test_a_site_that_only_turns_has_no_ellipses():
    picture = figure(found("spherical_wrist", [0.3, 0.4, 0.5], site="center"))
    assert all(not lines(axes, "--") for axes in picture.axes)
    picture.draw_without_rendering()


def test_files_are_whole_and_equal_for_equal_questions(tmp_path):
    for name in ("new/a.png", "new/a.svg"):
        draw_arm(found("planar_2link", [0.3, 0.4]), tmp_path / name)
    before = (tmp_path / "new/a.svg").read_bytes()
    draw_arm(found("planar_2link", [0.3, 0.4]), tmp_path / "new/a.svg")
    assert (tmp_path / "new/a.svg").read_bytes() == before
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["a.png", "a.svg"]
    picture = imread(tmp_path / "new/a.png")
    assert picture.shape[0] > 500 and picture[..., :3].min() < 0.5
    assert ">planar_2link.xml, site tip<" in (tmp_path / "new/a.svg").read_text("utf-8")
