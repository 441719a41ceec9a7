"""Where a run starts: the joint positions, of those that bring the site to a pose, that a search finds."""

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

# Of the error, as `rmrc ik` has it: orientation in rad, position over the length.
TOLERANCE = 1e-9
# The search aims lower, so that rounding does not break the promise.
AIM = 0.99 * TOLERANCE
# Steps of a try, and other starts that are tried if the one that is given leads nowhere.
STEPS, RESTARTS = 300, 200


def start_positions(arm: Arm, section: StartPose, near: Array, length: float) -> Array:
    """Return joint positions within the limits at which the site has a pose, (n,).

    The search sets out from the positions that are given; only where it ends elsewhere it tries others.

    Args:
        arm: The arm.
        section: The pose; what it does not say is as at the positions that are given.
        near: Joint positions, (n,).
        length: Characteristic length, which weighs rotation against position [m].

    Raises:
        TargetError: The arm does not reach the pose: how near it comes.
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
