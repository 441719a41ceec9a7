"""Inverse kinematics reach what can be reached, keep to the limits, and say honestly how near they came.

What was found is judged by MuJoCo's forward kinematics and scipy's rotations, never by the search's own error.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from chains import random_chain, seeds
from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.ik.solve import goal_pose, normalized_goal, solve_ik
from rmrc.law.task import choose
from rmrc.simulation import inverse_kinematics
from rmrc.support.errors import QuestionError
from rmrc.textbook.newton import newton_raphson
from rmrc.textbook.planar import three_link_jacobian, three_link_position
from screws import screw_chain
from wording import says

TOLERANCE = 1e-9

THREE_LINKS = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
<body><joint name="q1" axis="0 0 1"/><geom size="0.1"/>
<body pos="2 0 0"><joint name="q2" axis="0 0 1"/><geom size="0.1"/>
<body pos="1 0 0"><joint name="q3" axis="0 0 1"/><geom size="0.1"/><site name="tip" pos="1 0 0"/>
</body></body></body></worldbody></mujoco>"""


def load(name):
    return arms.load(ROOT / f"models/{name}.xml")


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


@pytest.fixture
def write(tmp_path):
    """Return a function: MJCF -> arm."""

    def load_text(text):
        (tmp_path / "arm.xml").write_text(text)
        return arms.load(tmp_path / "arm.xml")

    return load_text


# What can be reached is reached -----------------------------------------------------------------


@given(seeds)
def test_any_chain_reaches_its_random_poses_within_its_limits(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("chain") / "chain.xml"
    path.write_text(random_chain(seed, ranges=True))
    arm = arms.load(path, "tip")
    task = choose(arm)
    for q in arm.sampled(3, seed):
        goal = arm.pose(q)
        found = solve_ik(task, goal)
        assert found.found, (found.position_error, found.orientation_error)
        assert_reached(task, goal, found.q)
        assert_array_equal(found.pose, arm.pose(found.q))


@pytest.mark.parametrize("name", ["stanford", "puma560", "anthropomorphic", "helical"])
def test_many_goals_are_reached_from_a_start_that_does_not_know_the_answer(name):
    arm = load(name)
    task, q = choose(arm), arm.sampled(150, 11)
    goals = np.array([arm.pose(one) for one in q])
    found = [solve_ik(task, goal) for goal in goals]
    for goal, solution in zip(goals, found, strict=True):
        assert solution.found
        assert_reached(task, goal, solution.q)
    # Negative control: they are other postures than the goals were made of, so nothing was copied.
    if name == "puma560":
        others = np.array([solution.q for solution in found])
        assert (np.abs(others - q).max(axis=1) > 0.1).mean() > 0.3


def test_a_screw_joint_reaches_and_is_not_wound_back(write):
    arm = write(screw_chain())
    task = choose(arm)
    for q in arm.sampled(20, 3):
        goal = arm.pose(q)
        found = solve_ik(task, goal)
        assert found.found
        assert_reached(task, goal, found.q)


def test_who_begins_at_the_answer_stays_there():
    arm = load("stanford")
    task = choose(arm)
    for q in arm.sampled(30, 13):
        found = solve_ik(task, arm.pose(q), q)
        assert_allclose(found.q, q, atol=1e-12)
        assert found.tries == 1


def test_rows_that_do_not_count_are_free():
    arm = load("puma560")
    task = choose(arm, ["x", "z", "rx"])
    goal = arm.pose(arm.sampled(1, 14)[0])
    found = solve_ik(task, goal, arm.sampled(1, 15)[0])
    assert found.found
    assert_reached(task, goal, found.q)
    # Negative control: the others are not met.
    assert size(choose(arm), goal, found.pose) > 0.1


@pytest.mark.parametrize("method", ["damped", "newton"])
def test_more_rows_than_joints_are_met_where_they_can_be(method):
    arm = load("planar_2link")
    task = choose(arm, ["x", "y", "z", "rz"], 1.0)
    q = np.array([0.4, 0.9])
    found = solve_ik(task, arm.pose(q), q - 0.1, method=method)
    assert found.found
    assert_allclose(found.q, q, atol=1e-8)
    # The nearest to what they cannot have is where the derivative of the squared error vanishes.
    goal = arm.pose(q)
    goal[2] = 0.3
    nearest = solve_ik(task, goal, q)
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
    goals = np.array([arm.pose(q) for q in wide])
    beyond_boom = 0
    for goal in goals:
        kept, free = solve_ik(task, goal), solve_ik(task, goal, limits=False)
        assert (kept.q >= lower).all() and (kept.q <= upper).all()
        assert free.found and size(task, goal, arm.pose(free.q)) <= TOLERANCE + 1e-15
        # Not found is said of none that satisfies, found of none that does not.
        assert_allclose(size(task, goal, arm.pose(kept.q)), kept.error, atol=1e-14)
        beyond_boom += not kept.found and free.q[2] > upper[2]
    assert beyond_boom


def test_hinges_are_not_wound_up():
    arm = load("puma560")
    task, start = choose(arm), np.array([0.3, -0.4, 2.0, 3.0, -1.0, 6.0])
    for q in arm.sampled(50, 16):
        found = solve_ik(task, arm.pose(q), start, limits=False)
        assert found.found and (np.abs(found.q - start) <= np.pi + 1.1e-5).all()


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


def test_both_quaternions_of_a_goal_are_one_goal():
    task = choose(load("puma560"))
    goal = task.arm.pose(task.arm.sampled(1, 3)[0])
    other = np.concatenate([goal[:3], -2.0 * goal[3:]])
    assert_allclose(normalized_goal(other), goal, atol=1e-15)
    assert_allclose(solve_ik(task, other).q, solve_ik(task, goal).q, atol=1e-9)


@pytest.mark.parametrize("end", [0, 1])
def test_joints_at_their_limits_are_free_to_leave_them(end):
    arm = load("planar_2link")
    task, start = choose(arm), arm.position_limit[:, end]
    found = solve_ik(task, arm.pose(0.6 * start), start, restarts=0)
    assert found.found and found.tries == 1
    assert_array_equal(found.at_limit, 0)


# What cannot be reached -------------------------------------------------------------------------


@pytest.mark.parametrize("side", [-1, 1])
def test_the_limit_that_is_in_the_way_is_told_with_its_side(side):
    arm = load("planar_2link")
    goal = goal_pose(choose(arm), [0.2, 0.0])  # nearer than the elbow folds
    found = solve_ik(choose(arm), goal, [0.5, 2.0 * side], restarts=0)
    assert not found.found
    assert_array_equal(found.at_limit, [0, side])
    assert found.q[1] == arm.position_limit[1, (side + 1) // 2]


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_beyond_its_reach_two_links_are_stretched_towards_the_goal(seed):
    arm = load("planar_2link")
    task, rng = choose(arm), np.random.default_rng(seed)
    angle, distance = rng.uniform(-2.9, 2.9), rng.uniform(2.05, 4.0)
    found = solve_ik(task, goal_pose(task, distance * np.array([np.cos(angle), np.sin(angle)])))
    assert not found.found
    # The squared error is flat there: angles are known to the root of its rounding.
    assert_allclose(found.q, [angle, 0.0], atol=1e-6)
    assert_allclose(found.position_error, distance - 2.0, atol=1e-12)
    assert found.orientation_error == 0.0
    assert found.tries == 201
    assert not found.at_limit.any()


def test_too_near_two_links_fold_to_the_elbows_limit():
    arm = load("planar_2link")
    task, elbow = choose(arm), arm.position_limit[1, 1]
    found = solve_ik(task, goal_pose(task, [0.2, 0.0]))
    nearest = 2.0 * np.cos(elbow / 2.0)  # of the isosceles triangle of two links
    assert not found.found
    assert_allclose(found.position_error, nearest - 0.2, atol=1e-12)
    assert abs(found.q[1]) == elbow
    assert_array_equal(found.at_limit, [0, np.sign(found.q[1])])


@pytest.mark.parametrize(("beyond", "is_found"), [(0.5e-9, True), (2e-9, False)])
def test_nothing_above_the_tolerance_is_called_found(beyond, is_found):
    task = choose(load("planar_2link"))
    goal = goal_pose(task, [0.0, 2.0 + beyond])
    found = solve_ik(task, goal)
    assert found.found is is_found
    assert_allclose(found.position_error, beyond, atol=1e-14 if not is_found else 0.5e-9)


def test_the_tolerance_is_over_the_length():
    task = choose(load("planar_2link"), length=0.01)
    assert not solve_ik(task, goal_pose(task, [0.0, 2.0 + 0.5e-9])).found
    assert solve_ik(task, goal_pose(task, [0.0, 2.0 + 0.5e-11])).found


def test_the_nearest_cannot_be_bettered_within_the_limits():
    arm = load("stanford")
    task, (lower, upper) = choose(arm, length=1.0), arm.position_limit.T
    rng = np.random.default_rng(4)
    for _ in range(3):
        goal = np.concatenate([rng.uniform(1.2, 1.6, 3), Rotation.random(rng=rng).as_quat()])
        found = solve_ik(task, goal)
        assert not found.found
        better = least_squares(
            lambda q, goal=goal: errors(task, goal, arm.pose(q)), found.q, bounds=(lower, upper), xtol=1e-14
        )
        # A tenth of a percent would be another minimum or none; the last digits are a matter of patience.
        assert found.error <= np.linalg.norm(better.fun) * (1 + 1e-6)
        # Negative control: from half a degree beside it, there is something to better.
        beside = np.clip(found.q + 0.01, lower, upper)
        assert size(task, goal, arm.pose(beside)) > found.error * (1 + 1e-6)


# Newton's method --------------------------------------------------------------------------------


def test_newton_goes_through_the_iterates_of_the_notes(write):
    task = choose(write(THREE_LINKS))
    goal = goal_pose(task, [0.5, 3.0, 2 * np.pi / 3])
    found = solve_ik(task, goal, [np.pi / 3, np.pi / 6, np.pi / 6], method="newton")
    path = found.iterates
    # Printed: B, section 6.3; its later iterates follow a slip and are not the method's.
    assert_allclose(path.step[0], [0.5981, -1.6340, 1.0359], atol=5e-5)
    assert_allclose(path.q[1], [0.4491, 2.1576, -0.5123], atol=1e-4)
    assert found.found and found.steps <= 6 and found.tries == 1
    assert_allclose(found.q, [0.698863, 1.431888, -0.036356], atol=5e-7)
    assert_allclose(path.q[:-1] - path.step, path.q[1:], atol=1e-15)
    for q, error in zip(path.q, path.error, strict=True):
        assert_allclose(error, size(task, goal, task.arm.pose(q)), atol=1e-12)


@given(seeds)
def test_newton_is_the_textbooks_iterate_by_iterate(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("links") / "arm.xml"
    path.write_text(THREE_LINKS)
    task, rng = choose(arms.load(path)), np.random.default_rng(seed)
    start = rng.uniform([-1.0, 0.5, -1.0], [1.0, 2.5, 1.0])
    goal = three_link_position([2, 1, 1], start + rng.uniform(-0.2, 0.2, 3))
    found = solve_ik(task, goal_pose(task, goal), start, method="newton", limits=False, tolerance=1e-10)
    textbook = newton_raphson(
        lambda q: three_link_position([2, 1, 1], q), lambda q: three_link_jacobian([2, 1, 1], q), start, goal
    )
    assert textbook.status == "converged"
    same = min(len(textbook.step), found.steps)
    assert same >= found.steps - 1  # the two measure the last error differently
    # A step multiplies what rounding left by 1/σ_min, here below 10.
    assert_allclose(found.iterates.step[:same], textbook.step[:same], atol=1e-11)


def orders(error):
    """Return log e_{i+1} / log e_i where both are small and neither is rounding."""
    error = np.asarray(error)
    error = error[(error < 0.1) & (error > 1e-13)]
    return np.log(error[1:]) / np.log(error[:-1])


@pytest.mark.parametrize("method", ["newton", "damped"])
def test_convergence_is_quadratic_where_only_some_rotations_count(method):
    # At these goals the rotation error is not 0: the turned rows of J are what makes it quadratic.
    arm = load("puma560")
    task = choose(arm, ["x", "y", "z", "rx", "rz"])
    start = arm.configuration("home")[arm.wiring.qpos] + 0.1
    goal = arm.pose(start + 0.2)
    goal[3:] = Rotation.from_rotvec([0.2, 2.0, 0.1]).as_quat(scalar_first=True)
    found = solve_ik(task, goal, start, method=method, limits=False)
    assert found.found and found.tries == 1
    assert np.linalg.norm(errors(choose(arm), goal, found.pose)[4]) > 0.5
    assert orders(found.iterates.error)[-1] > 1.7
    # Negative control: with plain J the error falls by a factor a step.
    q, sizes = found.q + 0.01, []
    for _ in range(6):
        error = errors(task, goal, arm.pose(q))
        sizes.append(np.linalg.norm(error))
        q = q + np.linalg.pinv(arm.jacobian(q)[task.rows]) @ error
    assert orders(sizes)[-1] < 1.5


def test_newton_that_ends_beyond_a_limit_has_not_found():
    arm = load("planar_2link")
    task = choose(arm)
    # Behind the shoulder: 171° to 180° are beyond its 170°.
    goal = goal_pose(task, [-1.999, 0.0])
    found = solve_ik(task, goal, [2.9, 0.4], method="newton")
    assert not found.found and found.error < TOLERANCE
    assert found.beyond.tolist() == [True, False]
    free = solve_ik(task, goal, [2.9, 0.4], method="newton", limits=False)
    assert free.found
    assert_array_equal(free.q, found.q)


def test_newton_that_does_not_converge_says_so():
    task = choose(load("planar_2link"))
    found = solve_ik(task, goal_pose(task, [0.0, 3.0]), method="newton")
    assert not found.found and found.steps == 50 and len(found.iterates.q) == 51
    assert_allclose(found.error, size(task, found.goal, task.arm.pose(found.q)), atol=1e-12)


def test_damped_steps_never_make_the_error_larger():
    arm = load("stanford")
    task = choose(arm)
    for q in arm.sampled(20, 17):
        path = solve_ik(task, arm.pose(q)).iterates
        assert (np.diff(path.error) < 0.0).all()
        assert len(path.damping) == len(path.step) == len(path.error) - 1 and (path.damping > 0.0).all()


@pytest.mark.parametrize(("name", "axes", "wrong"), [
    ("fr3", "x y z", 1.0), ("planar_3link", "x y", 1.0), ("planar_2link", "x y rz", 1.0), ("ur5e", "x y z", 1.5),
])  # fmt: skip
def test_a_damped_step_minimizes_the_damped_error(name, axes, wrong):
    """|e − J z|² + λ²|z|², by numpy's least squares of the stacked equations; wrong: λ is not what was used."""
    arm = load(name)
    task, agree, seen = choose(arm, axes.split(), 1.0), True, 0
    for q in arm.sampled(5, 18):
        goal = arm.pose(q)
        path = solve_ik(task, goal, 0.5 * q, limits=False).iterates
        for at, step, damping in zip(path.q, path.step, wrong * path.damping, strict=False):
            J, e = arm.jacobian(at)[task.rows], errors(task, goal, arm.pose(at))
            if np.linalg.norm(e) < 1e-6:
                continue  # the two ways to measure e differ by rounding
            stacked = np.vstack([J, damping * np.eye(arm.n)])
            best = np.linalg.lstsq(stacked, np.concatenate([e, np.zeros(arm.n)]))[0]
            # 1e-8: of pivots down to 1e-8 of the largest entry
            agree &= np.allclose(-step, best, rtol=0.0, atol=1e-7 * np.linalg.norm(best))
            seen += 1
    assert seen > 15 and agree == (wrong == 1.0)


# Goals ------------------------------------------------------------------------------------------


def test_a_goal_is_a_value_for_each_row():
    planar, six = choose(load("planar_3link")), choose(load("puma560"))
    goal = goal_pose(planar, [0.5, 0.3, 2.0])
    # The sum of the angles of parallel axes is rz, whatever the frame of the site at 0.
    assert_allclose(np.cos(sum(solve_ik(planar, goal).q) - 2.0), 1.0, atol=1e-12)
    vector = [0.3, -0.2, 0.4, 0.5, -1.0, 0.7]
    assert_allclose(
        Rotation.from_quat(goal_pose(six, vector)[3:], scalar_first=True).as_rotvec(), vector[3:], atol=1e-15
    )
    assert_allclose(goal_pose(six, [1, 2, 3], [2.0, 0, 0, 2.0])[3:], np.array([1, 0, 0, 1]) / np.sqrt(2))


def test_some_rotations_turn_the_site_from_where_it_is_at_zero(write):
    # The tool of this arm points down, where a rotation vector has no row for the turn about z.
    task = choose(
        write(
            THREE_LINKS.replace(
                'pos="1 0 0"/>\n</body></body>', 'pos="1 0 0" euler="180 0 0"/>\n</body></body>'
            )
        )
    )
    found = solve_ik(task, goal_pose(task, [0.5, 3.0, 2.0]), [1.0, 0.5, 0.5])
    assert found.found
    assert_allclose(sum(found.q), 2.0, atol=1e-9)


# Bad questions ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda task: goal_pose(task, [1.0]), "… goal … 2 … x, y … [1.0]"),
        (lambda task: goal_pose(task, [1.0, np.nan]), "… goal … 2 finite … x, y … [1.0, nan]"),
        (lambda task: goal_pose(task, [1.0, 1.0], [0, 0, 0, 0]), "… quaternion … zero … [0, 0, 0, 0]"),
        (lambda task: solve_ik(task, [1.0, 1.0]), "… goal … [x, y, z, qw, qx, qy, qz] … (2,)"),
        (lambda task: solve_ik(task, [1.0, np.inf, 0, 1, 0, 0, 0]), "… goal … finite … quaternion … zero"),
        (lambda task: solve_ik(task, [1.0, 1, 0, 0, 0, 0, 0]), "… goal … finite … quaternion … zero"),
        (lambda task: solve_ik(task, [1.0, 1, 0, 1, 0, 0, 0], [0.0]), "… start … 2 … joint positions … (1,)"),
    ],
)
def test_bad_questions_are_told(ask, message):
    with pytest.raises(QuestionError) as caught:
        ask(choose(load("planar_2link")))
    assert str(caught.value) == says(message)
