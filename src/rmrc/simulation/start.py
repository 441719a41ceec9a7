"""The start of a run: joint positions that bring the site to a pose, found by a search."""

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.law.descent import search, unwound
from rmrc.law.task import Task
from rmrc.scenario import StartPose
from rmrc.support.errors import TargetError
from rmrc.support.spatial import (
    ORIGIN,
    normalize,
    pose_error,
    pose_inverse,
    pose_product,
    quat_from_rpy,
)

Array = NDArray[np.float64]

# Tolerance of the error, as in `rmrc ik`: orientation in rad, position over the length.
TOLERANCE = 1e-9
# The search has a smaller tolerance, so that rounding does not break the promise.
AIM = 0.99 * TOLERANCE
# Steps of a try, and number of further starts if the given one leads nowhere.
STEPS, RESTARTS = 300, 200


def start_positions(arm: Arm, section: StartPose, near: Array, length: float) -> Array:
    """Return joint positions within the limits at which the site has a pose, (n,).

    The search starts from the given positions. If that fails, it tries others.

    Args:
        arm: The arm.
        section: The pose; components that it leaves out are as at the given positions.
        near: Joint positions, (n,).
        length: Characteristic length, which weighs rotation against position [m].

    Raises:
        TargetError: The arm does not reach the pose; it reports how near it comes.
    """
    goal = _goal(arm, section, arm.pose(near))
    parts = ((section.position, (0, 1, 2)), (section.orientation, (3, 4, 5)))
    rows = [row for given, some in parts if given is not None for row in some]
    task = Task(arm, np.array(rows), length)
    first = np.clip(near, *arm.position_limit.T)[None]
    q, _, _ = search(task, arm.position_limit, False, AIM, STEPS, goal[None], first, arm.sampled(RESTARTS))
    (found,) = unwound(arm, arm.position_limit, q, near)
    error = pose_error(goal, arm.pose(found))[task.rows]
    if np.linalg.norm(error * np.where(task.rows < 3, 1.0 / length, 1.0)) > TOLERANCE:
        away = [f"{np.linalg.norm(error[task.rows < 3]):.4g} m"] if section.position else []
        if section.orientation:
            away.append(f"{np.degrees(np.linalg.norm(error[task.rows > 2])):.4g} deg")
        raise TargetError(f"must be within reach, the nearest pose found is {' and '.join(away)} away")
    return np.asarray(found)


def _goal(arm: Arm, section: StartPose, now: Array) -> Array:
    """Return the pose in the world, (7,); a position of 2 values keeps z of its frame."""
    frame = arm.base_pose if section.frame == "base" else ORIGIN
    goal = pose_product(pose_inverse(frame), now)
    if section.position is not None:
        goal[: len(section.position)] = section.position
    turn = section.orientation
    if turn is not None and len(turn) == 4:
        goal[3:] = normalize(turn)
    elif turn is not None:
        goal[3:] = quat_from_rpy(turn)
    return pose_product(frame, goal)
