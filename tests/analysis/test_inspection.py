"""What an inspection says is so: against closed forms, defining equations, finite differences and MuJoCo."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import rmrc
from chains import random_chain, seeds
from project import ROOT
from rmrc import arm as arms
from rmrc.analysis import inspection, singular_directions
from rmrc.analysis.inspection import inspect_arm
from rmrc.control.law import SINGULAR_BELOW
from rmrc.errors import QuestionError
from rmrc.spatial import AXES, quat_to_matrix
from rmrc.textbook.euler import zyz_angles

# Sums of some dozen products of the size of meters.
ROUNDING = 1e-12
# A null vector of a matrix of rank r is as exact as rounding over the gap, σ_r/σ_1; chains with a smaller gap
# than 1e-3 are left out.
NULL = 1e-11

WRENCH = np.array([3.0, -2.0, 7.0, 0.4, -0.6, 0.9])


def model(name, site=None):
    return arms.load(ROOT / f"models/{name}.xml", site)


def chain_of(folder, seed):
    path = folder.mktemp("chain") / "chain.xml"
    path.write_text(random_chain(seed))
    return arms.load(path)


# Known values ------------------------------------------------------------------------------------


@pytest.mark.parametrize("site", ["wrist", "tool"])
def test_determinant_of_the_stanford_arm_is_the_notes_at_both_sites_and_in_all_frames(site):
    arm = model("stanford", site)
    for q in arm.sampled(5):
        closed = q[2] ** 2 * np.sin(q[1]) * np.sin(q[4])
        for frame in ("world", "site", "base"):
            found = inspect_arm(arm, q, frame=frame)
            assert found.determinant == pytest.approx(closed, abs=ROUNDING)
            assert np.linalg.det(found.jacobian) == pytest.approx(closed, abs=ROUNDING)


def test_the_wrist_of_the_notes():
    s1, c1, s2, c2 = np.sin(0.4), np.cos(0.4), np.sin(0.9), np.cos(0.9)
    found = inspect_arm(model("spherical_wrist", "center"), [0.4, 0.9, -0.3])
    assert found.task.axes == ("rx", "ry", "rz")
    assert_allclose(found.jacobian[3:].T, [(0, 0, 1), (-s1, c1, 0), (c1 * s2, s1 * s2, c2)], atol=ROUNDING)
    assert found.determinant == pytest.approx(-s2, abs=ROUNDING)
    # Its joints are the Z-Y-Z angles, so that E is its Jacobian.
    assert_allclose(found.E, found.jacobian[3:], atol=ROUNDING)
    assert_allclose(found.analytic_jacobian[3:], np.eye(3), atol=ROUNDING)


def test_errors_of_the_notes_planar_arm():
    # l = (1, 0.8, 0.6): at home no error along x, and 0.1 rad at the second joint gives 0.1 (l2 + l3) along y.
    found = inspect_arm(model("planar_3link"), [0, 0, 0], joint_error=[0, 0.1, 0])
    assert_allclose(found.tip_error.deviation, [0, 0.14, 0, 0, 0, 0.1], atol=ROUNDING)
    found = inspect_arm(model("planar_3link"), [0, np.pi / 2, 0], joint_error=[0, 0.1, 0])
    assert_allclose(found.tip_error.deviation, [0.14, 0, 0, 0, 0, 0.1], atol=ROUNDING)
    assert_allclose(found.tip_error.worst_translation, [0.14, 0, 0], atol=ROUNDING)
    assert_allclose(found.tip_error.worst_rotation, [0, 0, 0.1], atol=ROUNDING)


# Lost directions ---------------------------------------------------------------------------------

WORDS = {
    "2-link, straight": (
        ("planar_2link", "tip", [0, 0]),
        ["cannot move along x; a force along x asks for no torque"],
        ["shoulder and elbow turn against each other, 1 : -2, without moving x and y of the site, which turns about -z"],
    ),
    "2-link, turned": (
        ("planar_2link", "tip", [np.pi / 4, 0]),
        ["cannot move along (0.71, 0.71, 0); a force along (0.71, 0.71, 0) asks for no torque"],
        ["shoulder and elbow turn against each other, 1 : -2, without moving x and y of the site, which turns about -z"],
    ),
    "3-link, at its wrist point": (
        ("planar_3link", "wrist", [np.pi / 2, 0, 1]),
        ["cannot move along y; a force along y asks for no torque"],
        ["shoulder, elbow and wrist turn, 1 : -2.25 : 1.25, without moving the site"],
    ),
    "3-link, at its tip": (
        ("planar_3link", "tip", [0, 0, np.pi / 2]),
        [
            "cannot turn about z in place, nor move along x without turning; a force along x with a moment "
            "about z, 0.86 N to 0.51 N m, asks for no torque"
        ],
        ["shoulder, elbow and wrist turn, 1 : -2.25 : 1.25, without moving the site"],
    ),
    "anthropomorphic, straight": (
        ("anthropomorphic", "tip", [0, 0, 0]),
        ["cannot move along y; a force along y asks for no torque"],
        ["shoulder and elbow turn against each other, 1 : -2.33, without moving x, y and z of the site, which turns about x"],
    ),
    "anthropomorphic, upright": (
        ("anthropomorphic", "tip", [0, np.pi / 2, 0]),
        [
            "cannot move along x; a force along x asks for no torque",
            "cannot move along z; a force along z asks for no torque",
        ],
        [
            "waist turns alone without moving x, y and z of the site, which turns about z",
            "shoulder and elbow turn against each other, 1 : -2.33, without moving x, y and z of the site, which turns about x",
        ],
    ),
    "wrist": (
        ("spherical_wrist", "center", [0.0, 0.0, 0.7]),
        ["cannot turn about x; a moment about x asks for no torque"],
        ["theta_1 and theta_3 turn against each other, 1 : -1, without moving the site"],
    ),
    "stanford, its wrist": (
        ("stanford", "wrist", [0.0, np.pi / 2, 0.6, 0.0, 0.0, 0.2]),
        # Axes 4 and 6 lie along x, axis 5 along y, and the boom points along x, 0.154 m beside the first axis.
        [
            "cannot turn about z in place, nor move along y without turning; a force along y with a moment "
            "about z, 0.86 N to 0.51 N m, asks for no torque"
        ],
        ["theta_4 and theta_6 turn against each other, 1 : -1, without moving the site"],
    ),
    "stanford, its boom": (
        ("stanford", "wrist", [0.0, 0.0, 0.6, 0.0, np.pi / 2, 0.2]),
        ["cannot move along y; a force along y asks for no torque"],
        ["theta_1, theta_2 and theta_4 move ..."],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WORDS)
def test_words_at_singularities(case):
    (name, site, q), lost, standing = WORDS[case]
    found = inspect_arm(model(name, site), q)
    assert [one.words for one in found.lost] == lost
    assert [one.words for one in found.standing] == standing
