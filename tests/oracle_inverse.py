"""Damping, inverses and null space, for the oracle: each function one equation of the theory, by another route.

Damped inverses are solved from their normal equations, roots are `brentq`'s, and singular values are LAPACK's.
"""

import numpy as np
from scipy.optimize import brentq

AXES = ("x", "y", "z", "rx", "ry", "rz")
ROUNDING = 1e-14  # singular values up to this share of the largest are none


def scaling(task_weights, axes, length, joint_weights, is_slide):
    """Return the diagonals of W_x (rows that count) and W_q with the characteristic length in them."""
    rows = [AXES.index(axis) for axis in axes]
    wx = np.array(task_weights, float) * np.array([1 / length**2 if r < 3 else 1.0 for r in rows])
    wq = np.array(joint_weights, float) / np.where(is_slide, length**2, 1.0)
    return wx, wq


def scaled_jacobian(J, wx, wq):
    """Return A of (5)."""
    return np.sqrt(wx)[:, None] * J / np.sqrt(wq)


def damping(
    schedule, maximum, below, sigma_min, *, w=None, w_below=None, error=None, error_gain=None, A=None, t=None, bound=None
):  # fmt: skip
    """Return λ by the formulas of the schedules (12); `rate_bound` needs the scaled A and task t."""
    if schedule == "constant":
        return maximum
    if schedule == "manipulability":
        return maximum * max(0.0, 1 - w / w_below)
    if schedule == "error":
        return error_gain * error
    if schedule == "rate_bound":
        return np.sqrt(least_square_damping(A, t, bound))
    assert schedule == "smallest_singular_value", f"no oracle for the schedule {schedule}: write it here"
    return np.sqrt(max(0.0, 1 - (sigma_min / below) ** 2) * maximum**2)


def least_square_damping(A, t, bound):
    """Return the least μ = λ² that keeps the norm of the scaled rates within a bound (13), by bisection and secants."""
    u, sigma, _ = np.linalg.svd(A, full_matrices=False)
    real = sigma > ROUNDING * sigma[0]
    sigma, c = sigma[real], (u.T @ t)[real]
    excess = lambda mu: np.linalg.norm(sigma * c / (sigma**2 + mu)) - bound  # noqa: E731
    if not real.any() or excess(0.0) <= 0:
        return 0.0
    # ‖σ c‖/μ is more than the norm, so the root is below where that is the bound
    return brentq(excess, 0.0, np.linalg.norm(sigma * c) / bound, xtol=1e-300, rtol=1e-15, maxiter=1000)


def generalized_inverse(
    J, v, wx, wq, method, tolerance=1e-6, lam=0.0, *, cutoff=0.01, gamma=0.1, bound=2.0, maximum=0.1, below=0.3
):  # fmt: skip
    """Return the matrix that makes weighted rates of one task's twist v (some depend on v), without an SVD if possible."""
    m, n = J.shape
    if method == "inverse" and J.any(axis=0).all():  # no joint is held
        return np.linalg.inv(J)
    A, t = scaled_jacobian(J, wx, wq), np.sqrt(wx) * v
    if method == "damped" and lam > 1e-3 * np.linalg.norm(A, 2):
        if m <= n:  # right inverse: W_q⁻¹ Jᵀ (J W_q⁻¹ Jᵀ + λ² W_x⁻¹)⁻¹
            return np.linalg.solve((J / wq) @ J.T + lam**2 * np.diag(1 / wx), J / wq).T
        # left inverse: (Jᵀ W_x J + λ² W_q)⁻¹ Jᵀ W_x
        return np.linalg.solve(J.T @ (wx[:, None] * J) + lam**2 * np.diag(wq), J.T * wx)
    if method == "damped":  # so little that the normal equations would be singular
        G = filtered_inverse(A, lambda sigma: np.full_like(sigma, lam**2))
    elif method == "filtered":
        G = filtered_inverse(A, lambda sigma: np.maximum(0, 1 - (sigma / below) ** 2) * maximum**2)
    elif method == "truncated":
        G = truncated_inverse(A, cutoff)
    elif method == "transpose":
        push = A @ A.T @ t
        G = A.T * (t @ push / (push @ push) if push @ push > 0 else 0.0)
    elif method == "selectively_damped":
        G = selectively_damped_inverse(A, t, bound)
    elif method == "jparse":
        G = jparse_inverse(A, gamma)
    else:
        assert method in ("inverse", "pseudoinverse"), f"no oracle for the inverse {method}: write it here"
        G = np.linalg.pinv(A, rcond=tolerance if method == "pseudoinverse" else ROUNDING)
    return G / np.sqrt(wq)[:, None] * np.sqrt(wx)


def filtered_inverse(A, squares):
    """Return Σ σ/(σ² + λ²) v uᵀ with λ² = squares(σ)."""
    u, sigma, vt = np.linalg.svd(A, full_matrices=False)
    real = sigma > ROUNDING * sigma[0]
    u, sigma, vt = u[:, real], sigma[real], vt[real]
    return (vt.T * (sigma / (sigma**2 + squares(sigma)))) @ u.T


def truncated_inverse(A, cutoff):
    """Return the pseudoinverse of what is left of A without its small singular values."""
    u, sigma, vt = np.linalg.svd(A, full_matrices=False)
    kept = sigma > max(cutoff, ROUNDING * sigma[0])
    if not kept.any():
        return np.zeros(A.T.shape)
    left = (u * np.where(kept, sigma, 0.0)) @ vt
    return np.linalg.pinv(left, rcond=0.5 * sigma[kept][-1] / sigma[0])


def jparse_inverse(A, gamma):
    """Return J-PARSE as its authors write it: J_s⁺ J_p J_p⁺ + J_s⁺ Φ, with gains of 1 in Φ."""
    u, sigma, vt = np.linalg.svd(A, full_matrices=False)
    if sigma[0] == 0:
        return np.zeros(A.T.shape)
    threshold = gamma * sigma[0]
    fading = sigma < threshold
    safety = (u * np.maximum(sigma, threshold)) @ vt  # J_s: no singular value below the threshold
    projection = (u[:, ~fading] * sigma[~fading]) @ vt[~fading]  # J_p: the directions that do not fade
    push = (u[:, fading] * (sigma[fading] / threshold)) @ u[:, fading].T  # Φ
    inverse = np.linalg.pinv(safety)
    return inverse @ projection @ np.linalg.pinv(projection, rcond=0.5 * gamma) + inverse @ push


def selectively_damped_inverse(A, t, bound):
    """Return the matrix of Buss and Kim's selectively damped least squares for a task t (9)."""
    u, sigma, vt = np.linalg.svd(A, full_matrices=False)
    real = sigma > ROUNDING * sigma[0]
    clamp = lambda x, most: x * min(1.0, most / np.abs(x).max()) if np.abs(x).max() > 0 else x  # noqa: E731
    reach = np.linalg.norm(A, axis=0)
    G, total = np.zeros(A.T.shape), np.zeros(A.shape[1])
    for ui, si, vi in zip(u[:, real].T, sigma[real], vt[real], strict=True):
        phi = (ui @ t) / si * vi
        clamped = clamp(phi, bound * min(1.0, si / (np.abs(vi) @ reach)))
        share = np.linalg.norm(clamped) / np.linalg.norm(phi) if np.any(phi) else 1.0
        G += share / si * np.outer(vi, ui)
        total += clamped
    return G * min(1.0, bound / np.abs(total).max()) if np.any(total) else G


def projector(J, wq, rank=None):
    """Return N (16), the weighted projector onto the null space of J, from LAPACK's full set of right vectors.

    Not as I − J⁺J: that loses as many digits as the condition number has.

    Args:
        J: Jacobian of the task, its rows weighted.
        wq: Weights of the joints.
        rank: How many directions the task takes; None for the rank here.
    """
    _, sigma, vt = np.linalg.svd(J / np.sqrt(wq))
    V0 = vt[np.sum(sigma > ROUNDING * sigma[0]) if rank is None else rank :].T
    return (V0 @ V0.T) / np.sqrt(wq)[:, None] * np.sqrt(wq)


def second_inverse(A, largest, lam):
    """Return A* of (18); `largest` is the Frobenius norm that small singular values are compared with."""
    if lam > 0:
        return np.linalg.solve(A @ A.T + lam**2 * np.eye(len(A)), A).T
    norm = np.linalg.norm(A, 2)
    return np.linalg.pinv(A, rcond=1e-6 * largest / norm) if norm > 1e-6 * largest else np.zeros(A.T.shape)
