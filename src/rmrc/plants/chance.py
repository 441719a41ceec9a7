"""Random numbers of a tick: counted, not drawn in turn, so that a world's depend on its own keys alone.

They are Philox4x64-10's [Salmon11], which numpy has as `numpy.random.Philox`. Its key is a seed and a stream,
which says what the numbers are for; its counter is the tick and a block, of which each has four numbers. So
joint j takes number j mod 4 of block j div 4.
"""

import math

import numpy as np

from rmrc.law.jit import compiled

# Multipliers of a round, and what is added to the two words of the key between rounds.
_FIRST, _SECOND = np.uint64(0xD2E7470EE14C6C93), np.uint64(0xCA5A826395121157)
_STEP_FIRST, _STEP_SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBB67AE8584CAA73B)
_ROUNDS = 10
_LOW, _HALF, _REST = np.uint64(0xFFFFFFFF), np.uint64(32), np.uint64(11)
_UNIT = 2.0**-53

# A call names the stream of its numbers, so that no two purposes share any.
TRANSPORT = 1  # jitter and loss of commands
ENCODER_NOISE = 2

Four = tuple[float, float, float, float]


def word(seed: int) -> int:
    """Return what a record holds of a seed, which may be of any size: a word of numpy's `SeedSequence`."""
    return int(np.random.SeedSequence(seed).generate_state(1, np.uint64).view(np.int64)[0])


@compiled
def _high(a: np.uint64, b: np.uint64) -> np.uint64:
    """Return the upper word of a · b."""
    a0, a1, b0, b1 = a & _LOW, a >> _HALF, b & _LOW, b >> _HALF
    middle = a1 * b0 + ((a0 * b0) >> _HALF)
    other = a0 * b1 + (middle & _LOW)
    return a1 * b1 + (middle >> _HALF) + (other >> _HALF)


@compiled
def uniforms(seed: int, stream: int, tick: int, block: int) -> Four:
    """Return four numbers of a tick from [0, 1).

    Args:
        seed: Of the world, as `word` has it.
        stream: What they are for, as above.
        tick: Its number.
        block: Which four.
    """
    key0, key1 = np.uint64(seed), np.uint64(stream)
    c0, c1, c2, c3 = np.uint64(tick), np.uint64(block), np.uint64(0), np.uint64(0)
    for _ in range(_ROUNDS):
        high0, high1 = _high(_FIRST, c0), _high(_SECOND, c2)
        c0, c1, c2, c3 = high1 ^ c1 ^ key0, _SECOND * c2, high0 ^ c3 ^ key1, _FIRST * c0
        key0, key1 = key0 + _STEP_FIRST, key1 + _STEP_SECOND
    return (c0 >> _REST) * _UNIT, (c1 >> _REST) * _UNIT, (c2 >> _REST) * _UNIT, (c3 >> _REST) * _UNIT


@compiled
def normals(a: float, b: float) -> tuple[float, float]:
    """Return two numbers of the standard normal distribution, made of two of `uniforms` [Box58]."""
    radius, angle = math.sqrt(-2.0 * math.log(1.0 - a)), 2.0 * math.pi * b
    return radius * math.cos(angle), radius * math.sin(angle)
