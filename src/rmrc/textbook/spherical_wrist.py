"""Wrists of three revolute joints whose axes meet: their Jacobian consists of the joint axes.

Rows are the angular velocity along frame {0}; no joint moves the center. The 3-R wrist turns about
k, j and k; the three-roll wrist of exercise 6.4 rolls about three axes that are tilted, not square.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.textbook.dh import DHChain


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
