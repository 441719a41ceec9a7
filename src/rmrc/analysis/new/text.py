"""A first scenario as a file for people: its assumptions first, and a reason for every number."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from rmrc.analysis.directions import impossible
from rmrc.analysis.new.motion import BESIDE, PATH_SHARE, PERIOD, Move
from rmrc.analysis.scaling import ASSUMED_RATE, Scales
from rmrc.arm import Arm
from rmrc.arm.frames import code_of
from rmrc.arm.geometry import damping_maximum, tidy
from rmrc.arm.inventory import other_joints, shape_masses
from rmrc.law.task import Array
from rmrc.scenario import inline
from rmrc.scenario.arm import ToolSection
from rmrc.support.legible import listed, quoted, visible

# Width of a comment.
WIDTH = 100
# The target reaches its speed in a quarter of a second, and its acceleration in a tenth [s].
RISE, JERK_RISE = 0.25, 0.1

Seen: TypeAlias = Callable[[Path], Path | str]
"""Returns the path of a model as a scenario has it."""

# Feedback is stable even with ten ticks of delay; redundant joints return more slowly.
SCENARIO = """\
name: {name}
arm:
{arm}
task:
  # controlled rows of the twist: those that the joints can move independently
  axes: {axes}
  # m that count as 1 rad in sigma{meaning}
  length: {length}
control:
  period: {period}   # s
  inverse:
    method: damped
    # `below`: damping begins where sigma_min is below it, in {share:.0f} % of the range within the limits,
    # not at the start, where sigma_min is {sigma:.3g}. `maximum` is below/sqrt(2), the least with which
    # the gain sigma/(sigma^2 + lambda^2) never passes 1/below.
    damping: {damping}
  feedback: 10.0   # 1/s; an error falls to a third in 1/feedback
{nullspace}  limits:
    # {units}, one per joint; {rates}
    rate: {rate}
    # no limit on accelerations: none is read from a model; set it as `acceleration`, in rad/s^2
    on_excess: scale   # beyond a limit all joints are scaled alike: the site keeps its direction
  at_singularity: damp   # or slow, or stop
target:
  # m, and rad about an axis of the world: out, and back the same way{passing}
  path:
    - {way_out}
    - hold: {{for: 0.5}}
    - {way_back}
    - hold: {{for: 0.5}}
  # m/s, rad/s and so on: {path_share:.0f} % of the speed at which a gain of 1/below takes the slowest joint
  # to its limit; the rest is left for feedback. Speed is reached in {rise:g} s.
  limits: {limits}
plant: {{kind: {plant}}}   # ideal has no physics, model the robot's own actuators
"""
NULLSPACE = """\
  # the null-space motion returns the joints to their start, at this rate in 1/s
  nullspace: {objective: posture, gain: 1.0}
"""


def text(scales: Scales, move: Move, seen: Seen, name: str, plant: str) -> str:
    """Return a scenario without its expectations as YAML.

    Args:
        scales: Scales of the arm.
        move: The motion.
        seen: Path of the model in the scenario.
        name: Name of the scenario.
        plant: Kind of its plant.
    """
    arm, task, below = scales.task.arm, scales.task, move.epsilon
    start = "home" if move.is_home else move.start.tolist()
    is_distance = task.length == arm.proportions.distance
    meaning = ": the rms distance of the site from the hinges' axes" if is_distance else ": sigma is per m"
    speeds = {"": move.velocity, "angular_": move.angular_velocity}
    limits = {
        f"{of}{derivative}": tidy(speed / rise)
        for of, speed in speeds.items()
        for derivative, rise in (("velocity", 1.0), ("acceleration", RISE), ("jerk", RISE * JERK_RISE))
    }
    keys = identity(arm, seen) | {"start": start}
    damping = {"schedule": "smallest_singular_value", "maximum": damping_maximum(below), "below": below}
    return SCENARIO.format(
        name=name, plant=plant, period=PERIOD, rise=RISE, path_share=100.0 * PATH_SHARE,
        arm="\n".join(f"  {key}: {inline(each)}" for key, each in keys.items()),
        axes=inline(list(task.axes)), length=inline(task.length),
        meaning="" if scales.is_length_given else meaning,
        share=100.0 * np.mean(task.least_sigma < below), sigma=scales.sigma_at(move.start),
        damping=inline(damping), nullspace=NULLSPACE if arm.n > len(task.rows) else "",
        units=" or ".join(dict.fromkeys(f"{unit}/s" for unit in arm.units)),
        rates="ASSUMED, see above" if scales.is_assumed.any() else "those of the model",
        rate=inline(scales.rate.tolist()), limits=inline(limits),
        passing=f",\n  # {BESIDE:g} rad, or of the arm's size, beside it" if move.how == "through" else "",
        way_out=_segment(move.by, move.turn), way_back=_segment(-move.by, -move.turn),
    )  # fmt: skip


def _segment(by: Array, turn: Array) -> str:
    angle = float(np.linalg.norm(turn))
    axis = [tidy(float(x), 5) + 0.0 for x in turn / (angle or 1.0)]
    about = {"turn": {"axis": axis, "angle": tidy(angle, 5)}} if angle else {}
    return inline({"line": {"by": (by + 0.0).tolist(), **about}} if by.any() else about)


def assumptions(scales: Scales, move: Move) -> dict[str, str]:
    """Return what a scenario assumes about an arm, and its motion, a line each by its subject."""
    arm, near = scales.task.arm, move.nearest
    kind, name = arm.frame or ("site", arm.site)
    frames = [note for note in arm.notes if code_of(note).startswith("frame")]
    notes = [note for note in arm.notes if note not in frames]
    weights = [note for note in notes if " kg" in note]
    shapes = [f"{body} {mass:.3g} kg" for body, mass in shape_masses(arm).items()]
    computed = f"ASSUMED, from shapes of 1000 kg/m^3: {listed(shapes)}" if shapes else "those of the file"
    idle = [each.name for each in other_joints(arm)]
    lacking = [name for name, missing in zip(arm.joints, scales.is_assumed, strict=True) if missing]
    rates = f"ASSUMED {ASSUMED_RATE:g} rad/s, and on slides that times the length: {', '.join(lacking)}"
    motion = f"{move.how} the nearest singularity found, at {scales.listed(near.q)}, and back; there the arm "
    lines = {
        "joints": ("" if arm.idle() else "all on the chain: ") + ", ".join(arm.joints)
        + (f"; not driven: {listed(idle)}" if idle else ""),
        "tool": "; ".join(frames) or f"{kind} {arm.site if kind == 'site' else name}"
        + ", the only site" * (arm.sites == (arm.site,)),
        "masses": "; ".join(weights) or computed,
        "rate limits": rates if lacking else "the model's",
        "start": _home(arm) if move.is_home else scales.listed(move.start),
        "notes": "; ".join(note for note in notes if note not in weights),
        "motion": "aside and back; the search found no reachable singularity within the limits"
        if move.how == "aside" else motion + impossible(near.wrench),
    }  # fmt: skip
    return {subject: visible(line) for subject, line in lines.items() if line}


def _home(arm: Arm) -> str:
    """Return a description of home."""
    if arm.home is not None and (name := arm.model.key(arm.home).name) != "home":
        return f"keyframe {quoted(name) if name else arm.home}, as none is called home"
    return "home" if arm.home is not None else "home, without a keyframe: joints at 0 or in mid-range"


def identity(arm: Arm, seen: Seen) -> dict[str, Any]:
    """Return the keys of `arm` in a scenario that identify an arm, without its start.

    Args:
        arm: The arm.
        seen: Path of the model in the scenario.
    """
    keys: dict[str, Any] = {"model": str(seen(arm.path))}
    if arm.frame is not None:
        key, frame = arm.frame
        keys[key] = frame if isinstance(frame, str) else _tool(frame, seen)
    if arm.packages:
        keys["packages"] = {name: str(seen(folder)) for name, folder in arm.packages}
    keys["joints"] = list(arm.joints)
    return keys | ({"stretch": dict(arm.stretch)} if arm.stretch else {})


def _tool(tool: ToolSection, seen: Seen) -> dict[str, Any]:
    keys = tool.model_dump(mode="json", exclude_defaults=True)
    return keys if tool.model is None else {**keys, "model": str(seen(tool.model))}


def comment(lines: Mapping[str, str]) -> str:
    """Return lines by their subjects as comments."""
    filled = [
        textwrap.wrap(f"{subject}: {line}", WIDTH, initial_indent="# ", subsequent_indent="#   ",
                      break_on_hyphens=False)
        for subject, line in lines.items()
    ]  # fmt: skip
    return "\n".join(row for rows in filled for row in rows) + "\n"


def expectations(expect: Mapping[str, Any], table: Sequence[Sequence[str]], remarks: Sequence[str]) -> str:
    """Return the section `expect` as YAML, below a table of metrics and remarks.

    Args:
        expect: Checks by name of metric.
        table: Its rows of cells, the headings first.
        remarks: Sentences.
    """
    wide = [max(map(len, column)) for column in zip(*table, strict=True)]
    rows = ["   ".join(map(str.ljust, row, wide)) for row in table]
    said = [line for remark in remarks for line in textwrap.wrap(remark, WIDTH - 2)]
    lines = [f"# {row}".rstrip() for row in (*said, *rows)]
    return (
        "\n".join([*lines, "expect:", *(f"  {name}: {inline(each)}" for name, each in expect.items())]) + "\n"
    )
