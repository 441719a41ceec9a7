"""What a jerk limit promises: of the bounds of one joint, of any wishes, and of whole runs under every policy."""

import functools
import operator

import numba
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from codes import Method, OnExcess
from oracle_limits import least_way, ticks_to_rate
from project import examples
from records import blank, put, resolve
from rmrc.law import braking as stops
from rmrc.law.jerk import remember, stopping_rate
from rmrc.scenario.choices import LIMITS, Status
from shipped import shipped

T = 1e-3
LIMITING = [name for name in LIMITS.names if name != "none"]
EXCEEDED = Status.ACCELERATION_EXCEEDED | Status.JERK_EXCEEDED


# The bounds of one joint ----------------------------------------------------------------------------------------


@numba.njit(error_model="numpy")
def way(rate, change, braking, step):
    return stops.way(rate / step, change / step, braking / step) * step


# in steps of jerk, so that programs stay small; a braking below 1 is one that jerk does not bind
brakings, rates, changes = st.floats(0.3, 8.0), st.floats(0.01, 30.0), st.floats(-1.0, 4.0)


@examples(5, 30)
@given(brakings, rates, changes, st.floats(1e-6, 10.0))
def test_the_way_to_rest_is_the_least_that_jerk_and_deceleration_allow(braking, rate, change, step):
    change = max(change, -braking)
    wanted = least_way(rate, change, braking, 1.0)
    assume(np.isfinite(wanted))  # else it turns back whatever is done
    # the program's own tolerance is 1e-7
    assert way(rate * step, change * step, braking * step, step) == pytest.approx(wanted * step, rel=1e-6)


@examples(30, 200)
@given(st.floats(1e-2, 1e3), st.floats(0.05, 20.0), st.floats(0.01, 10.0))
def test_a_steady_rate_is_the_largest_that_a_stop_of_half_that_rate_on_average_ends_within_a_distance(
    ticks, braking, step
):
    """A stop takes v/b + b/j, or 2 √(v/j) where the deceleration stays below b; the last tick needs v alone."""
    rate = stops.steady_stop(ticks * T, braking, step, T)
    time = rate / braking + braking / step if rate > braking**2 / step else 2.0 * np.sqrt(rate / step)
    exact = 0.5 * rate * time == pytest.approx(ticks, rel=1e-9)
    assert exact or (rate == pytest.approx(ticks, rel=1e-12) and 0.5 * rate * time < ticks)


@examples(10, 40)
@given(st.floats(0.5, 8.0), rates, changes, st.floats(0.05, 0.95))
def test_near_a_position_limit_the_rate_is_the_largest_from_which_the_joint_stops(
    braking, rate, change, share
):
    step, change = 500.0 * T**2, max(change, -braking)
    nearest, farthest = (least_way(rate + c, c, braking, 1.0) for c in (change - 1.0, change + 1.0))
    assume(np.isfinite(nearest) and np.isfinite(farthest) and nearest < farthest)
    distance = nearest + share * (farthest - nearest)
    joint = Joints(braking=braking * step / T, ends=[[-np.inf], [distance * step * T]])
    put(joint.world, q=np.zeros(1), qdot_cmd_last=np.full(1, rate * step), course=np.full(1, change * step))
    largest = stopping_rate(joint.world.records[0], 0, 1.0) / step
    # the false position ends within 1e-7 of the rate, and the program within as much
    assert least_way(largest, largest - rate, braking, 1.0) == pytest.approx(distance, rel=1e-5)


# Any wishes -----------------------------------------------------------------------------------------------------


class Joints:
    """Joints whose task is their own rates, on the ideal plant, with the memory of the loop."""

    def __init__(
        self, n=1, on_excess="clamp", jerk=500.0, acceleration=np.inf, rate=np.inf, ends=None, braking=10.0
    ):
        each = lambda value: np.broadcast_to(np.asarray(value, float), n).copy()  # noqa: E731
        self.jerk, self.acceleration, self.rate = each(jerk), each(acceleration), each(rate)
        self.ends = np.tile([[-np.inf], [np.inf]], n) if ends is None else np.asarray(ends, float)
        self.world, self.tick = blank(n, n)
        put(
            self.world, method=Method.PSEUDOINVERSE, tolerance=1e-9, J=np.eye(n), period=T, is_eased=1,
            on_excess=OnExcess[on_excess.upper()], jerk_step=self.jerk * T**2,
            change_limit=self.acceleration * T, braking=np.minimum(each(braking), self.acceleration),
            rate_limit=self.rate, position_limit=self.ends,
        )  # fmt: skip
        self.q, self.last, self.change, self.course, self.n = *np.zeros((4, n)), n

    def at(self, q, rate, change):
        """Put the joints into a state."""
        self.q, self.last, self.change = (np.full(self.n, x, float) for x in (q, rate, change))
        self.course = self.change
        return self

    def step(self, wish):
        """Return rates and status of a tick, and go on."""
        put(self.world, q=self.q, qdot_cmd_last=self.last, change_last=self.change, course=self.course)
        self.world["twist_cmd"][0, : self.n] = wish
        resolve(self.world, self.tick)
        sent = self.tick["qdot_cmd"][0, : self.n].copy()
        remember.entry(8)(self.world.records.ctypes.data)
        self.course = self.world["course"][0, : self.n].copy()
        self.change, self.last, self.q = sent - self.last, sent, self.q + T * sent
        return sent, Status(int(self.tick["status"][0]))

    def run(self, wishes):
        """Return rates, positions and status of many ticks."""
        rows = [(*self.step(wish), self.q.copy()) for wish in wishes]
        sent, status, q = zip(*rows, strict=True)
        return np.array(sent), np.array(q), functools.reduce(operator.or_, status)

    def holds(self, sent, q):
        """Say which limits are kept, from rest on."""
        changes = np.diff(sent, axis=0, prepend=0.0)
        kept = {
            # each is a difference of rates, of which each is rounded; positions are sums of them
            "jerk": np.abs(np.diff(changes, axis=0, prepend=0.0)) <= self.jerk * T**2 * (1 + 1e-9) + 1e-14,
            "acceleration": np.abs(changes) <= self.acceleration * T * (1 + 1e-9) + 1e-14,
            "rate": np.abs(sent) <= self.rate * (1 + 1e-12),
            "position": (self.ends[0] - 1e-12 <= q) & (q <= self.ends[1] + 1e-12),
        }
        return {name for name, all_of_it in kept.items() if all_of_it.all()}


ALL = {"jerk", "acceleration", "rate", "position"}


def greedy(seed, n, ticks=400):
    """Return wishes that turn at random ticks, by far too much; some rest, and some move steadily."""
    rng = np.random.default_rng(seed)
    wishes, now, slope = np.zeros((ticks, n)), np.zeros(n), np.zeros(n)
    for t in range(ticks):
        if rng.random() < 0.03:
            now, slope = rng.choice([-50.0, -0.5, 0.0, 0.5, 50.0], n), rng.choice([0.0, 0.0, 0.01], n)
        wishes[t] = now = now + slope
    return wishes


@examples(5, 15)
@given(
    st.integers(0, 10_000), st.sampled_from(LIMITING), st.sampled_from([50.0, 500.0, 5000.0]),
    st.sampled_from([np.inf, 30.0, 3.0]),
)  # fmt: skip
def test_from_rest_no_wish_brings_two_joints_beyond_any_limit(seed, on_excess, jerk, acceleration):
    rng = np.random.default_rng(seed)
    ends = np.array([[-0.3, -2.0], [0.4, 1.5]]) * rng.uniform(0.5, 2.0)
    limits = {
        "jerk": [jerk, 0.7 * jerk], "acceleration": [acceleration, 2 * acceleration], "rate": [1.0, 3.0],
        "braking": rng.uniform(1.0, 20.0, 2), "ends": ends,
    }  # fmt: skip
    joints = Joints(2, on_excess, **limits)
    sent, q, status = joints.run(greedy(seed, 2))
    assert np.isfinite(sent).all() and joints.holds(sent, q) == ALL
    assert not status & EXCEEDED


class Lagging(Joints):
    """A joint whose rates follow with a time constant, which measured rates tell or not."""

    def __init__(self, lag, tells=True, **limits):
        super().__init__(1, **limits)
        self.lag, self.tells, self.state = lag, tells, np.zeros(1)

    def step(self, wish):
        before = self.q
        sent, status = super().step(wish)
        share = 1 - np.exp(-T / self.lag)
        rate = sent - self.lag / T * share * (sent - self.state)  # the mean over the tick
        self.state, self.q = self.state + share * (sent - self.state), before + T * rate
        put(self.world, qdot=rate * self.tells)
        return sent, status


@pytest.mark.parametrize(("jerk", "lag"), [(500.0, 3e-2), (5000.0, 1e-2)])
def test_a_joint_that_lags_stops_within_jerk_before_its_position_limit(jerk, lag):
    limits = {"jerk": jerk, "acceleration": 10.0, "rate": 1.0, "ends": [[-0.5], [0.5]]}
    wishes = [50.0] * 1500 + [-50.0] * 2500
    joint = Lagging(lag, **limits)
    sent, q, status = joint.run(wishes)
    assert joint.holds(sent, q) >= {"jerk", "acceleration", "rate"} and not status & EXCEEDED
    assert (
        0.499 < np.abs(q).max() < 0.5 + 1e-5
    )  # it comes close; the mean rate of a tick is not that at its end
    # negative control: what does not show in its rates is not foreseen, and the joint goes on by rate times lag
    hidden = Lagging(lag, tells=False, **limits)
    sent, q, status = hidden.run(wishes)
    assert np.abs(q).max() > 0.5 + 0.3 * lag and hidden.holds(sent, q) >= {"jerk"} and not status & EXCEEDED


@examples(10, 30)
@given(
    st.floats(-1.0, 1.0), st.floats(-2.0, 2.0), st.floats(-30.0, 30.0), st.sampled_from([50.0, 500.0, 5000.0]),
    st.sampled_from([np.inf, 10.0]), st.sampled_from(LIMITING),
)  # fmt: skip
def test_position_and_rate_come_before_acceleration_and_that_before_jerk(
    q, rate, acceleration, jerk, most, on_excess
):
    # From any state, most of which no bounded jerk can come from; the status says what gave way.
    joints = Joints(1, on_excess, jerk=jerk, acceleration=most, rate=1.5, ends=[[-1.0], [1.0]], braking=10.0)
    joints.at(q, np.clip(rate, -1.5, 1.5), acceleration * T)
    for wish in (50.0,) * 120:
        last, change = joints.last.copy(), joints.change.copy()
        (sent,), status = joints.step(wish)
        assert abs(sent) <= 1.5 * (1 + 1e-12) and -1.0 - 1e-12 <= joints.q[0] <= 1.0 + 1e-12
        beyond_jerk = abs(sent - last - change)[0] - jerk * T**2
        beyond_acceleration = abs(sent - last)[0] - most * T
        assert bool(status & Status.JERK_EXCEEDED) == (beyond_jerk > 1e-9 * jerk * T**2 + 1e-10 * abs(sent))
        assert bool(status & Status.ACCELERATION_EXCEEDED) == (
            beyond_acceleration > 1e-9 * most * T + 1e-10 * abs(sent)
        )


@examples(5, 15)
@given(
    st.floats(1e-5, 3.0),
    st.sampled_from([50.0, 500.0, 5000.0]),
    st.sampled_from(LIMITING),
    st.sampled_from([0.0, 2e-3]),
)
def test_a_step_is_followed_in_the_least_time_and_without_overshoot(rate, jerk, on_excess, slope):
    joints = Joints(1, on_excess, jerk=jerk)
    ticks = ticks_to_rate(rate, jerk * T**2)
    wishes = rate + slope * np.maximum(0.0, np.arange(1200.0) - 600)[:, None]
    sent, _, _ = joints.run(wishes)
    assert sent[:600].max() <= rate * (1 + 1e-12)
    arrived = int(np.argmax(sent[:, 0] >= rate * (1 - 1e-9))) + 1
    assert arrived <= ticks + 1  # where the least is a fraction of a tick, the next one
    # and a ramp after it, once the change of slope is made up for
    assert sent[-1] == pytest.approx(wishes[-1], rel=1e-9)


# Whole runs ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "policy", "on_excess", "jerk"),
    [
        ("stanford_wrist", "damp", "scale", 500.0),
        ("joint_limit", "stop", "optimal", 500.0),
        ("at_the_stop", "damp", "sns", 5000.0),
        ("best_within_limits", "damp", "optimal", 5000.0),
    ],
)  # fmt: skip
def test_shipped_scenarios_stay_below_a_jerk_limit_at_every_tick(name, policy, on_excess, jerk):
    limits = (f"control.limits.jerk={jerk}", f"control.limits.on_excess={on_excess}")
    run = shipped(name, f"control.at_singularity={policy}", *limits)
    sent = run["qdot_cmd"]
    peak = np.abs(np.diff(np.diff(sent, axis=0, prepend=0.0), axis=0, prepend=0.0)).max() / run.period**2
    assert run.divergence is None and np.isfinite(sent).all()
    # what rounding of rates makes of it, added up while they change
    assert peak <= jerk * (1 + 1e-9) + 1e-10 * np.abs(sent).max() / run.period**2
