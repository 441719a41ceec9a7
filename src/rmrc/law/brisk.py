"""Repeated look-ups of numba, left out while it compiles this package.

Each change gives what numba's own code gives, only sooner, for functions that count no references to arrays.
They last while this package compiles, under numba's lock. Other versions of numba than those known here
compile without these changes, which takes longer.
"""

import operator
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, cast

from llvmlite.binding import ffi  # type: ignore[import-untyped]
from numba import __version__
from numba.core import base, cpu, postproc, transforms, types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.types.functions import BaseFunction

from rmrc.law import indexing

Change = Callable[[Any], Callable[..., Any]]

# Versions of numba with whose results these changes were compared.
IS_KNOWN = __version__.startswith("0.68.")

# Lookups of these functions are skipped: numba would search all its registries for each of them every time.
_OPTIONAL = "__array__", "static_getitem", "static_setitem"
# Operators on numbers: their code depends on the types of the numbers and not on the values.
_OF_NUMBERS = frozenset({
    operator.add, operator.sub, operator.mul, operator.truediv, operator.iadd, operator.isub, operator.imul,
    operator.itruediv, operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne,
})  # fmt: skip


class _Plain:
    """Whether the function that is compiled now counts no references, so that no variable need be deleted."""

    now = False


@contextmanager
def plainly(is_plain: bool) -> Iterator[None]:
    """Compile a function that counts no references, or one that does."""
    before, _Plain.now = _Plain.now, is_plain
    try:
        yield
    finally:
        _Plain.now = before


def _by_type(found: Callable[..., Any]) -> Callable[..., Any]:
    """Remember what a call returns, by function and types."""
    known = dict[tuple[Any, ...], Any]()

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws:
            return found(self, context, args, kws)
        if self.typing_key in _OF_NUMBERS:
            plain = tuple(map(types.unliteral, args))
            args = plain if all(isinstance(one, types.Number) for one in plain) else args
        key = (self, context, *args)
        if key not in known:
            known[key] = found(self, context, args, kws)
        return known[key]

    return get_call_type


def _searched_once(found: Callable[..., Any]) -> Callable[..., Any]:
    """Search registries only once, and have elements of arrays addressed directly."""

    def get_function(self: Any, of: Any, signature: Any, _firstcall: bool = True) -> Any:
        code = None if self.enable_boundscheck else indexing.code(of, signature)
        if code is None:
            return found(self, of, signature, _firstcall and of not in _OPTIONAL)

        def generate(builder: Any, given: Any, loc: Any = None) -> Any:
            made = code(self, builder, signature, given)
            return found(self, of, signature)(builder, given, loc) if made is None else made

        return generate

    return get_function


def _field_of_record(found: Callable[..., Any]) -> Callable[..., Any]:
    """Give arrays in records a description that keeps their place and shape."""

    def get_getattr(self: Any, kind: Any, name: str) -> Any:
        return indexing.field(kind, name) or found(self, kind, name)

    return get_getattr


def _remembered(found: Callable[..., Any]) -> Callable[..., Any]:
    """Remember what a method gives for its object and its arguments."""
    known = dict[tuple[Any, ...], tuple[Any, Any]]()

    def recalled(self: Any, *given: Any) -> Any:
        key = (id(self), *given)
        if key not in known:
            known[key] = (self, found(self, *given))  # with the object, or its id could become another's
        return known[key][1]

    return recalled


def _without_lifetimes(found: Callable[..., Any]) -> Callable[..., Any]:
    """Find the places where variables die only if that matters."""

    def run(self: Any, *args: Any, **kws: Any) -> None:
        code = self.func_ir
        if not _Plain.now or code.is_generator:
            found(self, *args, **kws)
            return
        code.blocks = cast(Any, transforms).canonicalize_cfg(code.blocks)
        lifetime: Any = postproc.VariableLifetime
        code.variable_lifetime, code.generator_info = lifetime(code.blocks), None

    return run


def _numbas_own(found: Callable[..., Any]) -> Callable[..., Any]:
    """Leave numba's own functions unchanged."""

    def run(self: Any, state: Any) -> None:
        with plainly(False):
            found(self, state)

    return run


# The name of a record type lists a hundred fields. For the size of a type llvmlite writes and reads a module.
_CHANGES: tuple[tuple[Any, str, Change], ...] = (
    (BaseFunction, "get_call_type", cache(_by_type)),
    (types.Record, "__repr__", cache(_remembered)),
    (base.BaseContext, "get_abi_sizeof", cache(_remembered)),
    (base.BaseContext, "get_getattr", _field_of_record),
    (cpu.CPUContext, "get_function", _searched_once),
    (postproc.PostProcessor, "run", _without_lifetimes),
    (PassManager, "run", _numbas_own),
)


@contextmanager
def briskly() -> Iterator[None]:
    """Have numba remember what it looked up. One thread at a time compiles here."""
    with global_compiler_lock:
        if not IS_KNOWN:
            yield
            return
        before = [(owner, name, vars(owner).get(name)) for owner, name, _ in _CHANGES]
        lock = cast(Any, ffi).lib._lock
        told, lock._cblist = lock._cblist, []  # numba takes the time of each call of LLVM
        try:
            for owner, name, change in _CHANGES:
                setattr(owner, name, change(getattr(owner, name)))
            yield
        finally:
            lock._cblist = told
            for owner, name, own in before:
                if own is None:
                    delattr(owner, name)
                else:
                    setattr(owner, name, own)
