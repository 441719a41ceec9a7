"""The control law for a Jacobian that the caller computes, without a model and without MuJoCo.

    law = Law(7, 6, {"feedback": 0, "limits": {"rate": 2.0}})
    while True:
        rates = law.step(J, twist).qdot_cmd
        ...

`resolve_rates` applies one inverse to one Jacobian and one twist.
"""

import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from rmrc.law.command import Command
from rmrc.law.fit import misfits
from rmrc.law.jit import Array, machine_code
from rmrc.law.law import TaskLaw, resolve
from rmrc.law.loop import RATES, Loop, taken
from rmrc.law.record import ROWS, Field, records, tick_type
from rmrc.law.sight import Sight
from rmrc.law.step import JACOBIAN_ALONE, Given
from rmrc.law.task import BareJoints, BareTask, Task
from rmrc.scenario import ControlSection, ControlSource, read_controls
from rmrc.scenario.choices import INVERSES, LIMITS, OBJECTIVES, POLICIES, SCHEDULES, Choice, Choices
from rmrc.support.errors import QuestionError, ScenarioError, did_you_mean
from rmrc.support.legible import shortened
from rmrc.support.problems import Problem

TWIST = int(Given.TWIST)


class Law(Loop):
    """The law without an arm: it turns a Jacobian and a twist into joint rates within the limits.

    It is the same compiled law as in a run. Quantities that depend on the arm are given with each step: the
    error for the schedule `error`, the gradient for the objective `manipulability`, the inertia for the
    metric `inertia`. Only `Controller` has a pose, the objective `secondary` (here `rates` with `qdot0` can
    replace it) and the policies other than `damp` and `slow`.

    Attributes:
        n: Number of joints.
        m: Number of task rows.
        control: The settings of the law.
    """

    def __init__(
        self,
        n: int,
        m: int = 6,
        control: ControlSource = None,
        *,
        period: float | None = None,
        weights: Sequence[float] | None = None,
        position_limit: ArrayLike | None = None,
        rate_limit: ArrayLike | None = None,
        joints: Sequence[str] | None = None,
        watchdog: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Make the law.

        Args:
            n: Number of joints.
            m: Number of task rows, 1 to 6.
            control: As in `Controller`.
            period: Time between two steps [s]; None: the period of `control`.
            weights: Task weights W_x, (m,); None: all 1.
            position_limit: Lower and upper position of each joint, (n, 2) [rad or m]; None: no limits. With
                limits `step` needs q.
            rate_limit: Largest rates where `control` has none, (n,) [rad/s or m/s]; None: none.
            joints: Names of the joints, used in messages and in `limited_by`.
            watchdog: See `watchdog`.
            clock: Returns the time that the watchdog compares [s].

        Raises:
            QuestionError: A shape or a number is not usable.
            ScenarioError: `control` has an unusable value, or does not fit n and m.
        """
        if not (isinstance(n, int) and n > 0 and isinstance(m, int) and 0 < m <= ROWS):
            raise QuestionError(f"n must be 1 or more, and m 1 to {ROWS}, got n {n} and m {m}")
        names = tuple(joints) if joints is not None else tuple(f"joint{j}" for j in range(n))
        limit = _limits("position_limit", position_limit, (n, 2), [-math.inf, math.inf])
        rate = _limits("rate_limit", rate_limit, (n,), math.inf)
        if len(names) != n or (limit[:, 0] > limit[:, 1]).any() or (rate < 0.0).any():
            raise QuestionError(
                f"joints must have {n} names, position_limit lower ends first, and rate_limit nothing below 0"
            )
        self.n, self.m = n, m
        self.control = read_controls(control, period).control
        self._joints = BareJoints(names, limit, rate)
        task = BareTask(self._joints, m, weights, self.control.joint_weights)
        if weights is not None and (len(weights) != m or min(weights) <= 0.0):
            raise QuestionError(f"weights must be {m} numbers > 0, got {list(weights)}")
        found = [
            Problem(tuple(key.split(".")), text) for key, text in _misfits(self.control, m, self._joints)
        ]
        if found:
            raise ScenarioError(found)
        self._task = task
        follows_q = self.control.nullspace.objective in ("posture", "joint_limits")
        self._needs_q = bool(np.isfinite(limit).any() and self.control.limits.position) or follows_q
        self._reads = dict(_read_of(self.control))
        self._unit: Array | None = None
        super().__init__(names, m, self.control.period, clock)
        self.reset()
        self.watchdog = watchdog

    def reset(self, q: ArrayLike | None = None, *, worlds: int | None = None) -> None:
        """Forget all steps: the next one is the first, from rest.

        Args:
            q: Positions of the joints, (n,), or (w, n) for a batch of w worlds [rad or m]. They are also the
                posture of the null space where `control` has none. None: the number of worlds stays, and q
                comes from the first step.
            worlds: Number of worlds, instead of q.

        Raises:
            QuestionError: q has another shape, or is not finite.
        """
        shape = (self.n,) if worlds is None else (worlds, self.n)
        self._unit = None
        if q is None and worlds is None and hasattr(self, "_worlds"):
            self._forget()
            return
        starts = started("q", np.zeros(shape) if q is None else q, self.n)
        laws = [TaskLaw(self._task, self.control, start) for start in starts.reshape(-1, self.n)]
        self._renew([[self._task, law, Sight()] for law in laws], self.n, starts.ndim == 1)
        if self.control.nullspace.objective == "manipulability":  # the gradient is given as rates
            self._worlds[OBJECTIVES.field] = OBJECTIVES.code("rates")
        J = self._worlds["J"][:, : self.m, : self.n]
        self._J = J[0] if self._is_one else J
        if q is not None:
            self._worlds["q"][:, : self.n] = self._worlds["q_cmd"][:, : self.n] = starts

    def step(
        self,
        J: ArrayLike,
        twist: ArrayLike,
        q: ArrayLike | None = None,
        qdot: ArrayLike | None = None,
        *,
        error: ArrayLike | None = None,
        gradient: ArrayLike | None = None,
        qdot0: ArrayLike | None = None,
        M: ArrayLike | None = None,
    ) -> Command:
        """Return the command for the next period. It raises nothing and keeps no argument.

        Args:
            J: Jacobian of the task, (m, n), or (w, m, n) of a batch, in the axes of the twist.
            twist: Wanted velocity of the task, feedback included, (m,) or (w, m) [m/s, rad/s].
            q: Joint positions, as measured, (n,) or (w, n) [rad or m]; position limits and the objectives
                `posture` and `joint_limits` need them.
            qdot: Joint rates, as measured, (n,) or (w, n) [rad/s or m/s]; with a jerk limit the law estimates
                from them how far a joint lags behind its commands.
            error: Norm of the task's error for the schedule `error`, () or (w,).
            gradient: Gradient of the quantity that the objective `manipulability` raises, with respect to the
                joints, (n,) or (w, n).
            qdot0: Rates for the objective `rates` in this step, instead of `nullspace.rates`, (n,) or (w, n)
                [rad/s or m/s]. J₂⁺ v₂ makes it a second task of `robust` priority.
            M: Joint inertia for the metric `inertia`, (n, n) or (w, n, n); only the lower triangle is read.
                Its unit is the mean diagonal of the first M after `reset`.

        Returns:
            Views that the next step overwrites. Unusable input brakes the joints: see `Command.problem`.
        """
        given = TWIST
        try:
            if J.shape != self._J.shape:  # type: ignore[union-attr]
                raise ValueError
            self._J[...] = J
            self._twist[:] = twist
            if q is not None:
                self._q[:] = q
            if qdot is not None:
                self._qdot[:] = qdot
                given |= RATES
        except Exception:
            return self._step_with_care(J, twist, q, qdot, error, gradient, qdot0, M)
        if q is None and self._needs_q:
            return self._refuse(_NEEDS_Q)
        if self._reads or not (error is gradient is qdot0 is M is None):
            wrong = self._take_more(error=error, gradient=gradient, qdot0=qdot0, M=M)
            if wrong:
                return self._refuse(wrong)
        return self._finish(given)

    def _take_more(self, **given: ArrayLike | None) -> str:
        """Write the optional arguments into the records; return an error text, "" if there is none."""
        n, w, wrong = self.n, len(self._worlds), ""
        for name, one in given.items():
            key = self._reads.get(name, "")
            values = self.control.nullspace.rates if one is None and name == "qdot0" and key else one
            if wrong or (values is None and not key):
                continue
            if not key:
                return f"{name} is given, and {_READERS[name]} is not chosen"
            if values is None:
                return f"{name} is needed: {key} reads it"
            each = {"error": (), "M": (n, n)}.get(name, (n,))
            found = np.empty((w, *each))
            wrong = taken(name, values, _Whole(found), [each] if self._is_one else [(w, *each), each])
            if not wrong:
                with np.errstate(all="ignore"):  # the caller reports non-finite results
                    wrong = self._put_more(name, found)
        return f"{wrong}; reset made a batch of {w}" if wrong and not self._is_one else wrong

    def _put_more(self, name: str, values: Array) -> str:
        """Write one optional argument, (w, ...), into the records; return an error text, "" if none."""
        n, worlds = self.n, self._worlds
        if name == "M":
            unit: Any = self._unit
            if unit is None:
                mean = np.trace(values, axis1=1, axis2=2) / n
                if not (np.isfinite(mean) & (mean > 0.0)).all():
                    return "M is not positive definite, or not finite"
                unit = self._unit = mean[:, None, None]
            worlds["metric"][:, :n, :n] = values / unit
            return ""
        if not np.isfinite(values).all() or (name == "error" and (values < 0.0).any()):
            return f"{name} is not finite{', or below 0' if name == 'error' else ''}"
        if name == "error":
            worlds["error"] = values
            return ""
        if name == "gradient":
            values = self.control.nullspace.gain * worlds["joint_scale"][:, :n] ** 2 * values
        worlds["nullspace_rates"][:, :n] = values
        return ""

    def _step_with_care(
        self,
        J: ArrayLike,
        twist: ArrayLike,
        q: ArrayLike | None,
        qdot: ArrayLike | None,
        *more: ArrayLike | None,
    ) -> Command:
        """Convert input that is not a 64-bit array of the right shape, or refuse it with a reason."""
        n, w = self.n, len(self._worlds)
        rows, twists = ([(n,)], [(self.m,)]) if self._is_one else ([(w, n), (n,)], [(w, self.m), (self.m,)])
        wrong = taken("J", J, self._J, [self._J.shape]) or taken("twist", twist, self._twist, twists)
        for name, values in (("q", q), ("qdot", qdot)):
            wrong = wrong or (taken(name, values, self._put[name], rows) if values is not None else "")
        if not wrong and q is None and self._needs_q:
            wrong = _NEEDS_Q
        wrong = wrong or self._take_more(**dict(zip(_READERS, more, strict=True)))
        if wrong and not self._is_one and "batch" not in wrong:
            wrong += f"; reset made a batch of {w}"
        elif wrong and getattr(J, "ndim", 0) == 3:
            wrong += "; reset(worlds=...) makes a batch"
        return self._refuse(wrong) if wrong else self._finish(TWIST | (RATES if qdot is not None else 0))


class _Whole:
    """Lets `taken` assign an array for all worlds, or one row that all worlds share."""

    def __init__(self, values: Array) -> None:
        self._values = values

    def __setitem__(self, all_of_it: slice, given: Array) -> None:
        self._values[...] = given


_NEEDS_Q = "q is needed: position limits or the null space depend on it"
# The part of the law that reads each optional argument of a step.
_READERS = {
    "error": 'the schedule "error"', "gradient": 'the objective "manipulability"',
    "qdot0": 'the objective "rates"', "M": 'the metric "inertia"',
}  # fmt: skip


def _read_of(control: ControlSection) -> Iterator[tuple[str, str]]:
    """Yield each optional argument that a law reads, with the part of the law that reads it."""
    inverse, objective = control.inverse, control.nullspace.objective
    if INVERSES[inverse.method].is_scheduled and inverse.damping.schedule == "error":
        yield "error", _READERS["error"]
    if objective in ("manipulability", "rates"):
        name = "gradient" if objective == "manipulability" else "qdot0"
        yield name, _READERS[name]
    if inverse.metric == "inertia":
        yield "M", _READERS["M"]


def _limits(name: str, given: ArrayLike | None, shape: tuple[int, ...], nothing: Any) -> Array:
    if given is None:
        return np.full(shape, nothing)
    try:
        values = np.array(given, np.float64)
    except (TypeError, ValueError):
        raise QuestionError(f"{name} must be numbers, got {shortened(repr(given))}") from None
    if values.shape != shape or np.isnan(values).any():
        raise QuestionError(f"{name} must be {shape} and no NaN, got {shortened(str(values.tolist()))}")
    return values


def started(name: str, q: ArrayLike, n: int) -> Array:
    """Return the initial joint positions, (n,) or (w, n).

    Raises:
        QuestionError: They have another shape, or are not finite.
    """
    try:
        values = np.array(q, np.float64)
    except (TypeError, ValueError):
        raise QuestionError(f"{name} must be numbers, got {shortened(repr(q))}") from None
    if values.ndim not in (1, 2) or values.shape[-1] != n or not values.size:
        raise QuestionError(f"{name} must be ({n},) or (w, {n}), got {values.shape}")
    if not np.isfinite(values).all():
        raise QuestionError(f"{name} must be finite, got {shortened(str(values.tolist()))}")
    return values


def _misfits(control: ControlSection, m: int, joints: BareJoints) -> list[tuple[str, str]]:
    found = list(misfits(control, m, joints))
    needs = "needs the arm's kinematics, which a Jacobian alone does not give; use rmrc.Controller"
    objective, policy = control.nullspace.objective, control.at_singularity
    if objective == "secondary":
        text = f'"secondary" {needs}, or "rates", and give qdot0 with each step'
        found.append(("control.nullspace.objective", text))
    if objective == "joint_limits" and not np.isfinite(joints.position_limit).all():
        found.append(("control.nullspace.objective", '"joint_limits" needs position_limit of all joints'))
    if policy in ("stop", "singularity_consistent", "keep_out"):  # replaces the findings about the same key
        found = [one for one in found if one[0] != "control.at_singularity"]
        found.append(("control.at_singularity", f'"{policy}" {needs}'))
    return found


# One inverse ---------------------------------------------------------------------------------------


def resolve_rates(
    J: ArrayLike,
    twist: ArrayLike,
    method: str = INVERSES.default,
    *,
    schedule: str = SCHEDULES.default,
    damping_maximum: float = 0.1,
    damping_below: float = 0.3,
    manipulability_below: float = 0.3,
    error_gain: float = 1.0,
    error: float = 0.0,
    tolerance: float = 1e-6,
    cutoff: float = 0.01,
    gamma: float = 0.1,
    rate_bound: float = 2.0,
    **others: float,
) -> Array:
    """Return the joint rates of one inverse for one twist: the law for a notebook.

    The defaults are those of a scenario.

    Args:
        J: Jacobian of the task, (m, n), m <= 6.
        twist: Commanded task velocity, (m,).
        method: One of the inverses; `inverse` needs a square J.
        schedule: The damping schedule of `damped`.
        damping_maximum: λ_max, in the units of σ.
        damping_below: ε, below which `smallest_singular_value` and the method `filtered` damp.
        manipulability_below: w₀, below which `manipulability` damps.
        error_gain: λ of the schedule `error` for an error of 1.
        error: Norm of the task error, for that schedule.
        tolerance: `pseudoinverse` drops σ_i <= tolerance · σ_1.
        cutoff: `truncated` drops σ_i <= cutoff.
        gamma: γ; `jparse` fades directions with σ_i < γ σ_1.
        rate_bound: Largest joint rate of `selectively_damped`, largest norm of the schedule `rate_bound`.
        others: Other parameters, by their key below `control.inverse`, with `_` for the dots.

    Returns:
        Joint rates, (n,).

    Raises:
        ValueError: The law does not know the method, schedule or parameter, or the shapes do not fit.

    >>> resolve_rates(np.diag([1.0, 0.1]), np.array([1.0, 1.0]), schedule="constant").round(3)
    array([0.99, 5.  ])
    >>> resolve_rates(np.diag([1.0, 0.01]), np.array([1.0, 1.0]), "jparse", gamma=0.1).round(3)
    array([1., 1.])
    """
    J, twist = np.asarray(J, np.float64), np.asarray(twist, np.float64)
    J = J if J.ndim > 1 else J[None]
    numbers = (
        damping_maximum, damping_below, manipulability_below, error_gain, tolerance, cutoff, gamma, rate_bound
    )  # fmt: skip
    key = J.shape, method, schedule, numbers, *others.items()
    known: dict[Any, _Resolved] = _known.__dict__
    one = known.get(key)
    if one is None:
        if J.ndim != 2 or not 0 < len(J) <= ROWS or not J.shape[1] or twist.shape != J.shape[:1]:
            raise ValueError(_shapes(J, twist))
        while len(known) >= MOST_KNOWN:
            del known[next(iter(known))]
        given = dict(zip(_NAMES, numbers, strict=True)) | others
        one = known[key] = _Resolved(J.shape, method, schedule, given)
    return one(J, twist, error)


# The parameters above, by their keys below `control.inverse`.
_NAMES = (
    "damping_maximum", "damping_below", "damping_manipulability_below", "damping_error_gain", "tolerance",
    "cutoff", "gamma", "rate_bound",
)  # fmt: skip
MOST_KNOWN = 64
_known = threading.local()


class _Resolved:
    """One inverse for Jacobians of one shape. One thread uses its records, which are made once."""

    def __init__(
        self, shape: tuple[int, ...], method: str, schedule: str, parameters: Mapping[str, float]
    ) -> None:
        m, n = shape
        codes = {INVERSES.field: _code("method", method, INVERSES)}
        codes[SCHEDULES.field] = _code("schedule", schedule, SCHEDULES)
        if INVERSES[method].needs_square and m != n:
            raise ValueError(f"method '{method}' needs a square J, got {shape}")
        known = {
            one.field.removeprefix("inverse_"): one for one in (*INVERSES.parameters, *SCHEDULES.parameters)
        }
        for name in parameters:
            if name not in known:
                raise ValueError(f'no inverse has a parameter "{name}"{did_you_mean(name, known)}')
        defaults = {name: one.null if one.default is None else one.default for name, one in known.items()}
        chosen = {one.field: (defaults | dict(parameters))[name] for name, one in known.items()}
        self._worlds, self._ticks = records(n, [_Inverse(m, n, chosen | codes)]), np.zeros(1, tick_type(n))
        (world,), (tick,) = self._worlds, self._ticks
        self._J, self._twist, self._error = world["J"][:m, :n], world["twist_cmd"][:m], self._worlds["error"]
        self._rates, self._age = tick["qdot_cmd"][:n], self._worlds["age"]
        self._nothing = np.zeros(shape)
        arguments: Any = (self._worlds, self._ticks)
        self._resolve = partial(machine_code(resolve, *arguments), *arguments)

    def __call__(self, J: Array, twist: Array, error: float) -> Array:
        if twist.shape != self._twist.shape:
            raise ValueError(_shapes(J, twist))
        if (
            np.vdot(J, self._nothing) != 0.0 or np.vdot(twist, self._nothing[:, 0]) != 0.0
        ):  # 0 times a non-finite number
            raise ValueError("J and twist must be finite")
        self._J[...], self._twist[...], self._error[0], self._age[0] = J, twist, error, 0
        self._resolve()
        rates: Array = self._rates.copy()
        return rates


class _Inverse:
    """A task without an arm, and a law that only inverts it."""

    fields: ClassVar[tuple[Field, ...]] = (*Task.fields, *TaskLaw.fields, *Sight.fields)

    def __init__(self, m: int, n: int, chosen: Mapping[str, Any]) -> None:
        joints = BareJoints(("",) * n, np.zeros((n, 2)), np.zeros(n))
        self._task, self._chosen = BareTask(joints, m), chosen

    def write(self, world: np.void) -> None:
        self._task.write(world)
        world["sites"] = JACOBIAN_ALONE
        for choices, nothing in ((OBJECTIVES, "none"), (LIMITS, "none"), (POLICIES, "damp")):
            world[choices.field] = choices.code(nothing)
        for field, value in self._chosen.items():
            world[field] = value


def _shapes(J: Array, twist: Array) -> str:
    return f"J must be (m, n) with m <= {ROWS} and twist (m,), got {J.shape}, {twist.shape}"


def _code(key: str, name: str, choices: Choices[Choice]) -> int:
    if name not in choices.names:
        known, hint = ", ".join(choices.names), did_you_mean(name, choices.names)
        raise ValueError(f'{key} must be one of {known}, got "{name}"{hint}')
    return choices.code(name)
