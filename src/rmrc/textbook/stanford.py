"""The Stanford (Scheinman) arm: DH table, wrist Jacobian and determinant as printed in the notes.

q = (θ₁, θ₂, d₃, θ₄, θ₅, θ₆); frame {0} is at the shoulder, frames 3 to 6 share the wrist point.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.textbook.dh import DHChain

SHOULDER_OFFSET = 0.154
"""d₂ of the arm that was built [m] [Paul72, fig. 2.3]."""


def stanford_chain(d2: float = SHOULDER_OFFSET) -> DHChain:
    """Return the arm's modified DH table [Khatib08].

    Args:
        d2: Shoulder offset d₂ [m].

    Returns:
        The chain of rows (α_i-1, a_i-1, d_i, θ_i).

    Example:
        With θ₂ = 90° the boom points along x, d₂ beside the shoulder:

        >>> q = [0, np.pi / 2, 0.6, 0, 0, 0]
        >>> stanford_chain().frames(q)[6, :3, 3].round(3) + 0.0
        array([0.6  , 0.154, 0.   ])
    """
    back, ahead = -np.pi / 2, np.pi / 2
    return DHChain(
        table=(
            (0.0, 0.0, 0.0, 0.0),
            (back, 0.0, d2, 0.0),
            (ahead, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0),
            (back, 0.0, 0.0, 0.0),
            (ahead, 0.0, 0.0, 0.0),
        ),
        kinds=("revolute", "revolute", "prismatic", "revolute", "revolute", "revolute"),
        convention="modified",
    )


def stanford_jacobian(q: ArrayLike, d2: float = SHOULDER_OFFSET) -> NDArray[np.float64]:
    """Return the Jacobian at the wrist point in frame {0}, entry by entry as printed.

    The upper left block is the partial derivatives of the wrist point, the upper right block is
    zero, the lower rows are the joint axes z_i [Khatib08].

    Args:
        q: θ₁, θ₂, d₃, θ₄, θ₅, θ₆, (..., 6) [rad, rad, m, rad, rad, rad].
        d2: Shoulder offset d₂ [m].

    Returns:
        Rows [v; ω], (..., 6, 6).

    Example:
        With θ₅ = 0 the fourth and the sixth axis coincide, as do their columns:

        >>> J = stanford_jacobian([0.3, 1.0, 0.6, 0.7, 0.0, 0.2])
        >>> bool(np.all(J[:, 3] == J[:, 5]))
        True
    """
    q = np.asarray(q, dtype=np.float64)
    d3 = q[..., 2]
    c1, c2, _, c4, c5, _ = np.moveaxis(np.cos(q), -1, 0)
    s1, s2, _, s4, s5, _ = np.moveaxis(np.sin(q), -1, 0)
    J = np.zeros((*q.shape[:-1], 6, 6))
    J[..., 0, 0] = -c1 * d2 - s1 * s2 * d3
    J[..., 1, 0] = -s1 * d2 + c1 * s2 * d3
    J[..., 5, 0] = 1.0
    J[..., 0, 1] = c1 * c2 * d3
    J[..., 1, 1] = s1 * c2 * d3
    J[..., 2, 1] = -s2 * d3
    J[..., 3, 1] = -s1
    J[..., 4, 1] = c1
    J[..., 0, 2] = c1 * s2
    J[..., 1, 2] = s1 * s2
    J[..., 2, 2] = c2
    J[..., 3, 3] = c1 * s2
    J[..., 4, 3] = s1 * s2
    J[..., 5, 3] = c2
    J[..., 3, 4] = -c1 * c2 * s4 - s1 * c4
    J[..., 4, 4] = -s1 * c2 * s4 + c1 * c4
    J[..., 5, 4] = s2 * s4
    J[..., 3, 5] = c1 * c2 * c4 * s5 - s1 * s4 * s5 + c1 * s2 * c5
    J[..., 4, 5] = s1 * c2 * c4 * s5 + c1 * s4 * s5 + s1 * s2 * c5
    J[..., 5, 5] = -s2 * c4 * s5 + c5 * c2
    return J


def stanford_determinant(q: ArrayLike) -> NDArray[np.float64]:
    """Return det J = d₃² s₂ s₅: each factor is a family of singularities; d₂ plays no part.

    At the wrist point J is block triangular, so det J is the determinant of the first three joints'
    positions, d₃² s₂, times that of the wrist's axes, s₅ [Khatib08].

    Args:
        q: θ₁, θ₂, d₃, θ₄, θ₅, θ₆, (..., 6) [rad, rad, m, rad, rad, rad].

    Returns:
        det J, (...) [m²].

    Example:
        >>> stanford_determinant([0.3, np.pi / 2, 0.6, 0.7, np.pi / 6, 0.2]).round(3)
        np.float64(0.18)
    """
    q = np.asarray(q, dtype=np.float64)
    return np.asarray(q[..., 2] ** 2 * np.sin(q[..., 1]) * np.sin(q[..., 4]))[()]
