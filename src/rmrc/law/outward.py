"""Kinematics of a chain, outward from its base, with eight axes at a time in vector registers, or with four.

The rotation before each axis is the product of the rotations about the axes before it. Two steps make the
products within both groups of four rotations, each step all at once [Hillis86]; one after the other, they
take four steps. The product of the first group then comes before those of the second.

Products and sums have a fixed order and are not fused. The bits are the same on processors whose registers
hold less than eight numbers.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import types
from numba.extending import intrinsic

from rmrc.law.jit import Array
from rmrc.law.record import AXIS, HALF, STEP, TURNS

LANES, GROUP = 8, 4
# A multiple of π/2 is subtracted in two parts; the first has so few bits that products with it are exact.
_FIRST, _REST = 1.57079632673412561417, 6.07710050650619224932e-11
# The sum with this number is rounded to an integer, which is in its last bits.
_ROUND = 1.5 * 2.0**52
# Minimax polynomials within ±π/4: sin x = x + x³ P(x²), cos x = 1 − x²/2 + x⁴ P(x²), of fdlibm (Sun, 1993).
_SINE = (
    -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
    2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10,
)  # fmt: skip
_COSINE = (
    4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
    -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11,
)  # fmt: skip

_REAL, _WORD, _NUMBER = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_ROW = ir.VectorType(_REAL, LANES)
_untyped: Any = types


class _Row:
    """The numbers in a register, and the code of their sums and products."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def of(self, value: Any) -> "_Row":
        """Return a row of one number, or a row as it is."""
        if isinstance(value, _Row):
            return value
        return _Row(self.builder, ir.Constant(self.value.type, [float(value)] * self.value.type.count))

    def __add__(self, other: Any) -> "_Row":
        return _Row(self.builder, self.builder.fadd(self.value, self.of(other).value))

    def __sub__(self, other: Any) -> "_Row":
        return _Row(self.builder, self.builder.fsub(self.value, self.of(other).value))

    def __mul__(self, other: Any) -> "_Row":
        return _Row(self.builder, self.builder.fmul(self.value, self.of(other).value))

    def behind(self, count: int, first: Any, size: int = GROUP) -> "_Row":
        """Return the numbers some places further on within each group of a size, behind others."""
        lanes = self.value.type.count
        places = [lanes + i % size if i % size < count else i - count for i in range(lanes)]
        return self.mixed(self.of(first), places)

    def mixed(self, other: "_Row", places: Sequence[int]) -> "_Row":
        """Return numbers of two registers."""
        taken = ir.Constant(ir.VectorType(_NUMBER, len(places)), list(places))
        return _Row(self.builder, self.builder.shuffle_vector(self.value, other.value, taken))

    def groups(self) -> tuple["_Row", "_Row"]:
        """Return both groups."""
        return self.mixed(self, range(GROUP)), self.mixed(self, range(GROUP, LANES))

    @property
    def last(self) -> Any:
        """The last number of a group."""
        return self.builder.extract_element(self.value, _NUMBER(GROUP - 1))


_Rows: TypeAlias = Sequence[_Row]


def _spread(builder: Any, value: Any) -> _Row:
    """Return a row of one number."""
    first = _Row(builder, builder.insert_element(ir.Constant(_ROW, ir.Undefined), value, _NUMBER(0)))
    return first.mixed(first, [0] * LANES)


def _polynomial(x: _Row, of: Sequence[float]) -> _Row:
    x2 = x * x
    return (x * of[1] + of[0]) + x2 * ((x * of[3] + of[2]) + x2 * (x * of[5] + of[4]))


def _sine_and_cosine(x: _Row) -> tuple[_Row, _Row]:
    """Return both to 2e-16; for angles beyond 1e6, to half a unit in the last place of the angle."""
    builder, rounded = x.builder, x * (2.0 / math.pi) + _ROUND
    quarters = rounded - _ROUND
    x = (x - quarters * _FIRST) - quarters * _REST
    x2 = x * x
    sine = x + (x * x2) * _polynomial(x2, _SINE)
    cosine = (x.of(1.0) - x2 * 0.5) + (x2 * x2) * _polynomial(x2, _COSINE)
    lanes = x.value.type.count
    words = ir.VectorType(_WORD, lanes)
    one, two, up = (ir.Constant(words, [number] * lanes) for number in (1, 2, 62))
    bits = builder.bitcast(rounded.value, words)
    is_odd = builder.trunc(bits, ir.VectorType(ir.IntType(1), lanes))

    def signed(odd: _Row, even: _Row, quarter: Any) -> _Row:
        """Return one or the other, negative in the third and fourth quarters."""
        taken = builder.bitcast(builder.select(is_odd, odd.value, even.value), words)
        sign = builder.shl(builder.and_(quarter, two), up)
        return _Row(builder, builder.bitcast(builder.xor(taken, sign), x.value.type))

    return signed(cosine, sine, bits), signed(sine, cosine, builder.add(bits, one))


def _product(a: _Rows, b: _Rows) -> list[_Row]:
    """Return the product of two quaternions."""
    return [
        (a[0] * b[0] - a[1] * b[1]) - (a[2] * b[2] + a[3] * b[3]),
        (a[0] * b[1] + a[1] * b[0]) + (a[2] * b[3] - a[3] * b[2]),
        (a[0] * b[2] - a[1] * b[3]) + (a[2] * b[0] + a[3] * b[1]),
        (a[0] * b[3] + a[1] * b[2]) - (a[2] * b[1] - a[3] * b[0]),
    ]


def _cross(a: _Rows, b: _Rows) -> list[_Row]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _turned(turn: _Rows, v: _Rows) -> list[_Row]:
    """Return v + 2 w (u × v) + 2 u × (u × v) of the quaternion (w, u)."""
    once = _cross(turn[1:], v)
    twice = _cross(turn[1:], once)
    return [x + (turn[0] * a + b) * 2.0 for x, a, b in zip(v, once, twice, strict=True)]


class _Table:
    """Some columns of an array, beginning with a given one; of a row alone, its numbers."""

    def __init__(
        self, context: Any, builder: Any, kind: Any, array: Any, first: Any, lanes: int = LANES
    ) -> None:
        made = context.make_array(kind)(context, builder, array)
        self.builder, self.start = builder, builder.gep(made.data, [first])
        self.kind = ir.VectorType(_REAL, lanes).as_pointer()
        self.width = builder.extract_value(made.shape, kind.ndim - 1)

    def place(self, row: int) -> Any:
        """Return the address of the numbers of a row."""
        at = self.builder.gep(self.start, [self.builder.mul(self.width, _WORD(row))])
        return self.builder.bitcast(at, self.kind)

    def rows(self, first: int, count: int) -> list[_Row]:
        """Read some rows."""
        found = [self.builder.load(self.place(first + i)) for i in range(count)]
        for one in found:
            one.align = 8
        return [_Row(self.builder, one) for one in found]

    def write(self, first: int, rows: _Rows) -> None:
        """Write some rows."""
        for i, row in enumerate(rows):
            self.builder.store(row.value, self.place(first + i), align=8)

    def number(self, at: Any) -> Any:
        """Return one number of the first row."""
        return self.builder.load(self.builder.gep(self.start, [at]))


# A rotation and a point: quaternion and position.
Place: TypeAlias = tuple[float, float, float, float, float, float, float]
HERE = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_PLACE = _untyped.UniTuple(types.float64, len(HERE))


def _turns(context: Any, builder: Any, kinds: Any, given: Any, at: Any, lanes: int) -> Any:
    """Return the target, axes, steps, slides along the axes, and rotations within groups of four axes."""
    of_chain, leaders, of_q, found = (
        _Table(context, builder, *one, lanes) for one in zip(kinds[:4], given[:4], at, strict=True)
    )
    values = ir.Constant(ir.VectorType(_REAL, lanes), ir.Undefined)
    for i in range(lanes):
        value = of_q.number(leaders.number(_WORD(i)))
        values = builder.insert_element(values, value, _NUMBER(i))
    moved, (half, along) = _Row(builder, values), of_chain.rows(HALF, 2)
    axis = of_chain.rows(AXIS, 3)
    sine, cosine = _sine_and_cosine(half * moved)
    turn = [cosine, *(sine * one for one in axis)]
    for count in (1, 2):
        turn = _product([one.behind(count, no) for one, no in zip(turn, HERE, strict=False)], turn)
    return found, axis, of_chain.rows(STEP, 3), along * moved, turn


def _typed_follow_short(_: Any, chain: Any, leader: Any, q: Any, outward: Any) -> Any:
    """Generate the code for a chain of at most four axes, as for the first group of eight."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        found, axis, step, way, turn = _turns(context, builder, signature.args, given, [_WORD(0)] * 4, GROUP)
        turned, ends = [one.behind(1, at) for one, at in zip(turn, HERE, strict=False)], []
        axis, point = _turned(turned, axis), _turned(turned, step)
        for i in range(3):
            go = way * axis[i]
            point[i] += go.behind(1, 0.0)
            for count in (1, 2):
                point[i] += point[i].behind(count, 0.0)
            ends.append(point[i] + go)
        found.write(0, [*axis, *point])
        return context.make_tuple(builder, _PLACE, [one.last for one in (*turn, *ends)])

    return _PLACE(chain, leader, q, outward), generate


def _typed_follow(is_first: bool) -> Any:
    """Return the generator of code for eight axes: the first of a chain, or those behind a place."""

    def typed(_: Any, chain: Any, leader: Any, q: Any, outward: Any, _a: Any, _n: Any, _at: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            at = [given[4]] * 2 + [_WORD(0)] + [given[4]]
            found, axis, step, way, turn = _turns(context, builder, signature.args, given, at, LANES)
            near, far = map(list, zip(*(one.groups() for one in turn), strict=True))
            before: Sequence[Any] = HERE
            if not is_first:
                before = [_spread(builder, builder.extract_value(given[6], i)) for i in range(len(HERE))]
                near = _product([one.groups()[0] for one in before[:4]], near)
            far = _product([_spread(builder, one.last).groups()[0] for one in near], far)
            turn = [a.mixed(b, range(LANES)) for a, b in zip(near, far, strict=True)]
            turned = [one.behind(1, at, LANES) for one, at in zip(turn, before, strict=False)]
            axis, point = _turned(turned, axis), _turned(turned, step)
            for i in range(3):
                go = way * axis[i]
                so_far = point[i] + go.behind(1, 0.0)
                for count in (1, 2):
                    so_far += so_far.behind(count, 0.0)
                (near_at, far_at), (near_go, far_go) = so_far.groups(), go.groups()
                near_at = near_at if is_first else near_at + before[4 + i].groups()[0]
                near.append(near_at + near_go)
                far_at += _spread(builder, near[-1].last).groups()[0]
                far.append(far_at + far_go)
                point[i] = near_at.mixed(far_at, range(LANES))
            found.write(0, [*axis, *point])
            is_near = builder.icmp_signed("<=", given[5], _WORD(GROUP))
            ends = (builder.select(is_near, a.last, b.last) for a, b in zip(near, far, strict=True))
            return context.make_tuple(builder, _PLACE, list(ends))

        return _PLACE(chain, leader, q, outward, types.int64, types.int64, _PLACE), generate

    return typed


def _typed_contribute(_: Any, chain: Any, outward: Any, point: Any, columns: Any, _first: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        at = [given[4], given[4], _WORD(0), given[4]]
        of_chain, found, of_point, target = (
            _Table(context, builder, *one) for one in zip(signature.args[:4], given[:4], at, strict=True)
        )
        axis, (turns, advance) = found.rows(0, 3), of_chain.rows(TURNS, 2)
        arm = [_spread(builder, of_point.number(_WORD(i))) - own for i, own in enumerate(found.rows(3, 3))]
        moves = [turns * a + advance * z for a, z in zip(_cross(axis, arm), axis, strict=True)]
        target.write(0, [*moves, *(turns * z for z in axis)])
        return context.get_dummy_value()

    return types.none(chain, outward, point, columns, types.int64), generate


_make: Any = intrinsic
# (chain, leader, q, outward, first, count, place): writes the axes and their anchors, [z; o] (6, ℓ), of eight
# axes from the first on, which come behind a place; returns the place behind them, of which `count` are real.
# The first eight come behind HERE, which is not multiplied.
follow_first: Callable[[Array, Any, Array, Array, int, int, Place], Place] = _make(_typed_follow(True))
follow_on: Callable[[Array, Any, Array, Array, int, int, Place], Place] = _make(_typed_follow(False))
# (chain, leader, q, outward): the same for a chain of at most four axes, with equal bits.
follow_short: Callable[[Array, Any, Array, Array], Place] = _make(_typed_follow_short)
# (chain, outward, point, columns, first): writes the contributions of eight axes to the twist of a point.
contribute: Callable[[Array, Array, Array, Array, int], None] = _make(_typed_contribute)
