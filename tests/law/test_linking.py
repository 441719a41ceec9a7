"""How functions are compiled: as numba compiles them, in less time, and numba is left as it was."""

import subprocess
import sys
from contextlib import suppress
from types import FunctionType

import numba
import numpy as np
import pytest
from numba.core.types.functions import BaseFunction

from rmrc.law import brisk, linking
from rmrc.law.jit import briskly, compiled
from rmrc.law.linking import WholeCompiler


def mixed(number, whole):
    """Return what a number and an integer make by operators of several types, one after the other."""
    total = 0.0
    for i in range(whole):
        total += number * i - i // 2 + (number if i % 3 == 0 else -i) ** 2 / (i + 1)
    return total


def test_remembered_typing_confuses_no_types():
    with briskly():
        ours = numba.njit(pipeline_class=WholeCompiler)(mixed)
        found = [ours(number, 10) for number in (3, 0.1, np.float32(0.1))]
    assert found == [mixed(3, 10), mixed(0.1, 10), numba.njit(mixed)(np.float32(0.1), 10)]
    assert found[1] != found[2]  # or the types would make no difference


def test_numba_types_calls_in_its_own_way_again():
    own = BaseFunction.get_call_type
    with suppress(KeyError), briskly():
        assert BaseFunction.get_call_type is not own
        raise KeyError  # as where something cannot be compiled
    assert BaseFunction.get_call_type is own


def test_what_cannot_be_compiled_says_in_which_step():
    with pytest.raises(
        numba.TypingError, match=r"Failed in nopython mode pipeline \(step: nopython frontend\)"
    ):
        numba.njit(pipeline_class=WholeCompiler)(lambda number: number.missing)(1.0)


KIND = np.dtype(
    [("n", np.int64), ("total", float), ("a", float, (3, 4)), ("b", float, (4,)), ("i", np.int64, (4,))]
)


def indexed(world, rows, first):
    """Read and write elements of arrays in records and of others, and find extremes and members of tuples.

    Elements are named by constants, loops, tuples, parts, and from the end.
    """
    for r in range(3):
        for c in range(-1, world.n):
            world.a[r, c] += first * rows[r, -c - 1] + world.b[world.i[c]]
        world.b[-1] -= total_of(world.a[r], world.n) + total_of(rows[-r], 2) + total_of(world.b, world.n)
    for c in range(world.n - 1, -5, -2):
        world.b[c % 4] += world.a[2][c] * world.a[-1, 1]
    for r in range(world.n - 9):  # none
        world.total += r
    last = 1 if world.b[3] > 0 else -2
    world.i[last] = world.i[2] + last
    world.total += world.a[1, 2] + world.b[0]
    world.total += max(rows[0][0], world.b[1], -first) - min(first, rows[1][1]) + int(9.0 * rows[0][2])
    world.total += max(world.n, 7, -3) + min(0.5 * world.n, world.n) + int(world.n)
    if world.n in (3, 4) and world.n not in (5,) and max(first, np.nan) == first != max(np.nan, first):
        world.total += 1.0
    return rows[0][1] + world.a[0][-1]


def total_of(values, count):
    """Return the sum of the first values, or of the last if their number is negative."""
    total = 0.0
    for i in range(count):
        total += values[i]
    return total


def records_of(seed):
    """Return a record and rows, in order or every second one of others."""
    random = np.random.default_rng(seed)
    world = np.zeros(1, KIND)
    world["n"], world["a"], world["b"] = 4, random.normal(size=(3, 4)), random.normal(size=4)
    world["i"] = random.integers(-4, 4, 4)
    return np.rec.array(world), random.normal(size=(3, 8))


@pytest.mark.parametrize(("step", "is_known"), [(1, True), (2, True), (1, False)])
def test_elements_and_loops_are_those_of_python(step, is_known, monkeypatch):
    for module in (brisk, linking):
        monkeypatch.setattr(module, "IS_KNOWN", is_known)
    of_rows, within = compiled(total_of), {**globals()}
    within["total_of"] = of_rows
    inner = compiled(FunctionType(indexed.__code__, within))
    outer = FunctionType(outwards.__code__, {**globals(), "inner": inner})
    ours = numba.njit(pipeline_class=WholeCompiler, _nrt=False)(outer)
    for seed in range(3):
        (world, rows), (wanted, _) = records_of(seed), records_of(seed)
        rows = rows[:, ::step]
        result = indexed(wanted[0], rows, 0.5)
        with briskly():
            found = ours(world.view(KIND).view(np.ndarray), rows, 0.5)
        assert found == result
        assert world.tobytes() == wanted.tobytes()
        assert world.tobytes() != records_of(seed)[0].tobytes()


def outwards(worlds, rows, first):
    """Call what is compiled as a part."""
    return inner(worlds[0], rows, first)  # noqa: F821 - given to it


def rooted(number):
    """Return the root of a number that has one."""
    if number < 0.0:
        raise ValueError("no root")
    return np.sqrt(number)


def doubled(number):
    return 2.0 * rooted(number)


def tripled(number):
    return 3.0 * number


def summed(number):
    return doubled(number) + tripled(number)


def test_what_can_raise_still_raises_through_its_callers():
    parts = {**globals(), "rooted": compiled(rooted), "tripled": compiled(tripled)}
    parts["doubled"] = compiled(FunctionType(doubled.__code__, parts))
    with briskly():
        found = numba.njit(pipeline_class=WholeCompiler, _nrt=False)(FunctionType(summed.__code__, parts))
        assert found(4.0) == 16.0
    with pytest.raises(ValueError, match="no root"):
        found(-4.0)
    libraries = {name: next(iter(parts[name].overloads.values())).library for name in PARTS}
    assert [name for name, one in libraries.items() if one.raises_nothing] == ["tripled"]


PARTS = "rooted", "doubled", "tripled"

ELSEWHERE = """
import sys, numba.core.codegen
numba.__version__ = "0.99"
del numba.core.codegen.JITCodeLibrary
from rmrc.law.jit import WholeCompiler, compiled
inner = compiled(lambda number: number + 1.0)
assert numba.njit(pipeline_class=WholeCompiler)(lambda number: 2.0 * inner(number))(3.0) == 8.0
assert not {"rmrc.law.shortcuts", "rmrc.law.linking"} & set(sys.modules)
"""


@pytest.mark.long  # elements and loops are tried without known internals above, in this process
def test_a_version_of_numba_without_its_present_internals_compiles():
    subprocess.run([sys.executable, "-c", ELSEWHERE], check=True, timeout=60)


def test_another_version_of_numba_compiles_in_its_own_way(monkeypatch):
    own = BaseFunction.get_call_type
    monkeypatch.setattr(brisk, "IS_KNOWN", False)
    with briskly():
        assert BaseFunction.get_call_type is own


def test_bounds_are_checked_where_numba_is_told_to():
    (world, _), beyond = records_of(0), lambda world, i: world.b[i]
    with briskly():
        one = numba.njit(boundscheck=True)(beyond)
        with pytest.raises(IndexError):
            one(world.view(KIND).view(np.ndarray)[0], 4)
