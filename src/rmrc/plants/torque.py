"""The torque plant: computed torque, which compensates the arm's own dynamics, in MuJoCo's physics."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm, Wiring
from rmrc.law.jit import Array, Record, compiled, entry, machine_code
from rmrc.law.metric import backward, factor, forward
from rmrc.law.record import JOINTS, Field
from rmrc.plants.physics import Physical, push
from rmrc.plants.plant import BeforeSteps, Wired
from rmrc.plants.resistance import friction_at


@compiled
def choose_acceleration(world: Record, out: Record, state: Array) -> None:
    """Keep the wanted acceleration of the joints; `computed_torque` does the rest."""
    push(world, out, state)
    for j in range(world.n):
        sent = world.qdot_sent[j]
        world.qddot[j] = (sent - world.sent_before[j]) / world.period
        world.qddot[j] += world.bandwidth * (sent - world.qdot[j])
        world.sent_before[j] = sent


@entry
def computed_torque(
    worlds: Record,
    state: Array,
    qfrc_bias: Array,
    qfrc_passive: Array,
    mass: Array,
    mass_entries: NDArray[np.int64],
    mass_factors: Array,
    free: NDArray[np.int64],
    free_damping: Array,
) -> None:
    """Set tau = Fᵀ (M F qddot + bias − passive) [Luh80], plus the torque of damping and dry friction.

    F moves the followers of each joint along; without any, it is 1. Free degrees of freedom give way,
    M_uu qddot_u = passive_u − bias_u − M_ua qddot, which the arm feels as M_au qddot_u [Spong94]. All others
    of the model are assumed at rest.

    Args:
        worlds: World records with the wanted acceleration, (w,).
        state: MuJoCo's state rows, (w, nstate); controls are written.
        qfrc_bias: Gravity and velocity forces, (w, nv).
        qfrc_passive: Springs, dampers and gravity compensation, (w, nv).
        mass: Joint-space inertia, the entries of its lower triangle, (w, nM).
        mass_entries: For each entry between two joints that move with the arm: which of its joints moves
            each, its index, and whether it is the inertia of one of the arm's, (e, 4); free degrees of
            freedom are numbered after the joints.
        mass_factors: Product of the ratios by which these move them, (e,).
        free: Addresses of the free degrees of freedom in qvel, (u,).
        free_damping: Inertia that implicit steps add to them, (u,).
    """
    for w in range(worlds.shape[0]):
        world = worlds[w]
        for j in range(world.n):
            dof = world.dof[j]
            state[w, world.ctrl_column[j]] = qfrc_bias[w, dof] - qfrc_passive[w, dof]
        for f in range(world.followers):
            dof, column = world.follower_dof[f], world.ctrl_column[world.follows[f]]
            state[w, column] += world.follower_ratio[f] * (qfrc_bias[w, dof] - qfrc_passive[w, dof])
        for e in range(mass_entries.shape[0]):
            i, j = mass_entries[e, 0], mass_entries[e, 1]
            inertia = mass_factors[e] * mass[w, mass_entries[e, 2]]
            if max(i, j) >= world.n:
                continue
            state[w, world.ctrl_column[i]] += inertia * world.qddot[j]
            if i != j:  # only the lower triangle is stored
                state[w, world.ctrl_column[j]] += inertia * world.qddot[i]
            elif world.resists[i] and mass_entries[e, 3]:
                if world.followers > 0:
                    inertia = _carried(i, mass[w], mass_entries, mass_factors)
                state[w, world.ctrl_column[i]] += _resisted(world, i, inertia)
        if len(free) > 0:
            give_way(
                world, state[w], qfrc_passive[w], qfrc_bias[w], mass[w], mass_entries, mass_factors, free,
                free_damping,
            )  # fmt: skip


@compiled
def give_way(
    world: Record,
    state: Array,
    passive: Array,
    bias: Array,
    mass: Array,
    entries: NDArray[np.int64],
    factors: Array,
    free: NDArray[np.int64],
    damping: Array,
) -> None:
    """Add to the controls the effect of free degrees of freedom on the arm; see `computed_torque`."""
    n, inertias, coupling = world.n, np.diag(damping), np.zeros((len(free), world.n))
    for e in range(entries.shape[0]):
        i, j, inertia = entries[e, 0], entries[e, 1], factors[e] * mass[entries[e, 2]]
        if min(i, j) >= n:
            inertias[i - n, j - n] += inertia
            inertias[j - n, i - n] = inertias[i - n, j - n]
        elif max(i, j) >= n:
            coupling[max(i, j) - n, min(i, j)] += inertia
    answer = passive[free] - bias[free]
    for u in range(len(free)):
        for j in range(n):
            answer[u] -= coupling[u, j] * world.qddot[j]
    factor(inertias, len(answer))
    forward(inertias, answer, len(answer))
    backward(inertias, answer, len(answer))
    for j in range(n):
        for u in range(len(free)):
            state[world.ctrl_column[j]] += coupling[u, j] * answer[u]


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
    wanted, added = world.qddot[j], 0.0
    d, size = world.damping[j], abs(world.qdot[j])
    slope = d[0] + size * (2.0 * d[1] + size * 3.0 * d[2])
    if slope > 0.0:
        left = (inertia / (inertia + world.period / world.substeps * slope)) ** world.substeps
        added = world.period * slope / (1.0 - left) - inertia
    return added * wanted + friction_at(world, j, (1.0 + added / inertia) * wanted, world.qdot[j])


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
    the model lacks. Where there are any, a second MuJoCo batch computes the known dynamics from the same
    states. The rate that it corrects is the measured one.
    """

    name, drives = "torque", ("motors", "motor")
    obey = staticmethod(choose_acceleration)
    fields = (*Physical.fields, Field("bandwidth"), Field("substeps", np.int64))
    # the wanted acceleration of the joints, and the rates that were sent before
    memory = (Field("qddot", size=(JOINTS,)), Field("sent_before", size=(JOINTS,)))
    batches, works_between = 2, True

    @property
    def compensates(self) -> bool:
        """Whether tau includes damping and dry friction of the joints at the wanted acceleration."""
        return self.section.friction_compensation

    @classmethod
    def drive(cls, plants: Sequence[Self]) -> Motors:
        """Return a motor for each joint."""
        del plants
        return Motors()

    def write(self, world: np.void) -> None:
        """Write the bandwidth and the steps of a period."""
        super().write(world)
        world["bandwidth"], world["substeps"] = self.section.bandwidth, self.substeps

    @classmethod
    def before_steps(cls, plants: Sequence[Self], wired: Wired) -> BeforeSteps:
        """Return a function that sets the motors of worlds."""
        batch = known = wired.batch
        if any(plant.has_secrets for plant in plants):
            known = wired.take([plant.known(wired.model, wired.wiring) for plant in plants])
        forces = [known.bind(field) for field in ("qfrc_bias", "qfrc_passive", "M")]
        model, free = wired.model, _free(wired.model, wired.wiring, plants[0].arm)
        masses = _mass_entries(model, wired.wiring, plants[0].arm, free)
        arrays: tuple[Any, ...] = (
            wired.worlds, batch.state, *forces, *masses, free,
            model.opt.timestep * model.dof_damping[free],
        )  # fmt: skip
        set_torques = partial(machine_code(computed_torque, *arrays), *arrays)

        def before(ids: NDArray[np.intp] | None) -> None:
            if known is not batch:
                known.state[:] = batch.state
                known.forward(ids, int(cls.stage))
            set_torques()

        return before


def _free(model: mujoco.MjModel, wiring: Wiring, arm: Arm) -> NDArray[np.int64]:
    """Return the degrees of freedom of the arm's tree that `arm.others: free` frees, (u,)."""
    if not arm.frees_others:
        return np.empty(0, np.int64)
    in_tree = model.body_rootid[model.dof_bodyid] == model.body_rootid[wiring.body]
    return np.flatnonzero(in_tree & np.isin(model.dof_jntid, list(arm.others.locked)))


def _mass_entries(
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
