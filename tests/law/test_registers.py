"""The decomposition in vector registers: near the last matrix it is LAPACK's, elsewhere it leaves all to Jacobi's."""

import numba
import numpy as np
import pytest
from numpy.testing import assert_allclose
from worlds import VARIANT, along, formula, with_sigma

from records import blank
from rmrc.law.jit import _APARTS, entry
from rmrc.law.svd import set_identity, svd

SHAPES = [(4, 4), (5, 6), (6, 6), (6, 7), (6, 8)]
STEP = 1e-3  # of an entry and a tick: an arm that turns by 1 rad/s at 1 kHz
ROUNDING = 2e-13  # angles are taken to 3e-7, which leaves cosines of their square
SPREAD = np.array([2.0, 1.6, 1.3, 0.9, 0.5, 0.2])

sharpen = numba.njit(error_model="numpy")(
    next(one.function for one in _APARTS if one.field == "call_sharpen")
)


@entry
def follow(worlds, ticks):  # as `decompose` does it, but that it says whether Jacobi's was needed
    world, tick = worlds[0], ticks[0]
    if sharpen(world, world.A, tick.sigma):
        return True
    svd(world.A, world.m, world.n, world.u, tick.sigma, world.v)
    return False


@entry
def is_followed(worlds, ticks):
    return sharpen(worlds[0], worlds[0].A, ticks[0].sigma)


@entry
def begin(worlds):
    set_identity(worlds[0].u, worlds[0].k)


def world_of(m, n):
    world, tick = blank(m, n)
    world["k"] = min(m, n)
    begin(world)
    return world, tick


def errors(world, tick, A):
    """Return how far u and v are from orthonormal, σ from LAPACK's, and the product from the matrix."""
    m, n = A.shape
    k, one = min(m, n), np.eye(min(m, n))
    u, v, sigma = world["u"][0, :k, :m], world["v"][0, :k, :n], tick["sigma"][0, :k]
    assert np.all(np.diff(sigma) <= 0)
    true = np.linalg.svd(A, compute_uv=False)
    rest = (u.T * sigma) @ v - A
    return [np.abs(x).max() for x in (u @ u.T - one, v @ v.T - one, sigma / true - 1, rest / true[0])]


def path(m, n, sigma, steps=200, step=STEP, seed=0):
    rng = np.random.default_rng([seed, m, n])
    A, to = with_sigma(rng, m, n, sigma), rng.normal(size=(m, n)) / n
    return A + step * np.arange(steps)[:, None, None] * to


@pytest.mark.parametrize(("m", "n"), SHAPES)
def test_it_follows_a_matrix_that_moves(m, n):
    world, tick = world_of(m, n)
    done = []
    for A in path(m, n, SPREAD[:m]):
        world["A"][0, :m, :n] = A
        done.append(follow(world, tick))
        assert max(errors(world, tick, A)) < ROUNDING
    assert not done[0]  # from the identity
    assert sum(done) > 0.9 * len(done)


@pytest.mark.parametrize("times", [1e-50, 1e-3, 1.0, 1e50])
def test_its_vectors_do_not_depend_on_units(times):
    A, vectors = path(6, 6, SPREAD, steps=2), []
    for scale in (1.0, times):
        world, tick = world_of(6, 6)
        for one in A:
            world["A"][0, :6, :6] = scale * one
            last = follow(world, tick)
        assert last
        vectors.append(np.array([world["u"][0], world["v"][0]]))
    assert_allclose(*vectors, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(
    "fault", ["jumps", "nearly singular", "singular", "not finite", "infinite", "tiny", "huge", "tall"]
)
def test_it_leaves_to_jacobis_method_what_it_cannot_do(fault):
    m, n = (6, 4) if fault == "tall" else (6, 6)
    world, tick = world_of(m, n)
    sigma = SPREAD[: min(m, n)].copy()
    if "singular" in fault:
        sigma[-1] = 0.0 if fault == "singular" else sigma[0] / 101
    A = with_sigma(np.random.default_rng(1), m, n, sigma)
    world["A"][0, :m, :n] = A
    follow(world, tick)
    changed = world["A"][0]
    if fault == "jumps":
        changed[:6, :6] += 0.3 * np.random.default_rng(2).normal(size=(6, 6))
    elif fault in ("not finite", "infinite"):
        changed[3, 2] = np.nan if fault == "not finite" else np.inf
    elif fault in ("tiny", "huge"):
        changed *= 1e-170 if fault == "tiny" else 1e170
    assert not is_followed(world, tick)


@pytest.mark.parametrize("shape", [(6, 6), (6, 7)])
def test_rates_are_those_of_the_formula_where_singular_values_meet_or_vanish(shape):
    # σ_2 passes σ_1 and σ_4 is equal to σ_3 throughout; σ_6 dies on the way. λ² = 0.01 bounds the slope by 100.
    s, rng = np.linspace(-0.1, 0.1, 401), np.random.default_rng(3)
    u, v = (np.linalg.qr(rng.normal(size=(size, size)))[0] for size in shape)
    sigma = np.stack([2 + s, 2 - s, 1 + 0 * s, 1 + 0 * s, 0.6 + s, s], axis=1)
    J = np.einsum("ik,sk,jk->sij", u, sigma, v[:, :6])
    J = J + s[:, None, None] * 0.1 * rng.normal(size=shape)
    twist, variant = rng.normal(size=6), VARIANT["damped-constant"]
    rates = along(J, twist, method=variant.method, schedule=variant.schedule, damping_maximum=0.1)
    true = np.array([formula(variant, one, twist, damping_maximum=0.1)[0] for one in J])
    assert_allclose(rates, true, rtol=0, atol=2e-12 * 10 * np.linalg.norm(twist))


def test_the_check_finds_a_turn_that_is_left_out():
    world, tick = world_of(6, 6)
    for A in path(6, 6, SPREAD, steps=2):
        world["A"][0, :6, :6] = A
        follow(world, tick)
    assert max(errors(world, tick, A)) < ROUNDING
    world["u"][0, 0] += 1e-9 * world["u"][0, 1]
    assert max(errors(world, tick, A)) > 100 * ROUNDING
