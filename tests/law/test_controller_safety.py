"""What a controller does when something is wrong or late: within its limits, and never by an exception."""

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import rmrc
from project import ROOT, mostly_long
from rmrc.arm import load as load_arm
from rmrc.law.controller import Controller
from rmrc.scenario.choices import Status
from rmrc.support.errors import QuestionError

ARM = load_arm(ROOT / "models/planar_3link.xml")
PERIOD = 0.002
RATE, ACCELERATION, JERK = 1.5, 6.0, 300.0
# Rounding of third differences over jerk: 1e-16 · 1.5/(300 · 4e-6), and what adds up in hundreds of ticks.
SLACK = 1 + 1e-6
LAWS = {
    "acceleration": {"limits": {"rate": RATE, "acceleration": ACCELERATION}},
    "jerk": {"limits": {"rate": RATE, "acceleration": ACCELERATION, "jerk": JERK}},
    "clamp": {"limits": {"rate": RATE, "acceleration": ACCELERATION, "jerk": JERK, "on_excess": "clamp"}},
    **{
        name: {"limits": {"rate": RATE, "acceleration": ACCELERATION, "on_excess": name}}
        for name in ("redistribute", "optimal", "sns", "reverse_priority")
    },
}
BROKEN = Status.ACCELERATION_EXCEEDED | Status.JERK_EXCEEDED


def controller(law, **more):
    return Controller(ARM, control=LAWS[law], period=PERIOD, **({"task": {"axes": ["x", "y"]}} | more))


def hold_limits(rates, law, broken=False):
    """Hold rates (T, n) from rest, and their differences, against the limits."""
    assert np.isfinite(rates).all()
    assert np.abs(rates).max() <= RATE * SLACK
    changes = np.diff(rates, axis=0, prepend=0.0)
    if not np.any(broken):
        assert np.abs(changes).max() <= ACCELERATION * PERIOD * SLACK
        if "jerk" in LAWS[law]["limits"]:
            assert np.abs(np.diff(changes, axis=0, prepend=0.0)).max() <= JERK * PERIOD**2 * SLACK


# Outside the range ------------------------------------------------------------------------------


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("joint", "side"), mostly_long([(0, 1), (2, 1), (1, 0)], 3))
def test_a_joint_that_starts_outside_comes_back_smoothly(law, joint, side):
    one = controller(law)
    q = ARM.configuration("home")[ARM.wiring.qpos]
    lower, upper = ARM.position_limit.T
    q[joint] = (upper + 0.2)[joint] if side else (lower - 0.2)[joint]
    beyond = lambda q: np.maximum(q - upper, lower - q)[joint]  # noqa: E731
    one.reset(q)
    pose, rates, way, status = ARM.pose(q), [], [beyond(q)], []
    for _ in range(3000):
        out = one.step(q, pose=pose)
        rates.append(out.qdot_cmd.copy())
        status.append(out.status)
        if beyond(q) > 0:
            assert out.limited_by["position"] == (ARM.joints[joint],) and out.path_rate == 0.0
        q = q + PERIOD * out.qdot_cmd
        way.append(beyond(q))
        if way[-1] <= 0:
            break
    assert way[0] == pytest.approx(0.2) and way[-1] <= 0.0  # it is back
    assert (np.diff(way) <= 1e-15).all()  # and went no other way
    hold_limits(np.array(rates), law)
    assert np.abs(rates).max() <= 0.5 * SLACK  # slowly
    assert all(one & Status.POSITION_LIMITED and one & Status.STOPPED for one in status)
    after = one.step(q, pose=ARM.pose(q))
    assert not after.status & Status.STOPPED  # and the law goes on


def test_an_encoder_that_is_a_little_beyond_the_range_stops_nothing():
    one = controller("acceleration")
    q = ARM.configuration("home")[ARM.wiring.qpos]
    q[1] = ARM.position_limit[1, 1] + 1e-4
    out = one.step(q, twist=np.array([0.1, 0, 0, 0, 0, 0]))
    assert not out.status & Status.STOPPED and out.path_rate == 1.0


# Joint targets ----------------------------------------------------------------------------------


@pytest.mark.parametrize("law", LAWS)
def test_joints_are_brought_to_where_they_are_told_within_all_limits(law):
    one = controller(law)
    q = ARM.configuration("home")[ARM.wiring.qpos]
    goal = q + np.array([0.8, -0.5, 0.05])
    one.reset(q)
    rates, over = [], 0.0
    for _ in range(2500):
        out = one.step(q, q_target=goal)
        rates.append(out.qdot_cmd.copy())
        q = q + PERIOD * out.qdot_cmd
        over = max(over, ((q - goal) * [1, -1, 1]).max())
    hold_limits(np.array(rates), law)
    assert_allclose(q, goal, atol=1e-6)
    assert np.abs(rates).max() > 0.9 * RATE or law != "acceleration"
    assert over < 2e-3  # the lag of the jerk limit, at most: none without one
    assert np.isfinite(out.sigma).all() and out.path_rate == 1.0


def test_rates_are_followed_and_stop_at_the_range():
    one = controller("acceleration")
    q = ARM.configuration("home")[ARM.wiring.qpos]
    told, upper = np.array([0.4, 0.0, -0.2]), ARM.position_limit[:, 1]
    one.reset(q)
    for _ in range(200):
        out = one.step(q, qdot_target=told)
        q = q + PERIOD * out.qdot_cmd
    assert_allclose(out.qdot_cmd, told, atol=1e-15)
    for _ in range(8000):
        out = one.step(q, qdot_target=np.array([0.4, 0.0, 0.0]))
        q = q + PERIOD * out.qdot_cmd
    assert q[0] <= upper[0] + 1e-12 and q[0] > upper[0] - 1e-3
    assert out.status & Status.POSITION_LIMITED and out.limited_by["position"] == (ARM.joints[0],)


# The watchdog -----------------------------------------------------------------------------------


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


def watched(law="jerk", watchdog=5 * PERIOD):
    clock = Clock()
    one = controller(law, watchdog=watchdog, clock=clock)
    q = ARM.configuration("home")[ARM.wiring.qpos]
    one.reset(q)
    for _ in range(300):
        out = one.step(q, twist=np.array([0.1, 0.1, 0, 0, 0, 0]))
        q = q + PERIOD * out.qdot_cmd
        clock.now += PERIOD
    clock.now -= PERIOD  # that of the last step
    return one, clock, q


@pytest.mark.parametrize("law", ["acceleration", "jerk"])
def test_a_step_that_does_not_come_brakes_and_the_next_goes_on_from_there(law):
    one, clock, q = watched(law)
    last, begun = one.command.qdot_cmd.copy(), clock.now
    assert np.abs(last).max() > 0.05
    sent = [last]
    for k in range(1, 200):
        out = one.command_at(begun + k * PERIOD)
        sent.append(out.qdot_cmd.copy())
        if k <= 5:
            assert_array_equal(out.qdot_cmd, last)
        else:
            assert out.status == Status.OVERDUE | Status.STOPPED
    sent = np.array(sent)
    assert not sent[-1].any()
    changes = np.diff(sent, axis=0)
    assert np.abs(changes).max() <= ACCELERATION * PERIOD * SLACK
    assert (np.abs(sent[1:]) <= np.abs(sent[:-1]) + 1e-15).all()
    clock.now = begun + 20 * PERIOD
    out = one.step(q)  # that stands still: it brakes on
    assert out.status & Status.OVERDUE
    # one step of the law from what was sent meanwhile, and no jump
    assert np.abs(out.qdot_cmd - sent[19]).max() <= ACCELERATION * PERIOD * SLACK
    assert np.abs(out.qdot_cmd - last).max() > 0.01
    clock.now += PERIOD
    assert not one.step(q, twist=np.array([0.1, 0.1, 0, 0, 0, 0])).status & Status.OVERDUE


def test_asking_what_to_send_changes_nothing():
    (asked, clock, q), (alone, other, _) = watched(), watched()
    for _ in range(50):
        clock.now = other.now = clock.now + PERIOD
        asked.command_at(clock.now + 0.1)
        twist = np.array([0.0, 0.1, 0, 0, 0, 0])
        assert_array_equal(asked.step(q, twist=twist).qdot_cmd, alone.step(q, twist=twist).qdot_cmd)


def test_a_watchdog_that_is_off_asks_no_clock():
    def no_clock():
        raise AssertionError

    one = controller("jerk", clock=no_clock)
    one.step(ARM.configuration("home")[ARM.wiring.qpos])
    with pytest.raises(QuestionError, match="command_at needs a watchdog"):
        one.command_at()
    one.watchdog = 0.1
    one.watchdog = None
    one.step(ARM.configuration("home")[ARM.wiring.qpos])


def test_rates_that_were_measured_once_are_not_those_of_later_steps():
    """A joint at its stop by 1.4 rad/s, measured at 0.5 rad/s on the way: a lag that would have it stop earlier."""
    sent = []
    for measured in (None, np.array([0.5, 0.0, 0.0])):
        one, q, rates = controller("jerk"), ARM.configuration("home")[ARM.wiring.qpos], []
        one.reset(q)
        for k in range(1500):
            out = one.step(q, measured if k == 400 else None, qdot_target=np.array([1.4, 0.0, 0.0]))
            rates.append(out.qdot_cmd.copy())
            q = q + PERIOD * out.qdot_cmd
        assert ARM.position_limit[0, 1] - q[0] < 2e-3
        sent.append(np.array(rates))
    assert_array_equal(*sent)


# Anything at all --------------------------------------------------------------------------------

SCRAP = [
    None, "home", [], {}, object(), np.nan, 3, 1e300, True, b"x", [[1, 2], [3]], np.zeros(0), np.zeros((2, 2, 2)),
    np.full(7, np.nan), np.full(6, np.inf), np.full(3, -1e12), np.zeros((4, 4)), np.eye(4), np.array(["a"] * 3),
    np.array([1 + 2j] * 3), np.zeros(3, object), np.zeros(3, bool), range(3), np.zeros(7, np.float16),
]  # fmt: skip


WRONG_Q = [
    None,
    "home",
    np.nan,
    np.full(3, np.nan),
    np.array([0.1, np.inf, 0.0]),
    np.zeros(2),
    np.zeros((3, 3)),
]


def fuzz(calls, seed):
    """Call a controller of an ideal arm with anything; hold its commands against its limits at each call."""
    rng = np.random.default_rng(seed)
    law = list(LAWS)[seed % len(LAWS)]
    method = ["damped", "pseudoinverse", "jparse", "selectively_damped"][seed // len(LAWS) % 4]
    one = Controller(
        ARM, control=LAWS[law] | {"inverse": {"method": method}}, period=PERIOD, task={"axes": ["x", "y"]}
    )
    q = rng.uniform(*ARM.position_limit.T)
    one.reset(q)
    lower, upper = ARM.position_limit.T
    rates, exceptions, wish = [], 0, {}
    for k in range(calls):
        if k % 40 == 0:  # a wish stays for some time, so that the arm gets fast, and far
            wish = wished(rng, q)
        given = dict(wish)
        said = q
        if rng.random() < 0.05:
            name = rng.choice(["q", "qdot", "pose", "twist", "frame", "q_target", "qdot_target"])
            scrap = SCRAP[rng.integers(len(SCRAP))]
            if name == "q":  # what looks like positions would be believed
                said = WRONG_Q[rng.integers(len(WRONG_Q))]
            else:
                given = given | {name: scrap}
        out = one.step(said, **given)
        rates.append(out.qdot_cmd.copy())
        exceptions |= int(out.status & BROKEN)
        _ = (out.limited_by, out.problem) if k % 97 == 0 else ()
        q = q + PERIOD * out.qdot_cmd
        assert (q <= upper + 1e-9).all() and (q >= lower - 1e-9).all(), k
    hold_limits(np.array(rates), law)
    assert not exceptions


def wished(rng, q):
    kind = rng.integers(5)
    twist = 10 ** rng.uniform(-2, 2) * rng.normal(size=6)
    pose = np.r_[rng.normal(size=3), rng.normal(size=4)]
    return (
        {"twist": twist, "frame": str(rng.choice(["world", "base", "site"]))},
        {"pose": pose, "twist": twist},
        {"q_target": q + rng.normal(size=3)},
        {"qdot_target": 3 * rng.normal(size=3)},
        {"pose": pose},
    )[kind]


@pytest.mark.parametrize("seed", range(len(LAWS)))
def test_nothing_raises_and_no_limit_is_exceeded(seed):
    fuzz(1500, seed)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(7, 27))
def test_nothing_raises_and_no_limit_is_exceeded_in_a_million_calls(seed):
    fuzz(50_000, seed)


def test_a_jacobian_of_anything_raises_nothing():
    rng = np.random.default_rng(0)
    law = rmrc.Law(3, 2, LAWS["jerk"], period=PERIOD)
    rates = []
    for k in range(2500):
        J, twist = rng.normal(size=(2, 3)), rng.normal(size=2) * 10 ** rng.uniform(-2, 3)
        if k % 7 == 0:
            J = SCRAP[rng.integers(len(SCRAP))]
        if k % 11 == 0:
            J, twist = (
                J * np.nan if isinstance(J, np.ndarray) and J.dtype == float else J,
                SCRAP[rng.integers(len(SCRAP))],
            )
        rates.append(law.step(J, twist).qdot_cmd.copy())
    hold_limits(np.array(rates), "jerk")


# What it takes ------------------------------------------------------------------------------------


def test_a_law_without_an_arm_loads_no_mujoco():
    code = "import sys, rmrc; rmrc.Law(7, 6); print('mujoco' in sys.modules, 'rmrc.law.bare' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]
