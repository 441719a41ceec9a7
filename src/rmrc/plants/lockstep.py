"""The compiled tick of all worlds: sense, law, obey. MuJoCo then steps them and updates the kinematics."""

import math
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.law.addresses import fetch
from rmrc.law.jerk import keep_changes
from rmrc.law.jit import Array, Record, apart, compiled, entry, inlined
from rmrc.law.kinematics import (
    chain_jacobian,
    follow_chain,
    follow_second,
    geometric_jacobian,
    second_jacobian,
)
from rmrc.law.law import control, take_error
from rmrc.law.priority import second_error
from rmrc.law.record import Field
from rmrc.plants.around import begin_tick, end_tick
from rmrc.plants.kinds import obey, sense
from rmrc.plants.stages import sensed, sent
from rmrc.scenario.choices import Status

# MuJoCo calls a larger position, velocity or acceleration bad (its mjMAXVAL).
LARGEST = 1e10
# An actuator is at its limit when it gives all of it, up to the rounding of a gear.
AT_LIMIT = 1.0 - 1e-9
TORQUE_LIMITED = int(Status.TORQUE_LIMITED)
BAD_FIRST, BAD_LAST = int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC)


@dataclass(frozen=True)
class Course:
    """The path ahead of a world: it owns the fields of its record that hold how far it goes.

    Attributes:
        reference: Index of its reference in the batch.
        path_ticks: Number of ticks of that reference.
        ticks: Largest number of ticks to run.
    """

    reference: int
    path_ticks: int
    ticks: int

    fields: ClassVar[tuple[Field, ...]] = (
        Field("reference", np.int64), Field("path_ticks", np.int64), Field("ticks", np.int64),
        # the tick at which it diverged or -1, and the joint
        Field("diverged", np.int64), Field("diverged_joint", np.int64),
    )  # fmt: skip

    def write(self, world: np.void) -> None:
        """Write its fields of a world's record."""
        world["reference"], world["path_ticks"], world["ticks"] = self.reference, self.path_ticks, self.ticks
        world["diverged"], world["diverged_joint"] = -1, 0


@entry
def tick(
    worlds: Record,
    ticks: Record,
    reference: Array,
    state: Array,
    warning: NDArray[np.int32],
    site_xpos: Array,
    site_xquat: Array,
    xanchor: Array,
    xaxis: Array,
    force: Array,
    qfrc_gravcomp: Array,
    about: int,
    t: int,
) -> int:
    """Control all worlds for one tick, or one world for a block of ticks; return how many are to be stepped.

    The arguments are few, because each one costs as much per call as a joint costs the law.

    Args:
        worlds: World records, (w,).
        ticks: Tick records, (w, rows): tick t is written to row t modulo rows.
        reference: Pose and twist of each reference at each tick, (r, ticks, 13).
        state: MuJoCo's state rows, (w, nstate); controls and wrenches are written.
        warning: MuJoCo's warning counters, (w, 7, 2).
        site_xpos: This and the next three are the fields of MjData of the same names, up to date, (w, …).
        site_xquat: Orientation of each site.
        xanchor: Joint anchors.
        xaxis: Joint axes.
        force: Forces of the last step.
        qfrc_gravcomp: Gravity compensation of all degrees of freedom, or (w, 0) without any.
        about: Address of the words about a block (`rmrc.plants.around`); 0: MuJoCo steps elsewhere.
        t: Number of the tick, or of the first one.
    """
    running = 0
    for w in range(worlds.shape[0]):
        world, going, t_w = worlds[w], True, t
        while going:
            if about != 0:
                begin_tick(about, t_w)
            out = ticks[w, t_w % ticks.shape[1]]
            going = world.diverged < 0 and t_w < world.ticks
            if going:
                sense(world, out, state[w], force[w])
                read_reference(world, out, reference[world.reference])
                is_misled = read_joints(world, out, ticks, w, t_w, site_xpos[w], site_xquat[w])
                world.diverged_joint = bad_joint(world, warning[w])
                going = world.diverged_joint < -1
                if going:
                    if not is_misled:
                        geometric_jacobian(world, xanchor[w], xaxis[w])
                    if world.m_2 > 0:
                        measure_second(world, is_misled, site_xpos[w], site_xquat[w])
                    out.time = t_w * world.period
                    control(world, out)
                    out.status |= read_loads(world, out, qfrc_gravcomp[w])
                    world.diverged_joint = bad_command(world, out)
                    going = world.diverged_joint < 0
                if going:
                    going = act(world, out, ticks, w, t_w, state[w])
                else:
                    world.diverged = t_w
            running += going
            going = about != 0 and end_tick(about, t_w, going)
            t_w += 1
    return running


@inlined
def act(world: Record, out: Record, ticks: Record, w: int, t: int, state: Array) -> bool:
    """Send the command, record the true errors, advance along the path; return whether a tick follows."""
    if world.is_sensed:  # the law took the arm to be elsewhere
        for i in range(6):
            out.pose_error[i] = world.true_error[i]
        out.secondary_error = world.true_error_2
    send(world, out, ticks, w, t)
    obey(world, out, state)
    proceed(world, t)
    follows = t + 1 < world.ticks
    if follows:
        fetch(ticks[w, (t + 1) % ticks.shape[1]])  # it arrives during the step of MuJoCo
    return bool(follows)


@compiled
def read_joints(world: Record, out: Record, ticks: Record, w: int, t: int, xpos: Array, xquat: Array) -> bool:
    """Sense joints and site; return whether a stage has the law take the arm to be elsewhere."""
    for j in range(world.n):
        world.q[j] = out.q_believed[j] = out.q[j]
        world.qdot[j] = out.qdot[j]
    for i in range(3):
        out.pose[i] = xpos[world.site, i]
    for i in range(4):
        out.pose[3 + i] = xquat[world.site, i]
    for i in range(7):
        world.pose[i] = out.pose[i]
    if not world.is_sensed:
        return False
    sense_by_stages(world, out, ticks, w, t)
    return True


@apart("call_sensed", is_sensed=())
def sense_by_stages(world: Record, out: Record, ticks: Record, w: int, t: int) -> None:
    """Apply the stages before the law to the sensed state, and compute the kinematics from it.

    The true error comes from other numbers, so that the processor computes it at the same time.
    """
    sensed(world, out, ticks, w, t)
    for j in range(world.n):
        out.q_believed[j] = world.q[j]
    take_error(world, out.pose_ref, out.pose, world.true_error)
    follow_chain(world, world.q)
    chain_jacobian(world)


@compiled
def read_loads(world: Record, out: Record, gravcomp: Array) -> int:
    """Read gravity compensation; return TORQUE_LIMITED if an actuator is at its limit."""
    status, compensated = 0, gravcomp.shape[0] > 0
    for j in range(world.n):
        out.tau_gravity[j] = world.gravity_apart[j] * gravcomp[world.dof[j]] if compensated else 0.0
        if abs(out.tau[j]) >= AT_LIMIT * world.torque_limit[j] > 0.0:
            status = TORQUE_LIMITED
    for f in range(world.followers if compensated else 0):
        load = world.follower_ratio[f] * gravcomp[world.follower_dof[f]]
        out.tau_gravity[world.follows[f]] += world.gravity_apart[world.follows[f]] * load
    return status


@apart("call_second", m_2=())
def measure_second(world: Record, is_misled: bool, site_xpos: Array, site_xquat: Array) -> None:
    """Write pose and Jacobian of the second task's site, from the state that the law uses."""
    for i in range(3):
        world.pose_2[i] = site_xpos[world.site_2, i]
    for i in range(4):
        world.pose_2[3 + i] = site_xquat[world.site_2, i]
    if is_misled:
        world.true_error_2 = second_error(world)
        follow_second(world, world.q)
    else:
        second_jacobian(world)


@compiled
def read_reference(world: Record, out: Record, reference: Array) -> None:
    """Read target pose and twist at the path tick; interpolate them between two ticks of a slowed world.

    Quaternions are interpolated linearly and normalized: neighbors differ by a fraction of a degree, for
    which that equals the arc.
    """
    before = int(world.path_tick)
    part = world.path_tick - before
    out.path_time = world.path_tick * world.period
    if part == 0.0:
        for i in range(7):
            out.pose_ref[i] = reference[before, i]
        for i in range(6):
            out.twist_ref[i] = reference[before, 7 + i]
        return
    first, second = reference[before], reference[before + 1]
    same = first[3] * second[3] + first[4] * second[4] + first[5] * second[5] + first[6] * second[6] >= 0.0
    norm = 0.0
    for i in range(7):
        end = second[i] if same or i < 3 else -second[i]
        out.pose_ref[i] = first[i] + part * (end - first[i])
        if i > 2:
            norm += out.pose_ref[i] * out.pose_ref[i]
    for i in range(3, 7):
        out.pose_ref[i] /= math.sqrt(norm)
    for i in range(6):
        out.twist_ref[i] = first[7 + i] + part * (second[7 + i] - first[7 + i])


@compiled
def send(world: Record, out: Record, ticks: Record, w: int, t: int) -> None:
    """Send the command through the stages after the law, and record what arrives."""
    if world.is_eased:
        keep_course(world, out)
    for j in range(world.n):
        world.qdot_cmd_last[j] = world.qdot_sent[j] = out.qdot_cmd[j]
    if world.is_sent:
        send_by_stages(world, out, ticks, w, t)
    for j in range(world.n):
        out.qdot_arrived[j] = world.qdot_sent[j]


@apart("call_course", is_eased=())
def keep_course(world: Record, out: Record) -> None:
    """Remember the changes of the rates, where jerk is limited."""
    keep_changes(world, out.qdot_cmd)


@apart("call_sent", is_sent=())
def send_by_stages(world: Record, out: Record, ticks: Record, w: int, t: int) -> None:
    """Apply the stages after the law to the command."""
    sent(world, out, ticks, w, t)


@compiled
def proceed(world: Record, t: int) -> None:
    """Advance along the path; the world ends with the tick at the end of its path."""
    end = world.path_ticks - 1.0
    if world.path_tick >= end:
        world.ticks = t + 1
    world.path_tick = min(world.path_tick + world.pace, end)


@compiled
def bad_joint(world: Record, warning: NDArray[np.int32]) -> int:
    """Return the joint whose state is not finite, -1 if it is of another joint, -2 if all are finite."""
    for j in range(world.n):
        if not (abs(world.q[j]) <= LARGEST and abs(world.qdot[j]) <= LARGEST):
            return j
    for kind in range(BAD_FIRST, BAD_LAST + 1):
        if warning[kind, 1] > 0:
            for j in range(world.n):
                if world.dof[j] == warning[kind, 0]:
                    return j
            for f in range(world.followers):
                if world.follower_dof[f] == warning[kind, 0]:
                    return int(world.follows[f])
            return -1
    return -2


@compiled
def bad_command(world: Record, out: Record) -> int:
    """Return the joint whose command is not finite, or -2; MuJoCo would take it for 0 and continue."""
    for j in range(world.n):
        if not abs(out.qdot_cmd[j]) <= LARGEST:
            return j
    return -2
