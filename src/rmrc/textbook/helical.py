"""An arm with a helical joint: a screw column, a boom that slides out of it, a crank on the boom.

The screw turns about z of frame {0} and rises by h = p/2π per radian, p per turn [Selig92, §6.6].
The boom slides along the rotating x axis. The crank, of length l, turns about the boom, and points sideways
at 0. q = (θ₁, d₂, θ₃). The arm is not from the notes: its crank can move the tip along the screw's helix, so
the singular configurations depend on the pitch.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def helical_position(pitch: ArrayLike, crank: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the tip in frame {0}.

    p = (c₁ d₂ − s₁ l c₃, s₁ d₂ + c₁ l c₃, h θ₁ + l s₃) [Selig92, §6.6].

    Args:
        pitch: h, the rise in a radian, (...) [m/rad].
        crank: l, (...) [m].
        q: θ₁, d₂, θ₃, (..., 3) [rad, m, rad].

    Returns:
        [x, y, z], (..., 3) [m].

    Example:
        A full turn raises the tip by 2π h, without another change:

        >>> helical_position(0.5 / (2 * np.pi), 0.4, [2 * np.pi, 0.8, 0.0]).round(3)
        array([0.8, 0.4, 0.5])
    """
    h, arm, c1, s1, d2, c3, s3, q1 = _terms(pitch, crank, q)
    return np.stack([c1 * d2 - s1 * arm * c3, s1 * d2 + c1 * arm * c3, h * q1 + arm * s3], axis=-1)


def helical_jacobian(pitch: ArrayLike, crank: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of the tip in frame {0}: the screw's column is (ẑ × p + h ẑ; ẑ).

    A helical joint is a hinge and a slide on one axis whose rates are as 1 to h, so its column
    is the hinge's and h times the slide's [Selig92, §6.6].

    Args:
        pitch: h, the rise in a radian, (...) [m/rad].
        crank: l, (...) [m].
        q: θ₁, d₂, θ₃, (..., 3) [rad, m, rad].

    Returns:
        Rows [v; ω], (..., 6, 3).

    Example:
        >>> helical_jacobian(0.1, 0.4, [0.0, 0.8, 0.0]).round(3) + 0.0
        array([[-0.4,  1. ,  0. ],
               [ 0.8,  0. ,  0. ],
               [ 0.1,  0. ,  0.4],
               [ 0. ,  0. ,  1. ],
               [ 0. ,  0. ,  0. ],
               [ 1. ,  0. ,  0. ]])
    """
    h, arm, c1, s1, d2, c3, s3, _ = _terms(pitch, crank, q)
    zero, one = np.zeros_like(h), np.ones_like(h)
    rows = (
        (-s1 * d2 - c1 * arm * c3, c1, s1 * arm * s3),
        (c1 * d2 - s1 * arm * c3, s1, -c1 * arm * s3),
        (h, zero, arm * c3),
        (zero, zero, c1),
        (zero, zero, s1),
        (one, zero, zero),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def helical_determinant(pitch: ArrayLike, crank: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return det J_v = −l (d₂ c₃ + h s₃), of the three linear rows.

    It is 0 where the crank can move the tip only along the helix of the screw:
    tan θ₃ = −d₂/h. With pitch 0 the crank then points straight up or down; the pitch tilts it.

    Args:
        pitch: h, the rise in a radian, (...) [m/rad].
        crank: l, (...) [m].
        q: θ₁, d₂, θ₃, (..., 3) [rad, m, rad].

    Returns:
        det J_v, (...) [m²].

    Example:
        >>> helical_determinant(0.1, 0.4, [0.3, 0.8, 0.0]).round(3)
        np.float64(-0.32)
    """
    h, arm, _, _, d2, c3, s3, _ = _terms(pitch, crank, q)
    return np.asarray(-arm * (d2 * c3 + h * s3))[()]


def helical_singular_crank(pitch: ArrayLike, reach: ArrayLike) -> NDArray[np.float64]:
    """Return the crank angle at which the arm is singular, θ₃ = atan2(d₂, −h); half a turn on, too.

    Args:
        pitch: h, the rise in a radian, (...) [m/rad].
        reach: d₂, (...) [m].

    Returns:
        θ₃, (...) [rad].

    Example:
        >>> np.degrees(helical_singular_crank(0.1, 0.8)).round(2)
        np.float64(97.13)
    """
    return np.asarray(np.arctan2(reach, -np.asarray(pitch, dtype=np.float64)))[()]


def _terms(pitch: ArrayLike, crank: ArrayLike, q: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Return h, l, c₁, s₁, d₂, c₃, s₃, θ₁, all of one shape."""
    q = np.asarray(q, dtype=np.float64)
    h = np.asarray(pitch, dtype=np.float64)
    q1, d2, q3 = q[..., 0], q[..., 1], q[..., 2]
    return np.broadcast_arrays(
        h, np.asarray(crank, dtype=np.float64), np.cos(q1), np.sin(q1), d2, np.cos(q3), np.sin(q3), q1
    )
