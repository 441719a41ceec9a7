"""Configurations in which the site has lost a direction, by Newton's method from nearby ones."""

import numpy as np
from numpy.typing import NDArray

from rmrc.analysis.survey import jacobians
from rmrc.analysis.workspace.slices import Slice
from rmrc.law.task import Array, Task

# A configuration is singular if σ_min, and on the plane if its distance, is below this part of the largest
# entry of J: Newton's method ends at rounding, 1e-15 of it, or slower where two curves cross.
SINGULAR = 1e-9
STEPS = 30
# Part of the sum of squares of a step's equations: directions with less, 3e-7 of it, count as rounding.
DAMPING = 1e-13
# Largest length of a step [rad or m]: second derivatives do not hold farther away.
LONGEST = 0.3


def nearest_singular(
    task: Task, part: Slice, q: Array, joints: NDArray[np.intp]
) -> tuple[Array, NDArray[np.bool_]]:
    """Return singular configurations near to others, in the slice, and which of them were found.

    J_v(q)ᵀ u = 0 for a unit vector u, the lost direction, is a smooth system of equations for q and u even if
    J_v is not square. Its derivative by q is the `curvature`; each step is the shortest solution of the
    linearized system.

    Args:
        task: The arm.
        part: The slice; the plane of one that cuts is one more equation.
        q: Starts, (N, n).
        joints: Joints that may move; at limits, the others stay.

    Returns:
        Configurations, (N, n), and a mask, (N,).
    """
    q, m, k = q.copy(), len(part.basis), len(joints)
    found = np.zeros(len(q), np.bool_)
    left = np.arange(len(q))
    for _ in range(STEPS):
        position, J = jacobians(task, q[left])
        linear, angular = J[:, :3][:, :, joints], J[:, 3:][:, :, joints]
        own = part.basis @ linear
        U, _, _ = np.linalg.svd(own, full_matrices=True)
        u = U[:, :, -1]
        lost = np.einsum("nmk,nm->nk", own, u)
        away = part.offset(position)
        scale = np.maximum(np.abs(linear).max(axis=(1, 2)), 1e-300)
        fine = (np.linalg.norm(lost, axis=1) < SINGULAR * scale) & (np.abs(away) < SINGULAR * scale)
        found[left[fine]] = True
        left, go = left[~fine], ~fine
        if not len(left):
            break
        second = curvature(u @ part.basis, linear, angular)
        system = np.zeros((len(u), k + 2, k + m))
        system[:, :k, :k], system[:, :k, k:] = second, np.swapaxes(own, 1, 2)
        system[:, k, k:] = u
        system[:, k + 1, :k] = part.cuts * np.einsum("nck,c->nk", linear, part.normal)
        wanted = -np.concatenate([lost, np.zeros((len(u), 1)), away[:, None]], axis=1)
        # Solutions lie on curves and some equations are dependent: damping leaves those directions alone.
        system, wanted = system[go], wanted[go]
        square = system @ np.swapaxes(system, 1, 2)
        square += DAMPING * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(k + 2)
        step = (np.swapaxes(system, 1, 2) @ np.linalg.solve(square, wanted[:, :, None]))[:, :k, 0]
        size = np.linalg.norm(step, axis=1, keepdims=True)
        q[np.ix_(left, joints)] += step * np.minimum(1.0, LONGEST / np.maximum(size, 1e-300))
    return q, found


def curvature(u: Array, linear: Array, angular: Array) -> Array:
    """Return the second derivatives of the site's position along some directions, u · ∂²p/∂q_i∂q_j.

    It is u · (z_i × J_v,j) for i before j or j itself, as a joint turns all columns behind it.

    Args:
        u: Directions, (N, 3).
        linear: J_v, the joints in their order along the chain, (N, 3, k).
        angular: Their axes z, 0 of slides, (N, 3, k).

    Returns:
        Symmetric, (N, k, k).
    """
    turned = np.einsum("nci,ncj->nij", np.cross(u[:, :, None], angular, axis=1), linear)
    return np.asarray(np.triu(turned) + np.swapaxes(np.triu(turned, 1), 1, 2))
