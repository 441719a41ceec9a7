"""The worlds of a search: the scenario itself, and with small errors of start, target, loads and loop."""

import numpy as np

from rmrc.scenario import Scenario, Variant, changes_of
from rmrc.scenario.sweep import MOST_DRAWN
from rmrc.simulation.prepare import Prepared
from rmrc.study.plan import sobol_point
from rmrc.support.errors import ScenarioError
from rmrc.tuning.robot import Options, Robot, lengths_of

# Number of further loops, beside the slowest, for the final run of a recommendation on the scenario itself.
LOOPS = 6


def draw_scenarios(nominal: Prepared, options: Options, robot: Robot) -> tuple[Variant, ...]:
    """Return the scenario itself and perturbed scenarios, drawn from the Sobol sequence.

    The scenario itself has the slowest and noisiest loop, the hardest case, and so has every second perturbed
    scenario. The first perturbed scenario has the fastest loop, and every second one after it a drawn loop.

    Args:
        nominal: The scenario.
        options: Number, seed and sizes of the perturbations; a start stays within the joints' position
            limits, and an offset is drawn only if the path has an absolute point for it to move.
        robot: Range of their loops, and their loads.

    Raises:
        ScenarioError: Too many numbers to draw.
    """
    scenario, arm = nominal.scenario, nominal.arm
    moved = [axis in scenario.task.axes and bool(options.offset) and _has_points(scenario) for axis in "xyz"]
    sizes = [arm.n if options.start else 0, sum(moved), len(robot.varied), len(robot.burdens)]
    if sum(sizes) > MOST_DRAWN:
        wrong = f"at most {MOST_DRAWN} numbers can be drawn, got {sum(sizes)}; use --start 0"
        raise ScenarioError.about("--perturbed", wrong)
    own = nominal.qpos[arm.wiring.qpos]
    # positions place the joints that are not actuated as in `home`, which must be where the keyframe has them
    placed = arm.at(arm.configuration("home")).configuration(own)
    if options.start and options.perturbed and not np.array_equal(placed, nominal.qpos):
        wrong = f'must be 0 with arm.start "{scenario.arm.start}", which has joints that are not actuated'
        raise ScenarioError.about("--start", f"{wrong} elsewhere than home")
    worlds = [_named("the scenario itself", robot.values(nominal, {}))]
    for index in range(options.perturbed if sum(sizes) or robot.calibration else 0):
        point = sobol_point(index, sum(sizes), options.seed)
        start, offset, loop, burden = np.split(point, np.cumsum(sizes)[:-1])
        shares = np.ones(len(loop)) if index % 2 else loop if index else np.zeros(len(loop))
        values = robot.values(nominal, dict(zip(robot.varied, shares, strict=True)))
        if options.start:
            off = options.start * lengths_of(nominal) * (2.0 * start - 1.0)
            values["arm.start"] = np.clip(own + off, *arm.position_limit.T)
        if any(moved):
            target = np.zeros(3)
            target[: len(scenario.target.offset)] = scenario.target.offset
            target[moved] += options.offset * (2.0 * offset - 1.0)
            values["target.offset"] = target
        values |= robot.burdened(nominal, burden.tolist())
        values |= robot.misfit(
            nominal, np.random.default_rng((options.seed, index)).uniform(-1.0, 1.0, 2 * arm.n)
        )
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


def _has_points(scenario: Scenario) -> bool:
    """Return whether a path has an absolute point for `target.offset`."""
    lines = (segment.line for segment in scenario.target.path)
    has_arc = any(segment.arc is not None for segment in scenario.target.path)
    return has_arc or any(line is not None and line.to is not None for line in lines)


def _named(name: str, values: dict[str, object]) -> Variant:
    changes = changes_of(values, "--vary")
    return Variant(f"{name} ({', '.join(map(str, changes))})" if changes else name, changes)
