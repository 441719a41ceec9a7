"""All sections of a scenario: their fields are the keys of a file, with unit, default and meaning.

Those of the arm, the plant, a sweep and a search stand here; `control` and `target` have modules of their
own.
"""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from rmrc.scenario import values as types
from rmrc.scenario.choices import PLANTS
from rmrc.scenario.control import ControlSection, TaskSection
from rmrc.scenario.profile import ProfileName
from rmrc.scenario.reading import show, split
from rmrc.scenario.target import TargetSection
from rmrc.scenario.values import (
    AngleRange,
    Bounds,
    Choice,
    Exclusive,
    Name,
    NotNegative,
    Number,
    Range,
    Section,
    Seed,
    TextOr,
    Values,
    key,
    rule,
)
from rmrc.support.errors import Key
from rmrc.support.spatial import quat_from_rpy

# Nobody can read a sweep over more keys than this, and the Sobol sequence here has this many dimensions.
MOST_DRAWN = 20

# Keys that no variant changes.
_FIXED = ("name", "look", "baseline", "sweep", "tune")

_Whole = Annotated[int, Field(strict=True, ge=1)]


def _key_but(*fixed: str) -> AfterValidator:
    """Return the check of a text that is a key: not one of some keys, nor below one of some sections."""

    def check(name: str) -> str:
        try:
            section = str(split(name)[0])
        except ValueError as error:
            raise rule(str(error).removeprefix(f"{name!r} ")) from None
        if section in fixed or name in fixed:
            way = "; use sweep.repeat and sweep.seed" if name.endswith("seed") else ""
            raise rule(f"cannot be changed here: give a key of a single run, such as control.feedback{way}")
        return name

    return AfterValidator(check)


_Varied = Annotated[str, _key_but(*_FIXED, "arm.encoder.seed", "plant.seed")]


class SweepSection(Section):
    """Variants for `rmrc sweep`: a grid, samples between bounds, repeats.

    Attributes:
        vary: values of keys; the sweep runs every combination
        draw: bounds of keys that are drawn uniformly
        sampler: independent samples, or the Sobol sequence, which covers the range more evenly
        samples: samples for each combination of `vary`; powers of 2 suit Sobol best
        repeat: runs per sample, each with other encoder errors, jitter and losses
        seed: seed of samples, from which arm.encoder.seed and plant.seed count; null: from their own
    """

    vary: dict[_Varied, Values] = key({})
    draw: dict[_Varied, Bounds] = key({}, max_length=MOST_DRAWN)
    sampler: Literal["random", "sobol"] = "random"
    samples: _Whole = 64
    repeat: _Whole = 1
    seed: Seed | None = None

    @model_validator(mode="after")
    def _each_key_once(self) -> Self:
        for name in self.draw.keys() & self.vary.keys():
            raise rule("must be in vary or in draw, got both", ("sweep", "draw", name))
        return self


_BASELINE = "value in a second run of `rmrc run`, for comparison"
Baseline = dict[Annotated[str, _key_but(*_FIXED, "expect")], Annotated[Any, Field(description=_BASELINE)]]


class TuneSection(Section):
    """Uncertainty about the robot, over which `rmrc tune` finds robust settings.

    Attributes:
        delay: dead time of commands, or its range; null: as in `plant`, or assumed without data of the robot
        lag: time constant of the actuators, as `delay`
        noise: standard deviation of the encoders' noise, for slides over task.length, as `delay`
        calibration: largest relative error of link lengths and of joint zeros (slides over task.length);
            null: none
    """

    delay: Range | None = key(None, "s")
    lag: Range | None = key(None, "s")
    noise: AngleRange | None = key(None, "rad")
    calibration: NotNegative | None = key(None, "1 or rad")


# MuJoCo's longest step where neither the scenario nor the plant sets another [s].
TIMESTEP = 0.001


class FrictionSection(Section):
    """Joint friction beyond the model's: no actuator compensates for it.

    Attributes:
        coulomb: dry friction added to the model's
        viscous: viscous friction added to the model's damping
    """

    coulomb: types.NotNegativeOrEach = key(0.0, "N·m or N")
    viscous: types.NotNegativeOrEach = key(0.0, "N·m·s/rad or N·s/m")


class ResonanceSection(Section):
    """Resonance: the rates of all joints oscillate about the received commands like a mass on a spring.

    Attributes:
        frequency: natural frequency, not for ideal; null: no resonance
        damping: damping ratio ζ: 0 never decays, 1 does not overshoot
    """

    frequency: types.Positive | None = key(None, "Hz")
    damping: types.NotNegative = key(0.1, "1")


class PlantSection(Section):
    """The plant, which executes the commanded rates.

    Attributes:
        kind: what turns commanded rates into motion
        kv: servo: torque or force per unit rate error; null: inertia at home over the timestep, plus damping
        bandwidth: torque, and motors of model: acceleration per unit rate error; null: 500 or, if less,
            1/control.period
        timestep: MuJoCo's step, of which control.period is a multiple; null: at most 0.001, or
            for model the model's
        gravity_compensation: whether the arm carries its weight, and servo its springs; null: true, or for
            model as in it
        friction_compensation: servo, torque: whether actuators compensate for joint damping and dry friction
        payload: point mass at the site, unknown to the controller; not for ideal
        gravity: gravity along world axes, not for ideal; null: the model's
        wrench: external wrench [f; n] on the site, along world axes
        delay: dead time of commands
        jitter: largest additional dead time, random per command; overtaken commands are dropped
        loss: fraction of commands that never arrive; the last one holds
        lag: time constant with which rates follow commands
        resonance: resonance of the actuators
        backlash: play between actuators and joints, crossed at each reversal; not for ideal
        seed: seed of jitter and losses
        friction: servo, torque, model: joint friction without compensation
        stretch: factor on all lengths of a body, unknown to the controller; multiplies `arm.stretch`
        joint_offset: error of the joint zeros: true position minus the assumed one
    """

    kind: Literal[PLANTS.names] = PLANTS.default  # type: ignore[name-defined]
    kv: types.OneOrEach | None = key(None, "N·m·s/rad or N·s/m")
    bandwidth: types.Positive | None = key(None, "1/s")
    timestep: types.Positive | None = key(None, "s")
    gravity_compensation: types.Switch | None = None
    friction_compensation: types.Switch = True
    payload: types.NotNegative = key(0.0, "kg")
    gravity: types.Point | None = key(None, "m/s²")
    wrench: types.Wrench = key((0.0,) * 6, "N, N·m")
    delay: types.NotNegative = key(0.0, "s")
    jitter: types.NotNegative = key(0.0, "s")
    loss: types.Share = key(0.0, "1")
    lag: types.NotNegativeOrEach = key(0.0, "s")
    resonance: ResonanceSection = ResonanceSection()
    backlash: types.NotNegativeAngleOrEach = key(0.0, "rad or m")
    seed: types.Seed = 0
    friction: FrictionSection = FrictionSection()
    stretch: dict[str, types.Positive] = key({}, "1")
    joint_offset: types.AngleOrEach = key(0.0, "rad or m")

    @property
    def is_compensated(self) -> bool:
        """Whether to switch on gravity compensation of the arm's bodies; if not, the model decides."""
        wanted = self.gravity_compensation
        return not PLANTS[self.kind].own if wanted is None else wanted


class EncoderSection(Section):
    """Errors of the arm's encoders: the controller uses their readings instead of the true q.

    Attributes:
        offset: constant offset of the readings
        deviation: standard deviation of a random, constant addition to `offset`
        noise: standard deviation of white noise per tick
        resolution: step to which readings are rounded; 0: none
        delay: age of a reading in use
        seed: seed of random offsets and noise
    """

    offset: types.AngleOrEach = key(0.0, "rad or m")
    deviation: types.NotNegativeAngleOrEach = key(0.0, "rad or m")
    noise: types.NotNegativeAngleOrEach = key(0.0, "rad or m")
    resolution: types.NotNegativeAngleOrEach = key(0.0, "rad or m")
    delay: types.NotNegative = key(0.0, "s")
    seed: types.Seed = 0


Orientation = Annotated[
    tuple[types.Angle, ...],
    types.count(3, 4),
    AfterValidator(lambda values: values if len(values) == 3 else types.directed(values)),
]
"""Roll, pitch and yaw about fixed x, y and z, or a quaternion w x y z."""


class StartPose(Choice):
    """Pose of the site at the start.

    Attributes:
        position: [x, y] (z stays) or [x, y, z]; null: as at `start`
        orientation: roll, pitch, yaw about fixed x, y, z, or quaternion w x y z; null: free
        frame: reference frame; base: the body that carries the first joint
    """

    counts = ((("position", "orientation"), 1, 2),)
    position: types.Vector | None = key(None, "m")
    orientation: Orientation | None = key(None, "rad or 1")
    frame: Literal["world", "base"] = "world"


class ToolSection(Choice):
    """Tool: a frame on a body of the arm, optionally with a mass or another model attached.

    Attributes:
        body: body that carries the tool; null: the arm's end effector
        position: position of the tool frame on it
        orientation: orientation of the tool frame on it, as `arm.pose.orientation`; null: parallel
        mass: mass; null: none
        center: center of mass in the tool frame; null: its origin
        inertia: principal moments about the center of mass, along the tool axes; null: point mass
        model: MJCF or URDF file of a tool to attach; null: none
        site: end effector site in that model; null: chosen as for an arm
    """

    counts = ((("mass", "model"), 0, 1),)
    needs = (("center", "mass"), ("inertia", "mass"), ("site", "model"))
    body: types.Text | None = None
    position: types.Point = key((0.0, 0.0, 0.0), "m")
    orientation: Orientation | None = key(None, "rad or 1")
    mass: types.NotNegative | None = key(None, "kg")
    center: types.Point | None = key(None, "m")
    inertia: types.Moments | None = key(None, "kg·m²")
    model: types.ModelFile | None = None
    site: types.Text | None = None

    @property
    def rotation(self) -> tuple[float, ...]:
        """Orientation of the tool frame, as a quaternion w x y z."""
        values = self.orientation or (1.0, 0.0, 0.0, 0.0)
        return values if len(values) == 4 else tuple(quat_from_rpy(values).tolist())


class ArmSection(Exclusive):
    """The arm: model, end effector and start configuration.

    Attributes:
        model: MJCF or URDF file, relative to the scenario's folder
        site: end effector (TCP) site; null: that of the hand, unless `body` or `tool` is given
        body: body whose frame is controlled instead of a site
        tool: tool whose frame is controlled instead of a site
        packages: folder of a URDF's package; null: searched above the file
        start: start configuration: a keyframe's name, or one position per joint
        pose: start pose of the site; inverse kinematics from `start` finds the joint positions; null: start
            at `start`
        joints: actuated joints; null: all between base and site
        others: joints without an actuator: `hold` locks them at `start`, `free` lets them move
        encoder: encoder errors
        stretch: factor on all lengths of a body, known to the controller; mass stays, inertia grows with its
            square
    """

    counts = ((("site", "body", "tool"), 0, 1),)
    model: types.ModelFile
    site: types.Text | None = None
    body: types.Text | None = None
    tool: ToolSection | None = None
    packages: dict[str, types.Folder] = key({})
    start: types.NameOrPositions = key("home", "rad or m")
    pose: StartPose | None = None
    joints: types.Names | None = None
    others: Literal["hold", "free"] = "hold"
    encoder: EncoderSection = EncoderSection()
    stretch: dict[str, types.Positive] = key({}, "1")


# The key in `expect` for a profile instead of a metric.
PROFILE = "profile"

_ACCEPTED = "vendor limits of the commands: a shipped profile's name, or a file"


class Check(Choice):
    """Expectation of one metric of the scorecard.

    Attributes:
        below: upper bound, exclusive
        above: lower bound, exclusive
        equals: expected value, to `within`
        within: tolerance of `equals`
    """

    counts = ((("below", "above", "equals"), 1, 3),)
    needs = (("equals", "within"), ("within", "equals"))
    below: Number | None = key(None, "as the metric")
    above: Number | None = key(None, "as the metric")
    equals: Number | None = key(None, "as the metric")
    within: NotNegative | None = key(None, "as the metric")

    @model_validator(mode="after")
    def _can_pass(self) -> Self:
        if self.above is not None and self.below is not None and self.above >= self.below:
            raise rule(f"must have above < below, got {show(self.above)} and {show(self.below)}")
        return self


def _profile_apart(expect: Any) -> Any:
    """Refuse a text in place of a check, and a check in place of a profile."""
    for name, value in expect.items() if isinstance(expect, dict) else ():
        if (name == PROFILE) != isinstance(value, str):
            wanted = "the name of a profile or a file" if name == PROFILE else "a mapping, such as {below: 1}"
            raise rule(f"must be {wanted}, got {show(value)}", ("expect", name))
    return expect


Expectations = Annotated[dict[str, TextOr[ProfileName, Check]], BeforeValidator(_profile_apart)]
"""A check of each metric, by its name, and a profile."""


class LookSection(Section):
    """Point of interest of a run: its recording opens there and marks it.

    Attributes:
        quantity: plot to open; status: active limits; path: the end effector's, in the picture
        at: time of the mark; null: where the quantity is worst
    """

    quantity: Literal[
        "rates", "joints", "sigma", "error", "rotation", "torque", "pace", "belief", "status", "path"
    ]
    at: NotNegative | None = key(None, "s")


class Sections(Section):
    """All inputs of a run.

    Attributes:
        name: name of the run and of its files
        arm: the arm
        task: controlled components of the site's motion
        control: the control law
        target: target motion of the site
        plant: plant, which executes the commanded rates
        expect: expectations, by metric of the scorecard
        look: point of interest in its recording; null: the rates, singular values and error
        baseline: changes of keys for a baseline, which `rmrc run` also runs for comparison
        sweep: variants for `rmrc sweep`
        tune: uncertainty about the robot, for `rmrc tune`
    """

    model_config = ConfigDict(title="Scenario")
    name: Name
    arm: ArmSection
    task: TaskSection = TaskSection()
    control: ControlSection = ControlSection()
    target: TargetSection
    plant: PlantSection = PlantSection()
    expect: Expectations = key(
        {}, schema={"properties": {PROFILE: {"type": "string", "default": None, "description": _ACCEPTED}}}
    )
    look: LookSection | None = None
    baseline: Baseline = key({})
    sweep: SweepSection = SweepSection()
    tune: TuneSection = TuneSection()

    @model_validator(mode="after")
    def _whole_steps(self) -> Self:
        period, timestep = self.control.period, self.plant.timestep
        steps = period / timestep if timestep and PLANTS[self.plant.kind].physics else 1.0
        # 1e-9: decimal fractions such as 0.003/0.001 are off by some 1e-16, real mistakes by far more.
        if not (steps < math.inf and abs(steps - max(1, round(steps))) <= 1e-9 * steps):
            numbers = f"got {show(period)} and {show(timestep)}"
            text = f"must be an integer multiple of plant.timestep, {numbers}; write plant.timestep: null"
            raise rule(text, ("control", "period"))
        return self


def parse_key(text: str) -> Key:
    """Return the steps of a dotted key; the name of a metric is one step, including its dots.

    A key in a sweep or a baseline is also one step: `sweep.vary.arm.start[0]` is the key `arm.start[0]` of
    `sweep.vary`.

    Raises:
        ValueError: If the text is no key.
    """
    for section in ("baseline", "sweep.vary", "sweep.draw"):
        if text.startswith(f"{section}.") and text != f"{section}.":
            return (*section.split("."), text.removeprefix(f"{section}."))
    section, _, below = text.partition(".")
    if section != "expect" or "." not in text:
        return split(text)
    metric, _, last = below.rpartition(".")  # a metric may lack a name, and is then refused
    return (section, metric, last) if metric and last in Check.model_fields else (section, below)
