"""Spatial arms and wrists of three joints, as printed in the notes.

The anthropomorphic arm has waist, shoulder and elbow. The notes are those on chapter 5 of [Craig05]. Frame
{0} is at the shoulder, z up, on the waist's axis; q = 0 stretches the arm out along y, since θ₁ = 90° + q₁.
`lengths` is L₂, L₃: the upper arm and the forearm. L₁, the height of the shoulder, moves no column of the
Jacobian.

The three joints of exercise 6.1 have singular tip positions that are a hollow torus [Selig92]. The first
axis is z of frame {0}. The first link carries the second axis away from it by l₁; the second and the third
axis are horizontal and square to that link, so that the links l₂ and l₃ move in the plane through the first
axis. Seen in that plane the tip is at the signed distance ρ = l₁ + l₂ c₂ + l₃ c₂₃ from the axis and at the
height z = l₂ s₂ + l₃ s₂₃. `lengths` is l₁, l₂, l₃ in m, `q` is in radians.

The arm with a helical joint has a screw column, a boom that slides out of it, a crank on the boom. The screw
turns about z of frame {0} and rises by h = p/2π per radian, p per turn [Selig92, §6.6]. The boom slides
along the rotating x axis. The crank, of length l, turns about the boom, and points sideways at 0. q = (θ₁,
d₂, θ₃). The arm is not from the notes: its crank can move the tip along the screw's helix, so the singular
configurations depend on the pitch.

Wrists have three revolute joints whose axes meet: their Jacobian consists of the joint axes. Rows are the
angular velocity along frame {0}; no joint moves the center. The 3-R wrist turns about k, j and k; the
three-roll wrist of exercise 6.4 rolls about three axes that are tilted, not square.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.textbook.chains import DHChain


def anthropomorphic_chain(lengths: ArrayLike) -> DHChain:
    """Return the arm's table in the standard convention, as printed; the tip is frame 3's origin.

    Args:
        lengths: L₂, L₃, (2,) [m].

    Returns:
        The chain of rows (α_i, a_i, d_i, θ_i).

    Example:
        >>> anthropomorphic_chain([0.8, 0.6]).frames([0, 0, 0])[3, :3, 3].round(3) + 0.0
        array([0. , 1.4, 0. ])
    """
    upper, fore = np.asarray(lengths, dtype=np.float64)
    right = np.pi / 2
    return DHChain(
        table=((right, 0.0, 0.0, right), (0.0, float(upper), 0.0, 0.0), (0.0, float(fore), 0.0, 0.0)),
        kinds=("revolute", "revolute", "revolute"),
        convention="standard",
    )


def anthropomorphic_position(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the tip in frame {0}.

    p = (c₁ r, s₁ r, L₂ s₂ + L₃ s₂₃) with r = L₂ c₂ + L₃ c₂₃ and θ₁ = 90° + q₁ [Craig05, chapter 5].

    Args:
        lengths: L₂, L₃, (..., 2) [m].
        q: q₁, q₂, q₃, (..., 3) [rad].

    Returns:
        [x, y, z], (..., 3) [m].

    Example:
        >>> anthropomorphic_position([0.8, 0.6], np.radians([-90, 90, -90])).round(3) + 0.0
        array([0.6, 0. , 0.8])
    """
    c1, s1, r, z, _, _ = _reach(lengths, q)
    return np.stack(np.broadcast_arrays(c1 * r, s1 * r, z), axis=-1)


def anthropomorphic_jacobian(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the Jacobian of the tip in frame {0}, entry by entry as printed.

    The columns are Ẑ × (P₃ − P) over Ẑ, with Ẑ₀ = (0, 0, 1) and Ẑ₁ = Ẑ₂ = (s₁, −c₁, 0)
    [Craig05, chapter 5].

    Args:
        lengths: L₂, L₃, (..., 2) [m].
        q: q₁, q₂, q₃, (..., 3) [rad].

    Returns:
        Rows [v; ω], (..., 6, 3).

    Example:
        Stretched out, shoulder and elbow only lift the tip:

        >>> anthropomorphic_jacobian([0.8, 0.6], [0, 0, 0])[:3].round(3) + 0.0
        array([[-1.4,  0. ,  0. ],
               [ 0. ,  0. ,  0. ],
               [ 0. ,  1.4,  0.6]])
    """
    c1, s1, r, z, r3, z3 = np.broadcast_arrays(*_reach(lengths, q))
    zero, one = np.zeros_like(r), np.ones_like(r)
    rows = (
        (-s1 * r, -c1 * z, -c1 * z3),
        (c1 * r, -s1 * z, -s1 * z3),
        (zero, r, r3),
        (zero, s1, s1),
        (zero, -c1, -c1),
        (one, zero, zero),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def anthropomorphic_determinant(lengths: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return det J_v = −L₂ L₃ s₃ (L₂ c₂ + L₃ c₂₃), of the three linear rows.

    s₃ = 0: the elbow is stretched or folded, a boundary. The bracket is the distance of the tip from
    the waist's axis: where it is 0, the waist does not move the tip, at any angle.

    Args:
        lengths: L₂, L₃, (..., 2) [m].
        q: q₁, q₂, q₃, (..., 3) [rad].

    Returns:
        det J_v, (...) [m³].

    Example:
        >>> anthropomorphic_determinant([0.8, 0.6], np.radians([20, 0, 90])).round(3)
        np.float64(-0.384)
    """
    lengths = np.asarray(lengths, dtype=np.float64)
    _, _, r, _, _, _ = _reach(lengths, q)
    s3 = np.sin(np.asarray(q, dtype=np.float64)[..., 2])
    return np.asarray(-lengths[..., 0] * lengths[..., 1] * s3 * r)[()]


def _reach(lengths: ArrayLike, q: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Return c₁, s₁ of θ₁, then the tip's r and z, and the forearm's part of both."""
    lengths, q = np.asarray(lengths, dtype=np.float64), np.asarray(q, dtype=np.float64)
    theta1, q2, q23 = np.pi / 2 + q[..., 0], q[..., 1], q[..., 1] + q[..., 2]
    r3, z3 = lengths[..., 1] * np.cos(q23), lengths[..., 1] * np.sin(q23)
    r, z = lengths[..., 0] * np.cos(q2) + r3, lengths[..., 0] * np.sin(q2) + z3
    return np.cos(theta1), np.sin(theta1), r, z, r3, z3


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


def spherical_wrist_chain() -> DHChain:
    """Return the wrist's modified table: R = R(θ₁, k) R(θ₂, j) R(θ₃, k).

    Returns:
        The chain of rows (α_i-1, a_i-1, d_i, θ_i); all frames have their origin at the center.

    Example:
        >>> spherical_wrist_chain().frames([0, np.pi / 2, 0])[3, :3, 2].round(3) + 0.0
        array([1., 0., 0.])
    """
    square = np.pi / 2
    return DHChain(
        table=((0.0, 0.0, 0.0, 0.0), (-square, 0.0, 0.0, 0.0), (square, 0.0, 0.0, 0.0)),
        kinds=("revolute", "revolute", "revolute"),
    )


def spherical_wrist_jacobian(q: ArrayLike) -> NDArray[np.float64]:
    """Return the angular rows of the Jacobian, in frame {0}, as printed.

    Columns (0, 0, 1), (−s₁, c₁, 0), (c₁ s₂, s₁ s₂, c₂) [Selig92, §6.5].

    Args:
        q: θ₁, θ₂, θ₃, (..., 3) [rad]; θ₃ turns no axis.

    Returns:
        Rows ω, (..., 3, 3).

    Example:
        >>> spherical_wrist_jacobian(np.radians([0, 90, 20])).round(3) + 0.0
        array([[0., 0., 1.],
               [0., 1., 0.],
               [1., 0., 0.]])
    """
    q = np.asarray(q, dtype=np.float64)
    c1, s1, c2, s2 = np.cos(q[..., 0]), np.sin(q[..., 0]), np.cos(q[..., 1]), np.sin(q[..., 1])
    zero, one = np.zeros_like(c1), np.ones_like(c1)
    rows = ((zero, -s1, c1 * s2), (zero, c1, s1 * s2), (one, zero, c2))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def spherical_wrist_determinant(q: ArrayLike) -> NDArray[np.float64]:
    """Return det J = −s₂: singular where the first and the third axis are one line, θ₂ = kπ.

    Args:
        q: θ₁, θ₂, θ₃, (..., 3) [rad].

    Returns:
        det J, (...).

    Example:
        >>> spherical_wrist_determinant(np.radians([10, 30, 20])).round(3)
        np.float64(-0.5)
    """
    return np.asarray(-np.sin(np.asarray(q, dtype=np.float64)[..., 1]))[()]


def three_roll_jacobian(q: ArrayLike, tilt: ArrayLike = (np.pi / 3, np.pi / 3)) -> NDArray[np.float64]:
    """Return the angular rows of the three-roll wrist's Jacobian, in frame {0}.

    The second axis is tilted from the first by β, the third back from the second by γ, so that at
    q = 0 the third is at β − γ from the first. The columns are the axes [Selig92, exercise 6.4]:

        k,   R(θ₁, k) (s_β, 0, c_β),   R(θ₁, k) R(β, j) (−s_γ c₂, −s_γ s₂, c_γ)

    Args:
        q: θ₁, θ₂, θ₃, (..., 3) [rad]; θ₃ turns no axis.
        tilt: β, γ, (..., 2) [rad]. The notes lack the figure with the angles of the real wrist; 60° is the
            choice of this package.

    Returns:
        Rows ω, (..., 3, 3).

    Example:
        With θ₂ = 0 and equal tilts the third axis is the first:

        >>> three_roll_jacobian([0.3, 0.0, 0.2]).round(3)[:, [0, 2]] + 0.0
        array([[0., 0.],
               [0., 0.],
               [1., 1.]])
    """
    q, tilt = np.asarray(q, dtype=np.float64), np.asarray(tilt, dtype=np.float64)
    c1, s1, c2, s2 = np.cos(q[..., 0]), np.sin(q[..., 0]), np.cos(q[..., 1]), np.sin(q[..., 1])
    cb, sb, cg, sg = np.cos(tilt[..., 0]), np.sin(tilt[..., 0]), np.cos(tilt[..., 1]), np.sin(tilt[..., 1])
    # The third axis before θ₁ turns it: in the plane of the first two, across it, and along k.
    ahead, across, along = sb * cg - cb * sg * c2, -sg * s2, cb * cg + sb * sg * c2
    zero, one = np.zeros_like(c1), np.ones_like(c1)
    rows = (
        (zero, c1 * sb, c1 * ahead - s1 * across),
        (zero, s1 * sb, s1 * ahead + c1 * across),
        (one, cb, along),
    )
    return np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in rows], axis=-2)


def three_roll_determinant(q: ArrayLike, tilt: ArrayLike = (np.pi / 3, np.pi / 3)) -> NDArray[np.float64]:
    """Return det J = −s_β s_γ s₂ of the three-roll wrist [Selig92, exercise 6.4].

    Singular where the three axes lie in one plane: θ₂ = kπ. At θ₂ = 0 with equal tilts two of them coincide,
    as in the 3-R wrist. Otherwise, and at θ₂ = π, they are three different lines.

    Args:
        q: θ₁, θ₂, θ₃, (..., 3) [rad].
        tilt: β, γ, (..., 2) [rad].

    Returns:
        det J, (...).

    Example:
        >>> three_roll_determinant(np.radians([10, 90, 20])).round(3)
        np.float64(-0.75)
    """
    s2 = np.sin(np.asarray(q, dtype=np.float64)[..., 1])
    return np.asarray(-np.prod(np.sin(np.asarray(tilt, dtype=np.float64)), axis=-1) * s2)[()]
