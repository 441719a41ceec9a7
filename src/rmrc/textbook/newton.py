"""The Newton-Raphson method for the joint positions of a goal, with all iterates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rmrc.support.errors import ModelError

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
