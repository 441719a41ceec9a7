"""The planar arm of exercise 6.3: a revolute joint at the origin, then a sliding one [Selig92].

At home the rod lies along x and its point Q is at (r₀, 0), with r₀ = 1 in the exercise. q = (θ, d): the
angle, and the displacement of the rod from home.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.textbook.dh import DHChain


def planar_rp_chain() -> DHChain:
    """Return the arm's modified table; Q is the point (0, 0, r₀) of frame 2.

    The sliding joint's axis is z of its frame: along the rod.

    Returns:
        The chain of rows (α_i-1, a_i-1, d_i, θ_i).

    Example:
        >>> (planar_rp_chain().frames([0, 0.5])[2] @ [0, 0, 1, 1]).round(3) + 0.0
        array([1.5, 0. , 0. , 1. ])
    """
    square = np.pi / 2
    return DHChain(table=((0.0, 0.0, 0.0, square), (square, 0.0, 0.0, 0.0)), kinds=("revolute", "prismatic"))


def planar_rp_position(q: ArrayLike, home_reach: ArrayLike = 1.0) -> NDArray[np.float64]:
    """Return the position of Q: (r cos θ, r sin θ) with r = r₀ + d [Selig92, exercise 6.3].

    Args:
        q: θ, d, (..., 2) [rad, m].
        home_reach: r₀, (...) [m].

    Returns:
        [x, y], (..., 2) [m].

    Example:
        >>> planar_rp_position([np.pi / 2, 0.5]).round(3)
        array([0. , 1.5])
    """
    q = np.asarray(q, dtype=np.float64)
    r = np.asarray(home_reach, dtype=np.float64) + q[..., 1]
    return np.stack([r * np.cos(q[..., 0]), r * np.sin(q[..., 0])], axis=-1)


def planar_rp_jacobian(q: ArrayLike, home_reach: ArrayLike = 1.0) -> NDArray[np.float64]:
    """Return the Jacobian of Q: the column of a sliding joint is its direction, without a rotation.

    J = [[−r sin θ, cos θ], [r cos θ, sin θ], [1, 0]] with r = r₀ + d [Selig92, exercise 6.3].

    Args:
        q: θ, d, (..., 2) [rad, m].
        home_reach: r₀, (...) [m].

    Returns:
        Rows x, y, rz in frame {0}, (..., 3, 2).

    Example:
        >>> planar_rp_jacobian([0, 0.5]).round(3) + 0.0
        array([[0. , 1. ],
               [1.5, 0. ],
               [1. , 0. ]])
    """
    q = np.asarray(q, dtype=np.float64)
    x, y = np.moveaxis(planar_rp_position(q, home_reach), -1, 0)
    c, s, zero, one = np.cos(q[..., 0]), np.sin(q[..., 0]), np.zeros_like(x), np.ones_like(x)
    rows = ((-y, c), (x, s), (one, zero))
    return np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in rows], axis=-2)


def planar_rp_determinant(q: ArrayLike, home_reach: ArrayLike = 1.0) -> NDArray[np.float64]:
    """Return det J = −r = −(r₀ + d), of the rows x and y: singular where Q is on the pivot.

    There the rotation does not move Q. It is not a boundary, because Q can leave it along the rod in both
    directions.

    Args:
        q: θ, d, (..., 2) [rad, m].
        home_reach: r₀, (...) [m].

    Returns:
        det J, (...) [m].

    Example:
        >>> planar_rp_determinant([0.3, -1.0])
        np.float64(0.0)
    """
    return np.asarray(-np.asarray(home_reach, dtype=np.float64) - np.asarray(q, dtype=np.float64)[..., 1])[()]
