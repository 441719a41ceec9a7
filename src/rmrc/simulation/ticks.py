"""The ticks of a world in one compiled loop: sense, law, obey, step. No Python, no clock, no files."""

import math

import numpy as np

from rmrc.law.compiling import Method, Record, at, call, carray, compiled, pointer
from rmrc.law.kinematics import follow_chain, follow_second, framed_error, geometric_jacobian
from rmrc.law.measurement import (
    TORQUE_LIMITED,
    is_at_torque_limit,
    look,
    read_at_joints,
    read_forces,
    read_joints,
)
from rmrc.law.nullspace import second_error
from rmrc.law.svd import copy, dot
from rmrc.plants.engine import BAD_FIRST, BAD_LAST, qpos_of
from rmrc.scenario.choices import Status
from rmrc.simulation.reference import POSE, TWIST

# MuJoCo calls a larger position, velocity or acceleration bad (its mjMAXVAL).
LARGEST = 1e10
SLIPPED = int(Status.SLIPPED)
# A follower that is further from its equality [rad or m] moves a tip at a meter from it by a millimeter.
# Stiff equalities give way by less than a twentieth of it, even under the weight of links of grams.
MOST_SLIP = 1e-3
# Results of a check of finite numbers.
ALL_FINE, OTHER_JOINT = -2, -1


@Method
def ticks(model: int, data: int, number: int, world: Record) -> None:  # noqa: ARG001 - of MuJoCo's guard
    """Do the ticks of a piece, from `engine.next` to `engine.last`, or until the world ends.

    After an error of the engine, `engine.next` is the tick whose step failed, plus 1.
    """
    engine = world.engine
    while engine.next < engine.last and engine.diverged < 0:
        call(engine.begin, engine.model, engine.data)
        if not do_tick(world):
            return
        engine.next += 1
        if engine.next < engine.ticks and engine.substeps > 0:
            call(engine.advance, engine.model, engine.data)
            for _ in range(1, engine.substeps):
                call(engine.step, engine.model, engine.data)


@compiled
def do_tick(world: Record) -> bool:
    """Control the arm for one tick; return False where its state or its command is not finite."""
    engine, tick, methods = world.engine, world.tick, world.methods
    follow_path(world)
    sense(world)
    if methods.believe != 0:
        call(methods.believe, world)
    engine.diverged_joint = bad_state(world)
    if engine.diverged_joint == ALL_FINE:
        tick.time = engine.next * world.period
        call(methods.control, world)
        if methods.move_joints != 0:
            call(methods.move_joints, world)
        engine.diverged_joint = bad_command(world)
    if engine.diverged_joint != ALL_FINE:
        engine.diverged = engine.next
        return False
    read_loads(world)
    if engine.watch != 0:
        call(engine.watch, engine.next)
    send(world)
    call(methods.obey, world)
    record(world)
    proceed(world)
    return True


@compiled
def follow_path(world: Record) -> None:
    """Read the target pose and twist, at full pace; between two ticks of the path they are interpolated.

    Quaternions are interpolated linearly and normalized: neighbors differ by a fraction of a degree, for
    which that equals the arc.
    """
    tick, path_tick = world.tick, world.memory.path_tick
    samples = carray(pointer(world.engine.reference), (world.engine.path_ticks, TWIST), np.float64)
    number = int(path_tick)
    part, here = path_tick - number, samples[number]
    after = samples[number + 1] if part > 0.0 else here
    side = 1.0 if dot(here[3:], after[3:], 4) >= 0.0 else -1.0
    tick.path_time = path_tick * world.period
    for i in range(POSE):
        goal = side * after[i] if i >= 3 else after[i]
        tick.pose_ref[i] = here[i] + part * (goal - here[i])
    for i in range(6):
        tick.twist_ref[i] = here[POSE + i] + part * (after[POSE + i] - here[POSE + i])
    if part > 0.0:
        size = math.sqrt(dot(tick.pose_ref[3:], tick.pose_ref[3:], 4))
        for i in range(3, POSE):
            tick.pose_ref[i] /= size


@compiled
def sense(world: Record) -> None:
    """Write joints, forces, sites and Jacobians as MuJoCo has them: what the law takes the arm to do."""
    engine, state, tick = world.engine, world.state, world.tick
    read_joints(world)
    for j in range(world.n):
        tick.q[j], tick.q_believed[j], tick.qdot[j] = state.q[j], state.q[j], state.qdot[j]
    if engine.substeps > 0:
        if engine.drive_count > 0:
            read_forces(world)
        else:
            read_drives(world)
    look(world)
    for i in range(POSE):
        tick.pose[i] = state.pose[i]
    if engine.positions != 0:  # those of all joints of the model are kept
        row = engine.next % engine.rows
        copy(qpos_of(world), at(engine.positions + 8 * engine.nq * row, engine.nq), engine.nq)


@compiled
def read_drives(world: Record) -> None:
    """Write tau of the last step: the forces of the drives that a plant added, with their compensation.

    Other actuators may act on the arm as well, such as those of tendons.
    """
    engine, tau, force = world.engine, world.tick.tau, at(world.engine.actuator_force, world.engine.nu)
    read_at_joints(world, engine.qfrc_gravcomp, tau)
    for j in range(world.n):
        tau[j] = force[engine.force_at[j]] + (1.0 - world.plant.gravity_apart[j]) * tau[j]


@Method
def believe(world: Record) -> None:
    """Replace the state by the readings of encoders, and note the true errors."""
    true_error, task, tick = world.plant.true_error, world.task, world.tick
    call(world.methods.readings, world)
    for j in range(world.n):
        tick.q_believed[j] = world.plant.q_last[j] = world.state.q[j]
    framed_error(task.frame, task.base, task.free, tick.pose, tick.pose_ref, true_error)
    follow_chain(world, world.state.q)
    geometric_jacobian(world)
    if world.second.m > 0:
        world.second.true_error = second_error(world)
        follow_second(world)


@compiled
def read_loads(world: Record) -> None:
    """Read gravity compensation and slip of followers; add TORQUE_LIMITED and SLIPPED to the status."""
    engine, plant, tick = world.engine, world.plant, world.tick
    if engine.substeps > 0:
        read_at_joints(world, engine.qfrc_gravcomp, tick.tau_gravity)
        for j in range(world.n):
            tick.tau_gravity[j] *= plant.gravity_apart[j]
            if is_at_torque_limit(world, j):
                tick.status |= TORQUE_LIMITED
    if engine.followers == 0:
        return
    qpos, tick.slip = qpos_of(world), 0.0
    for f in range(engine.followers):
        leader, ratio = engine.follows[f], engine.follower_ratio[f]
        slip = qpos[engine.follower_qpos[f]] - engine.follower_offset[f] - ratio * tick.q[leader]
        tick.slip = max(tick.slip, abs(slip))
    if tick.slip > MOST_SLIP:
        tick.status |= SLIPPED


@compiled
def bad_state(world: Record) -> int:
    """Return the joint whose state is not finite, OTHER_JOINT if it is none of the arm's, or ALL_FINE."""
    engine = world.engine
    for j in range(world.n):
        if not (abs(world.state.q[j]) <= LARGEST and abs(world.state.qdot[j]) <= LARGEST):
            return j
    # a warning of MuJoCo holds what it is about, and how often it came
    counts = carray(pointer(engine.warning_count), (2 * BAD_LAST + 1,), np.int32)
    infos = carray(pointer(engine.warning_info), (2 * BAD_LAST + 1,), np.int32)
    for warning in range(BAD_FIRST, BAD_LAST + 1):
        if counts[2 * warning] > 0:
            for j in range(world.n):
                if engine.dof[j] == infos[2 * warning]:
                    return j
            for f in range(engine.followers):
                if engine.follower_dof[f] == infos[2 * warning]:
                    return int(engine.follows[f])
            return OTHER_JOINT
    return ALL_FINE


@compiled
def bad_command(world: Record) -> int:
    """Return the joint whose command is not finite, or ALL_FINE; MuJoCo would take it for 0 and continue."""
    for j in range(world.n):
        if not abs(world.tick.qdot_cmd[j]) <= LARGEST:
            return j
    return ALL_FINE


@compiled
def send(world: Record) -> None:
    """Send the command through the stages after the law, and record what arrives, and the true errors."""
    plant, memory, tick = world.plant, world.memory, world.tick
    if world.methods.believe != 0:  # the law took the arm to be elsewhere
        for i in range(6):
            tick.pose_error[i] = plant.true_error[i]
        if world.second.m > 0:
            tick.secondary_error = world.second.true_error
    if world.methods.remember != 0:
        call(world.methods.remember, world)
    for j in range(world.n):
        memory.qdot_cmd[j] = plant.qdot_sent[j] = tick.qdot_cmd[j]
    if world.methods.transmission != 0:
        call(world.methods.transmission, world)
    for j in range(world.n):
        tick.qdot_arrived[j] = plant.qdot_sent[j]


@compiled
def record(world: Record) -> None:
    """Write the columns of this tick."""
    engine = world.engine
    row = engine.next % engine.rows
    words = carray(pointer(engine.record), (engine.record_size,), np.int64)
    sources = carray(pointer(engine.sources), (engine.width,), np.int64)
    columns = carray(pointer(engine.columns + 8 * engine.width * row), (engine.width,), np.int64)
    for c in range(engine.width):
        columns[c] = words[sources[c]]


@compiled
def proceed(world: Record) -> None:
    """Advance along the path; the world ends with the tick at the end of its path."""
    engine, memory = world.engine, world.memory
    end = engine.path_ticks - 1.0
    if memory.path_tick >= end:
        engine.ticks = engine.last = engine.next + 1
    memory.path_tick = min(memory.path_tick + memory.pace, end)
