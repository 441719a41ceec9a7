"""The anthropomorphic arm as printed in the notes: waist, shoulder and elbow.

The notes are those on chapter 5 of [Craig05]. Frame {0} is at the shoulder, z up, on the waist's
axis; q = 0 stretches the arm out along y, since θ₁ = 90° + q₁. `lengths` is L₂, L₃: the upper arm
and the forearm. L₁, the height of the shoulder, moves no column of the Jacobian.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.textbook.dh import DHChain


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
