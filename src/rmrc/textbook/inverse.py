"""Joint rates for a wanted twist, and joint positions for a wanted pose.

Where J is not square, rates come from normal equations alone. m < n: of all rates that fulfill the task, the
weighted smallest; m > n: the rates with the nearest twist. These functions use no singular value
decomposition. They are an independent check of the compiled law, and refuse a J without full rank, where the
law damps.

Joint positions come from the Newton-Raphson method, with all iterates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.errors import ModelError
from rmrc.support.spatial import times

# A pivot of the normal matrix is sin² of the angle between a row and those before it, times its
# length squared. This share of it is rounding: rows nearer than 1e-6 rad count as dependent.
DEPENDENT = 1e-12


def weighted_right_inverse(jacobian: ArrayLike, weights: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return J⁺ = W⁻¹ Jᵀ (J W⁻¹ Jᵀ)⁻¹, for m ≤ n: the least q̇ᵀ W q̇ among the rates that fulfill the task.

    From Lagrange's conditions W q̇ = Jᵀ λ, J q̇ = V [Whitney69]. J J⁺ = I_m; for m = n it is J⁻¹.

    Args:
        jacobian: J, (..., m, n).
        weights: W, symmetric positive definite: a heavier joint moves less, (..., n, n); None: I.

    Returns:
        J⁺, (..., n, m).

    Raises:
        numpy.linalg.LinAlgError: If the rows of J are dependent.
        ModelError: If W is not symmetric and positive definite.

    Example:
        Two joints with the same effect share the motion in inverse proportion to their weights:

        >>> weighted_right_inverse([[1, 1]]).T
        array([[0.5, 0.5]])
        >>> weighted_right_inverse([[1, 1]], np.diag([1, 3])).T
        array([[0.75, 0.25]])

        An arm in the y-z plane, stretched out along y, cannot move along x; only its row z counts:

        >>> J = np.array([[0, 0], [0, 0], [2, 1]])
        >>> weighted_right_inverse(J[2:]).T
        array([[0.4, 0.2]])
    """
    J = np.asarray(jacobian, dtype=np.float64)
    W = _weights(weights, J.shape[-1])
    spread = np.swapaxes(np.linalg.solve(W, np.swapaxes(J, -1, -2)), -1, -2)  # J W⁻¹
    normal = spread @ np.swapaxes(J, -1, -2)
    _check_rank(normal, J.shape, "rows")
    return np.swapaxes(np.linalg.solve(normal, spread), -1, -2)


def weighted_left_inverse(jacobian: ArrayLike, weights: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return J⁺ = (Jᵀ W J)⁻¹ Jᵀ W, for m ≥ n: the rates with the twist nearest to the wanted one.

    They minimize (V − J q̇)ᵀ W (V − J q̇): Jᵀ W (V − J q̇) = 0 [Whitney69]. J⁺ J = I_n.

    Args:
        jacobian: J, (..., m, n).
        weights: W, symmetric positive definite: a heavier row is followed better, (..., m, m); None: I.

    Returns:
        J⁺, (..., n, m).

    Raises:
        numpy.linalg.LinAlgError: If the columns of J are dependent.
        ModelError: If W is not symmetric and positive definite.

    Example:
        One joint cannot follow two velocities; it follows a row of weight 3 more closely:

        >>> weighted_left_inverse([[1], [1]]) @ [0, 4]
        array([2.])
        >>> weighted_left_inverse([[1], [1]], np.diag([1, 3])) @ [0, 4]
        array([3.])
    """
    J = np.asarray(jacobian, dtype=np.float64)
    weighed = np.swapaxes(J, -1, -2) @ _weights(weights, J.shape[-2])
    normal = weighed @ J
    _check_rank(normal, J.shape, "columns")
    return np.asarray(np.linalg.solve(normal, weighed))


def null_space_projector(jacobian: ArrayLike, weights: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return N = I − J⁺ J with the weighted right inverse: projected rates do not move the task.

    J N = 0 and N N = N; of all rates with J q̇ = 0, N q̇₀ is the nearest to q̇₀ in the metric W
    [Liegeois77].

    Args:
        jacobian: J, (..., m, n), m ≤ n.
        weights: W, symmetric positive definite, (..., n, n); None: I.

    Returns:
        N, (..., n, n).

    Raises:
        numpy.linalg.LinAlgError: If the rows of J are dependent.
        ModelError: If W is not symmetric and positive definite.

    Example:
        >>> null_space_projector([[1, 1]])
        array([[ 0.5, -0.5],
               [-0.5,  0.5]])
    """
    J = np.asarray(jacobian, dtype=np.float64)
    return np.eye(J.shape[-1]) - weighted_right_inverse(J, weights) @ J


def resolved_rates(
    jacobian: ArrayLike, twist: ArrayLike, qdot0: ArrayLike | None = None, weights: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Return q̇ = J⁺ V + (I − J⁺ J) q̇₀, for m ≤ n: the task, and the part of q̇₀ that does not disturb it.

    Of all rates with J q̇ = V it has the least (q̇ − q̇₀)ᵀ W (q̇ − q̇₀) [Liegeois77].

    Args:
        jacobian: J, (..., m, n).
        twist: V, wanted, in the rows of J, (..., m).
        qdot0: Wished rates, (..., n); None: 0.
        weights: W, symmetric positive definite, (..., n, n); None: I.

    Returns:
        q̇, (..., n).

    Raises:
        numpy.linalg.LinAlgError: If the rows of J are dependent.
        ModelError: If W is not symmetric and positive definite.

    Example:
        Two joints move one slide by 2; the wished rates assign all of it to the first:

        >>> resolved_rates([[1, 1]], [2], qdot0=[2, 0])
        array([2., 0.])
    """
    J = np.asarray(jacobian, dtype=np.float64)
    wish = np.zeros(J.shape[-1]) if qdot0 is None else np.asarray(qdot0, dtype=np.float64)
    missing = np.asarray(twist, dtype=np.float64) - times(J, wish)
    return wish + times(weighted_right_inverse(J, weights), missing)


def _weights(weights: ArrayLike | None, size: int) -> NDArray[np.float64]:
    if weights is None:
        return np.eye(size)
    W = np.asarray(weights, dtype=np.float64)
    if W.shape[-2:] != (size, size):
        raise ModelError(f"weights: expected a {size} x {size} matrix, got shape {W.shape}")
    if not np.allclose(W, np.swapaxes(W, -1, -2), rtol=1e-12, atol=0.0) or np.any(_least_pivot(W) <= 0.0):
        raise ModelError("weights: the matrix is not symmetric and positive definite")
    return W


def _check_rank(normal: NDArray[np.float64], shape: tuple[int, ...], which: str) -> None:
    if np.any(_least_pivot(normal) <= DEPENDENT):
        raise np.linalg.LinAlgError(
            f"J of {shape[-2]} rows and {shape[-1]} columns has dependent {which}: the normal equations "
            "have no solution; use damping, or drop rows that cannot move"
        )


def _least_pivot(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the least pivot of Cholesky's factors relative to its diagonal, 0 where there is none, (...)."""
    diagonal = np.diagonal(normal, axis1=-2, axis2=-1)
    if not np.all(diagonal > 0.0):
        return np.zeros(())
    scale = np.sqrt(diagonal)
    try:
        factor = np.linalg.cholesky(normal / (scale[..., :, None] * scale[..., None, :]))
    except np.linalg.LinAlgError:
        return np.zeros(())
    return np.asarray(np.diagonal(factor, axis1=-2, axis2=-1).min(axis=-1) ** 2)


Array = NDArray[np.float64]
NewtonStatus = Literal["converged", "singular", "not converged"]


@dataclass(frozen=True, eq=False)
class NewtonIterates:
    """The iterates of the method, with k steps.

    Attributes:
        q: θ⁽⁰⁾..θ⁽ᵏ⁾, (k + 1, n) [rad or m].
        error: f(θ⁽ⁱ⁾) = k(θ⁽ⁱ⁾) − goal, (k + 1, n).
        step: h⁽ⁱ⁾ = θ⁽ⁱ⁾ − θ⁽ⁱ⁺¹⁾, (k, n) [rad or m].
        status: "converged"; "singular" if J has no inverse at the last iterate; "not converged" if the
            allowed steps did not suffice.
    """

    q: Array
    error: Array
    step: Array
    status: NewtonStatus


def newton_raphson(
    position: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    start: ArrayLike,
    goal: ArrayLike,
    *,
    tolerance: float = 1e-10,
    most_steps: int = 20,
) -> NewtonIterates:
    """Solve k(θ) = goal by θ⁺ = θ − h, where J(θ) h = k(θ) − goal [Selig92, §6.3].

    Near a root where J has an inverse, each error is about the square of the previous one. Far from a root,
    convergence is not guaranteed: a step near a singularity can lead anywhere. It is also Whitney's tick θ⁺ =
    θ + J⁻¹ (x_d − x) [Whitney72], repeated for a goal that stands still.

    Args:
        position: k, from (n,) to (n,). Angles among its rows must not be wrapped, nor those of the goal.
        jacobian: J of k, from (n,) to (n, n).
        start: θ⁽⁰⁾, (n,) [rad or m].
        goal: (n,), in the units of k.
        tolerance: Converged when no row of the error is larger, in the units of k.
        most_steps: Before giving up. From a good start it takes 5 or 6.

    Returns:
        All iterates. A singular J or no convergence is a status, not an error.

    Raises:
        ModelError: If J is not square.

    Example:
        The notes' three links of 2, 1 and 1 m; the goal lowers the tip from 3.6 m to 3 m:

        >>> from rmrc.textbook.planar import three_link_jacobian, three_link_position
        >>> found = newton_raphson(
        ...     lambda q: three_link_position([2, 1, 1], q),
        ...     lambda q: three_link_jacobian([2, 1, 1], q),
        ...     start=np.radians([60, 30, 30]),
        ...     goal=[0.5, 3.0, 2 * np.pi / 3],
        ... )
        >>> found.step[0].round(4), found.q[1].round(4)
        (array([ 0.5981, -1.634 ,  1.0359]), array([ 0.4491,  2.1576, -0.5123]))
        >>> found.status, len(found.step), found.q[-1].round(6)
        ('converged', 5, array([ 0.698863,  1.431888, -0.036356]))
    """
    goal = np.asarray(goal, dtype=np.float64)
    q = [np.asarray(start, dtype=np.float64)]
    errors, steps = [position(q[0]) - goal], list[Array]()

    def ended(status: NewtonStatus) -> NewtonIterates:
        step = np.reshape(steps, (len(steps), len(q[0])))
        return NewtonIterates(np.array(q), np.array(errors), step, status)

    while not np.abs(errors[-1]).max() <= tolerance:
        if len(steps) >= most_steps:
            return ended("not converged")
        J = jacobian(q[-1])
        if J.shape != (len(goal), len(q[0])) or J.shape[0] != J.shape[1]:
            raise ModelError(
                f"Newton-Raphson: J is {J.shape[0]} x {J.shape[1]}, for {len(q[0])} joints and "
                f"{len(goal)} coordinates; it needs as many of one as of the other"
            )
        # Gaussian elimination rarely meets a pivot that is exactly 0: sin(pi) is 1e-16.
        if np.linalg.matrix_rank(J) < len(J):
            return ended("singular")
        steps.append(np.linalg.solve(J, errors[-1]))
        q.append(q[-1] - steps[-1])
        errors.append(position(q[-1]) - goal)
    return ended("converged")
