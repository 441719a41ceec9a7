"""The three joints of exercise 6.1, whose singular tip positions are a hollow torus [Selig92].

The first axis is z of frame {0}. The first link carries the second axis away from it by l₁; the
second and the third axis are horizontal and square to that link, so that the links l₂ and l₃ move
in the plane through the first axis. Seen in that plane the tip is at the signed distance
ρ = l₁ + l₂ c₂ + l₃ c₂₃ from the axis and at the height z = l₂ s₂ + l₃ s₂₃. `lengths` is l₁, l₂, l₃
in m, `q` is in radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.textbook.dh import DHChain

Array = NDArray[np.float64]

# For squares of lengths of order 1 m, a point this far beyond a boundary counts as on it.
_ON_BOUNDARY = 1e-12


def torus_chain(lengths: ArrayLike) -> DHChain:
    """Return the arm's modified table; the tip is the point (l₃, 0, 0) of frame 3.

    Args:
        lengths: l₁, l₂, l₃, (3,) [m].

    Returns:
        The chain of rows (α_i-1, a_i-1, d_i, θ_i).

    Example:
        >>> (torus_chain([1.2, 0.6, 0.4]).frames([0, 0, 0])[3] @ [0.4, 0, 0, 1]).round(3) + 0.0
        array([2.2, 0. , 0. , 1. ])
    """
    l1, l2, _ = (float(length) for length in np.asarray(lengths, dtype=np.float64))
    return DHChain(
        table=((0.0, 0.0, 0.0, 0.0), (np.pi / 2, l1, 0.0, 0.0), (0.0, l2, 0.0, 0.0)),
        kinds=("revolute", "revolute", "revolute"),
    )


def torus_position(lengths: ArrayLike, q: ArrayLike) -> Array:
    """Return the tip in frame {0}: p = (c₁ ρ, s₁ ρ, z) [Selig92, exercise 6.1 (i)].

    Args:
        lengths: l₁, l₂, l₃, (..., 3) [m].
        q: θ₁, θ₂, θ₃, (..., 3) [rad].

    Returns:
        [x, y, z], (..., 3) [m].

    Example:
        >>> torus_position([1.2, 0.6, 0.4], np.radians([90, 90, -90])).round(3) + 0.0
        array([0. , 1.6, 0.6])
    """
    c1, s1, rho, z, _, _ = _section(lengths, q)
    return np.stack(np.broadcast_arrays(c1 * rho, s1 * rho, z), axis=-1)


def torus_jacobian(lengths: ArrayLike, q: ArrayLike) -> Array:
    """Return the Jacobian of the tip in frame {0} [Selig92, exercise 6.1 (ii)].

    The columns are (−s₁ ρ, c₁ ρ, 0), (−c₁ z, −s₁ z, l₂ c₂ + l₃ c₂₃) and
    (−c₁ l₃ s₂₃, −s₁ l₃ s₂₃, l₃ c₂₃), over the axes (0, 0, 1) and twice (s₁, −c₁, 0).

    Args:
        lengths: l₁, l₂, l₃, (..., 3) [m].
        q: θ₁, θ₂, θ₃, (..., 3) [rad].

    Returns:
        Rows [v; ω], (..., 6, 3).

    Example:
        >>> torus_jacobian([1.2, 0.6, 0.4], np.radians([0, 0, 90]))[:3].round(3) + 0.0
        array([[ 0. , -0.4, -0.4],
               [ 1.8,  0. ,  0. ],
               [ 0. ,  0.6,  0. ]])
    """
    c1, s1, rho, z, r3, z3 = np.broadcast_arrays(*_section(lengths, q))
    l1 = np.asarray(lengths, dtype=np.float64)[..., 0]
    zero, one = np.zeros_like(rho), np.ones_like(rho)
    rows = (
        (-s1 * rho, -c1 * z, -c1 * z3),
        (c1 * rho, -s1 * z, -s1 * z3),
        (zero, rho - l1, r3),
        (zero, s1, s1),
        (zero, -c1, -c1),
        (one, zero, zero),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def torus_factors(lengths: ArrayLike, q: ArrayLike) -> Array:
    """Return the two factors of the determinant that can be 0 [Selig92, exercise 6.1 (iii)].

    s₃ = 0: the outer links are stretched or folded, and the tip is on a torus around the first axis:
    its tube is l₂ + l₃, or |l₂ − l₃| for the hollow within. ρ = 0: the tip is on the first axis.

    Args:
        lengths: l₁, l₂, l₃, (..., 3) [m].
        q: θ₁, θ₂, θ₃, (..., 3) [rad].

    Returns:
        [s₃, ρ], (..., 2) [1, m].

    Example:
        >>> torus_factors([1.2, 0.6, 0.4], np.radians([0, 180, 30])).round(3)
        array([0.5  , 0.254])
    """
    _, _, rho, _, _, _ = _section(lengths, q)
    return np.stack(np.broadcast_arrays(np.sin(np.asarray(q, dtype=np.float64)[..., 2]), rho), axis=-1)


def torus_determinant(lengths: ArrayLike, q: ArrayLike) -> Array:
    """Return det J_v = −l₂ l₃ s₃ ρ, of the three linear rows.

    Args:
        lengths: l₁, l₂, l₃, (..., 3) [m].
        q: θ₁, θ₂, θ₃, (..., 3) [rad].

    Returns:
        det J_v, (...) [m³].

    Example:
        >>> torus_determinant([1.2, 0.6, 0.4], np.radians([0, 0, 90])).round(3)
        np.float64(-0.432)
    """
    lengths = np.asarray(lengths, dtype=np.float64)
    return np.asarray(-lengths[..., 1] * lengths[..., 2] * np.prod(torus_factors(lengths, q), axis=-1))[()]


def torus_tube(lengths: ArrayLike, point: ArrayLike) -> Array:
    """Return the distance of a point from the circle of the second joint: the tube radius of its torus.

    √((√(x² + y²) − l₁)² + z²). With its outer links outward, the arm reaches the points between |l₂ − l₃| and
    l₂ + l₃. Both surfaces are singular [Selig92, exercise 6.1 (iii)].

    Args:
        lengths: l₁, l₂, l₃, (..., 3) [m].
        point: [x, y, z], (..., 3) [m].

    Returns:
        Distance, (...) [m].

    Example:
        >>> torus_tube([1.2, 0.6, 0.4], [0, 2.2, 0]).round(3)
        np.float64(1.0)
    """
    point = np.asarray(point, dtype=np.float64)
    outward = np.hypot(point[..., 0], point[..., 1]) - np.asarray(lengths, dtype=np.float64)[..., 0]
    return np.asarray(np.hypot(outward, point[..., 2]))[()]


def torus_postures(lengths: ArrayLike, point: ArrayLike) -> Array:
    """Return every posture that puts the tip at a point, in closed form [Selig92, exercise 6.1 (iv, v)].

    The first joint turns the plane of the outer links towards the point, ρ = √(x² + y²), or away from
    it, ρ = −√(x² + y²), and in that plane two links reach (ρ − l₁, z) in two ways: up to 4 postures.
    With l₁ > l₂ + l₃ the arm cannot reach back over the first axis, so there are 2. On a singular surface two
    of them coincide.

    Args:
        lengths: l₁, l₂, l₃, all positive, (3,) [m].
        point: [x, y, z], (3,) [m].

    Returns:
        Postures with angles in (−π, π], (k, 3) [rad], k from 0 to 4. An angle is nan where it can be
        anything: θ₁ for a point on the first axis, of which the rows are circles of postures; and θ₂
        for a point on the circle of the second joint, where l₂ = l₃.

    Example:
        A long first link has two postures, a short one four:

        >>> torus_postures([1.2, 0.6, 0.4], [1.6, 0, 0.6]).shape
        (2, 3)
        >>> np.degrees(torus_postures([0.3, 0.6, 0.4], [0.2, 0, 0.7])).round(1) + 0.0
        array([[  0. ,  63.7,  92.4],
               [  0. , 132.5, -92.4],
               [180. , 101.1,  62.7],
               [180. , 149.9, -62.7]])
    """
    l1, l2, l3 = np.asarray(lengths, dtype=np.float64)
    x, y, z = np.asarray(point, dtype=np.float64)
    distance = np.hypot(x, y)
    found = []
    for side in (1.0, -1.0) if distance > 0.0 else (1.0,):
        theta1 = _wrapped(np.arctan2(side * y, side * x)) if distance > 0.0 else np.nan
        outward = side * distance - l1
        c3 = (outward**2 + z**2 - l2**2 - l3**2) / (2.0 * l2 * l3)
        if abs(c3) > 1.0 + _ON_BOUNDARY:
            continue
        on_boundary = abs(c3) >= 1.0 - _ON_BOUNDARY
        bend = (0.0 if c3 > 0.0 else np.pi) if on_boundary else np.arccos(c3)
        for theta3 in (bend,) if on_boundary else (bend, -bend):
            along, across = l2 + l3 * np.cos(theta3), l3 * np.sin(theta3)
            theta2 = np.arctan2(z, outward) - np.arctan2(across, along)
            anywhere = on_boundary and l2 == l3 and c3 < 0.0
            found.append((theta1, np.nan if anywhere else _wrapped(theta2), theta3))
    return np.array(found, dtype=np.float64).reshape(-1, 3)


def _wrapped(angle: float) -> float:
    """Return the same angle in (−π, π]."""
    return float(np.pi - (np.pi - angle) % (2.0 * np.pi))


def _section(lengths: ArrayLike, q: ArrayLike) -> tuple[Array, ...]:
    """Return c₁, s₁, the tip's ρ and z, and the last link's part of both."""
    lengths, q = np.asarray(lengths, dtype=np.float64), np.asarray(q, dtype=np.float64)
    q2, q23 = q[..., 1], q[..., 1] + q[..., 2]
    r3, z3 = lengths[..., 2] * np.cos(q23), lengths[..., 2] * np.sin(q23)
    rho = lengths[..., 0] + lengths[..., 1] * np.cos(q2) + r3
    return np.cos(q[..., 0]), np.sin(q[..., 0]), rho, lengths[..., 1] * np.sin(q2) + z3, r3, z3
