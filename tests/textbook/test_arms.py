"""Printed arms: positions, Jacobians, determinants and singular families against DH tables and differences."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from differences import DIFFERENCE, slopes
from rmrc.textbook import planar, six_joint, spatial
from rmrc.textbook import two_link as two
from rmrc.textbook.chains import DHChain

# Products of six rotations and lengths of order one.
ROUNDING = 1e-12


class Arm(NamedTuple):
    """An arm as it is printed; each function takes lengths and joint positions.

    Attributes:
        joints: Their number.
        sizes: The least and the largest of each length.
        position: Of the tip; its first coordinates are lengths.
        jacobian: As printed.
        rows: Those of x, y, z, rx, ry, rz that it has.
        determinant: Of the first rows, as many as joints.
        table: Lengths to the DH chain, the tip in its last frame, and the rates of its joints from those of the arm.
    """

    joints: int
    sizes: tuple
    position: Callable
    jacobian: Callable
    rows: tuple
    determinant: Callable | None
    table: Callable


def chain_of_links(lengths):
    """A planar arm as a modified DH table."""
    rows = tuple((0.0, a, 0.0, 0.0) for a in [0.0, *lengths[:-1]])
    return DHChain(rows, ("revolute",) * len(lengths)), (lengths[-1], 0, 0), np.eye(len(lengths))


def screw_as_hinge_and_slide(lengths):
    rows = ((0, 0, 0, 0), (0, 0, 0, np.pi / 2), (np.pi / 2, 0, 0, 0), (0, 0, 0, 0))
    coupling = np.array([[1, 0, 0], [lengths[0], 0, 0], [0, 1, 0], [0, 0, 1]])
    return DHChain(rows, ("revolute", "prismatic", "prismatic", "revolute")), (lengths[1], 0, 0), coupling


def stanford_wrist(lengths, q):
    """d₂ z₂ + d₃ z₃, as the notes have it."""
    c1, c2, s1, s2, d2, d3 = *np.cos(q[..., :2].T), *np.sin(q[..., :2].T), lengths[0], q[..., 2]
    return np.stack([c1 * s2 * d3 - s1 * d2, s1 * s2 * d3 + c1 * d2, c2 * d3], axis=-1)


EVERY, PLANE = (0, 1, 2, 3, 4, 5), (0, 1, 5)
LINK = (0.1, 2.0)
ARMS = {
    "2 links": Arm(2, (LINK,) * 2, two.two_link_position, two.two_link_jacobian, (0, 1), two.two_link_determinant,
                   chain_of_links),
    "3 links": Arm(3, (LINK,) * 3, planar.three_link_position, planar.three_link_jacobian, PLANE,
                   lambda lengths, q: two.two_link_determinant(lengths[:2], q[..., :2]), chain_of_links),
    "5 links": Arm(5, (LINK,) * 5, planar.planar_position, planar.planar_jacobian, PLANE, None, chain_of_links),
    "RP": Arm(2, ((0.0, 2.0),), lambda size, q: planar.planar_rp_position(q, size[0]),
              lambda size, q: planar.planar_rp_jacobian(q, size[0]), PLANE, lambda size, q: planar.planar_rp_determinant(q, size[0]),
              lambda size: (planar.planar_rp_chain(), (0, 0, size[0]), np.eye(2))),
    "anthropomorphic": Arm(3, (LINK,) * 2, spatial.anthropomorphic_position, spatial.anthropomorphic_jacobian,
                           EVERY, spatial.anthropomorphic_determinant,
                           lambda size: (spatial.anthropomorphic_chain(size), (0, 0, 0), np.eye(3))),
    "torus": Arm(3, (LINK,) * 3, spatial.torus_position, spatial.torus_jacobian, EVERY, spatial.torus_determinant,
                 lambda size: (spatial.torus_chain(size), (size[2], 0, 0), np.eye(3))),
    "helical": Arm(3, ((-0.3, 0.3), LINK), lambda size, q: spatial.helical_position(*size, q),
                   lambda size, q: spatial.helical_jacobian(*size, q), EVERY, lambda size, q: spatial.helical_determinant(*size, q),
                   screw_as_hinge_and_slide),
    "stanford": Arm(6, ((-0.5, 0.5),), stanford_wrist, lambda size, q: six_joint.stanford_jacobian(q, size[0]), EVERY,
                    lambda _, q: six_joint.stanford_determinant(q),
                    lambda size: (six_joint.stanford_chain(size[0]), (0, 0, 0), np.eye(6))),
    "puma": Arm(6, (), lambda _, q: six_joint.puma_wrist_position(q), lambda _, q: six_joint.puma_chain().jacobian(q), EVERY,
                lambda _, q: six_joint.puma_determinant(q), lambda _: (six_joint.puma_chain(), (0, 0, 0), np.eye(6))),
}  # fmt: skip

every_arm = pytest.mark.parametrize("name", ARMS)


def drawn(arm, count=20):
    rng = np.random.default_rng(0)
    low, high = np.array(arm.sizes).reshape(-1, 2).T
    return [(rng.uniform(low, high), rng.uniform(-3.1, 3.1, arm.joints)) for _ in range(count)]


def check_table(arm, jacobian):
    for lengths, q in drawn(arm):
        chain, tip, coupling = arm.table(lengths)
        at = chain.frames(coupling @ q)[-1] @ [*tip, 1.0]
        width = sum(row < 3 for row in arm.rows)
        assert_allclose(arm.position(lengths, q)[:width], at[:width], atol=ROUNDING)
        J = chain.jacobian(coupling @ q, point=tip) @ coupling
        assert_allclose(jacobian(lengths, q), J[list(arm.rows)], atol=ROUNDING)


@every_arm
def test_position_and_jacobian_are_those_of_the_table(name):
    check_table(ARMS[name], ARMS[name].jacobian)


@pytest.mark.parametrize("name", [name for name, arm in ARMS.items() if arm.determinant])
def test_determinant_is_its_closed_form(name):
    arm = ARMS[name]
    for lengths, q in drawn(arm):
        expected = np.linalg.det(arm.jacobian(lengths, q)[: arm.joints])
        # Products of six entries of at most 6 m.
        assert_allclose(arm.determinant(lengths, q), expected, atol=100 * ROUNDING)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("5 links", lambda size, q: planar.planar_jacobian(size, np.diff(q, prepend=0.0))),  # absolute angles
        ("RP", lambda _, q: planar.planar_rp_jacobian(q)),  # a reach of 1 m
        ("anthropomorphic", lambda size, q: ARMS["anthropomorphic"].jacobian(size, q - [np.pi / 2, 0, 0])),
        ("torus", lambda size, q: spatial.torus_jacobian(size * [0, 1, 1], q)),  # which is the arm above
        ("helical", lambda size, q: spatial.helical_jacobian(0.0, size[1], q)),
        ("stanford", lambda size, q: six_joint.stanford_jacobian(q, -size[0])),
    ],
)  # fmt: skip
def test_another_jacobian_is_seen(name, wrong):
    """Negative control."""
    with pytest.raises(AssertionError):
        check_table(ARMS[name], wrong)


# Singular families -------------------------------------------------------------------------------


def puma_at(elbow=2.97, wrist=0.52):
    return np.array([*np.radians([10.0, -50]), elbow, np.radians(20), wrist, np.radians(40)])


# a₃ = −R sin δ, d₄ = R cos δ; the shoulder is singular where a₂ c₂ + R sin(θ₂₃ − δ) = 0.
ELBOW, DELTA = (
    np.hypot(six_joint.ELBOW_OFFSET, six_joint.FOREARM),
    np.arctan2(-six_joint.ELBOW_OFFSET, six_joint.FOREARM),
)
SHOULDER = DELTA - np.arcsin(six_joint.UPPER_ARM * np.cos(np.radians(50)) / ELBOW) + np.radians(50)
STRETCHED = np.arctan2(six_joint.FOREARM, six_joint.ELBOW_OFFSET)
TIP_ON_WAIST = np.arccos(-0.4 / 0.6) - np.pi / 3  # 0.8 cos 60° + 0.6 cos(60° + θ₃) = 0
HELICAL = spatial.helical_singular_crank(0.1, 0.8)


@pytest.mark.parametrize(
    ("name", "lengths", "q", "rank"),
    [
        ("RP", [1.0], [0.4, 0.3], 2),
        ("RP", [1.0], [0.4, -1.0], 1),  # on the pivot
        ("anthropomorphic", [0.8, 0.6], np.radians([20, 70, -100]), 3),
        ("anthropomorphic", [0.8, 0.6], np.radians([20, 70, 0]), 2),
        ("anthropomorphic", [0.8, 0.6], np.radians([20, 70, 180]), 2),
        ("anthropomorphic", [0.8, 0.6], [0.3, np.pi / 3, TIP_ON_WAIST], 2),
        ("anthropomorphic", [0.8, 0.6], np.radians([20, 90, 0]), 1),  # stretched straight up
        ("stanford", [0.154], [0.3, 1.0, 0.6, 0.7, 0.9, 0.2], 6),
        ("stanford", [0.154], [0.3, 0.0, 0.6, 0.7, 0.9, 0.2], 5),
        ("stanford", [0.154], [0.3, 1.0, 0.6, 0.7, 0.0, 0.2], 5),
        # d₃² is a double zero, but only one column, ∂p/∂θ₂, vanishes: d₂ keeps the other.
        ("stanford", [0.154], [0.3, 1.0, 0.0, 0.7, 0.9, 0.2], 5),
        # Two families at once cost two ranks only where z₅ is parallel to z₂.
        ("stanford", [0.154], [0.3, 0.0, 0.6, 0.0, 0.0, 0.2], 4),
        ("stanford", [0.154], [0.3, 0.0, 0.6, 0.7, 0.0, 0.2], 5),
        ("puma", [], puma_at(), 6),
        ("puma", [], puma_at(elbow=SHOULDER), 5),
        ("puma", [], puma_at(elbow=STRETCHED), 5),
        ("puma", [], puma_at(elbow=STRETCHED - np.pi), 5),
        ("puma", [], puma_at(wrist=0.0), 5),
        ("torus", [1.2, 0.6, 0.5], [0.3, 0.7, -0.9], 3),
        ("torus", [1.2, 0.6, 0.5], [0.3, 0.7, np.pi], 2),
        # the tip on the first axis: l₁ + l₂ c₂ + l₃ c₂₃ = 0
        ("torus", [0.4, 0.6, 0.5], [0.3, 2.9, np.arccos(-(0.4 + 0.6 * np.cos(2.9)) / 0.5) - 2.9], 2),
        ("helical", [0.1, 0.4], [0.5, 0.8, HELICAL], 2),
        ("helical", [0.1, 0.4], [0.5, 0.8, HELICAL + np.pi], 2),
        ("helical", [0.1, 0.4], [0.5, 0.8, 0.0], 3),  # the pitch tilts it
    ],
)  # fmt: skip
def test_each_factor_of_a_determinant_is_a_family_of_singularities(name, lengths, q, rank):
    arm, q = ARMS[name], np.array(q)
    assert np.linalg.matrix_rank(arm.jacobian(np.array(lengths), q)[: arm.joints], tol=1e-9) == rank
    assert (abs(arm.determinant(np.array(lengths), q)) > 1e-9) == (rank == arm.joints)


def test_gravity_torques_of_the_puma_are_the_slope_of_a_potential():
    """Whatever the constants: this fails for a wrong sign or factor in any entry."""
    g = np.array([-37.2, -8.44, 1.02, 0.249, -0.0282])

    def potential(q):
        s2, c2, s23, c23 = (f(x) for x in (q[..., 1], q[..., 1] + q[..., 2]) for f in (np.sin, np.cos))
        hand = -c23 * np.cos(q[..., 4]) + s23 * np.cos(q[..., 3]) * np.sin(q[..., 4])
        return (np.stack([s2, -c23, -c2, s23, hand], axis=-1) @ g)[..., None]

    for _, q in drawn(ARMS["puma"]):
        # Third derivatives of up to 40 N·m.
        assert_allclose(six_joint.puma_gravity_torques(g, q), slopes(potential, q)[0], atol=10 * DIFFERENCE)


# Wrists ------------------------------------------------------------------------------------------


def three_roll(q, tilt):
    second = Rotation.from_euler("ZYZ", [q[0], tilt[0], q[1]])
    return second * Rotation.from_euler("YZ", [-tilt[1], q[2]])


def angular_velocities(rotation, q):
    """ω of a unit rate of each joint, from the rotation a little later and a little before."""
    turns = [rotation(q + step) * rotation(q - step).inv() for step in 1e-6 * np.eye(3)]
    return np.array([turn.as_rotvec() for turn in turns]).T / 2e-6


def test_printed_columns_of_both_wrists_turn_the_hand():
    chain, rng = spatial.spherical_wrist_chain(), np.random.default_rng(0)
    for _ in range(20):
        q, tilt = rng.uniform(-3.1, 3.1, 3), rng.uniform(0.1, 3.0, 2)
        assert_allclose(chain.frames(q)[3, :3, :3], Rotation.from_euler("ZYZ", q).as_matrix(), atol=ROUNDING)
        J = spatial.spherical_wrist_jacobian(q)
        assert_allclose(chain.jacobian(q), np.vstack([np.zeros((3, 3)), J]), atol=ROUNDING)
        rolls = spatial.three_roll_jacobian(q, tilt)
        turning = angular_velocities(lambda q: three_roll(q, tilt), q)  # noqa: B023
        assert_allclose(rolls, turning, atol=DIFFERENCE)
        assert np.abs(spatial.three_roll_jacobian(q, tilt * [1, -1]) - turning).max() > 1e-3
        determinants = (
            spatial.spherical_wrist_determinant(q),
            spatial.three_roll_determinant(q, tilt),
        )
        assert_allclose(determinants, np.linalg.det([J, rolls]), atol=ROUNDING)


@pytest.mark.parametrize(("theta2", "rank"), [(0.0, 2), (np.pi, 2), (1.0, 3)])
def test_wrists_are_singular_where_theta_2_is_k_pi(theta2, rank):
    q = np.array([0.3, theta2, 0.7])
    rolls = [spatial.three_roll_jacobian(q, tilt) for tilt in ([1.0, 1.0], [1.0, 0.8])]
    for J in (spatial.spherical_wrist_jacobian(q), *rolls):
        assert np.linalg.matrix_rank(J, tol=1e-9) == rank
    # Only equal tilts align the first and the third axis; else they are |β − γ| apart.
    if theta2 == 0.0:
        assert [J[:, 0] @ J[:, 2] for J in rolls] == pytest.approx([1.0, np.cos(0.2)], abs=ROUNDING)
