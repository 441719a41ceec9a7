"""Bounds on the resources of a model: memory, time, and the size of its state."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

from rmrc.support.errors import ModelError

if sys.platform != "win32":
    import resource

# Memory that a model may take to be read and compiled, beyond that of the process. Of some 240 published
# models the largest takes 3.4 GB, and never touches nearly all of it.
MOST_MEMORY = 2**32

# Steps of a solver, and of the search for an actuator's range of lengths, which takes 1000 by itself.
_MOST_ITERATIONS, _MOST_STEPS = 10_000, 100_000
# Numbers in a state beside joints and bodies: 80 MB.
_MOST_NUMBERS = 10_000_000
_EXTRA = ("nuserdata", "nsensordata", "na", "nhistory", "npluginstate")


@contextmanager
def bounded_memory(most: int = MOST_MEMORY) -> Iterator[None]:
    """Limit the additional memory of this process: MuJoCo then raises an error, and nothing is killed.

    It works only on systems that report the memory of a process, such as Linux.
    """
    try:
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        soft, hard = resource.getrlimit(resource.RLIMIT_AS)
        limits = [limit for limit in (soft, hard, taken + most) if limit != resource.RLIM_INFINITY]
        resource.setrlimit(resource.RLIMIT_AS, (min(limits), hard))
    except (OSError, NameError, ValueError):
        yield
        return
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def check_spec(path: Path, spec: mujoco.MjSpec) -> None:
    """Refuse settings with which compiling would take practically forever.

    Raises:
        ModelError: MuJoCo would look for lengths of actuators in too many steps.
    """
    search = spec.compiler.LRopt
    steps = search.inttotal / search.timestep if search.timestep > 0.0 else float("inf")
    if not steps <= _MOST_STEPS:
        raise ModelError(
            f"{path}: compiler lengthrange: inttotal / timestep must be {_MOST_STEPS} steps at most, "
            f"got {search.inttotal:g} / {search.timestep:g}"
        )


def check_model(path: Path, model: mujoco.MjModel) -> None:
    """Refuse a model whose states are too large or whose steps are too long.

    Raises:
        ModelError: A state has too many numbers, or a solver too many iterations.
    """
    for name in _EXTRA:
        number = int(getattr(model, name))
        if number > _MOST_NUMBERS:
            raise ModelError(f"{path}: must have {_MOST_NUMBERS} numbers of {name} at most, got {number}")
    for name in ("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations"):
        number = int(getattr(model.opt, name))
        if number > _MOST_ITERATIONS:
            raise ModelError(f"{path}: option {name} must be <= {_MOST_ITERATIONS}, got {number}")
