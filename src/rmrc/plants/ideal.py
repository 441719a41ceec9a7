"""The ideal plant: Whitney's own arm, which obeys exactly; MuJoCo computes its kinematics."""

from collections.abc import Iterator, Sequence
from typing import Self

import mujoco
import numpy as np

from rmrc.law.jit import Array, Record, compiled
from rmrc.plants.plant import Plant


@compiled
def read_positions(world: Record, out: Record, state: Array, force: Array) -> None:  # noqa: ARG001 - as all
    """Read q; the rates are the last ones that were sent."""
    for j in range(world.n):
        out.q[j] = state[world.qpos_column[j]]
        out.qdot[j] = world.qdot_sent[j]
        out.tau[j] = 0.0


@compiled
def integrate(world: Record, out: Record, state: Array) -> None:  # noqa: ARG001 - as all
    """Move each joint and its followers: q⁺ = q + period · qdot."""
    for j in range(world.n):
        state[world.qpos_column[j]] += world.period * world.qdot_sent[j]
    for f in range(world.followers):
        rate = world.qdot_sent[world.follows[f]]
        state[world.follower_column[f]] += world.follower_ratio[f] * world.period * rate


class Ideal(Plant):
    """Integrates the rates [Whitney72]: no force acts on it, and it carries nothing."""

    name = "ideal"
    sense, obey = staticmethod(read_positions), staticmethod(integrate)
    stage = mujoco.mjtStage.mjSTAGE_POS
    substeps = 0

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield friction, which needs torques."""
        friction = self.section.friction
        if np.any(friction.coulomb) or np.any(friction.viscous):
            yield (
                "plant.friction",
                f'"{self.name}" obeys exactly, whatever the friction; choose plant.kind: servo, torque or '
                "model, or leave plant.friction out",
            )

    @classmethod
    def model(cls, plants: Sequence[Self]) -> mujoco.MjModel:
        """Return a model without actuators of the arm; its unused dynamics are those of the first world."""
        section = plants[0].section
        return plants[0].arm.adapted(None, section.step, section.is_compensated)
