"""The Sobol sequence: points that fill a unit cube more evenly than random points, by index."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

# Number of binary digits: nobody runs more than 2**32 samples.
_BITS = 32

# A primitive polynomial over {0, 1} as a binary number, and the first direction numbers, of each dimension
# [JoeKuo08, new-joe-kuo-6.21201]. The first dimension is van der Corput's sequence.
_DIRECTIONS = (
    (1, (1,) * _BITS), (3, (1,)), (7, (1, 3)), (11, (1, 3, 1)), (13, (1, 1, 1)), (19, (1, 1, 3, 3)),
    (25, (1, 3, 5, 13)), (37, (1, 1, 5, 5, 17)), (41, (1, 1, 5, 5, 5)), (47, (1, 1, 7, 11, 19)),
    (55, (1, 1, 5, 1, 1)), (59, (1, 1, 1, 3, 11)), (61, (1, 3, 5, 5, 31)), (67, (1, 3, 3, 9, 7, 49)),
    (91, (1, 1, 1, 15, 21, 21)), (97, (1, 3, 1, 13, 27, 49)), (103, (1, 1, 1, 15, 7, 5)),
    (109, (1, 3, 1, 15, 13, 25)), (115, (1, 1, 5, 5, 19, 61)), (131, (1, 3, 7, 11, 23, 15, 103)),
)  # fmt: skip


def _direction_numbers(polynomial: int, first: Sequence[int]) -> list[int]:
    """Return v_k = m_k / 2ᵏ of a dimension as binary fractions.

    m_k = 2 a₁ m_{k-1} ⊕ … ⊕ 2ˢ m_{k-s} ⊕ m_{k-s}, with the coefficients a of the polynomial [JoeKuo08].
    """
    degree, m = len(first), list(first)
    for k in range(degree, _BITS):
        m.append(m[k - degree])
        for i in range(1, degree + 1):
            m[k] ^= (m[k - i] << i) * (polynomial >> (degree - i) & 1)
    return [number << (_BITS - 1 - k) for k, number in enumerate(m)]


_V = np.array([_direction_numbers(*dimension) for dimension in _DIRECTIONS], np.uint32)  # (20, 32)


def sobol_point(index: int, dimensions: int, seed: int | None = None) -> NDArray[np.float64]:
    """Return one point of the Sobol sequence in the unit cube.

    x = ⊕ v_j over the digits j of Gray's code i ⊕ ⌊i/2⌋ that are 1 [JoeKuo08]. A seed shifts all points by
    one random point, digit by digit, which keeps every box as evenly filled and the origin out.

    Args:
        index: From 0 on, below 2³².
        dimensions: 1 to 20.
        seed: Seed of the digital shift; None: no shift.

    Returns:
        A point in [0, 1), (dimensions,).

    Example:
        >>> [sobol_point(i, 2).tolist() for i in range(4)]
        [[0.0, 0.0], [0.5, 0.5], [0.75, 0.25], [0.25, 0.75]]
    """
    gray = index ^ (index >> 1)
    digits = [j for j in range(_BITS) if gray >> j & 1]
    point = np.bitwise_xor.reduce(_V[:dimensions, digits], axis=1)
    if seed is not None:
        point ^= np.random.default_rng(seed).integers(2**_BITS, size=len(_V), dtype=np.uint32)[:dimensions]
    return np.asarray(point * 2.0**-_BITS)
