"""How this package compiles: decorators that give every function the same flags, and dispatch by name.

A function that few worlds need is `apart`. It is machine code of its own, which is compiled when a world that
needs it is first prepared. It is called at its address, which the record of that world holds in this process.
A function that worlds need at few ticks is late as well: a simulation compiles it at its first call.
"""

import ctypes
import gc
import hashlib
import inspect
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, TypeVar, cast

import numba
import numpy as np
from numba import config
from numba.core import event, types
from numpy.typing import NDArray

from rmrc.law import brisk
from rmrc.law.addresses import LATE, TYPES, caller
from rmrc.law.keeping import known_home, notice, own_folder
from rmrc.law.kept import Kept
from rmrc.law.record import ADDRESSES
from rmrc.scenario.choices import Choice, Choices
from rmrc.support import lifetime
from rmrc.support.notices import COMPILING, KEPT, NOT_KEPT, tell

try:
    from rmrc.law.linking import LongCompiler, PartCompiler, WholeCompiler
    from rmrc.law.shortcuts import shortened
except ImportError:  # another version of numba, which has moved its classes
    from numba.core.compiler import Compiler

    LongCompiler = PartCompiler = WholeCompiler = Compiler  # type: ignore[misc, assignment]
    shortened = nullcontext  # type: ignore[assignment]

Array: TypeAlias = NDArray[np.float64]
Record: TypeAlias = Any  # one element of a structured array, see records.py
Function = TypeVar("Function", bound=Callable[..., object])

# `nogil` lets threads run worlds side by side. With `error_model="numpy"` 1/0 is infinite and raises nothing,
# because the law itself decides about zeros. No `fastmath`: the bits of a world must not depend on how
# many others are computed beside it.
_flags: dict[str, Any] = {"nogil": True, "error_model": "numpy", "pipeline_class": WholeCompiler}
# Functions that make arrays use these names. Only they count references to arrays. The others use arrays
# of their caller, which outlive the call; counting would cost 0.1 to 0.25 us per tick. Numba refuses to
# compile a function that makes an array in another way.
_MAKERS = frozenset({"diag", "empty", "ones", "zeros"})
# Functions that only compiled code calls need no wrappers for Python and C, a quarter of the compile time.
_inner = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_part: dict[str, Any] = {"pipeline_class": PartCompiler, **_inner}


# Names of the compiled parts beside the control law, for messages.
_OTHER = {"descent": "the inverse kinematics", "sheet": "the search of workspaces"}


class _Compiling(event.Listener):
    """Reports that numba compiles, when it does; cached functions do not reach it."""

    depth = 0  # of nested functions; numba's lock admits one thread

    def on_start(self, event: Any) -> None:
        if self.depth == 0:
            dispatcher = event.data["dispatcher"]
            module = dispatcher.py_func.__module__.rpartition(".")[2]
            is_kept = dispatcher.stats.cache_path is not None
            tell(COMPILING.format(_OTHER.get(module, "the control law"), KEPT if is_kept else NOT_KEPT))
        self.depth += 1

    def on_end(self, event: Any) -> None:  # noqa: ARG002 - as numba calls it
        self.depth -= 1


event.register("numba:compile", _Compiling())  # type: ignore[no-untyped-call]


def _compile(function: Callable[..., object], **options: Any) -> Any:
    """Return a dispatcher for a function, with the flags of all and some of its own."""
    given = _flags | {"_nrt": not _MAKERS.isdisjoint(function.__code__.co_names)} | options
    return numba.njit(**given)(function)


def compiled(function: Function) -> Function:
    """Compile a function that other compiled functions call."""
    return cast(Function, _compile(function, **_part))


def inlined(function: Function) -> Function:
    """Compile a function as part of its caller: for functions that mainly call others in turn.

    Otherwise each level of calls would optimize all levels below once more, which takes most of the time.
    """
    return cast(Function, _compile(function, inline="always", **_part))


class _Apart(NamedTuple):
    """A function that is called at its address: the field of the address, and the worlds that need it.

    Attributes:
        field: Field of a world's record that holds the address.
        function: The function, with its types.
        needs: The fields and their values by which a world needs it; no values: all but 0. No fields: always.
        is_late: Whether a simulation compiles it at its first call.
    """

    field: str
    function: Callable[..., object]
    needs: Mapping[str, tuple[int, ...]]
    is_late: bool = False

    def users(self, worlds: Any, present: Mapping[str, set[Any]]) -> slice | NDArray[np.bool_] | None:
        """Return which of some worlds need it, all or a mask (w,), or None if none does.

        Args:
            worlds: Their records, (w,).
            present: Values of the fields in `needs` in these worlds; no values of a field that they lack.
        """
        used = None if self.needs else np.s_[:]
        for name, values in self.needs.items():
            found = present.get(name, set())
            needed = found.intersection(values) if values else found - {0}
            if needed and needed == found:
                return np.s_[:]
            for value in needed:
                mask = worlds[name] == value
                used = mask if used is None else used | mask
        return used


_APARTS: list[_Apart] = []


def apart(field: str, is_late: bool = False, **needs: tuple[int, ...]) -> Callable[[Function], Function]:
    """Compile a function apart from its callers, and only when a world that needs it is prepared.

    Its arguments are a world and, under the names `tick` or `out`, the record of a tick. An array is named
    after the field of the world or the tick that has its type, or it is a row of the entry's argument of the
    same name.

    Args:
        field: Field of a world's record that holds its address.
        is_late: Whether worlds call it at few ticks, so that a simulation compiles it at its first call.
        **needs: The fields of its record, and their values, by which a world needs it; none: all but 0.
            Only such worlds may call it. Without fields, all may.
    """

    def decorate(function: Function) -> Function:
        _APARTS.append(_Apart(field, function, needs, is_late))
        return cast(Function, caller(field, function, is_late))

    return decorate


def apart_by_code(field: str, chosen: str, functions: Mapping[int, Callable[..., Any]]) -> Callable[..., Any]:
    """Return a function that calls one of several functions, each of them `apart`, by a code in a record.

    Args:
        field: Field of `ADDRESSES`: where a world's record holds the address of its choice.
        chosen: The field of the code.
        functions: Compiled functions by their codes; all take the same arguments.
    """
    plain = {code: cast(Any, function).py_func for code, function in functions.items()}
    for code, function in plain.items():
        _APARTS.append(_Apart(field, function, {chosen: (code,)}))
    return caller(field, next(iter(plain.values())))


def _link(function: Callable[..., object], at_need: bool, worlds: Any, *others: Any) -> None:
    """Compile or load the functions `apart` that some worlds need, and write their addresses into records.

    Args:
        function: The entry that takes the worlds.
        at_need: Whether late functions wait for their first call.
        worlds: Their records, (w,).
        *others: The other arguments of the entry; the first of them are the ticks.
    """
    asked, read = _asked(worlds.dtype, len(_APARTS))
    present = {name: set(worlds[name].tolist()) for name in read}
    kinds = tuple(map(_kind, (worlds, *others)))
    for one in asked:
        used = one.users(worlds, present)
        if used is None:
            continue
        place = _addresses.get((one.function, *kinds), 0)
        if not place:
            names = inspect.signature(cast(Any, function).py_func).parameters
            types_of = {name: _typeof(given) for name, given in zip(names, (worlds, *others), strict=True)}
            if one.is_late and at_need and not _Patience.is_over:
                worlds[LATE] = _finder(worlds.dtype, kinds, types_of)
                continue
            place = _found(one, kinds, types_of)
        worlds[one.field][used] = place


class _Patience:
    """Whether late functions are compiled with the others, as other processes will need them."""

    is_over = False


@contextmanager
def all_at_once() -> Iterator[None]:
    """Compile late functions with the others."""
    before, _Patience.is_over = _Patience.is_over, True
    try:
        yield
    finally:
        _Patience.is_over = before


_Finder = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)
_finders: dict[tuple[object, ...], Any] = {}
# Exceptions during late compiling, by threads: compiled code cannot raise them.
_missed: dict[int, BaseException] = {}


def _finder(kind: np.dtype[np.void], kinds: tuple[object, ...], types_of: Mapping[str, Any]) -> int:
    """Return the address of a function that finds late functions for worlds of a type.

    Ctypes has it take Python's lock, which the calling code has released.
    """
    fields: Mapping[str, Any] = kind.fields or {}
    by_offset = {fields[one.field][1]: one for one in _APARTS if one.field in fields}

    def find(offset: int) -> int:
        while True:
            try:
                return _found(by_offset[offset], kinds, types_of)
            except KeyboardInterrupt as interrupted:  # it waits, so that no tick is left half done
                _missed[threading.get_ident()] = interrupted
            except BaseException as error:
                _missed[threading.get_ident()] = error
                return 0

    if kinds not in _finders:
        _finders[kinds] = _Finder(find)
    return ctypes.cast(_finders[kinds], ctypes.c_void_p).value or 0


@contextmanager
def compiling_late() -> Iterator[None]:
    """Raise an exception that came while compiled code waited for a late function."""
    try:
        yield
    finally:
        error = _missed.pop(threading.get_ident(), None)
        if error is not None:
            raise error


def _found(one: _Apart, kinds: tuple[object, ...], types_of: Mapping[str, Any]) -> int:
    """Return the address of a function `apart` for the arguments of an entry, compiled now if necessary."""
    key = (one.function, *kinds)
    _addresses[key] = _addresses.get(key) or _address(one, types_of)
    return _addresses[key]


_addresses: dict[tuple[object, ...], int] = {}


@cache
def _asked(kind: np.dtype[np.void], count: int) -> tuple[list[_Apart], list[str]]:
    """Return which of the first functions `apart` a type of worlds may need, and the fields that decide."""
    has = kind.names or ()
    asked = [one for one in _APARTS[:count] if one.field in has]
    return asked, sorted({name for one in asked for name in one.needs if name in has})


_entry_apart: Callable[..., Any] = cache(lambda function: entry(function, **_inner))


@cache
def _law_type(world: Any) -> Any:
    """Return the type of the fields of the law in a world, all of which take whole words of 8 bytes.

    Numba would take the world for a subtype, and warn of that, if fields had the same alignment: none.
    """
    last, aligned = world.offset(ADDRESSES[-1].name), {"alignment": 8}
    fields = [(name, one._asdict() | aligned) for name, one in world.fields.items() if one.offset <= last]
    return cast(Any, types.Record)(fields, last + 8, world.aligned)


def _address(one: _Apart, kinds: Mapping[str, Any]) -> int:
    """Return the address of a function's machine code, from the types of an entry's arguments by name.

    Worlds begin with the fields of the law. A function whose address is among them takes these alone, so that
    runs and controllers share its machine code.
    """
    world, tick = (kind.dtype for kind in list(kinds.values())[:2])
    if one.field in {field.name for field in ADDRESSES}:
        world = _law_type(world)
    signature, taken = inspect.signature(one.function), [world]
    for name, told in list(signature.parameters.items())[1:]:
        if name in ("tick", "out"):
            taken.append(tick)
        elif told.annotation != Array:
            taken.append(kinds[name] if name == "ticks" else TYPES[told.annotation])
        elif name in kinds:
            taken.append(kinds[name].copy(ndim=kinds[name].ndim - 1))
        else:
            taken.append((world if name in world.fields else tick).typeof(name))
    with briskly():
        dispatcher = _entry_apart(one.function)
        dispatcher.compile(TYPES[signature.return_annotation](*taken))
    compiled = dispatcher.overloads[tuple(taken)]
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


def dispatch(choices: Choices[Choice], like: Function, field: str = "") -> Function:
    """Compile a function that calls the function with the name of a world's choice.

    It is a generated chain of comparisons, as fast as a handwritten one. Numba's own ways, a tuple of
    functions or a function made of others, take a third longer. With a field, each function is `apart`.

    Args:
        choices: Each choice that acts has a compiled function of its name in the module of `like`. For the
            others nothing is done, and 0 returned.
        like: One of these functions. All take its arguments; the first is the world.
        field: Field of `ADDRESSES`: where a world's record holds the address of its function.

    Raises:
        ImportError: There is no such function, or it takes other arguments.
    """
    of_like = cast(Any, like).py_func
    module, signature = of_like.__globals__, inspect.signature(of_like)
    arguments, of_chain = ", ".join(signature.parameters), {"__name__": module["__name__"]}
    lines, done, idle = [f"def chosen({arguments}):"], dict[int, Any](), list[str]()
    world = next(iter(signature.parameters))
    for code, one in enumerate(choices.options):
        if not one.acts:
            idle.append(f"{world}.{choices.field} != {code}")
            continue
        function = of_chain[f"do_{one.name}"] = module.get(one.name)
        found = getattr(function, "py_func", None)
        if found is None or ", ".join(inspect.signature(found).parameters) != arguments:
            raise ImportError(
                f"{module['__name__']} must have a compiled function {one.name}({arguments}), which "
                f"control.{choices.key}: {one.name} stands for"
            )
        done[code] = function
        lines.append(f"    if {world}.{choices.field} == {code}:")
        lines.append(f"        return do_{one.name}({arguments})")
    if field:
        lines = [lines[0], f"    if {' and '.join(idle) or True}:", f"        return by_address({arguments})"]
        of_chain["by_address"] = apart_by_code(field, choices.field, done)
    lines.append(f"    return {signature.return_annotation and signature.return_annotation(0)}")
    exec(compile("\n".join(lines), f"<control.{choices.key}>", "exec"), of_chain)
    return cast(Function, of_chain["chosen"])


def chain(
    name: str, arguments: str, calls: Mapping[str, Callable[..., object]], passed: str = ""
) -> Callable[..., bool]:
    """Compile a function that calls, in order, each function whose condition holds; it returns if any did.

    Its source is generated: if-chains cost nothing, while closures over functions cost a fifth.

    Args:
        name: Name of the function.
        arguments: Arguments of the function.
        calls: Compiled functions, by conditions on the arguments such as `world.is_off`.
        passed: Their arguments, if these are expressions of the arguments, evaluated only for them.
    """
    names: dict[str, Any] = {f"call_{i}": function for i, function in enumerate(calls.values())}
    lines = [f"def {name}({arguments}):", "    called = False"]
    for called, condition in zip(names, calls, strict=True):
        lines += [f"    if {condition}:", f"        {called}({passed or arguments})", "        called = True"]
    exec("\n".join([*lines, "    return called"]), names)
    return inlined(cast(Callable[..., bool], names[name]))


def entry(function: Function, **options: Any) -> Function:
    """Compile a function that Python calls, and keep the machine code on disk for the next process.

    Numba recompiles when the function's own file changes, but not when the file of a function that it calls
    does. Machine code of other sources is therefore removed here.
    """
    dispatcher = _kept(function, options)
    if dispatcher.stats.cache_path is not None:
        _forget_other_sources(Path(str(dispatcher.stats.cache_path)), function)
        dispatcher._cache = Kept(dispatcher._cache, SOURCES)
    return cast(Function, dispatcher)


def long_entry(function: Function) -> Function:
    """Compile an `entry` that goes through thousands of rows, where longer code saves more than it costs."""
    return entry(function, pipeline_class=LongCompiler)


def _kept(function: Callable[..., object], options: Mapping[str, Any]) -> Any:
    """Return a dispatcher that keeps its code where numba can, or else in a folder of the user's own."""
    try:
        with known_home():
            return _compile(function, cache=True, **options)
    except RuntimeError:  # there is no place for it
        pass
    folder, settings = own_folder(), cast(Any, config)
    if folder is None:
        notice("machine code cannot be kept: not with the package, in HOME or among temporary files")
        return _compile(function, **options)
    before = settings.CACHE_DIR
    settings.CACHE_DIR = str(folder)
    try:
        dispatcher = _compile(function, cache=True, **options)
    finally:
        settings.CACHE_DIR = before
    notice(f"machine code is kept in {folder}, as neither the package nor HOME can be written")
    return dispatcher


def machine_code(function: Function, *arguments: object, at_need: bool = False) -> Function:
    """Return the machine code of an `entry` for arguments of these types, compiled now if necessary.

    Calling it saves the look at the type of each argument, which takes as long as the law. Its arguments must
    have exactly the same types.

    Where the first two arguments are records of worlds and of their ticks, functions `apart` that these
    worlds need are compiled as well, and their addresses are written into the records.

    Args:
        function: The entry.
        *arguments: Its arguments, or others of the same types.
        at_need: Whether late functions are compiled at their first call, in the context `compiling_late`.
    """
    if all(isinstance(one, np.ndarray) and one.dtype.names for one in arguments[:2]):
        _link(function, at_need, *arguments)
    key = (function, *map(_kind, arguments))
    if key not in _codes:
        dispatcher: Any = function
        with briskly():
            _codes[key] = dispatcher.compile(tuple(map(_typeof, arguments)))
    return cast(Function, _codes[key])


def address(
    function: Callable[..., object], *arguments: object, is_c: bool = False, at_need: bool = False
) -> int:
    """Return the address of an entry's machine code for arguments of these types.

    Args:
        function: The entry.
        *arguments: As in `machine_code`.
        is_c: Whether C code calls it, rather than compiled code of this package.
        at_need: As in `machine_code`.
    """
    machine_code(function, *arguments, at_need=at_need)
    key = (function, is_c, *map(_kind, arguments))
    if key not in _places:
        made = cast(Any, function).overloads[tuple(map(_typeof, arguments))]
        name = made.fndesc.llvm_cfunc_wrapper_name if is_c else made.fndesc.llvm_func_name
        _places[key] = int(made.library.get_pointer_to_function(name))
    return _places[key]


# Each batch of a sweep asks for it, and numba takes milliseconds to find the type of a record.
_codes: dict[tuple[object, ...], object] = {}
_places: dict[tuple[object, ...], int] = {}
_types: dict[object, Any] = {}


def _typeof(argument: object) -> Any:
    """Return the numba type of an argument."""
    kind = _kind(argument)
    if kind not in _types:
        _types[kind] = cast(Any, numba).typeof(argument)
    return _types[kind]


def _kind(argument: object) -> object:
    """Return the properties of an argument that determine its numba type."""
    if isinstance(argument, float):
        return float
    if not isinstance(argument, np.ndarray):
        # the class of a tuple does not show its items
        return argument.dtype if isinstance(argument, np.void) else cast(Any, numba).typeof(argument)
    flags = argument.flags
    return (
        argument.dtype,
        argument.ndim,
        flags.c_contiguous,
        flags.f_contiguous,
        flags.aligned,
        flags.writeable,
    )


_compiling = threading.RLock()


@contextmanager
def briskly() -> Iterator[None]:
    """Compile in a third of the time that numba takes by itself. One thread at a time does.

    Level 2 makes code as fast as level 3 does for loops this short. Compiling makes millions of objects that
    live on, and the garbage collector would search them again and again.
    """
    settings: Any = config  # its attributes are made on import
    with _compiling, shortened() if brisk.IS_KNOWN else nullcontext():
        level, collects = settings.OPT, gc.isenabled()
        settings.OPT = type(level)(min(2, level))
        gc.disable()
        try:
            yield
        finally:
            settings.OPT = level
            if collects:
                if lifetime.ends_with_job:
                    gc.freeze()
                gc.enable()


def _forget_other_sources(directory: Path, function: Callable[..., object]) -> None:
    module, name = function.__module__.rpartition(".")[2], function.__qualname__
    stamp = directory / f"{module}.{name}.sources"
    try:
        if stamp.is_file() and stamp.read_text() == SOURCES:
            return
        for stale in directory.glob(f"{module}.{name}-*.nb[ci]"):
            stale.unlink(missing_ok=True)
        directory.mkdir(parents=True, exist_ok=True)
        stamp.write_text(SOURCES)
    except OSError:  # a cache that cannot be written is slow, not wrong: numba will not use it either
        pass


# Modules of this folder that determine the machine code of functions.
_HOW = "record", "jit", "brisk", "shortcuts", "indexing", "linking", "addresses", "outward"
# Folders whose modules may have compiled functions.
_ROOMS = ("plants", "results", "simulation", "analysis")


def _digest_sources() -> str:
    """Return a digest of all modules that hold compiled functions, and of the constants these use."""
    package = Path(__file__).parents[1]
    own = (path.read_bytes() for path in sorted(package.glob("law/*.py")))
    marks = b"@compiled", b"@inlined", b"@entry", b"@long_entry", b"@apart"
    sources = [text for text in own if any(mark in text for mark in marks)]
    sources += [(package / f"law/{name}.py").read_bytes() for name in _HOW]
    sources.append((package / "scenario/choices.py").read_bytes())
    others = (
        text
        for room in _ROOMS
        for path in sorted(package.glob(f"{room}/**/*.py"))
        if b"law.jit" in (text := path.read_bytes())
    )
    return hashlib.sha256(b"".join([*sources, *others])).hexdigest()


SOURCES = _digest_sources()
