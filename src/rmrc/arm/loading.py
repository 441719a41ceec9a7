"""An MJCF file becomes an arm."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from rmrc.arm.arm import Arm
from rmrc.arm.bounds import bounded_memory
from rmrc.arm.compiling import quiet_log, read
from rmrc.arm.limits import position_limit, rate_limit, torque_limit
from rmrc.arm.scan import check_file
from rmrc.arm.wiring import SLIDE, find_chain, find_site, find_travels
from rmrc.support.errors import ModelError, did_you_mean
from rmrc.support.shipped import suggestion


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
        near = did_you_mean(path.name, _siblings(path)) or suggestion(path, "models")
        raise ModelError(f"{path}: no such model file{near}")
    spec, model = read(path)
    site = find_site(path, model, site)
    chain = find_chain(path, model, site)
    travels = find_travels(path, model, chain)
    own = [name for name in chain if name not in travels]
    driven = tuple(own) if joints is None else tuple(joints)
    for name in driven:
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
    outward = [name for name in own if name in driven]
    if outward != list(driven):
        raise ModelError(
            f"{path}: joints must be listed once each, from the world outward, got [{', '.join(driven)}]; "
            f"write [{', '.join(outward)}]",
            "joints",
        )
    followed = tuple(
        replace(travel, hinge=driven.index(own[travel.hinge]))
        for travel in travels.values()
        if own[travel.hinge] in driven
    )
    joint = np.array([model.joint(name).id for name in driven])
    return Arm(
        path=path,
        site=site,
        joints=driven,
        is_slide=model.jnt_type[joint] == SLIDE,
        travels=followed,
        position_limit=position_limit(model, driven, followed),
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
        check_file(path)
        with bounded_memory():
            found = set(mujoco.mju_getXMLDependencies(str(path)))
            # which looks for height fields beside the model, where the compiler does not
            spec = mujoco.MjSpec.from_file(str(path))
        found |= {os.path.normpath(path.parent / spec.meshdir / field.file) for field in spec.hfields}
    except (ValueError, RuntimeError, MemoryError, OSError, mujoco.FatalError):
        found = set()
    return sorted(file for file in {path, *map(Path, found)} if file.is_file())


def _siblings(path: Path) -> list[str]:
    return [p.name for p in path.parent.glob("*.xml")] if path.parent.is_dir() else []
