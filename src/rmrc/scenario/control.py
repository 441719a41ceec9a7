"""The task and the control law of a scenario; `choices` declares what its words do."""

from typing import Annotated, ClassVar, Literal, Self, get_args

from pydantic import Field, model_validator

from rmrc.scenario import values as types
from rmrc.scenario.choices import INVERSES, LIMITS, METRICS, OBJECTIVES, POLICIES, PRIORITIES, SCHEDULES
from rmrc.scenario.profile import ProfileName, load_profile
from rmrc.scenario.values import Section, key, rule
from rmrc.support.errors import Key

_Fraction = Annotated[types.Number, Field(gt=0, lt=1)]


class Paired(Section):
    """A mapping with `axes`, sorted in the order of twist rows, and one value for each beside them."""

    # The key of the values, which may be null.
    paired: ClassVar[Key]

    @model_validator(mode="after")
    def _in_row_order(self) -> Self:
        fields, name = self.__dict__, str(self.paired[-1])  # frozen is a promise to users
        axes, values = fields["axes"], fields[name]
        if values is not None and len(values) != len(axes):
            counts = f"got {len(values)} for the {len(axes)} axes {', '.join(axes)}"
            raise rule(f"must have one value for each of axes, {counts}", self.paired)
        order = sorted(range(len(axes)), key=lambda i: get_args(types.Axis).index(axes[i]))
        fields["axes"] = tuple(axes[i] for i in order)
        fields[name] = values and tuple(values[i] for i in order)
        return self


class TaskSection(Paired):
    """The task: controlled components of the site's motion, and their weights.

    Attributes:
        axes: controlled rows of the twist, along the axes of `frame`
        frame: frame of the rows: world; base, the body of the first joint; site, as it rotates
        length: length that makes meters comparable with radians; null: rms distance of the site from the
            hinges' axes
        weights: task weights W_x, one per axis; null: all 1
    """

    paired = ("task", "weights")
    axes: types.Axes = get_args(types.Axis)
    frame: types.Frame = "world"
    length: types.Positive | None = key(None, "m", schema={"derived": "from the arm"})
    weights: types.Weights | None = key(None, "1")


class DampingSection(Section):
    """How much damping λ the method `damped` uses, and when.

    Attributes:
        schedule: how λ follows the arm
        maximum: λ_max, the largest damping (λ, not λ²); null: `below`/√2, for gains up to 1/`below`
        below: ε: σ_min below which smallest_singular_value damps, or σ for filtered; null: a third of the
            arm's usual σ_min
        manipulability_below: w₀: threshold of w below which manipulability damps
        error_gain: error: λ per unit task error, linear rows over task.length
    """

    schedule: Literal[SCHEDULES.names] = SCHEDULES.default  # type: ignore[name-defined]
    maximum: types.Positive | None = key(None, "as σ", schema={"derived": "from the arm"})
    below: types.Positive | None = key(None, "as σ", schema={"derived": "from the arm"})
    manipulability_below: types.Positive = key(0.3, "as w")
    error_gain: types.Positive = key(1.0, "as σ")


class PushSection(Section):
    """Gains of the method `jparse` in a fading direction.

    Attributes:
        position: jparse: gain of linear rows in a fading direction
        rotation: jparse: gain of angular rows in a fading direction
    """

    position: types.NotNegative = key(1.0, "1")
    rotation: types.NotNegative = key(1.0, "1")


class InverseSection(Section):
    """Inversion of the Jacobian.

    Attributes:
        method: method of inversion: the filter g(σ) in place of 1/σ
        metric: norm of joint rates to minimize: scaled, or kinetic energy
        tolerance: pseudoinverse: singular values up to this share of the largest are dropped
        cutoff: truncated: singular values up to this are dropped
        gamma: jparse: directions with σ below this share of the largest fade
        rate_bound: bound on each rate (selectively_damped) or their norm (schedule rate_bound); slides over
            task.length
        damping: damped, filtered: the damping λ
        push: jparse: gains in a fading direction
    """

    method: Literal[INVERSES.names] = INVERSES.default  # type: ignore[name-defined]
    metric: Literal[METRICS.names] = METRICS.default  # type: ignore[name-defined]
    tolerance: _Fraction = key(1e-6, "1")
    cutoff: types.Positive = key(0.01, "as σ")
    gamma: _Fraction = key(0.1, "1")
    rate_bound: types.Positive = key(2.0, "rad/s")
    damping: DampingSection = DampingSection()
    push: PushSection = PushSection()


class SecondarySection(Paired):
    """A second task of lower priority: hold a site at a place.

    Attributes:
        site: site of the second task; null: that of the first
        axes: controlled rows of its twist
        frame: frame of its rows, as `task.frame`
        to: goal per axis: position in `frame` (for site, at the start), or rotation vector from the start;
            null: the start
        feedback: K of the second task
        priority: classical: solved within the null space of the first task; robust: solved separately, then
            projected
        damping: λ of the second task's inverse, constant
    """

    paired = ("control", "nullspace", "secondary", "to")
    site: types.Text | None = None
    axes: types.Axes = ("x", "y", "z")
    frame: types.Frame = "world"
    to: types.Positions | None = key(None, "m or rad")
    feedback: types.NotNegative = key(5.0, "1/s")
    priority: Literal[PRIORITIES.names] = PRIORITIES.default  # type: ignore[name-defined]
    damping: types.NotNegative = key(0.05, "as σ")


class NullspaceSection(Section):
    """Joint motion in the null space of the task.

    Attributes:
        objective: objective of the null-space motion
        gain: posture: rate per unit distance; joint_limits, manipulability: rate per unit slope
        posture: posture: desired joint positions; null: the start
        rates: rates: desired joint rates
        secondary: secondary: the second task
    """

    objective: Literal[OBJECTIVES.names] = OBJECTIVES.default  # type: ignore[name-defined]
    gain: types.NotNegative = key(1.0, "1/s")
    posture: types.Positions | None = key(None, "rad or m")
    rates: types.Rates | None = key(None, "rad/s or m/s")
    secondary: SecondarySection = SecondarySection()

    @model_validator(mode="after")
    def _has_rates(self) -> Self:
        if self.objective == "rates" and self.rates is None:
            text = "must be given for the objective rates, with one rate per joint"
            raise rule(text, ("control", "nullspace", "rates"))
        return self


class LimitsSection(Section):
    """The bounds on joint positions, rates, accelerations and jerk.

    Attributes:
        profile: vendor limits: a shipped profile's name, or a file; sets the limits and control.period that
            are not given
        rate: largest rate; null: the model's limit
        acceleration: largest acceleration; null: none
        jerk: largest jerk, also of stops; null: none
        position: whether joints brake before the model's position limits
        braking: deceleration before position limits; at most `acceleration`
        keep_direction: optimal: whether the end effector keeps its direction, except at position limits
        on_excess: treatment of rates beyond their limits
    """

    profile: ProfileName | None = None
    rate: types.VelocityOrEach | None = key(None, "rad/s or m/s")
    acceleration: types.AccelerationOrEach | None = key(None, "rad/s² or m/s²")
    jerk: types.JerkOrEach | None = key(None, "rad/s³ or m/s³")
    position: types.Switch = True
    braking: types.AccelerationOrEach = key(10.0, "rad/s² or m/s²")
    keep_direction: types.Switch = False
    on_excess: Literal[LIMITS.names] = LIMITS.default  # type: ignore[name-defined]


class SlowSection(Section):
    """How the time along the path is scaled.

    Attributes:
        change: largest rate of change of the pace, which is 1 at full speed
        patience: longest wait where the arm follows at no pace, before the path continues
        longest: time limit of the run over the planned duration
    """

    change: types.Positive = key(10.0, "1/s")
    patience: types.Positive = key(1.0, "s")
    longest: Annotated[types.Number, Field(ge=1, le=1000)] = key(10.0, "1")


class StopSection(Section):
    """When `at_singularity: stop` holds the arm.

    Attributes:
        sigma: hold if σ_min is at or below this
        condition: hold also if κ is at or above this; null: ignore κ
        change: fraction of the rates removed or restored per second
    """

    sigma: types.Positive = key(0.1, "as σ")
    condition: Annotated[types.Number, Field(gt=1)] | None = key(None, "1")
    change: types.Positive = key(20.0, "1/s")


class KeepOutSection(Section):
    """How far `at_singularity: keep_out` keeps the arm from singularities.

    Attributes:
        sigma: lower bound of σ_min
        approach: α: largest rate of decrease of σ_min over its distance from the bound
    """

    sigma: types.Positive = key(0.1, "as σ")
    approach: types.Positive = key(5.0, "1/s")


class ControlSection(Section):
    """The control law.

    Attributes:
        period: time between two ticks, or its rate, as 30 Hz or 1/30
        state: source of q: `measured` by the encoders, or `integrated` from commands since the first reading
        rate_filter: time constant of a first-order filter on rates differentiated from encoders
        inverse: inversion of the Jacobian
        feedback: K: gain from pose error to twist
        feedforward: whether the command includes the reference twist
        joint_weights: joint weights W_q, one per joint: larger ones move less; null: all 1
        nullspace: motion in the null space of the task
        limits: bounds on joint positions, rates, accelerations and jerk
        at_singularity: reaction to a nearby singularity
        slow: at_singularity slow, singularity_consistent: how
        stop: at_singularity stop: when
        keep_out: at_singularity keep_out: how far
    """

    period: types.Period = key(0.001, "s")
    state: Literal["measured", "integrated"] = "measured"
    rate_filter: types.NotNegative = key(0.0, "s")
    inverse: InverseSection = InverseSection()
    feedback: types.NotNegative = key(20.0, "1/s")
    feedforward: types.Switch = True
    joint_weights: types.Weights | None = key(None, "1")
    nullspace: NullspaceSection = NullspaceSection()
    limits: LimitsSection = LimitsSection()
    at_singularity: Literal[POLICIES.names] = POLICIES.default  # type: ignore[name-defined]
    slow: SlowSection = SlowSection()
    stop: StopSection = StopSection()
    keep_out: KeepOutSection = KeepOutSection()

    @model_validator(mode="after")
    def _by_profile(self) -> Self:
        if self.limits.profile:  # frozen is a promise to users; the sections are still being made
            profile, limits = load_profile(self.limits.profile), self.limits
            if profile.period and "period" not in self.model_fields_set:
                self.__dict__["period"] = profile.period.value
            given = limits.model_fields_set
            limits.__dict__.update({n: v for n, v in profile.limits.items() if n not in given})
        return self
