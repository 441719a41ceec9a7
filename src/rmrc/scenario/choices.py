"""The choices of a control law, each with its source and its parameters, declared once.

Sections and schema, fields of the world's record, the dispatch of the compiled law, the space that `tune`
searches and the tables of `docs/choices.md` follow from the lists below. The compiled function with its name
in `rmrc.law` implements a choice, and its code there is its position in the list.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntFlag
from functools import cached_property
from operator import attrgetter
from typing import Any, Generic, Literal, NamedTuple, TypeVar


class Status(IntFlag):
    """The events of a tick; several may occur at once."""

    OK = 0
    DAMPED = 1
    SLOWED = 2
    RATE_LIMITED = 4
    ACCELERATION_LIMITED = 8
    POSITION_LIMITED = 16
    SINGULAR = 32
    STOPPED = 64
    STUCK = 128
    CONTACT = 256
    TORQUE_LIMITED = 512
    JERK_LIMITED = 1024
    ACCELERATION_EXCEEDED = 2048
    JERK_EXCEEDED = 4096
    KEPT_OUT = 8192
    INVALID_INPUT = 16384
    OVERDUE = 32768
    SLIPPED = 65536


# Bits that only a loop outside a run can set: a simulation has no input that could be wrong or late.
OF_LOOPS = Status.INVALID_INPUT | Status.OVERDUE
IN_RUNS = tuple(one for one in Status if not one & OF_LOOPS)


class Scales(NamedTuple):
    """Scales of a scenario from its own run, on which the ranges of the search depend.

    Attributes:
        sigma: Largest singular value.
        manipulability: Largest w.
        start: Smallest singular value at the start.
        slowest: Smallest norm of the scaled joint rates with which the arm can follow.
        fastest: The largest norm that is useful as a bound.
    """

    sigma: float
    manipulability: float
    start: float
    slowest: float
    fastest: float


class Bounds(NamedTuple):
    """Bounds on a number: `gt` greater than, `ge` at least, `lt` less than, `le` at most."""

    gt: int | None = None
    ge: int | None = None
    lt: int | None = None
    le: int | None = None


POSITIVE, NOT_NEGATIVE, SHARE = Bounds(gt=0), Bounds(ge=0), Bounds(gt=0, lt=1)


@dataclass(frozen=True)
class Keyed:
    """An object with a key of a scenario.

    Attributes:
        key: Key below `control`.
    """

    key: str

    @property
    def field(self) -> str:
        """The field of a world's record that holds it."""
        return self.key.replace(".", "_")

    @property
    def place(self) -> str:
        """Its section below `control`; "" for `control` itself."""
        return self.key.rpartition(".")[0]

    @property
    def name(self) -> str:
        """Its key in that section."""
        return self.key.rpartition(".")[2]


@dataclass(frozen=True)
class Parameter(Keyed):
    """A number that choices read: a key of a scenario, a field of the record, a dimension of the search.

    Attributes:
        meaning: Description for the schema.
        default: None: null.
        unit: Unit for the schema.
        bounds: On the number.
        null: The number that the law reads where the key is null; None: it may not be null.
        derived: The source of a default that depends on the arm, in words; the law has `null` without an arm.
        kind: A number, one for all joints or for each, or one per joint: positions (perhaps angles) or rates.
        range: Smallest and largest value that `tune` tries; None: it leaves the parameter alone.
    """

    meaning: str
    default: float | None
    unit: str
    bounds: Bounds = POSITIVE
    null: float | None = None
    derived: str = ""
    kind: Literal["number", "each", "positions", "rates"] = "number"
    range: Callable[[Scales], tuple[float, float]] | None = None


# In the order of the keys in a section.
PARAMETERS = (
    DAMPING_MAXIMUM := Parameter(
        "inverse.damping.maximum",
        "λ_max, the largest damping (λ, not λ²); null: `below`/√2, so that no gain exceeds 1/`below`",
        None, "as σ", null=0.1, derived="from the arm",
        # λ = σ₁/2 takes a fifth of the gain even in the best direction, by 1/(1 + λ²/σ²); σ₁/1000 lets rates
        # grow 500-fold.
        range=lambda seen: (1e-3 * seen.sigma, 0.5 * seen.sigma),
    ),
    DAMPING_BELOW := Parameter(
        "inverse.damping.below",
        "ε: threshold of σ_min below which smallest_singular_value damps; filtered: threshold of each σ; "
        "null: a third of the arm's usual σ_min, its median within the limits",
        None, "as σ", null=0.3, derived="from the arm",
        # Damping that begins at σ₁ never ends.
        range=lambda seen: (5e-3 * seen.sigma, seen.sigma),
    ),
    MANIPULABILITY_BELOW := Parameter(
        "inverse.damping.manipulability_below",
        "w₀: threshold of w below which manipulability damps", 0.3, "as w",
        range=lambda seen: (1e-3 * seen.manipulability, seen.manipulability),
    ),
    ERROR_GAIN := Parameter(
        "inverse.damping.error_gain",
        "error: λ per unit task error, linear rows divided by task.length", 1.0, "as σ",
        # λ = σ₁/10 at a task error from 1 mm to 1 (m over the length, or rad).
        range=lambda seen: (0.1 * seen.sigma, 100.0 * seen.sigma),
    ),
    TOLERANCE := Parameter(  # `truncated` is the same with a threshold that `tune` searches
        "inverse.tolerance",
        "pseudoinverse: threshold relative to the largest singular value, up to which singular values are "
        "dropped", 1e-6, "1", SHARE,
    ),
    CUTOFF := Parameter(
        "inverse.cutoff", "truncated: threshold up to which singular values are dropped", 0.01, "as σ",
        range=lambda seen: (1e-3 * seen.sigma, 0.5 * seen.sigma),
    ),
    GAMMA := Parameter(
        "inverse.gamma",
        "jparse: threshold relative to the largest σ, below which directions fade", 0.1, "1", SHARE,
        range=lambda seen: (1e-3, 0.5),  # noqa: ARG005 - as the others are called
    ),
    PUSH_POSITION := Parameter(
        "inverse.push.position",
        "jparse: gain of the linear rows in a fading direction", 1.0, "1",
        NOT_NEGATIVE,
    ),
    PUSH_ROTATION := Parameter(
        "inverse.push.rotation",
        "jparse: gain of the angular rows in a fading direction", 1.0, "1", NOT_NEGATIVE,
    ),
    RATE_BOUND := Parameter(
        "inverse.rate_bound",
        "selectively_damped: largest rate of a joint; schedule rate_bound: largest norm of the rates; "
        "sliding joints divided by task.length", 2.0, "rad/s",
        range=lambda seen: (seen.slowest, seen.fastest),
    ),
    GAIN := Parameter(
        "nullspace.gain",
        "posture: rate per unit distance; joint_limits, manipulability: rate per unit slope",
        1.0, "1/s", NOT_NEGATIVE,
    ),
    POSTURE := Parameter(
        "nullspace.posture",
        "posture: desired joint positions, the shorter way round for a hinge without range; null: the start",
        None, "rad or m",
        null=math.nan, kind="positions",  # only the arm knows the start
    ),
    RATES := Parameter(
        "nullspace.rates", "rates: desired joint rates, one per joint", None, "rad/s or m/s",
        null=0.0, kind="rates",
    ),
    SECONDARY_DAMPING := Parameter(
        "nullspace.secondary.damping", "λ of the second task's inverse, constant", 0.05, "as σ", NOT_NEGATIVE,
    ),
    SLOW_CHANGE := Parameter(
        "slow.change", "largest rate of change of the pace, which is 1 at full speed", 10.0, "1/s",
    ),
    SLOW_PATIENCE := Parameter(
        "slow.patience",
        "longest wait where the arm cannot follow at any pace, before the path continues regardless",
        1.0, "s",
    ),
    SLOW_LONGEST := Parameter(
        "slow.longest", "time limit of the run, relative to the planned duration",
        10.0, "1", Bounds(ge=1, le=1000),
    ),
    STOP_SIGMA := Parameter(
        "stop.sigma", "hold if σ_min is at or below this", 0.1, "as σ",
        # An arm that is held at its start, or soon after, neither succeeds nor fails.
        range=lambda seen: (min(1e-3 * seen.sigma, 0.1 * seen.start), 0.5 * seen.start),
    ),
    STOP_CONDITION := Parameter(
        "stop.condition", "hold also if κ is at or above this; null: ignore κ", None, "1",
        Bounds(gt=1), null=math.inf,
    ),
    STOP_CHANGE := Parameter(
        "stop.change", "fraction of the rates removed or restored per second", 20.0, "1/s",
    ),
    KEEP_OUT_SIGMA := Parameter(
        "keep_out.sigma", "lower bound of σ_min", 0.1, "as σ",
    ),
    KEEP_OUT_APPROACH := Parameter(
        "keep_out.approach", "α: largest rate of decrease of σ_min, relative to its distance from the "
        "bound", 5.0,
        "1/s",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Choice:
    """One of the values of a key.

    Attributes:
        name: Its value in a scenario, and its function in the law.
        meaning: Its effect, for the table of `docs/choices.md`.
        source: Keys of `docs/references.md`.
        parameters: The parameters that it reads.
        acts: Whether the law has a function for it; without one, it changes nothing.
        others: Other names in tools, papers and talk: no file may use them, but a message then gives ours.
    """

    name: str
    meaning: str
    source: str = ""
    parameters: tuple[Parameter, ...] = ()
    acts: bool = True
    others: str = ""


@dataclass(frozen=True)
class Inverse(Choice):
    """A way to invert the Jacobian: a filter g(σ).

    Attributes:
        needs_square: Whether it needs as many task axes as joints.
        is_scheduled: Whether its damping follows a schedule.
        preference: Among settings with equal results, `tune` takes the inverse with the smallest: first those
            whose gain stays bounded at a singularity, in case the arm comes nearer to one than it did.
    """

    needs_square: bool = False
    is_scheduled: bool = False
    preference: int = 0


@dataclass(frozen=True)
class Schedule(Choice):
    """A rule for the damping.

    Attributes:
        follows: The quantity on which λ depends: the arm, where it is increased if joints are held at their
            stops and the remaining arm is nearer to a singularity; the command, where it is computed again
            for the remaining command; or "" for neither.
    """

    follows: Literal["", "arm", "command"] = ""


@dataclass(frozen=True)
class Policy(Choice):
    """A reaction to a nearby singularity.

    Attributes:
        is_tried: Whether `tune` tries it unasked. A policy that always gives up a part of the path loses
            every search for the smallest error; a second policy that slows down would double the cost of the
            search.
        slows: Whether it slows the time along the path.
    """

    is_tried: bool = True
    slows: bool = False


C_co = TypeVar("C_co", bound=Choice, covariant=True)


@dataclass(frozen=True)
class Choices(Keyed, Generic[C_co]):
    """The choices of a key.

    Attributes:
        meaning: Description for the schema.
        default: A name.
        options: In the order of the schema; the code of each is its position.
    """

    meaning: str
    default: str
    options: tuple[C_co, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all choices."""
        return tuple(one.name for one in self.options)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters that they read, each once."""
        return tuple(one for one in PARAMETERS if any(one in option.parameters for option in self.options))

    def code(self, name: str) -> int:
        """Return the code of a name in compiled code.

        Raises:
            ValueError: There is no such name.
        """
        return self.names.index(name)

    def codes(self, are: Callable[[C_co], bool]) -> tuple[int, ...]:
        """Return the codes of all choices with a property."""
        return tuple(code for code, one in enumerate(self.options) if are(one))

    def __getitem__(self, name: str) -> C_co:
        """Return the choice with a name.

        Raises:
            ValueError: There is none.
        """
        return self.options[self.code(name)]


INVERSES = Choices(
    "inverse.method", "method of inversion: the filter g(σ) in place of 1/σ", "damped",
    (
        Inverse("inverse", "1/σ", needs_square=True, preference=7,
            others="inv jinv exact plain newton newton_raphson nr ik_nr ikine_nr ordinary"),
        Inverse("pseudoinverse", "1/σ where σ > tolerance · σ₁, else 0", "Whitney69", (TOLERANCE,),
            preference=6,
            others="pinv pseudo_inverse moore_penrose mp lstsq least_squares right_inverse left_inverse "
            "generalized_inverse gauss_newton gn ik_gn chainiksolvervel_pinv pseudo"),
        Inverse("truncated", "1/σ where σ > cutoff, else 0", "Golub13, §5.5", (CUTOFF,), preference=4,
            others="svd tsvd truncated_svd truncated_pinv lma_svd"),
        Inverse("transpose", "α σ with the best α", "Wolovich84", preference=5,
            others="jt transposed jacobian_transpose j_transpose jtranspose"),
        Inverse("damped", "σ/(σ² + λ²)", "Nakamura86", is_scheduled=True,
            others="dls sr_inverse sr singularity_robust singularity_robust_inverse damped_least_squares lm "
            "lma ik_lm ikine_lm levenberg levenberg_marquardt wdls chainiksolvervel_wdls dpinv "
            "damped_pseudoinverse damped_inverse tikhonov regularized ridge constant"),
        Inverse("filtered", "σ/(σ² + λ(σ)²), each direction by its own λ", "Maciejewski88",
            (DAMPING_MAXIMUM, DAMPING_BELOW), preference=1,
            others="numerical_filtering nf filter maciejewski"),
        Inverse("selectively_damped", "1/σ, clamped to a bound on the joint rates of each direction",
            "Buss05", (RATE_BOUND,), preference=2,
            others="sdls selective selectively_damped_least_squares buss"),
        Inverse("jparse", "1/σ where σ ≥ γ σ₁, else σ/(γ σ₁)²", "Guptasarma25",
            (GAMMA, PUSH_POSITION, PUSH_ROTATION), preference=3,
            others="j_parse jparse_inverse"),
    ),
)  # fmt: skip

METRICS = Choices(
    "inverse.metric",
    "measure of the joint rates to minimize: their scaled norm, or the kinetic energy of the arm", "joints",
    (
        Choice("joints", "‖W_q^½ qdot‖, sliding joints over task.length", "Whitney69", acts=False,
            others="euclidean rates weights kinematic"),
        Choice("inertia", "√(qdotᵀ M qdot), with the inertia M(q) of the arm: dynamically consistent",
            "Khatib87", acts=False,
            others="dynamically_consistent dynamic mass khatib kinetic_energy energy operational_space"),
    ),
)  # fmt: skip

SCHEDULES = Choices(
    "inverse.damping.schedule",
    "how λ follows the arm: always `maximum`; rising to it as w falls below `manipulability_below`, or as "
    "σ_min falls below `below`; `error_gain` times the error; or the least that keeps the rates within "
    "`rate_bound`",
    "smallest_singular_value",
    (
        Schedule("constant", "λ_max", "Wampler86", (DAMPING_MAXIMUM,),
            others="fixed const none off false static"),
        Schedule("manipulability", "λ_max (1 − w/w₀) where w < w₀, else 0", "Nakamura86",
            (DAMPING_MAXIMUM, MANIPULABILITY_BELOW), follows="arm",
            others="nakamura nakamura_hanafusa w yoshikawa"),
        Schedule("smallest_singular_value", "λ² = (1 − (σ_min/ε)²) λ_max² where σ_min < ε, else 0",
            "Chiaverini94", (DAMPING_MAXIMUM, DAMPING_BELOW), follows="arm",
            others="sigma sigma_min min_sigma singular_value min_singular_value chiaverini maciejewski svd "
            "adaptive variable"),
        Schedule("error",
            "error_gain · the task error, as a contrast: it vanishes while tracking is good",
            "Levenberg44", (ERROR_GAIN,), others="sugihara chan chan_lawrence task_error levenberg"),
        Schedule("rate_bound", "the least that keeps the norm of the joint rates within a bound", "Deo92",
            (RATE_BOUND,), follows="command", others="deo_walker bound trust_region norm"),
    ),
)  # fmt: skip

OBJECTIVES = Choices(
    "nullspace.objective",
    "objective of the null-space motion: none, a posture, the middle of the joints' ranges, a larger w, "
    "constant rates, or a second task",
    "none",
    (
        Choice("none", "0", acts=False, others="off false zero nothing null disabled no"),
        Choice("posture", "gain · (posture − q)", "Liegeois77", (GAIN, POSTURE),
            others="home rest preferred preferred_posture configuration reference"),
        Choice("joint_limits", "towards the middle of the joints' ranges", "Liegeois77", (GAIN,),
            others="limits joint_limit limit_avoidance joint_limit_avoidance avoid_limits liegeois"),
        Choice("manipulability", "towards a larger w, by the derivative of J", "Yoshikawa85", (GAIN,),
            others="manip w yoshikawa dexterity gradient singularity_avoidance"),
        Choice("rates", "constant, as given", "", (RATES,),
            others="velocity velocities joint_rates qdot qdot0"),
        Choice("secondary",
            "the rates of a second task: another site, or other rows; `classical` or `robust` priority",
            others="second second_task secondary_task task_priority priority"),
    ),
)  # fmt: skip

PRIORITIES = Choices(
    "nullspace.secondary.priority",
    "classical: solved within the null space of the first task; robust: solved separately, then projected",
    "robust",
    (
        Choice("classical", "solved within the null space of the first task", "Nakamura87",
            (SECONDARY_DAMPING,), others="strict standard nakamura siciliano"),
        Choice("robust", "solved alone, then projected", "Chiaverini97", (SECONDARY_DAMPING,),
            others="singularity_robust sr chiaverini"),
    ),
)  # fmt: skip

LIMITS = Choices(
    "limits.on_excess",
    "beyond a limit: scale all joints alike (keeps direction, unless a joint is at its position limit), "
    "clamp each joint, redistribute the motion of saturated joints to the others, choose the best rates "
    "within all bounds, do the largest feasible share of the task, give limits priority over the task, or "
    "limit nothing",
    "scale",
    (
        Choice("scale",
            "all are scaled by one factor: the tip keeps its direction while no joint is at its position "
            "limit",
            others="scaled scale_all proportional uniform direction"),
        Choice("clamp", "each is clamped by itself: the tip does not keep its direction",
            others="clip clipped saturate saturation cut"),
        Choice("redistribute", "the other joints take over the part of a saturated joint", "Flacco15",
            others="basic_sns saturate_in_the_null_space"),
        Choice("optimal",
            "the rates within the bounds that are best for the task, by the measure of the damped inverse; "
            "for another inverse, those nearest to its own",
            "Stark95",
            others="best qp quadratic_program quadratic_programming bvls daqp osqp quadprog proxqp optimum "
            "optimize least_squares bounded_least_squares"),
        Choice("none", "nothing", acts=False, others="off false ignore nothing no"),
        Choice("sns",
            "the largest share of the task that fits all bounds, by the smallest rates for it: the tip keeps "
            "its direction, and waits where none fits",
            "Flacco15",
            others="opt_sns optimal_sns osns saturation_in_the_null_space"),
        Choice("reverse_priority",
            "limits come first: joints that the task would take beyond their bounds stay at them, and the "
            "others do the rest of the task",
            "Flacco14", others="rp reverse priority limits_first"),
    ),
)  # fmt: skip

POLICIES = Choices(
    "at_singularity",
    "near a singularity: leave it to the inverse, slow down along the path, stop and wait for a way out, "
    "slow down along the kernel of [J | −t], or keep out of it",
    "damp",
    (
        Policy("damp", "the rates of the inverse, unchanged", acts=False,
            others="damped dls damping none off false nothing ignore"),
        Policy("slow",
            "the time along the path is slowed, so that rates stay within limits and the tip on its path",
            "", (SLOW_CHANGE, SLOW_PATIENCE, SLOW_LONGEST), slows=True,
            others="slow_down slowdown scale time_scaling slowing true"),
        Policy("stop",
            "the arm holds where σ_min or κ passes its bound, and continues when the command leads out",
            "", (STOP_SIGMA, STOP_CONDITION, STOP_CHANGE), others="halt hold pause wait abort"),
        Policy("singularity_consistent",
            "rates and the time along the path are chosen together, along the kernel of [J | −t]: the tip "
            "stays on the path's tangent",
            "Nenchev00", (SLOW_CHANGE, SLOW_PATIENCE, SLOW_LONGEST), is_tried=False, slows=True,
            others="sc consistent nenchev tsumaki adjugate natural_motion"),
        Policy("keep_out",
            "the arm slides along the configurations with σ_min = `sigma` and does not go nearer",
            "Ames19", (KEEP_OUT_SIGMA, KEEP_OUT_APPROACH), is_tried=False,
            others="barrier cbf control_barrier_function avoid avoidance slide keepout"),
    ),
)  # fmt: skip

CHOICES: tuple[Choices[Choice], ...] = (
    INVERSES, METRICS, SCHEDULES, OBJECTIVES, PRIORITIES, LIMITS, POLICIES
)  # fmt: skip


@dataclass(frozen=True)
class Group(Keyed):
    """A section that follows the choices of the section that contains it.

    Attributes:
        meaning: Description for the schema.
        title: Description in a sentence; "" where its class in `sections` has it.
    """

    meaning: str
    title: str = ""


GROUPS = (
    Group(
        "inverse.damping",
        "damped, filtered: the damping λ",
        "How much damping λ the method `damped` uses, and when.",
    ),
    Group(
        "inverse.push",
        "jparse: gains in a fading direction",
        "Gains of the method `jparse` in a fading direction.",
    ),
    Group("nullspace.secondary", "secondary: the second task"),
    Group(
        "slow",
        "at_singularity slow, singularity_consistent: how",
        "How the time along the path is scaled.",
    ),
    Group("stop", "at_singularity stop: when", "When `at_singularity: stop` holds the arm."),
    Group(
        "keep_out",
        "at_singularity keep_out: how far",
        "How far `at_singularity: keep_out` keeps the arm from singularities.",
    ),
)


def read_by(method: str, schedule: str) -> tuple[Parameter, ...]:
    """Return the parameters that an inverse and, if it has one, its schedule read."""
    inverse = INVERSES[method]
    return (*inverse.parameters, *(SCHEDULES[schedule].parameters if inverse.is_scheduled else ()))


def record_fields() -> tuple[tuple[str, type[int] | type[float], bool], ...]:
    """Return the fields of a world's record that hold choices and parameters.

    Returns:
        For each, its name, the type of its values, and whether it has one per joint.
    """
    codes = [(one.field, int, False) for one in CHOICES]
    return (*codes, *((one.field, float, one.kind != "number") for one in PARAMETERS))


_CODES = tuple((one.field, attrgetter(one.key), one.code) for one in CHOICES)
_NUMBERS = tuple((one.field, attrgetter(one.key), one.null) for one in PARAMETERS)


def write_choices(world: Any, control: Any) -> None:
    """Write the fields of `record_fields` into the record of a world, or an array of one.

    Args:
        world: Of a type that has these fields.
        control: The section `control` of a scenario.
    """
    for field, read, code in _CODES:
        world[field] = code(read(control))
    for field, read, null in _NUMBERS:
        value = read(control)
        if isinstance(value, tuple):
            world[field][..., : len(value)] = value
        else:
            world[field] = null if value is None else value


@dataclass(frozen=True)
class Plant(Choice):
    """A plant, which turns commanded rates into motion, by the class of its name in `rmrc.plants`.

    Attributes:
        physics: Whether MuJoCo steps it, with gravity, loads and torques; otherwise it is only kinematics.
        own: Whether it is the model as its author wrote it: actuators, timestep, gravity compensation.
        equation: Its effect on the commanded rates, for the table of `docs/choices.md`.
    """

    physics: bool = True
    own: bool = False
    equation: str = ""


@dataclass(frozen=True)
class Plants:
    """The plants; the code of each is its position."""

    default: str
    options: tuple[Plant, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all plants."""
        return tuple(one.name for one in self.options)

    def __getitem__(self, name: str) -> Plant:
        """Return the plant with a name."""
        return self.options[self.names.index(name)]

    @property
    def meaning(self) -> str:
        """Descriptions of all of them."""
        *others, last = (one.meaning for one in self.options)
        return f"{', '.join(others)}, or {last}"

    @property
    def parameters(self) -> Iterator[Parameter]:
        """The parameters that they read, each once."""
        return iter(dict.fromkeys(parameter for one in self.options for parameter in one.parameters))

    @property
    def physical(self) -> str:
        """Names of the plants that MuJoCo steps."""
        return ", ".join(one.name for one in self.options if one.physics)

    @property
    def own(self) -> str:
        """Names of the plants that are the model as its author wrote it."""
        return ", ".join(one.name for one in self.options if one.own)


IDEAL = Plant(
    "ideal", "exact integration of the rates", "Whitney72", physics=False,
    equation="q⁺ = q + period · qdot_cmd, Whitney's own arm",
    others="kinematic kinematics integrator perfect none exact euler false off",
)  # fmt: skip
SERVO = Plant(
    "servo", "joint-rate servos", "",
    (
        Parameter(
            "kv",
            "servo: torque or force per unit rate error, one for all joints or one per joint; null: each "
            "joint's inertia at home divided by the timestep, plus its damping",
            None, "N·m·s/rad or N·s/m", null=math.nan, kind="each",
        ),
    ),
    equation="torque = kv · (qdot_cmd − qdot), plus the joint's resistance at qdot_cmd and the load "
    "of its springs, in MuJoCo's physics",
    others="velocity velocity_servo rate_servo dynamics dynamic actuator pd p mujoco physics",
)  # fmt: skip
BANDWIDTH = Parameter(
    "bandwidth",
    "torque, and motors of the model: acceleration per unit rate error; null: 500, or 1/control.period if "
    "that is less, as a larger one is unstable",
    None, "1/s", null=math.nan,
)  # fmt: skip
TORQUE = Plant(
    "torque", "computed torques", "Luh80", (BANDWIDTH,),
    equation="computed torque: M (Δqdot_cmd/period + bandwidth · (qdot_cmd − qdot)) + bias + friction",
    others="computed_torque effort inverse_dynamics motor force acceleration",
)  # fmt: skip

MODEL = Plant(
    "model", "the model's own actuators", "", (BANDWIDTH,), own=True,
    equation="the model's own actuators, in its own physics: position servos get the integral of qdot_cmd, "
    "rate servos qdot_cmd, motors computed torque",
    others="own native actuators drives author authors robot real mjcf position position_servo",
)  # fmt: skip

PLANTS = Plants("servo", (IDEAL, SERVO, TORQUE, MODEL))
