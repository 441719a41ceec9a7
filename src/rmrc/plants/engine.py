"""MuJoCo's C functions at their addresses, for compiled code, and the guard in which that code runs.

Compiled code calls MuJoCo itself, on the data of its own world. Called bare, an error of the engine, such as
a full stack, would end the process. `mjb_apply` runs a C function under MuJoCo's own guard: an error ends the
function, and MuJoCo reports its message.

The record of a world has the addresses of arrays: fields of MuJoCo's data, and tables.
"""

import ctypes
import threading
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from rmrc.law.compiling import Array, Record, at, carray, compiled, pointer
from rmrc.support import process

_POINTER, _INT, _TEXT, _FLAG = ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_bool
_NOTHING = "<mujoco/>"
# Warnings about a state that is not finite, or too large.
BAD_FIRST, BAD_LAST = int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC)


class _Config(ctypes.Structure):
    _fields_ = (("nthread", _INT), ("persistent", _FLAG))


@cache
def _library() -> ctypes.CDLL:
    """Return MuJoCo's library, which the Python package has loaded."""
    names = ("libmujoco*.so*", "libmujoco*.dylib", "mujoco.dll")
    folder = Path(mujoco.__file__).parent
    found = ctypes.CDLL(str(next(file for name in names for file in sorted(folder.glob(name)))))
    for name, result, arguments in (
        ("mjb_makeBatch", _POINTER, [_POINTER, _INT, _POINTER, _TEXT, _INT]),
        ("mjb_apply", _INT, [_POINTER, _POINTER, _INT, _POINTER, _POINTER, _FLAG]),
        ("mjb_error", _TEXT, [_POINTER, _INT]),
    ):
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    if process.ends_with_job:
        # Nothing here reads MuJoCo's timers, which take a fifth of a step; other processes keep them.
        _POINTER.in_dll(found, "mjcb_time").value = None
    return found


@cache
def address(function: str) -> int:
    """Return the address of one of MuJoCo's functions."""
    return int(ctypes.cast(getattr(_library(), function), _POINTER).value or 0)


def address_of(struct: mujoco.MjModel | mujoco.MjData) -> int:
    """Return the address of a model or of data in C."""
    return int(struct._address)


class _Guards(threading.local):
    """A batch of one simulation of nothing, for each thread: MuJoCo guards what it applies to it."""

    def __init__(self) -> None:
        self._model = mujoco.MjModel.from_xml_string(_NOTHING)
        why = ctypes.create_string_buffer(1000)
        config = _Config(1, True)
        self.batch = _library().mjb_makeBatch(address_of(self._model), 1, ctypes.byref(config), why, len(why))
        if not self.batch:
            raise MemoryError(f"MuJoCo cannot make a batch: {why.value.decode(errors='replace')}")


_guards = _Guards()


def run_guarded(function: int, argument: int) -> str:
    """Run a C function (model, data, number, argument) within MuJoCo's guard; other threads run meanwhile.

    Args:
        function: Its address. Model and data are those of the guard, for it to ignore.
        argument: Passed on.

    Returns:
        The message of an error of the engine that ended it, or "".
    """
    library, batch, ids = _library(), _guards.batch, (_INT * 1)(0)
    if library.mjb_apply(batch, ids, 1, function, argument, False) == 0:
        return ""
    message = library.mjb_error(batch, 0).decode(errors="replace")
    return " ".join(message.split()) or "MuJoCo cannot step this model"


@compiled
def qpos_of(world: Record) -> Array:
    """Return the positions of all joints of the model, (nq,)."""
    return at(world.engine.qpos, world.engine.nq)


@compiled
def qvel_of(world: Record) -> Array:
    """Return the velocities of all degrees of freedom of the model, (nv,)."""
    return at(world.engine.qvel, world.engine.nv)


@compiled
def ctrl_of(world: Record) -> Array:
    """Return the controls of all actuators of the model, (nu,)."""
    return at(world.engine.ctrl, world.engine.nu)


@compiled
def past_of(world: Record) -> Array:
    """Return past ticks, (rows, 2 n + 1): true positions, commands, and the arrival of the command, in ticks.

    Tick t is in row t modulo rows.
    """
    engine = world.engine
    return carray(pointer(engine.past), (engine.past_rows, 2 * world.n + 1), np.float64)  # type: ignore[no-any-return]


@compiled
def chance_of(world: Record) -> Array:
    """Return the random numbers of this tick, (n + 2,): see `rmrc.plants.hardware.Hardware.chance`."""
    engine, size = world.engine, world.n + 2
    return at(engine.chance + 8 * size * engine.next, size)
