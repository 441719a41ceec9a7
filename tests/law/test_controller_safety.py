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


# From the first call on -------------------------------------------------------------------------

# No positions at all; those that an arm could have, a fuzzer cannot tell from the true ones.
NO_Q = [*WRONG_Q[:-1], [], {}, object(), 1e308, np.full(3, 1e308), np.full(3, -np.inf), np.full(3, 1j), ["a", "b", "c"], [[1, 2], [3]]]  # fmt: skip
NO_POSE = [np.zeros(7), np.r_[np.zeros(3), np.nan, 1, 0, 0], np.full(7, 1e308), np.zeros((4, 4)), "there", np.zeros(5), []]  # fmt: skip
NO_TWIST = [np.full(6, np.nan), np.full(6, 1e308), np.zeros(3), "fast", {}, np.r_[np.inf, np.zeros(5)]]
NO_TIME = [0.0, -PERIOD, np.nan, np.inf, "soon", [PERIOD] * 7, 1j]
# Usable, although no number is as one writes it.
ODD = {"pose": np.r_[0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 7.0], "qdot": np.full(3, 1e9), "twist": np.full(6, 1e9)}


def held(rows, way):
    """Return what every arm is given, (w, ...), in a form that a caller may choose."""
    return (np.array(rows), list(rows), [list(row) for row in rows])[way]


class Sequence:
    """Calls of a controller with good and bad input from the first one on, and what is known of its commands."""

    def __init__(self, seed):
        self.rng, self.seed = np.random.default_rng(seed), seed
        self.law = list(LAWS)[seed % len(LAWS)]
        self.one = controller(self.law)
        self.w = 1
        self.q = self.drawn()
        self.rest()

    def drawn(self):
        return self.rng.uniform(*ARM.position_limit.T, (self.w, 3))

    def rest(self, starts=None):
        """Know that all steps are forgotten."""
        self.last = np.zeros((self.w, 3))
        self.q_cmd = np.full((self.w, 3), np.nan) if starts is None else starts.copy()

    def reset(self):
        """Reset by good positions of a new number of arms, by none, or by bad ones, which change nothing."""
        way = self.rng.integers(4)
        if way == 0:
            self.one.reset()
            self.rest()
        elif way == 1:
            with pytest.raises(QuestionError):
                self.one.reset(NO_Q[1 + self.rng.integers(len(NO_Q) - 1)])
        elif way == 2:
            self.w = int(self.rng.integers(1, 4))
            self.q = self.drawn()
            self.one.reset(self.q if self.w > 1 else self.q[0])
            self.rest(self.q)

    def step(self, share):
        """Step once; a share of the calls has something bad. Hold the commands against their limits."""
        rng, w = self.rng, self.w
        given = wished(rng, self.q[0]) if rng.random() < 0.9 else dict([list(ODD.items())[rng.integers(3)]])
        if "q_target" in given:
            given["q_target"] = given["q_target"] * np.ones((w, 1)) if w > 1 else given["q_target"]
        said, bad, dt = self.q if w > 1 else self.q[0], np.zeros(w, bool), PERIOD
        if rng.random() < 0.5:
            given["dt"] = dt = PERIOD * rng.uniform(0.2, 3.0)
        if rng.random() < share:
            bad[:] = True
            name = ("q", "pose", "twist", "dt", "frame")[rng.integers(5)]
            scrap = {"q": NO_Q, "pose": NO_POSE, "twist": NO_TWIST, "dt": NO_TIME, "frame": ["tool", None]}[
                name
            ]
            scrap = scrap[rng.integers(len(scrap))]
            if name == "q":
                said = scrap
            elif name in ("pose", "twist"):
                given = {name: scrap} | ({"dt": dt} if "dt" in given else {})
            else:
                given[name], dt = scrap, PERIOD if name == "dt" else dt
            if name == "q" and w > 1 and rng.random() < 0.5:  # of one arm alone
                bad[1:] = False
                row = scrap if isinstance(scrap, np.ndarray) and rng.random() < 0.5 else None
                said = [row, *self.q[1:]]
        out = self.one.step(said, **given)
        u, q_cmd, status = (np.reshape(v, (w, -1)) for v in (out.qdot_cmd, out.q_cmd, np.array(out.status)))
        assert np.isfinite(u).all() and np.abs(u).max() <= RATE * SLACK
        assert (((status[:, 0] & int(Status.INVALID_INPUT)) != 0) == bad).all(), (given, said, out.problem)
        assert [text != "" for text in np.atleast_1d(np.array(out.problem, object))] == list(bad)
        assert np.abs(u - self.last).max() <= ACCELERATION * dt * SLACK + 1e-15
        assert not (status & int(Status.ACCELERATION_EXCEEDED)).any()
        starts = np.isnan(self.q_cmd[:, 0])
        before = np.where(starts[:, None] & ~bad[:, None], self.q, self.q_cmd)
        unknown = starts & bad
        assert np.isnan(q_cmd[unknown]).all()
        assert (np.abs(q_cmd - before)[~unknown] <= np.abs(u[~unknown]) * dt + 1e-12).all()  # NaN is no less
        self.last, self.q_cmd = u.copy(), q_cmd.copy()
        self.q = self.q + dt * u


def fuzz_from_the_start(calls, seed):
    sequence = Sequence(seed)
    for k in range(calls):
        if k % 100 == 99:
            sequence.reset()
        sequence.step(0.9 if k % 100 < 5 else 0.1)


@pytest.mark.parametrize("seed", range(len(LAWS)))
def test_commands_are_continuous_from_the_first_call_on(seed):
    fuzz_from_the_start(1500, seed)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6, 26))
def test_commands_are_continuous_from_the_first_call_on_in_a_hundred_thousand_calls(seed):
    fuzz_from_the_start(5000, seed)


@pytest.mark.parametrize("first", NO_Q)
def test_positions_start_at_the_first_usable_ones(first):
    q = ARM.configuration("home")[ARM.wiring.qpos]
    one = controller("jerk")
    for _ in range(3):
        out = one.step(first, qdot_target=np.ones(3))
        assert out.status & Status.INVALID_INPUT and out.problem
        assert np.isnan(out.q_cmd).all() and not out.qdot_cmd.any()
    out = one.step(q, qdot_target=np.ones(3))
    assert_allclose(out.q_cmd, q + PERIOD * out.qdot_cmd, atol=1e-15)


def test_a_jacobian_alone_has_positions_once_they_are_given():
    law = rmrc.Law(3, 2, period=PERIOD)
    J, q = np.eye(2, 3), np.array([0.1, 0.2, 0.3])
    assert np.isnan(law.step(J, np.ones(2)).q_cmd).all()
    out = law.step(J, np.ones(2), q)
    assert_allclose(out.q_cmd, q + PERIOD * out.qdot_cmd, atol=1e-15)


# What it takes ------------------------------------------------------------------------------------


def test_a_law_without_an_arm_loads_no_mujoco():
    code = "import sys, rmrc; rmrc.Law(7, 6); print('mujoco' in sys.modules, 'rmrc.law.bare' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]
