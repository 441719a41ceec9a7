"""Static forces: joint torques for a wrench at the tip, by virtual work.

The sign depends on the question. τ = Jᵀ F is *equivalent* to the wrench F: with these torques the tip presses
on the world with F. −Jᵀ F *balances* it: with these torques the arm holds still while F acts on the tip.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def joint_torques(jacobian: ArrayLike, wrench: ArrayLike) -> NDArray[np.float64]:
    """Return the joint torques that are equivalent to a wrench: τ = Jᵀ F.

    They do the same work in any small motion: τ·δq = F·δx for δx = J δq
    [Craig05, §5.10] [Khatib08].

    Args:
        jacobian: J, (..., m, n).
        wrench: F at the point and along the axes of J, in the order of its rows, (..., m) [N, N·m].

    Returns:
        τ, (..., n) [N·m, N for a prismatic joint].

    Example:
        The notes' two links of 1 m at (0, 60°) press down with 1 N:

        >>> from rmrc.textbook.two_link import two_link_jacobian
        >>> joint_torques(two_link_jacobian([1, 1], np.radians([0, 60])), [0, -1]).round(12)
        array([-1.5, -0.5])

        Stretched out upward, at (90°, 0), even 1000 N need no torque: the arm is singular, and the force is
        along the lost direction.

        >>> joint_torques(two_link_jacobian([1, 1], np.radians([90, 0])), [0, -1000]).round(9) + 0.0
        array([0., 0.])
    """
    jacobian = np.asarray(jacobian, dtype=np.float64)
    wrench = np.asarray(wrench, dtype=np.float64)
    return np.asarray(np.einsum("...mn,...m->...n", jacobian, wrench))


def equilibrium_torques(jacobian: ArrayLike, wrench: ArrayLike) -> NDArray[np.float64]:
    """Return the joint torques that balance a wrench which acts on the arm: τ = −Jᵀ F.

    The virtual work τ·δq + F·δx is zero for every δq [Craig05, §5.10] [Khatib08].

    Args:
        jacobian: J, (..., m, n).
        wrench: F at the point and along the axes of J, in the order of its rows, (..., m) [N, N·m].

    Returns:
        τ, (..., n) [N·m, N for a prismatic joint].

    Example:
        A weight of 1 N hangs at the tip of two links of 1 m at (0, 60°):

        >>> from rmrc.textbook.two_link import two_link_jacobian
        >>> equilibrium_torques(two_link_jacobian([1, 1], np.radians([0, 60])), [0, -1]).round(12)
        array([1.5, 0.5])
    """
    return -joint_torques(jacobian, wrench)
