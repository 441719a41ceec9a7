"""The torque plant: computed torque, which compensates the arm's own dynamics, in MuJoCo's physics."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm, Wiring
from rmrc.law.compiling import Array, Method, Record, at, call, carray, compiled, pointer
from rmrc.law.metric import backward, factor, forward
from rmrc.plants.fields import ctrl_of
from rmrc.plants.physics import Physical, push
from rmrc.plants.resistance import friction_at


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
    qpos, qvel = at(engine.qpos, engine.nq), at(engine.qvel, engine.nv)
    known_qpos, known_qvel = at(engine.known_qpos, engine.nq), at(engine.known_qvel, engine.nv)
    for i in range(engine.nq):
        known_qpos[i] = qpos[i]
    for i in range(engine.nv):
        known_qvel[i] = qvel[i]
    call(engine.begin, engine.known_model, engine.known_data)


@Method
def computed_torque(world: Record) -> None:
    """Set tau = Fᵀ (M F qddot + bias − passive) [Luh80], plus the torque of damping and dry friction.

    F moves the followers of each joint along; without any, it is 1. Free degrees of freedom give way,
    M_uu qddot_u = passive_u − bias_u − M_ua qddot, which the arm feels as M_au qddot_u [Spong94]. All others
    of the model are assumed at rest.

    Each row of the table `masses` is an entry of M, whose lower triangle is stored, between two joints that
    move with the arm: which of its joints moves each, its index, and whether it is the inertia of one of the
    arm's; free degrees of freedom are numbered after the joints. `mass_factors` are the products of the
    ratios.
    """
    engine, plant, n, ctrl = world.engine, world.plant, world.n, ctrl_of(world)
    choose_acceleration(world)
    refresh_known(world)
    bias, passive = at(engine.known_bias, engine.nv), at(engine.known_passive, engine.nv)
    mass = at(engine.known_M, engine.mass_size)
    entries = carray(pointer(engine.masses), (engine.mass_count, 4), np.int64)
    factors = at(engine.mass_factors, engine.mass_count)
    for j in range(n):
        ctrl[engine.ctrl_at[j]] = bias[engine.dof[j]] - passive[engine.dof[j]]
    for f in range(engine.followers):
        dof = engine.follower_dof[f]
        ctrl[engine.ctrl_at[engine.follows[f]]] += engine.follower_ratio[f] * (bias[dof] - passive[dof])
    for e in range(engine.mass_count):
        i, j = entries[e, 0], entries[e, 1]
        inertia = factors[e] * mass[entries[e, 2]]
        if max(i, j) >= n:
            continue
        ctrl[engine.ctrl_at[i]] += inertia * plant.qddot[j]
        if i != j:
            ctrl[engine.ctrl_at[j]] += inertia * plant.qddot[i]
        elif plant.resists[i] and entries[e, 3]:
            if engine.followers > 0:
                inertia = _carried(i, mass, entries, factors)
            ctrl[engine.ctrl_at[i]] += _resisted(world, i, inertia)
    if engine.free_count > 0:
        give_way(world, ctrl, passive, bias, mass, entries, factors)


@compiled
def give_way(
    world: Record,
    ctrl: Array,
    passive: Array,
    bias: Array,
    mass: Array,
    entries: NDArray[np.int64],
    factors: Array,
) -> None:
    """Add to the controls the effect of free degrees of freedom on the arm; see `computed_torque`."""
    engine, n, count = world.engine, world.n, world.engine.free_count
    free = carray(pointer(engine.free), (count,), np.int64)
    damping = at(engine.free_damping, count)
    inertias, coupling, answer = np.zeros((count, count)), np.zeros((count, n)), np.zeros(count)
    for u in range(count):
        inertias[u, u], answer[u] = damping[u], passive[free[u]] - bias[free[u]]
    for e in range(entries.shape[0]):
        i, j, inertia = entries[e, 0], entries[e, 1], factors[e] * mass[entries[e, 2]]
        if min(i, j) >= n:
            inertias[i - n, j - n] += inertia
            inertias[j - n, i - n] = inertias[i - n, j - n]
        elif max(i, j) >= n:
            coupling[max(i, j) - n, min(i, j)] += inertia
    for u in range(count):
        for j in range(n):
            answer[u] -= coupling[u, j] * world.plant.qddot[j]
    factor(inertias, count)
    forward(inertias, answer, count)
    backward(inertias, answer, count)
    for j in range(n):
        for u in range(count):
            ctrl[engine.ctrl_at[j]] += coupling[u, j] * answer[u]


@compiled
def _carried(j: int, mass: Array, entries: NDArray[np.int64], factors: Array) -> Any:
    """Return the inertia of everything that joint j alone moves."""
    inertia = 0.0
    for e in range(entries.shape[0]):
        if entries[e, 0] == j and entries[e, 1] == j:
            inertia += factors[e] * mass[entries[e, 2]]
    return inertia


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
        left = (inertia / (inertia + world.period / world.plant.substeps * slope)) ** world.plant.substeps
        added = world.period * slope / (1.0 - left) - inertia
    return added * wanted + friction_at(world, j, (1.0 + added / inertia) * wanted, world.state.qdot[j])


@dataclass(frozen=True)
class Motors:
    """A motor on each joint: it gives the commanded torque."""

    def __call__(self, actuator: mujoco.MjsActuator, joint: int) -> None:
        """Make an actuator the motor of a joint."""
        del joint
        actuator.set_to_motor()


class Torque(Physical):
    """Motors with tau = M (Δqdot/period + bandwidth · (qdot sent − qdot)) + bias − passive [Luh80].

    It knows gravity and the lengths that the law knows, but not the payload, other lengths or friction that
    the model lacks. Where there are any, a second model computes the known dynamics from the same
    states. The rate that it corrects is the measured one.
    """

    name, drives = "torque", ("motors", "motor")
    obey = computed_torque

    @property
    def compensates(self) -> bool:
        """Whether tau includes damping and dry friction of the joints at the wanted acceleration."""
        return self.section.friction_compensation

    @property
    def drive(self) -> Motors:
        """A motor for each joint."""
        return Motors()

    def wire(self, world: np.void, model: mujoco.MjModel, wiring: Wiring, data: mujoco.MjData) -> list[Any]:
        """Write the tables of masses and of free degrees of freedom as well."""
        engine, free = world["engine"], _free(model, wiring, self.arm)
        entries, factors = mass_entries(model, wiring, self.arm, free)
        damping = model.opt.timestep * model.dof_damping[free]
        tables = [entries, factors, free, damping]
        for name, table in zip(("masses", "mass_factors", "free", "free_damping"), tables, strict=True):
            engine[name] = table.ctypes.data
        engine["mass_count"], engine["free_count"] = len(entries), len(free)
        return [*super().wire(world, model, wiring, data), *tables]


def _free(model: mujoco.MjModel, wiring: Wiring, arm: Arm) -> NDArray[np.int64]:
    """Return the degrees of freedom of the arm's tree that `arm.others: free` frees, (u,)."""
    if not arm.frees_others:
        return np.empty(0, np.int64)
    in_tree = model.body_rootid[model.dof_bodyid] == model.body_rootid[wiring.body]
    return np.flatnonzero(in_tree & np.isin(model.dof_jntid, list(arm.others.locked)))


def mass_entries(
    model: mujoco.MjModel, wiring: Wiring, arm: Arm, free: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return mass_entries (e, 4) and mass_factors (e,) for `computed_torque`."""
    moved = {int(dof): (j, 1.0) for j, dof in enumerate([*wiring.dof, *free])}
    for dof, one in zip(wiring.follower_dof, arm.followers, strict=True):
        moved[int(dof)] = one.leader, one.ratio
    own, entries, factors = set(wiring.dof.tolist()), [], []
    for row, (i, ratio) in moved.items():
        for e in range(model.M_rowadr[row], model.M_rowadr[row] + model.M_rownnz[row]):
            column = int(model.M_colind[e])
            if column in moved:
                j, other = moved[column]
                # of two joints that move as one, only the lower triangle is stored
                twice = 2.0 if i == j and row != column else 1.0
                entries.append((i, j, e, row == column and row in own))
                factors.append(twice * ratio * other)
    return np.array(entries, np.int64), np.array(factors)
