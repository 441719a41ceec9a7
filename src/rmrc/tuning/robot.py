"""Uncertainty about a robot: delay, lag and noise of its loop, its calibration, and its loads.

It makes the worlds of a search: the scenario itself, and with small errors of start, target, loads and loop.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.scenario import Scenario, Variant, changes_of
from rmrc.scenario.profile import load_profile
from rmrc.scenario.sections import MOST_DRAWN, PROFILE
from rmrc.scenario.values import quantity
from rmrc.simulation.prepare import Prepared
from rmrc.study.runs import sobol_point
from rmrc.support.errors import Origin, Problem, ScenarioError

# What a user states -------------------------------------------------------------------------------
#
# What a user may ask of a search, with its defaults.

Only: TypeAlias = Sequence[str] | Mapping[str, Iterable[str | float]]
"""Values by key, or a text `KEY=V1,V2,...` for each key."""
Property: TypeAlias = str | float | Sequence[float] | None
"""A property of a robot: a number, the smallest and the largest, a text such as `6ms..12ms`, or nothing."""

# The factor on its feedback that a recommended setting must tolerate, unless the loop is ideal.
GAIN_MARGIN = 2.0


@dataclass(frozen=True)
class Options:
    """Options of `rmrc tune` and `rmrc.tune`.

    Attributes:
        only: Values to which keys are restricted, such as `{"control.inverse.method": ["damped",
            "filtered"]}`.
        perturbed: Number of perturbed scenarios; the worst of all counts.
        start: Perturbation of the joints' start, to either side [rad]; slides: times `task.length` [m].
        offset: Offset of the target along each translational task axis, to either side [m].
        payload: Largest additional payload of a perturbed scenario [kg]; None: 5 % of the mass that the
            joints move, and none with `ideal` or in an ideal plant.
        friction: Largest additional dry friction of each joint in a perturbed scenario [N·m; of slides, N];
            None: as much as accelerates the joint alone by 1 rad/s², with exceptions as for `payload`.
        delay: Dead time of the robot's commands [s]: a number, the smallest and the largest, or a text such
            as `6ms..12ms`. If neither this nor `lag` or `noise` is given, nor in the scenario, a modest robot
            is assumed.
        lag: Time constant with which its actuators follow [s].
        noise: Standard deviation of its encoders' noise [rad]; of slides, times `task.length` [m].
        calibration: Errors of its link lengths and joint zeros, to either side [1, rad].
        ideal: Whether to keep the loop of the scenario, and assume nothing.
        gain_margin: Factor on its feedback that a recommendation tolerates on the slowest of the robots; 1:
            no margin is required; None: 2, or 1 with `ideal`.
        slower: Factor on the duration with the scenario's own setting that another may take.
        runs: Largest number of runs, without the final checks.
        seed: Seed of the perturbed scenarios and of the search.
        threads: Number of threads, one world each; None: one per core.
    """

    only: Only = ()
    perturbed: int = 4
    start: float = math.radians(1.0)
    offset: float = 0.002
    payload: float | None = None
    friction: float | None = None
    delay: Property = None
    lag: Property = None
    noise: Property = None
    calibration: Property = None
    ideal: bool = False
    gain_margin: float | None = None
    slower: float = 1.1
    runs: int = 340
    seed: int = 0
    threads: int | None = None

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ScenarioError: Lists those that are too small or not finite.
        """
        least = dict.fromkeys(("perturbed", "seed", "start", "offset", "payload", "friction"), 0)
        least |= {"gain_margin": 1, "slower": 1, "runs": 2 * (self.perturbed + 1), "threads": 1}
        problems = list[Problem]()
        for name, low in least.items():
            value = getattr(self, name)
            if value is not None and not low <= value < math.inf:
                wrong = f"must be finite and >= {low}, got {value:g}"
                problems.append(Problem((), wrong, Origin(f"--{name.replace('_', '-')}")))
        if problems:
            raise ScenarioError(problems)

    @property
    def margin(self) -> float:
        """The gain margin that a recommendation must have on the slowest loop; 1: any."""
        if self.gain_margin is not None:
            return self.gain_margin
        return 1.0 if self.ideal else GAIN_MARGIN


# The assumed robot --------------------------------------------------------------------------------

Range = tuple[float, float]

# The assumed robot, by published loops, if nothing is known: commands take two periods and more, actuators
# lag, and an encoder of 19 bits rounds to 1e-5 rad.
DELAY, PERIODS, LAG, NOISE = 0.008, 2, 0.005, 1e-5

# The loads of perturbed scenarios, if nobody tells them: a payload of this share of the mass that the joints
# move, and a dry friction that accelerates each joint alone by this much [rad/s² or m/s²].
PAYLOAD, FRICTION = 0.05, 1.0

_UNITS = {"delay": "s", "lag": "s", "noise": "rad", "calibration": "1"}
_KEYS = {
    "delay": "plant.delay", "lag": "plant.lag", "noise": "arm.encoder.noise",
    "payload": "plant.payload", "friction": "plant.friction.coulomb",
}  # fmt: skip
_EXAMPLES = {"s": "8ms or 6ms..12ms", "rad": "1e-5 or 0..1e-5", "1": "0.002"}


@dataclass(frozen=True)
class Robot:
    """The range of a robot's loop, from the fastest to the slowest.

    Attributes:
        ranges: `delay` of its commands [s], `lag` of its actuators [s], and `noise` of its encoders [rad; of
            slides, times task.length, m]; those that are missing are as in the scenario.
        calibration: Errors of link lengths and joint zeros, to either side: share of a length, and angle
            [1, rad]; of slides, times task.length [m].
        origin: `assumed`, or the profile with its published loop; "" if options or the scenario describe it.
        burdens: Largest loads beside those of the scenario: `payload` [kg], and `friction`, dry friction of
            each joint, (n,) [N·m or N].
    """

    ranges: Mapping[str, Range]
    calibration: float = 0.0
    origin: str = ""
    burdens: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    @property
    def varied(self) -> tuple[str, ...]:
        """The varied properties."""
        return tuple(name for name, (low, high) in self.ranges.items() if low < high)

    def values(self, nominal: Prepared, shares: Mapping[str, float]) -> dict[str, object]:
        """Return the keys of a perturbed scenario, and their values.

        Args:
            nominal: The scenario.
            shares: Position of each varied property between its smallest and largest value, 0 to 1.
        """
        values: dict[str, object] = {}
        for name, (low, high) in self.ranges.items():
            value = low + shares.get(name, 1.0) * (high - low)
            slides = name == "noise" and nominal.arm.is_slide.any()
            values[_KEYS[name]] = value * lengths_of(nominal) if slides else value
        return values

    def burdened(self, nominal: Prepared, shares: Sequence[float]) -> dict[str, object]:
        """Return the keys of the loads, and their values.

        Args:
            nominal: The scenario.
            shares: Share of each largest load, 0 to 1.
        """
        pairs = zip(self.burdens.items(), shares, strict=True)
        keys = [(_KEYS[name], share * most) for (name, most), share in pairs]
        return {key: attrgetter(key)(nominal.scenario) + more for key, more in keys}

    def without(self, name: str) -> "Robot":
        """Return a robot without a property or load."""
        ranges, burdens = dict(self.ranges), dict(self.burdens)
        ranges.pop(name, None)
        burdens.pop(name, None)
        return replace(self, ranges=ranges, burdens=burdens)

    def misfit(self, nominal: Prepared, shares: NDArray[np.float64]) -> dict[str, object]:
        """Return the calibration keys of a perturbed scenario, and their values.

        Args:
            nominal: The scenario.
            shares: From -1 to 1, for each joint, and then for the link that it moves, (2 n,).
        """
        if not self.calibration:
            return {}
        arm, plant, (zeros, lengths) = nominal.arm, nominal.scenario.plant, np.split(shares, 2)
        bodies = [arm.body_names[body] for body in arm.model.jnt_bodyid[arm.wiring.joint]]
        factors = {
            name: plant.stretch.get(name, 1.0) * (1.0 + self.calibration * float(share))
            for name, share in zip(bodies, lengths, strict=True)
        }
        off = lengths_of(nominal) * self.calibration * zeros
        return {"plant.stretch": plant.stretch | factors, "plant.joint_offset": plant.joint_offset + off}

    def slowest(self, scenario: Scenario) -> Range:
        """Return the largest delay and the largest lag [s]; those of the scenario if the robot has none."""
        plant = scenario.plant
        delay, lag = self.ranges.get("delay", (plant.delay,)), self.ranges.get("lag", (np.max(plant.lag),))
        return delay[-1], float(lag[-1])

    @property
    def weights(self) -> tuple[str, str]:
        """The loads in words: `payload 0.85 kg`, `friction 0.1 to 2.14 N·m`."""
        payload, friction = (np.unique(self.burdens.get(name, 0.0)) for name in ("payload", "friction"))
        ends = " to ".join(f"{it:.3g}" for it in dict.fromkeys((friction[0], friction[-1])))
        return f"payload {payload[0]:.3g} kg", f"friction {ends} N·m"

    @property
    def words(self) -> str:
        """The properties in words: `delay 0 to 0.008 s, lag 0.005 s, noise 1e-05 rad`."""
        ranges = {**self.ranges, **({"calibration": (0.0, self.calibration)} if self.calibration else {})}
        return ", ".join(
            f"{name} {f'{low:.4g} to ' * (low < high)}{high:.4g} {_UNITS[name]}"
            for name, (low, high) in ranges.items()
        )


def lengths_of(nominal: Prepared) -> NDArray[np.float64]:
    """Return 1, and task.length for a joint that slides, (n,)."""
    return np.where(nominal.arm.is_slide, nominal.task.length, 1.0)


def robot_of(nominal: Prepared, options: Options) -> Robot:
    """Return the uncertainty about a scenario's robot, assumed if neither options nor scenario describe it.

    Args:
        nominal: The scenario. Its `tune` has the properties that the options do not have; if its plant or its
            encoders have a loop of their own, none is assumed.
        options: Options of the search.

    Raises:
        ScenarioError: Lists the problems of the ranges; or loads in an ideal plant.
    """
    arm, has_loads = nominal.arm, nominal.plant.has_physics
    mass = arm.model.body_subtreemass[arm.model.jnt_bodyid[arm.wiring.joint]].max()
    usual = {"payload": PAYLOAD * mass, "friction": FRICTION * arm.inertia}
    burdens = dict[str, NDArray[np.float64]]()
    for name, value in usual.items():
        option = getattr(options, name)
        if option and not has_loads:
            plant = nominal.scenario.plant.kind
            wrong = f"must be 0 in an {plant} plant, which has no loads; use another plant.kind"
            raise ScenarioError.about(f"--{name}", wrong)
        if option is None and has_loads and not options.ideal:
            burdens[name] = np.asarray(value)
        elif option:
            burdens[name] = np.full(np.shape(value), option)
    return replace(_loop_of(nominal.scenario, options), burdens=burdens)


def _loop_of(scenario: Scenario, options: Options) -> Robot:
    """Return the robot without its loads."""
    asked = {name: getattr(options, name) for name in _UNITS if getattr(options, name) is not None}
    if options.ideal:
        if asked:
            names = " and ".join(f"--{name}" for name in asked)
            raise ScenarioError.about("--ideal", f"uses the loop of the scenario, got {names} as well")
        return Robot({})
    ranges, problems = dict[str, Range](), list[Problem]()
    for name, unit in _UNITS.items():
        value = asked.get(name, getattr(scenario.tune, name))
        try:
            ranges |= {} if value is None else {name: read_range(value, unit)}
        except ValueError as error:
            problems.append(Problem((), str(error), Origin(f"--{name}")))
    if problems:
        raise ScenarioError(problems)
    calibration = ranges.pop("calibration", (0.0, 0.0))[1]
    if ranges or _has_loop(scenario):
        return Robot(ranges, calibration)
    profile = scenario.control.limits.profile or scenario.expect.get(PROFILE)
    published = _published(profile) if isinstance(profile, str) else {}
    if published:
        return Robot(published, calibration, f"profile {profile}")
    late = max(PERIODS * scenario.control.period, DELAY)
    return Robot({"delay": (0.0, late), "lag": (0.0, LAG), "noise": (NOISE, NOISE)}, calibration, "assumed")


def _published(profile: str) -> dict[str, Range]:
    """Return the properties of the loop that a profile has."""
    loop = load_profile(profile).loop
    known = {"delay": loop.delay, "lag": loop.lag}
    ranges = {name: read_range(it.value, "s") for name, it in known.items() if it}
    if loop.encoder_resolution:  # acts like noise that is uniform within a step
        ranges["noise"] = read_range(loop.encoder_resolution.value / math.sqrt(12.0), "rad")
    return ranges


def read_range(given: str | float | Sequence[str | float], unit: str) -> Range:
    """Return the smallest and the largest value of a range.

    Args:
        given: A number or a text, `8ms`, `6ms..12ms`, `0..1e-5`; or two of them, each without `..`.
        unit: Unit of numbers without one.

    Raises:
        ValueError: It is no range, negative, or the largest comes first.

    >>> read_range("6ms..12ms", "s"), read_range(0.008, "s")
    ((0.006, 0.012), (0.008, 0.008))
    """
    if isinstance(given, str):
        low, high = _read(given, unit)
    else:
        pair = (given, given) if isinstance(given, int | float) else given
        low, high = (quantity(end, unit)[0] if isinstance(end, str) else float(end) for end in pair)
    if not 0.0 <= low <= high < math.inf:
        raise ValueError(f"must be >= 0 and finite, smallest first, got {given}")
    return float(low), float(high)


def _read(text: str, unit: str) -> Range:
    low, _, high = text.partition("..")
    try:
        least, _ = quantity(low, unit)
        most, has_unit = quantity(high or low, unit)
    except ValueError as error:
        raise ValueError(f"must be a range such as {_EXAMPLES[unit]}, got {text}, which {error}") from None
    if unit == "s" and most >= 1.0 and not has_unit:  # the unit must be explicit
        raise ValueError(f"must be less than 1 s without a unit, got {text}: write {text}ms or {text}s")
    return least, most


def _has_loop(scenario: Scenario) -> bool:
    """Return whether a scenario describes its loop."""
    plant, encoder = scenario.plant, scenario.arm.encoder
    numbers: list[Any] = [plant.delay, plant.lag, plant.jitter, plant.loss, plant.resonance.frequency]
    return any(np.any(number) for number in (*numbers, encoder.noise, encoder.resolution, encoder.delay))


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
