"""Perturbed scenarios: small errors of start, target, payload, and the robot's loop."""

from dataclasses import dataclass

import numpy as np

from rmrc.scenario import ArcSegment, Change, LineSegment, Scenario, Variant, changes_of
from rmrc.scenario.sections import MOST_DRAWN
from rmrc.simulation.prepare import Prepared
from rmrc.study.sobol import sobol_point
from rmrc.support.errors import ScenarioError
from rmrc.tuning.robot import Robot

# Number of further loops, beside the slowest, for the final run of a recommendation on the scenario itself.
LOOPS = 6


@dataclass(frozen=True)
class Spread:
    """Sizes of the perturbations.

    Attributes:
        start: Start of each joint, to either side [rad]; for a sliding joint, times the task's length [m].
        offset: Offset of the target along each translational task axis, to either side [m].
        payload: Largest additional payload at the site [kg].
    """

    start: float = np.radians(1.0)
    offset: float = 0.002
    payload: float = 0.0

    def words(self, nominal: Prepared) -> str:
        """Return the sizes for a scenario, in words."""
        degrees = f"joints start within {np.degrees(self.start):.4g} deg"
        slides = f" (slides: {self.start:.3g} task.length)" if nominal.arm.is_slide.any() else ""
        target = f"target within {self.offset:g} m along each axis"
        if not has_points(nominal.scenario):
            target = "no target offset, because the task has no absolute point"
        parts = {degrees + slides: self.start, target: self.offset, f"payload up to {self.payload:g} kg more": self.payload}
        return "; ".join(part for part, size in parts.items() if size) or "no perturbation"


def draw_scenarios(
    nominal: Prepared, count: int, seed: int, spread: Spread, robot: Robot
) -> tuple[Variant, ...]:
    """Return the scenario itself and perturbed scenarios, drawn from the Sobol sequence.

    The scenario itself has the slowest and noisiest loop, the hardest case, and so has every second perturbed
    scenario. The first perturbed scenario has the fastest loop, and every second one after it a drawn loop.

    Args:
        nominal: The scenario.
        count: Number of perturbed scenarios.
        seed: Seed of the sequence.
        spread: Sizes of the perturbations; a start stays within the joints' position limits, and an offset is
            drawn only if the path has an absolute point for it to move.
        robot: Range of their loops.

    Raises:
        ScenarioError: A payload in an ideal plant, or too many numbers to draw.
    """
    scenario, arm = nominal.scenario, nominal.arm
    if spread.payload and not nominal.plant.has_physics:
        name = scenario.plant.kind
        raise ScenarioError.about(
            "--payload", f"must be 0 in an {name} plant, which has no loads; use another plant.kind"
        )
    axes = [i for i, axis in enumerate("xyz") if axis in scenario.task.axes] if has_points(scenario) else []
    joints = arm.n if spread.start else 0
    axes = axes if spread.offset else []
    loops = range(joints + len(axes), joints + len(axes) + len(robot.varied))
    drawn = joints + len(axes) + len(loops) + bool(spread.payload)
    if drawn > MOST_DRAWN:
        raise ScenarioError.about(
            "--perturbed", f"at most {MOST_DRAWN} numbers can be drawn, got {drawn}; use --start 0"
        )
    # positions place the joints that are not actuated as in `home`, which must be where the keyframe has them
    placed = arm.at(arm.configuration("home")).configuration(nominal.qpos[arm.wiring.qpos])
    if joints and count and not np.array_equal(placed, nominal.qpos):
        raise ScenarioError.about(
            "--start",
            f'must be 0 with arm.start "{scenario.arm.start}", which has joints that are not actuated '
            "elsewhere than home",
        )
    itself = changes_of(robot.values(nominal, {}))
    scenarios = [Variant(f"the scenario itself{_told(itself)}", itself)]
    for index in range(count if drawn or robot.calibration else 0):
        point = sobol_point(index, drawn, seed)
        loop = np.ones(len(loops)) if index % 2 else point[loops] if index else np.zeros(len(loops))
        values = robot.values(nominal, dict(zip(robot.varied, loop, strict=True)))
        if joints:
            off = (
                spread.start * np.where(arm.is_slide, nominal.task.length, 1.0) * (2.0 * point[:joints] - 1.0)
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
        values |= robot.misfit(nominal, np.random.default_rng((seed, index)).uniform(-1.0, 1.0, 2 * arm.n))
        changes = changes_of(values, "--vary")
        scenarios.append(Variant(f"perturbed scenario {index + 1}{_told(changes)}", changes))
    return tuple(scenarios)


def loops_between(nominal: Prepared, robot: Robot) -> tuple[Variant, ...]:
    """Return the scenario itself on loops evenly from the fastest to the slowest, without the slowest.

    Args:
        nominal: The scenario.
        robot: Range of its loop; none if that is a single loop.
    """
    shares = np.arange(LOOPS if robot.varied else 0) / LOOPS
    values = (robot.values(nominal, dict.fromkeys(robot.varied, float(share))) for share in shares)
    return tuple(Variant("the scenario itself", changes_of(one)) for one in values)


def _told(changes: tuple[Change, ...]) -> str:
    return f" ({', '.join(map(str, changes))})" if changes else ""


def has_points(scenario: Scenario) -> bool:
    """Return whether a path has an absolute point for `target.offset`, and the task an axis for it."""
    return not set("xyz").isdisjoint(scenario.task.axes) and any(
        isinstance(one, ArcSegment) or (isinstance(one, LineSegment) and one.line.to is not None)
        for one in scenario.target.path
    )
