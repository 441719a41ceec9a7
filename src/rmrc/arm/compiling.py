"""MuJoCo's compiler with this package's messages: errors of one line, warnings that Python can filter."""

import threading
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import mujoco

from rmrc.arm import meshes, names, numbers, urdf
from rmrc.arm.bounds import MOST_MEMORY, bounded_memory, check_model, check_spec
from rmrc.arm.scan import check_file
from rmrc.support.errors import ModelError, ModelWarning

# MuJoCo's messages about a lack of memory: its own, and that of an exception that its bindings do not know.
_NO_MEMORY = ("allocate", "unknown exception")
# Remedies for messages of MuJoCo that name none.
_WAYS_OUT = {
    "opening file": "put it there, or correct meshdir, texturedir or assetdir of <compiler>",
    "'mujocoinclude'": "it is a fragment; give the file that includes it",
}


class Read(NamedTuple):
    """A model as it was read.

    Attributes:
        spec: Its specification.
        model: The compiled model.
        velocity: The largest rate of each joint that has one, by its name: a URDF's.
        notes: Assumptions.
    """

    spec: mujoco.MjSpec
    model: mujoco.MjModel
    velocity: Mapping[str, float]
    notes: tuple[str, ...]


def read(path: Path, packages: Mapping[str, Path] | None = None) -> Read:
    """Return an MJCF or URDF file as a specification and as a compiled model.

    Args:
        path: The file.
        packages: Folders of a URDF's packages, by their names.

    Raises:
        ModelError: It cannot be read, MuJoCo refuses it, it asks for more than a model may have, a name has a
            control character, or a number is not finite.
    """
    try:
        check_file(path)
        text = urdf.read(path, packages or {}) if urdf.is_urdf(path) else None
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None
    quiet_log()
    with in_our_words(path) as heard:
        spec, notes = parsed(path, text)
        check_spec(path, spec)
        try:
            model = spec.compile()
        except ValueError:
            spec, notes = parsed(path, text, only_readable=True)
            model = spec.compile()
    check_model(path, model)
    names.check(path, model)
    numbers.check(path, model)
    _pass_on(path, heard)
    return Read(spec, model, text.velocity if text else {}, notes)


def parsed(
    path: Path, text: urdf.Urdf | None, only_readable: bool = False
) -> tuple[mujoco.MjSpec, tuple[str, ...]]:
    """Return a file as MuJoCo parses it, and the assumptions.

    Args:
        path: The file.
        text: Text of a URDF; None for MJCF.
        only_readable: Whether to leave out meshes that MuJoCo cannot read, if the arm moves alike without
            them.
    """
    spec = mujoco.MjSpec.from_string(text.text) if text else mujoco.MjSpec.from_file(str(path))
    notes = list(text.notes) if text else []
    if only_readable:
        notes += meshes.drop_unreadable(spec, contacts=text is not None)
    if text:
        notes += urdf.mend(spec)
    return spec, tuple(notes)


def compiled(path: Path, spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Return the model of a changed specification.

    Args:
        path: Path of the original file.
        spec: The changed specification.

    Raises:
        ModelError: MuJoCo refuses it.
    """
    with in_our_words(path) as heard:
        model = spec.compile()
    _pass_on(path, heard)
    return model


def quiet_log() -> None:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT into the user's directory; its counters are read instead."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.logto_console = False
    config.set()


# What hears the warnings is of the whole process: one thread at a time.
_hearing = threading.RLock()


@contextmanager
def in_our_words(path: Path) -> Iterator[list[warnings.WarningMessage]]:
    """Yield the warnings that come, if the caller continues; an error is reported alone."""
    with _hearing, warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            with bounded_memory():
                yield heard
        except ModelError:
            raise
        except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
            raise ModelError(f"{path}: {_told(error)}") from None


def _pass_on(path: Path, heard: list[warnings.WarningMessage]) -> None:
    for warning in dict.fromkeys(_one_line(each.message) for each in heard):
        warnings.warn(f"{path}: {warning}", ModelWarning, stacklevel=4)


def _told(error: Exception) -> str:
    if isinstance(error, MemoryError) or any(words in str(error) for words in _NO_MEMORY):
        most = f"{MOST_MEMORY / 2**30:g} GiB"
        return f"must compile within {most} of memory; make its sizes, grids, meshes or textures smaller"
    told = _one_line(error)
    return "; ".join([told, *(way for words, way in _WAYS_OUT.items() if words in told)])


def _one_line(said: Exception | Warning | str) -> str:
    return " ".join(str(said).split())
