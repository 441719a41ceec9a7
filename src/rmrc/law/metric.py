"""The metric of joint rates: S_q, the coordinates of joint rates in which all directions weigh the same.

    S_q = W_q^-½ · L                         metric joints
    S_q = W_q^-½ · L · R⁻ᵀ,  R Rᵀ = M        metric inertia, of the scaled inertia M of the arm

Rates over W_q^-½ · L are called scaled. The columns of A = S_x J W_q^-½ L are joints; A R⁻ᵀ is decomposed.

The inertia M(q) comes from the arm's own links [Khatib87]:

    M_ab = b S_bᵀ I_a^c S_a a,   link b at or before link a, each moved by its leader in a ratio

with the screw S = [ω; v at the origin] of a link at unit rate and the composite inertia I^c, (6, 6) about the
origin, of everything that the link carries [Walker82]. As everywhere, the joint positions are those that the
law takes the arm to have.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.law.kinematics import place_axis, turn_of, turned
from rmrc.law.svd import copy, dot
from rmrc.scenario.choices import METRICS

if TYPE_CHECKING:
    from rmrc.arm import Arm


def link_fields(arm: "Arm", length: float) -> dict[str, NDArray[Any]]:
    """Return the moving masses of an arm, by the fields of a world's record.

    Args:
        arm: The arm.
        length: Characteristic length [m].
    """
    masses, lengths = arm.masses, np.where(arm.is_slide, length, 1.0)
    names = "parent", "leader", "ratio", "mass", "moment", "inertia", "armature"
    return {name: masses[name] for name in names} | {
        "axis_0": masses["axis"], "step_0": masses["step"], "turns": ~masses["is_slide"],
        "advance": masses["is_slide"],
        # The unit makes it 1 in the mean at `home`: σ and λ are then as large as in the metric of the joints.
        "scale": lengths / math.sqrt(float(np.mean(lengths**2 * arm.inertia))),
    }  # fmt: skip


@Method
def find_metric(world: Record) -> None:
    """Write the scaled inertia at q into `metric` (n, n), and its Cholesky factor into `root`."""
    links, n = world.links, world.n
    for a in range(links.count):
        place_axis(links, a, links.parent[a], world.state.q)
        place_body(world, a)
    for i in range(n):
        for j in range(n):
            links.metric[i, j] = links.armature[i] if i == j else 0.0
    for a in range(links.count - 1, -1, -1):  # the links that it carries have been added by then
        add_link(world, a)
    for i in range(n):
        for j in range(n):
            links.metric[i, j] *= links.scale[i] * links.scale[j]
            links.root[i, j] = links.metric[i, j]
    factor(links.root, n)


@compiled
def add_link(world: Record, a: int) -> None:
    """Add the inertia of a link, and of all that it carries, to the metric and to the link before it."""
    links, momentum, b = world.links, world.links.momentum[0], a
    for c in range(6):
        momentum[c] = dot(links.body[a, c], links.screw[a], 6)
    while b >= 0:
        inertia = links.ratio[a] * links.ratio[b] * dot(momentum, links.screw[b], 6)
        i, j = links.leader[a], links.leader[b]
        links.metric[i, j] += inertia
        if a != b:
            links.metric[j, i] += inertia
        b = links.parent[b]
    for c in range(6 if links.parent[a] >= 0 else 0):
        for d in range(6):
            links.body[links.parent[a], c, d] += links.body[a, c, d]


@compiled
def place_body(world: Record, a: int) -> None:
    """Write the screw of a link at its place, and its inertia about the origin, with its joint at p.

    I_0 = R I Rᵀ + (2 p·h + m p·p) 1 − p hᵀ − h pᵀ − m p pᵀ,   h the moment about the joint
    """
    links = world.links
    z, o, p, half, h, m = (
        links.axis[a], links.anchor[a], links.frame[a], links.half_turned, links.turned_moment, links.mass[a],
    )  # fmt: skip
    turn = turn_of(links.frame[a])
    body, screw, turns, advance = links.body[a], links.screw[a], links.turns[a], links.advance[a]
    h[0], h[1], h[2] = turned(turn, links.moment[a])
    for c in range(3):
        half[0, c], half[1, c], half[2, c] = turned(turn, links.inertia[a, c])
    square = 2.0 * dot(p, h, 3) + m * dot(p, p, 3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        screw[i], screw[3 + i] = turns * z[i], turns * (o[j] * z[k] - o[k] * z[j]) + advance * z[i]
        body[i, 0], body[i, 1], body[i, 2] = turned(turn, half[i])
        body[i, i] += square
        for c in range(3):
            body[i, c] -= p[i] * h[c] + h[i] * p[c] + m * p[i] * p[c]
            body[3 + i, 3 + c] = m if i == c else 0.0
    for i in range(3):
        h[i] += m * p[i]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        body[i, 3 + i], body[i, 3 + j], body[i, 3 + k] = 0.0, -h[k], h[j]
        body[3 + i, i], body[3 + j, i], body[3 + k, i] = 0.0, -h[k], h[j]


@compiled
def add_energy_gradient(world: Record, rates: Array, factor: float, gradient: Array) -> None:
    """Add a multiple of ∂T/∂q_j, T = ½ ratesᵀ M(q) rates, at the q of the last `find_metric`.

    A joint moves the links that it carries as a rigid body, and no others: ∂T/∂q_a = −h_aᵀ (S_a × V_a), with
    V_a the twist of the link and h_a the momentum of all that it carries, itself included. That momentum is
    I_a^c V_b + Σ_l I_l^c S_l rates_l, over the link itself and all behind it, with b the link before it.

    Args:
        world: Read: the links at their places.
        rates: Joint rates, (n,).
        factor: Factor of the gradient.
        gradient: Added to, (n,).
    """
    links = world.links
    for a in range(links.count):
        b, rate = links.parent[a], links.ratio[a] * rates[links.leader[a]]
        for c in range(6):
            links.twist[a, c] = rate * links.screw[a, c] + (links.twist[b, c] if b >= 0 else 0.0)
            links.momentum[a, c] = rate * dot(links.body[a, c], links.screw[a], 6)
    for a in range(links.count - 1, -1, -1):
        b, S, h, v = links.parent[a], links.screw[a], links.momentum[a], links.twist[a]
        for c in range(6 if b >= 0 else 0):
            links.momentum[b, c] += h[c]
            h[c] += dot(links.body[a, c], links.twist[b], 6)
        slope = 0.0
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            slope += h[i] * (S[j] * v[k] - S[k] * v[j])
            slope += h[3 + i] * (S[j] * v[3 + k] - S[k] * v[3 + j] + S[3 + j] * v[k] - S[3 + k] * v[j])
        gradient[links.leader[a]] -= factor * links.ratio[a] * slope


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
