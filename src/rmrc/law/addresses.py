"""Use addresses in compiled code: call machine code, read numbers, and fetch a record from memory."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any, cast

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils, types
from numba.extending import intrinsic
from numpy.typing import NDArray

_WORD = ir.IntType(64)
_function: Any = cgutils.get_or_insert_function
# Bytes that a processor's memory moves at once.
_LINE = 64


def _typed_call(_: Any, address: Any, first: Any, second: Any) -> Any:
    def generate(context: Any, builder: Any, _: Any, given: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [_WORD, _WORD])
        builder.call(builder.inttoptr(given[0], kind.as_pointer()), given[1:])
        return context.get_dummy_value()

    return types.none(address, first, second), generate


def _typed_words(_: Any, address: Any, count: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        code: Any = cgutils
        words = code.create_struct_proxy(signature.return_type)(context, builder)  # without an owner
        words.data = builder.inttoptr(given[0], _WORD.as_pointer())
        words.nitems, words.itemsize = given[1], _WORD(_WORD.width // 8)
        words.shape = code.pack_array(builder, [words.nitems])
        words.strides = code.pack_array(builder, [words.itemsize])
        return words._getvalue()

    return types.Array(types.int64, 1, "C")(address, count), generate


def _typed_fetch(_: Any, record: Any) -> Any:
    def generate(context: Any, builder: Any, _: Any, given: Any) -> Any:
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
        prefetch = _function(builder.module, kind, "llvm.prefetch.p0")
        start, to_write, nearest, data = builder.bitcast(given[0], byte), number(1), number(3), number(1)
        for at in (*range(0, record.size, _LINE), record.size - 1):
            builder.call(prefetch, [builder.gep(start, [_WORD(at)]), to_write, nearest, data])
        return context.get_dummy_value()

    return types.none(record), generate


_make: Any = intrinsic
# Returns the 64-bit words that begin at an address, (count,): of memory that another owns.
words_at: Callable[[int, int], NDArray[np.int64]] = _make(_typed_words)
# Calls a C function that takes two pointers and returns nothing.
call_c: Callable[[int, int, int], None] = _make(_typed_call)
# Has the processor load a record that is written soon into its cache, while it does other work.
fetch: Callable[[Any], None] = _make(_typed_fetch)


def caller_of(count: int) -> Callable[[int, int, int], int]:
    """Return a compiled function that calls an entry at its address: (address, words, last) -> its int.

    The entry takes `count` 64-bit words, which begin at the address `words` (`words_of` makes them from
    arrays), and then one int.
    """
    taken = [types.int64] * (count + 1)

    def typed(_: Any, address: Any, words: Any, last: Any) -> Any:
        def generate(context: Any, builder: Any, _: Any, given: Any) -> Any:
            convention, start = context.call_conv, builder.inttoptr(given[1], _WORD.as_pointer())
            values = [builder.load(builder.gep(start, [_WORD(i)])) for i in range(count)]
            called = builder.inttoptr(given[0], convention.get_function_type(types.int64, taken).as_pointer())
            status, value = convention.call_function(builder, called, types.int64, taken, [*values, given[2]])
            with builder.if_then(status.is_error, likely=False):
                convention.return_status_propagate(builder, status)
            return value

        return types.int64(address, words, last), generate

    return cast(Callable[[int, int, int], int], _make(typed))


# The field of a world's record with the address of a function for compiled code: it takes the offset of the
# field of a late function in the record, compiles that function, and returns its address, or 0.
LATE = "call_late"
# The types of a function's arguments that compiled code needs to call it at an address.
TYPES: Mapping[Any, Any] = {
    int: types.int64, float: types.float64, bool: types.boolean, None: types.none,
}  # fmt: skip


def caller(field: str, function: Callable[..., object], is_late: bool = False) -> Callable[..., Any]:
    """Return a function that calls another at the address that its first argument, a world, holds."""
    signature, code = inspect.signature(function), cast(Any, cgutils)
    names, result = tuple(signature.parameters), TYPES[signature.return_annotation]
    message = f"nothing is at {field}: a world is first given to rmrc.law.jit.machine_code"

    def word(builder: Any, world: Any, kind: Any, name: str) -> Any:
        return code.get_record_member(builder, world, kind.offset(name), _WORD)

    def typed(context: Any, *given: Any) -> Any:  # noqa: ARG001 - as numba calls it
        told = (signature.parameters[name].annotation for name in names)
        taken = [TYPES.get(one, kind) for one, kind in zip(told, given, strict=True)]

        def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
            convention, place = context.call_conv, word(builder, values[0], given[0], field)
            address, nowhere = builder.load(place), _WORD(0)
            if is_late:
                at = code.alloca_once_value(builder, address)
                late = builder.load(word(builder, values[0], given[0], LATE))
                is_missing = builder.icmp_unsigned("==", address, nowhere)
                with code.if_unlikely(
                    builder, builder.and_(is_missing, builder.icmp_unsigned("!=", late, nowhere))
                ):
                    find = builder.inttoptr(late, ir.FunctionType(_WORD, [_WORD]).as_pointer())
                    found = builder.call(find, [_WORD(given[0].offset(field))])
                    builder.store(found, place)
                    builder.store(found, at)
                address = builder.load(at)
            with code.if_unlikely(builder, builder.icmp_unsigned("==", address, nowhere)):
                convention.return_user_exc(builder, RuntimeError, (message,))
            kind = convention.get_function_type(result, taken)
            called = builder.inttoptr(address, kind.as_pointer())
            status, value = convention.call_function(builder, called, result, taken, values)
            with code.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return value

        return result(*taken), generate

    arguments, made = ", ".join(names), {"typed": typed}
    exec(f"def call(context, {arguments}): return typed(context, {arguments})", made)
    return cast(Callable[..., Any], intrinsic(made["call"]))


def words_of(array: NDArray[Any]) -> list[int]:
    """Return an array in numba's layout: no owner, item count, item size, address, shape and strides."""
    return [0, 0, array.size, array.itemsize, array.ctypes.data, *array.shape, *array.strides]
