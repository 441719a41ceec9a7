"""Random numbers of a tick: numpy's own Philox has the same, bit for bit; the normal ones are normal."""

import math

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rmrc.plants.chance import normals, uniforms, word

WORD = st.integers(0, 2**64 - 1)


@numba.njit
def uniform(seed, stream, tick, block):
    return uniforms(seed, stream, tick, block)


@numba.njit
def normal(seed, stream, tick, block):
    a, b, c, d = uniforms(seed, stream, tick, block)
    return normals(a, b) + normals(c, d)


def as_word(value):
    """Return the int64 of the same bits."""
    return int(np.uint64(value).view(np.int64))


def by_numpy(seed, stream, tick, block):
    """Return the same four numbers; numpy raises its counter before it draws."""
    counter = (tick + (block << 64) - 1) % 2**256
    drawn = np.random.Philox(counter=counter, key=seed + (stream << 64)).random_raw(4)
    return tuple((drawn >> np.uint64(11)) * 2.0**-53)


@given(WORD, WORD, WORD, WORD)
def test_they_are_philox(seed, stream, tick, block):
    assert uniform(*map(as_word, (seed, stream, tick, block))) == by_numpy(seed, stream, tick, block)


@pytest.mark.parametrize("place", range(4))
def test_each_argument_counts(place):
    arguments = [5, 6, 7, 8]
    before = uniform(*arguments)
    arguments[place] += 1
    assert not set(before) & set(uniform(*arguments))


def test_normal_ones_are_normal_and_independent():
    count = 20_000
    drawn = np.array([normal(1, 2, t, b) for t in range(count // 4) for b in range(2)])
    flat = np.sort(drawn.ravel())
    # Kolmogorov and Smirnov: beyond 1.95/√n once in a thousand, and these numbers are always the same
    expected = np.array([0.5 * math.erfc(-x / math.sqrt(2.0)) for x in flat])
    assert np.abs(np.arange(1, len(flat) + 1) / len(flat) - expected).max() < 1.95 / math.sqrt(len(flat))
    correlation = np.corrcoef(np.hstack([drawn[:-1], drawn[1:]]).T) - np.eye(8)
    assert np.abs(correlation).max() < 5.0 / math.sqrt(len(drawn))  # five standard deviations


def test_seeds_of_any_size_are_words_of_their_own():
    seeds = [*range(100), 2**63, 2**64, 2**200]
    assert len({word(seed) for seed in seeds}) == len(seeds)
    assert all(-(2**63) <= word(seed) < 2**63 for seed in seeds)
