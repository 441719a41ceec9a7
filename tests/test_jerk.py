"""What a jerk limit promises: of the bounds of one joint, of any wishes, and of whole runs under every policy."""

import functools
import operator

import numba
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import rmrc
from codes import Method, OnExcess
from oracle_limits import least_way, ticks_to_rate
from project import ROOT, examples
from records import blank, put, resolve
from rmrc.law import braking as stops
from rmrc.law.jerk import remember
from rmrc.scenario.choices import LIMITS, Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

T = 1e-3
LIMITING = [name for name in LIMITS.names if name != "none"]
EXCEEDED = Status.ACCELERATION_EXCEEDED | Status.JERK_EXCEEDED


# The bounds of one joint ----------------------------------------------------------------------------------------


@numba.njit(error_model="numpy")
def way(rate, change, braking, step):
    return stops.way(rate / step, change / step, braking / step) * step


@numba.njit(error_model="numpy")
def largest_change(distance, rate, least, most, braking, step):
    return stops.largest_change(distance, rate, least, most, braking, step, 1.0)


@numba.njit(error_model="numpy")
def next_gentle_rate(rate, distance):
    return stops.brake_gently(rate, distance, 1.0)


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


@examples(3, 20)
@given(brakings, rates, changes, st.floats(0.02, 0.98))
def test_the_bound_before_a_position_limit_is_sharp(braking, rate, last, part):
    # Within one step of jerk, a little more than the largest change leads beyond.
    last = max(last, -braking)
    least, most = max(last - 1.0, -braking), last + 1.0
    assume(rate + least > 0)
    ends = [least_way(rate + change, change, braking, 1.0) for change in (least, most)]
    assume(np.isfinite(ends).all() and ends[1] > ends[0] * (1 + 1e-3))
    distance = ends[0] + part * (ends[1] - ends[0])
    change = largest_change(distance, rate, least, most, braking, 1.0)
    assert least_way(rate + change, change, braking, 1.0) <= distance * (1 + 1e-6)
    more = change + 1e-3
    assert least_way(rate + more, more, braking, 1.0) > distance * (1 + 1e-6)


@given(st.floats(0.01, 100.0), st.floats(0.05, 1e4))
def test_the_least_deceleration_stops_at_the_limit(rate, distance):
    # Followed tick by tick, none is harder than the first, and the way is all there is.
    left, falls, now = distance, [], rate
    assume(rate <= 2 * distance < 400 * rate)
    for _ in range(500):
        following = next_gentle_rate(now, left)
        falls.append(now - following)
        left, now = left - following, following
    assert min(falls) >= -1e-9 * rate and max(falls) <= falls[0] * (1 + 1e-6) + 1e-9 * rate
    assert left == pytest.approx(0.0, abs=1e-6 * distance)


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
    wishes, now = np.zeros((ticks, n)), np.zeros(n)
    slope = np.zeros(n)
    for t in range(ticks):
        if rng.random() < 0.03:
            now, slope = rng.choice([-50.0, -0.5, 0.0, 0.5, 50.0], n), rng.choice([0.0, 0.0, 0.01], n)
        now = now + slope
        wishes[t] = now
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


def test_acceleration_and_jerk_give_way_to_a_limit_that_is_too_near():
    near = Joints(1, ends=[[-1.0], [1.0]], acceleration=20.0, rate=2.0).at(0.999, 1.0, 0.0)
    assert near.step(50.0)[1] & EXCEEDED == EXCEEDED
    # of a stop in one tick no more goes on than braking and jerk allow
    alone = Joints(1, ends=[[-1.0], [1.0]], rate=2.0).at(0.9999, 1.5, 0.0)
    sent, _, status = alone.run([50.0] * 5)
    assert (
        status & Status.JERK_EXCEEDED and sent[0] < 0.2 and np.abs(np.diff(sent, axis=0)).max() < 2 * 10.0 * T
    )
    # 1 rad/s² · 1 s²/2 away: jerk has to give way, and acceleration has not
    late = Joints(1, ends=[[-1.0], [1.0]], acceleration=20.0, rate=2.0, jerk=50.0).at(0.96, 1.0, 0.0)
    _, q, status = late.run([50.0] * 500)
    assert status & EXCEEDED == Status.JERK_EXCEEDED and q.max() <= 1.0 + 1e-12


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


def test_scaled_rates_keep_their_direction_while_they_change():
    joints = Joints(
        3, "scale", jerk=[500.0, 50.0, 5000.0], acceleration=[30.0, 20.0, 5.0], rate=[2.0, 3.0, 1.0]
    )
    sent, _, status = joints.run([[3.0, -1.0, 0.5]] * 400 + [[0.0, 0.0, 0.0]] * 400)
    moving = sent[np.linalg.norm(sent, axis=1) > 1e-9]
    turned = moving / np.linalg.norm(moving, axis=1)[:, None] - np.array([3.0, -1.0, 0.5]) / np.linalg.norm(
        [3.0, -1.0, 0.5]
    )
    assert np.abs(turned).max() < 1e-9
    # negative control: by each joint's own limits it does not
    clamped, _, _ = Joints(3, "clamp", jerk=[500.0, 50.0, 5000.0]).run([[3.0, -1.0, 0.5]] * 50)
    assert abs(clamped[20, 0] / clamped[20, 1] + 3.0) > 0.5
    assert status & Status.JERK_LIMITED


# Whole runs ---------------------------------------------------------------------------------------------------


def jerk_of(run):
    """Return the largest jerk that is commanded, and what rounding of rates makes of it, added up while they change."""
    changes = np.diff(run["qdot_cmd"], axis=0, prepend=0.0)
    rounding = 1e-10 * np.abs(run["qdot_cmd"]).max() / run.period**2
    return np.abs(np.diff(changes, axis=0, prepend=0.0)).max() / run.period**2, rounding


def shipped(name, *overrides):
    return Simulation([prepare(rmrc.load(ROOT / f"scenarios/{name}.yaml", overrides))]).run()[0]


@pytest.mark.parametrize(
    ("name", "policy", "on_excess", "jerk"),
    [
        ("stanford_wrist", "damp", "scale", 500.0), ("approach_singularity", "slow", "clamp", 5000.0),
        ("slow_wrist", "singularity_consistent", "redistribute", 500.0), ("joint_limit", "stop", "optimal", 500.0),
        ("at_the_stop", "damp", "sns", 5000.0), ("null_space", "keep_out", "reverse_priority", 500.0),
        ("best_within_limits", "damp", "optimal", 5000.0),
    ],
)  # fmt: skip
def test_shipped_scenarios_stay_below_a_jerk_limit_at_every_tick(name, policy, on_excess, jerk):
    limits = (f"control.limits.jerk={jerk}", f"control.limits.on_excess={on_excess}")
    run = shipped(name, f"control.at_singularity={policy}", *limits)
    peak, rounding = jerk_of(run)
    assert run.divergence is None and np.isfinite(run["qdot_cmd"]).all()
    assert peak <= jerk * (1 + 1e-9) + rounding
