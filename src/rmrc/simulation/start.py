"""The start of a run: joint positions that bring the site to a pose, found by a search."""

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.law.task import Task
from rmrc.scenario import StartPose
from rmrc.simulation.inverse_kinematics import search, unwound
from rmrc.support import spatial
from rmrc.support.errors import TargetError

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
    frame = arm.base_pose if section.frame == "base" else spatial.ORIGIN
    goal = spatial.pose_product(spatial.pose_inverse(frame), arm.pose(near))
    rows: list[int] = []
    if section.position is not None:
        goal[: len(section.position)] = section.position  # two values keep z of the frame
        rows += 0, 1, 2
    if section.orientation is not None:
        is_quaternion = len(section.orientation) == 4
        goal[3:] = (spatial.normalize if is_quaternion else spatial.quat_from_rpy)(section.orientation)
        rows += 3, 4, 5
    goal, task = spatial.pose_product(frame, goal), Task(arm, np.array(rows), length)
    first = np.clip(near, *arm.position_limit.T)[None]
    q, _, _ = search(task, arm.position_limit, AIM, STEPS, goal[None], first, arm.sampled(RESTARTS))
    (nearest,) = unwound(arm, arm.position_limit, q, near)
    error = spatial.pose_error(goal, arm.pose(nearest))
    distance = float(np.linalg.norm(error[:3])) if section.position else 0.0
    angle = float(np.linalg.norm(error[3:])) if section.orientation else 0.0
    if np.hypot(distance / length, angle) > TOLERANCE:
        away = [f"{distance:.4g} m"] if section.position else []
        away += [f"{np.degrees(angle):.4g} deg"] if section.orientation else []
        raise TargetError(f"must be within reach, the nearest pose found is {' and '.join(away)} away")
    return np.asarray(nearest)
