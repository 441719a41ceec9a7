"""Reading and compiling a model in bounded memory: errors of one line, warnings that Python can filter."""

import sys
import threading
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import mujoco

from rmrc.arm import urdf
from rmrc.arm.urdf import POINTER, check_file
from rmrc.support.errors import ModelError, ModelWarning
from rmrc.support.text import listed

if sys.platform != "win32":
    import resource

# Memory that a model may take to be read and compiled, beyond that of the process. Of some 240 published
# models the largest takes 3.4 GB, and never touches nearly all of it.
MOST_MEMORY = 2**32
_BOUND = f"a model must compile within {MOST_MEMORY / 2**30:g} GiB of memory"
# Messages of MuJoCo for which it names no remedy.
_REMEDIES = {
    "allocate": _BOUND,
    "unknown exception": _BOUND,
    "could not find decoder": "give MJCF the ending .xml",
    "opening file": "put it there, or correct meshdir, texturedir or assetdir of <compiler>",
    "'mujocoinclude'": "it is a fragment; give the file that includes it",
}


class Read(NamedTuple):
    """A model as it was read.

    Attributes:
        spec: Its specification; None of a compiled model.
        model: The compiled model.
        robot: The contents of its file, if that is a URDF.
        notes: Assumptions.
    """

    spec: Any
    model: mujoco.MjModel
    robot: urdf.Urdf | None
    notes: tuple[str, ...]


def read(path: Path, packages: Mapping[str, Path] | None = None) -> Read:
    """Return an MJCF or URDF file as a specification and as a compiled model.

    Meshes of a URDF that MuJoCo cannot read are left out, and masses that it refuses are raised.

    Args:
        path: The file.
        packages: Folders of a URDF's packages, by their names.

    Raises:
        ModelError: It cannot be read, it asks for more than a model may have, or MuJoCo refuses it.
    """
    with in_our_words(path):
        robot = opened(path, packages)
        if robot is None:
            try:
                spec = mujoco.MjSpec.from_file(str(path))
                return Read(spec, spec.compile(), None, ())
            except ValueError:
                if lines := _pointers(mujoco.mju_getXMLDependencies(str(path))):
                    raise ModelError(f"{path}: {lines[0]}") from None
                raise
        failure = ValueError()
        for repairs in range(3):  # parsed anew, because a specification that failed keeps its error
            spec, notes = mujoco.MjSpec.from_string(robot.text), [*robot.notes]
            notes += _drop_unreadable(spec) + _pointers(robot.meshes) if repairs > 0 else []
            notes += urdf.bound_masses(spec, failure) if repairs > 1 else []
            urdf.hide_collisions(spec)
            try:
                return Read(spec, spec.compile(), robot, tuple(notes))
            except ValueError as error:
                failure = error
        raise failure


def opened(path: Path, packages: Mapping[str, Path] | None) -> urdf.Urdf | None:
    """Return the contents of a URDF file; None for MJCF. MuJoCo can then read it safely.

    Raises:
        ModelError: See `read`.
        OSError: It cannot be read.
    """
    root, _ = check_file(path)
    robot = urdf.read(path, root, packages or {}) if root.tag == "robot" else None
    text = str(path) if robot is None else robot.text
    if text.encode(errors="replace").decode() != text:
        raise ModelError(f"{path}: must have a path in UTF-8, as MuJoCo reads no other; rename the folder")
    return robot


def _drop_unreadable(spec: mujoco.MjSpec) -> list[str]:
    """Remove meshes whose file is missing or cannot be decoded, with their geoms; return notes about them."""
    bodies: dict[str, list[str]] = {"is drawn": [], "collides": []}
    for mesh in [mesh for mesh in spec.meshes if not _is_readable(spec, mesh)]:
        for geom in [geom for geom in spec.geoms if geom.meshname == mesh.name]:
            bodies["collides" if geom.contype or geom.conaffinity else "is drawn"].append(geom.parent.name)
            spec.delete(geom)
        spec.delete(mesh)
    why = "without a missing mesh, or one in a format that MuJoCo cannot read"
    return [f"body {listed(dict.fromkeys(names))} {does} {why}" for does, names in bodies.items() if names]


def _pointers(files: Iterable[str | Path]) -> list[str]:
    """Return a note about files that only stand for those that Git LFS would fetch."""
    present = [path for path in map(Path, files) if path.is_file()]
    names = [path.name for path in present if path.read_bytes().startswith(POINTER.encode())]
    return [f"only pointers of Git LFS: {listed(names)}; run `git lfs pull` there"] if names else []


def _is_readable(spec: mujoco.MjSpec, mesh: mujoco.MjsMesh) -> bool:
    """Return whether MuJoCo can compile a mesh by itself."""
    alone = mujoco.MjSpec()
    alone.modelfiledir, alone.meshdir = spec.modelfiledir, mesh.compiler.meshdir
    alone.add_mesh(name="mesh", file=mesh.file, scale=mesh.scale, content_type=mesh.content_type)
    geom = alone.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh", density=0.0)
    geom.contype = geom.conaffinity = 0
    try:
        alone.compile()
    except ValueError:
        return False
    return True


def compiled(path: Path, spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Return the model of a changed specification.

    Args:
        path: Path of the original file.
        spec: The changed specification.

    Raises:
        ModelError: MuJoCo refuses it.
    """
    with in_our_words(path):
        return spec.compile()


# What hears the warnings is of the whole process, as are limits of memory: one thread at a time.
_hearing = threading.RLock()


@contextmanager
def in_our_words(path: Path) -> Iterator[None]:
    """Report an error of MuJoCo in one line, or else its warnings; keep it from writing MUJOCO_LOG.TXT.

    Raises:
        ModelError: It refuses the model, or the file cannot be read.
    """
    config = mujoco.MjLogConfig.get()
    config.logto_file = config.logto_console = False
    config.set()
    with _hearing, warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            with bounded_memory():
                yield
        except ModelError:
            raise
        except OSError as error:
            raise ModelError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None
        except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
            text = " ".join(str(error).split()) or "could not allocate memory"
            ways = (way for words, way in _REMEDIES.items() if words in text)
            raise ModelError("; ".join([f"{path}: {text}", *ways])) from None
    for warning in dict.fromkeys(" ".join(str(each.message).split()) for each in heard):
        warnings.warn(f"{path}: {warning}", ModelWarning, stacklevel=4)


@contextmanager
def bounded_memory(most: int = MOST_MEMORY) -> Iterator[None]:
    """Limit the additional memory of this process: MuJoCo then raises an error, and nothing is killed.

    It works only on systems that report the memory of a process, such as Linux.
    """
    try:
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except (NameError, OSError):
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    limits = [limit for limit in (soft, hard, taken + most) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_AS, (min(limits), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
