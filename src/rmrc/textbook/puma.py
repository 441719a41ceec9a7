"""The PUMA 560: DH table, wrist point, determinant and gravity torques.

Frames are those of [Craig05, §3.7] and of [Armstrong86], modified convention. Frame {0} is at the
shoulder; at q = 0 the upper arm lies along x and the forearm points up. Positive θ₂ lowers the arm.
Frames 4 to 6 share the wrist point.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.textbook.dh import DHChain

UPPER_ARM = 0.4318
"""a₂ [m] [Armstrong86]."""
ELBOW_OFFSET = -0.0203
"""a₃ [m] [Armstrong86]."""
SHOULDER_OFFSETS = (0.2435, -0.0934)
"""d₂, d₃ [m] [Armstrong86]. Joints 2 and 3 are parallel, so only the sum 0.1501 is kinematics;
[Craig05] has d₂ = 0 and all of it in d₃. The published centers of mass need these frames."""
FOREARM = 0.4331
"""d₄ [m] [Armstrong86]; other sources have 0.4318."""


def puma_chain() -> DHChain:
    """Return the arm's modified table [Armstrong86].

    Returns:
        The chain of rows (α_i-1, a_i-1, d_i, θ_i).

    Example:
        At q = 0 the wrist is above the elbow:

        >>> puma_chain().frames([0, 0, 0, 0, 0, 0])[6, :3, 3].round(4)
        array([0.4115, 0.1501, 0.4331])
    """
    back, ahead = -np.pi / 2, np.pi / 2
    d2, d3 = SHOULDER_OFFSETS
    return DHChain(
        table=(
            (0.0, 0.0, 0.0, 0.0),
            (back, 0.0, d2, 0.0),
            (0.0, UPPER_ARM, d3, 0.0),
            (ahead, ELBOW_OFFSET, FOREARM, 0.0),
            (back, 0.0, 0.0, 0.0),
            (ahead, 0.0, 0.0, 0.0),
        ),
        kinds=("revolute",) * 6,
    )


def puma_wrist_position(q: ArrayLike) -> NDArray[np.float64]:
    """Return the wrist point in frame {0}.

    p = (c₁ r − s₁ d, s₁ r + c₁ d, −a₂ s₂ − a₃ s₂₃ + d₄ c₂₃) with r = a₂ c₂ + a₃ c₂₃ + d₄ s₂₃ and
    d = d₂ + d₃ [Craig05, §3.7].

    Args:
        q: θ₁..θ₆, (..., 6) [rad]; the last three do not matter.

    Returns:
        [x, y, z], (..., 3) [m].

    Example:
        >>> puma_wrist_position(np.radians([90, -90, 0, 0, 0, 0])).round(4) + 0.0
        array([-0.1501, -0.4331,  0.4115])
    """
    q = np.asarray(q, dtype=np.float64)
    c1, s1, s2 = np.cos(q[..., 0]), np.sin(q[..., 0]), np.sin(q[..., 1])
    q23 = q[..., 1] + q[..., 2]
    r, d = _radius(q), sum(SHOULDER_OFFSETS)
    z = -UPPER_ARM * s2 - ELBOW_OFFSET * np.sin(q23) + FOREARM * np.cos(q23)
    return np.stack([c1 * r - s1 * d, s1 * r + c1 * d, z], axis=-1)


def puma_factors(q: ArrayLike) -> NDArray[np.float64]:
    """Return the three factors of the determinant, each 0 on a family of singularities.

    Shoulder, r = a₂ c₂ + a₃ c₂₃ + d₄ s₂₃: the wrist point is in the plane of the first two axes, as near to
    the waist's axis as the offset d₂ + d₃ allows. Elbow, d₄ c₃ − a₃ s₃: the wrist point, the third and the
    second axis in one plane, arm straight (tan θ₃ = d₄/a₃, θ₃ = 92.7°) or folded (−87.3°). Wrist, s₅: axes 4
    and 6 aligned.

    Args:
        q: θ₁..θ₆, (..., 6) [rad].

    Returns:
        [shoulder, elbow, wrist], (..., 3) [m, m, 1].

    Example:
        At q = 0 only the wrist is singular:

        >>> puma_factors(np.zeros(6)).round(4)
        array([0.4115, 0.4331, 0.    ])
    """
    q = np.asarray(q, dtype=np.float64)
    elbow = FOREARM * np.cos(q[..., 2]) - ELBOW_OFFSET * np.sin(q[..., 2])
    return np.stack([_radius(q), elbow, np.sin(q[..., 4])], axis=-1)


def puma_determinant(q: ArrayLike) -> NDArray[np.float64]:
    """Return det J = a₂ (d₄ c₃ − a₃ s₃)(a₂ c₂ + a₃ c₂₃ + d₄ s₂₃) s₅, at the wrist point.

    J is block triangular there: the first three joints' −a₂ (d₄ c₃ − a₃ s₃) r times the wrist's −s₅.

    Args:
        q: θ₁..θ₆, (..., 6) [rad].

    Returns:
        det J, (...) [m³].

    Example:
        >>> puma_determinant(np.radians([10, 0, 0, 20, 90, 30])).round(4)
        np.float64(0.077)
    """
    return np.asarray(UPPER_ARM * np.prod(puma_factors(q), axis=-1))[()]


def puma_gravity_torques(constants: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the torques that hold the arm against gravity, from five constants [Armstrong86].

        τ₂ = g₁ c₂ + g₂ s₂₃ + g₃ s₂ + g₄ c₂₃ + g₅ (s₂₃ c₅ + c₂₃ c₄ s₅)
        τ₃ = g₂ s₂₃ + g₄ c₂₃ + g₅ (s₂₃ c₅ + c₂₃ c₄ s₅)
        τ₄ = −g₅ s₂₃ s₄ s₅,   τ₅ = g₅ (c₂₃ s₅ + s₂₃ c₄ c₅),   τ₁ = τ₆ = 0

    Args:
        constants: g₁..g₅, (..., 5) [N·m].
        q: θ₁..θ₆, (..., 6) [rad].

    Returns:
        τ, (..., 6) [N·m].

    Example:
        The published constants, with the arm stretched out horizontally:

        >>> published = [-37.2, -8.44, 1.02, 0.249, -0.0282]
        >>> puma_gravity_torques(published, np.radians([0, 0, 90, 0, 0, 0]))[1:3].round(2)
        array([-45.67,  -8.47])
    """
    g1, g2, g3, g4, g5 = np.moveaxis(np.asarray(constants, dtype=np.float64), -1, 0)
    q = np.asarray(q, dtype=np.float64)
    _, c2, _, c4, c5, _ = np.moveaxis(np.cos(q), -1, 0)
    _, s2, _, s4, s5, _ = np.moveaxis(np.sin(q), -1, 0)
    c23, s23 = np.cos(q[..., 1] + q[..., 2]), np.sin(q[..., 1] + q[..., 2])
    forearm = g2 * s23 + g4 * c23 + g5 * (s23 * c5 + c23 * c4 * s5)
    upper_arm = g1 * c2 + g3 * s2 + forearm
    zero = np.zeros_like(forearm)
    return np.stack(
        [zero, upper_arm, forearm, -g5 * s23 * s4 * s5, g5 * (c23 * s5 + s23 * c4 * c5), zero], axis=-1
    )


def _radius(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a₂ c₂ + a₃ c₂₃ + d₄ s₂₃: the horizontal distance of the wrist point in the plane of the arm."""
    q2, q23 = q[..., 1], q[..., 1] + q[..., 2]
    return np.asarray(UPPER_ARM * np.cos(q2) + ELBOW_OFFSET * np.cos(q23) + FOREARM * np.sin(q23))
