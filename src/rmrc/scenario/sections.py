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
    Period,
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
    count,
    key,
    rule,
)
from rmrc.scenario.wording import inline, show
from rmrc.support.problems import Key
from rmrc.support.spatial import quat_from_rpy


def sort_axes(section: "Section | Derived", beside: str) -> None:
    """Sort the axes of a section in the order of twist rows, together with their values."""
    axes: Axes = section.__dict__["axes"]
    order = sorted(range(len(axes)), key=lambda i: get_args(Axis).index(axes[i]))
    for name in ("axes", beside):
        values = section.__dict__[name]
        if values is not None:  # frozen is a promise to users; the section is still being made
            section.__dict__[name] = tuple(values[i] for i in order)


class EncoderSection(Section):
    """Errors of the arm's encoders: the controller uses their readings instead of the true q."""

    offset: AngleOrEach = key(
        "constant offset added to the true position by the encoders, one for all joints or one per joint",
        0.0,
        "rad or m",
    )
    deviation: NotNegativeAngleOrEach = key(
        "standard deviation of a random addition to `offset`, one for all joints or one per joint; drawn "
        "once from a normal distribution",
        0.0,
        "rad or m",
    )
    noise: NotNegativeAngleOrEach = key(
        "standard deviation of white noise, drawn at every tick, one for all joints or one per joint",
        0.0,
        "rad or m",
    )
    resolution: NotNegativeAngleOrEach = key(
        "step to which readings are rounded, one for all joints or one per joint; 0: no rounding",
        0.0,
        "rad or m",
    )
    delay: NotNegative = key("age of a reading when the controller uses it", 0.0, "s")
    seed: Seed = key("seed of the random offsets and noise", 0)


class StartPose(Choice):
    """Pose of the site at the start."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": [name]} for name in ("position", "orientation")]}
    )
    position: Vector | None = key(
        "position: [x, y], which keeps z, or [x, y, z]; null: as at `start`", None, "m"
    )
    orientation: Annotated[tuple[Angle, ...], count(3, 4)] | None = key(
        "orientation: roll, pitch and yaw about fixed x, y and z, or a quaternion w x y z; null: "
        "unconstrained",
        None,
        "rad or 1",
    )
    frame: Literal["world", "base"] = key(
        "reference frame: world; base, the body that carries the first joint", "world"
    )

    @model_validator(mode="after")
    def _some_pose(self) -> Self:
        if not self.given("position", "orientation"):
            raise rule("must have position or orientation, got neither")
        if len(self.orientation or ()) == 4 and not any(self.orientation or ()):
            raise rule("must not be a zero quaternion", ("arm", "pose", "orientation"))
        return self


class ToolSection(Choice):
    """Tool: a frame on a body of the arm, optionally with a mass or another model attached."""

    body: Text | None = key("body that carries the tool; null: the default end-effector frame", None)
    position: Point = key("position of the tool frame, in the frame of its carrier", (0.0, 0.0, 0.0), "m")
    quat: Quaternion | None = key(
        "orientation of the tool frame in the frame of its carrier, as a quaternion w x y z; null: given "
        "by `rpy`",
        None,
        "1",
    )
    rpy: Angles | None = key(
        "the same orientation as roll, pitch and yaw about fixed x, y and z", None, "rad"
    )
    mass: NotNegative | None = key("mass; null: none", None, "kg")
    center: Point | None = key("center of mass in the tool frame; null: its origin", None, "m")
    inertia: Moments | None = key(
        "principal moments of inertia about the center of mass, along the tool axes; null: point mass",
        None,
        "kg·m²",
    )
    model: ModelFile | None = key("MJCF or URDF file of a tool to attach; null: none", None)
    site: Text | None = key("end effector (TCP) site in that model; null: chosen as for an arm", None)

    @property
    def rotation(self) -> tuple[float, ...]:
        """Orientation of the tool frame, as a quaternion w x y z."""
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
            raise rule("site needs model, which contains it; remove site, or use arm.site")
        if self.inertia is not None and 2.0 * max(self.inertia) > sum(self.inertia):
            moments = show(list(self.inertia))
            raise rule(f"inertia must have no moment above the sum of the two others, got {moments}")
        return self


class ArmSection(Section):
    """The arm: model, end effector and start configuration."""

    model: ModelFile = key("MJCF or URDF file; relative paths start at the scenario's folder")
    site: Text | None = key(
        "end effector (TCP): the controlled MuJoCo site; null, without `body` and `tool`: the site of the "
        "hand",
        None,
    )
    body: Text | None = key("body whose frame is controlled instead of a site", None)
    tool: ToolSection | None = key("tool whose frame is controlled instead of a site", None)
    base: Literal["fixed", "free"] = key(
        "base with a free joint in the model: `fixed` at the pose of the first keyframe; `free` is "
        "refused, because no actuator holds it",
        "fixed",
    )
    packages: dict[str, Folder] = key(
        "folders of the packages named in a URDF, by package name; other packages are searched above the "
        "file",
        {},
    )
    start: NameOrPositions = key(
        "start configuration: a keyframe's name, or one position per joint", "home", "rad or m"
    )
    pose: StartPose | None = key(
        "start pose of the site; inverse kinematics from `start` finds the joint positions; null: start "
        "at `start`",
        None,
    )
    joints: Names | None = key("actuated joints; null: all joints between the base and the site", None)
    others: Literal["hold", "free"] = key(
        "passive joints, without an actuator in the model: `hold` locks them at `start`, `free` lets them "
        "move; a body on a free joint apart from the arm always moves freely",
        "hold",
    )
    encoder: EncoderSection = key("encoder errors", EncoderSection())
    stretch: dict[str, Positive] = key(
        "factor on all lengths of a body, by body name: positions of its bodies, sites, joints and "
        "shapes, and their sizes; the mass stays the same, and the inertia scales with the square of the "
        "factor; the controller knows it, unlike `plant.stretch`",
        {},
        "1",
    )

    @model_validator(mode="after")
    def _one_frame(self) -> Self:
        given = [name for name in ("site", "body", "tool") if getattr(self, name) is not None]
        if len(given) > 1:
            raise rule(f"must have at most one of site, body and tool, got {' and '.join(given)}")
        return self


class TaskSection(Section):
    """The task: controlled components of the site's motion, and their weights."""

    axes: Axes = key("controlled rows of the twist, along the axes of `frame`", get_args(Axis))
    frame: Frame = key(
        "frame of the task rows: world; base, the body that carries the first joint; site, the controlled "
        "site as it rotates",
        "world",
    )
    length: Positive | None = key(
        "characteristic length: divides the linear rows, to make them comparable with angles; null: the rms "
        "distance of the site from the hinges' axes, or 1 where it would only change the unit of σ",
        None,
        "m",
        schema={"derived": "from the arm"},
    )
    weights: Weights | None = key(
        "task weights W_x, one per axis in the order of `axes`; null: all 1", None, "1"
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
    """A section with the choices and parameters declared in `rmrc.scenario.choices`."""


# By their keys below `control`, except `control` itself.
DERIVED: dict[str, type[Derived]] = {}


def derived(place: str) -> Callable[[type[Derived]], type[Derived]]:
    """Give a section the choices and parameters declared for its place, and their subsections.

    Fields that the class has itself come first.

    Args:
        place: Its key below `control`, or "" for `control` itself.
    """

    def complete(base: type[Derived]) -> type[Derived]:
        fields: dict[str, Any] = {}
        for choice in (one for one in choices.CHOICES if one.place == place):
            fields[choice.name] = (Literal[choice.names], key(choice.meaning, choice.default))
        for one in (one for one in choices.PARAMETERS if one.place == place):
            schema = {"derived": one.derived} if one.derived else {}
            fields[one.name] = (_type_of(one), key(one.meaning, one.default, one.unit, schema=schema))
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
    """Inversion of the Jacobian."""


@derived("nullspace.secondary")
class SecondarySection(Derived):
    """A second task of lower priority: hold a site at a place."""

    site: Text | None = key("site of the second task; null: the site of the first task", None)
    axes: Axes = key("controlled rows of its twist, along the axes of `frame`", ("x", "y", "z"))
    frame: Frame = key(
        "frame of its rows: world; base, the body that carries the first joint; site, the second task's "
        "site as it rotates",
        "world",
    )
    to: Positions | None = key(
        "goal, one value for each of `axes`: position in `frame` (for `site`: its frame at the start), or "
        "rotation vector from the start; null: hold the start",
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
    """Joint motion in the null space of the task."""

    @model_validator(mode="after")
    def _has_rates(self) -> Self:
        if self.objective == "rates" and self.rates is None:
            raise rule(
                "must be given for the objective rates, with one rate per joint",
                key=("control", "nullspace", "rates"),
            )
        return self


@derived("limits")
class LimitsSection(Derived):
    """The bounds on joint positions, rates, accelerations and jerk."""

    profile: ProfileName | None = key(
        "vendor limits of a robot controller: the name of a shipped profile, or a file; sets rate, "
        "acceleration, jerk, braking and control.period where they are not given, and makes joints brake "
        "before its position limits; null: none",
        None,
    )
    rate: OneOrEach | None = key(
        "largest rate, one for all joints or one per joint; null: the model's limit", None, "rad/s or m/s"
    )
    acceleration: OneOrEach | None = key(
        "largest acceleration, one for all joints or one per joint; null: none", None, "rad/s² or m/s²"
    )
    jerk: OneOrEach | None = key(
        "largest jerk, one for all joints or one per joint; also applies to stops and braking; null: none",
        None,
        "rad/s³ or m/s³",
    )
    position: Switch = key("whether joints brake before the model's position limits", default=True)
    braking: OneOrEach = key(
        "deceleration of a joint that stops before its position limit, one for all joints or one per "
        "joint; at most `acceleration`",
        10.0,
        "rad/s² or m/s²",
    )
    keep_direction: Switch = key(
        "on_excess optimal: whether the end effector keeps its direction, except at position limits: the "
        "arm then does the largest feasible share of the task with the least rates",
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

    period: Period = key(
        "control period: time between two ticks; or their rate, as 30 Hz or 1/30", 0.001, "s"
    )
    state: Literal["measured", "integrated"] = key(
        "source of q in the control law: `measured` by the encoders, or `integrated` from its own "
        "commands, starting at the first reading",
        "measured",
    )
    rate_filter: NotNegative = key(
        "time constant of a first-order filter on differentiated rates: with a resolution, noise or delay "
        "of arm.encoder, computed torque uses difference quotients of the encoder readings",
        0.0,
        "s",
    )
    inverse: InverseSection = key("inversion of the Jacobian", InverseSection())
    feedback: NotNegative = key("K: feedback gain from pose error to twist", 20.0, "1/s")
    feedforward: Switch = key("whether the command includes the reference twist", default=True)
    joint_weights: Weights | None = key(
        "joint weights W_q, one per joint: a joint with a larger weight moves less; null: all 1", None, "1"
    )
    nullspace: NullspaceSection = key("motion in the null space of the task", NullspaceSection())
    limits: LimitsSection = key("bounds on joint positions, rates, accelerations and jerk", LimitsSection())

    @model_validator(mode="after")
    def _by_profile(self) -> Self:
        published = load_profile(self.limits.profile).period if self.limits.profile else None
        if published and "period" not in self.model_fields_set:
            self.__dict__["period"] = published.value
        return self


class TargetLimitsSection(Section):
    """Speed limits along the path."""

    velocity: Positive = key("largest speed", 0.25, "m/s")
    acceleration: Positive = key("largest acceleration", 1.0, "m/s²")
    jerk: Positive = key("largest jerk; does not apply to a recorded motion", 10.0, "m/s³")
    angular_velocity: Positive = key("largest angular speed", 1.0, "rad/s")
    angular_acceleration: Positive = key("largest angular acceleration", 4.0, "rad/s²")
    angular_jerk: Positive = key("largest angular jerk; as `jerk`", 40.0, "rad/s³")


class TargetSection(Section):
    """Target motion of the site."""

    path: Annotated[tuple[Segment, ...], count(1)] = key("segments of the path, in order")
    offset: Vector = key(
        "offset added to every absolute point of the path: line.to, arc.center, set.to",
        (0.0, 0.0, 0.0),
        "m",
    )
    frame: PathFrame = key(
        "frame of all segments without a frame of their own: world; base, the body that carries the first "
        "joint; site, at the start of the segment; start, the site at the start of the path",
        "world",
    )
    limits: TargetLimitsSection = key("speed limits", TargetLimitsSection())


if TYPE_CHECKING:  # a type checker knows no computed keys

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
    """Joint friction beyond the model's: no actuator compensates for it."""

    coulomb: NotNegativeOrEach = key(
        "dry friction added to the model's, one for all joints or one per joint", 0.0, "N·m or N"
    )
    viscous: NotNegativeOrEach = key(
        "viscous friction coefficient added to the model's damping, one for all joints or one per joint",
        0.0,
        "N·m·s/rad or N·s/m",
    )


# MuJoCo's longest step where neither the scenario nor the plant sets another [s].
TIMESTEP = 0.001


class ResonanceSection(Section):
    """Resonance: the rates of all joints oscillate about the received commands like a mass on a spring."""

    frequency: Positive | None = key(
        f"{PLANTS.physical}: undamped natural frequency; null: no resonance",
        None,
        "Hz",
    )
    damping: NotNegative = key("damping ratio ζ: 0 never decays, 1 does not overshoot", 0.1, "1")


class PlantSection(_PlantKeys):
    """The plant, which executes the commanded rates."""

    if TYPE_CHECKING:

        def __init__(self, **values: Any) -> None: ...  # noqa: D107 - of a model

    timestep: Positive | None = key(
        f"{PLANTS.physical}: MuJoCo's time step; control.period is an integer multiple of it; null: "
        f"{TIMESTEP:g}, for {PLANTS.own} the model's step, or the next shorter one that divides "
        "control.period",
        None,
        "s",
    )
    gravity_compensation: Switch | None = key(
        f"{PLANTS.physical}: whether the arm compensates for gravity, and the actuators of servo for springs "
        f"of joints; null: true, or for {PLANTS.own} as in the model",
        None,
    )
    friction_compensation: Switch = key(
        "servo, torque: whether the actuators compensate for joint damping and dry friction at the "
        "commanded rates",
        default=True,
    )
    payload: NotNegative = key(
        f"{PLANTS.physical}: point mass at the site, unknown to the controller and to the gravity "
        "compensation",
        0.0,
        "kg",
    )
    gravity: Gravity | None = key(
        f"{PLANTS.physical}: gravity along world axes; null: the model's own", None, "m/s²"
    )
    wrench: Wrench = key("external wrench [f; n] on the site, along world axes", (0.0,) * 6, "N, N·m")
    delay: NotNegative = key("dead time of a command on its way to the plant", 0.0, "s")
    jitter: NotNegative = key(
        "largest additional dead time, drawn uniformly for each command; a command that arrives after a "
        "later one is dropped",
        0.0,
        "s",
    )
    loss: Share = key(
        "fraction of commands that never arrive; the plant holds the last received one", 0.0, "1"
    )
    lag: NotNegativeOrEach = key(
        "time constant with which the rates follow the received commands, one for all joints or one per "
        "joint",
        0.0,
        "s",
    )
    resonance: ResonanceSection = key("resonance of the actuators", ResonanceSection())
    backlash: NotNegativeAngleOrEach = key(
        f"{PLANTS.physical}: backlash between actuators and joints, one for all or one per joint: after a "
        "reversal an actuator moves no joint until it has crossed the gap",
        0.0,
        "rad or m",
    )
    seed: Seed = key("seed of the random jitter and losses", 0)
    friction: FrictionSection = key(
        f"{PLANTS.physical}: joint friction without compensation", FrictionSection()
    )
    stretch: dict[str, Positive] = key(
        "factor on all lengths of a body, by body name, unknown to the controller, as on an uncalibrated "
        "arm; multiplies `arm.stretch`, which the controller knows",
        {},
        "1",
    )
    joint_offset: AngleOrEach = key(
        "error of the joint zeros: true position minus the position assumed by the controller, one for "
        "all joints or one per joint",
        0.0,
        "rad or m",
    )

    @property
    def is_compensated(self) -> bool:
        """Whether to switch on gravity compensation of the arm's bodies; if not, the model decides."""
        wanted = self.gravity_compensation
        return not PLANTS[self.kind].own if wanted is None else wanted


class Check(Choice):
    """Expectation of one metric of the scorecard."""

    model_config = ConfigDict(
        json_schema_extra={
            "anyOf": [{"required": [name]} for name in ("below", "above", "equals")],
            "dependentRequired": {"equals": ["within"], "within": ["equals"]},
        }
    )
    below: Number | None = key("upper bound: the metric must be less than this", None, "as the metric")
    above: Number | None = key("lower bound: the metric must be more than this", None, "as the metric")
    equals: Number | None = key("expected value of the metric, to `within`", None, "as the metric")
    within: NotNegative | None = key("tolerance: largest deviation from `equals`", None, "as the metric")

    @model_validator(mode="after")
    def _something(self) -> Self:
        given = self.given("below", "above", "equals", "within")
        if "equals" in given and "within" not in given:
            raise rule("equals needs within, its tolerance")
        if "within" in given and "equals" not in given:
            raise rule("within needs equals")
        if not given:
            raise rule("must have at least one of below, above, equals, got none")
        if self.below is not None and self.above is not None and self.above >= self.below:
            bounds = f"got above {show(self.above)} and below {show(self.below)}"
            raise rule(f"above must be less than below, {bounds}")
        return self


# The key in `expect` for a profile instead of a metric.
PROFILE = "profile"


_ACCEPTED = (
    "the commands must stay within the limits that a robot's vendor publishes for its controller: the "
    "name of a shipped profile, or a file; null: not checked"
)


def _check_or_profile(value: object) -> str:
    return "<text>" if isinstance(value, str) else "<one>"


Expected = Annotated[
    Annotated[Check, Tag("<one>")] | Annotated[ProfileName, Tag("<text>")], Discriminator(_check_or_profile)
]

# Nobody can read a sweep over more keys than this, and the Sobol sequence here has this many dimensions.
MOST_DRAWN = 20

# The name does not affect a run, and the sweep sets the seeds of each run.
_NOT_SWEPT = {
    "name": "only names the runs",
    "look": "applies to recordings only",
    "baseline": "applies to rmrc run only",
    "sweep": "is the sweep itself",
    "tune": "applies to rmrc tune only",
    "arm.encoder.seed": "is set by the sweep for each run; use sweep.repeat and sweep.seed",
    "plant.seed": "is set by the sweep for each run; use sweep.repeat and sweep.seed",
}


class SweepSection(Section):
    """Variants for `rmrc sweep`: a grid, samples between bounds, repeats."""

    vary: dict[str, Values] = key("values of keys; the sweep runs every combination", {})
    draw: dict[str, Bounds] = key("bounds of keys that are drawn uniformly", {})
    sampler: Literal["random", "sobol"] = key(
        "sampling method: independent samples, or the Sobol sequence, which covers the range more evenly",
        "random",
    )
    samples: Annotated[int, Field(strict=True, ge=1)] = key(
        "number of samples for each combination of `vary`; Sobol samples are most even for powers of 2", 64
    )
    repeat: Annotated[int, Field(strict=True, ge=1)] = key(
        "number of runs per sample, each with different encoder offsets, noise, jitter and losses", 1
    )
    seed: Seed | None = key(
        "seed of the samples; each run's arm.encoder.seed and plant.seed count from it; null: from their "
        "own values",
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
                raise rule("is not a key such as control.feedback or arm.start[1]", key) from None
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


# A baseline shares the metrics of its scenario, and runs only with `rmrc run`.
_NOT_OF_BASELINES = {
    "name": "only names the scenario",
    "expect": "applies to the scenario, not to the baseline",
    "look": "applies to the recording, which shows both",
    "baseline": "is the baseline itself",
    "sweep": "applies to rmrc sweep only",
    "tune": "applies to rmrc tune only",
}


def _baseline(values: dict[str, Any]) -> dict[str, Any]:
    """Refuse unknown keys, and keys that a baseline cannot change."""
    for name in values:
        try:
            root = split(name)[0]
        except ValueError:
            raise rule("is not a key such as control.feedback or arm.start[1]", ("baseline", name)) from None
        if root in _NOT_OF_BASELINES:
            raise rule(f"cannot be changed: it {_NOT_OF_BASELINES[str(root)]}", ("baseline", name))
    return values


class TuneSection(Section):
    """Uncertainty about the robot, over which `rmrc tune` finds robust settings."""

    delay: Range | None = key(
        "dead time of its commands, one value or a range; null: as in `plant`, or assumed if the scenario "
        "has no data of the robot",
        None,
        "s",
    )
    lag: Range | None = key("time constant of its actuators; range and null as for `delay`", None, "s")
    noise: AngleRange | None = key(
        "standard deviation of its encoders' white noise, for slides divided by task.length; range and "
        "null as for `delay`",
        None,
        "rad",
    )
    calibration: NotNegative | None = key(
        "calibration error: largest deviation, to either side, of its link lengths (relative) and of its "
        "joint zeros (for slides divided by task.length); null: none",
        None,
        "1 or rad",
    )


class LookSection(Section):
    """Point of interest of a run: its recording opens there and marks it."""

    quantity: Literal[
        "rates", "joints", "sigma", "error", "rotation", "torque", "pace", "belief", "status", "path"
    ] = key("plot to open; status: the active limits; path: the path of the end effector, in the picture")
    at: NotNegative | None = key("time of the mark; null: where the quantity is largest, or worst", None, "s")


class Sections(Section):
    """All inputs of a run."""

    model_config = ConfigDict(title="Scenario")
    name: Name = key("name of the run and of its files")
    arm: ArmSection = key("the arm")
    task: TaskSection = key("controlled components of the site's motion", TaskSection())
    control: ControlSection = key("the control law", ControlSection())
    target: TargetSection = key("target motion of the site")
    plant: PlantSection = key("plant, which executes the commanded rates", PlantSection())
    expect: dict[str, Expected] = key(
        "expectations, by metric of the scorecard",
        {},
        schema={"properties": {PROFILE: {"type": "string", "default": None, "description": _ACCEPTED}}},
    )
    look: LookSection | None = key(
        "point of interest in its recording; null: the rates, singular values and error", None
    )
    baseline: Annotated[dict[str, Changed], AfterValidator(_baseline)] = key(
        "changes of keys for a baseline, which `rmrc run` also runs for comparison", {}
    )
    sweep: SweepSection = key("variants for `rmrc sweep`", SweepSection())
    tune: TuneSection = key("uncertainty about the robot, for `rmrc tune`", TuneSection())

    @field_validator("expect", mode="before")
    @classmethod
    def _profile_by_name(cls, expect: object) -> object:
        """Refuse a text in place of a check, and a check in place of a profile."""
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
    """Return why a control period is not a whole number of the given steps of MuJoCo, or None."""
    if timestep is None or not PLANTS[kind].physics:
        return None
    ratio, way = period / timestep, "plant.timestep: null, which divides any period"
    if ratio < math.inf:
        steps = max(1, round(ratio))
        # 1e-9: decimal fractions such as 0.003/0.001 are off by some 1e-16, real mistakes by far more.
        if abs(ratio - steps) <= 1e-9 * ratio:
            return None
        step, multiple = (inline(float(f"{x:.12g}")) for x in (period / steps, steps * timestep))
        way = f"plant.timestep: {step}, control.period: {multiple}, or {way}"
    numbers = f"got {show(period)} and {show(timestep)}"
    return f"must be an integer multiple of plant.timestep, {numbers}; write {way}"


def listed_default(key: Key) -> list[object] | None:
    """Return the default of a key if it is a list, else None."""
    fields = Sections.model_fields
    for step in key[:-1]:
        section = fields[step].annotation if step in fields else None
        if not (isinstance(section, type) and issubclass(section, Section)):
            return None
        fields = section.model_fields
    default = fields[key[-1]].default if key[-1] in fields else None
    return list(default) if isinstance(default, tuple) else None


def is_section(key: Key) -> bool:
    """Return whether a key is a section."""
    kind: Any = Sections
    for step in key:
        fields = kind.model_fields if isinstance(kind, type) and issubclass(kind, Section) else {}
        kind = fields[step].annotation if step in fields else None
    return isinstance(kind, type) and issubclass(kind, Section)


def parse_key(text: str) -> Key:
    """Return the steps of a dotted key; the name of a metric is one step, including its dots.

    A swept key is also one step: `sweep.vary.arm.start[0]` is the key `arm.start[0]` of `sweep.vary`.

    Raises:
        ValueError: If the text is no key.
    """
    section, _, rest = text.partition(".")
    if section == "sweep":
        name, _, swept = rest.partition(".")
        if swept and name in SweepSection.model_fields:
            return (section, name, swept)
    if section != "expect" or "." not in text:  # a metric may lack a name, and is then refused
        return split(text)
    metric, _, last = rest.rpartition(".")
    return ("expect", metric, last) if metric and last in Check.model_fields else ("expect", rest)
