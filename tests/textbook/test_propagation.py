"""Recursions from link to link against explicit forms: DH chains, MuJoCo, moments about each joint, power."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from rmrc.textbook.dh import DHChain
from rmrc.textbook.propagation import (
    actuator_torques,
    inward_wrenches,
    jacobian_by_propagation,
    outward_velocities,
)

# A few dozen products of order ten.
ROUNDING = 1e-12

seeds = st.integers(0, 2**32 - 1)


def moved(point):
    T = np.eye(4)
    T[:3, 3] = point
    return T


class Chain:
    """A random modified DH chain: links, pitch, tip, rates, a wrench; and its explicit Jacobian.

    A helical joint is told to the DH chain as a hinge and a slide on one axis, so it knows no pitch.
    """

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        n = rng.integers(1, 7)
        table = [tuple(row) for row in rng.uniform(-1, 1, (n, 4)) * [np.pi, 1, 1, np.pi]]
        self.pitch = rng.choice([0.0, 0.3, -0.2, np.inf], n)
        self.q, self.qdot = rng.uniform(-2, 2, (2, n))
        self.point, self.wrench = rng.uniform(-1, 1, 3), rng.normal(size=6)
        self.coupling = np.zeros((2 * n, n))
        self.coupling[np.arange(n) * 2, np.arange(n)] = np.isfinite(self.pitch)
        self.coupling[np.arange(n) * 2 + 1, np.arange(n)] = np.where(np.isinf(self.pitch), 1.0, self.pitch)
        rows = [row for first in table for row in (first, (0.0, 0.0, 0.0, 0.0))]
        self.pairs = DHChain(tuple(rows), ("revolute", "prismatic") * n)
        self.frames = self.pairs.frames(self.coupling @ self.q)[::2]
        self.links = np.linalg.inv(self.frames[:-1]) @ self.frames[1:]
        self.tip = moved(self.point)

    def jacobian(self, link, point=(0.0, 0.0, 0.0)):
        """Of a point of link 1..n, explicitly, along {0}."""
        return self.pairs.jacobian(self.coupling @ self.q, 2 * link, point) @ self.coupling


def check_velocities(chain):
    twists = outward_velocities(chain.links, chain.pitch, chain.qdot, chain.tip)
    n = len(chain.q)
    for link, point in [*((i, np.zeros(3)) for i in range(1, n + 1)), (n, chain.point)]:
        R = chain.frames[link][:3, :3]
        explicit = chain.jacobian(link, point) @ chain.qdot
        row = link if point.any() else link - 1
        assert_allclose(twists[row], [*(R.T @ explicit[:3]), *(R.T @ explicit[3:])], atol=ROUNDING)
    J = jacobian_by_propagation(chain.links, chain.pitch, chain.tip)
    assert_allclose(J, chain.jacobian(n, chain.point), atol=ROUNDING)


def check_reactions(chain):
    """What is cut free at joint i is in equilibrium: same force, and its moment about the joint."""
    reactions = inward_wrenches(chain.links, chain.wrench, chain.tip)
    last = chain.frames[-1]
    R, tip = last[:3, :3], last[:3, :3] @ chain.point + last[:3, 3]
    f, n = R @ chain.wrench[:3], R @ chain.wrench[3:]
    for frame, reaction in zip(chain.frames[1:], reactions, strict=True):
        moment = n + np.cross(tip - frame[:3, 3], f)
        assert_allclose(reaction, [*(frame[:3, :3].T @ f), *(frame[:3, :3].T @ moment)], atol=ROUNDING)
    tau = actuator_torques(reactions, chain.pitch)
    explicit = chain.jacobian(len(chain.q), chain.point)
    assert_allclose(tau, explicit.T @ np.concatenate([f, n]), atol=ROUNDING)


@given(seeds)
def test_velocities_are_those_of_the_explicit_jacobian_for_every_link(seed):
    check_velocities(Chain(seed))


@given(seeds)
def test_reactions_keep_every_cut_in_equilibrium_and_drives_give_j_transposed_f(seed):
    check_reactions(Chain(seed))


def test_what_costs_no_torque_at_a_singularity_is_carried_by_the_bearings():
    arm = DHChain(((0, 0, 0, 0), (0, 1.0, 0, 0), (0, 0.8, 0, 0)), ("revolute",) * 3)
    along = np.array([1000.0, 0, 0, 0, 0, 0])  # the links' own direction, stretched out
    reactions = inward_wrenches(arm.link_transforms([0.7, 0, 0]), along, moved([0.6, 0, 0]))
    assert_allclose(reactions, [along] * 3, atol=0)
    assert_allclose(actuator_torques(reactions, np.zeros(3)), 0.0, atol=0)


# Negative controls: each fault is planted into the recursion, and a check above must fail --------


# Any arm of MuJoCo -------------------------------------------------------------------------------


# Arguments ---------------------------------------------------------------------------------------
