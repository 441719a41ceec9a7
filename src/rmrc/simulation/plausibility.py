"""Values of a valid type that no arm has, or this arm cannot do, as where a unit is wrong.

The site never leaves a ball around the first axis of the chain. Points on successive axes keep their
distances, so its radius is the length of the polyline through them, and the travel of the slides. The points
are chosen to make it short: at each axis, the polyline goes on like a ray from a mirror.

Most such values are a warning, as they may be meant: a target beyond reach leads to a singularity. Only a
target ten times as far is refused.
"""

import math
import re
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from rmrc.arm import Arm
from rmrc.scenario import Scenario, inline
from rmrc.scenario.values import Section
from rmrc.support.errors import ScenarioError, tell
from rmrc.support.spatial import AXES, Array

Bounds: TypeAlias = dict[str, tuple[float, str, str]]

# What is this many times more than an arm can do is an error of units.
SENSELESS = 10.0
# A target may be beyond reach by this share of it without a word: that is how one leads to a singularity.
MARGIN = 0.01
# The rate of joints without a limit, and of the fastest of industrial arms [rad/s or m/s].
USUAL, FASTEST = 6.0, 21.0
# A site that stays within this does not move [m].
NOWHERE = 1e-3
# Repetitions after which the polyline is short: any is a bound.
REPETITIONS = 20
# The unit that is often meant instead of another, a thousandth of it; instead of rad, it is deg.
SLIPS = {"s": "ms", "m": "mm", "m/s": "mm/s", "kg": "g"}
# The most that known robots have, its unit, and the keys; they respond within 0.25 s.
MOST = (
    (0.25, "s", "control.period"), (0.05, "s", "plant.timestep"),
    (0.5, "s", "control.rate_filter plant.delay plant.jitter plant.lag arm.encoder.delay"),
    (0.5, "rad", "arm.encoder.offset arm.encoder.deviation plant.joint_offset"),
    (0.05, "rad", "arm.encoder.noise arm.encoder.resolution"), (0.2, "rad", "plant.backlash"),
    (400.0, "rad/s²", "control.limits.acceleration"), (40.0, "rad/s", "target.limits.angular_velocity"),
)  # fmt: skip
# Whole numbers above a turn are degrees in these keys, below the names of angles.
ANGLES = ("arm.pose", "arm.tool.orientation", "control.nullspace.posture", "target.path")
_ANGLE = re.compile(r"\b(angle|orientation|posture|configurations)\b")


class Reach(NamedTuple):
    """What an arm can do.

    Attributes:
        center: Of the ball that the site never leaves, (3,) [m].
        radius: Of the ball; infinite for an arm on a slide without ends, or one that only turns its site [m].
        speed: Bound on the speed of the site [m/s].
    """

    center: Array
    radius: float
    speed: float


def reach_of(arm: Arm) -> Reach:
    """Return what an arm can do, from its geometry, its ranges and its rate limits."""
    chain, ratio = arm.chain, np.abs(arm.chain.ratio)
    slides, leads = np.isinf(chain.pitch), np.nan_to_num(np.abs(chain.pitch), posinf=1.0)
    points = np.cumsum(chain.step, axis=0)
    way, axes = [*points[~slides], points[-1] + chain.tip_step], chain.axis[~slides]
    for k, axis in [*enumerate(axes)] * REPETITIONS:
        ends = np.array([way[k + 1], way[k - 1] if k else way[k + 1]]) - way[k]
        across = np.linalg.norm(np.cross(axis, ends), axis=1)[::-1]
        way[k] = way[k] + np.average(ends @ axis, weights=across if across.any() else None) * axis
    lengths = np.linalg.norm(np.diff(way, axis=0), axis=1)
    ranges = (ratio * np.abs(arm.position_limit).max(axis=1)[chain.leader])[leads > 0.0]
    travel = float(leads[leads > 0.0] @ ranges)
    levers = leads.copy()
    levers[~slides] += np.cumsum(lengths[::-1])[::-1] + travel
    rates = np.where(np.isfinite(arm.rate_limit), arm.rate_limit, USUAL)[chain.leader]
    radius = float(lengths.sum()) + travel
    return Reach(way[0], radius if radius > NOWHERE else math.inf, float(levers @ (ratio * rates)))


def bounds_of(arm: Arm, reach: Reach) -> Bounds:
    """Return the largest plausible value of keys, with its unit, and what the arm can do, in words."""
    mass, limits = float(arm.model.body_mass.sum()), arm.rate_limit[np.isfinite(arm.rate_limit)]
    rate, radius = float(limits.max(initial=0.0)) or FASTEST, reach.radius
    bounds = {
        key: (most, unit, f"known robots have at most {most:g}")
        for most, unit, keys in MOST for key in keys.split()
    }  # fmt: skip
    bounds["control.limits.rate"] = min(SENSELESS * rate, 40.0), "rad/s", f"the arm does {rate:.4g}"
    speed = min(reach.speed or math.inf, 5.0)
    bounds["target.limits.velocity"] = SENSELESS * speed, "m/s", f"the arm does at most {reach.speed:.3g}"
    bounds["task.length"] = SENSELESS * radius, "m", f"the arm reaches {radius:.3g}"
    bounds["arm.tool.position"] = max(2.0, 0.9 * radius), "m", f"the arm reaches {radius:.3g} with it"
    bounds["plant.payload"] = 3.0 * mass or math.inf, "kg", f"the bodies of its model have {mass:.3g}"
    return bounds | dict.fromkeys(ANGLES, (math.inf, "", ""))


def doubt(scenario: Scenario, bounds: Bounds) -> None:
    """Warn of the values of a scenario that are probably in another unit."""
    for key, (most, unit, words) in bounds.items():
        section: Any = scenario
        for step in key.split("."):
            section = getattr(section, step, None)
        for place, value in _numbers(key, section):
            text = ""
            if abs(value) > most:
                slip = SLIPS.get(unit, unit.replace("rad", "deg"))
                way = f"{value / 1e3:g}" if unit in SLIPS else f"{value:g} {slip}"
                text = f"{value:g} {unit}, but {words}; are these {slip}? write {way}"
            elif abs(value) > math.tau and value == round(value) and _ANGLE.search(place):
                text = f"{value:g} rad are {abs(value) / math.tau:.3g} turns; for degrees write {value:g} deg"
            if text:
                tell(f"warning: {scenario.locate(place)}: {text}", once=key)


def _numbers(key: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield every number of a section, with its dotted key."""
    if isinstance(value, tuple):
        for i, inner in enumerate(value):
            yield from _numbers(f"{key}[{i}]", inner)
    elif isinstance(value, Section):
        for name, inner in value:
            yield from _numbers(f"{key}.{name}", inner)
    elif isinstance(value, float):
        yield key, value


def check_points(scenario: Scenario, reach: Reach, number: int, points: Array) -> None:
    """Warn of points of a segment of the path, (k, 3), that the arm does not reach along the task's axes.

    Raises:
        ScenarioError: They are so far away that their unit must be another.
    """
    task = scenario.task
    rows = [i for i in range(3) if task.frame != "world" or not task.axes or AXES[i] in task.axes]
    distance = float(np.linalg.norm((points - reach.center)[:, rows], axis=1).max())
    if not distance > reach.radius * (1.0 + MARGIN):
        return
    segment = scenario.target.path[number]
    key, section = f"target.path[{number}].{segment.name}", getattr(segment, segment.name)
    vectors = {f"{key}.{name}": getattr(section, name, None) or () for name in ("to", "by", "center")}
    vectors["target.offset"] = scenario.target.offset
    longest = max(vectors, key=lambda name: math.hypot(*vectors[name]))
    way = "name its columns x_mm, y_mm and z_mm" if segment.file else "write meters"
    if any(vectors[longest]) and segment.file is None:
        key, way = longest, f"write {inline([x / 1e3 for x in vectors[longest]])}"
    text = f"leads {distance:.4g} m away from the first axis of the arm, which reaches {reach.radius:.4g} m"
    if distance >= SENSELESS * reach.radius:
        raise ScenarioError([scenario.problem(key, f"{text}; are these mm? {way}")])
    tell(f"warning: {scenario.locate(key)}: {text}", once="target.path")
