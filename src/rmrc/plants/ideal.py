"""The ideal plant: Whitney's own arm, which obeys exactly; MuJoCo computes its kinematics."""

from collections.abc import Iterator

import mujoco
import numpy as np

from rmrc.law.compiling import Method, Record
from rmrc.plants.engine import qpos_of, qvel_of
from rmrc.plants.plant import Plant
from rmrc.scenario.choices import PLANTS
from rmrc.scenario.sections import TIMESTEP


@Method
def integrate(world: Record) -> None:
    """Move each joint and its followers: q⁺ = q + period · qdot."""
    engine, sent, qpos, qvel = world.engine, world.plant.qdot_sent, qpos_of(world), qvel_of(world)
    for j in range(world.n):
        qpos[engine.qpos_at[j]] += world.period * sent[j]
        qvel[engine.dof[j]] = sent[j]
    for f in range(engine.followers):
        qpos[engine.follower_qpos[f]] += engine.follower_ratio[f] * world.period * sent[engine.follows[f]]


class Ideal(Plant):
    """Integrates the rates [Whitney72]: no force acts on it, and it carries nothing."""

    name = "ideal"
    obey = integrate
    begins = "mj_fwdKinematics"
    substeps = 0

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield features that need masses and actuators."""
        section = self.section
        used = {
            "friction": self.rubs, "backlash": np.any(section.backlash),
            "resonance": section.resonance.frequency,
        }  # fmt: skip
        physical = ", ".join(each.name for each in PLANTS.options if each.physics)
        way = f"leave it out, write plant.lag for slow actuators, or choose from {physical}"
        for key in (f"plant.{name}" for name, is_used in used.items() if is_used):
            yield key, f'"{self.name}" obeys exactly, without {key}; {way}'

    def model(self) -> mujoco.MjModel:
        """Return a model without actuators of the arm; its dynamics are not used."""
        return self.arm.adapted(None, TIMESTEP, self.section.is_compensated)
