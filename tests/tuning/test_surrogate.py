"""What is guessed of settings: against functions that are known, and areas against sums over a fine grid."""

import numpy as np
import pytest

from rmrc.tuning.surrogate import Surrogate, gains

REFERENCE = (1.0, 1.0)


def known(points):
    """Return two figures over the square: one that the second edge hardly changes, and one with a kink."""
    x, y = points.T
    return np.stack([np.sin(3.0 * x) + 0.05 * y, np.abs(x - 0.5) + y**2], axis=1)


def test_what_was_run_is_guessed_and_what_is_beside_it_nearly():
    random = np.random.default_rng(3)
    points, others = random.random((40, 2)), random.random((200, 2))
    surrogate = Surrogate(points, known(points))
    # the kernel's noise is 1e-3 of the variance: its root is 0.03 of what varies, here about 0.3
    assert np.abs(surrogate.at(points, 0.0) - known(points)).max() < 0.02
    off = np.abs(surrogate.at(others, 0.0) - known(others))
    assert np.median(off) < 0.01
    # negative control: the mean alone is ten times as far off
    assert np.median(np.abs(known(points).mean(axis=0) - known(others))) > 10.0 * np.median(off)


def test_hope_is_large_far_from_what_was_run_and_small_beside_it():
    points = 0.2 * np.random.default_rng(4).random((20, 3))
    surrogate = Surrogate(points, known(points[:, :2]))
    near, far = points[:1] + 0.001, np.ones((1, 3))
    hope = [surrogate.at(one, 0.0) - surrogate.at(one, 1.0) for one in (near, far)]
    assert (hope[0] > 0.0).all()
    assert (hope[1] > 5.0 * hope[0]).all()


@pytest.mark.parametrize("count", [0, 1, 7])
def test_a_gain_is_the_area_that_only_the_new_point_dominates(count):
    random = np.random.default_rng(count)
    front, points = random.uniform(0.0, 1.1, (count, 2)), random.uniform(0.0, 1.1, (20, 2))
    x = (np.arange(10_000) + 0.5) / 10_000
    # in a strip at x the front leaves what is below the least of its points up to x
    below = np.where(x >= front[:, :1], front[:, 1:], 1.0).min(axis=0, initial=1.0)
    wanted = [np.where(x >= px, np.maximum(below - py, 0.0), 0.0).mean() for px, py in points]
    # 10,000 strips are off by at most one at each edge of a staircase
    assert gains(front, points, REFERENCE) == pytest.approx(wanted, abs=1e-3)
    assert max(wanted) > 0.02
