"""The control law for a Jacobian that the caller computes, without a model and without MuJoCo.

    law = Law(7, 6, {"feedback": 0, "limits": {"rate": 2.0}})
    while True:
        rates = law.step(J, twist).qdot_cmd
        ...

`resolve_rates` applies one inverse to one Jacobian and one twist.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from functools import lru_cache
from numbers import Real
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.law import damping, inverses, nullspace, settings
from rmrc.law.command import Command
from rmrc.law.compiling import Array
from rmrc.law.measurement import JACOBIAN_ALONE
from rmrc.law.record import ROWS, TWIST, capacity, new_worlds
from rmrc.law.settings import TaskLaw, link, schedule_of
from rmrc.law.step import resolve_alone
from rmrc.law.stepping import SteppedLaw, as_numbers, started
from rmrc.law.task import BareJoints, Task
from rmrc.scenario import ControlSection, ControlSource, LimitsSection, read_controls
from rmrc.scenario.changes import hinted
from rmrc.scenario.choices import INVERSES, OBJECTIVES, SCHEDULES, Choice, Choices
from rmrc.scenario.messages import other_name
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.text import shortened

# The part of the law that reads each optional argument of a step.
_READERS = {
    "error": 'the schedule "error"', "gradient": 'the objective "manipulability"',
    "qdot0": 'the objective "rates"', "M": 'the metric "inertia"',
}  # fmt: skip


class Law(SteppedLaw):
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

    @hinted
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
        if not (
            isinstance(n, int | np.integer) and n > 0 and isinstance(m, int | np.integer) and 0 < m <= ROWS
        ):
            raise QuestionError(f"n must be 1 or more, and m 1 to {ROWS}, got n {n} and m {m}")
        names = tuple(joints) if joints is not None else tuple(f"joint{j}" for j in range(n))
        limit = _limits("position_limit", position_limit, (n, 2), [-math.inf, math.inf])
        rate = _limits("rate_limit", rate_limit, (n,), math.inf)
        if len(names) != n or (limit[:, 0] > limit[:, 1]).any() or (rate < 0.0).any():
            raise QuestionError(
                f"joints must have {n} names, position_limit lower ends first, and rate_limit nothing below 0"
            )
        weighted = as_numbers("weights", np.ones(m) if weights is None else weights)
        if weighted.shape != (m,) or not ((weighted > 0.0) & (weighted < math.inf)).all():
            raise QuestionError(f"weights must be {m} numbers > 0 and finite, got {weights}")
        self.n, self.m, self.control = n, m, read_controls(control, period).control
        bare = BareJoints(names, limit, rate)
        settings.refuse(_misfits(self.control, m, bare))
        self._task = Task(
            cast(Any, bare), np.arange(m), weights=weighted.tolist(), joint_weights=self.control.joint_weights
        )
        inverse, objective = self.control.inverse, self.control.nullspace.objective
        is_limited = bool(np.isfinite(limit).any() and self.control.limits.position)
        self._needs_q = is_limited or objective in ("posture", "joint_limits")
        follows_error = INVERSES[inverse.method].is_scheduled and inverse.damping.schedule == "error"
        self._reads = {"error": follows_error, "gradient": objective == "manipulability"}
        self._reads |= {"qdot0": objective == "rates", "M": inverse.metric == "inertia"}
        super().__init__(names, self.control.period, watchdog, clock)
        self.reset()

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
        n, m = self.n, self.m
        self._unit: Array | None = None
        if q is None and worlds is None and hasattr(self, "_worlds"):
            self._forget()
            return
        if worlds is not None and (q is not None or not isinstance(worlds, int | np.integer) or worlds < 1):
            raise QuestionError(f"worlds must be an integer > 0, without q, got {worlds}")
        starts = started(np.zeros(n if worlds is None else (worlds, n)) if q is None else q, n)
        laws = [TaskLaw(self._task, self.control, start) for start in starts.reshape(-1, n)]
        self._renew(laws, n, starts.ndim == 1)
        records = self._worlds
        records["input"]["sites"], self._methods["control"] = JACOBIAN_ALONE, resolve_alone
        rates = records["law"]["nullspace_rates"][:, :n]
        if self._reads["gradient"]:  # it is given as rates
            records["law"][OBJECTIVES.field] = OBJECTIVES.code("rates")
            self._methods["objective"] = nullspace.rates
        for name, place in (
            ("J", records["state"]["J"][:, :m, :n]), ("twist", records["tick"]["twist_ref"][:, :m]),
            ("error", records["scratch"]["error"]), ("M", records["links"]["metric"][:, :n, :n]),
            ("gradient", rates), ("qdot0", rates),
        ):  # fmt: skip
            self._place(name, place)
        if q is not None:
            records["state"]["q"][:, :n] = records["input"]["q_cmd"][:, :n] = starts
        self._watch()

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
        dt: ArrayLike | None = None,
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
            dt: Time since the last step, as in `Controller.step`, () or (w,) [s]; None: `period`.

        Returns:
            Views that the next step overwrites. Unusable input brakes the joints: see `Command.problem`.
        """
        try:
            self._take_time(dt)
            self._take_each("J", J)
            self._take_each("twist", twist)
            bits = TWIST
            if q is None and self._needs_q:
                raise QuestionError("q is needed: position limits or the null space depend on it")
            if q is not None or qdot is not None:
                bits |= self._take_all(q=q, qdot=qdot)
            for name, values in (("error", error), ("gradient", gradient), ("qdot0", qdot0), ("M", M)):
                if values is not None or self._reads[name]:
                    self._take_more(name, values)
        except QuestionError as unusable:
            return self._refuse(unusable)
        return self._finish(bits)

    def _take_more(self, name: str, values: ArrayLike | None) -> None:
        """Write an optional argument where the law reads it.

        Raises:
            QuestionError: It is missing, not read, or not usable.
        """
        if not self._reads[name]:
            raise QuestionError(f"{name} is given, and {_READERS[name]} is not chosen")
        if values is None and name == "qdot0":
            values = self.control.nullspace.rates
        if values is None:
            raise QuestionError(f"{name} is needed: {_READERS[name]} reads it")
        place = self._take(name, values)
        with np.errstate(all="ignore"):  # the law reports results that are not finite
            if name == "M":
                if self._unit is None:
                    unit = np.trace(place, axis1=1, axis2=2) / self.n
                    if not (np.isfinite(unit) & (unit > 0.0)).all():
                        raise QuestionError("M is not positive definite, or not finite")
                    self._unit = unit[:, None, None]
                place /= self._unit
            elif not np.isfinite(place).all() or (name == "error" and (place < 0.0).any()):
                raise QuestionError(f"{name} is not finite{', or below 0' if name == 'error' else ''}")
            elif name == "gradient":
                place *= self.control.nullspace.gain * self._worlds["task"]["joint_scale"][:, : self.n] ** 2


def _limits(name: str, given: ArrayLike | None, shape: tuple[int, ...], nothing: Any) -> Array:
    if given is None:
        return np.full(shape, nothing)
    values = as_numbers(name, given).copy()
    if values.shape != shape or np.isnan(values).any():
        raise QuestionError(f"{name} must be {shape} and no NaN, got {shortened(str(values.tolist()))}")
    return values


def _misfits(control: ControlSection, m: int, joints: BareJoints) -> list[tuple[str, str]]:
    """Return the keys that do not fit, and why."""
    problems = list(settings.misfits(control, m, joints))
    needs = "needs the arm's kinematics, which a Jacobian alone does not give; use rmrc.Controller"
    objective, policy = control.nullspace.objective, control.at_singularity
    if objective == "secondary":
        text = f'"secondary" {needs}, or "rates", and give qdot0 with each step'
        problems.append(("control.nullspace.objective", text))
    if objective == "joint_limits" and not np.isfinite(joints.position_limit).all():
        problems.append(("control.nullspace.objective", '"joint_limits" needs position_limit of all joints'))
    if policy in ("stop", "singularity_consistent", "keep_out"):  # replaces other problems of the same key
        problems = [problem for problem in problems if problem[0] != "control.at_singularity"]
        problems.append(("control.at_singularity", f'"{policy}" {needs}'))
    return problems


# One inverse ---------------------------------------------------------------------------------------


def resolve_rates(
    J: ArrayLike,
    twist: ArrayLike,
    method: str = INVERSES.default,
    *,
    schedule: str = SCHEDULES.default,
    error: float = 0.0,
    **parameters: float,
) -> Array:
    """Return the joint rates of one inverse for one twist: the law for a notebook.

    Args:
        J: Jacobian of the task, (m, n), m <= 6.
        twist: Commanded task velocity, (m,).
        method: One of the inverses; `inverse` needs a square J.
        schedule: The damping schedule of `damped`.
        error: Norm of the task error, for the schedule `error`.
        parameters: Parameters by their key below `control.inverse`, with `_` for the dots, as in
            `damping_maximum=0.2`. The others are those of a scenario, with λ_max = 0.1 and ε = 0.3, which fit
            links of a meter.

    Returns:
        Joint rates, (n,).

    Raises:
        ValueError: The law does not know the method, schedule or parameter, or the shapes do not fit.

    >>> resolve_rates(np.diag([1.0, 0.1]), np.array([1.0, 1.0]), schedule="constant").round(3)
    array([0.99, 5.  ])
    >>> resolve_rates(np.diag([1.0, 0.01]), np.array([1.0, 1.0]), "jparse", gamma=0.1).round(3)
    array([1., 1.])
    """
    J, twist = as_numbers("J", J), as_numbers("twist", twist)
    J = J if J.ndim > 1 else J[None]
    if J.ndim != 2 or not 0 < len(J) <= ROWS or not J.shape[1] or twist.shape != J.shape[:1]:
        raise ValueError(f"J must be (m, n) with m <= {ROWS} and twist (m,), got {J.shape}, {twist.shape}")
    if not (np.isfinite(J).all() and np.isfinite(twist).all()):
        raise ValueError("J and twist must be finite")
    for name, value in {"error": error, **parameters}.items():
        if not isinstance(value, Real) or not 0.0 <= value < math.inf:
            raise ValueError(f"{name} must be a finite number >= 0, got {value}")
    (m, n), thread = J.shape, threading.get_ident()  # each thread has its own records
    worlds, resolve = _inverse(thread, m, n, method, schedule, *parameters.items())
    worlds["state"]["J"][0, :m, :n], worlds["scratch"]["twist_cmd"][0, :m] = J, twist
    worlds["scratch"]["error"], worlds["first"]["age"] = error, 0
    resolve(worlds.ctypes.data)
    return np.array(worlds["tick"]["qdot_cmd"][0, :n])


@lru_cache(maxsize=64)
def _inverse(
    _thread: int, m: int, n: int, method: str, schedule: str, *numbers: tuple[str, float]
) -> tuple[NDArray[np.void], Callable[[int], None]]:
    """Return the record of one inverse for Jacobians of one shape, (1,), and a call that resolves it."""
    codes = {"method": _code("method", method, INVERSES)}
    codes["damping_schedule"] = _code("schedule", schedule, SCHEDULES)
    if INVERSES[method].needs_square and m != n:
        raise ValueError(f"method '{method}' needs a square J, got {(m, n)}")
    known = [one.field.removeprefix("inverse_") for one in (*INVERSES.parameters, *SCHEDULES.parameters)]
    for name, _ in numbers:
        if name not in known:
            raise ValueError(f'no inverse has a parameter "{name}"{did_you_mean(name, known)}')
    joints = BareJoints(("",) * n, np.tile([-math.inf, math.inf], (n, 1)), np.full(n, math.inf))
    plain = ControlSection(limits=LimitsSection(on_excess="none"))
    law, worlds = TaskLaw(Task(cast(Any, joints), np.arange(m)), plain, np.zeros(n)), new_worlds(1, n)
    law.write(worlds[0])
    for name, value in (*codes.items(), *numbers):
        worlds["law"][f"inverse_{name}"] = value
    gains, schedules = getattr(inverses, method), getattr(damping, schedule_of(method, schedule))
    methods = law.methods | {"control": resolve_alone, "gains": gains, "damping": schedules}
    link(worlds, methods, late=())
    return worlds, resolve_alone.entry(capacity(n))


def _code(key: str, name: str, choices: Choices[Choice]) -> int:
    if name not in choices.names:
        known, hint = ", ".join(choices.names), other_name(name, choices.names)
        raise ValueError(f'{key} must be one of {known}, got "{name}"{hint}')
    return choices.code(name)
