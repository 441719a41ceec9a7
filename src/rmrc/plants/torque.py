"""The torque plant: computed torque, which takes the arm's own dynamics out, in MuJoCo's physics."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm, Wiring
from rmrc.law.jit import Array, Record, compiled, entry, machine_code
from rmrc.law.record import JOINTS, Field
from rmrc.plants.physics import Physical, push
from rmrc.plants.plant import BeforeSteps, Wired


@compiled
def choose_acceleration(world: Record, out: Record, state: Array) -> None:
    """Keep the acceleration that the joints shall have; `computed_torque` does the rest."""
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
) -> None:
    """Set tau = Fᵀ (M F qddot + bias − passive) [Luh80].

    With each joint, F moves those that follow it. The other degrees of freedom of the model are taken to be
    at rest.

    Args:
        worlds: World records with the wanted acceleration, (w,).
        state: MuJoCo's state rows, (w, nstate); controls are written.
        qfrc_bias: Gravity and velocity forces, (w, nv).
        qfrc_passive: Springs, dampers and gravity compensation, (w, nv).
        mass: Joint-space inertia, the entries of its lower triangle, (w, nM).
        mass_entries: For each entry between two joints that move with the arm: which of its joints moves
            each, and its index, (e, 3).
        mass_factors: How far they move for these, one times the other, (e,).
    """
    for w in range(worlds.shape[0]):
        world = worlds[w]
        for j in range(world.n):
            dof = world.dof[j]
            state[w, world.ctrl_column[j]] = qfrc_bias[w, dof] - qfrc_passive[w, dof]
        for f in range(world.followers):
            dof, ratio = world.follower_dof[f], world.follower_ratio[f]
            column = world.ctrl_column[world.follows[f]]
            state[w, column] += ratio * (qfrc_bias[w, dof] - qfrc_passive[w, dof])
        for e in range(mass_entries.shape[0]):
            i, j = mass_entries[e, 0], mass_entries[e, 1]
            inertia = mass_factors[e] * mass[w, mass_entries[e, 2]]
            state[w, world.ctrl_column[i]] += inertia * world.qddot[j]
            if i != j:  # only the lower triangle is stored
                state[w, world.ctrl_column[j]] += inertia * world.qddot[i]


@dataclass(frozen=True)
class Motors:
    """A motor on each joint: it gives the torque that it is told."""

    def __call__(self, actuator: mujoco.MjsActuator, joint: int) -> None:
        """Make an actuator the motor of a joint."""
        del joint
        actuator.set_to_motor()


class Torque(Physical):
    """Motors that are told tau = M (Δqdot/period + bandwidth · (qdot sent − qdot)) + bias − passive [Luh80].

    It knows gravity and lengths, but no payload: where there is one, a second batch of MuJoCo's computes what
    is known, from the same states.
    """

    name = "torque"
    obey = staticmethod(choose_acceleration)
    fields = (*Physical.fields, Field("bandwidth"))
    # the acceleration that the joints shall have, and the rates that were sent before
    memory = (Field("qddot", size=(JOINTS,)), Field("sent_before", size=(JOINTS,)))
    batches = 2

    @classmethod
    def drive(cls, plants: Sequence[Self]) -> Motors:
        """Return a motor for each joint."""
        del plants
        return Motors()

    def write(self, world: np.void) -> None:
        """Write the wrench and the bandwidth."""
        super().write(world)
        world["bandwidth"] = self.section.bandwidth

    @classmethod
    def before_steps(cls, plants: Sequence[Self], wired: Wired) -> BeforeSteps:
        """Return what sets the motors of worlds."""
        batch = known = wired.batch
        if any(plant.is_loaded for plant in plants):
            known = wired.take([plant.known(wired.model, wired.wiring) for plant in plants])
        forces = [known.bind(field) for field in ("qfrc_bias", "qfrc_passive", "M")]
        arrays: tuple[Any, ...] = (
            wired.worlds, batch.state, *forces, *_mass_entries(wired.model, wired.wiring, plants[0].arm)
        )  # fmt: skip
        set_torques = partial(machine_code(computed_torque, *arrays), *arrays)

        def before(ids: NDArray[np.intp] | None) -> None:
            if known is not batch:
                known.state[:] = batch.state
                known.forward(ids, int(cls.stage))
            set_torques()

        return before


def _mass_entries(
    model: mujoco.MjModel, wiring: Wiring, arm: Arm
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return (joint, joint, index) and the factor of each stored entry of M that moves with the arm."""
    moved = {int(dof): (j, 1.0) for j, dof in enumerate(wiring.dof)}
    for dof, one in zip(wiring.follower_dof, arm.followers, strict=True):
        moved[int(dof)] = one.leader, one.ratio
    entries, factors = [], []
    for row, (i, ratio) in moved.items():
        for e in range(model.M_rowadr[row], model.M_rowadr[row] + model.M_rownnz[row]):
            column = int(model.M_colind[e])
            if column in moved:
                j, other = moved[column]
                # of two joints that move as one, only the lower triangle is stored
                twice = 2.0 if i == j and row != column else 1.0
                entries.append((i, j, e))
                factors.append(twice * ratio * other)
    return np.array(entries, np.int64), np.array(factors)
