"""The torque plant: computed torque, which compensates the arm's own dynamics, in MuJoCo's physics."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm, Wiring
from rmrc.law.compiling import Array, Method, Record, at, call, carray, compiled, pointer
from rmrc.law.metric import backward, factor, forward
from rmrc.plants.engine import ctrl_of, qpos_of, qvel_of
from rmrc.plants.physics import Physical, friction_at, push

# A degree of freedom: its joint of the arm, or -1, and its speed at unit rate of that joint; those that give
# way are numbered after the joints. Then whether its actuators compensate its gravity, and its damping as an
# inertia.
FREEDOM = np.dtype([("joint", np.int64), ("ratio", float), ("is_balanced", np.int64), ("damping", float)])
# An entry of M, whose lower triangle is stored: the joints that it couples, its place, and the product of
# their ratios.
ENTRY = np.dtype([("row", np.int64), ("column", np.int64), ("place", np.int64), ("factor", float)])


@compiled
def choose_acceleration(world: Record) -> None:
    """Apply the wrench, and write the wanted acceleration of the joints."""
    plant = world.plant
    push(world)
    for j in range(world.n):
        sent = plant.qdot_sent[j]
        plant.qddot[j] = (sent - plant.sent_before[j]) / world.period
        plant.qddot[j] += plant.bandwidth * (sent - world.state.qdot[j])
        plant.sent_before[j] = sent


@compiled
def refresh_known(world: Record) -> None:
    """Bring the arm that the plant knows to the state of the true one, if they differ."""
    engine = world.engine
    if engine.known_data == engine.data:
        return
    at(engine.known_qpos, engine.nq)[:] = qpos_of(world)
    at(engine.known_qvel, engine.nv)[:] = qvel_of(world)
    call(engine.begin, engine.known_model, engine.known_data)


@compiled
def find_torques(world: Record) -> None:
    """Write tau = Fᵀ (M F qddot + bias − passive) [Luh80] and the inertia that each joint moves alone.

    F moves the followers of each joint along; without any, it is 1. The actuators give their own gravity
    compensation. All other joints of the model are assumed at rest, except those that are free.
    """
    engine, plant, n = world.engine, world.plant, world.n
    refresh_known(world)
    bias, passive = at(engine.known_qfrc_bias, engine.nv), at(engine.known_qfrc_passive, engine.nv)
    balanced, mass = at(engine.known_qfrc_gravcomp, engine.nv), at(engine.known_M, engine.mass_size)
    freedoms = carray(pointer(engine.freedoms), (engine.nv,), FREEDOM)
    entries = carray(pointer(engine.masses), (engine.mass_count,), ENTRY)
    for j in range(n):
        plant.torque[j] = plant.inertia[j] = 0.0
    for dof in range(engine.nv):
        freedom = freedoms[dof]
        if 0 <= freedom.joint < n:
            load = bias[dof] - passive[dof] - (balanced[dof] if freedom.is_balanced else 0.0)
            plant.torque[freedom.joint] += freedom.ratio * load
    for e in range(engine.mass_count):
        i, j, inertia = entries[e].row, entries[e].column, entries[e].factor * mass[entries[e].place]
        if max(i, j) >= n:
            continue
        plant.torque[i] += inertia * plant.qddot[j]
        if i != j:  # only the lower triangle is stored
            plant.torque[j] += inertia * plant.qddot[i]
        else:
            plant.inertia[i] += inertia
    if engine.free_count > 0:
        give_way(world, freedoms, passive, bias, entries, mass)


@Method
def computed_torque(world: Record) -> None:
    """Command tau, plus the torque of damping and dry friction."""
    engine, plant, ctrl = world.engine, world.plant, ctrl_of(world)
    choose_acceleration(world)
    find_torques(world)
    for j in range(world.n):
        ctrl[engine.ctrl_at[j]] = plant.torque[j]
        if plant.resists[j]:
            ctrl[engine.ctrl_at[j]] += _resisted(world, j, plant.inertia[j])


@compiled
def give_way(
    world: Record, freedoms: Record, passive: Array, bias: Array, entries: Record, mass: Array
) -> None:
    """Add to tau the effect of free degrees of freedom on the arm.

    They give way, M_uu qddot_u = passive_u − bias_u − M_ua qddot, which the arm feels as M_au qddot_u
    [Spong94].
    """
    engine, plant, n, count = world.engine, world.plant, world.n, world.engine.free_count
    inertias, coupling, answer = np.zeros((count, count)), np.zeros((count, n)), np.zeros(count)
    for dof in range(engine.nv):
        u = freedoms[dof].joint - n
        if u >= 0:
            inertias[u, u], answer[u] = freedoms[dof].damping, passive[dof] - bias[dof]
    for e in range(engine.mass_count):
        i, j, inertia = entries[e].row, entries[e].column, entries[e].factor * mass[entries[e].place]
        if min(i, j) >= n:
            inertias[i - n, j - n] += inertia
            inertias[j - n, i - n] = inertias[i - n, j - n]
        elif max(i, j) >= n:
            coupling[max(i, j) - n, min(i, j)] += inertia
    for u in range(count):
        for j in range(n):
            answer[u] -= coupling[u, j] * plant.qddot[j]
    factor(inertias, count)
    forward(inertias, answer, count)
    backward(inertias, answer, count)
    for j in range(n):
        for u in range(count):
            plant.torque[j] += coupling[u, j] * answer[u]


@compiled
def _resisted(world: Record, j: int, inertia: float) -> Any:
    """Return the resistance of joint j to its wanted acceleration, beside the damping at its rate.

    MuJoCo's implicit steps of h treat damping d as an inertia: n of them, each (M + h d) Δq̇ = h (τ − d q̇),
    reach the wanted rate if τ is for M + e, e = n h d/(1 − (M/(M + h d))ⁿ) − M, instead of M. Dry friction
    feels the acceleration of explicit steps, which is (M + e)/M times as large.
    """
    wanted, added = world.plant.qddot[j], 0.0
    d, size = world.plant.damping[j], abs(world.state.qdot[j])
    slope = d[0] + size * (2.0 * d[1] + size * 3.0 * d[2])
    if slope > 0.0:
        left = (inertia / (inertia + world.period / world.engine.substeps * slope)) ** world.engine.substeps
        added = world.period * slope / (1.0 - left) - inertia
    return added * wanted + friction_at(world, j, (1.0 + added / inertia) * wanted, world.state.qdot[j])


def motor(actuator: mujoco.MjsActuator) -> None:
    """Make an actuator a motor: it gives the commanded torque."""
    actuator.set_to_motor()


class Torque(Physical):
    """Motors with tau = M (Δqdot/period + bandwidth · (qdot sent − qdot)) + bias − passive [Luh80].

    It knows gravity and the lengths that the law knows, but not the payload, other lengths or friction that
    the model lacks. Where there are any, a second model computes the known dynamics from the same
    states. The rate that it corrects is the measured one.
    """

    name, drives = "torque", ("motors", "motor")
    obey, drive = computed_torque, staticmethod(motor)

    def wire(self, world: np.void, model: mujoco.MjModel, wiring: Wiring, data: mujoco.MjData) -> list[Any]:
        """Write the tables of the dynamics as well, with the joints that `arm.others: free` frees."""
        arm, free = self.arm, list[int]()
        if arm.frees_others:
            in_tree = model.body_rootid[model.dof_bodyid] == model.body_rootid[wiring.body]
            free = np.flatnonzero(in_tree & np.isin(model.dof_jntid, list(arm.others.locked))).tolist()
        return [
            *super().wire(world, model, wiring, data), *write_dynamics(world["engine"], model, arm, free)
        ]  # fmt: skip


def write_dynamics(
    engine: np.void, model: mujoco.MjModel, arm: Arm, free: list[int]
) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Write the tables of the dynamics of an arm into the group `engine` of a world's record.

    Args:
        engine: The group.
        model: The model of the world.
        arm: The arm.
        free: Degrees of freedom that give way.

    Returns:
        The tables: degrees of freedom, (nv,), and entries of the inertia.
    """
    freedoms, entries = np.zeros(model.nv, FREEDOM), []
    freedoms["joint"] = np.where(arm.motion.any(axis=1), np.abs(arm.motion).argmax(axis=1), -1)
    freedoms["ratio"] = arm.motion.sum(axis=1)
    freedoms["joint"][free], freedoms["ratio"][free] = arm.n + np.arange(len(free)), 1.0
    freedoms["is_balanced"] = model.jnt_actgravcomp[model.dof_jntid]
    freedoms["damping"] = model.opt.timestep * model.dof_damping
    joint, ratio, columns = freedoms["joint"].tolist(), freedoms["ratio"].tolist(), model.M_colind.tolist()
    for row in np.flatnonzero(freedoms["joint"] >= 0).tolist():
        first, count = int(model.M_rowadr[row]), int(model.M_rownnz[row])
        for place, column in enumerate(columns[first : first + count], first):
            i, j = joint[row], joint[column]
            # of two joints that move as one, only the lower triangle is stored
            twice = 2.0 if i == j and row != column else 1.0
            if j >= 0:
                entries.append((i, j, place, twice * ratio[row] * ratio[column]))
    masses = np.array(entries, ENTRY)
    engine["freedoms"], engine["masses"] = freedoms.ctypes.data, masses.ctypes.data
    engine["mass_count"], engine["free_count"] = len(masses), len(free)
    return freedoms, masses
