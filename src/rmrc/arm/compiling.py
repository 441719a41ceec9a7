"""MuJoCo's compiler, which speaks in our words: errors of one line, warnings that Python can filter."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

from rmrc.arm import names, numbers
from rmrc.arm.bounds import MOST_MEMORY, bounded_memory, check_model, check_spec
from rmrc.arm.scan import check_file
from rmrc.support.errors import ModelError, ModelWarning

# How MuJoCo says that there is no memory: as itself, or of an exception that its bindings do not know.
_NO_MEMORY = ("allocate", "unknown exception")


def read(path: Path) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """Return an MJCF file as it is written and as it is compiled.

    Raises:
        ModelError: It cannot be read, MuJoCo refuses it, it asks for more than a model may have, a name has a
            control character, or a number is not finite.
    """
    try:
        check_file(path)
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None
    quiet_log()
    with in_our_words(path) as heard:
        spec = mujoco.MjSpec.from_file(str(path))
        check_spec(path, spec)
        model = spec.compile()
    check_model(path, model)
    names.check(path, model)
    numbers.check(path, model)
    _pass_on(path, heard)
    return spec, model


def compiled(path: Path, spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Return the model of a specification that was changed.

    Args:
        path: Of the file that it was.
        spec: As it is now.

    Raises:
        ModelError: MuJoCo refuses it.
    """
    with in_our_words(path) as heard:
        model = spec.compile()
    _pass_on(path, heard)
    return model


def quiet_log() -> None:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT into the user's directory; we read its counters."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.logto_console = False
    config.set()


@contextmanager
def in_our_words(path: Path) -> Iterator[list[warnings.WarningMessage]]:
    """Yield the warnings that come, for those who go on; an error is told alone."""
    with warnings.catch_warnings(record=True) as heard:
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
    return _one_line(error)


def _one_line(said: Exception | Warning | str) -> str:
    return " ".join(str(said).split())
