"""The sections of a scenario: their fields are the keys of a file, with unit, default and meaning."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import (
    AfterValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from rmrc.scenario import choices
from rmrc.scenario.choices import PLANTS
from rmrc.scenario.keys import split
from rmrc.scenario.path import PathFrame, Segment
from rmrc.scenario.profile import ProfileName, load_profile
from rmrc.scenario.values import (
    Angle,
    AngleOrEach,
    AngleRange,
    Angles,
    Axes,
    Axis,
    Bounds,
    Changed,
    Choice,
    Count,
    Folder,
    Frame,
    Gravity,
    ModelFile,
    Moments,
    Name,
    NameOrPositions,
    Names,
    NotNegative,
    NotNegativeAngleOrEach,
    NotNegativeOrEach,
    Number,
    OneOrEach,
    Point,
    Positions,
    Positive,
    Quaternion,
    Range,
    Rates,
    Section,
    Seed,
    Share,
    Switch,
    Text,
    Values,
    Vector,
    Weights,
    Wrench,
    key,
    rule,
)
from rmrc.scenario.wording import show
from rmrc.support.problems import Key
from rmrc.support.spatial import quat_from_rpy


def sort_axes(section: "Section | Derived", beside: str) -> None:
    """Sort the axes of a section as the rows of a twist, and what has one value for each of them along."""
    axes: Axes = section.__dict__["axes"]
    order = sorted(range(len(axes)), key=lambda i: get_args(Axis).index(axes[i]))
    for name in ("axes", beside):
        values = section.__dict__[name]
        if values is not None:  # frozen is a promise to users; the section is still being made
            section.__dict__[name] = tuple(values[i] for i in order)


class EncoderSection(Section):
    """What the arm's encoders say: the law works with that, where the arm is at q."""

    offset: AngleOrEach = key("what the encoders of all joints, or of each, say too much", 0.0, "rad or m")
    deviation: NotNegativeAngleOrEach = key(
        "standard deviation of what is added to `offset`, of all joints or of each; it is drawn once, from a "
        "normal distribution",
        0.0,
        "rad or m",
    )
    noise: NotNegativeAngleOrEach = key(
        "standard deviation of white noise, drawn at every tick, of all joints or of each", 0.0, "rad or m"
    )
    resolution: NotNegativeAngleOrEach = key(
        "what is read is rounded to a multiple of this, of all joints or of each; 0: to nothing",
        0.0,
        "rad or m",
    )
    delay: NotNegative = key("how old what is read is when the law takes it", 0.0, "s")
    seed: Seed = key("what is drawn: the same seed, the same offsets and noise", 0)


class StartPose(Choice):
    """A pose of the site in which an arm starts."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": [name]} for name in ("position", "orientation")]}
    )
    position: Vector | None = key(
        "where it is: [x, y], which keeps z, or [x, y, z]; null: as at `start`", None, "m"
    )
    orientation: Annotated[tuple[Angle, ...], Count(3, 4)] | None = key(
        "how it is turned: roll, pitch and yaw, about x, then y, then z, or a quaternion w x y z; "
        "null: as it may be",
        None,
        "rad or 1",
    )
    frame: Literal["world", "base"] = key(
        "the frame that it is in: world; base, the body that carries the first joint", "world"
    )

    @model_validator(mode="after")
    def _some_pose(self) -> Self:
        if not self.given("position", "orientation"):
            raise rule("must have position or orientation, got none of them")
        if len(self.orientation or ()) == 4 and not any(self.orientation or ()):
            raise rule("must not be a zero quaternion", ("arm", "pose", "orientation"))
        return self


class ToolSection(Choice):
    """What the arm holds: a frame on a body of it, perhaps with a mass there, or with another model."""

    body: Text | None = key(
        "the body that carries it; null: the frame that is controlled where none is named", None
    )
    position: Point = key("where its frame is, in the frame of what carries it", (0.0, 0.0, 0.0), "m")
    quat: Quaternion | None = key(
        "how its frame is turned in the frame of what carries it, as a quaternion w x y z; null: by `rpy`",
        None,
        "1",
    )
    rpy: Angles | None = key("the same as roll, pitch and yaw: about x, y and z, fixed", None, "rad")
    mass: NotNegative | None = key("its mass; null: none", None, "kg")
    center: Point | None = key("where its center of mass is, in its frame; null: at its origin", None, "m")
    inertia: Moments | None = key(
        "its moments of inertia about its center of mass, along its axes; null: those of a point",
        None,
        "kg·m²",
    )
    model: ModelFile | None = key("an MJCF or URDF file that is attached there; null: none", None)
    site: Text | None = key("the site of that model that is controlled; null: as for an arm", None)

    @property
    def rotation(self) -> tuple[float, ...]:
        """How its frame is turned, as a quaternion w x y z."""
        if self.quat is not None:
            return self.quat
        return tuple(quat_from_rpy(self.rpy or (0.0, 0.0, 0.0)).tolist())

    @model_validator(mode="after")
    def _fitting(self) -> Self:
        if self.quat is not None and self.rpy is not None:
            raise rule("must have quat or rpy, got both")
        weighing = self.given("mass", "center", "inertia")
        if self.model is not None and weighing:
            raise rule(f"must have {' and '.join(weighing)} or model, which has a mass of its own; got both")
        if weighing and self.mass is None:
            raise rule(f"{' and '.join(weighing)} needs mass")
        if self.site is not None and self.model is None:
            raise rule("site needs model, whose site it is; leave it out, or write arm.site")
        if self.inertia is not None and 2.0 * max(self.inertia) > sum(self.inertia):
            moments = show(list(self.inertia))
            raise rule(f"inertia must have no moment above the sum of the two others, got {moments}")
        return self


class ArmSection(Section):
    """The arm: which model, which point of it, where it starts."""

    model: ModelFile = key("the MJCF or URDF file; a relative path starts at the scenario's folder")
    site: Text | None = key(
        "the MuJoCo site that is controlled; null, without `body` and `tool`: that of the hand", None
    )
    body: Text | None = key("the body whose frame is controlled instead", None)
    tool: ToolSection | None = key("what the arm holds, whose frame is controlled instead", None)
    base: Literal["fixed", "free"] = key(
        "a base that floats in the model: `fixed` where its first keyframe has it; `free` is refused, as no "
        "drive holds it",
        "fixed",
    )
    packages: dict[str, Folder] = key(
        "folders of the packages that a URDF names, by their names; others are looked for above the file", {}
    )
    start: NameOrPositions = key(
        "where the joints start: a keyframe's name, or a position a joint", "home", "rad or m"
    )
    pose: StartPose | None = key(
        "a pose of the site to start in, at the joint positions that a search from `start` finds; null: at "
        "`start`",
        None,
    )
    joints: Names | None = key("the joints that are driven; null: those between the base and the site", None)
    others: Literal["hold", "free"] = key(
        "joints that are not driven, and that no actuator of the model holds: they stay where `start` has "
        "them, or are free to move; what hangs at a free joint beside the arm is free anyway",
        "hold",
    )
    encoder: EncoderSection = key("what its encoders say", EncoderSection())
    stretch: dict[str, Positive] = key(
        "factor on all lengths of a body, by its name: where bodies, sites, joints and shapes sit on it, and "
        "their sizes; its mass stays, its inertia is the factor's square times as large; the law knows "
        "it, as it does not know `plant.stretch`",
        {},
        "1",
    )

    @model_validator(mode="after")
    def _one_frame(self) -> Self:
        given = [name for name in ("site", "body", "tool") if getattr(self, name) is not None]
        if len(given) > 1:
            raise rule(f"must have one of site, body and tool at most, got {' and '.join(given)}")
        return self


class TaskSection(Section):
    """What of the site's motion counts, and how much."""

    axes: Axes = key("the rows of the twist that are controlled, along the axes of `frame`", get_args(Axis))
    frame: Frame = key(
        "along whose axes the rows are: world; base, of the body that carries the first joint; site, of the "
        "controlled site as it turns",
        "world",
    )
    length: Positive = key(
        "characteristic length: linear rows are divided by it, so that they compare with angles", 1.0, "m"
    )
    weights: Weights | None = key(
        "task weights W_x, one an axis in the order of `axes`; null: all 1", None, "1"
    )

    @field_validator("weights")
    @classmethod
    def _one_an_axis(cls, weights: Weights | None, info: ValidationInfo) -> Weights | None:
        axes = info.data.get("axes")
        if weights is not None and axes is not None and len(weights) != len(axes):
            counts = f"got {len(weights)} for the {len(axes)} axes {', '.join(axes)}"
            raise rule(f"must have one weight for each of task.axes, {counts}")
        return weights

    @model_validator(mode="after")
    def _in_row_order(self) -> Self:
        sort_axes(self, "weights")
        return self


if TYPE_CHECKING:

    class _Computed:  # a checker knows no fields that are computed
        model_fields: ClassVar[dict[str, Any]]

        def __init__(self, **values: Any) -> None: ...

        def __getattr__(self, name: str) -> Any: ...

else:
    _Computed = Section


class Derived(_Computed):
    """A section that has choices and parameters as `rmrc.scenario.choices` declares them."""


# By their keys below `control`, but for `control` itself.
DERIVED: dict[str, type[Derived]] = {}


def derived(place: str) -> Callable[[type[Derived]], type[Derived]]:
    """Give a section the choices and parameters that are declared for its place, and the sections of both.

    Fields that the class has itself come first.

    Args:
        place: Its key below `control`, or "" for `control` itself.
    """

    def complete(base: type[Derived]) -> type[Derived]:
        fields: dict[str, Any] = {}
        for choice in (one for one in choices.CHOICES if one.place == place):
            fields[choice.name] = (Literal[choice.names], key(choice.meaning, choice.default))
        for one in (one for one in choices.PARAMETERS if one.place == place):
            fields[one.name] = (_type_of(one), key(one.meaning, one.default, one.unit))
        for group in (one for one in choices.GROUPS if one.place == place):
            section = DERIVED.get(group.key) or _made(group)
            fields[group.name] = (section, key(group.meaning, section()))
        DERIVED[place] = _model(base.__name__, base, base.__doc__, fields)
        return DERIVED[place]

    return complete


def _made(group: choices.Group) -> type[Derived]:
    name = f"{group.name.capitalize()}Section"
    globals()[name] = derived(group.key)(_model(name, Derived, group.title, {}))  # where pickle looks for it
    return DERIVED[group.key]


def _model(name: str, base: Any, doc: str | None, fields: dict[str, Any]) -> type[Derived]:
    made: type[Derived] = create_model(name, __base__=base, __doc__=doc, __module__=__name__, **fields)
    return made


def _type_of(parameter: choices.Parameter) -> Any:
    bounds = {name: bound for name, bound in parameter.bounds._asdict().items() if bound is not None}
    kinds: dict[str, Any] = {
        "number": Annotated[Number, Field(**bounds)], "each": OneOrEach,
        "positions": Positions, "rates": Rates,
    }  # fmt: skip
    return kinds[parameter.kind] if parameter.null is None else kinds[parameter.kind] | None


@derived("inverse")
class InverseSection(Derived):
    """How the Jacobian is inverted."""


@derived("nullspace.secondary")
class SecondarySection(Derived):
    """A second task, done as far as the first leaves room for it: a site that shall stay somewhere."""

    site: Text | None = key("the site of the second task; null: that of the first", None)
    axes: Axes = key("the rows of its twist that count, along the axes of `frame`", ("x", "y", "z"))
    frame: Frame = key(
        "along whose axes the rows are: world; base, of the body that carries the first joint; site, of the "
        "second task's site as it turns",
        "world",
    )
    to: Positions | None = key(
        "where it shall be, a value for each of `axes`: position in `frame`, which is the site's where it "
        "starts, or rotation vector from the start; null: where it starts",
        None,
        "m or rad",
    )
    feedback: NotNegative = key("K of the second task: twist for a given error", 5.0, "1/s")

    @field_validator("to")
    @classmethod
    def _one_an_axis(cls, to: Positions | None, info: ValidationInfo) -> Positions | None:
        axes = info.data.get("axes")
        if to is not None and axes is not None and len(to) != len(axes):
            counts = f"got {len(to)} for the {len(axes)} axes {', '.join(axes)}"
            raise rule(f"must have one value for each of axes, {counts}")
        return to

    @model_validator(mode="after")
    def _in_row_order(self) -> Self:
        sort_axes(self, "to")
        return self


@derived("nullspace")
class NullspaceSection(Derived):
    """What the joints do that the task does not feel."""

    @model_validator(mode="after")
    def _has_rates(self) -> Self:
        if self.objective == "rates" and self.rates is None:
            raise rule(
                "must be given for the objective rates, one rate a joint",
                key=("control", "nullspace", "rates"),
            )
        return self


@derived("limits")
class LimitsSection(Derived):
    """The bounds on joint positions, rates, accelerations and jerk."""

    profile: ProfileName | None = key(
        "what the controller of a robot accepts, as its vendor publishes it: the name of a shipped profile, "
        "or a file; it sets rate, acceleration, jerk, braking and control.period where they are not written, "
        "and joints brake before its positions as well; null: none",
        None,
    )
    rate: OneOrEach | None = key(
        "largest rate, of all joints or of each; null: the model's own", None, "rad/s or m/s"
    )
    acceleration: OneOrEach | None = key(
        "largest acceleration, of all joints or of each; null: none", None, "rad/s² or m/s²"
    )
    jerk: OneOrEach | None = key(
        "largest jerk, of all joints or of each, stops and braking with it; null: none",
        None,
        "rad/s³ or m/s³",
    )
    position: Switch = key("whether joints brake before the position limits of the model", default=True)
    braking: OneOrEach = key(
        "deceleration with which a joint stops before its position limit, of all joints or of each; "
        "not more than `acceleration`",
        10.0,
        "rad/s² or m/s²",
    )
    keep_direction: Switch = key(
        "on_excess optimal: whether the tip keeps its direction, but at position limits: then the largest "
        "share of the task that fits is done, by the least rates",
        default=False,
    )

    @model_validator(mode="after")
    def _by_profile(self) -> Self:
        for name, value in load_profile(self.profile).limits.items() if self.profile else ():
            if name not in self.model_fields_set:  # frozen is a promise to users; it is still being made
                self.__dict__[name] = value
        return self


@derived("")
class ControlSection(Derived):
    """The control law."""

    period: Positive = key("time between two control ticks", 0.001, "s")
    state: Literal["measured", "integrated"] = key(
        "what the law takes for q: what the encoders say; or the integral of its own commands from what they "
        "said at the start",
        "measured",
    )
    rate_filter: NotNegative = key(
        "time constant of a first-order filter of rates that are differentiated: with a resolution, noise or "
        "delay of arm.encoder, computed torque takes difference quotients of what the encoders say",
        0.0,
        "s",
    )
    inverse: InverseSection = key("how the Jacobian is inverted", InverseSection())
    feedback: NotNegative = key("K: twist for a given pose error", 20.0, "1/s")
    feedforward: Switch = key("whether the reference twist is part of the command", default=True)
    joint_weights: Weights | None = key(
        "joint weights W_q, one a joint: a heavier joint moves less; null: all 1", None, "1"
    )
    nullspace: NullspaceSection = key("the motion left over", NullspaceSection())
    limits: LimitsSection = key("bounds on joint positions, rates, accelerations and jerk", LimitsSection())

    @model_validator(mode="after")
    def _by_profile(self) -> Self:
        published = load_profile(self.limits.profile).period if self.limits.profile else None
        if published and "period" not in self.model_fields_set:
            self.__dict__["period"] = published.value
        return self


class TargetLimitsSection(Section):
    """How fast the path is followed."""

    velocity: Positive = key("largest speed", 0.25, "m/s")
    acceleration: Positive = key("largest acceleration", 1.0, "m/s²")
    jerk: Positive = key("largest jerk; a recorded motion is not held against it", 10.0, "m/s³")
    angular_velocity: Positive = key("largest angular speed", 1.0, "rad/s")
    angular_acceleration: Positive = key("largest angular acceleration", 4.0, "rad/s²")
    angular_jerk: Positive = key("largest angular jerk; as `jerk`", 40.0, "rad/s³")


class TargetSection(Section):
    """Where the site shall go."""

    path: Annotated[tuple[Segment, ...], Count(1)] = key("the pieces of the path, in order")
    offset: Vector = key(
        "how far every absolute point of the path lies from where it is written: line.to, arc.center, set.to",
        (0.0, 0.0, 0.0),
        "m",
    )
    frame: PathFrame = key(
        "the frame of all pieces that have none of their own: world; base, the body that carries the first "
        "joint; site, as the piece starts; start, the site as the path starts",
        "world",
    )
    limits: TargetLimitsSection = key("how fast", TargetLimitsSection())


if TYPE_CHECKING:  # a checker knows no keys that are computed

    class _PlantKeys(Section):
        kind: str

        def __getattr__(self, name: str) -> Any: ...

else:
    _PlantKeys = create_model(
        "_PlantKeys",
        __base__=Section,
        kind=(Literal[PLANTS.names], key(PLANTS.meaning, PLANTS.default)),
        **{one.key: (_type_of(one), key(one.meaning, one.default, one.unit)) for one in PLANTS.parameters},
    )


class FrictionSection(Section):
    """Friction of the joints that is not in the model: no drive takes it out."""

    coulomb: NotNegativeOrEach = key(
        "dry friction, of all joints or of each, beside that of the model", 0.0, "N·m or N"
    )
    viscous: NotNegativeOrEach = key(
        "torque or force for a given rate, of all joints or of each, beside the damping of the model",
        0.0,
        "N·m·s/rad or N·s/m",
    )


# MuJoCo's step where neither the scenario nor the plant says another [s].
TIMESTEP = 0.001


class ResonanceSection(Section):
    """How the rates of all joints swing about what arrived: as a mass at a spring does."""

    frequency: Positive | None = key(
        f"{PLANTS.physical}: natural frequency, that of swings without damping; null: nothing swings",
        None,
        "Hz",
    )
    damping: NotNegative = key("damping ratio ζ: 0 swings forever, 1 does not overshoot", 0.1, "1")


class PlantSection(_PlantKeys):
    """What obeys the commanded rates."""

    if TYPE_CHECKING:

        def __init__(self, **values: Any) -> None: ...  # noqa: D107 - of a model

    timestep: Positive | None = key(
        f"{PLANTS.physical}: MuJoCo's step; control.period is an integer multiple of it; null: {TIMESTEP:g}, "
        f"and for {PLANTS.own} the model's own, or the next shorter that divides control.period",
        None,
        "s",
    )
    gravity_compensation: Switch | None = key(
        f"{PLANTS.physical}: whether gravity is balanced by the arm itself; null: true, and for {PLANTS.own} "
        "as the model has it",
        None,
    )
    friction_compensation: Switch = key(
        "servo, torque: whether the drives also give what damping and dry friction of the joints take at the "
        "rates that they are told",
        default=True,
    )
    payload: NotNegative = key(
        f"{PLANTS.physical}: point mass at the site, which neither the law nor the gravity compensation "
        "knows of",
        0.0,
        "kg",
    )
    gravity: Gravity | None = key(
        f"{PLANTS.physical}: gravity along world axes; null: the model's own", None, "m/s²"
    )
    wrench: Wrench = key("external wrench [f; n] on the site, along world axes", (0.0,) * 6, "N, N·m")
    delay: NotNegative = key("dead time: how long a command is on its way to the plant", 0.0, "s")
    jitter: NotNegative = key(
        "how much longer it may be on its way, evenly drawn for each command; one that a later command "
        "overtakes is dropped",
        0.0,
        "s",
    )
    loss: Share = key("share of the commands that never arrive; the last one that did holds", 0.0, "1")
    lag: NotNegativeOrEach = key(
        "time constant with which the rates of all joints, or of each, follow what arrived", 0.0, "s"
    )
    resonance: ResonanceSection = key("swings of the drives", ResonanceSection())
    backlash: NotNegativeAngleOrEach = key(
        f"{PLANTS.physical}: play between drives and joints, of all or of each: a drive that turns back "
        "moves nothing until it has crossed it",
        0.0,
        "rad or m",
    )
    seed: Seed = key("what is drawn of jitter and loss: the same seed, the same commands late and lost", 0)
    friction: FrictionSection = key(
        f"{PLANTS.physical}: friction of the joints that no compensation knows of", FrictionSection()
    )
    stretch: dict[str, Positive] = key(
        "factor on all lengths of a body, by its name, that the law does not know of, as of an arm that "
        "was never calibrated: beside `arm.stretch`, which it knows",
        {},
        "1",
    )
    joint_offset: AngleOrEach = key(
        "how far all joints, or each, are beyond where the law takes them to be, from the start on: their "
        "zeros are off",
        0.0,
        "rad or m",
    )

    @property
    def step(self) -> float:
        """MuJoCo's step, where the model has no say in it [s]."""
        return TIMESTEP if self.timestep is None else self.timestep

    @property
    def is_compensated(self) -> bool:
        """Whether the bodies of the arm are made to float; if not, they are as the model has them."""
        wanted = self.gravity_compensation
        return not PLANTS[self.kind].own if wanted is None else wanted


class Check(Choice):
    """What is expected of one figure of the scorecard."""

    model_config = ConfigDict(
        json_schema_extra={
            "anyOf": [{"required": [name]} for name in ("below", "above", "equals")],
            "dependentRequired": {"equals": ["within"], "within": ["equals"]},
        }
    )
    below: Number | None = key("the figure must be less than this", None, "as the figure")
    above: Number | None = key("the figure must be more than this", None, "as the figure")
    equals: Number | None = key("the figure must be this, give or take `within`", None, "as the figure")
    within: NotNegative | None = key("how far from `equals` the figure may be", None, "as the figure")

    @model_validator(mode="after")
    def _something(self) -> Self:
        given = self.given("below", "above", "equals", "within")
        if "equals" in given and "within" not in given:
            raise rule("equals needs within, how far from it the figure may be")
        if "within" in given and "equals" not in given:
            raise rule("within needs equals")
        if not given:
            raise rule("must have at least one of below, above, equals, got none of them")
        if self.below is not None and self.above is not None and self.above >= self.below:
            bounds = f"got above {show(self.above)} and below {show(self.below)}"
            raise rule(f"above must be less than below, {bounds}")
        return self


# What is expected of the commands, beside figures.
PROFILE = "profile"


_ACCEPTED = (
    "the commands must keep to what the controller of a robot accepts, as its vendor publishes it: the name "
    "of a shipped profile, or a file; null: it is not asked"
)


def _check_or_profile(value: object) -> str:
    return "<text>" if isinstance(value, str) else "<one>"


Expected = Annotated[
    Annotated[Check, Tag("<one>")] | Annotated[ProfileName, Tag("<text>")], Discriminator(_check_or_profile)
]

# More keys than this are no sweep of anything that a person reads, and Sobol's
# sequence has its numbers for so many.
MOST_DRAWN = 20

# The run's own name is no part of what happens, and what is drawn has a seed for each run.
_NOT_SWEPT = {
    "name": "names the runs and changes none of them",
    "look": "is for recordings alone",
    "baseline": "is for rmrc run alone",
    "sweep": "is the sweep itself",
    "tune": "is for rmrc tune alone",
    "arm.encoder.seed": "is set by the sweep, run by run: take sweep.repeat and sweep.seed",
    "plant.seed": "is set by the sweep, run by run: take sweep.repeat and sweep.seed",
}


class SweepSection(Section):
    """Which variants of the scenario `rmrc sweep` runs: a grid, samples between bounds, repeats."""

    vary: dict[str, Values] = key("values of keys; every combination of them is run", {})
    draw: dict[str, Bounds] = key("bounds of keys that are drawn between them, evenly", {})
    sampler: Literal["random", "sobol"] = key(
        "how they are drawn: each sample on its own, or by Sobol's sequence, which is more even",
        "random",
    )
    samples: Annotated[int, Field(strict=True, ge=1)] = key(
        "how many samples are drawn for each combination of `vary`; Sobol's are most even for powers of 2", 64
    )
    repeat: Annotated[int, Field(strict=True, ge=1)] = key(
        "how often each of them is run, each time with other encoder offsets and noise, jitter and losses", 1
    )
    seed: Seed | None = key(
        "what is drawn, and what each run's arm.encoder.seed and plant.seed count from; null: their own",
        None,
    )

    @model_validator(mode="after")
    def _each_key_once(self) -> Self:
        if len(self.draw) > MOST_DRAWN:
            raise rule(f"must draw at most {MOST_DRAWN} keys, got {len(self.draw)}")
        for name, where in [(name, "vary") for name in self.vary] + [(name, "draw") for name in self.draw]:
            key = ("sweep", where, name)
            try:
                split(name)
            except ValueError:
                raise rule("is no key such as control.feedback or arm.start[1]", key) from None
            for refused, why in _NOT_SWEPT.items():
                if name == refused or name.startswith(f"{refused}."):
                    raise rule(f"cannot be varied: it {why}", key)
            if name in self.vary and where == "draw":
                raise rule("must be in vary or in draw, got both", key)
            values = self.vary.get(name, ())
            for i, value in enumerate(values):
                if value in values[:i]:
                    raise rule(f"must not repeat a value, got {show(value)} twice", key)
        return self


# A baseline is held against the scenario by the figures of both, and runs where the scenario is run alone.
_NOT_OF_BASELINES = {
    "name": "names the scenario and changes nothing",
    "expect": "holds for the scenario, and the baseline is expected nothing",
    "look": "is for the recording, which shows both",
    "baseline": "is the baseline itself",
    "sweep": "is for rmrc sweep alone",
    "tune": "is for rmrc tune alone",
}


def _baseline(values: dict[str, Any]) -> dict[str, Any]:
    """Refuse what is no key, and what no baseline changes."""
    for name in values:
        try:
            root = split(name)[0]
        except ValueError:
            raise rule("is no key such as control.feedback or arm.start[1]", ("baseline", name)) from None
        if root in _NOT_OF_BASELINES:
            raise rule(f"cannot be changed: it {_NOT_OF_BASELINES[str(root)]}", ("baseline", name))
    return values


class TuneSection(Section):
    """What is not known of the robot, for all of which `rmrc tune` shall find settings."""

    delay: Range | None = key(
        "dead time of its commands, one or from the least to the largest; null: as `plant` has it, or "
        "assumed where the scenario tells nothing of the robot",
        None,
        "s",
    )
    lag: Range | None = key(
        "time constant with which its drives follow; a range and null as for `delay`", None, "s"
    )
    noise: AngleRange | None = key(
        "standard deviation of its encoders' white noise, of slides over task.length; a range and null as "
        "for `delay`",
        None,
        "rad",
    )
    calibration: NotNegative | None = key(
        "how far lengths of its links, as a share, and zeros of its joints, of slides over task.length, are "
        "off, to either side; null: not at all",
        None,
        "1 or rad",
    )


class LookSection(Section):
    """What there is to see in a run: its recording opens with that in sight, and marks it."""

    quantity: Literal[
        "rates", "joints", "sigma", "error", "rotation", "torque", "pace", "belief", "status", "path"
    ] = key("the plot to look at; status: of what limits; path: that of the tip, in the picture")
    at: NotNegative | None = key(
        "when to look: there it is marked; null: where the quantity is largest, or worst", None, "s"
    )


class Sections(Section):
    """Everything that one run depends on."""

    model_config = ConfigDict(title="Scenario")
    name: Name = key("names the run and its files")
    arm: ArmSection = key("the arm")
    task: TaskSection = key("what of the site's motion counts", TaskSection())
    control: ControlSection = key("the control law", ControlSection())
    target: TargetSection = key("where the site shall go")
    plant: PlantSection = key("what obeys the commanded rates", PlantSection())
    expect: dict[str, Expected] = key(
        "what is expected, by figure of the scorecard",
        {},
        schema={"properties": {PROFILE: {"type": "string", "default": None, "description": _ACCEPTED}}},
    )
    look: LookSection | None = key(
        "what its recording shows first; null: the rates, singular values and error", None
    )
    baseline: Annotated[dict[str, Changed], AfterValidator(_baseline)] = key(
        "changes of keys that make what `rmrc run` runs beside the scenario", {}
    )
    sweep: SweepSection = key("which variants of it `rmrc sweep` runs", SweepSection())
    tune: TuneSection = key("what is not known of the robot, for `rmrc tune`", TuneSection())

    @field_validator("expect", mode="before")
    @classmethod
    def _profile_by_name(cls, expect: object) -> object:
        """Refuse a text for a figure, and a check for the profile, before a text is taken for a profile."""
        for name, value in expect.items() if isinstance(expect, dict) else ():
            if name != PROFILE and isinstance(value, str):
                raise rule(f"must be a mapping, got {show(value)}", ("expect", name))
            if name == PROFILE and not isinstance(value, str | None):
                wanted = "must be the name of a profile, such as franka_fr3, or a file of one"
                raise rule(f"{wanted}, got {show(value)}", ("expect", name))
        if isinstance(expect, dict) and PROFILE in expect and expect[PROFILE] is None:
            return {name: value for name, value in expect.items() if name != PROFILE}
        return expect

    @model_validator(mode="after")
    def _whole_steps(self) -> Self:
        problem = uneven(self.plant.kind, self.control.period, self.plant.timestep)
        if problem:
            raise rule(problem, key=("control", "period"))
        return self


def uneven(kind: str, period: float, timestep: float | None) -> str | None:
    """Return why a control period is not made of whole steps, if so; a plant without physics has none."""
    if timestep is None and PLANTS[kind].own:
        return None
    timestep = TIMESTEP if timestep is None else timestep
    ratio = period / timestep
    # 1e-9: decimal fractions such as 0.003/0.001 are off by some 1e-16, real mistakes by far more.
    whole = 0.5 < ratio < math.inf and abs(ratio - round(ratio)) <= 1e-9 * ratio
    if whole or not PLANTS[kind].physics:
        return None
    return f"must be an integer multiple of plant.timestep, got {show(period)} and {show(timestep)}"


def listed_default(key: Key) -> list[object] | None:
    """Return the default of a key that has a list for one, else None."""
    fields = Sections.model_fields
    for step in key[:-1]:
        section = fields[step].annotation if step in fields else None
        if not (isinstance(section, type) and issubclass(section, Section)):
            return None
        fields = section.model_fields
    default = fields[key[-1]].default if key[-1] in fields else None
    return list(default) if isinstance(default, tuple) else None


def is_section(key: Key) -> bool:
    """Say whether a section stands at a key."""
    kind: Any = Sections
    for step in key:
        fields = kind.model_fields if isinstance(kind, type) and issubclass(kind, Section) else {}
        kind = fields[step].annotation if step in fields else None
    return isinstance(kind, type) and issubclass(kind, Section)


def parse_key(text: str) -> Key:
    """Return the steps of a dotted key; the name of a figure is one step, whatever it is made of.

    So is a key that is swept: `sweep.vary.arm.start[0]` is the key `arm.start[0]` of `sweep.vary`.

    Raises:
        ValueError: If the text is no key.
    """
    section, _, rest = text.partition(".")
    if section == "sweep":
        name, _, swept = rest.partition(".")
        if swept and name in SweepSection.model_fields:
            return (section, name, swept)
    if (
        section != "expect" or "." not in text
    ):  # a figure may be called by no name at all, which is then refused
        return split(text)
    figure, _, last = rest.rpartition(".")
    return ("expect", figure, last) if figure and last in Check.model_fields else ("expect", rest)
