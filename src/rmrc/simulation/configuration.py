"""The configuration in which a run starts: as the law assumes it, and as it is."""

import math

import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm
from rmrc.law.fit import wrong_length
from rmrc.scenario import Problems, Scenario, angle
from rmrc.simulation.start import start_positions
from rmrc.support.errors import ModelError, TargetError
from rmrc.support.notices import tell

Array = NDArray[np.float64]


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
    for j, position in enumerate(qpos[arm.wiring.qpos].tolist()):
        key = "arm.start" if isinstance(start, str) else f"arm.start[{j}]"
        hint = _in_degrees(arm, j, position)
        if limits := _limits_beyond(arm, j, position):
            text = f'joint "{arm.joints[j]}" must start within its limits {limits}, got {position:.6g}'
            problems.add(key, text + hint)
        elif hint and not isinstance(start, str):
            turns = f"{position:.6g} rad are {abs(position) / math.tau:.3g} turns"
            tell(f"warning: {scenario.locate(key)}: {turns}{hint}", once=key)
    return qpos if scenario.arm.pose is None else _moved_to_pose(scenario, arm, qpos, problems)


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
        if limits := _limits_beyond(arm, j, position):
            start = f'puts joint "{arm.joints[j]}" at {position:.6g} {arm.units[j]} at the start'
            text = f"{start}, beyond its limits {limits}; lower it, or start elsewhere"
            problems.add("plant.joint_offset", text)
    return arm.placed(assumed, q)


def _limits_beyond(arm: Arm, j: int, position: float) -> str:
    """Return the limits of a joint whose position is beyond them, in words; "" if it is within."""
    lower, upper = arm.position_limit[j]
    return "" if lower <= position <= upper else f"[{lower:.6g}, {upper:.6g}] {arm.units[j]}"


def _moved_to_pose(scenario: Scenario, arm: Arm, qpos: Array, problems: Problems) -> Array:
    """Return a configuration, (nq,), with the site moved to `arm.pose`."""
    pose, near = scenario.arm.pose, qpos[arm.wiring.qpos]
    assert pose is not None
    try:
        q = start_positions(arm.at(qpos), pose, near, scenario.task.length)
    except TargetError as error:
        problems.add("arm.pose", str(error))
        return qpos
    return arm.placed(qpos, q)


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
    if abs(position) <= math.tau or arm.is_slide[j] or _limits_beyond(arm, j, math.radians(position)):
        return ""
    return f"; for degrees write {position:.6g} deg"
