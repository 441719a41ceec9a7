"""The sampled loop: its edge against the roots of its characteristic polynomial, written out here."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import polynomial
from numpy.testing import assert_allclose

from project import examples
from rmrc.textbook.stability import edge_delay, edge_frequency, edge_gain, edge_lag, rule_gain

PERIODS = st.sampled_from([1.0, 0.001, 0.02])
TICKS = st.floats(0.0, 20.0)  # of dead time
LAGS = st.just(0.0) | st.floats(0.01, 100.0)  # in periods


def largest_root(gain, delay, lag):
    """Return the largest |z| of z^(d+1) (z − 1)(z − a) + K (f + (1 − f) z) B(z), with T = 1.

    The lagging rate is y⁺ = y + (1 − a)(u − y), and the joint moves by u − L (1 − a)(u − y).
    """
    whole = math.floor(delay)
    part = delay - whole
    closed = polynomial.polymul(np.eye(whole + 2)[whole + 1], [-1.0, 1.0])
    opened = np.array([part, 1.0 - part])
    if lag > 0.0:
        a = math.exp(-1.0 / lag)
        moved = lag * (1.0 - a)
        closed = polynomial.polymul(closed, [-a, 1.0])
        opened = polynomial.polymul(opened, [moved - a, 1.0 - moved])
    return np.abs(polynomial.polyroots(polynomial.polyadd(closed, gain * opened))).max()


@pytest.mark.parametrize("ticks", range(6))
def test_the_edge_of_whole_ticks_is_in_closed_form(ticks):
    wanted = 2.0 * math.sin(math.pi / (2 * (2 * ticks + 1)))
    assert_allclose(edge_gain(0.001, ticks * 0.001) * 0.001, wanted, rtol=1e-12)
    assert_allclose(edge_frequency(0.001, ticks * 0.001) * 0.001, math.pi / (2 * ticks + 1), rtol=1e-12)


@given(PERIODS, TICKS, LAGS)
def test_at_the_edge_a_root_leaves_the_unit_circle(period, ticks, lag):
    gain = edge_gain(period, ticks * period, lag * period) * period
    # the slope of |z| over ln K is 1e-3 at least, but for lags of a hundred periods
    assert largest_root(gain * (1.0 - 1e-3), ticks, lag) < 1.0 < largest_root(gain * (1.0 + 1e-3), ticks, lag)


@given(PERIODS, TICKS, LAGS)
def test_below_the_edge_all_gains_are_stable_and_so_is_the_rule(period, ticks, lag):
    edge = edge_gain(period, ticks * period, lag * period)
    shares = np.linspace(0.05, 0.99, 12)
    assert all(largest_root(edge * period * share, ticks, lag) < 1.0 for share in shares)
    assert rule_gain(period, ticks * period, lag * period) <= edge * (1.0 + 1e-12)


@given(PERIODS, st.floats(0.6, 20.0), st.floats(0.0, 10.0))
@examples(3, 200)
def test_the_longest_dead_time_is_that_whose_edge_it_is(period, ticks, lag):
    feedback = edge_gain(period, ticks * period, lag * period)
    assert_allclose(edge_delay(feedback, period, lag * period), ticks * period, rtol=1e-9)


@given(PERIODS, st.floats(0.6, 20.0), st.floats(0.05, 10.0))
@examples(3, 200)
def test_the_longest_lag_is_that_whose_edge_it_is(period, ticks, lag):
    feedback = edge_gain(period, ticks * period, lag * period)
    assert_allclose(edge_lag(feedback, period, ticks * period), lag * period, rtol=1e-5)


def test_a_loop_slower_than_all_that_is_late_but_the_lag_bears_any_lag():
    delay, period = 0.008, 0.001
    assert edge_lag(0.999 / (delay + 0.5 * period), period, delay) == math.inf
    assert edge_lag(1.01 / (delay + 0.5 * period), period, delay) < math.inf
    assert_allclose(edge_gain(period, delay, 1e4), 1.0 / (delay + 0.5 * period), rtol=1e-4)
