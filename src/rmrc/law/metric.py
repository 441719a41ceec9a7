"""The metric of joint rates: S_q, the coordinates of joint rates in which all directions weigh the same.

    S_q = W_q^-½ · L                         metric joints
    S_q = W_q^-½ · L · R⁻ᵀ,  R Rᵀ = M        metric inertia, of the scaled inertia M of the arm

Rates over W_q^-½ · L are called scaled. The columns of A = S_x J W_q^-½ L are joints; A R⁻ᵀ is decomposed.
"""

import math

from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.law.svd import copy, dot
from rmrc.scenario.choices import METRICS

INERTIA = METRICS.code("inertia")
# A squared pivot that is a smaller share of its diagonal is rounding.
SINGULAR = 1e-18


@compiled
def factor(root: Array, n: int) -> None:
    """Replace a positive matrix (n, n) by its lower Cholesky factor; the upper part stays.

    Where it is singular, the diagonal is infinite: `forward` and `backward` solve for 0 there.
    """
    for i in range(n):
        size = root[i, i]
        for j in range(i + 1):
            left = root[i, j]
            for p in range(j):
                left -= root[i, p] * root[j, p]
            if j < i:
                root[i, j] = left / root[j, j]
            else:
                root[i, i] = math.inf if left <= SINGULAR * size else math.sqrt(left)


@compiled
def forward(root: Array, values: Array, n: int) -> None:
    """Solve R x = values, (n,), in place."""
    for i in range(n):
        left = values[i]
        for p in range(i):
            left -= root[i, p] * values[p]
        values[i] = left / root[i, i]


@compiled
def backward(root: Array, values: Array, n: int) -> None:
    """Solve Rᵀ x = values, (n,), in place."""
    for i in range(n - 1, -1, -1):
        left = values[i]
        for p in range(i + 1, n):
            left -= root[p, i] * values[p]
        values[i] = left / root[i, i]


@compiled
def times_transposed(root: Array, values: Array, n: int) -> None:
    """Replace values, (n,), by Rᵀ values."""
    for i in range(n):
        total = 0.0
        for p in range(i, n):
            total += root[p, i] * values[p]
        values[i] = total


@compiled
def weigh_columns(root: Array, A: Array, m: int, n: int, B: Array) -> None:
    """Write B = A R⁻ᵀ, (m, n); B may be A."""
    for r in range(m):
        copy(A[r], B[r], n)
        forward(root, B[r], n)


@Method
def weigh(world: Record) -> None:
    """Weigh the columns of the matrix that is decomposed, A R⁻ᵀ."""
    weigh_columns(world.links.root, world.scratch.A, world.m, world.n, world.first.matrix)


@compiled
def scale_joints(world: Record, rates: Array) -> None:
    """Turn coordinates into joint rates: multiply by S_q."""
    if world.law.inverse_metric == INERTIA:
        backward(world.links.root, rates, world.n)
    for j in range(world.n):
        rates[j] *= world.task.joint_scale[j]


@compiled
def unscale_joints(world: Record, rates: Array) -> None:
    """Turn joint rates into coordinates: multiply by S_q⁻¹."""
    for j in range(world.n):
        rates[j] /= world.task.joint_scale[j]
    if world.law.inverse_metric == INERTIA:
        times_transposed(world.links.root, rates, world.n)


@compiled
def scale_gradient(world: Record, gradient: Array) -> None:
    """Turn a gradient with respect to the joints into one with respect to coordinates: multiply by S_qᵀ."""
    for j in range(world.n):
        gradient[j] *= world.task.joint_scale[j]
    if world.law.inverse_metric == INERTIA:
        forward(world.links.root, gradient, world.n)


@compiled
def weigh_wish(world: Record, wish: Array) -> None:
    """Turn joint rates S² ∇H, with S = W_q^-½ L, into S_q S_qᵀ ∇H."""
    for j in range(world.n):
        wish[j] /= world.task.joint_scale[j]
    forward(world.links.root, wish, world.n)
    scale_joints(world, wish)


@compiled
def keep_free(world: Record, fade: Array) -> None:
    """Write the factor of F M F + 1 − F² into `root_b`, where F is 1 if a joint is free and else 0."""
    scratch = world.scratch
    for i in range(world.n):
        for j in range(i + 1):
            scratch.root_b[i, j] = fade[i] * world.links.metric[i, j] * fade[j]
        scratch.root_b[i, i] += 1.0 - fade[i] * fade[i]
    factor(scratch.root_b, world.n)


@compiled
def weigh_faded(world: Record) -> None:
    """Weigh the columns of fading joints in `rest.matrix`, so that σ is in their metric."""
    rest, scratch = world.rest, world.scratch
    if world.law.inverse_metric == INERTIA:
        keep_free(world, world.bounds.fade)
        weigh_columns(scratch.root_b, rest.matrix, world.m, world.n, rest.matrix)


@compiled
def weigh_free(world: Record) -> None:
    """Weigh the columns of the free joints in `rest.matrix`; let them move along with the held ones.

    They move by −M_FF⁻¹ M_FH (best − drift)_H, scaled, the motion of the free joints with the least energy.
    It is left in `sway`, and its effect on the task is taken from `rest.task`. In the metric of the joints
    nothing moves along.
    """
    rest, scratch, bounds = world.rest, world.scratch, world.bounds
    n, sway, held = world.n, scratch.sway, bounds.held
    if world.law.inverse_metric != INERTIA:
        return
    for j in range(n):
        scratch.shape[j] = 1.0 if held[j] == 0.0 else 0.0
    keep_free(world, scratch.shape)
    for i in range(n):
        sway[i] = 0.0
        for j in range(n if held[i] == 0.0 else 0):
            if held[j] != 0.0:
                away = (bounds.best[j] - bounds.drift[j]) / world.task.joint_scale[j]
                sway[i] -= world.links.metric[i, j] * away
    forward(scratch.root_b, sway, n)
    backward(scratch.root_b, sway, n)
    for r in range(world.m):
        rest.task[r] -= dot(scratch.A[r], sway, n)
    weigh_columns(scratch.root_b, rest.matrix, world.m, n, rest.matrix)


@compiled
def take_along(world: Record, rates: Array, part: float) -> None:
    """Turn coordinates of the free joints into scaled rates, and add a part of `sway`."""
    scratch = world.scratch
    if world.law.inverse_metric == INERTIA:
        backward(scratch.root_b, rates, world.n)
        for j in range(world.n):
            rates[j] += part * scratch.sway[j]
