"""The choices of a control law, each with its source and its parameters, declared once.

The values of keys, fields of the world's record, the dispatch of the compiled law, the space that `tune`
searches and the tables of `docs/choices.md` follow from the lists below. The compiled function with its name
in `rmrc.law` implements a choice, and its code there is its position in the list. A parameter is a key of the
same name in `rmrc.scenario.control`, with unit, default and bounds.
"""

import math
from collections.abc import Callable
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


# Those of a run: only a loop outside a run has an input that could be wrong or late.
IN_RUNS = tuple(bit for bit in Status if bit not in (Status.INVALID_INPUT, Status.OVERDUE))


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


@dataclass(frozen=True)
class Keyed:
    """What a scenario has at a key.

    Attributes:
        key: Key below `control`; of a plant, below the root.
    """

    key: str

    @property
    def field(self) -> str:
        """The field of a world's record that holds it."""
        return self.key.replace(".", "_")


@dataclass(frozen=True)
class Parameter(Keyed):
    """A number that choices read: a key of a scenario, a field of the record, a dimension of the search.

    Attributes:
        null: The number that the law reads where the key is null; None: it is never null.
        range: Smallest and largest value that `tune` tries; None: it leaves the parameter alone.
        is_each: Whether it has one value per joint.
    """

    null: float | None = None
    range: Callable[[Scales], tuple[float, float]] | None = None
    is_each: bool = False


PARAMETERS = (
    # λ = σ₁/2 takes a fifth of the gain even in the best direction, by 1/(1 + λ²/σ²); σ₁/1000 lets rates grow
    # 500-fold.
    DAMPING_MAXIMUM := Parameter("inverse.damping.maximum", 0.1,
        lambda seen: (1e-3 * seen.sigma, 0.5 * seen.sigma)),
    # Damping that begins at σ₁ never ends.
    DAMPING_BELOW := Parameter("inverse.damping.below", 0.3, lambda seen: (5e-3 * seen.sigma, seen.sigma)),
    MANIPULABILITY_BELOW := Parameter("inverse.damping.manipulability_below",
        range=lambda seen: (1e-3 * seen.manipulability, seen.manipulability)),
    # λ = σ₁/10 at a task error from 1 mm to 1 (m over the length, or rad).
    ERROR_GAIN := Parameter("inverse.damping.error_gain",
        range=lambda seen: (0.1 * seen.sigma, 100.0 * seen.sigma)),
    TOLERANCE := Parameter("inverse.tolerance"),  # `truncated` is the same with a threshold that is searched
    CUTOFF := Parameter("inverse.cutoff", range=lambda seen: (1e-3 * seen.sigma, 0.5 * seen.sigma)),
    GAMMA := Parameter("inverse.gamma", range=lambda _: (1e-3, 0.5)),
    PUSH_POSITION := Parameter("inverse.push.position"), PUSH_ROTATION := Parameter("inverse.push.rotation"),
    RATE_BOUND := Parameter("inverse.rate_bound", range=lambda seen: (seen.slowest, seen.fastest)),
    # Only the arm knows the start, which is the posture for null.
    GAIN := Parameter("nullspace.gain"), POSTURE := Parameter("nullspace.posture", math.nan, is_each=True),
    RATES := Parameter("nullspace.rates", 0.0, is_each=True),
    SECONDARY_DAMPING := Parameter("nullspace.secondary.damping"),
    SLOW_CHANGE := Parameter("slow.change"), SLOW_PATIENCE := Parameter("slow.patience"),
    SLOW_LONGEST := Parameter("slow.longest"),
    # An arm that is held at its start, or soon after, neither succeeds nor fails.
    STOP_SIGMA := Parameter("stop.sigma",
        range=lambda seen: (min(1e-3 * seen.sigma, 0.1 * seen.start), 0.5 * seen.start)),
    STOP_CONDITION := Parameter("stop.condition", math.inf), STOP_CHANGE := Parameter("stop.change"),
    KEEP_OUT_SIGMA := Parameter("keep_out.sigma"), KEEP_OUT_APPROACH := Parameter("keep_out.approach"),
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
    """

    name: str
    meaning: str
    source: str = ""
    parameters: tuple[Parameter, ...] = ()
    acts: bool = True


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


@dataclass(frozen=True)
class Plant(Choice):
    """A plant, which turns commanded rates into motion, by the class of its name in `rmrc.plants`.

    Attributes:
        physics: Whether MuJoCo steps it, with gravity, loads and torques; otherwise it is only kinematics.
        own: Whether it is the model as its author wrote it: actuators, timestep, gravity compensation.
    """

    physics: bool = True
    own: bool = False


C_co = TypeVar("C_co", bound=Choice, covariant=True)


@dataclass(frozen=True)
class Choices(Keyed, Generic[C_co]):
    """The choices of a key.

    Attributes:
        default: A name.
        options: In the order of the schema; the code of each is its position.
    """

    default: str
    options: tuple[C_co, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all choices."""
        return tuple(option.name for option in self.options)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters that they read, each once."""
        read = {each for option in self.options for each in option.parameters}
        return tuple(each for each in PARAMETERS if each in read)

    def code(self, name: str) -> int:
        """Return the code of a name in compiled code.

        Raises:
            ValueError: There is no such name.
        """
        return self.names.index(name)

    def codes(self, are: Callable[[C_co], bool]) -> tuple[int, ...]:
        """Return the codes of all choices with a property."""
        return tuple(code for code, option in enumerate(self.options) if are(option))

    def __getitem__(self, name: str) -> C_co:
        """Return the choice with a name.

        Raises:
            ValueError: There is none.
        """
        return self.options[self.code(name)]


INVERSES = Choices("inverse.method", "damped", (
    Inverse("inverse", "1/σ, for as many task axes as joints", needs_square=True, preference=7),
    Inverse("pseudoinverse", "1/σ where σ > tolerance · σ₁, else 0", "Whitney69", (TOLERANCE,), preference=6),
    Inverse("truncated", "1/σ where σ > cutoff, else 0", "Golub13, §5.5", (CUTOFF,), preference=4),
    Inverse("transpose", "α σ with the best α", "Wolovich84", preference=5),
    Inverse("damped", "σ/(σ² + λ²)", "Nakamura86", is_scheduled=True),
    Inverse("filtered", "σ/(σ² + λ(σ)²)", "Maciejewski88",
        (DAMPING_MAXIMUM, DAMPING_BELOW), preference=1),
    Inverse("selectively_damped", "1/σ, clamped to a bound on joint rates", "Buss05",
        (RATE_BOUND,), preference=2),
    Inverse("jparse", "1/σ where σ ≥ γ σ₁, else σ/(γ σ₁)²", "Guptasarma25",
        (GAMMA, PUSH_POSITION, PUSH_ROTATION), preference=3),
))  # fmt: skip

METRICS = Choices("inverse.metric", "joints", (
    Choice("joints", "‖W_q^½ qdot‖, sliding joints over task.length", "Whitney69", acts=False),
    Choice("inertia", "√(qdotᵀ M(q) qdot), dynamically consistent", "Khatib87", acts=False),
))  # fmt: skip

SCHEDULES = Choices("inverse.damping.schedule", "smallest_singular_value", (
    Schedule("constant", "λ_max", "Wampler86", (DAMPING_MAXIMUM,)),
    Schedule("manipulability", "λ_max (1 − w/w₀) where w < w₀, else 0", "Nakamura86",
        (DAMPING_MAXIMUM, MANIPULABILITY_BELOW), follows="arm"),
    Schedule("smallest_singular_value", "λ² = (1 − (σ_min/ε)²) λ_max² where σ_min < ε, else 0",
        "Chiaverini94", (DAMPING_MAXIMUM, DAMPING_BELOW), follows="arm"),
    Schedule("error", "error_gain · the task error: vanishes while tracking is good",
        "Levenberg44", (ERROR_GAIN,)),
    Schedule("rate_bound", "the least that keeps the norm of joint rates within a bound", "Deo92",
        (RATE_BOUND,), follows="command"),
))  # fmt: skip

OBJECTIVES = Choices("nullspace.objective", "none", (
    Choice("none", "0", acts=False),
    Choice("posture", "gain · (posture − q)", "Liegeois77", (GAIN, POSTURE)),
    Choice("joint_limits", "towards the middle of the joints' ranges", "Liegeois77", (GAIN,)),
    Choice("manipulability", "towards a larger w, by the derivative of J", "Yoshikawa85", (GAIN,)),
    Choice("rates", "constant, as given", "", (RATES,)),
    Choice("secondary", "rates of a second task of lower priority"),
))  # fmt: skip

PRIORITIES = Choices("nullspace.secondary.priority", "robust", (
    Choice("classical", "solved within the null space of the first task", "Nakamura87", (SECONDARY_DAMPING,)),
    Choice("robust", "solved alone, then projected", "Chiaverini97", (SECONDARY_DAMPING,)),
))  # fmt: skip

LIMITS = Choices("limits.on_excess", "scale", (
    Choice("scale", "all by one factor: the tip keeps its direction, except at position limits"),
    Choice("clamp", "each by itself: the tip does not keep its direction"),
    Choice("redistribute", "other joints take over the part of a saturated one", "Flacco15"),
    Choice("optimal", "the best rates within the bounds, by the measure of the damped inverse; for another "
        "inverse, those nearest to its own", "Stark95"),
    Choice("none", "nothing", acts=False),
    Choice("sns", "the largest share of the task within all bounds: the tip keeps its direction, and waits "
        "where none fits", "Flacco15"),
    Choice("reverse_priority", "joints that the task would take beyond their bounds stay at them, and "
        "the others do the rest", "Flacco14"),
))  # fmt: skip

POLICIES = Choices("at_singularity", "damp", (
    Policy("damp", "the rates of the inverse", acts=False),
    Policy("slow", "the time along the path slows, so that the tip stays on it within rate limits", "",
        (SLOW_CHANGE, SLOW_PATIENCE, SLOW_LONGEST), slows=True),
    Policy("stop", "the arm holds where σ_min or κ passes its bound, until the command leads out", "",
        (STOP_SIGMA, STOP_CONDITION, STOP_CHANGE)),
    Policy("singularity_consistent", "rates and pace along the kernel of [J | −t]: the tip keeps the "
        "path's tangent", "Nenchev00",
        (SLOW_CHANGE, SLOW_PATIENCE, SLOW_LONGEST), is_tried=False, slows=True),
    Policy("keep_out", "the arm slides along configurations with σ_min = `sigma` and goes no nearer",
        "Ames19", (KEEP_OUT_SIGMA, KEEP_OUT_APPROACH), is_tried=False),
))  # fmt: skip

# Of the control law, by their keys below `control`.
CHOICES: tuple[Choices[Choice], ...] = (
    INVERSES, METRICS, SCHEDULES, OBJECTIVES, PRIORITIES, LIMITS, POLICIES
)  # fmt: skip

PLANTS = Choices("plant.kind", "servo", (
    Plant("ideal", "q⁺ = q + period · qdot_cmd, Whitney's own arm", "Whitney72", physics=False),
    Plant("servo", "torque = kv · (qdot_cmd − qdot) + friction + springs, in MuJoCo's physics"),
    Plant("torque", "computed torque: M (Δqdot_cmd/period + bandwidth · (qdot_cmd − qdot)) + bias + friction",
        "Luh80"),
    Plant("model", "the model's own actuators: position servos get the integral of qdot_cmd, rate servos "
        "qdot_cmd, motors computed torque", own=True),
))  # fmt: skip
IDEAL, SERVO, *_ = PLANTS.options


def read_by(method: str, schedule: str) -> tuple[Parameter, ...]:
    """Return the parameters that an inverse and, if it has one, its schedule read."""
    inverse = INVERSES[method]
    return (*inverse.parameters, *(SCHEDULES[schedule].parameters if inverse.is_scheduled else ()))


def record_fields() -> tuple[tuple[str, type[int] | type[float], bool], ...]:
    """Return the fields of a world's record that hold choices and parameters.

    Returns:
        For each, its name, the type of its values, and whether it has one per joint.
    """
    codes = [(each.field, int, False) for each in CHOICES]
    return (*codes, *((each.field, float, each.is_each) for each in PARAMETERS))


def write_choices(world: Any, control: Any) -> None:
    """Write the fields of `record_fields` into the record of a world, or an array of one.

    Args:
        world: Of a type that has these fields.
        control: The section `control` of a scenario.
    """
    for choices in CHOICES:
        world[choices.field] = choices.code(attrgetter(choices.key)(control))
    for each in PARAMETERS:
        value = attrgetter(each.key)(control)
        if isinstance(value, tuple):
            world[each.field][..., : len(value)] = value
        else:
            world[each.field] = each.null if value is None else value
