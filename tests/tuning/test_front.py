"""Dominance and the front against their definitions."""

from hypothesis import given
from hypothesis import strategies as st

from rmrc.tuning.front import Point, dominates, front

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
