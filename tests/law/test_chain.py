"""Compiled functions that are called in a chain, each where its condition holds."""

import numba
import numpy as np

from rmrc.law.jit import chain, compiled

RECORD = np.dtype([("adds", np.int64), ("doubles", np.int64)])


@compiled
def add(world, values):
    values[0] += 3.0 * world.adds


@compiled
def double(world, values):
    values[0] *= 2.0 * world.doubles


def caller(calls):
    """Return a function: whether functions add and double -> whether anything changed, and what 1 became."""
    changed = chain("changed", "world, values", calls)

    @numba.njit  # what is compiled here, compiled code alone can call
    def call(world, values):
        return changed(world, values)

    def called(adds, doubles):
        world, values = np.array([(adds, doubles)], RECORD), np.array([1.0])
        return call(world[0], values), values[0]

    return called


def test_what_is_used_is_called_in_order_and_nothing_else():
    calls = {"world.adds": add, "world.doubles": double}
    called = caller(calls)
    assert called(0, 0) == (False, 1.0)
    assert called(1, 0) == (True, 4.0)
    assert called(0, 1) == (True, 2.0)
    assert called(1, 1) == (True, 8.0)
    assert caller(dict(reversed(calls.items())))(1, 1) == (True, 5.0)  # the other way round


def test_a_code_chooses_one():
    called = caller({"world.adds == 1": add, "world.adds == 2": double})
    assert [called(code, 3) for code in (0, 1, 2)] == [(False, 1.0), (True, 4.0), (True, 6.0)]


def test_an_empty_chain_does_nothing():
    assert caller({})(1, 1) == (False, 1.0)
