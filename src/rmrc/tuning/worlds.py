"""The worlds of a search: the scenario itself, and with small errors of start, target, payload and loop."""

from dataclasses import dataclass

import numpy as np

from rmrc.scenario import Scenario, Variant, changes_of
from rmrc.scenario.sweep import MOST_DRAWN
from rmrc.simulation.prepare import Prepared
from rmrc.study.sobol import sobol_point
from rmrc.support.errors import ScenarioError
from rmrc.tuning.robot import Robot, lengths_of

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
        start = f"joints start within {np.degrees(self.start):.4g} deg"
        slides = f" (slides: {self.start:.3g} task.length)" if nominal.arm.is_slide.any() else ""
        target = f"target within {self.offset:g} m along each axis"
        if not has_points(nominal.scenario):
            target = "no target offset, because the task has no absolute point"
        payload = f"payload up to {self.payload:g} kg more"
        parts = {start + slides: self.start, target: self.offset, payload: self.payload}
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
        wrong = f"must be 0 in an {scenario.plant.kind} plant, which has no loads; use another plant.kind"
        raise ScenarioError.about("--payload", wrong)
    moved = [axis in scenario.task.axes and bool(spread.offset) and has_points(scenario) for axis in "xyz"]
    sizes = [arm.n if spread.start else 0, sum(moved), len(robot.varied), bool(spread.payload)]
    if sum(sizes) > MOST_DRAWN:
        wrong = f"at most {MOST_DRAWN} numbers can be drawn, got {sum(sizes)}; use --start 0"
        raise ScenarioError.about("--perturbed", wrong)
    own = nominal.qpos[arm.wiring.qpos]
    # positions place the joints that are not actuated as in `home`, which must be where the keyframe has them
    placed = arm.at(arm.configuration("home")).configuration(own)
    if spread.start and count and not np.array_equal(placed, nominal.qpos):
        wrong = f'must be 0 with arm.start "{scenario.arm.start}", which has joints that are not actuated'
        raise ScenarioError.about("--start", f"{wrong} elsewhere than home")
    worlds = [_named("the scenario itself", robot.values(nominal, {}))]
    for index in range(count if sum(sizes) or robot.calibration else 0):
        point = sobol_point(index, sum(sizes), seed)
        start, offset, loop, payload = np.split(point, np.cumsum(sizes)[:-1])
        shares = np.ones(len(loop)) if index % 2 else loop if index else np.zeros(len(loop))
        values = robot.values(nominal, dict(zip(robot.varied, shares, strict=True)))
        if spread.start:
            off = spread.start * lengths_of(nominal) * (2.0 * start - 1.0)
            values["arm.start"] = np.clip(own + off, *arm.position_limit.T)
        if any(moved):
            target = np.zeros(3)
            target[: len(scenario.target.offset)] = scenario.target.offset
            target[moved] += spread.offset * (2.0 * offset - 1.0)
            values["target.offset"] = target
        if spread.payload:
            values["plant.payload"] = scenario.plant.payload + spread.payload * float(payload[0])
        values |= robot.misfit(nominal, np.random.default_rng((seed, index)).uniform(-1.0, 1.0, 2 * arm.n))
        worlds.append(_named(f"perturbed scenario {index + 1}", values))
    return tuple(worlds)


def loops_between(nominal: Prepared, robot: Robot) -> tuple[Variant, ...]:
    """Return the scenario itself on loops evenly from the fastest to the slowest, without the slowest.

    Args:
        nominal: The scenario.
        robot: Range of its loop; none if that is a single loop.
    """
    shares = np.arange(LOOPS if robot.varied else 0) / LOOPS
    loops = (robot.values(nominal, dict.fromkeys(robot.varied, float(share))) for share in shares)
    return tuple(_named("the scenario itself", values) for values in loops)


def has_points(scenario: Scenario) -> bool:
    """Return whether a path has an absolute point for `target.offset`, and the task an axis for it."""
    return not set("xyz").isdisjoint(scenario.task.axes) and any(
        segment.arc is not None or (segment.line is not None and segment.line.to is not None)
        for segment in scenario.target.path
    )


def _named(name: str, values: dict[str, object]) -> Variant:
    changes = changes_of(values, "--vary")
    return Variant(f"{name} ({', '.join(map(str, changes))})" if changes else name, changes)
