"""The decomposition of a matrix that differs little from the last one, with whole rows in vector registers.

    V = U A,  G_ij = v_i·v_j / (v_i·v_i − v_j·v_j),  U ← (I + G + G²/2 + G³/8) U

turns all pairs of rows at once [Ogita18], where Jacobi's method turns one pair after the other. G is skew, so
the new U is orthonormal to the sixth power of the angles. The next sweep finds angles of their squares.

Rows are padded to WIDTH with zeros. Products and sums have a fixed order and are not fused. The bits are the
same on processors whose registers hold less than a row.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils, types
from numba.extending import intrinsic

from rmrc.law.jit import Array, Record, apart
from rmrc.law.record import CAPACITY as WIDTH
from rmrc.law.record import ROWS
from rmrc.law.svd import HUGE, ORTHOGONAL, SMALL, TINY, sort_falling

# With fewer rows, one pair after the other is faster.
FEWEST = 4
# With larger angles the method may not converge. Three sweeps reduce angles up to this one to SMALL.
LARGEST, SWEEPS = 0.03, 4
# Beyond this condition number, cosines would have to be smaller than the measured angles.
WORST = 100.0

_REAL, _WORD, _NUMBER = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_ROW = ir.VectorType(_REAL, WIDTH)
_Rows: TypeAlias = Sequence[Any]
_untyped: Any = types
_function: Any = cgutils.get_or_insert_function


def _all(value: float) -> Any:
    return ir.Constant(_ROW, [value] * WIDTH)


def _mixed(builder: Any, a: Any, b: Any, places: Sequence[int]) -> Any:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_NUMBER, len(places)), list(places)))


def _spread(builder: Any, value: Any) -> Any:
    """Return a row of one value."""
    nothing = ir.Constant(_ROW, ir.Undefined)
    return _mixed(builder, builder.insert_element(nothing, value, _NUMBER(0)), nothing, [0] * WIDTH)


def _places(context: Any, builder: Any, kind: Any, array: Any) -> list[Any]:
    """Return where the rows of a matrix (ROWS, WIDTH) are."""
    start = context.make_array(kind)(context, builder, array).data
    return [builder.bitcast(builder.gep(start, [_WORD(WIDTH * i)]), _ROW.as_pointer()) for i in range(ROWS)]


def _load(builder: Any, places: _Rows) -> list[Any]:
    rows = [builder.load(place) for place in places]
    for row in rows:
        row.align = 8
    return rows


def _entry(builder: Any, place: Any, j: int) -> Any:
    """Return a row whose places all hold one entry of a row in memory."""
    start = builder.bitcast(place, _REAL.as_pointer())
    return _spread(builder, builder.load(builder.gep(start, [_WORD(j)])))


def _sum(builder: Any, terms: _Rows) -> Any:
    """Return the sum of rows, added in pairs."""
    left = list(terms)
    while len(left) > 1:
        pairs = zip(left[::2], left[1::2], strict=False)
        left = [builder.fadd(a, b) for a, b in pairs] + left[len(left) // 2 * 2 :]
    return left[0]


def _product(builder: Any, places: _Rows, rows: _Rows, is_skew: bool = False) -> list[Any]:
    """Return the rows of the product of a matrix in memory, possibly a skew one, and one in registers."""
    found = []
    for i, place in enumerate(places):
        used = [(j, row) for j, row in enumerate(rows) if not is_skew or j != i]
        found.append(_sum(builder, [builder.fmul(_entry(builder, place, j), row) for j, row in used]))
    return found


def _lengths2(builder: Any, rows: _Rows) -> tuple[list[Any], Any]:
    """Return the columns of ROWS rows, and their squared lengths."""
    columns = _transposed(builder, [*rows, *[_all(0.0)] * (WIDTH - ROWS)])
    return columns, _sum(builder, [builder.fmul(column, column) for column in columns])


def _transposed(builder: Any, rows: _Rows) -> list[Any]:
    """Return the columns of WIDTH rows: blocks of 1, 2 and 4 entries change places in turn."""
    columns = list(rows)
    for size in (1, 2, 4):
        low = [j + (WIDTH - size if j & size else 0) for j in range(WIDTH)]
        for i in (i for i in range(WIDTH) if not i & size):
            a, b = columns[i], columns[i + size]
            columns[i] = _mixed(builder, a, b, low)
            columns[i + size] = _mixed(builder, a, b, [j + size for j in low])
    return columns


def _typed_times(_: Any, to: Any, a: Any, b: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        found, left, right = (
            _places(context, builder, *one) for one in zip(signature.args, given, strict=True)
        )
        for row, place in zip(_product(builder, left, _load(builder, right)), found, strict=True):
            builder.store(row, place, align=8)
        return context.get_dummy_value()

    return types.none(to, a, b), generate


def _typed_turn(shares: Sequence[float]) -> Any:
    """Return the generator of code for rows + Σ share · angles^power · rows, of the powers from 1 on."""

    def typed(_: Any, rows: Any, angles: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            places, of_angles = (
                _places(context, builder, *one) for one in zip(signature.args, given, strict=True)
            )
            before = power = _load(builder, places)
            terms = [[row] for row in before]
            for share in shares:
                power = _product(builder, of_angles, power, is_skew=True)
                for term, row in zip(terms, power, strict=True):
                    term.insert(1, builder.fmul(_all(share), row) if share != 1.0 else row)
            for place, (row, *small) in zip(places, terms, strict=True):
                builder.store(builder.fadd(row, _sum(builder, small)), place, align=8)
            return context.get_dummy_value()

        return types.none(rows, angles), generate

    return typed


def _typed_measure(_: Any, rows: Any, angles: Any, norm2: Any, small: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        of_rows, of_angles = (
            _places(context, builder, *one) for one in zip(signature.args[:2], given[:2], strict=True)
        )
        norms = context.make_array(signature.args[2])(context, builder, given[2]).data
        nothing, most = _all(0.0), _spread(builder, builder.fmul(given[3], given[3]))
        columns, square = _lengths2(builder, _load(builder, of_rows))
        largest, is_loose = nothing, ir.Constant(ir.VectorType(ir.IntType(1), WIDTH), [0] * WIDTH)
        for i, (place, angle) in enumerate(zip(of_rows, of_angles, strict=True)):
            others = ir.Constant(ir.VectorType(ir.IntType(1), WIDTH), [int(j != i) for j in range(WIDTH)])
            own = builder.extract_element(square, _NUMBER(i))
            builder.store(own, builder.gep(norms, [_WORD(i)]))
            own = _spread(builder, own)
            inner = _sum(
                builder, [builder.fmul(_entry(builder, place, j), column) for j, column in enumerate(columns)]
            )
            inner = builder.select(others, inner, nothing)
            inner2, both = builder.fmul(inner, inner), builder.fmul(own, square)
            differs = builder.fcmp_ordered(">", inner2, builder.fmul(_all(ORTHOGONAL**2), both))
            below = builder.select(differs, builder.fsub(own, square), _all(1.0))
            tangent = builder.fdiv(builder.select(differs, inner, nothing), below)
            builder.store(tangent, angle, align=8)
            tangent2 = builder.fmul(tangent, tangent)
            largest = builder.select(builder.fcmp_ordered(">", largest, tangent2), largest, tangent2)
            is_loose = builder.or_(is_loose, builder.fcmp_ordered(">", inner2, builder.fmul(most, both)))
        for half in (4, 2, 1):
            other = _mixed(builder, largest, largest, [(j + half) % WIDTH for j in range(WIDTH)])
            largest = builder.select(builder.fcmp_ordered(">", largest, other), largest, other)
        loose = builder.icmp_unsigned("!=", builder.bitcast(is_loose, ir.IntType(8)), ir.IntType(8)(0))
        found = builder.extract_element(largest, _NUMBER(0))
        return context.make_tuple(builder, signature.return_type, [found, loose])

    return _untyped.Tuple((types.float64, types.boolean))(rows, angles, norm2, small), generate


def _typed_normalize(_: Any, rows: Any, lengths: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        places = _places(context, builder, signature.args[0], given[0])
        start = context.make_array(signature.args[1])(context, builder, given[1]).data
        rows, nothing = _load(builder, places), _all(0.0)
        _, square = _lengths2(builder, rows)
        root = _function(builder.module, ir.FunctionType(_ROW, [_ROW]), f"llvm.sqrt.v{WIDTH}f64")
        length = builder.call(root, [square])
        is_row = builder.fcmp_ordered(">", length, nothing)
        inverse = builder.fdiv(_all(1.0), builder.select(is_row, length, _all(1.0)))
        for i, (place, row) in enumerate(zip(places, rows, strict=True)):
            own = builder.extract_element(length, _NUMBER(i))
            builder.store(own, builder.gep(start, [_WORD(i)]))
            own = _spread(builder, builder.extract_element(inverse, _NUMBER(i)))
            builder.store(builder.fmul(own, row), place, align=8)
        return context.get_dummy_value()

    return types.none(rows, lengths), generate


_make: Any = intrinsic
# Writes a product of two matrices (ROWS, WIDTH), of which the first has no more columns than ROWS that count.
times: Callable[[Array, Array, Array], None] = _make(_typed_times)
# Turn rows by angles: by angles of any size, and by angles whose third power is below rounding.
turn: Callable[[Array, Array], None] = _make(_typed_turn((1.0, 0.5, 0.125)))
turn_little: Callable[[Array, Array], None] = _make(_typed_turn((1.0, 0.5)))
# Gives rows length 1, leaves zero rows as they are, and writes the lengths before.
normalize: Callable[[Array, Array], None] = _make(_typed_normalize)
# (rows, angles, norm2, small): writes the angles that make rows orthogonal, and the squared lengths of these;
# returns the square of the largest angle, and whether any cosine between two rows is above `small`.
measure: Callable[[Array, Array, Array, float], tuple[float, bool]] = _make(_typed_measure)


@apart("call_sharpen", k=tuple(range(FEWEST, ROWS + 1)))
def sharpen(world: Record, A: Array, sigma: Array) -> bool:
    """Decompose A as `svd` does, warm-started from the last u; return False where `svd` must do it.

    `svd` must do it if the matrix has more rows than columns, has rows that are too wide, has changed too
    much, has nearly lost its rank, or has singular values that nearly meet.
    """
    k, n, u, v = world.k, world.n, world.u, world.v
    if world.m > n or A.shape[1] != WIDTH:
        return False
    for _ in range(SWEEPS):
        times(v, u, A)
        largest, is_loose = measure(v, world.angles, sigma, SMALL)
        least = most = sigma[0]
        for i in range(1, k):
            least, most = min(least, sigma[i]), max(most, sigma[i])
        if not (largest <= LARGEST**2 and most < WORST**2 * least and TINY < most < HUGE):
            return False
        if largest <= SMALL**2 and not is_loose:
            turn_little(u, world.angles)
            turn_little(v, world.angles)
            normalize(v, sigma)
            sort_falling(sigma, v, u, k, n)
            return True
        turn(u, world.angles)
    return False
