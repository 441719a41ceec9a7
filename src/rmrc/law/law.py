"""Resolved motion rate control, one tick of one world.

    twist_cmd = Rᵀ twist_ref + K · pose_error
    A         = S_x Rᵀ J S_q = Σ σ_i u_i v_iᵀ       (task rows only; S_x = W_x^½ / L, S_q = W_q^-½ · L)
    qdot_cmd  = S_q Σ g(σ_i) v_i (u_iᵀ S_x twist_cmd)  +  N qdot0

The columns of R are the axes of the task's frame: the world, the base or the site. The error and J in the
record are along them. The characteristic length L divides linear rows and multiplies sliding joints, so that
σ of any arm is a number without unit and does not change when the model is drawn in millimeters.
"""

import math
from typing import ClassVar

import numpy as np

from rmrc.law.inertia import Inertia, find_metric
from rmrc.law.inverses import damping, gains, invert_above, push_fading
from rmrc.law.jit import Array, Record, apart, compiled, entry, inlined
from rmrc.law.kinematics import (
    BASE,
    SITE,
    WORLD,
    frame_error,
    frame_turn,
    pose_error,
    turn_columns,
    turn_twist,
)
from rmrc.law.limits import limit
from rmrc.law.metric import INERTIA, backward, scale_joints, weigh_columns
from rmrc.law.nullspace import NONE, move_in_null_space
from rmrc.law.policies import KEEP_OUT, hold_off, near_singularity
from rmrc.law.record import JOINTS, LAST, Field
from rmrc.law.registers import FEWEST, sharpen
from rmrc.law.standstill import stuck
from rmrc.law.svd import (
    RANK_FLOOR,
    combine,
    continue_row,
    dot,
    orthonormalize,
    product,
    project,
    set_identity,
    svd,
)
from rmrc.law.task import BareTask, Joints, SecondTask, Task
from rmrc.scenario import ControlSection, LimitsSection
from rmrc.scenario.choices import Status, record_fields, write_choices
from rmrc.scenario.profile import load_profile

# Flags become plain integers in compiled code.
DAMPED, SINGULAR = int(Status.DAMPED), int(Status.SINGULAR)

# κ ≥ 100 is called SINGULAR: the worst direction needs a hundred times the joint rates of the best one.
SINGULAR_BELOW = 0.01

# A direction counts as damped when it gets less than its demand by more than rounding explains.
GETS_ALL = 1.0 - 1e-9

# Rotations accumulate rounding in the warm start; after this many ticks it is made orthonormal again. In 64
# ticks of some 30 rotations it loses at most 1e-13.
REFRESH = 64

# Between these, quotients and cubes of rates over steps of jerk are finite. Beyond them, a joint may not
# change its rate at all, or may change it without limit [rad/s or m/s].
JERK_STEPS = 1e-30, 1e30


class TaskLaw:
    """The law of a scenario for the joints of a task: it owns the law's parameters in a world's record.

    Attributes:
        task: The task of the site.
        second: The second task, if any.
        rate_limit: Largest rates, from the model where the scenario has none, (n,); infinite for none.
        acceleration_limit: Largest accelerations, (n,); infinite for none.
        jerk_limit: Largest jerks, (n,); infinite for none.
        braking: Decelerations before position limits, (n,).
        position_limit: Lower and upper, (2, n); infinite where they are not enforced.
        posture: Posture of the objective with this name, (n,).
    """

    fields: ClassVar[tuple[Field, ...]] = (
        *(
            Field(name, np.int64 if kind is int else np.float64, (JOINTS,) if is_each else ())
            for name, kind, is_each in record_fields()
        ),
        Field("rank", np.int64), Field("feedback"), Field("feedforward"),
        Field("position_range", size=(2, JOINTS)), *SecondTask.fields,
        Field("rate_limit", size=(JOINTS,)), Field("acceleration_limit", size=(JOINTS,)),
        Field("change_limit", size=(JOINTS,), start=math.inf),
        Field("jerk_step", size=(JOINTS,), start=math.inf), Field("is_eased", np.int64),
        Field("braking", size=(JOINTS,)), Field("position_limit", size=(2, JOINTS)),
        Field("keep_direction", np.int64), Field("feedback_2"), *Inertia.fields, Field(LAST),
    )  # fmt: skip

    def __init__(self, task: Task | BareTask, control: ControlSection, start: Array) -> None:
        """Bind parameters to joints.

        Args:
            task: The task of the site.
            control: The control section; its lists over joints fit the arm.
            start: Start configuration, (n,).
        """
        arm, limits, nullspace = task.arm, control.limits, control.nullspace
        self.task, self._control = task, control
        self.rate_limit = rate_limit(arm, limits)
        self.acceleration_limit = np.full(
            arm.n, math.inf if limits.acceleration is None else limits.acceleration
        )
        self.jerk_limit = np.full(arm.n, math.inf if limits.jerk is None else limits.jerk)
        self.braking = np.minimum(limits.braking, self.acceleration_limit)
        nowhere = np.array([arm.n * [-math.inf], arm.n * [math.inf]])
        self.position_limit = arm.position_limit.T if limits.position else nowhere
        if limits.profile and limits.position:
            lower, upper = load_profile(limits.profile).stops
            own = self.position_limit
            self.position_limit = np.array([np.maximum(own[0], lower), np.minimum(own[1], upper)])
        self.posture = start if nullspace.posture is None else np.array(nullspace.posture)
        is_second = nullspace.objective == "secondary"
        self.second: SecondTask | None = None
        if is_second and isinstance(task, Task):
            self.second = SecondTask(task, nullspace.secondary, start)
        self._inertia: Inertia | None = None
        if control.inverse.metric == "inertia" and isinstance(task, Task):
            self._inertia = Inertia(task.arm, task.length)

    def write(self, world: np.void) -> None:
        """Write its fields of a world's record."""
        control, n = self._control, self.task.arm.n
        world["rank"], world["period"] = self.task.rank, control.period
        world["feedback"], world["feedforward"] = control.feedback, control.feedforward
        world["position_range"][:, :n] = self.task.arm.position_limit.T
        is_eased = bool(np.isfinite(self.jerk_limit).any())
        world["rate_limit"][:n], world["is_eased"] = self.rate_limit, is_eased
        # The limits on changes also keep them within the acceleration limit.
        world["acceleration_limit"][:n] = math.inf if is_eased else self.acceleration_limit
        world["change_limit"][:n] = self.acceleration_limit * control.period
        if is_eased:
            world["jerk_step"][:n] = np.clip(self.jerk_limit * control.period**2, *JERK_STEPS)
        world["braking"][:n], world["position_limit"][:, :n] = self.braking, self.position_limit
        world["keep_direction"] = control.limits.keep_direction
        if self.second is not None:
            self.second.write(world)
        world["feedback_2"] = control.nullspace.secondary.feedback
        if self._inertia is not None:
            self._inertia.write(world)
        write_choices(world, control)
        world["nullspace_posture"][:n] = self.posture


def rate_limit(arm: Joints, limits: LimitsSection) -> Array:
    """Return the largest rates of an arm's joints, (n,), from the model where the limits give none."""
    return arm.rate_limit if limits.rate is None else np.full(arm.n, limits.rate)


@inlined
def control(world: Record, tick: Record) -> None:
    """Turn the measured state and the reference of one tick into `tick.qdot_cmd`.

    Args:
        world: Parameters, measurement (q, pose, J) and memory; scratch is overwritten, and J is turned into
            the frame of the task.
        tick: Read: pose_ref and twist_ref at full pace. Written: every column from pose_error to status
            except tau.
    """
    aim(world, tick)
    resolve_twist(world, tick)


@inlined
def aim(world: Record, tick: Record) -> None:
    """Write the commanded twist along the axes of the task's frame; turn J into that frame."""
    take_error(world, tick.pose_ref, world.pose, tick.pose_error)
    for i in range(6):
        world.twist_task[i] = tick.twist_ref[i]
    if world.frame != WORLD:
        turn_task(world)
    feedforward = world.feedforward * world.pace
    for i in range(6):
        world.twist_cmd[i] = feedforward * world.twist_task[i] + world.feedback * tick.pose_error[i]
    world.error = scaled_error(world, tick.pose_error)
    if world.inverse_metric == INERTIA:
        find_metric(world)


@inlined
def take_error(world: Record, pose_ref: Array, pose: Array, error: Array) -> None:
    """Write the error to a pose of the site, (6,) [m, rad], along the axes of the task's frame."""
    pose_error(pose, pose_ref, error)
    if world.frame != WORLD:
        turn_error(world, pose, pose_ref, error)


@apart("call_frame_error", frame=(BASE, SITE))
def turn_error(world: Record, pose: Array, pose_ref: Array, pose_error: Array) -> None:
    """Turn an error, (6,), from world axes into the frame of the task."""
    frame_error(world.frame, world.frame_quat, world.free, pose, pose_ref, pose_error)


@apart("call_frame", frame=(BASE, SITE))
def turn_task(world: Record) -> None:
    """Turn the wanted twist and J from world axes into the frame of the task."""
    turn = frame_turn(world.frame, world.frame_quat, world.pose)
    turn_twist(turn, world.twist_task)
    turn_columns(turn, world.J, world.n)
    if world.axes > world.n:  # the slopes are those of its axes
        turn_columns(turn, world.columns, world.axes)


@entry
def resolve(worlds: Record, ticks: Record) -> None:
    """Resolve one `twist_cmd`: the law without its reference, for Python.

    Python takes ten times as long to pass a single record as an array of one.
    """
    resolve_twist(worlds[0], ticks[0])


@inlined
def resolve_twist(world: Record, tick: Record) -> None:
    """Resolve `world.twist_cmd`: decompose, filter, project, slow or stop, limit, judge, and record."""
    scale_task(world)
    decompose(world, tick.sigma)
    project(world.u, world.task, world.k, world.m, world.asked)
    ask_plainly(world, tick)
    push_fading(world, world.u, world.task, tick.sigma, world.asked)
    tick.damping = damping(world, world.asked, tick.sigma)
    gains(world, world.asked, tick.sigma, world.v, tick.damping, tick.gain)
    combine(tick.gain, world.asked, world.v, world.k, world.n, tick.qdot_cmd)
    scale_joints(world, tick.qdot_cmd)
    tick.secondary_error = tick.secondary_sigma = math.nan
    for j in range(world.n):
        world.qdot0[j] = 0.0
    if world.nullspace_objective != NONE:
        move_in_null_space(world, tick)
    tick.path_rate = 1.0
    status = singular_status(world, tick) | near_singularity(world, tick)
    status |= limit(world, tick)
    if world.at_singularity == KEEP_OUT:
        status |= hold_off(world, tick)
    tick.status = status | stuck(world, tick, status)
    record_measures(world, tick)


@compiled
def scaled_error(world: Record, error: Array) -> float:
    """Return ‖S_x pose_error‖ over the rows that count."""
    total = 0.0
    for i in range(world.m):
        scaled = world.row_scale[i] * error[world.row[i]]
        total += scaled * scaled
    return math.sqrt(total)


@compiled
def scale_task(world: Record) -> None:
    """Write A = S_x J S_q and S_x twist_cmd over the rows that count."""
    for i in range(world.m):
        row, scale = world.row[i], world.row_scale[i]
        world.task[i] = scale * world.twist_cmd[row]
        for j in range(world.n):
            world.A[i, j] = scale * world.J[row, j] * world.joint_scale[j]


@inlined
def decompose(world: Record, sigma: Array) -> None:
    """A = Σ σ_i u_i v_iᵀ, warm-started from the vectors of the last tick.

    Exactly at a singularity v_k is rounding. The v_k of the last tick replaces it, as it would hold slightly
    away from the singularity.
    """
    basis = world.u if world.m <= world.n else world.v
    if world.age == 0:
        set_identity(basis, world.k)
    elif world.age % REFRESH == 0:
        orthonormalize(basis, world.k)
    world.age += 1
    matrix = world.A
    if world.inverse_metric == INERTIA:
        matrix = world.B
        weigh_columns(world.root, world.A, world.m, world.n, matrix)
    if world.k < FEWEST or not sharpen(world, matrix, sigma):
        svd(matrix, world.m, world.n, world.u, sigma, world.v)
    last = world.k - 1
    if sigma[last] <= RANK_FLOOR * sigma[0] and world.m <= world.n and world.age > 1:
        continue_row(world.v, last, world.v_last, world.n)
    for j in range(world.n):
        world.v_last[j] = world.v[last, j]


@compiled
def ask_plainly(world: Record, tick: Record) -> None:
    """Write the command of the plain inverse or pseudoinverse: 1/σ of every σ above rounding.

    Nothing is damped, weighted, limited or added. The gains are overwritten.
    """
    invert_above(world, tick.sigma, RANK_FLOOR * tick.sigma[0], tick.gain)
    combine(tick.gain, world.asked, world.v, world.k, world.n, tick.qdot_plain)
    scale_joints(world, tick.qdot_plain)


@compiled
def singular_status(world: Record, tick: Record) -> int:
    """Return DAMPED if any direction gets less than its demand, and SINGULAR if one is nearly lost."""
    status, floor = DAMPED if tick.damping > 0.0 else 0, RANK_FLOOR * tick.sigma[0]
    for i in range(world.k):
        if tick.sigma[i] > floor and tick.sigma[i] * tick.gain[i] < GETS_ALL:
            status |= DAMPED
    if tick.sigma[world.k - 1] <= SINGULAR_BELOW * tick.sigma[0]:
        status |= SINGULAR
    return status


@compiled
def record_measures(world: Record, tick: Record) -> None:
    """Record w = ∏σ, κ = σ_1/σ_k, the lost task direction u_min and its joint motion v_min."""
    last = world.k - 1
    tick.manipulability = product(tick.sigma, world.k)
    tick.condition = tick.sigma[0] / tick.sigma[last] if tick.sigma[last] > 0.0 else math.inf
    for i in range(6):
        tick.u_min[i] = 0.0
    for i in range(world.m):
        tick.u_min[world.row[i]] = world.u[last, i]
    for j in range(world.n):
        tick.v_min[j] = world.v[last, j]
    if world.inverse_metric == INERTIA:  # in coordinates of the joints, with length 1
        backward(world.root, tick.v_min, world.n)
        size = math.sqrt(dot(tick.v_min, tick.v_min, world.n))
        for j in range(world.n):
            tick.v_min[j] /= size
