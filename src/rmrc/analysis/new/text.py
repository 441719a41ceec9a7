"""A scenario as a text for people: every key with its unit and the reason for its value."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from rmrc.analysis.directions import impossible
from rmrc.analysis.new.move import BESIDE, Move
from rmrc.analysis.new.scaling import ASSUMED_RATE, PATH_SHARE, Scales
from rmrc.arm import Arm
from rmrc.arm.frames import code_of
from rmrc.arm.geometry import damping_maximum, tidy
from rmrc.law.task import Array
from rmrc.scenario import inline
from rmrc.scenario.arm import ToolSection
from rmrc.support.legible import quoted, visible

# Width of a comment.
WIDTH = 100
# Feedback [1/s]: an error falls to a third in 0.1 s, and the loop is stable even with ten ticks of delay.
FEEDBACK = 10.0
# Rate at which redundant joints return to the start [1/s]: slower than the feedback.
POSTURE_GAIN = 1.0
PERIOD = 0.001
# The target reaches its speed in a quarter of a second, and its acceleration in a tenth.
RISE, JERK_RISE = 0.25, 0.1
HOLD = 0.5
RMS = ": the rms distance of the site from the hinges' axes"

Seen: TypeAlias = Callable[[Path], Path | str]
"""Returns the path of a model as a scenario has it."""


def text(
    scales: Scales,
    move: Move,
    seen: Seen,
    name: str,
    plant: str,
    expect: Mapping[str, Any],
    said: Sequence[str],
) -> str:
    """Return the scenario.

    Args:
        scales: Scales of the arm.
        move: The motion.
        seen: Path of the model in the scenario.
        name: Name of the scenario.
        plant: Its kind.
        expect: Checks by name of metric.
        said: The comment on `expect`, its lines.
    """
    parts = (
        _head(scales, move, name), _arm(scales, move, seen), _task(scales), _control(scales, move),
        _target(move), f"plant: {{kind: {plant}}}   # ideal has no physics, model the robot's own actuators",
        _expect(expect, said),
    )  # fmt: skip
    return "\n".join(parts) + "\n"


def _head(scales: Scales, move: Move, name: str) -> str:
    arm, near = scales.task.arm, move.nearest
    lines = [
        f"# A first scenario for {visible(arm.path.name)}, by `rmrc new`: edit it, and run it by `rmrc run`."
    ]
    if move.how == "aside":
        lines += comment(
            "The search found no reachable singularity within the limits: the path goes aside and back."
        )
    else:
        what = "through" if move.how == "through" else "towards"
        lines += comment(
            f"The site moves {what} the nearest singularity found, at {listed_positions(scales, near.q)}, "
            f"and back. There the arm {impossible(near.wrench)}. Watch sigma, damping and qdot."
        )
    return "\n".join([*lines, f"name: {name}"])


def identity(arm: Arm, seen: Seen) -> dict[str, Any]:
    """Return the keys of `arm` in a scenario that identify an arm, without its start.

    Args:
        arm: The arm.
        seen: Path of the model in the scenario.
    """
    keys: dict[str, Any] = {"model": str(seen(arm.path))}
    if arm.frame is not None:
        key, value = arm.frame
        keys[key] = value if isinstance(value, str) else _tool(value, seen)
    if arm.packages:
        keys["packages"] = {name: str(seen(folder)) for name, folder in arm.packages}
    keys["joints"] = list(arm.joints)
    return keys | ({"stretch": dict(arm.stretch)} if arm.stretch else {})


def _tool(tool: ToolSection, seen: Seen) -> dict[str, Any]:
    keys = tool.model_dump(mode="json", exclude_defaults=True)
    return keys if tool.model is None else {**keys, "model": str(seen(tool.model))}


def _arm(scales: Scales, move: Move, seen: Seen) -> str:
    arm = scales.task.arm
    told = {
        "site": f"end effector (TCP); this model has {len(arm.sites)}",
        "body": "body whose frame is controlled; arm.site names a site instead",
        "tool": "body whose frame is controlled",
        "packages": "folders of the packages named in the file",
        "stretch": "factor on all lengths of a body",
    }
    notes = (visible(note) for note in arm.notes if code_of(note) == "assumed")
    lines = [line for note in notes for line in comment(f"ASSUMED: {note}")] + ["arm:"]
    for key, value in identity(arm, seen).items():
        lines.append(f"  {key}: {inline(value)}{f'   # {told[key]}' if key in told else ''}")
    if move.is_home:
        lines.append(f"  start: home   # {_home(arm)}")
    else:
        lines += comment(
            "rad or m; home itself is near a singularity, at a limit, or too far from the one above", 2
        )
        lines.append(f"  start: {inline([float(value) for value in move.start])}")
    return "\n".join(lines)


def _home(arm: Arm) -> str:
    """Return a description of home."""
    name = "home" if arm.home is None else arm.model.key(arm.home).name
    if name != "home":
        return f"keyframe {quoted(name) if name else arm.home}, as none is called home"
    if arm.home is None and "home" in arm.keyframes:
        return "no keyframe: all joints at 0, or in the middle of their range if 0 is outside"
    return "the keyframe of this name, or all joints at 0 without one"


def _task(scales: Scales) -> str:
    task = scales.task
    rows = ", ".join(task.axes)
    says = "m; length equivalent to 1 rad in sigma"
    if not scales.is_length_given:
        is_unit = task.length != task.arm.proportions.distance
        says = "m; sigma is per this length" if is_unit else f"{says}{RMS}"
    why = "all six" if len(task.axes) == 6 else "those that the joints can move independently"
    return "\n".join(
        [
            "task:",
            f"  axes: [{rows}]   # controlled rows of the twist: {why}",
            *comment(says, 2),
            f"  length: {inline(task.length)}",
        ]
    )


def _control(scales: Scales, move: Move) -> str:
    arm, epsilon = scales.task.arm, move.epsilon
    damping = {
        "schedule": "smallest_singular_value", "maximum": damping_maximum(epsilon),
        "below": epsilon,
    }  # fmt: skip
    share = float(np.mean(scales.task.least_sigma < epsilon))
    lines = ["control:", f"  period: {inline(PERIOD)}   # s", "  inverse:", "    method: damped"]
    lines += comment(
        f"`below`: damping begins where sigma_min is below it, in {100.0 * share:.0f} % of the range within "
        f"the limits, not at the start, where sigma_min is {scales.sigma_at(move.start):.3g}. `maximum` is "
        "below/sqrt(2), the least with which the gain sigma/(sigma^2 + lambda^2) never passes 1/below.", 4,
    )  # fmt: skip
    lines.append(f"    damping: {flow(damping)}")
    lines.append(f"  feedback: {inline(FEEDBACK)}   # 1/s; an error falls to a third in 1/feedback")
    if arm.n > len(scales.task.rows):
        lines += comment("the null-space motion returns the joints to their start, at this rate in 1/s", 2)
        lines.append(f"  nullspace: {{objective: posture, gain: {inline(POSTURE_GAIN)}}}")
    lines.append("  limits:")
    lines += comment(_rates_said(scales), 4)
    lines.append(f"    rate: {inline([float(value) for value in scales.rate])}")
    lines += comment(
        "no limit on accelerations: none is read from a model; set it as `acceleration`, in rad/s^2", 4
    )
    lines.append(
        "    on_excess: scale   # beyond a limit all joints are scaled alike: the site keeps its direction"
    )
    lines.append("  at_singularity: damp   # or slow, or stop")
    return "\n".join(lines)


def _rates_said(scales: Scales) -> str:
    arm = scales.task.arm
    assumed = [name for name, is_assumed in zip(arm.joints, scales.is_assumed, strict=True) if is_assumed]
    unit = " or ".join(dict.fromkeys(f"{one}/s" for one in arm.units))
    if not assumed:
        return f"{unit}, one per joint; those of the model"
    which = "the model has none" if len(assumed) == arm.n else f"the model has none for {', '.join(assumed)}"
    slides = f", and {tidy(ASSUMED_RATE * scales.task.length):g} m/s of slides" if arm.is_slide.any() else ""
    stands = f"so {ASSUMED_RATE:g} rad/s{slides} are assumed; use those of your actuators"
    return f"{unit}, one per joint. ASSUMED: {which}, {stands}"


def _target(move: Move) -> str:
    limits = {
        "velocity": move.velocity, "acceleration": tidy(move.velocity / RISE),
        "jerk": tidy(move.velocity / RISE / JERK_RISE), "angular_velocity": move.angular_velocity,
        "angular_acceleration": tidy(move.angular_velocity / RISE),
        "angular_jerk": tidy(move.angular_velocity / RISE / JERK_RISE),
    }  # fmt: skip
    past = f" It passes {BESIDE:g} rad, or of the arm's size, beside it." if move.how == "through" else ""
    lines = [
        "target:",
        *comment(f"m, and rad about an axis of the world: out, and back the same way.{past}", 2),
    ]
    lines.append("  path:")
    for sign in (1.0, -1.0):
        lines += [f"    - {flow(_segment(sign * move.by, sign * move.turn))}", f"    - hold: {{for: {HOLD}}}"]
    lines += comment(
        f"m/s, rad/s and so on: {100 * PATH_SHARE:.0f} % of the speed at which a gain of 1/below takes the "
        f"slowest joint to its limit; the rest is left for feedback. Speed is reached in {RISE:g} s.", 2,
    )  # fmt: skip
    return "\n".join([*lines, f"  limits: {flow(limits)}"])


def _segment(by: Array, turn: Array) -> dict[str, Any]:
    angle = float(np.linalg.norm(turn))
    axis = [tidy(float(x), 5) + 0.0 for x in turn / (angle or 1.0)]
    about = {"axis": axis, "angle": tidy(angle, 5)} if angle else None
    if not by.any():
        return {"turn": about}
    line: dict[str, Any] = {"by": [float(x) + 0.0 for x in by]}
    return {"line": line | ({"turn": about} if about else {})}


def _expect(expect: Mapping[str, Any], said: Sequence[str]) -> str:
    if not expect:
        return ""
    return "\n".join([*said, "expect:", *(f"  {name}: {flow(one)}" for name, one in expect.items())])


def flow(value: Any) -> str:
    """Return a value as YAML on one line, the keys in their order.

    >>> flow({"line": {"by": [0.1, 0.0], "a": 1e-05}})
    '{line: {by: [0.1, 0.0], a: 1.0e-05}}'
    """
    if not isinstance(value, dict):
        return inline(value)
    return f"{{{', '.join(f'{key}: {flow(one)}' for key, one in value.items())}}}"


def comment(text: str, indent: int = 0) -> list[str]:
    """Return a text as lines of comment."""
    before = " " * indent + "# "
    return textwrap.wrap(text, WIDTH, initial_indent=before, subsequent_indent=before, break_on_hyphens=False)


def listed_positions(scales: Scales, q: Array) -> str:
    """Return joint positions in words.

    Args:
        scales: Scales of the arm.
        q: Joint positions, (n,).
    """
    arm = scales.task.arm
    parts = zip(arm.joints, q, arm.units, strict=True)
    return ", ".join(f"{name} {0.0 if abs(at) < 5e-4 else at:.3g} {unit}" for name, at, unit in parts)
