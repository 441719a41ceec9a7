"""The common part of plants that MuJoCo steps: gravity, a payload, a wrench, and the actuators' sensors."""

import math
from abc import abstractmethod
from collections.abc import Hashable, Iterator, Sequence
from typing import ClassVar, Self

import mujoco
import numpy as np

from rmrc.arm import Drive, Own, Wiring
from rmrc.arm.differences import loaded_fields, rubbed_fields
from rmrc.arm.inventory import actuators
from rmrc.law.jit import Array, Record, compiled
from rmrc.law.record import JOINTS, Field
from rmrc.plants.plant import Assumed, Plant
from rmrc.support.legible import listed

# Ten billion steps of MuJoCo take a day for a small arm on one core: more is an error of units.
MOST_STEPS = 10_000_000_000
# A step this short [s] changes no position of an arm by a bit; gains of inertia over timestep stay finite.
_SHORTEST_STEP = 1e-12
# MuJoCo's own, for a model that names none [s].
_UNSAID_TIMESTEP = 0.002

# Flags of a model's option without which a kind of friction is absent.
_LEFT_OUT = {
    "coulomb": int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT),
    "viscous": int(mujoco.mjtDisableBit.mjDSBL_DAMPER),
}


@compiled
def read_drives(world: Record, out: Record, state: Array, force: Array) -> None:
    """Read q, qdot, and tau of the last step."""
    for j in range(world.n):
        out.q[j] = state[world.qpos_column[j]]
        out.qdot[j] = state[world.qvel_column[j]]
        out.tau[j] = force[world.force[j]]


@compiled
def push(world: Record, out: Record, state: Array) -> None:
    """Apply the site's external wrench [f; n] at its body's center of mass: n' = n + r × f.

    r, from the center to the site, is fixed to the site; v + 2 w (u × v) + 2 u × (u × v) turns it into
    the world by the quaternion (w, u).
    """
    f, r, w, column = world.wrench, world.lever, out.pose[3], world.wrench_column
    ux, uy, uz = out.pose[4], out.pose[5], out.pose[6]
    cx, cy, cz = uy * r[2] - uz * r[1], uz * r[0] - ux * r[2], ux * r[1] - uy * r[0]
    rx = r[0] + 2.0 * (w * cx + uy * cz - uz * cy)
    ry = r[1] + 2.0 * (w * cy + uz * cx - ux * cz)
    rz = r[2] + 2.0 * (w * cz + ux * cy - uy * cx)
    for i in range(6):
        state[column + i] = f[i]
    state[column + 3] += ry * f[2] - rz * f[1]
    state[column + 4] += rz * f[0] - rx * f[2]
    state[column + 5] += rx * f[1] - ry * f[0]


class Physical(Plant):
    """A plant with actuators, in MuJoCo's physics."""

    sense = staticmethod(read_drives)
    fields: ClassVar[tuple[Field, ...]] = (
        Field("wrench", size=(6,)), Field("torque_limit", size=(JOINTS,), start=math.inf),
        Field("gravity_apart", size=(JOINTS,)),
    )  # fmt: skip
    stage = mujoco.mjtStage.mjSTAGE_VEL
    drives: ClassVar[tuple[str, str]]  # their name in messages, and the kind of the actuators

    @classmethod
    @abstractmethod
    def drive(cls, plants: Sequence[Self]) -> Drive | Own:
        """Return the actuators of the model that worlds share."""

    @property
    def timestep(self) -> float:
        """MuJoCo's step [s]."""
        return self.section.step

    @property
    def substeps(self) -> int:
        """MuJoCo's steps in a control period."""
        return round(self.period / self.timestep)

    @property
    def is_loaded(self) -> bool:
        """Whether there is a payload."""
        return self.section.payload > 0.0

    @property
    def rubs(self) -> bool:
        """Whether there is friction that no compensation includes."""
        friction = self.section.friction
        return bool(np.any(friction.coulomb) or np.any(friction.viscous))

    @property
    def has_secrets(self) -> bool:
        """Whether the arm differs from the one that computed torque assumes."""
        return self.is_loaded or self.rubs or bool(self.section.stretch)

    @property
    def gravity_apart(self) -> Array:
        """1 for joints whose `tau` excludes gravity compensation, 0 for those where it is included, (n,)."""
        return np.ones(self.arm.n)

    @property
    def shares(self) -> Hashable:
        """The common properties of worlds: besides the arm, their steps, and a body for a payload."""
        section = self.section
        return super().shares, self.timestep, section.is_compensated, self.substeps, self.is_loaded

    @classmethod
    def model(cls, plants: Sequence[Self]) -> mujoco.MjModel:
        """Return the model with the plant's actuators: see `Arm.adapted`."""
        first = plants[0]
        compensated = first.section.is_compensated
        return first.arm.adapted(cls.drive(plants), first.timestep, compensated, loaded=first.is_loaded)

    def difference(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return lengths, gravity, payload and friction of this world."""
        friction = self.section.friction
        fields = super().difference(model, wiring) | loaded_fields(model, self.section.payload)
        return fields | rubbed_fields(model, wiring.dof, friction.coulomb, friction.viscous)

    def known(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return the known differences: all except payload, friction and unknown lengths."""
        gravity = self.section.gravity
        fields = super().known(model, wiring)
        return fields if gravity is None else fields | {"opt.gravity": np.array(gravity)}

    def write(self, world: np.void) -> None:
        """Write the wrench, the actuators' limits, and the joints whose gravity they do not compensate."""
        world["wrench"], world["torque_limit"][: self.arm.n] = self.section.wrench, self.arm.torque_limit
        world["gravity_apart"][: self.arm.n] = self.gravity_apart

    def assumed(self) -> Iterator[Assumed]:
        """Yield actuators that it replaces, and options and gravity that differ from the model's."""
        model, section = self.arm.model, self.section
        for kind, names in self._replaced().items():
            text = f"{self.drives[0]} take the place of {kind} actuators: {listed(names)}"
            yield Assumed(text, kind != self.drives[1])
        integrator = mujoco.mjtIntegrator(model.opt.integrator)
        if integrator != mujoco.mjtIntegrator.mjINT_IMPLICITFAST:
            name = integrator.name.removeprefix("mjINT_")
            yield Assumed(
                f"integrator implicitfast instead of the model's {name}",
                integrator != mujoco.mjtIntegrator.mjINT_EULER,  # the integrator of a model that names none
            )
        if model.opt.timestep != self.timestep:
            text = f"timestep {self.timestep:g} s instead of the model's {model.opt.timestep:g} s"
            yield Assumed(text, model.opt.timestep != _UNSAID_TIMESTEP)
        if section.is_compensated and not self.arm.is_balanced:
            yield Assumed("gravity compensation of the arm, which the model does not have", False)

    def _replaced(self) -> dict[str, list[str]]:
        """Return names of the model's actuators that it replaces, by their kind."""
        found = dict[str, list[str]]()
        for one in actuators(self.arm):
            if one.is_replaced:
                found.setdefault(one.kind, []).append(one.name)
        return found

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield friction that an option of the model disables."""
        option, friction = self.arm.model.opt, self.section.friction
        for name, flag in _LEFT_OUT.items():
            if np.any(getattr(friction, name)) and option.disableflags & flag:
                yield (
                    f"plant.friction.{name}",
                    f"an option of {self.arm.path} disables it; remove the option, or leave this key out",
                )

    def excesses(self, ticks: int) -> Iterator[tuple[str, str]]:
        """Yield misfits of the steps of a run of this many control ticks."""
        timestep, steps = self.timestep, ticks * float(self.substeps)
        if steps > MOST_STEPS:
            yield (
                "plant.timestep",
                f"makes up to {steps:.6g} steps of {timestep:g} s, more than {MOST_STEPS:g}; raise it, "
                "shorten target.path or lower control.slow.longest",
            )
        elif timestep < _SHORTEST_STEP:
            yield "plant.timestep", f"must be >= {_SHORTEST_STEP:g} s, got {timestep:g} s"
