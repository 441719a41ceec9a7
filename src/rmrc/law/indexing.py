"""Code for elements, loops, extremes and searches: like numba's, with fewer instructions to write.

Numba builds the description of an array in memory and reads it again for each element. The shape of an array
is known if it is a field of a record. The optimized code is the same.
"""

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils, types
from numba.np import arrayobj

_code, _arrays = cast(Any, cgutils), cast(Any, arrayobj)
Code = Callable[..., Any]
_WORD = ir.IntType(64)
# Where numba's description of an array has the address of its first element, its shape, and its strides.
_DATA, _SHAPE, _STRIDES = 4, 5, 6


class _Known(NamedTuple):
    """An array of a record: the address of its first element, its shape and strides, and its item size."""

    data: Any
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    size: int


def _of_record(array: Any, data: Any) -> _Known:
    return _Known(data, array.shape, array.strides, array.size)


def _described(builder: Any, of: Any, known: _Known) -> Any:
    """Return numba's description of an array, in its type there, which also keeps place and shape."""
    memory, parent = of.elements[:2]
    words = (ir.Constant(_WORD, one) for one in (math.prod(known.shape), known.size))
    extents = (
        ir.Constant(ir.ArrayType(_WORD, len(values)), [_WORD(one) for one in values])
        for values in (known.shape, known.strides)
    )
    parts = [memory(None), parent(None), *words, of.elements[_DATA](None), *extents]
    described = builder.insert_value(ir.Constant(of, parts), known.data, _DATA)
    described.known = known
    return described


def field(kind: Any, name: str) -> Code | None:
    """Return the generator of code for an array of a record; None: the field is no array."""
    if not (isinstance(kind, types.Record) and name in kind.fields):
        return None
    array = kind.typeof(name)
    if not isinstance(array, types.NestedArray):
        return None

    def generate(context: Any, builder: Any, typ: Any, record: Any, _: str) -> Any:
        context.sentry_record_alignment(typ, name)
        data = _code.get_record_member(builder, record, typ.offset(name), context.get_data_type(array.dtype))
        return _described(builder, context.get_value_type(array), _of_record(array, data))

    return generate


def code(of: Any, signature: Any) -> Code | None:
    """Return the generator of code for an operation; None: only numba has it.

    It generates None where only numba's own code is right.
    """
    if of in _LOOPS:
        kind, generate = _LOOPS[of]
        return generate if signature.args[0] == kind else None
    does = getattr(of, "typing_key", None)
    if does in _OF_NUMBERS:
        is_ours, generate = _OF_NUMBERS[does]
        return generate if is_ours(does, signature) else None
    return _of_element(does, signature) if does in (operator.getitem, operator.setitem) else None


def _of_element(does: Any, signature: Any) -> Code | None:
    """Return the generator of code for reading or writing an element; None: numba's own is right."""
    array, index = signature.args[:2]
    kinds = cast(Any, index).types if isinstance(index, types.BaseTuple) else (index,)
    if not isinstance(array, types.Array) or not all(isinstance(one, types.Integer) for one in kinds):
        return None
    if does is operator.setitem:
        value = signature.args[2]
        return _write if len(kinds) == array.ndim and isinstance(value, types.Number) else None
    return _read if len(kinds) == array.ndim or isinstance(array, types.NestedArray) else None


def result(does: Any, given: Sequence[Any]) -> Any:
    """Return the signature of an operation on numbers; None: only numba has it.

    For `max`, `min` and `int` numba would compile a function for each combination of types.
    """
    kinds = tuple(map(types.unliteral, given))
    if does is int and kinds in ((types.float64,), (types.int64,)):
        return types.int64(*kinds)
    if does in (max, min) and len(kinds) > 1 and set(kinds) in ({types.float64}, {types.int64}):
        return kinds[0](*kinds)
    return None


def _to_integer(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    return context.cast(builder, given[0], signature.args[0], signature.return_type)


def _largest(context: Any, builder: Any, signature: Any, given: Any) -> Any:  # noqa: ARG001 - as numba calls it
    return _extreme(builder, signature.return_type, ">", given)


def _smallest(context: Any, builder: Any, signature: Any, given: Any) -> Any:  # noqa: ARG001 - as numba calls it
    return _extreme(builder, signature.return_type, "<", given)


def _extreme(builder: Any, kind: Any, is_better: str, given: Any) -> Any:
    """Return the first number that no later one exceeds, as Python does."""
    best = given[0]
    compare = builder.fcmp_ordered if kind == types.float64 else builder.icmp_signed
    for one in given[1:]:
        best = builder.select(compare(is_better, one, best), one, best)
    return best


def _is_integral(numbers: Any, sought: Any) -> bool:
    """Return whether an integer is sought in a tuple of integers of its type."""
    return (
        isinstance(numbers, types.UniTuple) and isinstance(sought, types.Integer) and numbers.dtype == sought
    )


def _is_among(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    """Return whether a tuple has a number; numba would compile a loop."""
    found = context.get_constant(types.boolean, False)
    for one in _code.unpack_tuple(builder, given[0], signature.args[0].count):
        found = builder.or_(found, builder.icmp_signed("==", one, given[1]))
    return found


def _known(builder: Any, array: Any, described: Any) -> _Known | None:
    """Return the place and shape of an array of a record, or of a part of one; None: it is another."""
    if hasattr(described, "known"):
        return cast(_Known, described.known)
    is_field = isinstance(array, types.NestedArray)
    return _of_record(array, builder.extract_value(described, _DATA)) if is_field else None


def _read(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    array, index = signature.args
    known = _known(builder, array, given[0])
    count = len(index) if isinstance(index, types.BaseTuple) else 1
    if known is None and count < array.ndim:
        return None
    data = _place(context, builder, array, index, given, known)
    if known is None or count == array.ndim:
        return _arrays.load_item(context, builder, array, data)
    part = _Known(data, known.shape[count:], known.strides[count:], known.size)
    return _described(builder, context.get_value_type(signature.return_type), part)


def _write(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    array, index, kind = signature.args
    place = _place(context, builder, array, index, given, _known(builder, array, given[0]))
    _arrays.store_item(context, builder, array, context.cast(builder, given[2], kind, array.dtype), place)
    return context.get_dummy_value()


def _place(context: Any, builder: Any, array: Any, index: Any, given: Any, known: _Known | None) -> Any:
    """Return the address of an element, or of the first one of a part."""
    if isinstance(index, types.BaseTuple):
        kinds, indices = cast(Any, index).types, _code.unpack_tuple(builder, given[1], len(index))
    else:
        kinds, indices = (index,), [given[1]]
    if known is None:
        extents = [builder.extract_value(given[0], (_SHAPE, i)) for i in range(array.ndim)]
    else:
        extents = [_WORD(one) for one in known.shape]
    fixed = [
        _arrays.fix_integer_index(context, builder, kind, one, extent)
        for kind, one, extent in zip(kinds, indices, extents, strict=False)
    ]
    if known is None:
        data = builder.extract_value(given[0], _DATA)
        every = range(array.ndim if array.layout == "A" else 0)  # the others follow from the shape
        strides = [builder.extract_value(given[0], (_STRIDES, i)) for i in every]
        return _code.get_item_pointer2(context, builder, data, extents, strides, array.layout, fixed)
    at = None
    for i, one in enumerate(fixed):
        step = math.prod(known.shape[i + 1 :])
        term = one if step == 1 else builder.mul(one, _WORD(step))
        at = term if at is None else builder.add(at, term)
    return builder.gep(known.data, [at])


# Where numba's iterator of a range has its next number, its step, and how many are left.
_NEXT, _STEP, _LEFT = 0, 2, 3


def _count_to(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    """Make range(n)."""
    start = ir.Constant(context.get_value_type(signature.return_type), [_WORD(0), _WORD(0), _WORD(1)])
    state = builder.insert_value(start, given[0], 1)
    state.count = given[0]
    return state


def _begin(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    """Make the iterator of a range."""
    if not hasattr(given[0], "count"):
        return None
    following, left = (_code.alloca_once(builder, _WORD) for _ in range(2))
    builder.store(_WORD(0), following)
    is_some = builder.icmp_signed(">", given[0].count, _WORD(0))
    builder.store(builder.select(is_some, given[0].count, _WORD(0)), left)
    of = context.get_value_type(signature.return_type)
    iterator = builder.insert_value(ir.Constant(of, [None, _WORD(0), _WORD(1), None]), following, _NEXT)
    return builder.insert_value(iterator, left, _LEFT)


def _go_on(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    """Return the next number of a range, and whether there is one."""
    following, step, left = (builder.extract_value(given[0], i) for i in (_NEXT, _STEP, _LEFT))
    count = builder.load(left)
    is_one = builder.icmp_signed(">", count, _WORD(0))
    before = builder.block
    with builder.if_then(is_one):
        number = builder.load(following)
        builder.store(builder.sub(count, _WORD(1), flags=["nsw"]), left)
        builder.store(builder.add(number, step), following)
        within = builder.block
    found = builder.phi(_WORD)
    found.add_incoming(_WORD(0), before)
    found.add_incoming(number, within)
    pair = ir.Constant(context.get_value_type(signature.return_type), ir.Undefined)
    return builder.insert_value(builder.insert_value(pair, found, 0), is_one, 1)


def _is_result(does: Any, signature: Any) -> bool:
    return bool(result(does, signature.args) == signature)


# Operations on numbers: whether ours is right for a signature, and its code.
_OF_NUMBERS: dict[object, tuple[Callable[[Any, Any], bool], Code]] = {
    range: (lambda _, signature: bool(signature.args == (types.int64,)), _count_to),
    operator.contains: (lambda _, signature: _is_integral(*signature.args), _is_among),
    int: (_is_result, _to_integer), max: (_is_result, _largest), min: (_is_result, _smallest),
}  # fmt: skip
# Operations of a loop over a range of 64-bit integers, by their names in numba.
_LOOPS: dict[object, tuple[object, Code]] = {
    "getiter": (types.range_state64_type, _begin),
    "iternext": (types.range_iter64_type, _go_on),
}
