"""Use addresses in compiled code: call machine code, read numbers, and fetch a record from memory."""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils, types
from numba.extending import intrinsic
from numba.np import arrayobj
from numpy.typing import NDArray

_WORD = ir.IntType(64)
_function: Any = cgutils.get_or_insert_function
_arrays: Any = arrayobj
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
        words = _arrays.make_array(signature.return_type)(context, builder)
        size = context.get_constant(types.intp, _WORD.width // 8)
        data = builder.inttoptr(given[0], _WORD.as_pointer())
        _arrays.populate_array(words, data, [given[1]], [size], size, None)
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


def words_of(array: NDArray[Any]) -> list[int]:
    """Return an array in numba's layout: no owner, item count, item size, address, shape and strides."""
    return [0, 0, array.size, array.itemsize, array.ctypes.data, *array.shape, *array.strides]
