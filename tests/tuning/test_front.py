"""Dominance and the front against their definitions; the dominated area against squares that are counted."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rmrc.tuning.front import Point, area, dominates, front, gains

# few values, so that ties are frequent
numbers = st.sampled_from([1.0, 1.5, 2.0, 3.0])
points = st.lists(st.builds(Point, numbers, numbers, numbers), max_size=14)


def beats(a, b):
    """The definition: no worse in rate and error, and better in one; or equal in both, and shorter."""
    no_worse = a.peak_rate <= b.peak_rate and a.error <= b.error
    better = a.peak_rate < b.peak_rate or a.error < b.error
    return no_worse and (better or a.time < b.time)


@given(points)
def test_the_front_is_what_nothing_beats(some):
    nothing_beats = [i for i, b in enumerate(some) if not any(beats(a, b) for a in some)]
    assert front(some) == sorted(nothing_beats, key=lambda i: (some[i], i))
    assert all(dominates(a, b) == beats(a, b) for a in some for b in some)


@given(points)
def test_the_area_is_that_of_the_squares_that_a_point_dominates(some):
    edge, cells = math.log(4.0), 40
    middles = (np.arange(cells) + 0.5) * edge / cells
    dominated = np.zeros((cells, cells), bool)
    for point in some:
        rate, error = point.logs
        dominated |= (middles[:, None] > rate) & (middles > error)
    counted = dominated.sum() * (edge / cells) ** 2
    total = area(some, (edge, edge))
    assert total == pytest.approx(counted, abs=2.5 * edge * edge / cells)
    if some:
        logs = np.array([point.logs for point in some])
        (gained,) = gains(logs[:-1].reshape(-1, 2), logs[-1:], (edge, edge))
        assert gained == pytest.approx(total - area(some[:-1], (edge, edge)), abs=1e-12)
