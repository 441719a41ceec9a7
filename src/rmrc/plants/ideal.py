"""The ideal plant: Whitney's own arm, which obeys exactly; MuJoCo computes its kinematics."""

from collections.abc import Iterator

import mujoco
import numpy as np

from rmrc.law.compiling import Method, Record
from rmrc.plants.fields import qpos_of
from rmrc.plants.plant import Plant
from rmrc.scenario.sections import TIMESTEP


@Method
def read_positions(world: Record) -> None:
    """Read q; the rates are the last ones that were sent."""
    engine, tick, qpos = world.engine, world.tick, qpos_of(world)
    for j in range(world.n):
        tick.q[j] = qpos[engine.qpos_at[j]]
        tick.qdot[j] = world.plant.qdot_sent[j]
        tick.tau[j] = 0.0


@Method
def integrate(world: Record) -> None:
    """Move each joint and its followers: q⁺ = q + period · qdot."""
    engine, sent, qpos = world.engine, world.plant.qdot_sent, qpos_of(world)
    for j in range(world.n):
        qpos[engine.qpos_at[j]] += world.period * sent[j]
    for f in range(engine.followers):
        qpos[engine.follower_qpos[f]] += engine.follower_ratio[f] * world.period * sent[engine.follows[f]]


class Ideal(Plant):
    """Integrates the rates [Whitney72]: no force acts on it, and it carries nothing."""

    name = "ideal"
    sense, obey = read_positions, integrate
    begins = "mj_fwdKinematics"
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

    def model(self) -> mujoco.MjModel:
        """Return a model without actuators of the arm; its dynamics are not used."""
        return self.arm.adapted(None, TIMESTEP, self.section.is_compensated)
