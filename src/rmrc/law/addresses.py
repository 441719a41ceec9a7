"""Use addresses in compiled code: call machine code, read numbers, and fetch a record from memory."""

from collections.abc import Callable
from typing import Any, cast

import numba
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from rmrc.law.jit import inlined

_WORD = ir.IntType(64)
_function: Any = cgutils.get_or_insert_function
# Bytes that a processor's memory moves at once.
_LINE = 64


def _typed_pointer(_: Any, address: Any) -> Any:
    def generate(context: Any, builder: Any, _: Any, given: Any) -> Any:
        return builder.inttoptr(given[0], context.get_value_type(types.voidptr))

    return types.voidptr(address), generate


def _typed_call(_: Any, address: Any, first: Any, second: Any) -> Any:
    def generate(context: Any, builder: Any, _: Any, given: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [_WORD, _WORD])
        builder.call(builder.inttoptr(given[0], kind.as_pointer()), given[1:])
        return context.get_dummy_value()

    return types.none(address, first, second), generate


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
_carray: Any = cast(Any, numba).carray
_pointer: Callable[[int], int] = _make(_typed_pointer)
# Calls a C function that takes two pointers and returns nothing.
call_c: Callable[[int, int, int], None] = _make(_typed_call)
# Has the processor load a record that is written soon into its cache, while it does other work.
fetch: Callable[[Any], None] = _make(_typed_fetch)


@inlined
def words_at(address: int, count: int) -> NDArray[np.int64]:
    """Return the 64-bit words that begin at an address, (count,)."""
    return _carray(_pointer(address), count, np.int64)  # type: ignore[no-any-return]


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
