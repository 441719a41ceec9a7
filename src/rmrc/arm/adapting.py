"""The model as a plant needs it: the author's, with actuators on the arm's joints and other joints locked.

Actuators that also act on other joints stay, before the added ones, in their order. The author's defaults for
actuators do not apply to the added ones: a control of 1 is 1 rad/s or N·m. Controls are not clamped here,
because the law limits the rates; torque limits are kept. Other joints that no actuator holds are locked,
unless `frees_others`. Sensors are left out, as nothing reads them. The integrator is `implicitfast`, because
servos stiff enough for tracking are unstable under Euler. If joints follow others, it is `discrete`, also for
the author's own actuators, and the equalities that hold the followers are as stiff as the timestep bears; for
own actuators, where he wrote no softness.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.compiling import compiled, in_our_words
from rmrc.arm.wiring import DRIVES_JOINT, find, soft_bodies
from rmrc.support.errors import ModelError

Array = NDArray[np.float64]

# The body that carries the payload; only a model adapted for a payload has it.
PAYLOAD = "rmrc:payload"
# Lengths of arms are meters; squares and products of such factors are finite, also as MuJoCo's floats.
_STRETCH = 1e-6, 1e6
# What makes an actuator the one of a joint; the author's own actuators; none.
Drive: TypeAlias = Callable[[mujoco.MjsActuator], None] | Literal["own"] | None

# MuJoCo's own softness of an equality: solref and solimp where its author wrote none.
UNSAID = (0.02, 1.0, 0.9, 0.95, 0.001, 0.5, 2.0)
# The time constant of a stiff one [timestep], of which the integrator `discrete` bears any: with this one, a
# gap is gone after a step. And its impedance, the largest that MuJoCo takes.
_STEPS, _IMPEDANCE = 0.1, 0.9999


def adapted(
    arm: Any, spec: mujoco.MjSpec, drive: Drive, timestep: float, gravity_compensation: bool, loaded: bool
) -> mujoco.MjModel:
    """Return a model for a plant.

    Args:
        arm: The `rmrc.arm.Arm`.
        spec: Its specification, changed.
        drive: This and the other arguments are as in `Arm.adapted`.
        timestep: MuJoCo's step [s].
        gravity_compensation: Whether the weight of the arm's bodies is compensated.
        loaded: Whether a body for a payload is added.
    """
    locks = drive is not None and not arm.frees_others and bool(arm.others.locked)
    with in_our_words(arm.path):  # a specification refuses some errors before it is compiled
        if locks:
            arm.others.lock(spec, arm.path)
        if drive != "own":
            _replace_actuators(arm, spec, drive)
        # controls of keyframes no longer fit, and nothing reads sensors, whose actuators may be gone
        for element in [*spec.keys, *spec.sensors]:
            spec.delete(element)
        if gravity_compensation:
            carried = is_behind(arm.model, int(arm.model.jnt_bodyid[arm.wiring.joint[0]]))
            carried[list(soft_bodies(arm.model))] = False
            for body in (body for body in spec.bodies if carried[body.id]):
                body.gravcomp = 1.0
        if loaded:  # after this, nothing in the specification has its id
            site = spec.site(arm.site)
            site.parent.add_body(name=PAYLOAD, pos=site.pos, ipos=[0.0, 0.0, 0.0], explicitinertial=True)
            spec.compiler.fusestatic = False  # otherwise it would merge into the body that carries it
    _set_options(arm, spec, drive, timestep)
    model = compiled(arm.path, spec)
    if locks:  # MuJoCo's solver uses it to decide when to stop
        model.stat.meaninertia = arm.model.stat.meaninertia
    return model


def _set_options(arm: Any, spec: mujoco.MjSpec, drive: Drive, timestep: float) -> None:
    """Set timestep, integrator and flags, and have followers stay with their leaders.

    Servos and dampers are taken implicitly. The other integrators add their inertia after the equalities
    are solved, which then answer forces that never come: followers slip, and the arm chatters.
    """
    option, flags, integrators = spec.option, mujoco.mjtDisableBit, mujoco.mjtIntegrator
    option.timestep = timestep
    option.disableflags |= flags.mjDSBL_AUTORESET | flags.mjDSBL_SENSOR
    option.disableflags |= flags.mjDSBL_CONSTRAINT if drive is None else 0
    if drive is None or not arm.followers:
        option.integrator = option.integrator if drive == "own" else integrators.mjINT_IMPLICITFAST
        return
    option.integrator, names = integrators.mjINT_DISCRETE, [each.name for each in arm.followers]
    for equality in (each for each in spec.equalities if each.type == mujoco.mjtEq.mjEQ_JOINT):
        if equality.name1 in names and (drive != "own" or (*equality.solref, *equality.solimp) == UNSAID):
            equality.solref, equality.solimp[:2] = [_STEPS * timestep, 1.0], _IMPEDANCE


def _replace_actuators(arm: Any, spec: mujoco.MjSpec, drive: Drive) -> None:
    """Remove the actuators of the arm, and add those of a plant."""
    for actuator in spec.actuators:
        actuator.delay, actuator.nsample = 0.0, 0  # the delay of a constant control does not matter
    for actuator in [each for each in spec.actuators if each.id in arm.others.replaced]:
        spec.delete(actuator)  # chosen before, as ids change with every deletion
    if drive is None or drive == "own":
        return
    plain = mujoco.MjSpec()  # of the defaults of MuJoCo, not of the author
    for joint, limit in zip(arm.joints, arm.torque_limit, strict=True):
        actuator = spec.add_actuator(plain.default, f"rate:{joint}", target=joint, trntype=DRIVES_JOINT)
        drive(actuator)
        if np.isfinite(limit):
            actuator.forcelimited, actuator.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, [-limit, limit]


def without_textures(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Return a copy without textures, which take nearly all of a model's memory and time to compile."""
    spec = spec.copy()
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in list(spec.textures):
        spec.delete(texture)
    return spec


def is_behind(model: mujoco.MjModel, root: int) -> NDArray[np.bool_]:
    """Return which bodies are a body or hang on it, (nbody,)."""
    behind = np.arange(model.nbody) == root
    for body in range(root + 1, model.nbody):  # children come after their parents
        behind[body] = behind[model.body_parentid[body]]
    return np.asarray(behind)


# Fields in which one world differs from the model that it shares with others ---------------------


def set_fields(model: mujoco.MjModel, fields: Mapping[str, Array]) -> None:
    """Set fields of a model, and what MuJoCo derives from them, such as a subtree's mass.

    Args:
        model: The model.
        fields: The new values, whole, by their names in MuJoCo, or "opt.gravity".
    """
    for name, values in fields.items():
        (model.opt.gravity if name == "opt.gravity" else getattr(model, name))[...] = values
    if "body_mass" in fields or "body_pos" in fields:  # a payload, or stretched bodies
        mujoco.mj_setConst(model, mujoco.MjData(model))


def stretched_fields(model: mujoco.MjModel, stretch: Mapping[str, float]) -> dict[str, Array]:
    """Return the fields of a model with some larger bodies, whole, by their names in MuJoCo.

    For a body with factor f, all lengths about its frame's origin are multiplied by f: positions of bodies,
    sites, joints and geoms on it, and sizes of geoms. Its mass stays, so its inertia is multiplied by f².

    Args:
        model: A model.
        stretch: Factor of each body, by its name.
    """
    if not stretch:
        return {}
    factor = np.ones(model.nbody)
    for name, value in stretch.items():
        factor[model.body(name).id] = value
    of_site, of_geom = factor[model.site_bodyid], factor[model.geom_bodyid]
    factors = {
        "body_pos": factor[model.body_parentid], "body_ipos": factor, "body_inertia": factor**2,
        "jnt_pos": factor[model.jnt_bodyid], "site_pos": of_site, "site_size": of_site, "geom_pos": of_geom,
        "geom_size": of_geom, "geom_rbound": of_geom, "geom_aabb": of_geom,
        "cam_pos": factor[model.cam_bodyid], "light_pos": factor[model.light_bodyid],
    }  # fmt: skip
    return {name: (getattr(model, name).T * values).T for name, values in factors.items()}


def check_stretch(path: Path, model: mujoco.MjModel, stretch: Mapping[str, float]) -> None:
    """Refuse bodies that cannot be stretched.

    Raises:
        ModelError: No such body; a factor beyond reason; parts whose size is not one of their own numbers.
    """
    collides = ((model.geom_contype | model.geom_conaffinity) != 0) & (model.geom_dataid >= 0)
    for name, factor in stretch.items():
        about = f"stretch.{name}" if name.replace("-", "_").isidentifier() else "stretch"
        body, (least, most), why = find(path, model, "body", name, about), _STRETCH, ""
        if (model.geom_bodyid[collides] == body).any():
            why = "a mesh of it collides; let simpler geometries collide, or stretch other bodies"
        elif not least <= factor <= most:
            why = f"the factor must be between {least:g} and {most:g}, got {factor:g}"
        elif (model.eq_type <= int(mujoco.mjtEq.mjEQ_WELD)).any():  # the model keeps their points as numbers
            why = "an equality holds points of bodies; remove it, or write the lengths into the model"
        if why:
            raise ModelError(f'{path}: body "{name}" cannot be stretched: {why}', about)
