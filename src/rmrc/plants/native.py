"""MuJoCo's C batch, through which one call runs many ticks of a world: Python's own batch cannot do that.

mjb_apply runs a function of this package on the data of each world: no global callback is needed, and an
error of the engine ends only its own world. The offsets in that data are found in data of the same model.
"""

import ctypes
import threading
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, lru_cache
from typing import Any

import mujoco
import numpy as np
from mujoco import _batch
from mujoco.batch import SimulationError
from numpy.typing import NDArray

from rmrc.law.jit import Array
from rmrc.plants.wiring import column

_POINTER, _INT, _TEXT, _FLAG = ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_bool
_SIZES = ctypes.POINTER(_INT)
# The functions of MuJoCo's C interface that are called here, with their arguments and results.
_CALLED: dict[str, tuple[Any, list[Any]]] = {
    "mjb_makeBatch": (_POINTER, [_POINTER, _INT, _POINTER, _TEXT, _INT]),
    "mjb_deleteBatch": (None, [_POINTER]),
    "mjb_nstate": (_INT, [_POINTER]),
    "mjb_state": (_POINTER, [_POINTER]),
    "mjb_warning": (_POINTER, [_POINTER]),
    "mjb_status": (_POINTER, [_POINTER]),
    "mjb_error": (_TEXT, [_POINTER, _INT]),
    "mjb_expand": (_POINTER, [_POINTER, _TEXT, _SIZES, _SIZES]),
    "mjb_setConst": (_INT, [_POINTER, _POINTER, _INT]),
    "mjb_reset": (_INT, [_POINTER, _POINTER, _INT, _POINTER, _INT]),
    "mjb_step": (_INT, [_POINTER, _POINTER, _INT, _INT, _INT]),
    "mjb_apply": (_INT, [_POINTER, _POINTER, _INT, _POINTER, _POINTER, _FLAG]),
}
# Without the callback of the clock, which the Python package installs.
_CALLBACKS = ("passive", "control", "contactfilter", "sensor", "act_dyn", "act_gain", "act_bias")
_WARNINGS = len(mujoco.mjtWarning.__members__) - 1  # the last is their number

# Fields of MjData that a tick reads. The model below serves to find their addresses. None of them is empty in
# it, so each has an address of its own.
FIELDS = (
    "qpos", "site_xpos", "site_xquat", "xanchor", "xaxis", "actuator_force", "qfrc_actuator", "qfrc_gravcomp",
)  # fmt: skip
_LOOKED_UP = """<mujoco><worldbody><body gravcomp="1"><joint name="j"/><geom size="1"/><site/></body>
</worldbody><actuator><motor joint="j"/></actuator></mujoco>"""
# Functions that return the number of bytes allocated at an address, on Linux and on macOS.
_ALLOCATED = ("malloc_usable_size", "malloc_size")


class _Config(ctypes.Structure):
    _fields_ = (("nthread", _INT), ("persistent", _FLAG))


@cache
def library() -> ctypes.CDLL:
    """Return MuJoCo's library, which its extension modules were linked to.

    Raises:
        OSError: It cannot be found.
        AttributeError: It lacks a function.
    """
    found = ctypes.CDLL(_batch.__file__)
    for name, (result, arguments) in _CALLED.items():
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    return found


def function_at(name: str) -> int:
    """Return the address of one of MuJoCo's functions."""
    return int(ctypes.cast(getattr(library(), name), _POINTER).value or 0)


@cache
def _callbacks() -> list[ctypes.c_void_p]:
    return [_POINTER.in_dll(library(), f"mjcb_{name}") for name in _CALLBACKS]


def has_callbacks() -> bool:
    """Return whether a callback of MuJoCo is installed, in C or in Python."""
    return any(pointer.value for pointer in _callbacks())


@contextmanager
def untimed() -> Iterator[None]:
    """Have MuJoCo step without its timers, which take a fifth of a step and which nothing here reads.

    They are on for the whole process as long as it has a clock, `mjcb_time`. The clock is off while any
    thread is in this context. A clock that the user installed stays. The times in `MjData.timer` of other
    simulations are wrong for steps at the same time; nothing else reads the clock.
    """
    with _timing:
        _clock.users += 1
        if _clock.users == 1:
            _clock.stop()
    try:
        yield
    finally:
        with _timing:
            _clock.users -= 1
            if _clock.users == 0:
                _clock.resume()


class _Clock:
    """MuJoCo's clock in this process."""

    users, _found = 0, 0

    def stop(self) -> None:
        """Take the clock away, unless it is the user's."""
        self._found = 0
        if offsets() and mujoco.get_mjcb_time() is None:
            pointer = _POINTER.in_dll(library(), "mjcb_time")
            self._found, pointer.value = int(pointer.value or 0), None

    def resume(self) -> None:
        """Put the clock back, unless the user has installed one in between."""
        if self._found:
            pointer = _POINTER.in_dll(library(), "mjcb_time")
            pointer.value = pointer.value or self._found


_clock, _timing = _Clock(), threading.Lock()


# To make data takes longer than all else here, and batches of one model mostly follow each other.
_data_of = lru_cache(1)(mujoco.MjData)


def serves(model: mujoco.MjModel) -> bool:
    """Return whether `Native` can run worlds of a model: `offsets` holds for it, and there are no callbacks.

    MuJoCo's own batch can call these.
    """
    where = offsets()
    if not where or has_callbacks():
        return False
    data = _data_of(model)
    return all(
        ctypes.c_int64.from_address(data._address + where[name]).value == _address(data, name)
        for name in FIELDS
        if getattr(data, name).size  # an empty field has no address
    )


@cache
def offsets() -> dict[str, int]:
    """Return the offsets in MjData of the pointers to FIELDS, and of its warnings [B]; none if unsure.

    They are found in live data: reading MuJoCo's own description takes longer.
    """
    try:
        library()
        data = mujoco.MjData(mujoco.MjModel.from_xml_string(_LOOKED_UP))
        data.warning[0].lastinfo, data.warning[0].number = 0x5EA1, 0x0DD5
        sought = {0x5EA1 | 0x0DD5 << 32: "warning"} | {_address(data, name): name for name in FIELDS}
        # the whole buffer begins where qpos does, and comes first: the last of equal words is the right one
        words = _words(data)
        found = {name: np.flatnonzero(words == word)[-1:] for word, name in sought.items()}
        if len(found) == len(FIELDS) + 1 and all(map(len, found.values())):
            return {name: 8 * int(at[0]) for name, at in found.items()}
    except (OSError, AttributeError, TypeError, ValueError):  # another MuJoCo, or another system
        pass
    return {}


def _words(data: mujoco.MjData) -> NDArray[np.int64]:
    """Return all words of the memory that was allocated for an MjData.

    Raises:
        AttributeError: The size of an allocation is unknown on this system.
    """
    system = ctypes.CDLL(None)
    allocated = getattr(system, next((name for name in _ALLOCATED if hasattr(system, name)), _ALLOCATED[0]))
    allocated.restype, allocated.argtypes = ctypes.c_size_t, [_POINTER]
    words = (ctypes.c_int64 * (allocated(data._address) // 8)).from_address(data._address)
    return np.frombuffer(words, np.int64)


def _address(data: mujoco.MjData, name: str) -> int:
    return int(getattr(data, name).ctypes.data)


class Native:
    """Worlds of one model, with the parts of `mujoco.batch.Batch` that blocks need, under the same names.

    Attributes:
        data: Data of the model, for shapes and offsets, only to read; it belongs to no world.
        state: MuJoCo's state rows, (w, nstate).
        warning: Its warning counters, (w, 7, 2).
    """

    def __init__(self, model: mujoco.MjModel, count: int) -> None:
        """Make some worlds of a copy of a model.

        Raises:
            ValueError: MuJoCo refuses; the message gives its reason.
        """
        why = ctypes.create_string_buffer(1000)
        config = _Config(1, True)
        self._library, self._model, self._count = library(), model, count
        made = self._library.mjb_makeBatch(model._address, count, ctypes.byref(config), why, len(why))
        if not made:
            raise ValueError(why.value.decode(errors="replace"))
        self._made = made
        weakref.finalize(self, self._library.mjb_deleteBatch, made).atexit = False
        self.data = _data_of(model)
        self.state: Array = self._view(
            self._library.mjb_state(made), np.float64, self._library.mjb_nstate(made)
        )
        self.warning: NDArray[np.int32] = self._view(self._library.mjb_warning(made), np.int32, _WARNINGS, 2)
        self._status = self._view(self._library.mjb_status(made), np.int32)

    def _view(self, address: int, kind: Any, *shape: int) -> NDArray[Any]:
        """Return a view of the batch's own memory, (w, *shape), valid as long as the batch."""
        dtype, whole = np.dtype(kind), (self._count, *shape)
        memory = (ctypes.c_char * (int(np.prod(whole)) * dtype.itemsize)).from_address(address)
        return np.frombuffer(memory, dtype).reshape(whole)

    def bind(self, name: str) -> Array:
        """Return a field of the state, a view of the rows, (w, …)."""
        size, begin = getattr(self.data, name).shape, column(self._model, name.upper())
        return self.state[:, begin : begin + int(np.prod(size))].reshape(self._count, *size)

    def expand(self, name: str) -> NDArray[Any]:
        """Give a field of the model a value for each world, (w, …)."""
        group, _, field = name.rpartition(".")
        own = np.asarray(getattr(self._model.opt if group else self._model, field))
        address = self._library.mjb_expand(self._made, name.encode(), None, None)
        return self._view(address, own.dtype, *own.shape)

    def set_const(self) -> None:
        """Update the derived constants of expanded fields."""
        self._check(None, self._library.mjb_setConst(self._made, None, 0))

    def reset(self, stage: int) -> None:
        """Reset to the model's defaults."""
        self._check(None, self._library.mjb_reset(self._made, None, 0, None, int(stage)))

    def step(self, ids: NDArray[np.intp] | None, steps: int, stage: int) -> None:
        """Advance some worlds, or all, by some steps.

        Raises:
            SimulationError: MuJoCo raised an error in some of them.
        """
        chosen = np.arange(self._count, dtype=np.int32) if ids is None else ids.astype(np.int32)
        about = self._made, chosen.ctypes.data, len(chosen), steps, int(stage)
        self._check(chosen, self._library.mjb_step(*about))

    def apply(self, ids: NDArray[np.intp], function: int, given: int) -> None:
        """Run a C function on some worlds with an address as its last argument, and keep their states.

        Raises:
            SimulationError: MuJoCo raised an error in some of them.
        """
        chosen = ids.astype(np.int32)
        about = self._made, chosen.ctypes.data, len(chosen), function, given, True
        self._check(chosen, self._library.mjb_apply(*about))

    def error(self, world: int) -> str:
        """Return MuJoCo's message about a world in the last call, or an empty text."""
        return str(self._library.mjb_error(self._made, world).decode(errors="replace"))

    def _check(self, ids: NDArray[np.int32] | None, failed: int) -> None:
        if failed:
            chosen = np.arange(self._count) if ids is None else ids
            wrong = chosen[self._status[chosen] != 0]
            raise SimulationError(wrong, self.error(int(wrong[0])), len(chosen))

    def place(self, component: str) -> int:
        """Return the offset of a component of the state in a world's data, in numbers from `qpos` on."""
        return (_address(self.data, component.lower()) - _address(self.data, "qpos")) // 8
