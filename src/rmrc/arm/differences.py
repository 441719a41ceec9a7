"""Fields in which one world differs from the model that it shares with others."""

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rmrc.arm.wiring import find
from rmrc.support.errors import ModelError

Array = NDArray[np.float64]

# The body that carries the payload; only a model adapted for a payload has it.
PAYLOAD = "rmrc:payload"
# Lengths of arms are meters; squares and products of such factors are finite, also as MuJoCo's floats.
_STRETCH = 1e-6, 1e6


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
        body, (least, most) = find(path, model, "body", name, about), _STRETCH
        why = ""
        if (model.geom_bodyid[collides] == body).any():
            why = "a mesh of it collides; let simpler geometries collide, or stretch other bodies"
        elif not least <= factor <= most:
            why = f"the factor must be between {least:g} and {most:g}, got {factor:g}"
        elif (model.eq_type <= int(mujoco.mjtEq.mjEQ_WELD)).any():  # the model keeps their points as numbers
            why = "an equality holds points of bodies; remove it, or write the lengths into the model"
        if why:
            raise ModelError(f'{path}: body "{name}" cannot be stretched: {why}', about)
