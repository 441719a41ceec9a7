"""The configuration in which a run starts: as the law assumes it, and as it is."""

import math

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.law.settings import wrong_length
from rmrc.law.task import Task
from rmrc.scenario import Problems, Scenario, StartPose, angle
from rmrc.simulation.inverse_kinematics import search, unwound
from rmrc.support import spatial
from rmrc.support.errors import ModelError, TargetError, tell

Array = NDArray[np.float64]

# Tolerance of the error, as in `rmrc ik`: orientation in rad, position over the length.
TOLERANCE = 1e-9
# The search has a smaller tolerance, so that rounding does not break the promise.
AIM = 0.99 * TOLERANCE
# Steps of a try, and number of further starts if the given one leads nowhere.
STEPS, RESTARTS = 300, 200


def assumed_configuration(scenario: Scenario, arm: Arm, problems: Problems) -> Array:
    """Return the start configuration of the model that the law assumes, (nq,).

    Args:
        scenario: The scenario; `arm.start` and `arm.pose` give the start.
        arm: The arm that it names.
        problems: A start that cannot be is added; the configuration is then another.
    """
    start = scenario.arm.start
    if not isinstance(start, str) and len(start) != arm.n:
        problems.add("arm.start", wrong_length(len(start), arm))
        start = "home"
    try:
        qpos = arm.configuration(start)
    except ModelError as error:
        problems.add("arm.start", f"{error}{_as_positions(start, arm)}")
        return np.array(arm.model.qpos0)
    q = _as_printed(arm, qpos[arm.wiring.qpos])
    qpos = qpos if np.array_equal(q, qpos[arm.wiring.qpos]) else arm.placed(qpos, q)
    for j, position in enumerate(q.tolist()):
        key = "arm.start" if isinstance(start, str) else f"arm.start[{j}]"
        hint, limits, excess = _in_degrees(arm, j, position), *_beyond(arm, j, position)
        text = f'joint "{arm.joints[j]}" must start within its limits {limits}, got {position:.6g}'
        if limits and (hint or excess > np.ptp(arm.position_limit[j])):
            problems.add(key, text + hint)
        elif limits:
            begins = f'joint "{arm.joints[j]}" starts {excess:.3g} {arm.units[j]} outside its limits {limits}'
            tell(f"warning: {scenario.locate(key)}: {begins}; it comes back while the path goes on", once=key)
        elif hint and not isinstance(start, str):
            turns = f"{position:.6g} rad are {abs(position) / math.tau:.3g} turns"
            tell(f"warning: {scenario.locate(key)}: {turns}{hint}", once=key)
    if scenario.arm.pose is not None:
        try:
            near = qpos[arm.wiring.qpos]
            q = start_positions(arm.at(qpos), scenario.arm.pose, near, scenario.task.length)
            return arm.placed(qpos, q)
        except TargetError as error:
            problems.add("arm.pose", str(error))
    return qpos


def true_configuration(scenario: Scenario, arm: Arm, assumed: Array, problems: Problems) -> Array:
    """Return the true start configuration of the model, (nq,).

    Args:
        scenario: The scenario; `plant.joint_offset` is the difference.
        arm: The arm that it names.
        assumed: The configuration that the law assumes, (nq,).
        problems: An offset that leads beyond the limits is added.
    """
    offset = scenario.plant.joint_offset
    offsets = offset if isinstance(offset, tuple) else (offset,) * arm.n
    if not any(offsets) or len(offsets) != arm.n:  # a wrong number of them is the hardware's problem
        return assumed
    q = assumed[arm.wiring.qpos] + offsets
    for j, position in enumerate(q.tolist()):
        if limits := _beyond(arm, j, position)[0]:
            start = f'puts joint "{arm.joints[j]}" at {position:.6g} {arm.units[j]} at the start'
            text = f"{start}, beyond its limits {limits}; lower it, or start elsewhere"
            problems.add("plant.joint_offset", text)
    return arm.placed(assumed, q)


def start_positions(arm: Arm, section: StartPose, near: Array, length: float | None) -> Array:
    """Return joint positions within the limits at which the site has a pose, (n,).

    The search starts from the given positions. If that fails, it tries others.

    Args:
        arm: The arm.
        section: The pose; components that it leaves out are as at the given positions.
        near: Joint positions, (n,).
        length: Characteristic length, which weighs rotation against position [m]; None: that of the arm.

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
    length = arm.proportions.length(rows) if length is None else length
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
        hint = "; are these mm?" if distance > 10.0 * length else ""
        raise TargetError(f"must be within reach, the nearest pose found is {' and '.join(away)} away{hint}")
    return np.asarray(nearest)


def _beyond(arm: Arm, j: int, position: float) -> tuple[str, float]:
    """Return the limits of a joint in words, and how far a position is beyond; "" and 0 if it is within."""
    lower, upper = arm.position_limit[j].tolist()
    excess = max(lower - position, position - upper, 0.0)
    return (f"[{lower:.6g}, {upper:.6g}] {arm.units[j]}" if excess else ""), excess


def _as_printed(arm: Arm, q: Array) -> Array:
    """Return positions, (n,); one that is a limit as it is printed, to 4 to 6 digits, is at the limit."""
    at_limit = np.clip(q, *arm.position_limit.T)
    same = [any(f"{a:.{k}g}" == f"{b:.{k}g}" for k in (4, 5, 6)) for a, b in zip(q, at_limit, strict=True)]
    return np.where(same, at_limit, q)


def _as_positions(start: object, arm: Arm) -> str:
    """Return the hint for positions in place of a keyframe's name."""
    if not isinstance(start, str):
        return ""
    if start.strip().lower() in ("zero", "zeros", "null"):
        return f"; write [{', '.join('0' for _ in arm.joints)}] for all joints at zero"
    try:
        angle(start)
    except ValueError:
        return ""
    return f"; write [{', '.join([start.strip()] * arm.n)}], a position for each joint"


def _in_degrees(arm: Arm, j: int, position: float) -> str:
    """Return the hint for a position beyond a turn that would be within the limits in degrees."""
    if abs(position) <= math.tau or arm.is_slide[j] or _beyond(arm, j, math.radians(position))[0]:
        return ""
    return f"; for degrees write {position:.6g} deg"
