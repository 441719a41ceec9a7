"""A loop whose period varies, a pause of it, and targets that come slower than the loop."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc.arm import load as load_arm
from rmrc.law.controller import Controller
from rmrc.scenario.choices import Status

ARM = load_arm(ROOT / "models/planar_3link.xml")
HOME = ARM.configuration("home")[ARM.wiring.qpos]
LOWER, UPPER = ARM.position_limit.T
PERIOD = 0.01
RATE, ACCELERATION, JERK = 1.5, 8.0, 200.0
# Rounding of second differences over the shortest time, 4 ms, adds up over a thousand steps.
SLACK = 1 + 1e-8
LAWS = {
    "acceleration": {"rate": RATE, "acceleration": ACCELERATION},
    "jerk": {"rate": RATE, "acceleration": ACCELERATION, "jerk": JERK},
    "optimal": {"rate": RATE, "acceleration": ACCELERATION, "on_excess": "optimal"},
}


def controller(**limits):
    one = Controller(ARM, control={"feedback": 8, "limits": limits}, period=PERIOD, task={"axes": ["x", "y"]})
    one.reset(HOME)
    return one


def wishes(seed, steps):
    """Yield what is asked for, which changes now and then: far, fast, and beyond the range."""
    rng, wish = np.random.default_rng(seed), {}
    for k in range(steps):
        if k % 60 == 0:
            wish = (
                {"qdot_target": 3 * rng.normal(size=3)},
                {"q_target": rng.uniform(LOWER, UPPER) + 0.3 * rng.normal(size=3)},
                {"twist": 3 * rng.normal(size=6)},
            )[rng.integers(3)]
        yield wish


def jitter(one, order, seed, steps=900, passes=True):
    """Run an ideal arm for times of 4 to 30 ms; return times (T,), rates and positions (T, n).

    `elapsed`: a command acts until the next step, which is told the time that has passed. `expected`: a step
    is told the time for which its command will act.
    """
    rng, q, u = np.random.default_rng(seed), HOME.copy(), np.zeros(3)
    times, rates, positions = rng.uniform(0.004, 0.03, steps), [], []
    for dt, wish in zip(times, wishes(seed, steps), strict=True):
        q = q + dt * u if order == "elapsed" else q
        u = one.step(q, **wish, **({"dt": dt} if passes else {})).qdot_cmd.copy()
        q = q + dt * u if order == "expected" else q
        rates.append(u)
        positions.append(q)
    return times[:, None], np.array(rates), np.array(positions)


def accelerations(times, rates):
    return np.diff(rates, axis=0, prepend=0.0) / times


@pytest.mark.parametrize("order", ["elapsed", "expected"])
@pytest.mark.parametrize("law", ["acceleration", "optimal"])
def test_a_loop_that_jitters_keeps_its_limits(law, order):
    for seed in range(3):
        one = controller(**LAWS[law])
        times, rates, positions = jitter(one, order, seed)
        assert np.abs(rates).max() <= RATE * SLACK
        assert np.abs(accelerations(times, rates)).max() <= ACCELERATION * SLACK
        assert (positions <= UPPER + 1e-12).all() and (positions >= LOWER - 1e-12).all()
        assert not int(one.command.status) & int(Status.ACCELERATION_EXCEEDED)
        room = np.minimum(UPPER - positions, positions - LOWER).min()
        assert room < 0.05  # a joint comes near its limit
    # negative control: without the time, a period of 10 ms is assumed
    times, rates, positions = jitter(controller(**LAWS[law]), order, 0, passes=False)
    assert np.abs(accelerations(times, rates)).max() > 1.5 * ACCELERATION


@pytest.mark.parametrize("order", ["elapsed", "expected"])
def test_a_loop_that_jitters_keeps_jerk_where_no_position_limit_is_near(order):
    for seed in range(3):
        one = controller(**LAWS["jerk"], position=False)
        times, rates, _ = jitter(one, order, seed)
        a = accelerations(times, rates)
        assert np.abs(rates).max() <= RATE * SLACK and np.abs(a).max() <= ACCELERATION * SLACK
        assert np.abs(np.diff(a, axis=0, prepend=0.0) / times).max() <= JERK * (1 + 1e-6)
        assert np.abs(rates).max() > 0.9 * RATE


def test_times_may_differ_in_a_batch():
    one = controller(**LAWS["acceleration"])
    one.reset(np.tile(HOME, (3, 1)))
    out = one.step(np.tile(HOME, (3, 1)), qdot_target=np.ones(3), dt=[0.004, 0.03, -1.0])
    assert_allclose(out.qdot_cmd[:2, 0], ACCELERATION * np.array([0.004, 0.03]), rtol=1e-14)
    assert not out.qdot_cmd[2].any()
    assert out.problem == ["", "", "dt must be > 0 and finite [s], got -1.0"]


@pytest.mark.parametrize("dt", [0.0, -0.01, np.nan, "soon"])
def test_a_time_that_is_none_brakes_and_says_so(dt):
    one = controller(**LAWS["acceleration"])
    for _ in range(20):
        moving = one.step(HOME, qdot_target=np.ones(3)).qdot_cmd.copy()
    out = one.step(HOME, qdot_target=np.ones(3), dt=dt)
    assert out.status & Status.INVALID_INPUT and out.problem.startswith("dt ")
    assert_allclose(out.qdot_cmd, moving - ACCELERATION * PERIOD, rtol=1e-12)


@pytest.mark.parametrize(("period", "longest"), [(0.01, 0.1), (0.2, 0.4)])
def test_a_pause_is_no_license_to_jump(period, longest):
    one = Controller(ARM, control={"limits": LAWS["acceleration"]}, period=period)
    one.reset(HOME)
    one.step(HOME, qdot_target=-np.ones(3), dt=period)
    last, before = one.command.qdot_cmd.copy(), one.command.q_cmd.copy()
    out = one.step(HOME, qdot_target=np.full(3, 1e3), dt=5.0)
    assert_allclose(out.qdot_cmd - last, min(ACCELERATION * longest, RATE - last[0]), rtol=1e-12)
    assert_allclose(out.q_cmd - before, longest * out.qdot_cmd, rtol=1e-12)
    out = one.step(HOME, qdot_target=np.full(3, 1e3), dt=1e-300)
    assert np.isfinite(out.qdot_cmd).all() and out.problem == ""


# Targets slower than the loop -------------------------------------------------------------------

UPDATE, LOOP = 1 / 30, 0.002


def follow(recipe, **limits):
    """Follow 0.15 m back and forth at 0.5 Hz by targets at 30 Hz; return results of the steps after 0.5 s.

    These are the largest distance from the path [m], that from the path one update ago, and the largest
    change of a rate over the period [rad/s²].
    """
    law = {"feedback": 20, "limits": {"rate": 2.0, **limits}}
    one = Controller(ARM, control=law, period=LOOP, task={"axes": ["x", "y"]})
    one.reset(HOME)
    text, page = (ROOT / "docs/python.md").read_text(), {}
    exec(re.search(r"```python\n(import numpy as np\n.*?)```", text, re.DOTALL)[1], page)
    q, home, w, along = HOME.copy(), np.array(ARM.pose(HOME)), np.pi, np.array([-0.5, 0.5, 0, 0, 0, 0, 0])
    path = lambda t: home + 0.15 * (1 - np.cos(w * t)) * along  # noqa: E731
    twist = lambda t: 0.15 * w * np.sin(w * t) * along[:6]  # noqa: E731
    last, changes, away, behind = np.zeros(3), [], [], []
    for k in range(2000):
        t = k * LOOP
        came = np.floor(t / UPDATE + 1e-9) * UPDATE
        before, newest, v, s = path(max(came - UPDATE, 0.0)), path(came), twist(came), t - came
        given = {
            "hold": {"pose": newest},
            "advance": page["advanced"](newest, v, s),
            "between": page["between"](before, newest, s, UPDATE),
        }[recipe]
        u = one.step(q, **given).qdot_cmd.copy()
        changes.append(np.abs(u - last).max() / LOOP)
        last, q = u, q + LOOP * u
        if t > 0.5:
            p, now = np.array(ARM.pose(q)), t + LOOP
            away.append(np.linalg.norm((p - path(now))[:3]))
            behind.append(np.linalg.norm((p - path(now - UPDATE))[:3]))
    return max(away), max(behind), max(changes)


def test_the_recipes_for_slow_targets_and_their_numbers():
    """As docs/python.md has them."""
    held, advanced, between = follow("hold"), follow("advance"), follow("between")
    assert held[0] > 0.02 and held[2] > 90
    assert advanced[0] < 0.0013 and advanced[2] < 22  # without delay
    assert between[1] < 0.0004 and between[2] < 17  # on the path of one update ago
    for recipe in ("hold", "advance", "between"):
        assert follow(recipe, acceleration=ACCELERATION, jerk=JERK)[2] < 4
