"""Facts about a model, before its findings."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rmrc.analysis.check.motion import Motion
from rmrc.analysis.new.nearest import Nearest
from rmrc.analysis.new.scaling import Scales
from rmrc.arm import Arm
from rmrc.arm.inventory import Actuator, Contact, OtherJoint
from rmrc.law.task import Array


@dataclass(frozen=True, eq=False)
class Facts:
    """Facts about a model.

    Attributes:
        arm: The arm.
        scales: Scales of the arm: task, length, distribution of σ_min.
        home: Joint positions of `home`, (n,) [rad or m].
        sigma: Singular values of A at home, descending, (k,).
        lost: Directions that are lost or nearly lost there, in words.
        nearest: The nearest singularity that was found from home, within the limits.
        actuators: Actuators of the author's model.
        others: Joints that are not actuated.
        contacts: Contacts at home.
        routes: Largest difference of J from MuJoCo's by each other route.
        motions: A second of motion on each plant.
        seed: Seed of that motion.
    """

    arm: Arm
    scales: Scales
    home: Array
    sigma: Array
    lost: tuple[str, ...]
    nearest: Nearest
    actuators: tuple[Actuator, ...]
    others: tuple[OtherJoint, ...]
    contacts: tuple[Contact, ...]
    routes: Mapping[str, float]
    motions: tuple[Motion, ...]
    seed: int

    @property
    def condition(self) -> float:
        """κ = σ_1/σ_k at home, infinite where σ_k = 0."""
        return float(self.sigma[0] / self.sigma[-1]) if self.sigma[-1] > 0.0 else np.inf
