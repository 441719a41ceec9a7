"""Random numbers of a tick: numpy's own Philox has the same bits, and its ziggurat the same normal numbers."""

import math

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from oracle_sensing import normals as normals_by_numpy
from rmrc.plants import chance

WORD = st.integers(0, 2**64 - 1)


@numba.njit
def words(seed, stream, first, second):
    return chance.words(seed, stream, first, second)


@numba.njit
def uniform(seed, stream, tick):
    return chance.uniforms(seed, stream, tick)


@numba.njit
def draw(seed, stream, tick, drawn, found):
    for i in range(len(found)):
        chance.normals(seed, stream, tick + i, found.shape[1], drawn, found[i])


def normal(seed, tick, count):
    """Return the normal numbers of a tick, (count,)."""
    return normals(seed, tick, count, 1)[0]


def normals(seed, first, count, ticks):
    """Return the normal numbers of some ticks, (ticks, count)."""
    found = np.full((ticks, count), np.nan)
    draw(chance.word(seed), chance.ENCODER_NOISE, first, np.empty(count + 3, np.int64), found)
    return found


def as_word(value):
    """Return the int64 of the same bits."""
    return int(np.uint64(value).view(np.int64))


def by_numpy(seed, stream, first, second):
    """Return the same four words; numpy raises its counter before it draws."""
    counter = (first + (second << 64) - 1) % 2**256
    return tuple(np.random.Philox(counter=counter, key=seed + (stream << 64)).random_raw(4))


@given(WORD, WORD, WORD, WORD)
def test_they_are_philox(seed, stream, first, second):
    drawn = by_numpy(seed, stream, first, second)
    assert words(*map(as_word, (seed, stream, first, second))) == drawn


@given(WORD, WORD, WORD)
def test_uniform_ones_are_the_first_two_words_of_a_tick(seed, stream, tick):
    drawn = by_numpy(seed, stream, tick, 0)[:2]
    assert uniform(*map(as_word, (seed, stream, tick))) == tuple(
        int(one) / 2**53 for one in np.array(drawn) >> np.uint64(11)
    )


@pytest.mark.parametrize("place", range(4))
def test_each_argument_counts(place):
    arguments = [5, 6, 7, 8]
    before = words(*arguments)
    arguments[place] += 1
    assert not set(before) & set(words(*arguments))


@given(st.integers(0, 2**200), st.integers(0, 2**62), st.integers(1, 20))
def test_normal_ones_are_those_that_numpy_draws(seed, tick, count):
    # widths of layers are the sums of 255 logarithms, each rounded
    assert_allclose(normal(seed, tick, count), normals_by_numpy(seed, tick, count), rtol=1e-13)


@pytest.mark.parametrize("tick", [0, 1, 10**9])
def test_so_are_those_beyond_the_edge_and_between_layers(tick):
    found = normal(3, tick, 100_000)
    # of these some 26 are beyond the lowest layer's edge, and 1,200 are drawn between two layers
    assert (np.abs(found) > 3.6541528853610088).sum() > 10
    assert_allclose(found, normals_by_numpy(3, tick, 100_000), rtol=1e-13)


@given(st.integers(0, 2**200), st.integers(0, 2**62), st.integers(1, 8))
def test_those_of_many_ticks_at_once_are_those_of_each(seed, first, count):
    found = normals(seed, first, count, 100)
    np.testing.assert_array_equal(found, [normal(seed, first + i, count) for i in range(100)])


def test_those_of_ticks_and_joints_are_independent():
    drawn = np.array([normal(1, tick, 8) for tick in range(5_000)])
    correlation = np.corrcoef(np.hstack([drawn[:-1], drawn[1:]]).T) - np.eye(16)
    assert np.abs(correlation).max() < 5.0 / math.sqrt(len(drawn))  # five standard deviations


def test_seeds_of_any_size_are_words_of_their_own():
    seeds = [*range(100), 2**63, 2**64, 2**200]
    assert len({chance.word(seed) for seed in seeds}) == len(seeds)
    assert all(-(2**63) <= chance.word(seed) < 2**63 for seed in seeds)
