"""Copies of a scenario that are a little off: where the arm starts, what lies where, what is carried."""

from dataclasses import dataclass

import numpy as np

from rmrc.scenario import ArcSegment, LineSegment, Scenario, Variant, changes_of
from rmrc.scenario.sections import MOST_DRAWN
from rmrc.simulation.prepare import Prepared
from rmrc.study.sobol import sobol_point
from rmrc.support.errors import ScenarioError


@dataclass(frozen=True)
class Spread:
    """How far copies are off.

    Attributes:
        start: Of each joint, to either side [rad]; of one that slides, times the task's length [m].
        offset: Of the target along each translational task axis, to either side [m].
        payload: From nothing to so much more at the site [kg].
    """

    start: float = np.radians(1.0)
    offset: float = 0.002
    payload: float = 0.0


def draw_copies(nominal: Prepared, count: int, seed: int, spread: Spread) -> tuple[Variant, ...]:
    """Return the scenario itself and copies of it, drawn evenly by Sobol's sequence.

    Args:
        nominal: The scenario.
        count: Of copies.
        seed: What is drawn.
        spread: How far they are off; a start stays within the joints' position limits, and an offset is drawn
            only where the path has an absolute point for it to move.

    Raises:
        ScenarioError: A payload in an ideal plant, or too many numbers to draw.
    """
    scenario, arm = nominal.scenario, nominal.arm
    if spread.payload and not nominal.plant.has_physics:
        name = scenario.plant.kind
        raise ScenarioError.about(
            "--payload", f"must be 0 in an {name} plant, which carries nothing; take another plant.kind"
        )
    axes = [i for i, axis in enumerate("xyz") if axis in scenario.task.axes] if has_points(scenario) else []
    joints = arm.n if spread.start else 0
    axes = axes if spread.offset else []
    drawn = joints + len(axes) + bool(spread.payload)
    if drawn > MOST_DRAWN:
        raise ScenarioError.about(
            "--copies", f"at most {MOST_DRAWN} numbers can be drawn, got {drawn}; take --start 0"
        )
    # positions place the joints that are not driven as in `home`, which must be where the keyframe has them
    placed = arm.at(arm.configuration("home")).configuration(nominal.qpos[arm.wiring.qpos])
    if joints and count and not np.array_equal(placed, nominal.qpos):
        raise ScenarioError.about(
            "--start",
            f'must be 0 with arm.start "{scenario.arm.start}", which has joints that are not driven '
            "elsewhere than home",
        )
    copies = [Variant("the scenario itself")]
    for index in range(count if drawn else 0):
        point = sobol_point(index, drawn, seed)
        values: dict[str, object] = {}
        if joints:
            off = (
                spread.start
                * np.where(arm.is_slide, scenario.task.length, 1.0)
                * (2.0 * point[:joints] - 1.0)
            )
            start = np.clip(nominal.qpos[arm.wiring.qpos] + off, *arm.position_limit.T)
            values["arm.start"] = start
        if axes:
            moved = np.zeros(3)
            moved[: len(scenario.target.offset)] = scenario.target.offset
            moved[axes] += spread.offset * (2.0 * point[joints : joints + len(axes)] - 1.0)
            values["target.offset"] = moved
        if spread.payload:
            values["plant.payload"] = scenario.plant.payload + spread.payload * float(point[-1])
        changes = changes_of(values, "--vary")
        copies.append(Variant(f"copy {index + 1} ({', '.join(map(str, changes))})", changes))
    return tuple(copies)


def has_points(scenario: Scenario) -> bool:
    """Say whether a path has an absolute point, which `target.offset` moves, and the task an axis for it."""
    return not set("xyz").isdisjoint(scenario.task.axes) and any(
        isinstance(one, ArcSegment) or (isinstance(one, LineSegment) and one.line.to is not None)
        for one in scenario.target.path
    )
