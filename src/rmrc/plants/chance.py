"""Random numbers of a tick: counted, not drawn in turn, so that a world's depend on its own keys alone.

They come from the words of Philox4x64-10 [Salmon11], which numpy has as `numpy.random.Philox`. Its key is a
seed and a stream, which names the purpose of the numbers. Its counter is the tick.
"""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rmrc.law.compiling import Array, compiled

# Multipliers of a round, and the increments of the two words of the key between rounds.
_FIRST, _SECOND = np.uint64(0xD2E7470EE14C6C93), np.uint64(0xCA5A826395121157)
_STEP_FIRST, _STEP_SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBB67AE8584CAA73B)
_ROUNDS = 10
_LOW, _HALF, _REST = np.uint64(0xFFFFFFFF), np.uint64(32), np.uint64(11)
_SCALE = 2.0**-53

# A call names the stream of its numbers, so that no two purposes share any.
TRANSPORT = 1  # jitter and loss of commands
ENCODER_NOISE = 2

# The ziggurat [Marsaglia00] has one layer per value of a byte, all of equal area. The lowest is number 0: it
# includes the tail beyond its edge, and is as wide as a box of that area. The narrowest is number 1.
_LAYERS, _EDGE = 256, 3.6541528853610088
_AREA = _EDGE * math.exp(-0.5 * _EDGE**2) + math.sqrt(0.5 * math.pi) * math.erfc(_EDGE / math.sqrt(2.0))
# A word holds, from its low end, the layer (a byte), the sign (a bit), and the position inward (52 bits).
_BYTE, _MANTISSA = 255, 2**52 - 1

Four = tuple[np.uint64, np.uint64, np.uint64, np.uint64]
Words: TypeAlias = NDArray[np.int64]


def _ziggurat() -> Array:
    """Return the width of each layer, the extent of its inside, per 2⁻⁵² of it, and its density, (256, 3)."""
    width = np.empty(_LAYERS)
    width[0], width[-1] = _AREA / math.exp(-0.5 * _EDGE**2), _EDGE
    for i in range(_LAYERS - 1, 1, -1):
        width[i - 1] = math.sqrt(-2.0 * math.log(_AREA / width[i] + math.exp(-0.5 * width[i] ** 2)))
    inside = np.roll(width, 1) / width * 2.0**52
    inside[0], inside[1] = _EDGE / width[0] * 2.0**52, 0.0
    density = np.array([1.0, *(math.exp(-0.5 * x**2) for x in width[1:])])
    return np.stack([width * 2.0**-52, np.trunc(inside), density], axis=1)


_LAYER = _ziggurat()


def word(seed: int) -> int:
    """Return the word that a record holds for a seed of any size: from numpy's `SeedSequence`."""
    return int(np.random.SeedSequence(seed).generate_state(1, np.uint64).view(np.int64)[0])


@compiled
def _high(a: np.uint64, b: np.uint64) -> np.uint64:
    """Return the upper word of a · b."""
    a0, a1, b0, b1 = a & _LOW, a >> _HALF, b & _LOW, b >> _HALF
    middle = a1 * b0 + ((a0 * b0) >> _HALF)
    other = a0 * b1 + (middle & _LOW)
    return a1 * b1 + (middle >> _HALF) + (other >> _HALF)


@compiled
def words(seed: int, stream: int, first: int, second: int) -> Four:
    """Return the four words of Philox with a key of seed and stream, at a counter of two words and zeros."""
    key0, key1 = np.uint64(seed), np.uint64(stream)
    c0, c1, c2, c3 = np.uint64(first), np.uint64(second), np.uint64(0), np.uint64(0)
    for _ in range(_ROUNDS):
        high0, high1 = _high(_FIRST, c0), _high(_SECOND, c2)
        c0, c1, c2, c3 = high1 ^ c1 ^ key0, _SECOND * c2, high0 ^ c3 ^ key1, _FIRST * c0
        key0, key1 = key0 + _STEP_FIRST, key1 + _STEP_SECOND
    return c0, c1, c2, c3


@compiled
def uniforms(seed: int, stream: int, tick: int) -> tuple[float, float]:
    """Return two numbers of a tick from [0, 1), made from the words at the tick's counter.

    Args:
        seed: Seed of the world, as `word` makes it.
        stream: Their purpose, as above.
        tick: Number of the tick.
    """
    first, second, _, _ = words(seed, stream, tick, 0)
    return (first >> _REST) * _SCALE, (second >> _REST) * _SCALE


@compiled
def normals(seed: int, stream: int, tick: int, count: int, drawn: Words, found: Array) -> None:
    """Write numbers of the standard normal distribution, the same as numpy's `standard_normal` draws.

    The generator of a tick is a `numpy.random.Philox` whose first counter is the words 0, tick, 0, 0. All but
    one of a hundred numbers take one word, one multiplication and one comparison.

    Args:
        seed: Seed of the world, as `word` makes it.
        stream: Their purpose, as above.
        tick: Number of the tick.
        count: How many numbers to write.
        drawn: Scratch, with room for a multiple of four.
        found: Written, (count,) or longer.
    """
    for k in range(0, count, 4):
        drawn[k], drawn[k + 1], drawn[k + 2], drawn[k + 3] = words(seed, stream, k // 4, tick)
    place = 0
    for k in range(count):
        found[k], place = _draw(seed, stream, tick, place, count, drawn)


@compiled
def _draw(seed: int, stream: int, tick: int, place: int, count: int, drawn: Words) -> tuple[float, int]:
    """Return a normal number from the word at a place or from several, and the place behind them."""
    while True:
        word = _word(seed, stream, tick, place, count, drawn)
        layer, inward = word & _BYTE, (word >> 9) & _MANTISSA
        x, sign, place = inward * _LAYER[layer, 0], 1 - ((word >> 7) & 2), place + 1
        if inward < _LAYER[layer, 1]:
            return sign * x, place
        if layer == 0:  # beyond the edge, by exponential numbers [Marsaglia64]
            beyond, fall = 1.0, 0.0
            while 2.0 * fall <= beyond * beyond:
                beyond = -math.log1p(-_unit(seed, stream, tick, place, count, drawn)) / _EDGE
                fall = -math.log1p(-_unit(seed, stream, tick, place + 1, count, drawn))
                place += 2
            return (1 - ((inward >> 7) & 2)) * (_EDGE + beyond), place
        low, high, place = _LAYER[layer, 2], _LAYER[layer - 1, 2], place + 1
        if low + (high - low) * _unit(seed, stream, tick, place - 1, count, drawn) < math.exp(-0.5 * x * x):
            return sign * x, place


@compiled
def _word(seed: int, stream: int, tick: int, place: int, count: int, drawn: Words) -> np.int64:
    """Return a word of a tick, of which those up to a multiple of four have been drawn."""
    if place < (count + 3) // 4 * 4:
        return np.int64(drawn[place])
    return np.int64(words(seed, stream, place // 4, tick)[place % 4])


@compiled
def _unit(seed: int, stream: int, tick: int, place: int, count: int, drawn: Words) -> float:
    """Return a number from [0, 1), made from a word of a tick."""
    return (np.uint64(_word(seed, stream, tick, place, count, drawn)) >> _REST) * _SCALE
