"""Dominance and the ranks of fronts against their definitions."""

from hypothesis import given
from hypothesis import strategies as st

from rmrc.tuning.front import Point, dominates, front, ranks

# few values, so that ties are frequent
numbers = st.sampled_from([0.0, 1.0, 1.5, 2.0, 3.0])
points = st.lists(st.builds(Point, numbers, numbers, numbers), max_size=14)


def beats(a, b):
    """The definition: no worse in rate and error, and better in one; or equal in both, and shorter."""
    no_worse = a.peak_rate <= b.peak_rate and a.error <= b.error
    better = a.peak_rate < b.peak_rate or a.error < b.error
    return no_worse and (better or a.time < b.time)


def peeled(given_points):
    """Ranks by their definition: the points that none of the rest beats, removed again and again."""
    left, result, rank = set(range(len(given_points))), {}, 0
    while left:
        free = {i for i in left if not any(beats(given_points[j], given_points[i]) for j in left)}
        result |= dict.fromkeys(free, rank)
        left, rank = left - free, rank + 1
    return [result[i] for i in range(len(given_points))]


@given(points)
def test_ranks_are_the_fronts_that_are_peeled_off_one_by_one(some):
    assert ranks(some) == peeled(some)
    on_front = [i for i, rank in enumerate(peeled(some)) if rank == 0]
    assert front(some) == sorted(on_front, key=lambda i: (some[i], i))
    assert all(dominates(a, b) == beats(a, b) for a in some for b in some)


def test_a_planted_fault_is_seen():
    # a front that forgets the time of equals
    some = [Point(1.0, 1.0, 2.0), Point(1.0, 1.0, 1.0)]
    assert ranks(some) == [1, 0] != ranks([point._replace(time=0.0) for point in some])
