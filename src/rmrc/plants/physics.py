"""The common part of plants that MuJoCo steps: gravity, a payload, a wrench, and the actuators' sensors."""

import math
from collections.abc import Iterator
from typing import Any, ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm import Arm, Wiring
from rmrc.arm.actuators import kind_word
from rmrc.arm.adapting import PAYLOAD, UNSAID
from rmrc.law.compiling import Array, Record, at, compiled
from rmrc.law.kinematics import turned
from rmrc.plants.plant import Assumed, Plant
from rmrc.scenario.sections import TIMESTEP

# Resistance of joints -----------------------------------------------------------------------------
#
# Joint resistance, damping and dry friction, as the actuators compensate it.

# MuJoCo's dry friction is a force −clip(I (q̈ + b q̇), ±loss): a drag up to a creeping rate, the loss beyond.
_OF_JOINT = int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF)


@compiled
def damping_at(world: Record, j: int, rate: float) -> Any:
    """Return the damping of joint j at a rate."""
    d, size = world.plant.damping[j], abs(rate)
    return rate * (d[0] + size * (d[1] + size * d[2]))


@compiled
def friction_at(world: Record, j: int, acceleration: float, rate: float) -> Any:
    """Return the dry friction of joint j, positive against a positive rate."""
    force = world.plant.friction_inertia[j] * (acceleration + world.plant.friction_decay[j] * rate)
    return min(max(force, -world.plant.friction_loss[j]), world.plant.friction_loss[j])


def write_resistance(
    plant: np.void, model: mujoco.MjModel, wiring: Wiring, arm: Arm, compensates: bool
) -> None:
    """Write the resistance of an arm's joints into the group `plant` of a world's record.

    A follower of a joint, such as the slide of a screw, resists with its own damping and friction, by its
    ratio.

    Args:
        plant: The group.
        model: The model of the world.
        wiring: Wiring of the arm in it.
        arm: The arm.
        compensates: Whether the actuators compensate resistance.
    """
    damping = np.column_stack([model.dof_damping, model.dof_dampingpoly])
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_DAMPER:
        damping[:] = 0.0
    loss, inertia, decay = _friction(model)
    own = wiring.dof
    damping_of, loss_of, inertia_of = damping[own], loss[own], inertia[own]
    for address, one in zip(wiring.follower_dof, arm.followers, strict=True):
        ratio = abs(one.ratio)
        damping_of[one.leader] += damping[address] * ratio ** np.array([2.0, 3.0, 4.0])
        loss_of[one.leader] += ratio * loss[address]
        inertia_of[one.leader] += ratio**2 * inertia[address]
    resists = damping_of.any(axis=1) | (loss_of > 0.0)
    plant["resists"][: arm.n] = resists & compensates
    plant["damping"][: arm.n], plant["friction_loss"][: arm.n] = damping_of, loss_of
    plant["friction_inertia"][: arm.n], plant["friction_decay"][: arm.n] = inertia_of, decay[own]


def _friction(model: mujoco.MjModel) -> tuple[NDArray[np.float64], ...]:
    """Return loss, I and b of each degree of freedom, (nv,) each, by MuJoCo's definitions.

    The integrator `discrete` takes the rate at the end of its step, h q̈ later: I is so much larger.
    """
    loss, inertia, decay = np.zeros((3, model.nv))
    if model.dof_frictionloss.any():
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        rows = np.flatnonzero(data.efc_type == _OF_JOINT)
        dof = data.efc_id[rows]
        loss[dof], inertia[dof], decay[dof] = (
            data.efc_frictionloss[rows], data.efc_D[rows], data.efc_KBIP[rows, 1]
        )  # fmt: skip
        if model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
            decay /= 1.0 + model.opt.timestep * decay
    return loss, inertia, decay


# The plants ---------------------------------------------------------------------------------------

# Ten billion steps of MuJoCo take a day for a small arm on one core: more is an error of units.
MOST_STEPS = 10_000_000_000
# A step this short [s] changes no position of an arm by a bit; gains of inertia over timestep stay finite.
_SHORTEST_STEP = 1e-12
# MuJoCo's own, for a model that names none [s].
_UNSAID_TIMESTEP, _UNSAID_INTEGRATOR = 0.002, "Euler"
_INTEGRATORS = ("Euler", "RK4", "implicit", "implicitfast", "discrete")
# The largest bandwidth of motors by default [1/s].
BANDWIDTH = 500.0
# Decimal fractions such as 0.003/0.001 are off by some 1e-16.
_ROUNDING = 1e-9

# Flags of a model's option without which a kind of friction is absent.
_LEFT_OUT = {
    "coulomb": int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT),
    "viscous": int(mujoco.mjtDisableBit.mjDSBL_DAMPER),
}


@compiled
def push(world: Record) -> None:
    """Apply the site's external wrench [f; n] at its body's center of mass: n' = n + r × f.

    r, from the center to the site, is fixed to the site.
    """
    plant, pose = world.plant, world.tick.pose
    applied, f = at(world.engine.xfrc_applied, 6 * world.engine.nbody), plant.wrench
    column = 6 * world.engine.body
    rx, ry, rz = turned((pose[3], pose[4], pose[5], pose[6]), plant.lever)
    for i in range(6):
        applied[column + i] = f[i]
    applied[column + 3] += ry * f[2] - rz * f[1]
    applied[column + 4] += rz * f[0] - rx * f[2]
    applied[column + 5] += rx * f[1] - ry * f[0]


class Physical(Plant):
    """A plant with actuators, in MuJoCo's physics."""

    begins = "mj_step1"
    drives: ClassVar[tuple[str, str]]  # their name in messages, and the kind of the actuators
    drive: ClassVar[Any]  # a Drive or Own: the actuators of the model that worlds share

    @property
    def usual_timestep(self) -> float:
        """MuJoCo's step where it divides the control period [s]."""
        return TIMESTEP

    @property
    def timestep(self) -> float:
        """MuJoCo's step [s]: the scenario's, or the longest up to the usual one that divides the period."""
        if self.section.timestep is not None:
            return self.section.timestep
        usual = self.usual_timestep
        ratio = min(self.period / usual, 10.0 * MOST_STEPS)  # `excesses` refuses more
        steps = max(1, math.ceil(ratio * (1.0 - _ROUNDING)))
        return usual if abs(self.period - steps * usual) <= _ROUNDING * self.period else self.period / steps

    @property
    def substeps(self) -> int:
        """MuJoCo's steps in a control period."""
        return round(self.period / self.timestep)

    @property
    def bandwidth(self) -> float:
        """Acceleration of motors per unit rate error [1/s], by default at most what ends it in a period."""
        return self.section.bandwidth or min(BANDWIDTH, 1.0 / self.period)

    @property
    def knows_all(self) -> bool:
        """Whether the arm is the one that computed torque assumes."""
        return not (self.section.payload or self.rubs or self.section.stretch)

    def model(self) -> mujoco.MjModel:
        """Return the model with the plant's actuators: see `Arm.adapted`."""
        section = self.section
        loaded = section.payload > 0.0
        return self.arm.adapted(self.drive, self.timestep, section.is_compensated, loaded=loaded)

    def difference(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return lengths, gravity, payload and friction of this world."""
        friction, fields = self.section.friction, super().difference(model, wiring)
        if self.section.payload:
            fields["body_mass"] = np.array(model.body_mass)
            fields["body_mass"][model.body(PAYLOAD).id] = self.section.payload
        for name, more in (("dof_frictionloss", friction.coulomb), ("dof_damping", friction.viscous)):
            if np.any(more):
                fields[name] = np.array(getattr(model, name))
                fields[name][wiring.dof] += more
        return fields

    def known(self, model: mujoco.MjModel, wiring: Wiring) -> dict[str, Array]:
        """Return the known differences: all except payload, friction and unknown lengths."""
        gravity = self.section.gravity
        fields = super().known(model, wiring)
        return fields if gravity is None else fields | {"opt.gravity": np.array(gravity)}

    def write(self, world: np.void) -> None:
        """Write wrench, limits and bandwidth."""
        plant = world["plant"]
        plant["wrench"], plant["bandwidth"] = self.section.wrench, self.bandwidth
        world["limits"]["torque"][: self.arm.n] = self.arm.torque_limit

    def wire(self, world: np.void, model: mujoco.MjModel, wiring: Wiring, data: mujoco.MjData) -> list[Any]:
        """Write the lever of the wrench, the resistance of joints, and whose `tau` lacks gravity."""
        del data
        world["plant"]["gravity_apart"][: self.arm.n] = model.jnt_actgravcomp[wiring.joint] == 0
        inverse, lever = np.empty(4), np.empty(3)
        mujoco.mju_negQuat(inverse, model.site_quat[wiring.site])
        offset = model.site_pos[wiring.site] - model.body_ipos[wiring.body]
        mujoco.mju_rotVecQuat(lever, offset, inverse)
        world["plant"]["lever"] = lever * self.stretch.get(model.body(wiring.body).name, 1.0)
        write_resistance(world["plant"], model, wiring, self.arm, self.section.friction_compensation)
        return []

    def assumed(self) -> Iterator[Assumed]:
        """Yield actuators, options, stiffness of equalities, and gravity that differ from the model's."""
        yield from self.assumed_drives()
        used, written = self.model(), self.arm.model
        steps, own = (_INTEGRATORS[model.opt.integrator] for model in (used, written))
        if steps != own:
            yield Assumed(f"integrator {steps} instead of the model's {own}", own != _UNSAID_INTEGRATOR)
        softness = np.hstack([written.eq_solref, written.eq_solimp])
        stiffened = (np.hstack([used.eq_solref, used.eq_solimp]) != softness).any(axis=1)
        if stiffened.any():
            text = "equalities of followers as stiff as the timestep bears, instead of the model's"
            yield Assumed(text, bool((softness[stiffened] != UNSAID).any()))
        step, author = self.timestep, float(written.opt.timestep)
        is_chosen = self.section.timestep is None and step != self.usual_timestep
        if step != author or is_chosen:
            instead = f" instead of the model's {author:g} s" if step != author else ""
            why = f", to divide the control period of {self.period:g} s" if is_chosen else ""
            is_otherwise = is_chosen or self.drive == "own" or author != _UNSAID_TIMESTEP
            yield Assumed(f"timestep {step:g} s{instead}{why}", is_otherwise)
        compensated = [model.body_mass @ model.body_gravcomp for model in (used, written)]
        if self.section.is_compensated and written.opt.gravity.any() and not np.isclose(*compensated):
            yield Assumed("gravity compensation of the arm, which the model does not have", False)

    def assumed_drives(self) -> Iterator[Assumed]:
        """Yield the model's actuators that it replaces, by their kind."""
        kinds = {i: kind_word(self.arm.model, i) for i in sorted(self.arm.others.replaced)}
        for word in dict.fromkeys(kinds.values()):
            names = self.arm.drives.named([i for i, kind in kinds.items() if kind == word])
            text = f"{self.drives[0]} take the place of {word} actuators: {names}"
            yield Assumed(text, word != self.drives[1])

    def misfits(self) -> Iterator[tuple[str, str]]:
        """Yield friction that an option of the model disables."""
        option, friction = self.arm.model.opt, self.section.friction
        for name, flag in _LEFT_OUT.items():
            if option.disableflags & flag and np.any(getattr(friction, name)):
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
