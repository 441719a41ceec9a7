"""Joint positions that bring the site of an arm to a goal, one or all of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rmrc.analysis.ik.postures import Postures, find_postures
from rmrc.analysis.ik.solve import (
    METHODS,
    TOLERANCE,
    Method,
    Solution,
    checked_goals,
    goal_pose,
    judge,
    kept_limit,
    solve_ik,
)
from rmrc.analysis.subject import Model, Packages, numbers, subject
from rmrc.law.task import Array, Task
from rmrc.simulation.inverse_kinematics import unwound
from rmrc.support.brief import brief
from rmrc.support.errors import QuestionError
from rmrc.support.spatial import AXES


@brief
@dataclass(frozen=True, eq=False)
class IkResult:
    """The result of `ik`.

    Attributes:
        task: The arm and the rows that count.
        goal: Target pose of the site, (7,).
        start: Joint positions at which the search began, (n,).
        limits: Whether the search kept the model's position limits.
        tolerance: Tolerance of |e|: orientation in rad, position over L.
        solution: Joint positions at the goal, or the nearest ones found; of all postures the nearest to
            the start.
        postures: All of them; None if only one was requested.
    """

    task: Task
    goal: Array
    start: Array
    limits: bool
    tolerance: float
    solution: Solution
    postures: Postures | None

    @property
    def found(self) -> bool:
        """Whether the goal is reached within the tolerance and the limits."""
        return self.solution.found if self.postures is None else self.postures.nearest is None

    @property
    def q(self) -> Array:
        """Joint positions of the solution, (n,) [rad or m]."""
        return self.solution.q


def ik(
    model: Model,
    to: ArrayLike | None = None,
    q: ArrayLike | None = None,
    *,
    quat: ArrayLike | None = None,
    to_q: ArrayLike | None = None,
    pose: ArrayLike | None = None,
    keyframe: str | None = None,
    site: str | None = None,
    body: str | None = None,
    packages: Packages | None = None,
    axes: Sequence[str] | None = None,
    task_frame: str | None = None,
    length: float | None = None,
    method: Method = "damped",
    limits: bool = True,
    every: bool = False,
    tolerance: float = TOLERANCE,
) -> IkResult:
    """Find joint positions that bring the site of an arm to a goal; the function behind `rmrc ik`.

    Args:
        model: An arm, an MJCF file, or a scenario.
        to: The goal: a value for each row that counts [m, rad], see `rmrc.analysis.ik.solve.goal_pose`; with
            `quat` one for each of x, y, z that counts.
        q: Joint positions to begin at, (n,) [rad or m]; None: those of the keyframe.
        quat: The goal's orientation [w, x, y, z], of any length but 0.
        to_q: The goal instead: the pose of the site at these joint positions, (n,) [rad or m].
        pose: The goal instead: [p, quat w x y z], (7,); rows that do not count are ignored.
        keyframe: Name of the joint positions to begin at; None: the start of a scenario, or else `home`.
        site: The site to bring there; None: that of the arm or scenario, or else of the hand: see
            `rmrc.arm.frames`.
        body: The body whose frame to bring there, instead of a site.
        packages: Folders of a URDF's packages, by their names; others are searched upward from the file.
        axes: Rows that count, of x y z rx ry rz; None: those of a scenario, or else those that the arm can
            move independently.
        task_frame: Frame of the rows: `world`, `base` or `site`; None: that of the scenario whose rows they
            are, or else `world`. A goal is a pose in the world: in another frame, all three positions count
            or none, and likewise rotations.
        length: Characteristic length, which makes meters and radians comparable [m]; None: that of a
            scenario, or else of the arm.
        method: `damped` steps from several starts, or `newton`'s from one.
        limits: Whether to keep the model's position limits.
        every: Whether to search for all postures, from many starts, by damped steps.
        tolerance: Tolerance of |e|: orientation in rad, position over L.

    Returns:
        The result. A goal that is not reached is no error: then `found` is False, and `q` is where |e| is
        smallest.

    Raises:
        ModelError: The file, the site or the keyframe is missing or unusable.
        QuestionError: There is no goal or more than one, or any of the others does not fit the arm.

    Example:
        >>> found = ik("models/planar_2link.xml", [1.0, 1.0])
        >>> found.found, np.degrees(found.q).round(6).tolist()
        (True, [90.0, -90.0])
        >>> found = ik("models/planar_2link.xml", [1.0, 1.0], every=True)
        >>> (np.degrees(found.postures.q).round(6) + 0.0).tolist()
        [[0.0, 90.0], [90.0, -90.0]]
    """
    if method not in METHODS:
        raise QuestionError(f'method must be one of {", ".join(METHODS)}, got "{method}"')
    if every and method != "damped":
        raise QuestionError(f'every takes the method "damped" alone, got "{method}"')
    asked = subject(model, q, keyframe, site, axes, length, body, packages, task_frame)
    asked.arm.require_open()
    task, start = searchable(asked.task), asked.q
    goal = _goal(task, to, quat, to_q, pose)
    if not every:
        solution = solve_ik(task, goal, start, method=method, limits=limits, tolerance=tolerance)
        return IkResult(task, goal, start, limits, tolerance, solution, None)
    postures = find_postures(task, goal, start, limits=limits, tolerance=tolerance)
    nearest = postures.nearest
    if nearest is None:
        limit = kept_limit(task.arm, limits)
        near = unwound(task.arm, limit, postures.q, start[None])
        best = near[np.argmin(np.linalg.norm((near - start) / task.joint_scale, axis=1))]
        nearest = judge(task, limit, best, checked_goals(goal, 1)[0], tolerance)
    return IkResult(task, goal, start, limits, tolerance, nearest, postures)


def searchable(task: Task) -> Task:
    """Return the task along world axes: for whole positions and rotations it is the same.

    Raises:
        QuestionError: It has only some of three rows along axes of the site or of the base.
    """
    if task.frame == "world":
        return task
    for three in (slice(0, 3), slice(3, 6)):
        counted = [axis for axis in AXES[three] if axis in task.axes]
        if len(counted) in (1, 2):
            raise QuestionError(
                f"rows {', '.join(counted)} along the axes of the {task.frame} are not searched for; give "
                f"axes with all of {', '.join(AXES[three])} or none, or a task frame of world"
            )
    return Task(task.arm, task.rows, task.length)


def _goal(
    task: Task, to: ArrayLike | None, quat: ArrayLike | None, to_q: ArrayLike | None, pose: ArrayLike | None
) -> Array:
    """Return the pose (7,) of the one goal that was given."""
    others = {"to_q": to_q, "pose": pose, "to": to if to is not None else quat}
    given = [name for name, value in others.items() if value is not None]
    if len(given) != 1:
        names = ", ".join(task.axes)
        raise QuestionError(
            f"give one goal: to with a value for each of {names}, to_q or pose; "
            f"got {' and '.join(given) or 'none'}"
        )
    if pose is not None:
        return numbers("pose", pose, ("x", "y", "z", "qw", "qx", "qy", "qz"))
    if to_q is not None:
        return task.arm.pose(numbers("to_q", to_q, task.arm.joints))
    return goal_pose(task, () if to is None else to, quat)
