"""An MJCF file becomes an arm."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from rmrc.arm.arm import Arm
from rmrc.arm.limits import position_limit, rate_limit, torque_limit
from rmrc.arm.wiring import SLIDE, find_chain, find_site, find_travels
from rmrc.errors import ModelError, did_you_mean

# A NaN in an MJCF file compiles without an error, so these are looked at.
MUST_BE_FINITE = ("body_pos", "body_quat", "body_mass", "body_inertia", "jnt_axis", "jnt_pos",
                  "jnt_range", "site_pos", "site_quat", "qpos0", "dof_damping", "dof_armature")  # fmt: skip


def load(path: Path, site: str | None = None, joints: Sequence[str] | None = None) -> Arm:
    """Read an MJCF file and find the arm in it.

    Args:
        path: The file.
        site: Name of the site to control; None for the one that the most joints move, the last of several, of
            those on a chain of hinges, slides and screws.
        joints: Names of the joints to drive, all on the chain to the site; None for all of them.

    Raises:
        ModelError: The file, the site or a joint is missing or will not do.
    """
    if not path.is_file():
        raise ModelError(f"{path}: no such model file{did_you_mean(path.name, _siblings(path))}")
    quiet_log()
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f"{path}: {one_line(error)}") from None
    for field in MUST_BE_FINITE:
        if not np.isfinite(getattr(model, field)).all():
            raise ModelError(f"{path}: {field} is not finite everywhere; look for nan or inf in the file")
    site = find_site(path, model, site)
    chain = find_chain(path, model, site)
    travels = find_travels(path, model, chain)
    own = [name for name in chain if name not in travels]
    names = tuple(own) if joints is None else tuple(joints)
    for name in names:
        if name in travels:
            raise ModelError(
                f'{path}: joint "{name}" follows "{own[travels[name].hinge]}" by an equality; drive that one',
                "joints",
            )
        if name not in own:
            raise ModelError(
                f'{path}: no hinge or slide joint "{name}" on the chain to site "{site}"'
                f"{did_you_mean(name, own)}; the chain: {', '.join(own)}",
                "joints",
            )
    outward = [name for name in own if name in names]
    if outward != list(names):
        raise ModelError(
            f"{path}: joints must be listed once each, from the world outward, got [{', '.join(names)}]; "
            f"write [{', '.join(outward)}]",
            "joints",
        )
    followed = tuple(
        replace(travel, hinge=names.index(own[travel.hinge]))
        for travel in travels.values()
        if own[travel.hinge] in names
    )
    joint = np.array([model.joint(name).id for name in names])
    return Arm(
        path=path,
        site=site,
        joints=names,
        is_slide=model.jnt_type[joint] == SLIDE,
        travels=followed,
        position_limit=position_limit(model, names, followed),
        rate_limit=np.array([rate_limit(model, i) for i in joint]),
        torque_limit=np.array([torque_limit(model, i) for i in joint]),
        keyframes={
            name: np.array(model.key(i).qpos) for i in range(model.nkey) if (name := model.key(i).name)
        },
        model=model,
        _spec=spec,
    )


def files(path: Path) -> list[Path]:
    """Return an MJCF file and every file that it depends on: what it includes, meshes, textures.

    Args:
        path: The file, absolute.

    Returns:
        Those that are there; the file alone if it cannot be read as MJCF, which `load` then tells.
    """
    quiet_log()
    try:
        found = set(mujoco.mju_getXMLDependencies(str(path)))
        # which looks for height fields beside the model, where the compiler does not
        spec = mujoco.MjSpec.from_file(str(path))
        found |= {os.path.normpath(path.parent / spec.meshdir / field.file) for field in spec.hfields}
    except (ValueError, mujoco.FatalError):
        found = set()
    return sorted(file for file in {path, *map(Path, found)} if file.is_file())


def quiet_log() -> None:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT into the user's directory; we read its counters."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.logto_console = False
    config.set()


def one_line(error: Exception) -> str:
    """Return a foreign error's text on one line."""
    return " ".join(str(error).split())


def _siblings(path: Path) -> list[str]:
    return [p.name for p in path.parent.glob("*.xml")] if path.parent.is_dir() else []
