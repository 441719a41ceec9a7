"""The law without a scenario: in a loop of one's own, or one inverse and one twist.

    controller = Controller(Law(task, ControlSection(), start), data)
    while True:
        rates = controller.step(data.qpos[...], data.qvel[...], pose, twist).qdot
        ...

A controller has the record, the Writers and the law of a run, and gives the same rates to the bit where it
sees the same. `resolve` is compiled beside `step`, as it takes a third less time alone; both have records of
one type, so that who needs both compiles most of it once.
"""

import math
from collections.abc import Mapping
from functools import partial
from typing import Any, ClassVar

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from rmrc.law.jerk import come_to_rest, remember
from rmrc.law.jit import Array, Record, compiled, entry, machine_code
from rmrc.law.kinematics import (
    chain_jacobian,
    follow_chain,
    geometric_jacobian,
    quat_product,
    second_jacobian,
)
from rmrc.law.law import Law, control, resolve
from rmrc.law.record import CHAIN, MEMORY, ROWS, Field, records, tick_type
from rmrc.law.task import Task
from rmrc.scenario.choices import INVERSES, LIMITS, OBJECTIVES, POLICIES, SCHEDULES, Choice, Choices, Status
from rmrc.support.errors import ModelError, did_you_mean

STOPPED = int(Status.STOPPED)

# A larger position, velocity or command is none: MuJoCo calls it bad (its mjMAXVAL).
LARGEST = 1e10


class Command:
    """What the law commands: views that the next step writes over.

    Attributes:
        qdot: Joint rates, (n,) [rad/s or m/s].
        sigma: Singular values of A, falling, (k,); NaN where what was measured or wanted is not finite.
        gain: What stands for 1/σ, (k,).
        pose_error: From the site to where it is wanted, [Δp; rotation vector], (6,) [m, rad].
    """

    __slots__ = ("_tick", "gain", "pose_error", "qdot", "sigma")

    def __init__(self, tick: np.void, n: int, k: int) -> None:
        """Look into the record of a tick."""
        self._tick = tick
        self.qdot: Array = tick["qdot_cmd"][:n]
        self.sigma: Array = tick["sigma"][:k]
        self.gain: Array = tick["gain"][:k]
        self.pose_error: Array = tick["pose_error"]

    @property
    def damping(self) -> float:
        """Damping λ, in the units of σ."""
        return float(self._tick["damping"])

    @property
    def path_rate(self) -> float:
        """By how many periods the reference shall advance: 1, or less where the law slows it down."""
        return float(self._tick["path_rate"])

    @property
    def status(self) -> Status:
        """What happened."""
        return Status(int(self._tick["status"]))


class Controller:
    """One arm under the law, to be called once a control period.

    Attributes:
        law: What it does.
        command: What it did last.
    """

    def __init__(self, law: Law, data: mujoco.MjData | None = None) -> None:
        """Bind the law to what it is to see.

        Args:
            law: The law of a task.
            data: Fresh kinematics at each step, of any model that has the arm: after `mj_step`,
                `mj_fwdPosition`. None: those of the arm's own chain at the joint positions given.

        Raises:
            ModelError: The chain alone does not say where the sites are, or the model lacks the arm.
        """
        task, n = law.task, law.task.arm.n
        self.law = law
        self._world = records(n, [task, law, Sight(law, data)], axes=n + len(task.arm.followers))
        ticks = np.zeros(1, tick_type(n))
        (world,), (tick,) = self._world, ticks
        self.command = Command(tick, n, min(len(task.rows), n))
        self._q, self._qdot = world["q"][:n], world["qdot"][:n]
        self._pose, self._twist = tick["pose_ref"], tick["twist_ref"]
        nothing = np.zeros((1, 3)), np.zeros((1, 4)), np.zeros((1, 3)), np.zeros((1, 3))
        seen = nothing if data is None else (data.site_xpos, data.xquat, data.xanchor, data.xaxis)
        arrays = self._world, ticks, *seen
        self._step = partial(machine_code(step, *arrays), *arrays)

    def step(self, q: ArrayLike, qdot: ArrayLike, pose: ArrayLike, twist: ArrayLike) -> Command:
        """Return what to command for the next period; nothing is raised, and nothing kept.

        What is not finite, or beyond 1e10, brakes the joints from the last command; then the status is
        STOPPED and the path rate 0. Near a singularity the status says so.

        Args:
            q: Joint positions, as measured, (n,) [rad or m].
            qdot: Joint rates, as measured, (n,) [rad/s or m/s]; they are checked, and no term of the law
                needs them.
            pose: Where the site is wanted, [p, quat w x y z], (7,) [m, 1].
            twist: At which velocity [v; ω], along world axes, that of full pace, (6,) [m/s, rad/s].
        """
        self._q[:], self._qdot[:], self._pose[:], self._twist[:] = q, qdot, pose, twist
        self._step()
        return self.command

    def reset(self) -> None:
        """Forget all steps: the next one is the first, from rest."""
        for field in MEMORY:
            self._world[field.name] = field.start


class Sight:
    """Where kinematics are read: it owns the numbers of joints and sites in MuJoCo's arrays, if any."""

    fields: ClassVar[tuple[Field, ...]] = (
        Field("sites", np.int64), Field("joint", np.int64, (CHAIN,)),
        Field("site", np.int64, (2,)), Field("body", np.int64, (2,)), Field("site_quat", size=(2, 4)),
    )  # fmt: skip

    def __init__(self, law: Law, data: mujoco.MjData | None) -> None:
        """Find the arm: see `Controller`."""
        arm, second = law.task.arm, law.second
        self._sites, self._joint = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self._model = None if data is None else data.model
        if self._model is not None:
            try:
                self._joint = arm.wire(self._model).axis
                names = [arm.site, second.site] if second else [arm.site]
                self._sites = np.array([self._model.site(name).id for name in names])
            except KeyError as error:
                raise ModelError(f"the model of the data lacks a part of {arm.path}: {error}") from None
        elif arm.idle or second:
            what = f'site "{second.site}"' if second else f'joint "{arm.idle[0]}", which is not driven,'
            raise ModelError(
                f"{arm.path}: positions of the driven joints do not say where {what} is; give MuJoCo's data"
            )

    def write(self, world: np.void) -> None:
        """Write its fields of a world's record."""
        count = len(self._sites)
        world["sites"], world["joint"][: len(self._joint)] = count, self._joint
        if self._model is not None:
            world["site"][:count], world["body"][:count] = self._sites, self._model.site_bodyid[self._sites]
            world["site_quat"][:count] = self._model.site_quat[self._sites]


def resolve_rates(
    J: Array,
    twist: Array,
    method: str = "damped",
    *,
    schedule: str = "constant",
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
    """Return the joint rates that one inverse answers to one twist: the law for a notebook.

    Args:
        J: Jacobian of the task, (m, n), m <= 6.
        twist: Commanded task velocity, (m,).
        method: One of the inverses; `inverse` needs a square J.
        schedule: How the damping of `damped` is chosen.
        damping_maximum: λ_max, in the units of σ.
        damping_below: ε, where `smallest_singular_value` and the method `filtered` start to damp.
        manipulability_below: w₀, where `manipulability` starts to damp.
        error_gain: λ of the schedule `error` for an error of 1.
        error: Norm of the task error, for that schedule.
        tolerance: `pseudoinverse` drops σ_i <= tolerance · σ_1.
        cutoff: `truncated` drops σ_i <= cutoff.
        gamma: γ; `jparse` lets directions fade with σ_i < γ σ_1.
        rate_bound: Largest joint rate of `selectively_damped`, largest norm of the schedule `rate_bound`.
        others: Parameters without a name here, by their key below `control.inverse`, with `_` for the dots.

    Returns:
        Joint rates, (n,).

    Raises:
        ValueError: A shape or a name that the law does not have.

    >>> resolve_rates(np.diag([1.0, 0.1]), np.array([1.0, 1.0]), damping_maximum=0.1).round(3)
    array([0.99, 5.  ])
    >>> resolve_rates(np.diag([1.0, 0.01]), np.array([1.0, 1.0]), "jparse", gamma=0.1).round(3)
    array([1., 1.])
    """
    J, twist = np.atleast_2d(np.asarray(J, np.float64)), np.asarray(twist, np.float64)
    m, n = J.shape
    if m > 6 or twist.shape != (m,):
        raise ValueError(f"J must be (m, n) with m <= 6 and twist (m,), got {J.shape}, {twist.shape}")
    code = _code("method", method, INVERSES)
    if INVERSES[method].needs_square and m != n:
        raise ValueError(f"method '{method}' needs a square J, got {J.shape}")
    if not (np.isfinite(J).all() and np.isfinite(twist).all()):
        raise ValueError("J and twist must be finite")
    given = {
        "damping_maximum": damping_maximum, "damping_below": damping_below,
        "damping_manipulability_below": manipulability_below, "damping_error_gain": error_gain,
        "tolerance": tolerance, "cutoff": cutoff, "gamma": gamma, "rate_bound": rate_bound, **others,
    }  # fmt: skip
    known = {one.field.removeprefix("inverse_"): one for one in (*INVERSES.parameters, *SCHEDULES.parameters)}
    for name in given:
        if name not in known:
            raise ValueError(f'no inverse has a parameter "{name}"{did_you_mean(name, known)}')
    defaults = {name: one.null if one.default is None else one.default for name, one in known.items()}
    chosen = {one.field: (defaults | given)[name] for name, one in known.items()}
    chosen |= {INVERSES.field: code, SCHEDULES.field: _code("schedule", schedule, SCHEDULES)}
    (world,), (tick,) = records(n, [_Bare(m, n, chosen)]), np.zeros(1, tick_type(n))
    world["J"][:m, :n], world["twist_cmd"][:m], world["error"] = J, twist, error
    machine_code(resolve, world, tick)(world, tick)
    return np.array(tick["qdot_cmd"][:n])


class _Bare:
    """A task without an arm, and a law that inverts it and does nothing else."""

    fields: ClassVar[tuple[Field, ...]] = (*Task.fields, *Law.fields, *Sight.fields)

    def __init__(self, m: int, n: int, chosen: Mapping[str, Any]) -> None:
        self._m, self._n, self._chosen = m, n, chosen

    def write(self, world: np.void) -> None:
        m, n = self._m, self._n
        world["n"], world["m"], world["k"], world["rank"] = n, m, min(m, n), min(m, n)
        world["row"], world["row_scale"], world["joint_scale"] = np.arange(ROWS), 1.0, 1.0
        for choices, nothing in ((OBJECTIVES, "none"), (LIMITS, "none"), (POLICIES, "damp")):
            world[choices.field] = choices.code(nothing)
        for field, value in self._chosen.items():
            world[field] = value


def _code(key: str, name: str, choices: Choices[Choice]) -> int:
    if name not in choices.names:
        known, hint = ", ".join(choices.names), did_you_mean(name, choices.names)
        raise ValueError(f'{key} must be one of {known}, got "{name}"{hint}')
    return choices.code(name)


@entry
def step(
    worlds: Record, ticks: Record, site_xpos: Array, xquat: Array, xanchor: Array, xaxis: Array
) -> None:  # fmt: skip
    """Turn q, and the pose and twist that are wanted, into `qdot_cmd`.

    A record alone would take Python ten times as long to hand over as an array of one.

    Args:
        worlds: The record of a world, (1,).
        ticks: That of its tick, (1,).
        site_xpos: And the other fields of MjData of the same names: fresh, read where the world has sites.
        xquat: Orientation of each body.
        xanchor: Joint anchors.
        xaxis: Joint axes.
    """
    world, tick = worlds[0], ticks[0]
    if world.sites == 0:
        follow_chain(world, world.q)
        chain_jacobian(world, world.J)
    else:
        see(world, 0, site_xpos, xquat, world.pose)
        geometric_jacobian(world, site_xpos[world.site[0]], xanchor, xaxis, world.J)
    if world.sites == 2:
        see(world, 1, site_xpos, xquat, world.pose_2)
        second_jacobian(world, site_xpos[world.site[1]], xanchor, xaxis)
    is_known = are_bounded(world, tick)
    if is_known:
        control(world, tick)
    if not (is_known and is_bounded(tick.qdot_cmd, world.n)):
        brake(world, tick)
    remember(world, tick.qdot_cmd)
    world.path_tick += tick.path_rate


@compiled
def see(world: Record, i: int, site_xpos: Array, xquat: Array, pose: Array) -> None:
    """Write the pose of a site, its orientation that of its body times its own, to the bit as in a run."""
    for c in range(3):
        pose[c] = site_xpos[world.site[i], c]
    body, own = xquat[world.body[i]], world.site_quat[i]
    pose[3], pose[4], pose[5], pose[6] = quat_product(
        (body[0], body[1], body[2], body[3]), (own[0], own[1], own[2], own[3])
    )


@compiled
def are_bounded(world: Record, tick: Record) -> bool:
    """Say whether all that is measured and wanted is finite, and no larger than anything can be."""
    bounded = is_bounded(world.q, world.n) and is_bounded(world.qdot, world.n) and is_bounded(world.pose, 7)
    for i in range(6):
        bounded = bounded and is_bounded(world.J[i], world.n)
    return bounded and is_bounded(tick.pose_ref, 7) and is_bounded(tick.twist_ref, 6)


@compiled
def is_bounded(values: Array, count: int) -> bool:
    """Say whether the first values are finite and no larger than anything can be."""
    bounded = True
    for i in range(count):
        bounded = bounded and abs(values[i]) <= LARGEST
    return bounded


@compiled
def brake(world: Record, tick: Record) -> None:
    """Bring each joint nearer to rest from the last command, and say that nothing else is known."""
    if world.is_eased:
        come_to_rest(world, tick.qdot_cmd)
    for j in range(0 if world.is_eased else world.n):
        last = world.qdot_cmd_last[j]
        tick.qdot_cmd[j] = math.copysign(max(0.0, abs(last) - world.braking[j] * world.period), last)
    for i in range(world.k):
        tick.sigma[i] = tick.gain[i] = math.nan
    for i in range(6):
        tick.pose_error[i] = math.nan
    tick.damping, tick.path_rate, tick.status = math.nan, 0.0, STOPPED
    world.age = 0  # no decomposition starts from what this one left
