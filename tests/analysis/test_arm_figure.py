"""The picture of an arm: where it is, where its ellipses are, and how large they are."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rmrc
from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.inspect.figure import draw_arm, figure, moving_planes


def found(name, q, site=None):
    return rmrc.inspect(arms.load(ROOT / f"models/{name}.xml", site), q)


def drawn(inspection):
    """Return the lines of each panel: velocity, force, the arm, its site; and the texts of the legend."""
    picture = figure(inspection)
    lines = [[line.get_xydata() for line in axes.lines] for axes in picture.axes]
    return lines, " ".join(text.get_text() for text in picture.legends[0].get_texts())


def test_a_planar_arm_is_drawn_in_its_plane_and_others_in_two():
    planes = {path.stem: moving_planes(arms.load(path)) for path in sorted((ROOT / "models").glob("*.xml"))}
    planar = {"planar_2link", "planar_3link", "planar_6_3", "planar_rp", "selig_211"}
    assert {name for name, both in planes.items() if both == [[0, 1]]} == planar
    assert planes["stanford"] == planes["spherical_wrist"] == [[0, 1], [0, 2]]


def test_the_stick_figure_joins_base_joints_and_site():
    ((_, _, stick, _),), _ = drawn(found("planar_2link", [0.4, 0.7]))
    elbow, tip = [np.cos(0.4), np.sin(0.4)], [np.cos(0.4) + np.cos(1.1), np.sin(0.4) + np.sin(1.1)]
    assert_allclose(stick, [[0, 0], [0, 0], elbow, tip], atol=1e-12)


def test_ellipses_are_around_the_tip_with_the_scale_of_the_legend():
    one = found("planar_2link", [0.4, 1.2])
    (outlines,), words = drawn(one)
    scales = [float(re.search(rf"1 {unit} is ([0-9.]+) m", words)[1]) for unit in ("m/s", "N")]
    squares = one.jacobian[:2] @ one.jacobian[:2].T
    # xi^T (J J^T)^-1 xi = 1, and F^T (J J^T) F = 1
    for outline, scale, matrix in zip(outlines[:2], scales, (np.linalg.inv(squares), squares), strict=True):
        values = (outline - one.pose[:2]) / scale
        assert_allclose(np.einsum("ki,ij,kj->k", values, matrix, values), 1.0, atol=1e-9)


def test_at_a_singularity_velocities_are_a_line_and_forces_are_cut_off_where_the_legend_says():
    ((velocity, force, *_),), words = drawn(found("planar_2link", [0, 0]))
    assert_allclose(velocity[:, 0], 2.0, atol=1e-12)
    cut = float(re.search(r"cut off at ([0-9.]+) m", words)[1])
    assert np.ptp(force[:, 0]) / 2 == pytest.approx(cut)


def test_a_site_that_only_turns_has_no_ellipses():
    for velocity, force, *_ in drawn(found("spherical_wrist", [0.3, 0.4, 0.5], "center"))[0]:
        assert np.ptp(velocity, axis=0).max() < 1e-12 and np.ptp(force, axis=0).max() < 1e-12


def test_files_are_whole_and_equal_for_equal_questions(tmp_path):
    for name in ("new/a.png", "new/a.svg", "new/b.svg"):
        draw_arm(found("planar_2link", [0.3, 0.4]), tmp_path / name)
    assert (tmp_path / "new/a.svg").read_bytes() == (tmp_path / "new/b.svg").read_bytes()
    assert ">planar_2link.xml, site tip<" in (tmp_path / "new/a.svg").read_text("utf-8")
