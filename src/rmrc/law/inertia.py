"""The inertia M(q) of the arm, from its own links, as the metric of joint rates [Khatib87].

    M_ab = b S_bᵀ I_a^c S_a a,   link b at or before link a, each moved by its leader in a ratio

with the composite inertia I^c of everything that a link carries [Walker82], about the joint of the first
link. As everywhere, the joint positions are those that the law takes the arm to have.
"""

import math
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from rmrc.law.compiling import Array, Method, Record, compiled
from rmrc.law.kinematics import quat_product, turned
from rmrc.law.metric import factor
from rmrc.law.svd import dot

if TYPE_CHECKING:  # a law without an arm does not load MuJoCo
    from rmrc.arm import Arm

Twist: TypeAlias = tuple[float, float, float, float, float, float]


class Inertia:
    """The metric of a law: it writes the moving masses into a world's record."""

    def __init__(self, arm: "Arm", length: float) -> None:
        """Bind it to an arm.

        Args:
            arm: The arm.
            length: Characteristic length [m].
        """
        self._masses, lengths = arm.masses, np.where(arm.is_slide, length, 1.0)
        # The unit makes it 1 in the mean at `home`: σ and λ are then as large as in the metric of the joints.
        self._scale = lengths / math.sqrt(float(np.mean(lengths**2 * arm.inertia)))

    def write(self, world: np.void) -> None:
        """Write them into a world's record."""
        masses, links, n = self._masses, world["links"], len(self._masses.armature)
        count = links["count"] = len(masses.mass)
        for name, values in (
            ("parent", masses.parent), ("leader", masses.leader), ("ratio", masses.ratio),
            ("is_slide", masses.is_slide), ("axis_0", masses.axis), ("step_0", masses.step),
            ("mass", masses.mass), ("moment", masses.moment), ("inertia", masses.inertia),
        ):  # fmt: skip
            links[name][:count] = values
        links["armature"][:n], links["scale"][:n] = masses.armature, self._scale


@Method
def find_metric(world: Record) -> None:
    """Write the scaled inertia at q into `metric` (n, n), and its Cholesky factor into `root`."""
    n = world.n
    place_links(world)
    for i in range(n):
        for j in range(n):
            world.links.metric[i, j] = 0.0
        world.links.metric[i, i] = world.links.armature[i]
    for a in range(world.links.count - 1, -1, -1):  # the links that it carries have been added by then
        carried, b = momentum(world, a, screw(world, a)), a
        while b >= 0:
            inertia = world.links.ratio[a] * world.links.ratio[b] * paired(carried, screw(world, b))
            i, j = world.links.leader[a], world.links.leader[b]
            world.links.metric[i, j] += inertia
            if a != b:
                world.links.metric[j, i] += inertia
            b = world.links.parent[b]
        if world.links.parent[a] >= 0:
            load_on(world, a, world.links.parent[a])
    for i in range(n):
        for j in range(n):
            world.links.metric[i, j] *= world.links.scale[i] * world.links.scale[j]
            world.links.root[i, j] = world.links.metric[i, j]
    factor(world.links.root, n)


@compiled
def load_on(world: Record, a: int, b: int) -> None:
    """Add the inertia that link a carries, itself included, to the inertia that link b carries."""
    links = world.links
    links.carried_mass[b] += links.carried_mass[a]
    for i in range(3):
        links.carried_moment[b, i] += links.carried_moment[a, i]
        for c in range(3):
            links.carried_inertia[b, i, c] += links.carried_inertia[a, i, c]


@compiled
def place_links(world: Record) -> None:
    """Write the place of each link at q: its axis, its joint, and its mass, moment and inertia."""
    links, state = world.links, world.state
    for a in range(links.count):
        b, moved = links.parent[a], links.ratio[a] * state.q[links.leader[a]]
        x = y = z = 0.0
        turn = (1.0, 0.0, 0.0, 0.0)
        if b >= 0:
            t = links.turn[b]
            turn = (t[0], t[1], t[2], t[3])
            x, y, z = links.anchor[b, 0], links.anchor[b, 1], links.anchor[b, 2]
            if links.is_slide[b]:
                way = links.ratio[b] * state.q[links.leader[b]]
                x += way * links.axis[b, 0]
                y += way * links.axis[b, 1]
                z += way * links.axis[b, 2]
        dx, dy, dz = turned(turn, links.step_0[a])
        x, y, z = x + dx, y + dy, z + dz
        ax, ay, az = turned(turn, links.axis_0[a])
        links.anchor[a, 0], links.anchor[a, 1], links.anchor[a, 2] = x, y, z
        links.axis[a, 0], links.axis[a, 1], links.axis[a, 2] = ax, ay, az
        if links.is_slide[a]:
            x, y, z = x + moved * ax, y + moved * ay, z + moved * az
        else:
            c, s = math.cos(0.5 * moved), math.sin(0.5 * moved)
            turn = quat_product((c, s * ax, s * ay, s * az), turn)
        t = links.turn[a]
        t[0], t[1], t[2], t[3] = turn
        move_mass(world, a, x, y, z)


@compiled
def move_mass(world: Record, a: int, x: float, y: float, z: float) -> None:
    """Write mass, moment and inertia of a link about the origin, with its joint at x, y, z.

    I_0 = R I Rᵀ + (2 p·h + m p·p) 1 − p hᵀ − h pᵀ − m p pᵀ,   h the moment about the joint
    """
    links = world.links
    t, m, p, half = links.turn[a], links.mass[a], links.point, links.half_turned
    h, inertia = links.carried_moment[a], links.carried_inertia[a]
    turn = (t[0], t[1], t[2], t[3])
    p[0], p[1], p[2] = x, y, z
    h[0], h[1], h[2] = turned(turn, links.moment[a])
    for c in range(3):
        half[0, c], half[1, c], half[2, c] = turned(turn, links.inertia[a, c])
    square = 2.0 * dot(p, h, 3) + m * dot(p, p, 3)
    for i in range(3):
        inertia[i, 0], inertia[i, 1], inertia[i, 2] = turned(turn, half[i])
        inertia[i, i] += square
        for c in range(3):
            inertia[i, c] -= p[i] * h[c] + h[i] * p[c] + m * p[i] * p[c]
    links.carried_mass[a] = m
    for i in range(3):
        h[i] += m * p[i]


@compiled
def screw(world: Record, a: int) -> Twist:
    """Return the twist [ω; v at the origin] of a link at unit rate of its joint."""
    links = world.links
    x, y, z = links.axis[a, 0], links.axis[a, 1], links.axis[a, 2]
    if links.is_slide[a]:
        return 0.0, 0.0, 0.0, x, y, z
    px, py, pz = links.anchor[a, 0], links.anchor[a, 1], links.anchor[a, 2]
    return x, y, z, py * z - pz * y, pz * x - px * z, px * y - py * x


@compiled
def momentum(world: Record, a: int, twist: Twist) -> Twist:
    """Return [angular; linear] momentum about the origin of a link and all that it carries, at a twist."""
    links = world.links
    wx, wy, wz, vx, vy, vz = twist
    m, h, inertia = links.carried_mass[a], links.carried_moment[a], links.carried_inertia[a]
    return (
        inertia[0, 0] * wx + inertia[0, 1] * wy + inertia[0, 2] * wz + h[1] * vz - h[2] * vy,
        inertia[1, 0] * wx + inertia[1, 1] * wy + inertia[1, 2] * wz + h[2] * vx - h[0] * vz,
        inertia[2, 0] * wx + inertia[2, 1] * wy + inertia[2, 2] * wz + h[0] * vy - h[1] * vx,
        m * vx + wy * h[2] - wz * h[1],
        m * vy + wz * h[0] - wx * h[2],
        m * vz + wx * h[1] - wy * h[0],
    )


@compiled
def paired(a: Twist, b: Twist) -> float:
    """Return the inner product of a momentum or wrench with a twist."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


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
        b, rate, S = links.parent[a], links.ratio[a] * rates[links.leader[a]], screw(world, a)
        own = momentum(world, a, S)
        for c in range(6):
            links.twist[a, c] = rate * S[c] + (links.twist[b, c] if b >= 0 else 0.0)
            links.momentum[a, c] = rate * own[c]
    for a in range(links.count - 1, -1, -1):
        b, S, h, v = links.parent[a], screw(world, a), links.momentum[a], links.twist[a]
        if b >= 0:
            for c in range(6):
                links.momentum[b, c] += h[c]
            u = links.twist[b]
            base = momentum(world, a, (u[0], u[1], u[2], u[3], u[4], u[5]))
            for c in range(6):
                h[c] += base[c]
        turns = (
            S[1] * v[2] - S[2] * v[1], S[2] * v[0] - S[0] * v[2], S[0] * v[1] - S[1] * v[0],
            S[1] * v[5] - S[2] * v[4] + S[4] * v[2] - S[5] * v[1],
            S[2] * v[3] - S[0] * v[5] + S[5] * v[0] - S[3] * v[2],
            S[0] * v[4] - S[1] * v[3] + S[3] * v[1] - S[4] * v[0],
        )  # fmt: skip
        slope = paired((h[0], h[1], h[2], h[3], h[4], h[5]), turns)
        gradient[links.leader[a]] -= factor * links.ratio[a] * slope
