"""The effect of small joint displacements on the tip: Taylor's theorem, and errors that spread through J."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def taylor_remainder(
    position: Callable[[Array], Array], jacobian: Callable[[Array], Array], q: ArrayLike, dq: ArrayLike
) -> Array:
    """Return the error of the linear approximation: k(q + Δ) − k(q) − J(q) Δ [Selig92, §6.1].

    Args:
        position: k, from joint positions (..., n) to task coordinates (..., m).
        jacobian: J, from joint positions (n,) to (m, n).
        q: Joint positions, (n,) [rad or m].
        dq: Δ, (..., n) [rad or m].

    Returns:
        (..., m), in the units of k.

    Example:
        A link of 1 m turned by 0.1 rad falls short of its tangent by 0.1²/2:

        >>> from rmrc.textbook.planar import planar_jacobian, planar_position
        >>> arm = (lambda q: planar_position([1], q), lambda q: planar_jacobian([1], q))
        >>> taylor_remainder(*arm, [0.0], [0.1]).round(6)
        array([-0.004996, -0.000167,  0.      ])
    """
    q, dq = np.asarray(q, dtype=np.float64), np.asarray(dq, dtype=np.float64)
    return position(q + dq) - position(q) - tip_error(jacobian(q), dq)


def taylor_order(
    position: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    q: ArrayLike,
    direction: ArrayLike,
    largest: float = 1e-2,
) -> float:
    """Return the order of the error of the linear approximation: 2 if J is the Jacobian of k.

    The slope of log ‖k(q + hΔ) − k(q) − h J Δ‖ over log h, for h from `largest` down to a tenth of
    it. It is 1 if J is wrong, and 3 or more where the second derivative along Δ happens to be 0
    [Selig92, §6.1].

    Args:
        position: k, from joint positions (..., n) to task coordinates (..., m).
        jacobian: J, from joint positions (n,) to (m, n).
        q: Joint positions, (n,) [rad or m].
        direction: Δ, (n,) [rad or m].
        largest: Largest of the factors h. With 1e-2 the remainder is some 1e-6 to 1e-4, far above rounding
            and far below the distance at which higher orders show.

    Returns:
        The slope, or infinity if k is linear along Δ except rounding.

    Example:
        >>> from rmrc.textbook.two_link import two_link_jacobian, two_link_position
        >>> arm = (lambda q: two_link_position([1, 1], q), lambda q: two_link_jacobian([1, 1], q))
        >>> round(taylor_order(*arm, [0.3, 0.5], [1.0, -0.7]), 2)
        2.0
    """
    h = np.geomspace(largest, 0.1 * largest, 6)
    q, direction = np.asarray(q, dtype=np.float64), np.asarray(direction, dtype=np.float64)
    missed = np.linalg.norm(taylor_remainder(position, jacobian, q, h[:, None] * direction), axis=-1)
    # Sums of some dozen terms of the size of k: less than this is their rounding.
    if missed[-1] <= 64 * np.finfo(float).eps * (1.0 + np.abs(position(q)).max()):
        return np.inf
    return float(np.polyfit(np.log(h), np.log(missed), 1)[0])


def tip_error(jacobian: ArrayLike, joint_error: ArrayLike) -> Array:
    """Return the error of the tip due to joint errors, to first order: Δx = J Δθ [Selig92, §6.2].

    Args:
        jacobian: J, (..., m, n).
        joint_error: Δθ, (..., n) [rad or m].

    Returns:
        Δx, in the rows of J, (..., m).

    Example:
        Stretched out along x, no joint error moves the tip along x; 0.1 rad in the second joint moves
        it along y by 0.1 (l₂ + l₃):

        >>> from rmrc.textbook.planar import planar_jacobian
        >>> tip_error(planar_jacobian([2, 1, 1], [0, 0, 0]), [0, 0.1, 0]).round(3)
        array([0. , 0.2, 0.1])
    """
    J, joint_error = np.asarray(jacobian, dtype=np.float64), np.asarray(joint_error, dtype=np.float64)
    return np.asarray((J @ joint_error[..., None])[..., 0])


def tip_covariance(jacobian: ArrayLike, joint_covariance: ArrayLike) -> Array:
    """Return the covariance of the tip's error for random joint errors: J Σ Jᵀ, to first order.

    From Δx = J Δθ and Σ = E[Δθ Δθᵀ] [Selig92, §6.2]. The square roots of its diagonal are the
    standard deviations of the rows. Joints with independent errors of standard deviation s_i have
    Σ = diag(s²).

    Args:
        jacobian: J, (..., m, n).
        joint_covariance: Σ, (..., n, n) [rad² or m²].

    Returns:
        J Σ Jᵀ, in the rows of J, (..., m, m).

    Example:
        Encoder errors of 1 mrad each, on two links of 1 m at a right angle, give 1.4 mm in x and 1 mm in y:

        >>> from rmrc.textbook.two_link import two_link_jacobian
        >>> J = two_link_jacobian([1, 1], np.radians([0, 90]))
        >>> np.sqrt(np.diag(tip_covariance(J, np.diag([1e-3, 1e-3]) ** 2))).round(4)
        array([0.0014, 0.001 ])
    """
    J = np.asarray(jacobian, dtype=np.float64)
    return np.asarray(J @ np.asarray(joint_covariance, dtype=np.float64) @ np.swapaxes(J, -1, -2))
