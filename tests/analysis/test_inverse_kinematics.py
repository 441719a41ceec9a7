"""Inverse kinematics reach what can be reached, keep to the limits, and say honestly how near they came.

What was found is judged by MuJoCo's forward kinematics and scipy's rotations, never by the search's own error.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from chains import random_chain, seeds
from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.ik import goal_pose, solve_ik
from rmrc.law.task import choose
from rmrc.simulation import inverse_kinematics
from rmrc.textbook.inverse import newton_raphson
from rmrc.textbook.planar import three_link_jacobian, three_link_position

TOLERANCE = 1e-9


def load(name):
    return arms.load(ROOT / f"models/{name}.xml")


def solved(task, goal, start=None, **more):
    home = task.arm.configuration("home")[task.arm.wiring.qpos]
    return solve_ik(task, goal, home if start is None else np.array(start), **more)


def errors(task, goal, pose):
    """Return the error rows that count, by scipy's rotation vectors: [p_ref − p; log(R_ref Rᵀ)]."""
    rotation = lambda q: Rotation.from_quat(q, scalar_first=True)  # noqa: E731
    turn = (rotation(goal[3:]) * rotation(pose[3:]).inv()).as_rotvec()
    return np.concatenate([goal[:3] - pose[:3], turn])[task.rows]


def size(task, goal, pose):
    return np.linalg.norm(errors(task, goal, pose) * task.row_scale)


def assert_reached(task, goal, q):
    # 1e-15 is the rounding of the two ways to measure it.
    assert size(task, goal, task.arm.pose(q)) <= TOLERANCE + 1e-15 * max(1.0, np.abs(goal).max())
    lower, upper = task.arm.position_limit.T
    assert (q >= lower).all() and (q <= upper).all()


# What can be reached is reached -----------------------------------------------------------------


@given(seeds)
def test_any_chain_reaches_its_random_poses_within_its_limits(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("chain") / "chain.xml"
    path.write_text(random_chain(seed, ranges=True))
    arm = arms.load(path, "tip")
    task = choose(arm)
    for q in arm.sampled(3, seed):
        goal = arm.pose(q)
        found = solved(task, goal)
        assert found.found, (found.position_error, found.orientation_error)
        assert_reached(task, goal, found.q)


@pytest.mark.parametrize("method", ["damped", "newton"])
def test_more_rows_than_joints_are_met_where_they_can_be(method):
    arm = load("planar_2link")
    task = choose(arm, ["x", "y", "z", "rz"], 1.0)
    q = np.array([0.4, 0.9])
    found = solved(task, arm.pose(q), q - 0.1, method=method)
    assert found.found
    assert_allclose(found.q, q, atol=1e-8)
    # The nearest to what they cannot have is where the derivative of the squared error vanishes.
    goal = arm.pose(q)
    goal[2] = 0.3
    nearest = solved(task, goal, q)
    assert not nearest.found
    assert_allclose(nearest.error, 0.3, atol=1e-12)
    assert_allclose(nearest.q, q, atol=1e-6)


# Limits -----------------------------------------------------------------------------------------


def test_limits_are_kept_and_can_be_left_out():
    arm = load("stanford")
    task = choose(arm)
    lower, upper = arm.position_limit.T
    # Beyond the limits of the boom and of the fifth joint.
    wide = np.random.default_rng(1).uniform(lower, upper, (30, 6))
    wide[:, [2, 4]] += 1.0
    beyond_boom = 0
    for goal in map(arm.pose, wide):
        within, free = solved(task, goal), solved(task, goal, limits=False)
        assert (within.q >= lower).all() and (within.q <= upper).all()
        assert free.found and size(task, goal, arm.pose(free.q)) <= TOLERANCE + 1e-15
        # Not found is said of none that satisfies, found of none that does not.
        assert_allclose(size(task, goal, arm.pose(within.q)), within.error, atol=1e-14)
        beyond_boom += not within.found and free.q[2] > upper[2]
    assert beyond_boom


@given(seeds)
def test_no_other_turn_within_the_limits_is_nearer(seed):
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-8.0, -1.0, 6)
    limit = np.transpose([lower, lower + rng.uniform(1.0, 14.0, 6)])
    q, near = rng.uniform(*limit.T), rng.uniform(*limit.T)
    comes_round = np.arange(6) < 5  # and a slide
    found = inverse_kinematics.unwound(SimpleNamespace(comes_round=comes_round), limit, q[None], near)[0]
    assert found[5] == q[5]
    turns = q + 2 * np.pi * np.arange(-4, 5)[:, None]
    within = (turns >= limit[:, 0]) & (turns <= limit[:, 1])
    nearest = np.where(within, np.abs(turns - near), np.inf).min(axis=0)
    assert_allclose(np.exp(1j * found), np.exp(1j * q), atol=1e-12)
    assert ((found >= limit[:, 0]) & (found <= limit[:, 1])).all()
    assert (np.abs(found - near)[:5] <= nearest[:5] + 5 * inverse_kinematics.HALF_TURN).all()


# What cannot be reached -------------------------------------------------------------------------


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_beyond_its_reach_two_links_are_stretched_towards_the_goal(seed):
    task, rng = choose(load("planar_2link")), np.random.default_rng(seed)
    angle, distance = rng.uniform(-2.9, 2.9), rng.uniform(2.05, 4.0)
    found = solved(task, goal_pose(task, distance * np.array([np.cos(angle), np.sin(angle)])))
    assert not found.found and found.tries == 201 and found.at_limit == {}
    # The squared error is flat there: angles are known to the root of its rounding.
    assert_allclose(found.q, [angle, 0.0], atol=1e-6)
    assert_allclose([found.position_error, found.orientation_error], [distance - 2.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("side", [-1, 1])
def test_too_near_two_links_fold_to_the_elbows_limit_and_it_is_named(side):
    arm = load("planar_2link")
    task, end = choose(arm), arm.position_limit[1, (side + 1) // 2]
    found = solved(task, goal_pose(task, [0.2, 0.0]), [0.5, 2.0 * side], restarts=0)
    nearest = 2.0 * np.cos(end / 2.0)  # of the isosceles triangle of two links
    assert not found.found and found.q[1] == end
    assert_allclose(found.position_error, nearest - 0.2, atol=1e-12)
    assert found.at_limit == {"elbow": "upper" if side > 0 else "lower"}


@pytest.mark.parametrize(("beyond", "is_found"), [(0.5e-9, True), (2e-9, False)])
def test_nothing_above_the_tolerance_over_the_length_is_called_found(beyond, is_found):
    for length in (1.0, 0.01):
        task = choose(load("planar_2link"), length=length)
        found = solved(task, goal_pose(task, [0.0, 2.0 + beyond * length]))
        assert found.found is is_found
        if not is_found:
            assert_allclose(found.position_error, beyond * length, atol=1e-14)


def test_the_nearest_cannot_be_bettered_within_the_limits():
    arm = load("stanford")
    task, (lower, upper) = choose(arm, length=1.0), arm.position_limit.T
    rng = np.random.default_rng(4)
    for _ in range(3):
        goal = np.concatenate([rng.uniform(1.2, 1.6, 3), Rotation.random(rng=rng).as_quat()])
        found = solved(task, goal)
        assert not found.found
        better = least_squares(
            lambda q, goal=goal: errors(task, goal, arm.pose(q)), found.q, bounds=(lower, upper), xtol=1e-14
        )
        # A tenth of a percent would be another minimum or none; the last digits are a matter of patience.
        assert found.error <= np.linalg.norm(better.fun) * (1 + 1e-6)
        # Negative control: from half a degree beside it, there is something to better.
        beside = np.clip(found.q + 0.01, lower, upper)
        assert size(task, goal, arm.pose(beside)) > found.error * (1 + 1e-6)


# Steps ------------------------------------------------------------------------------------------


@given(seeds)
def test_newton_is_the_textbooks_iterate_by_iterate(seed):
    task, rng = choose(load("selig_211")), np.random.default_rng(seed)
    start = rng.uniform([-1.0, 0.5, -1.0], [1.0, 2.5, 1.0])
    goal = three_link_position([2, 1, 1], start + rng.uniform(-0.2, 0.2, 3))
    found = solved(task, goal_pose(task, goal), start, method="newton", limits=False, tolerance=1e-10)
    textbook = newton_raphson(
        lambda q: three_link_position([2, 1, 1], q), lambda q: three_link_jacobian([2, 1, 1], q), start, goal
    )
    assert textbook.status == "converged"
    same = min(len(textbook.step), found.steps)
    assert same >= found.steps - 1  # the two measure the last error differently
    # A step multiplies what rounding left by 1/σ_min, here below 10.
    assert_allclose(-np.diff(found.iterates, axis=0)[:same], textbook.step[:same], atol=1e-11)


@pytest.mark.parametrize(("name", "axes", "wrong"), [
    ("fr3", "x y z", 1.0), ("planar_3link", "x y", 1.0), ("planar_2link", "x y rz", 1.0), ("ur5e", "x y z", 1.5),
])  # fmt: skip
def test_a_damped_step_minimizes_the_damped_error(name, axes, wrong):
    """|e − J z|² + λ²|z|², by numpy's least squares of the stacked equations; wrong: λ is not what was used."""
    arm = load(name)
    task, agree, no_limits = choose(arm, axes.split(), 1.0), True, np.tile([-np.inf, np.inf], (arm.n, 1))
    for q in arm.sampled(20, 18):
        goal, first = arm.pose(q), 0.8 * q[None]
        # one step from each of two equal starts
        (found,), _, _ = inverse_kinematics.search(task, no_limits, 0.0, 1, goal[None], first, first)
        J, e = arm.jacobian(first[0])[task.rows], errors(task, goal, arm.pose(first[0]))
        damping = wrong * np.sqrt(inverse_kinematics.FIRST_SHARE) * np.linalg.norm(e)
        stacked = np.vstack([J, damping * np.eye(arm.n)])
        step = np.linalg.lstsq(stacked, np.concatenate([e, np.zeros(arm.n)]))[0]
        if size(task, goal, arm.pose(first[0] + step)) > np.linalg.norm(e):
            step = 0.0 * step  # it is not taken
        # 1e-8: of pivots down to 1e-8 of the largest entry
        agree &= np.allclose(found - first[0], step, rtol=0.0, atol=1e-7)
    assert agree == (wrong == 1.0)


# Goals ------------------------------------------------------------------------------------------


def test_a_goal_is_a_value_for_each_row():
    planar, six = choose(load("planar_3link")), choose(load("puma560"))
    goal = goal_pose(planar, [0.5, 0.3, 2.0])
    # The sum of the angles of parallel axes is rz, whatever the frame of the site at 0.
    assert_allclose(np.cos(sum(solved(planar, goal).q) - 2.0), 1.0, atol=1e-12)
    vector = [0.3, -0.2, 0.4, 0.5, -1.0, 0.7]
    assert_allclose(
        Rotation.from_quat(goal_pose(six, vector)[3:], scalar_first=True).as_rotvec(), vector[3:], atol=1e-15
    )
    # Both quaternions of an orientation, of any length, are one goal.
    for sign in (2.0, -3.0):
        quat = goal_pose(six, [1, 2, 3], [sign, 0, 0, sign])[3:]
        assert_allclose(quat, np.array([1, 0, 0, 1]) / np.sqrt(2))


def test_some_rotations_turn_the_site_from_where_it_is_at_zero(tmp_path):
    # The tool of this arm points down, where a rotation vector has no row for the turn about z.
    model = (ROOT / "models/selig_211.xml").read_text("utf-8").replace("common/", f"{ROOT}/models/common/")
    text = model.replace('<site name="tip"', '<site name="tip" euler="3.14159265358979 0 0"')
    assert text != model
    (tmp_path / "arm.xml").write_text(text)
    task = choose(arms.load(tmp_path / "arm.xml"))
    assert abs(task.arm.chain.tip_quat[1]) == pytest.approx(1.0)
    found = solved(task, goal_pose(task, [0.5, 3.0, 2.0]), [1.0, 0.5, 0.5])
    assert found.found
    assert_allclose(sum(found.q), 2.0, atol=1e-9)
