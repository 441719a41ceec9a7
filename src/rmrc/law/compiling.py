"""How this package compiles: one set of flags, a cache that tells the truth, and methods at addresses.

Numba's cache looks at the file of a function, not at those that it calls. So machine code is kept in a folder
that is named after a hash of all compiled sources: an edit of any of them compiles everything anew.

A method, such as an inverse or a plant, is a plain function of the record of a world. It is compiled to
machine code of its own when its address is first asked for, and compiled code calls it there. So a run
compiles only the methods that it uses, and arms with the same capacity share all machine code.
"""

import ctypes
import hashlib
import os
import shutil
import signal
import stat
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, cast

import numba
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from rmrc.law.record import spectrum_type, world_type
from rmrc.support.errors import COMPILING, KEPT, NOT_KEPT, tell

Array: TypeAlias = NDArray[np.float64]
Record: TypeAlias = Any  # one element of a structured array, see rmrc.law.record
Function = TypeVar("Function", bound=Callable[..., object])

# `nogil` lets threads run worlds side by side. With `error_model="numpy"` 1/0 is infinite and raises nothing,
# because the law itself decides about zeros. No `fastmath`: it would drop the tests for NaN.
_FLAGS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
# Rooms with compiled functions; the constants that these use stand in rmrc.scenario.choices.
_SOURCES = tuple(f"{room}/**/*.py" for room in ("law", "plants", "simulation", "analysis", "export"))
# The folders of older sources that stay beside the present one: other branches of a clone.
_OLDER = 8

_numba: Any = numba
_types: Any = types
_compiling = threading.RLock()


def _sources() -> str:
    """Return a digest of all modules that may hold compiled functions."""
    package = Path(__file__).parents[1]
    patterns = (*_SOURCES, "scenario/choices.py")
    files = sorted(file for pattern in patterns for file in package.glob(pattern))
    versions = f"{numba.__version__} {np.__version__}".encode()
    return hashlib.sha256(versions + b"".join(file.read_bytes() for file in files)).hexdigest()[:16]


def _parents() -> Iterator[Path]:
    """Yield the folders that may hold the cache, the best first."""
    if named := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(named)
        return
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    if home.is_absolute():  # a user without a home has none
        yield home / "rmrc"
    yield Path(tempfile.gettempdir()).resolve() / f"rmrc-{os.getuid() if hasattr(os, 'getuid') else 'cache'}"


def _is_safe(folder: Path) -> bool:
    """Return whether only this user can write to a folder: who writes there can run code as the user."""
    status = folder.lstat()  # of a link, the link itself, which is no folder
    is_owned = not hasattr(os, "getuid") or status.st_uid == os.getuid()
    is_closed = os.name != "posix" or not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    above = folder.parent.stat().st_mode  # who can write there can rename the folder, unless it is sticky
    is_fixed = os.name != "posix" or not above & stat.S_IWOTH or bool(above & stat.S_ISVTX)
    is_safe = stat.S_ISDIR(status.st_mode) and is_owned and is_closed and is_fixed
    return is_safe and os.access(folder, os.W_OK)


@cache
def cache_folder() -> Path | None:
    """Return the folder of machine code of the present sources, made if missing; None: there is no place."""
    for parent in _parents():
        try:
            parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not _is_safe(parent):
                continue
            folder = parent / _sources()
            if not folder.exists():
                folder.mkdir(mode=0o700, exist_ok=True)
                _remove_old(parent)
            return folder
        except OSError:
            continue
    warnings.warn(
        "machine code cannot be kept: neither HOME nor the folder of temporary files can be written; the "
        "variable NUMBA_CACHE_DIR names another folder",
        RuntimeWarning,
        stacklevel=2,
    )
    return None


def _remove_old(parent: Path) -> None:
    """Remove the folders of sources that have not been used for longest."""
    folders = sorted((one for one in parent.iterdir() if one.is_dir()), key=lambda one: one.stat().st_mtime)
    for folder in folders[: -(_OLDER + 1)]:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _keeping() -> Iterator[dict[str, Any]]:
    """Have numba keep machine code in that folder; yield the flags of a function. One thread at a time.

    Loops of the law are a few joints long: more optimization makes no tick faster, and takes longer.
    """
    folder, settings = cache_folder(), _numba.config
    wanted = {"OPT": type(settings.OPT)(1), "LOOP_VECTORIZE": 0, "SLP_VECTORIZE": 0}
    if folder is not None:
        wanted["CACHE_DIR"] = str(folder)
    with _compiling:
        before = {name: getattr(settings, name) for name in wanted}
        vars(settings).update(wanted)
        try:
            yield {**_FLAGS, "cache": folder is not None}
        finally:
            vars(settings).update(before)


@contextmanager
def portably() -> Iterator[dict[str, Any]]:
    """Have numba make code for no machine yet; yield the flags of a function. One thread at a time.

    It is neither kept nor optimized.
    """
    settings = _numba.config
    with _compiling:
        before, settings.OPT = settings.OPT, type(settings.OPT)(0)
        try:
            yield {"error_model": _FLAGS["error_model"]}
        finally:
            settings.OPT = before


def compiled(function: Function) -> Function:
    """Compile a function that compiled functions or Python call, at its first call."""
    with _keeping() as flags:
        return cast(Function, _numba.njit(**flags)(function))


class _Missed(threading.local):
    """Exceptions that came where none can be raised, and whether such work goes on."""

    def __init__(self) -> None:
        self.exceptions: list[BaseException] = []
        self.is_at_work = False


_missed = _Missed()
# Signals that programs handle; to look at all of the sixty would take as long as ten ticks.
_SIGNALS = [
    getattr(signal, f"SIG{name}")
    for name in ("INT", "TERM", "HUP", "ALRM", "VTALRM", "PROF", "USR1", "USR2", "BREAK")
    if hasattr(signal, f"SIG{name}")
]


@contextmanager
def missing_nothing() -> Iterator[None]:
    """Keep an exception for `raise_missed`: compiled code can raise none."""
    try:
        yield
    except BaseException as exception:
        _missed.exceptions.append(exception)


def raise_missed() -> None:
    """Raise an exception that came in this thread where it could not be raised."""
    if _missed.exceptions:
        exception = _missed.exceptions[0]
        _missed.exceptions.clear()
        raise exception


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Raise at the end what signal handlers raise meanwhile, such as Ctrl-C; the handlers run at once.

    Numba could compile nothing more in this process after an exception in the middle of its work. One at the
    entry of a function that compiled code calls would be lost.
    """
    if _missed.is_at_work:
        yield
        return
    _missed.is_at_work = True
    try:
        with _holding_handlers():
            yield
    finally:
        _missed.is_at_work = False
        raise_missed()


@contextmanager
def _holding_handlers() -> Iterator[None]:
    """Keep what the handlers of signals raise, for `raise_missed`. They run in the main thread alone."""
    replaced: dict[int, tuple[Any, Any]] = {}

    def hold_back(handler: Callable[[int, Any], object]) -> Callable[[int, Any], None]:
        @wraps(handler)  # with its attributes
        def hold(number: int, frame: Any) -> None:
            try:
                handler(number, frame)
            except BaseException as exception:
                if not _missed.is_at_work:  # it came while handlers are put back
                    raise
                _missed.exceptions.append(exception)

        return hold

    is_main = threading.current_thread() is threading.main_thread()
    try:
        for number in _SIGNALS if is_main else ():
            handler = signal.getsignal(number)
            if callable(handler):
                replaced[number] = hold_back(handler), handler
                signal.signal(number, replaced[number][0])
        yield
    finally:
        for number, (hold, handler) in replaced.items():
            if signal.getsignal(number) is hold:  # the handler may have set another one
                signal.signal(number, handler)


class Method:
    """A function of a world, and perhaps of one of its spectra, that is called at its address.

    MuJoCo's guard calls with a model, data and a number before the world. A program in C calls with addresses
    of q, qdot, a pose and a twist, and with a time dt.

    Attributes:
        function: The plain function.
    """

    def __init__(self, function: Callable[..., None]) -> None:
        """Compile nothing yet."""
        self.function = function
        self._made: dict[int, Any] = {}
        self._late: dict[int, Any] = {}

    def address(self, capacity: int) -> int:
        """Return the address of its machine code, compiled or loaded now if necessary.

        Args:
            capacity: Number of joints that the records of worlds hold.
        """
        return int(self._machine_code(capacity).address)

    def address_at_need(self, capacity: int) -> int:
        """Return its address if it is compiled, or else that of a function that compiles it when called.

        For methods that most worlds never call. An exception there waits for `raise_missed`, as compiled code
        can raise none; one of a signal handler needs `uninterrupted` around the compiled code.
        """
        if capacity in self._made:
            return self.address(capacity)
        if capacity not in self._late:

            def compile_and_call(*records: int) -> None:
                with missing_nothing():
                    self.entry(capacity)(*records)

            self._late[capacity] = self._kind(compile_and_call)
        return ctypes.cast(self._late[capacity], ctypes.c_void_p).value or 0

    def entry(self, capacity: int) -> Callable[..., None]:
        """Return a function that calls it for records at addresses; other threads run meanwhile."""
        return cast(Callable[..., None], self._kind(self.address(capacity)))

    @property
    def _kind(self) -> Any:
        """Its type in C, if it takes only records."""
        return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * self.function.__code__.co_argcount)

    def _machine_code(self, capacity: int) -> Any:
        if capacity not in self._made:
            with _compiling, uninterrupted():
                if capacity not in self._made:
                    self._made[capacity] = self._make(capacity)
        return self._made[capacity]

    def signature(self, capacity: int) -> Any:
        """Return its type, as numba has it.

        Args:
            capacity: Number of joints that the records of worlds hold.
        """
        kinds = dict.fromkeys(("model", "data"), _types.voidptr) | {"number": _types.int32}
        kinds["world"] = _numba.from_dtype(world_type(capacity))
        kinds["spectrum"] = _numba.from_dtype(spectrum_type(capacity))
        kinds |= dict.fromkeys(("q", "qdot", "pose", "twist"), _types.int64) | {"dt": _types.float64}
        names = self.function.__code__.co_varnames[: self.function.__code__.co_argcount]
        return _types.void(*(kinds[name] for name in names))

    def _make(self, capacity: int) -> Any:
        signature = self.signature(capacity)
        folder = cache_folder()
        mark = folder and folder / f"{self.function.__module__}.{self.function.__qualname__}.{capacity}"
        if mark is None or not mark.exists():
            tell(COMPILING.format("the control law", KEPT if mark else NOT_KEPT))
        with _keeping() as flags:
            flags.pop("nogil")  # of functions that Python calls
            made = _numba.cfunc(signature, **flags)(self.function)
        if mark is not None:
            mark.touch()
        return made


# Called by compiled code ------------------------------------------------------------------------


def _typed_call(typing: Any, address: Any, *arguments: Any) -> Any:  # noqa: ARG001 - as numba calls it
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        count = len(signature.args[1])
        passed = [builder.extract_value(values[1], i) for i in range(count)]
        function = ir.FunctionType(ir.VoidType(), [value.type for value in passed])
        builder.call(builder.inttoptr(values[0], function.as_pointer()), passed)
        return context.get_dummy_value()

    return _types.void(address, _types.StarArgTuple(arguments)), generate


def _typed_pointer(typing: Any, address: Any) -> Any:  # noqa: ARG001 - as numba calls it
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:  # noqa: ARG001
        return builder.inttoptr(values[0], context.get_value_type(_types.voidptr))

    return _types.voidptr(address), generate


_intrinsic: Any = intrinsic
# Calls a function at an address with records or words, and returns nothing.
call: Callable[..., None] = _intrinsic(_typed_call)
# Returns an address as a pointer, of which `carray` makes an array of a shape and a type.
pointer: Callable[[int], Any] = _intrinsic(_typed_pointer)
carray: Any = _numba.carray


@compiled
def at(address: int, count: int) -> Array:
    """Return the numbers at an address, (count,)."""
    return carray(pointer(address), (count,), np.float64)  # type: ignore[no-any-return]
