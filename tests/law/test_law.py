"""The law as a whole: measures, status bits, numbers at the edge of the range, and what it refuses."""

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose
from worlds import SHAPES, VARIANT, fits, matrices, named, one_world, seeds

from rmrc.law.jacobian_law import Law, resolve_rates
from rmrc.scenario.choices import Status
from rmrc.support.errors import QuestionError
from wording import says

WRITTEN = ("qdot_cmd", "sigma", "gain", "damping", "manipulability", "condition", "u_min", "v_min")
# Those whose gain is bounded: by 1/cutoff = 100, or less; or whose rates are.
BOUNDED = {
    "damped-constant", "damped-error", "filtered", "truncated", "selectively_damped", "damped-rate_bound",
}  # fmt: skip


def extreme(seed):
    """Return J of any shape, whose entries are zero or of some powers of ten, and a twist."""
    rng = np.random.default_rng(seed)
    m, n = SHAPES[seed % len(SHAPES)]
    some = rng.choice((-300, -170, -90, -8, 0, 8, 90, 150), size=rng.integers(1, 4))
    J = rng.choice([-1.0, 0.0, 1.0], (m, n)) * rng.choice([1.0, rng.uniform(1, 9)], (m, n))
    return J * 10.0 ** rng.choice(some, (m, n)), rng.choice([0.0, 1.0, -3.0, 1e-9, 1e6], m)


@named
def test_entries_of_any_size_give_numbers(variant):
    for seed in range(70):
        J, twist = extreme(seed)
        if not fits(variant, J.shape):
            continue
        _, tick = one_world(J, twist, variant=variant)
        for column in WRITTEN:
            assert not np.any(np.isnan(tick[column])), (seed, column, tick[column])
        if str(variant) in BOUNDED:
            most = max(100 * np.linalg.norm(twist), 2.0 * np.sqrt(J.shape[1]))
            assert np.linalg.norm(tick["qdot_cmd"]) <= most * (1 + 1e-9), seed
        assert twist.any() or not tick["qdot_cmd"].any(), seed


@pytest.mark.parametrize("factor", [0.5, 2.0])
@named
def test_a_sigma_that_is_rounding_gets_no_gain(variant, factor):
    # σ_2 on either side of 1e-14 σ_1, exact in a diagonal matrix; by their own thresholds some drop both.
    parameters = {"tolerance": 1e-16, "cutoff": 1e-16, "rate_bound": 1e30}
    _, tick = one_world(np.diag([4.0, factor * 4e-14]), np.ones(2), variant=variant, **parameters)
    assert tick["gain"][0] > 0
    assert (tick["gain"][1] > 0) == (factor > 1)


@given(matrices, seeds)
def test_recorded_measures_are_those_of_the_weighted_jacobian(J, seed):
    rng = np.random.default_rng(seed)
    m, n = J.shape
    wx, wq = rng.uniform(0.2, 5, m), rng.uniform(0.2, 5, n)
    A = np.sqrt(wx)[:, None] * J / np.sqrt(wq)
    sigma = np.linalg.svd(A, compute_uv=False)
    _, tick = one_world(J, rng.normal(size=m), wx, wq, VARIANT["damped-constant"])
    k = len(sigma)
    assert_allclose(tick["sigma"][:k], sigma, rtol=0, atol=1e-12 * max(1, sigma[0]))
    assert tick["manipulability"] == pytest.approx(np.prod(sigma), abs=1e-9 * max(1, sigma[0]) ** k)
    if sigma[-1] > 1e-6:
        u, v = tick["u_min"][:m], tick["v_min"][:n]
        assert tick["condition"] == pytest.approx(sigma[0] / sigma[-1], rel=1e-6)
        assert np.linalg.norm(u) == pytest.approx(1) and np.linalg.norm(v) == pytest.approx(1)
        assert_allclose(A.T @ u, sigma[-1] * v, rtol=0, atol=1e-11 * sigma[0])


# Status -------------------------------------------------------------------------------------------------------


def status_of(sigma, name, **parameters):
    _, tick = one_world(np.diag(np.asarray(sigma, float)), np.ones(2), variant=VARIANT[name], **parameters)
    return Status(int(tick["status"]))


@pytest.mark.parametrize(
    ("sigma", "is_singular"),
    [((2.0, 0.0202), False), ((2.0, 0.0198), True), ((100, 1), True), ((1, 1), False), ((1, 0), True), ((0, 0), True)],
)  # fmt: skip
def test_a_condition_of_a_hundred_is_called_singular(sigma, is_singular):
    assert bool(status_of(sigma, "inverse") & Status.SINGULAR) == is_singular


def test_an_inverse_is_never_called_damped_by_rounding():
    # σ · (1/σ) is below 1 for every seventh number or so, first for 49.
    for sigma in range(1, 500):
        assert status_of((sigma, sigma / 2), "inverse") == Status.OK, sigma


DAMPS_BELOW = {
    "pseudoinverse": {"tolerance": 0.1}, "truncated": {"cutoff": 0.1}, "jparse": {"gamma": 0.1},
    "filtered": {"damping_below": 0.1}, "selectively_damped": {"rate_bound": 10.0},
    "damped-smallest_singular_value": {"damping_below": 0.1}, "damped-manipulability": {"manipulability_below": 0.1},
    "damped-rate_bound": {"rate_bound": 10.0},
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "parameters", "sigma", "damped"),
    [
        *((name, keys, sigma, sigma < 0.1) for name, keys in DAMPS_BELOW.items() for sigma in (0.11, 0.09)),
        ("damped-error", {"error": 0.0}, 0.11, False),
        ("damped-error", {"error": 1e-3}, 0.11, True),
        ("damped-constant", {"damping_maximum": 1e-9}, 0.11, True),
        ("transpose", {}, 1.0, False),
        ("transpose", {}, 0.99, True),
        ("inverse", {}, 0.09, False),
        # A direction that is lost gets nothing and asks for nothing that anything could give: SINGULAR says so.
        ("pseudoinverse", {}, 0.0, False),
        ("jparse", {}, 0.0, False),
    ],
)
def test_damped_begins_where_each_method_begins_to_damp(name, parameters, sigma, damped):
    assert bool(status_of((1.0, sigma), name, **parameters) & Status.DAMPED) == damped


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_a_status_does_not_depend_on_the_unit_of_lengths(scale):
    for sigma, damped in ((0.11, False), (0.09, True)):
        status = status_of((scale, scale * sigma), "pseudoinverse", tolerance=0.1)
        assert status == Status.DAMPED * damped


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.ones((7, 2)), np.ones(7)), "J … (m, n) … 6 … twist (m,) … (7, 2), (7,)"),
        ((np.ones((2, 3)), np.ones(2), "inverse"), "method 'inverse' needs a square J, got (2, 3)"),
        ((np.eye(2), np.ones(2), "dampd"), 'method … "dampd" … "damped"…'),
        ((np.eye(2), np.array([np.nan, 1.0])), "J and twist must be finite"),
        ((1j * np.eye(2), np.ones(2)), "J must be real, got complex numbers"),
        ((np.eye(2), np.ones(2), "damped", "constant", np.nan), "error … >= 0, got nan"),
        ((np.eye(2), np.ones(2), "damped", "constant", 0.0, -0.1), "damping_maximum … >= 0, got -0.1"),
    ],
)
def test_resolve_rates_refuses_what_it_cannot_resolve(arguments, message):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        resolve_rates(
            *arguments[:3], **dict(zip(("schedule", "error", "damping_maximum"), arguments[3:], strict=False))
        )
    assert str(caught.value) == says(message)


def test_a_law_refuses_weights_and_worlds_that_are_none():
    for weights in ([1, np.nan], [1, np.inf], [1, 0], [1], 2.0):
        with pytest.raises(QuestionError, match="weights must be 2 numbers > 0 and finite"):
            Law(2, 2, weights=weights)
    law = Law(np.int64(2), 2)
    for wrong in ({"worlds": 0}, {"worlds": 2.5}, {"q": [0, 0], "worlds": 2}):
        with pytest.raises(QuestionError, match="worlds must be an integer > 0, without q"):
            law.reset(**wrong)
