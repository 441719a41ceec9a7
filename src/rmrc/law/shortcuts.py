"""Repeated look-ups and needless steps of numba, left out while it compiles this package.

Each change gives what numba's own code gives, only sooner, for functions that count no references to arrays.
They last while this package compiles, under numba's lock. Other versions of numba than those known to
`rmrc.law.brisk` compile without these changes, which takes longer.
"""

import operator
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, cast

from llvmlite import ir as llvm  # type: ignore[import-untyped]
from llvmlite.binding import ffi  # type: ignore[import-untyped]
from numba.core import base, cgutils, cpu, inline_closurecall, ir, postproc, transforms, types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.types.functions import BaseFunction
from numba.core.typing import context

from rmrc.law import indexing
from rmrc.law.brisk import Plain, plainly
from rmrc.law.linking import Part, in_turn
from rmrc.support import lifetime

Change = Callable[[Any], Callable[..., Any]]

# Lookups of these functions are skipped: numba would search all its registries for each of them every time.
_OPTIONAL = "__array__", "static_getitem", "static_setitem"
# Operators on numbers: their code depends on the types of the numbers and not on the values.
_OF_NUMBERS = frozenset({
    operator.add, operator.sub, operator.mul, operator.truediv, operator.iadd, operator.isub, operator.imul,
    operator.itruediv, operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne,
})  # fmt: skip


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
            known[key] = indexing.result(self.typing_key, args) or found(self, context, args, kws)
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
        if not Plain.now or code.is_generator:
            found(self, *args, **kws)
            return
        code.blocks = cast(Any, transforms).canonicalize_cfg(code.blocks)
        lifetime: Any = postproc.VariableLifetime
        code.variable_lifetime, code.generator_info = lifetime(code.blocks), None

    return run


class _Inlined:
    """Whether the functions that are read now become a part of their caller, and are ours."""

    now = False


def _numbas_own(found: Callable[..., Any]) -> Callable[..., Any]:
    """Leave numba's own functions unchanged."""

    def run(self: Any, state: Any) -> None:
        if _Inlined.now:
            in_turn(self, state)
            return
        with plainly(False):
            found(self, state)

    return run


class _Fresh:
    """The module `copy` where the original is not needed."""

    @staticmethod
    def deepcopy(original: Any) -> Any:
        return original


def _inlined_once(found: Callable[..., Any]) -> Callable[..., Any]:
    """Inline the code of a function that was just read for this call; numba would copy it twice."""

    def inline_function(self: Any, *about: Any, **more: Any) -> Any:
        module: Any = inline_closurecall
        before, _Inlined.now, copies = _Inlined.now, Plain.now, module.copy
        module.copy = _Fresh if Plain.now else copies
        try:
            return found(self, *about, **more)
        finally:
            _Inlined.now, module.copy = before, copies

    return inline_function


def _variables(value: Any) -> list[Any]:
    """Return the variables in a part of an instruction."""
    kind = type(value)
    if kind is ir.Var:
        return [value]
    if kind is dict:
        value = value.values()
    elif kind is not tuple and kind is not list:
        return cast(list[Any], cast(Any, value).list_vars()) if isinstance(value, ir.Inst) else []
    found = []
    for one in value:
        if type(one) is ir.Var:
            found.append(one)
        elif type(one) not in _WITHOUT:
            found += _variables(one)
    return found


# Types of most parts of instructions that are no variables.
_WITHOUT = frozenset({str, int, float, bool, type(None), ir.Loc})


def _listed_faster(_: Callable[..., Any]) -> Callable[..., Any]:
    """Find the variables of an instruction by the types of its parts."""

    def list_within(self: Any, value: Any) -> list[Any]:  # noqa: ARG001 - as numba calls it
        return _variables(value)

    return list_within


def _called_plainly(found: Callable[..., Any]) -> Callable[..., Any]:
    """Call a function of this package that raises nothing without a look at its status."""

    def user_function(described: Any, libraries: Any) -> Any:
        checked = found(described, libraries)
        if not all(isinstance(one, Part) and one.raises_nothing for one in libraries) or isinstance(
            described.restype, types.Optional
        ):
            return checked

        def call(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            convention, kind = context.call_conv, described.restype
            if signature.return_type != kind:
                return checked(context, builder, signature, given)
            function = context.declare_function(builder.module, described)
            place, error = (one.type for one in function.args[:2])
            result = cast(Any, cgutils).alloca_once(builder, place.pointee)
            flat = convention._get_arg_packer(described.argtypes).as_arguments(builder, given)
            builder.call(function, [result, llvm.Constant(error, None), *flat])
            return context.get_returned_value(builder, kind, builder.load(result))

        call.signature, call.libs = checked.signature, checked.libs  # type: ignore[attr-defined]
        return call

    return user_function


@contextmanager
def _without_scipy() -> Iterator[None]:
    """Have numba not import scipy.linalg, in a process that compiles nothing for others.

    Numba asks whether it is there before it first compiles, for products of matrices that no function of this
    package takes.
    """
    name = "scipy.linalg"
    if not lifetime.ends_with_job or name in sys.modules or "numba.np.arraymath" in sys.modules:
        yield
        return
    sys.modules[name] = cast(Any, None)
    try:
        yield
    finally:
        del sys.modules[name]


def _alone(found: Callable[..., Any]) -> Callable[..., Any]:
    """Register everything that can be compiled, without scipy."""

    def refresh(self: Any) -> None:
        with _without_scipy():
            found(self)

    return refresh


# The name of a record type lists a hundred fields. For the size of a type llvmlite writes and reads a module.
# Whether a function takes the place in the source is read from its signature, for each instruction.
_CHANGES: tuple[tuple[Any, str, Change], ...] = (
    (BaseFunction, "get_call_type", cache(_by_type)),
    (types.Record, "__repr__", cache(_remembered)),
    (base.BaseContext, "get_abi_sizeof", cache(_remembered)),
    (base.BaseContext, "get_getattr", _field_of_record),
    (base.BaseContext, "refresh", _alone),
    (context.BaseContext, "refresh", _alone),
    (base, "_has_loc", cache(cache)),
    (base, "user_function", _called_plainly),
    (cpu.CPUContext, "get_function", _searched_once),
    (postproc.PostProcessor, "run", _without_lifetimes),
    (PassManager, "run", _numbas_own),
    (inline_closurecall.InlineWorker, "inline_function", _inlined_once),
    (ir.Inst, "_rec_list_vars", _listed_faster),
)


@contextmanager
def shortened() -> Iterator[None]:
    """Have numba take shortcuts, and remember what it looked up."""
    with global_compiler_lock:
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
