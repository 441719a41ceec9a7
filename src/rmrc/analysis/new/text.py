"""A first scenario as a file for people: what it assumes about the arm, and its keys."""

import math
import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np

from rmrc.analysis.directions import impossible
from rmrc.analysis.new.motion import Move
from rmrc.analysis.scaling import ASSUMED_RATE, Scales
from rmrc.analysis.trial import Seen, identity
from rmrc.arm.frames import code_of
from rmrc.arm.geometry import damping_maximum, tidy
from rmrc.arm.inventory import other_joints, shape_masses
from rmrc.law.task import Array
from rmrc.scenario import block
from rmrc.support.text import listed, visible

# Control period of a scenario [s]; feedback [1/s], which is stable even with ten ticks of delay.
PERIOD, FEEDBACK = 0.001, 10.0
# Share of the rate limits for the path; the feedback has the rest.
PATH_SHARE = 0.8
# The target reaches its speed in a quarter of a second, and its acceleration in a tenth [s].
RISE, JERK_RISE = 0.25, 0.1
# Width of a line.
WIDTH = 100


def text(name: str, keys: Mapping[str, Any], assumed: Mapping[str, str]) -> str:
    """Return a scenario as YAML, below comments with its assumptions.

    Args:
        name: Name of the model.
        keys: The scenario.
        assumed: A line for each subject.
    """
    wrapper = textwrap.TextWrapper(
        WIDTH, initial_indent="# ", subsequent_indent="#   ", break_on_hyphens=False
    )
    title = f"# A first scenario for {name}: edit it, and `rmrc run` it; `rmrc schema` explains its keys"
    lines = [wrapper.fill(f"{subject}: {line}") for subject, line in assumed.items()]
    return "\n".join([title, *lines, block(keys, WIDTH)])


def draft(scales: Scales, move: Move, name: str, seen: Seen) -> dict[str, Any]:
    """Return a scenario without its plant and expectations.

    Args:
        scales: Scales of the arm.
        move: The motion.
        name: Name of the scenario.
        seen: Path of the model in the scenario.
    """
    arm, task, below = scales.task.arm, scales.task, move.epsilon
    damping = {"schedule": "smallest_singular_value", "maximum": damping_maximum(below), "below": below}
    control = {
        "period": PERIOD, "inverse": {"method": "damped", "damping": damping}, "feedback": FEEDBACK,
        "limits": {"rate": scales.rate.tolist(), "on_excess": "scale"}, "at_singularity": "damp",
    }  # fmt: skip
    if arm.n > len(task.rows):  # redundant joints return slowly
        control["nullspace"] = {"objective": "posture", "gain": 1.0}
    speed = PATH_SHARE * below * scales.slowest / math.sqrt(2.0 if move.by.any() and move.turn.any() else 1.0)
    limits = {
        f"{of}{derivative}": tidy(tidy(speed * size) / rise)
        for of, size in (("", task.length), ("angular_", 1.0))
        for derivative, rise in (("velocity", 1.0), ("acceleration", RISE), ("jerk", RISE * JERK_RISE))
    }
    path = [
        _segment(move.by, move.turn), {"hold": {"for": 0.5}},
        _segment(-move.by, -move.turn), {"hold": {"for": 0.5}},
    ]  # fmt: skip
    return {
        "name": name,
        "arm": identity(arm, seen) | {"start": "home" if move.is_home else move.start.tolist()},
        "task": {"axes": list(task.axes), "length": task.length},
        "control": control,
        "target": {"path": path, "limits": limits},
    }


def _segment(by: Array, turn: Array) -> dict[str, Any]:
    """Return a line with a rotation, or one of the two."""
    angle = float(np.linalg.norm(turn))
    axis = [tidy(float(x), 5) + 0.0 for x in turn / (angle or 1.0)]
    about = {"turn": {"axis": axis, "angle": tidy(angle, 5)}} if angle else {}
    return {"line": {"by": (by + 0.0).tolist(), **about}} if by.any() else about


def assumptions(scales: Scales, move: Move) -> dict[str, str]:
    """Return what a scenario assumes about an arm, and its motion, a line each by its subject."""
    arm, near = scales.task.arm, move.nearest
    frames = [note for note in arm.notes if code_of(note).startswith("frame")]
    weights = [note for note in arm.notes if " kg" in note]
    shapes = listed(f"{body} {mass:.3g} kg" for body, mass in shape_masses(arm).items())
    idle = listed(other_joints(arm))
    lacking = listed(name for name, missing in zip(arm.joints, scales.is_assumed, strict=True) if missing)
    rates = f"ASSUMED {ASSUMED_RATE:g} rad/s, and on slides that times the length: {lacking}"
    way = f"{move.how} the nearest singularity found, at {scales.listed(near.q)}; there the arm "
    lines = {
        "joints": "all on the chain: " * (not arm.idle()) + ", ".join(arm.joints)
        + f"; not driven: {idle}" * bool(idle),
        "tool": "; ".join(frames) or f"{arm.frame[0] if arm.frame else 'site'} {arm.site}",
        "masses": "; ".join(weights)
        or (f"ASSUMED, from shapes of 1000 kg/m^3: {shapes}" if shapes else "those of the file"),
        "rate limits": rates if lacking else "the model's",
        "notes": "; ".join(note for note in arm.notes if note not in (*frames, *weights)),
        "motion": "aside; the search found no reachable singularity within the limits"
        if move.how == "aside" else way + impossible(near.wrench),
        "faults of the motion": ", ".join(move.faults),
    }  # fmt: skip
    return {subject: visible(line) for subject, line in lines.items() if line}
