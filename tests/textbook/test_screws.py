"""Screws against scipy's matrix exponential, against DH chains, and against differences of poses."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from rmrc.support.errors import ModelError
from rmrc.textbook.dh import DHChain
from rmrc.textbook.screws import (
    exp_screw,
    geometric_from_screws,
    joint_screw,
    product_of_exponentials,
    space_jacobian,
    transform_screw,
)

# A few dozen products of order ten.
ROUNDING = 1e-12
# Central differences of step 1e-5: truncation (1e-5)²/6 times a third derivative of a few meters, rounding 1e-16/1e-5.
DIFFERENCE = 1e-8
STEP = 1e-5

seeds = st.integers(0, 2**32 - 1)
PITCHES = [0.0, 0.3, -0.2, np.inf]


def matrix_of(screw):
    """The 4x4 matrix of a screw, written out here."""
    wx, wy, wz, vx, vy, vz = screw
    return np.array([[0, -wz, wy, vx], [wz, 0, -wx, vy], [-wy, wx, 0, vz], [0, 0, 0, 0.0]])


def random_arm(seed, pitches=PITCHES):
    rng = np.random.default_rng(seed)
    n = rng.integers(1, 7)
    axes, points = rng.normal(size=(n, 3)), rng.uniform(-1, 1, (n, 3))
    home = np.eye(4)
    home[:3, :3], home[:3, 3] = Rotation.from_rotvec(rng.normal(size=3)).as_matrix(), rng.uniform(-1, 1, 3)
    return joint_screw(axes, points, rng.choice(pitches, n)), rng.uniform(-2, 2, n), home


@given(seeds, st.sampled_from([0.0, 1e-300, 1e-12, 1e-8, 1e-4, 0.03, 1.0, 3.0, np.pi, 7.0]))
def test_motion_along_a_screw_is_the_matrix_exponential(seed, angle):
    rng = np.random.default_rng(seed)
    for screw in (
        joint_screw(*rng.normal(size=(2, 3)), rng.choice(PITCHES)),
        rng.normal(size=6),
        np.array([0, 0, 0, *rng.normal(size=3)]),
    ):
        assert_allclose(exp_screw(screw, angle), expm(matrix_of(screw) * angle), atol=ROUNDING)


@given(seeds, st.sampled_from(PITCHES), st.floats(-4, 4))
def test_motion_of_a_joint_is_a_turn_about_its_axis_and_an_advance_along_it(seed, pitch, q):
    """The notes: t = (p θ / 2π) v̂ + (I − R) u; a slide is all advance."""
    axis, u = np.random.default_rng(seed).normal(size=(2, 3))
    z = axis / np.linalg.norm(axis)
    R = np.eye(3) if np.isinf(pitch) else Rotation.from_rotvec(q * z).as_matrix()
    advance_a_turn = 2 * np.pi * pitch
    t = q * z if np.isinf(pitch) else advance_a_turn * q / (2 * np.pi) * z + (np.eye(3) - R) @ u
    T = exp_screw(joint_screw(axis, u, pitch), q)
    assert_allclose(T, np.vstack([np.column_stack([R, t]), [0, 0, 0, 1]]), atol=ROUNDING)


@given(seeds, st.sampled_from(PITCHES))
def test_transformed_screw_is_that_of_the_joint_where_it_was_moved_to(seed, pitch):
    rng = np.random.default_rng(seed)
    axis, u, t, turn = rng.normal(size=(4, 3))
    R = Rotation.from_rotvec(turn).as_matrix()
    moved = transform_screw(joint_screw(axis, u, pitch), R, t)
    assert_allclose(moved, joint_screw(R @ axis, R @ u + t, pitch), atol=ROUNDING)


def test_screw_transformed_by_the_inverse_or_by_the_matrix_of_twists_is_seen():
    axis, u, t, turn = np.random.default_rng(3).normal(size=(4, 3))
    R, screw = Rotation.from_rotvec(turn).as_matrix(), joint_screw(axis, u, 0.3)
    holds = joint_screw(R @ axis, R @ u + t, 0.3)
    T = matrix_of([*t, 0, 0, 0])[:3, :3]
    upper = np.block([[R, T @ R], [np.zeros((3, 3)), R]])  # that of [v; ω]
    for wrong in (transform_screw(screw, R.T, -R.T @ t), upper @ screw):
        assert np.abs(wrong - holds).max() > 1e-3


def space_columns_by_differences(pose, q):
    """[ω; v at the origin] of each joint: Ṫ T⁻¹ by central differences."""
    columns = []
    for step in STEP * np.eye(len(q)):
        spin = (pose(q + step) - pose(q - step)) / (2 * STEP) @ np.linalg.inv(pose(q))
        columns.append([spin[2, 1], spin[0, 2], spin[1, 0], *spin[:3, 3]])
    return np.transpose(columns)


@given(seeds)
def test_space_jacobian_is_the_derivative_of_the_product_of_exponentials(seed):
    screws, q, home = random_arm(seed)
    expected = space_columns_by_differences(lambda x: product_of_exponentials(screws, x, home), q)
    # Six screws of reach 2 with pitches: third derivatives of up to 100 meters.
    assert_allclose(space_jacobian(screws, q), expected, atol=5e-8)


def random_table(seed):
    """A modified DH chain, a tip in its last frame, and a configuration."""
    rng = np.random.default_rng(seed)
    n = rng.integers(1, 7)
    rows = rng.uniform(-1, 1, (n, 4)) * [np.pi, 1, 1, np.pi]
    kinds = rng.choice(["revolute", "prismatic"], n)
    return tuple(map(tuple, rows)), tuple(map(str, kinds)), rng.uniform(-2, 2, n), rng.uniform(-1, 1, 3)


def as_screws(chain, pitch):
    """The screws of a modified DH chain and its last frame, both at q = 0."""
    frames = chain.frames(np.zeros(len(chain.kinds)))
    return joint_screw(frames[1:, :3, 2], frames[1:, :3, 3], pitch), frames[-1]


@given(seeds)
def test_screws_give_pose_and_jacobian_of_a_dh_chain(seed):
    table, kinds, q, point = random_table(seed)
    chain = DHChain(table, kinds)
    screws, home = as_screws(chain, np.where(np.equal(kinds, "prismatic"), np.inf, 0.0))
    T = product_of_exponentials(screws, q, home)
    assert_allclose(T, chain.frames(q)[-1], atol=ROUNDING)
    tip = T[:3, :3] @ point + T[:3, 3]
    J = geometric_from_screws(space_jacobian(screws, q), tip)
    assert_allclose(J, chain.jacobian(q, point=point), atol=ROUNDING)


def helical_pair(seed):
    """Each joint twice: a DH chain whose helical joints are a hinge and a slide on one axis, and the pitches."""
    table, _, q, point = random_table(seed)
    pitch = np.random.default_rng([seed, 1]).uniform(-0.5, 0.5, len(q))
    rows = [row for first in table for row in (first, (0.0, 0.0, 0.0, 0.0))]
    pair = DHChain(tuple(rows), ("revolute", "prismatic") * len(q))
    coupling = np.kron(np.eye(len(q)), [[1.0], [0.0]]) + np.kron(np.diag(pitch), [[0.0], [1.0]])
    return pair, coupling, DHChain(table, ("revolute",) * len(q)), pitch, q, point


@given(seeds)
def test_helical_joint_is_a_hinge_and_a_slide_that_are_coupled(seed):
    pair, coupling, chain, pitch, q, point = helical_pair(seed)
    screws, home = as_screws(chain, pitch)
    T = product_of_exponentials(screws, q, home)
    assert_allclose(T, pair.frames(coupling @ q)[-1], atol=ROUNDING)
    J = geometric_from_screws(space_jacobian(screws, q), T[:3, :3] @ point + T[:3, 3])
    assert_allclose(J, pair.jacobian(coupling @ q, point=point) @ coupling, atol=ROUNDING)


@pytest.mark.parametrize(
    "fault", ["pitch_dropped", "pitch_per_turn", "tip_at_the_origin", "rows_not_exchanged"]
)
def test_what_is_dropped_on_the_way_to_the_geometric_jacobian_is_seen(fault):
    pair, coupling, chain, pitch, q, point = helical_pair(3)
    factor = {"pitch_dropped": 0.0, "pitch_per_turn": 2 * np.pi}.get(fault, 1.0)
    screws, home = as_screws(chain, factor * pitch)
    T = pair.frames(coupling @ q)[-1]
    tip = 0 * point if fault == "tip_at_the_origin" else T[:3, :3] @ point + T[:3, 3]
    S = space_jacobian(screws, q)
    J = S if fault == "rows_not_exchanged" else geometric_from_screws(S, tip)
    with pytest.raises(AssertionError):
        assert_allclose(J, pair.jacobian(coupling @ q, point=point) @ coupling, atol=1e-3)


SPINDLE = """<mujoco><worldbody><body pos="0.1 0 0.2" quat="0.9 0.1 -0.2 0.3"><joint axis="0.2 1 0"/>
<geom size="0.1"/><body pos="0.4 0.1 0" quat="0.8 -0.3 0.1 0.2">
<joint name="advance" type="slide" axis="0.3 0.2 1"/><joint name="turn" axis="0.3 0.2 1" pos="0.1 -0.1 0"/>
<geom size="0.1"/><site name="tip" pos="0.2 0.3 0.1"/></body></body></worldbody></mujoco>"""


def test_spindle_of_mujoco_is_a_slide_and_a_hinge_on_one_axis():
    model, pitch, turn = mujoco.MjModel.from_xml_string(SPINDLE), 0.07, 0.8
    data = mujoco.MjData(model)
    data.qpos[:] = [0.5, pitch * turn, turn]
    mujoco.mj_forward(model, data)
    J = np.zeros((6, 3))
    mujoco.mj_jacSite(model, data, J[:3], J[3:], model.site("tip").id)
    on = [0, model.joint("turn").id]
    screws = joint_screw(data.xaxis[on], data.xanchor[on], [0.0, pitch])
    found = geometric_from_screws(screws.T, data.site("tip").xpos)
    assert_allclose(found, np.column_stack([J[:, 0], J[:, 2] + pitch * J[:, 1]]), atol=ROUNDING)


def test_slide_is_the_limit_of_a_screw_whose_pitch_grows():
    axis, u = np.array([0.0, 0.6, 0.8]), np.array([1.0, 2.0, 3.0])
    pitch = 1e9
    # Per meter of advance, what is left of the turn is 1/h, with |u| = 4 in front.
    assert_allclose(joint_screw(axis, u, pitch) / pitch, joint_screw(axis, u, np.inf), atol=4 / pitch)


@pytest.mark.parametrize("pitch", [np.nan, -np.inf])
def test_a_pitch_that_is_none_is_refused(pitch):
    with pytest.raises(ModelError) as caught:
        joint_screw([0, 0, 1], [0, 0, 0], [0.0, pitch])
    assert str(caught.value) == "joint pitch: nan or -inf; give 0 if revolute, inf if prismatic, else m/rad"


@pytest.mark.parametrize("function", [lambda s, q: product_of_exponentials(s, q, np.eye(4)), space_jacobian])
def test_a_position_too_many_is_refused(function):
    with pytest.raises(ModelError) as caught:
        function(np.ones((2, 6)), [0.1, 0.2, 0.3])
    assert str(caught.value) == "screws: 2 joints but 3 positions; give one per joint"


def test_leading_axes_are_configurations():
    screws, _, home = random_arm(8)
    q = np.random.default_rng(1).uniform(-1, 1, (5, 4, len(screws)))
    T, S = product_of_exponentials(screws, q, home), space_jacobian(screws, q)
    assert T.shape == (5, 4, 4, 4) and S.shape == (5, 4, 6, len(screws))
    J = geometric_from_screws(S, T[..., :3, 3])
    assert_allclose(T[3, 2], product_of_exponentials(screws, q[3, 2], home), atol=ROUNDING)
    assert_allclose(S[3, 2], space_jacobian(screws, q[3, 2]), atol=ROUNDING)
    assert_allclose(J[3, 2], geometric_from_screws(S[3, 2], T[3, 2, :3, 3]), atol=ROUNDING)
