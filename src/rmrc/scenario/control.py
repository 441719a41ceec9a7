"""The task and the control law of a scenario; `choices` declares what its words do."""

from typing import Annotated, ClassVar, Literal, Self, get_args

from pydantic import Field, model_validator

from rmrc.scenario import values as types
from rmrc.scenario.choices import INVERSES, LIMITS, METRICS, OBJECTIVES, POLICIES, PRIORITIES, SCHEDULES
from rmrc.scenario.profile import ProfileName, load_profile
from rmrc.scenario.values import Section, key, rule
from rmrc.support.problems import Key

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
        frame: frame of the task rows: world; base, the body that carries the first joint; site, the
            controlled site as it rotates
        length: characteristic length: divides the linear rows, to make them comparable with angles; null: the
            rms distance of the site from the hinges' axes, or 1 where it would only change the unit of σ
        weights: task weights W_x, one per axis in the order of `axes`; null: all 1
    """

    paired = ("task", "weights")
    axes: types.Axes = get_args(types.Axis)
    frame: types.Frame = "world"
    length: types.Positive | None = key(None, "m", schema={"derived": "from the arm"})
    weights: types.Weights | None = key(None, "1")


class DampingSection(Section):
    """How much damping λ the method `damped` uses, and when.

    Attributes:
        schedule: how λ follows the arm: always `maximum`; rising to it as w falls below
            `manipulability_below`, or as σ_min falls below `below`; `error_gain` times the error; or the
            least that keeps the rates within `rate_bound`
        maximum: λ_max, the largest damping (λ, not λ²); null: `below`/√2, so that no gain exceeds 1/`below`
        below: ε: threshold of σ_min below which smallest_singular_value damps; filtered: threshold of each σ;
            null: a third of the arm's usual σ_min, its median within the limits
        manipulability_below: w₀: threshold of w below which manipulability damps
        error_gain: error: λ per unit task error, linear rows divided by task.length
    """

    schedule: Literal[SCHEDULES.names] = SCHEDULES.default  # type: ignore[name-defined]
    maximum: types.Positive | None = key(None, "as σ", schema={"derived": "from the arm"})
    below: types.Positive | None = key(None, "as σ", schema={"derived": "from the arm"})
    manipulability_below: types.Positive = key(0.3, "as w")
    error_gain: types.Positive = key(1.0, "as σ")


class PushSection(Section):
    """Gains of the method `jparse` in a fading direction.

    Attributes:
        position: jparse: gain of the linear rows in a fading direction
        rotation: jparse: gain of the angular rows in a fading direction
    """

    position: types.NotNegative = key(1.0, "1")
    rotation: types.NotNegative = key(1.0, "1")


class InverseSection(Section):
    """Inversion of the Jacobian.

    Attributes:
        method: method of inversion: the filter g(σ) in place of 1/σ
        metric: measure of the joint rates to minimize: their scaled norm, or the kinetic energy of the arm
        tolerance: pseudoinverse: threshold relative to the largest singular value, up to which singular
            values are dropped
        cutoff: truncated: threshold up to which singular values are dropped
        gamma: jparse: threshold relative to the largest σ, below which directions fade
        rate_bound: selectively_damped: largest rate of a joint; schedule rate_bound: largest norm of the
            rates; sliding joints divided by task.length
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
        site: site of the second task; null: the site of the first task
        axes: controlled rows of its twist, along the axes of `frame`
        frame: frame of its rows: world; base, the body that carries the first joint; site, the second task's
            site as it rotates
        to: goal, one value for each of `axes`: position in `frame` (for `site`: its frame at the start), or
            rotation vector from the start; null: hold the start
        feedback: K of the second task: twist for a given error
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
        objective: objective of the null-space motion: none, a posture, the middle of the joints' ranges, a
            larger w, constant rates, or a second task
        gain: posture: rate per unit distance; joint_limits, manipulability: rate per unit slope
        posture: posture: desired joint positions, the shorter way round for a hinge without range; null: the
            start
        rates: rates: desired joint rates, one per joint
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
        profile: vendor limits of a robot controller: the name of a shipped profile, or a file; sets rate,
            acceleration, jerk, braking and control.period where they are not given, and makes joints brake
            before its position limits; null: none
        rate: largest rate, one for all joints or one per joint; null: the model's limit
        acceleration: largest acceleration, one for all joints or one per joint; null: none
        jerk: largest jerk, one for all joints or one per joint; also applies to stops and braking; null: none
        position: whether joints brake before the model's position limits
        braking: deceleration of a joint that stops before its position limit, one for all joints or one per
            joint; at most `acceleration`
        keep_direction: on_excess optimal: whether the end effector keeps its direction, except at position
            limits: the arm then does the largest feasible share of the task with the least rates
        on_excess: beyond a limit: scale all joints alike (keeps direction, unless a joint is at its position
            limit), clamp each joint, redistribute the motion of saturated joints to the others, choose the
            best rates within all bounds, do the largest feasible share of the task, give limits priority over
            the task, or limit nothing
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
        patience: longest wait where the arm cannot follow at any pace, before the path continues regardless
        longest: time limit of the run, relative to the planned duration
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
        approach: α: largest rate of decrease of σ_min, relative to its distance from the bound
    """

    sigma: types.Positive = key(0.1, "as σ")
    approach: types.Positive = key(5.0, "1/s")


class ControlSection(Section):
    """The control law.

    Attributes:
        period: control period: time between two ticks; or their rate, as 30 Hz or 1/30
        state: source of q in the control law: `measured` by the encoders, or `integrated` from its own
            commands, starting at the first reading
        rate_filter: time constant of a first-order filter on differentiated rates: with a resolution, noise
            or delay of arm.encoder, computed torque uses difference quotients of the encoder readings
        inverse: inversion of the Jacobian
        feedback: K: feedback gain from pose error to twist
        feedforward: whether the command includes the reference twist
        joint_weights: joint weights W_q, one per joint: a joint with a larger weight moves less; null: all 1
        nullspace: motion in the null space of the task
        limits: bounds on joint positions, rates, accelerations and jerk
        at_singularity: near a singularity: leave it to the inverse, slow down along the path, stop and wait
            for a way out, slow down along the kernel of [J | −t], or keep out of it
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
