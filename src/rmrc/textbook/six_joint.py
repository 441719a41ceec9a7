"""Arms of six joints: the PUMA 560 and the Stanford arm.

The PUMA 560 has a DH table, wrist point, determinant and gravity torques. Frames are those of [Craig05,
§3.7] and of [Armstrong86], modified convention. Frame {0} is at the shoulder; at q = 0 the upper arm lies
along x and the forearm points up. Positive θ₂ lowers the arm. Frames 4 to 6 share the wrist point.

The Stanford (Scheinman) arm has a DH table, wrist Jacobian and determinant as printed in the notes. q = (θ₁,
θ₂, d₃, θ₄, θ₅, θ₆); frame {0} is at the shoulder, frames 3 to 6 share the wrist point.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.textbook.chains import DHChain

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
