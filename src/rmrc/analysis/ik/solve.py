"""Inverse kinematics of any arm: joint positions that bring its site to a pose, or as near as they can.

It is a search (`rmrc.simulation.inverse_kinematics`) from a start and from random but always equal others.
Forward kinematics proves its results; other solutions may still exist.
"""

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.arm import Arm
from rmrc.law.task import Array, Task
from rmrc.simulation.inverse_kinematics import newton, search, unwound
from rmrc.support.errors import QuestionError
from rmrc.support.spatial import exp_rotation, normalize, pose_error, quat_multiply

Method: TypeAlias = Literal["damped", "newton"]
METHODS: tuple[Method, ...] = get_args(Method)

TOLERANCE = 1e-9
# The search has a smaller tolerance than promised, so that MuJoCo's rounding, 1e-15, does not break the
# promise.
AIM = 0.99
# A damped try has converged or is stuck after some 30 steps; Newton's method is lost if not done after 50.
STEPS: dict[Method, int] = {"damped": 300, "newton": 50}
# Number of other starts. Of 20,000 random poses of the PUMA arm, one in a hundred needs more than 19, one in
# a thousand more than 32, and one needed 133.
RESTARTS = 200
# The seed differs from the default of `Arm.sampled`, which gives examples and tests their goals.
SEED = 6
# A limit counts as reached within this distance, for rounding.
AT_LIMIT = 1e-9


@dataclass(frozen=True, eq=False)
class Iterates:
    """The history of a search with k steps; steps that would increase the error are not included.

    Attributes:
        q: Joint positions, (k + 1, n).
        error: |e|, (k + 1,).
        damping: λ of each step, (k,); 0 for Newton's.
    """

    q: Array
    error: Array
    damping: Array

    @property
    def step(self) -> Array:
        """Steps h of q⁺ = q − h, (k, n) [Selig92, §6.3]."""
        return -np.diff(self.q, axis=0)


@dataclass(frozen=True, eq=False)
class Solution:
    """Joint positions that reach a goal, or the nearest ones found.

    Attributes:
        found: Whether the error is within the tolerance and no limit is violated.
        method: "damped" or "newton".
        q: Joint positions, (n,).
        pose: Pose of the site there, by MuJoCo, (7,).
        goal: Its target, (7,).
        error: |e| = √(|Δp|²/L² + |Δφ|²) over the rows that count; the nearest positions minimize it.
        position_error: |Δp| [m].
        orientation_error: |Δφ| [rad].
        at_limit: −1 at the lower limit, 1 at the upper, 0 between them, (n,).
        beyond: Joints beyond a limit, (n,); only Newton's method leaves some.
        steps: Number of steps from the successful start.
        tries: Number of starts up to this one; all, if none succeeded.
        iterates: Those steps.
    """

    found: bool
    method: Method
    q: Array
    pose: Array
    goal: Array
    error: float
    position_error: float
    orientation_error: float
    at_limit: NDArray[np.int64]
    beyond: NDArray[np.bool_]
    steps: int
    tries: int
    iterates: Iterates


def goal_pose(task: Task, values: ArrayLike, quat: ArrayLike | None = None) -> Array:
    """Return the pose (7,) for values of the rows of a task, in their order.

    rx, ry, rz are the rotation vector of the orientation if all three count. If only some do, they turn the
    site from its orientation with all joints at 0, which for parallel axes is the sum of the joint angles:

        R_ref = exp([rx, ry, rz]),   or   exp([rx, ry, rz]) R(0)

    Rows that do not count stay 0.

    Args:
        task: The arm and the rows that count.
        values: One for each row [m, rad]; for each of x, y, z that counts, if `quat` is given.
        quat: The orientation [w, x, y, z], of any length but 0.

    Raises:
        QuestionError: There are more or fewer values, one is not finite, or the quaternion is zero.

    Example:
        >>> from pathlib import Path
        >>> from rmrc.law.task import choose
        >>> from rmrc.arm import load
        >>> task = choose(load(Path("models/planar_3link.xml")))
        >>> task.axes, goal_pose(task, [0.5, 0.3, np.pi]).round(12) + 0.0
        (('x', 'y', 'rz'), array([0.5, 0.3, 0. , 0. , 0. , 0. , 1. ]))
    """
    values = np.asarray(values, np.float64)
    rows = task.rows if quat is None else task.rows[task.rows < 3]
    if values.shape != rows.shape or not np.isfinite(values).all():
        names = ", ".join(np.array(task.axes)[: len(rows)])
        raise QuestionError(
            f"a goal must have {len(rows)} finite values, for {names or 'none'}, got {values.tolist()}"
        )
    full = np.zeros(6)
    full[rows] = values
    if quat is not None:
        try:
            orientation = normalize(quat)
        except ValueError:
            raise QuestionError(
                f"the goal's quaternion must be finite and not zero, got {np.asarray(quat).tolist()}"
            ) from None
    else:
        orientation = exp_rotation(full[3:])
        if np.count_nonzero(task.rows >= 3) < 3:
            orientation = quat_multiply(orientation, task.arm.chain.tip_quat)
    return np.concatenate([full[:3], orientation])


def solve_ik(
    task: Task, goal: ArrayLike, start: ArrayLike | None = None, *, method: Method = "damped",
    limits: bool = True, tolerance: float = TOLERANCE, restarts: int = RESTARTS,
) -> Solution:  # fmt: skip
    """Find joint positions that bring the site to a goal.

    damped: z = Σ_i σ_i/(σ_i² + λ²) v_i u_iᵀ e, with λ² proportional to |e|² and limits as an active set
    [Levenberg44], [Chan88], [Sugihara11], [Fan03]; from other starts if it does not succeed.
    newton: q⁺ = q + S_q A⁺ e, the Newton-Raphson method of the notes [Selig92, §6.3], from one start; limits
    are ignored until it ends. They are `descend` and `newton` of `rmrc.simulation.inverse_kinematics`.

    Args:
        task: The arm and the rows that count, and the length L that weighs rotation against position.
        goal: Pose of the site, [p, quat w x y z], (7,); see `goal_pose`.
        start: Joint positions, (n,); None: `home`. The damped method begins at the nearest within limits.
        method: "damped" or "newton".
        limits: Whether to keep the model's position limits.
        tolerance: Tolerance of |e|: orientation in rad, position over L.
        restarts: Other starts to try.

    Returns:
        Joint positions, hinges at most half a turn from the start where limits allow. A goal that is not
        reached is no error: then `found` is False, and q is where |e| is smallest.

    Raises:
        QuestionError: Goal or start do not fit the arm or are not finite.

    Example:
        >>> from pathlib import Path
        >>> from rmrc.law.task import choose
        >>> from rmrc.arm import load
        >>> task = choose(load(Path("models/planar_2link.xml")))
        >>> reached = solve_ik(task, goal_pose(task, [1.0, 1.0]))
        >>> reached.found, np.degrees(reached.q).round(6).tolist()
        (True, [90.0, -90.0])
        >>> beyond = solve_ik(task, goal_pose(task, [0.0, 3.0]))
        >>> beyond.found, round(beyond.position_error, 9)
        (False, 1.0)
    """
    arm, pose, begin = task.arm, normalized_goal(goal), begin_at(task.arm, start)
    limit, most, aim = limits_of(arm, limits), STEPS[method], AIM * tolerance
    trace, winner = np.full((most + 1, arm.n + 2), np.nan), 0
    if method == "newton":
        restarts = 0
        q, steps = newton(task, aim, most, pose, begin, trace)
    else:
        first, more = np.clip(begin, *limit.T)[None], random_starts(task, restarts, limits)
        _, _, tally = search(task, limit, aim, most, pose[None], first, more)
        winner = int(tally[0, 1])
        # Once more from the successful start, now with all iterates.
        first = more[winner - 1 : winner] if winner > 0 else first
        (q,), _, tally = search(task, limit, aim, most, pose[None], first, more[:0], trace=trace)
        steps = int(tally[0, 0])
    trace = trace[~np.isnan(trace[:, 0])]
    solution = judge(task, limit, unwound(arm, limit, q[None], begin[None])[0], pose, tolerance)
    return replace(
        solution,
        method=method,
        steps=steps,
        tries=1 + (winner if solution.found else restarts),
        iterates=Iterates(trace[:, :-2], trace[:, -2], trace[1:, -1]),
    )


def random_starts(task: Task, count: int, limits: bool) -> Array:
    """Return joint positions to begin at, (count, n), the same at every call.

    Without limits the range of a hinge is its circle, and a slide goes as far to either side of 0 as its
    farther limit.
    """
    starts = task.arm.sampled(count, SEED)
    if limits:
        return starts
    farthest = np.abs(task.arm.position_limit).max(axis=1)
    span = np.where(task.arm.is_slide & np.isfinite(farthest), farthest, np.pi)
    return np.random.default_rng(SEED).uniform(-span, span, starts.shape)


def judge(task: Task, limit: Array, q: Array, goal: Array, tolerance: float) -> Solution:
    """Return joint positions judged by MuJoCo's own kinematics, without the history of the search.

    Args:
        task: The arm and the rows that count.
        limit: Position limits to keep, (n, 2); see `limits_of`.
        q: Joint positions, (n,).
        goal: Pose of the site, (7,).
        tolerance: Tolerance of |e|: orientation in rad, position over L.
    """
    pose = task.arm.pose(q)
    scaled = np.zeros(6)
    scaled[task.rows] = pose_error(goal, pose)[task.rows]
    position, orientation = np.linalg.norm(scaled[:3]), np.linalg.norm(scaled[3:])
    error = float(np.hypot(position / task.length, orientation))
    lower, upper = limit.T
    beyond = (q < lower - AT_LIMIT) | (q > upper + AT_LIMIT)
    at_limit = (q >= upper - AT_LIMIT).astype(np.int64) - (q <= lower + AT_LIMIT)
    is_reached = bool(error <= tolerance and not beyond.any())
    nowhere = Iterates(q[None], np.array([error]), np.empty(0))
    errors = error, float(position), float(orientation)
    return Solution(is_reached, "damped", q, pose, goal, *errors, at_limit, beyond, 0, 0, nowhere)


def linearized(task: Task, solution: Solution) -> tuple[Array, Array]:
    """Return the equations of Newton's method at each iterate: J(q) h = f(q), q⁺ = q − h [Selig92, §6.3].

    Args:
        task: The arm and the rows that count, m of them.
        solution: The solution, after k steps.

    Returns:
        f, the site's excess over the goal, (k + 1, m) [m, rad], and J, (k + 1, m, n).
    """
    q = solution.iterates.q
    poses = np.array([task.arm.pose(row) for row in q])
    J = task.turned(np.array([task.arm.jacobian(row) for row in q]), poses)
    return -task.view.error(solution.goal, poses)[:, task.rows], J[:, task.rows]


def limits_of(arm: Arm, limits: bool) -> Array:
    """Return the position limits to keep, (n, 2); infinite without `limits`."""
    return arm.position_limit if limits else np.tile([-np.inf, np.inf], (arm.n, 1))


def normalized_goal(goal: ArrayLike) -> Array:
    """Return a goal, (7,), with a unit quaternion of w >= 0, like that of a site.

    Raises:
        QuestionError: It is no pose, is not finite, or has a quaternion of zeros.
    """
    pose = np.array(goal, np.float64)
    if pose.shape != (7,):
        raise QuestionError(f"a goal must be a pose [x, y, z, qw, qx, qy, qz], got an array {pose.shape}")
    if not (np.isfinite(pose).all() and pose[3:].any()):
        raise QuestionError("a goal must be finite, with a quaternion that is not zero")
    pose[3:] = normalize(-pose[3:] if pose[3] < 0.0 else pose[3:])
    return pose


def begin_at(arm: Arm, start: ArrayLike | None) -> Array:
    """Return joint positions to begin at, (n,); None: `home`.

    Raises:
        QuestionError: There are more or fewer than n, or one is not finite.
    """
    q = np.array(arm.configuration("home")[arm.wiring.qpos] if start is None else start, np.float64)
    if q.shape != (arm.n,) or not np.isfinite(q).all():
        raise QuestionError(f"a start must be {arm.n} finite joint positions, got an array {q.shape}")
    return q
