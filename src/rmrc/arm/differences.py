"""Fields in which one world differs from the model that it shares with others."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.support.errors import ModelError, did_you_mean
from rmrc.support.legible import listed

Array = NDArray[np.float64]

# The body that carries the payload; only a model adapted for a payload has it.
PAYLOAD = "rmrc:payload"

# MuJoCo computes quantities derived from these, such as a subtree's mass, only on request. If a stretched
# body carries no other body, no `body_pos` changes, but its inertia does.
NEED_CONSTANTS = frozenset(
    {"body_mass", "body_pos", "body_ipos", "body_inertia", "jnt_pos", "site_pos", "cam_pos", "light_pos"}
    | {"geom_pos", "geom_size", "geom_aabb"}
)

# Equalities that hold points or frames of bodies, which the model keeps as numbers of its own.
_HOLDS_POINTS = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))


def set_fields(model: mujoco.MjModel, fields: Mapping[str, Array]) -> None:
    """Set fields of a model, and what MuJoCo derives from them.

    Args:
        model: The model.
        fields: The new values, whole, by their names in MuJoCo, or "opt.gravity".
    """
    for name, values in fields.items():
        (model.opt.gravity if name == "opt.gravity" else getattr(model, name))[...] = values
    if not NEED_CONSTANTS.isdisjoint(fields):
        mujoco.mj_setConst(model, mujoco.MjData(model))


def loaded_fields(model: mujoco.MjModel, payload: float) -> dict[str, Array]:
    """Return the fields of a model that carries a payload, whole, by their names in MuJoCo.

    Args:
        model: A model with a body for the payload, unless the payload is 0.
        payload: Point mass at the controlled site [kg].
    """
    if not payload:
        return {}
    mass = np.array(model.body_mass)
    mass[model.body(PAYLOAD).id] = payload
    return {"body_mass": mass}


def rubbed_fields(
    model: mujoco.MjModel,
    dofs: NDArray[np.int64],
    coulomb: float | Sequence[float],
    viscous: float | Sequence[float],
) -> dict[str, Array]:
    """Return the fields of a model whose joints have more friction, whole, by their names in MuJoCo.

    Args:
        model: A model.
        dofs: Addresses of the joints in qvel, (n,).
        coulomb: Dry friction in addition to the model's own, of all or of each [N·m or N].
        viscous: Damping in addition to the model's own, of all or of each [N·m·s/rad or N·s/m].
    """
    fields = {}
    for name, more in (("dof_frictionloss", coulomb), ("dof_damping", viscous)):
        if np.any(more):
            fields[name] = np.array(getattr(model, name))
            fields[name][dofs] += more
    return fields


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
    of_geom, of_site = factor[model.geom_bodyid], factor[model.site_bodyid]
    return {
        "body_pos": model.body_pos * factor[model.body_parentid][:, None],
        "body_ipos": model.body_ipos * factor[:, None],
        "body_inertia": model.body_inertia * factor[:, None] ** 2,
        "jnt_pos": model.jnt_pos * factor[model.jnt_bodyid][:, None],
        "site_pos": model.site_pos * of_site[:, None],
        "site_size": model.site_size * of_site[:, None],
        "geom_pos": model.geom_pos * of_geom[:, None],
        "geom_size": model.geom_size * of_geom[:, None],
        "geom_rbound": model.geom_rbound * of_geom,
        "geom_aabb": model.geom_aabb * of_geom[:, None],
        "cam_pos": model.cam_pos * factor[model.cam_bodyid][:, None],
        "light_pos": model.light_pos * factor[model.light_bodyid][:, None],
    }


# Lengths of arms are meters; squares and products of such factors are finite, also as MuJoCo's floats.
_STRETCH = 1e-6, 1e6


def check_stretch(path: Path, model: mujoco.MjModel, stretch: Mapping[str, float]) -> None:
    """Refuse bodies that cannot be stretched.

    Raises:
        ModelError: No such body; a factor beyond reason; parts whose size is not one of their own numbers.
    """
    bodies = [name for b in range(1, model.nbody) if (name := model.body(b).name)]
    for name in stretch:
        if name not in bodies:
            hint = did_you_mean(name, bodies)
            about = (
                f"stretch.{name}" if re.fullmatch(r"[\w-]+", name) else "stretch"
            )  # otherwise it is no plain key
            raise ModelError(f'{path}: has no body "{name}"{hint}; its bodies: {listed(bodies)}', about)
        body = model.body(name).id
        collides = (model.geom_contype | model.geom_conaffinity) != 0
        if (collides & (model.geom_dataid >= 0) & (model.geom_bodyid == body)).any():
            raise ModelError(
                f'{path}: body "{name}" cannot be stretched: a mesh of it collides; '
                "let simpler geometries collide, or stretch other bodies",
                "stretch",
            )
    for name, factor in stretch.items():
        if not _STRETCH[0] <= factor <= _STRETCH[1]:
            raise ModelError(
                f'{path}: the factor of body "{name}" must be between {_STRETCH[0]:g} and {_STRETCH[1]:g}, '
                f"got {factor:g}",
                f"stretch.{name}" if re.fullmatch(r"[\w-]+", name) else "stretch",
            )
    if stretch and np.isin(model.eq_type, _HOLDS_POINTS).any():
        raise ModelError(
            f"{path}: cannot be stretched: an equality connects or welds points of its bodies; remove it, "
            "or write the lengths into the model",
            "stretch",
        )
