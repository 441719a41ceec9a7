"""Which rates are continuous along a path of Jacobians through rank loss, and which are not.

A path is sampled with steps h and h/10. Of a law that is continuous ‖Δq̇‖/‖ΔJ‖ stays what it is; at a jump it
grows tenfold. Where the theory gives a bound, from the derivative of the filter, it is held as well.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from worlds import NAMES, VARIANT, along, with_sigma

from codes import Method, Objective

CONTINUOUS = {
    "damped-constant", "damped-smallest_singular_value", "damped-manipulability", "damped-error", "filtered",
    "jparse", "transpose", "selectively_damped",  # the last while no two σ meet
}  # fmt: skip
DISCONTINUOUS = {"inverse", "pseudoinverse", "truncated", "damped-rate_bound"}

COARSE = 150  # steps h; a tenth of them is what the growth is seen at
GROWTH = 1.5  # a bounded quotient grows by the error of sampling it, some per cent; at a jump it grows by 10

# Where a σ dies: no multiple of a step, so that no sample is at the singularity but some are very near.
FIRST, SECOND = 1 / np.sqrt(2), np.exp(-1)


class Path(NamedTuple):
    """J(s) for s from 0 to 1.

    Attributes:
        J: (steps + 1, m, n).
        twist: Of the whole path, of norm 1, (m,).
        turning: Largest ‖dV/ds‖ where the path is made of turning vectors, else NaN.
    """

    J: np.ndarray
    twist: np.ndarray
    turning: float


def turned(generator, s):
    """Return exp(s X) of a skew X for every s."""
    omega, w = np.linalg.eig(generator)
    return np.einsum("ij,sj,jk->sik", w, np.exp(np.outer(s, omega)), np.linalg.inv(w)).real


@cache
def path(kind, m, n, steps):
    """Return a path of m x n matrices: `one`, `two` σ that die one after another, or a `line` through rank loss."""
    rng = np.random.default_rng([0, m, n])
    s, k = np.linspace(0, 1, steps + 1), min(m, n)
    twist = rng.normal(size=m)
    twist /= np.linalg.norm(twist)
    if kind == "line":
        # σ near 1, so that w is near σ_k, and a schedule by w does not act over less than a step
        lost = with_sigma(rng, m, n, np.append(rng.uniform(0.8, 1.3, k - 1), 0.0))
        slope = rng.normal(size=(m, n)) / np.sqrt(n)
        return Path(lost + (s - FIRST)[:, None, None] * slope, twist, np.nan)
    sigma = np.array([1.0 + 0.2 * i + 0.05 * np.sin(3 * s + i) for i in range(k)])
    sigma[0] = s - FIRST  # changes its sign, which the decomposition hides in a vector
    if kind == "two":
        sigma[1] = 0.9 * (s - SECOND)
    X, Y = (np.subtract(x, x.T) for x in (rng.normal(size=(size, size)) / size for size in (m, n)))
    u = turned(X, s) @ np.linalg.qr(rng.normal(size=(m, m)))[0]
    v = turned(Y, s) @ np.linalg.qr(rng.normal(size=(n, n)))[0]
    J = np.einsum("sik,ks,sjk->sij", u[:, :, :k], sigma, v[:, :, :k])
    return Path(J, twist, np.linalg.norm(Y, 2))


PATHS = [("one", 2, 2), ("line", 3, 3), ("one", 5, 3), ("two", 6, 7)]


def quotients(J, rates):
    """Return ‖Δq̇‖/‖ΔJ‖ of neighbors."""
    return np.linalg.norm(np.diff(rates, axis=0), axis=1) / np.linalg.norm(np.diff(J, axis=0), axis=(1, 2))


def growth(answer, kind, m, n):
    """Return by how much the quotient grows from a step h to the ten of h/10 in it, of path -> rates.

    Each is held against those of its own step and of the two beside it, so that a small jump is found beside a
    steep slope elsewhere; but not against less than a tenth of the largest, as a quotient may pass through zero.
    """
    coarse, fine = (path(kind, m, n, steps) for steps in (COARSE, 10 * COARSE))
    one, ten = quotients(coarse.J, answer(coarse)), quotients(fine.J, answer(fine)).reshape(COARSE, 10)
    around = np.max([np.append(one[1:], 0), one, np.append(0, one[:-1])], axis=0)
    return float(np.max(ten.max(axis=1) / np.maximum(around, 0.1 * one.max())))


def law_of(name):
    """Return path -> rates of a variant of the law."""
    variant = VARIANT[name]
    parameters = {"method": variant.method, "schedule": variant.schedule, **SHARP.get(name, {})}
    return lambda p: along(p.J, p.twist, **parameters)


# Parameters that make the promise no easier than it need be: everything acts along the paths.
SHARP = {
    "pseudoinverse": {"tolerance": 0.05},
    "truncated": {"cutoff": 0.05},
    "damped-error": {"error": 0.2, "error_gain": 0.5},
    "damped-rate_bound": {"rate_bound": 1.0},
    "selectively_damped": {"rate_bound": 1.0},
}


def test_every_method_and_schedule_has_a_promise():
    without = set(NAMES) - CONTINUOUS - DISCONTINUOUS
    assert not without, f"say above, and in docs/theory.md, whether these are continuous: {without}"
    assert {*CONTINUOUS, *DISCONTINUOUS} == set(NAMES)
    assert not CONTINUOUS & DISCONTINUOUS


@pytest.mark.parametrize("name", sorted(CONTINUOUS))
def test_rates_are_continuous_through_rank_loss(name):
    for kind, m, n in PATHS:
        if name == "selectively_damped" and kind != "one":
            continue  # its σ keep apart; of the others some meet, where it promises nothing
        times = growth(law_of(name), kind, m, n)
        assert times < GROWTH, (kind, m, n, times)


@pytest.mark.parametrize("name", sorted(DISCONTINUOUS))
def test_the_check_finds_the_methods_that_jump(name):
    # Each is said to jump, and does: else the theory is wrong, or the check finds nothing.
    kind, m, n = "one", 3, 3
    times = growth(law_of(name), kind, m, n)
    assert times > 5


# Null space ---------------------------------------------------------------------------------------------------

WIDE = [("one", 2, 4), ("line", 3, 5), ("two", 6, 7)]


def projected(p):
    """Return N qdot0 along a path of wide matrices, of constant wishes: the command is zero."""
    n = p.J.shape[2]
    return along(
        p.J, np.zeros(p.J.shape[1]), method=Method.DAMPED, damping_maximum=0.1,
        objective=Objective.RATES, nullspace_gain=1.0, nullspace_rates=np.arange(1.0, n + 1),
    )  # fmt: skip


def projected_by_threshold(p):
    """N of the vectors whose σ is above a threshold: a direction that dies is handed to the objective."""
    n = p.J.shape[2]
    _, sigma, vt = np.linalg.svd(p.J, full_matrices=False)
    held = np.where(sigma[:, :, None] > 1e-2, vt, 0)
    wished = np.arange(1.0, n + 1)
    return wished - np.einsum("skj,ski,i->sj", held, held, wished)


@pytest.mark.parametrize(("kind", "m", "n"), WIDE)
def test_null_space_motion_is_continuous_through_rank_loss(kind, m, n):
    times = growth(projected, kind, m, n)
    jumps = growth(projected_by_threshold, kind, m, n)
    assert jumps > 5  # negative control
    assert times < GROWTH
    fine = path(kind, m, n, 10 * COARSE)
    rates = projected(fine)
    if kind != "line":
        # N = I − V Vᵀ and dV = Y V ds, so ‖dN‖ ≤ 2 ‖Y‖ ds. Rounding turns v_k by 1e-15/σ_k, and σ_k > 1e-5.
        size = np.linalg.norm(np.arange(1.0, n + 1))
        change = np.linalg.norm(np.diff(rates, axis=0), axis=1)
        assert change.max() <= 2 * fine.turning * size * (1 / (10 * COARSE)) * (1 + 1e-3) + 1e-9
    # and there is such a motion
    assert np.linalg.norm(rates, axis=1).min() > 0.01
