"""What a controller does when something is wrong or late: within its limits, and never by an exception."""

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import rmrc
from project import ROOT
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


def controller(law, method="damped", **more):
    control = LAWS[law] | {"inverse": {"method": method}}
    return Controller(ARM, control=control, period=PERIOD, task={"axes": ["x", "y"]}, **more)


def hold_limits(rates, law):
    """Hold rates (T, n) from rest, and their differences, against the limits."""
    assert np.isfinite(rates).all()
    assert np.abs(rates).max() <= RATE * SLACK
    changes = np.diff(rates, axis=0, prepend=0.0)
    assert np.abs(changes).max() <= ACCELERATION * PERIOD * SLACK
    if "jerk" in LAWS[law]["limits"]:
        assert np.abs(np.diff(changes, axis=0, prepend=0.0)).max() <= JERK * PERIOD**2 * SLACK


# Outside the range ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "joint", "side"),
    [("acceleration", 0, 1), ("jerk", 2, 1), ("clamp", 1, 0), ("redistribute", 2, 1), ("optimal", 1, 0)],
)
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


def test_a_joint_that_brakes_before_its_stop_is_named():
    one, q, named = controller("jerk"), ARM.configuration("home")[ARM.wiring.qpos], set()
    one.reset(q)
    for _ in range(1200):
        out = one.step(q, qdot_target=np.array([1.4, 0.0, 0.0]))
        named.add(out.limited_by.get("position"))
        q = q + PERIOD * out.qdot_cmd
    assert named == {None, ("shoulder",)}


# The watchdog -----------------------------------------------------------------------------------


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.mark.parametrize("law", ["acceleration", "jerk"])
def test_a_step_that_does_not_come_brakes_and_the_next_goes_on_from_there(law):
    clock, q = Clock(), ARM.configuration("home")[ARM.wiring.qpos]
    one = controller(law, watchdog=5 * PERIOD, clock=clock)
    one.reset(q)
    for _ in range(300):
        out = one.step(q, twist=np.array([0.1, 0.1, 0, 0, 0, 0]))
        q = q + PERIOD * out.qdot_cmd
        clock.now += PERIOD
    clock.now -= PERIOD  # that of the last step
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


def test_what_is_sent_after_a_reset_is_rest():
    """The next step begins there, so that nothing jumps."""
    clock, q = Clock(), ARM.configuration("home")[ARM.wiring.qpos]
    one = controller("acceleration", watchdog=5 * PERIOD, clock=clock)
    one.reset(q)
    assert_array_equal(one.command_at().q_cmd, q)
    for _ in range(100):
        one.step(q, twist=np.array([0.1, 0.1, 0, 0, 0, 0]))
    assert np.abs(one.command_at().qdot_cmd).max() > 0.01
    one.reset()
    for command in (one.command, one.command_at()):
        assert not command.qdot_cmd.any() and command.status == 0 and np.isnan(command.q_cmd).all()


def test_a_watchdog_that_is_off_asks_no_clock():
    one = controller("jerk", clock=lambda: pytest.fail("asked"))
    one.step(ARM.configuration("home")[ARM.wiring.qpos])
    with pytest.raises(QuestionError, match="command_at needs a watchdog"):
        one.command_at()


# Anything at all --------------------------------------------------------------------------------

# What cannot be used, of each argument. Positions that an arm could have, a fuzzer cannot tell from the true ones.
SCRAP = {
    "q": [
        "home", np.nan, np.full(3, np.nan), np.array([0.1, np.inf, 0.0]), np.zeros(2), [], {}, object(), 1e308,
        np.full(3, 1e308), np.full(3, -np.inf), np.full(3, 1j), ["a", "b", "c"], [[1, 2], [3]],
    ],
    "pose": [
        np.zeros(7), np.r_[np.zeros(3), np.nan, 1, 0, 0], np.full(7, 1e308), np.zeros((4, 4)), "there", np.zeros(5), [],
        np.diag([1.0, 1.0, -1.0, 1.0]),
    ],
    "twist": [np.full(6, np.nan), np.full(6, 1e308), np.zeros(3), "fast", {}, np.r_[np.inf, np.zeros(5)]],
    "dt": [0.0, -PERIOD, np.nan, np.inf, "soon", [PERIOD] * 7, 1j],
    "frame": ["tool", None, 3],
    "q_target": [np.zeros(2), np.full(3, np.nan), "home"],
    "qdot_target": [np.zeros(4), np.full(3, np.inf), {}],
}  # fmt: skip
METHODS = ("damped", "pseudoinverse", "jparse", "selectively_damped")


def wished(rng, q):
    twist = 10 ** rng.uniform(-2, 9 if rng.random() < 0.1 else 2) * rng.normal(size=6)
    pose = np.r_[rng.normal(size=3), rng.normal(size=4)]
    return (
        {"twist": twist, "frame": str(rng.choice(["world", "base", "site"]))},
        {"pose": pose, "twist": twist},
        {"q_target": q + rng.normal(size=3)},
        {"qdot_target": 3 * rng.normal(size=3)},
        {"pose": pose},
    )[rng.integers(5)]


class Sequence:
    """Calls of a controller with good and bad input from the first one on, and what is known of its commands."""

    def __init__(self, seed):
        self.rng, self.varies = np.random.default_rng(seed), seed % 2 == 1  # the period
        self.law = list(LAWS)[seed // 2 % len(LAWS)]
        self.one, self.w, self.calls = controller(self.law, METHODS[seed % 4]), 1, 0
        self.q = self.drawn()
        self.rest()

    def drawn(self):
        return self.rng.uniform(*ARM.position_limit.T, (self.w, 3))

    def rest(self, starts=None):
        """Know that all steps are forgotten."""
        self.last = self.change = np.zeros((self.w, 3))
        self.q_cmd = np.full((self.w, 3), np.nan) if starts is None else starts.copy()

    def reset(self):
        """Reset by good positions of a new number of arms, by none, or by bad ones, which change nothing."""
        way = self.rng.integers(4)
        if way == 0:
            self.one.reset()
            self.rest()
        elif way == 1:
            with pytest.raises(QuestionError):
                self.one.reset(self.scrap("q"))
        elif way == 2:
            self.w = int(self.rng.integers(1, 4))
            self.q = self.drawn()
            self.one.reset(self.q if self.w > 1 else self.q[0])
            self.rest(self.q)

    def scrap(self, name):
        return SCRAP[name][self.rng.integers(len(SCRAP[name]))]

    def spoiled(self, given):
        """Return arguments of a step, one of which is unusable, and of which arms."""
        rng, name = self.rng, str(self.rng.choice(list(SCRAP)))
        scrap, bad = self.scrap(name), np.ones(self.w, bool)
        if name in ("pose", "twist", "q_target", "qdot_target"):
            kept = {key: given[key] for key in ("q", "dt") if key in given}
            return kept | {name: scrap}, bad
        if name == "q" and self.w > 1 and rng.random() < 0.5:  # of one arm alone
            bad[1:] = False
            scrap = [scrap if isinstance(scrap, np.ndarray) else None, *self.q[1:]]
        return given | {name: scrap}, bad

    def step(self, share):
        """Step once; a share of the calls has something bad. Hold the commands against their limits."""
        rng, w = self.rng, self.w
        if self.calls % 40 == 0:  # a wish stays for some time, so that the arm gets fast, and far
            self.wish = wished(rng, self.q[0])
        self.calls += 1
        given, bad, dt = {"q": self.q if w > 1 else self.q[0], **self.wish}, np.zeros(w, bool), PERIOD
        if "q_target" in given and w > 1:
            given["q_target"] = given["q_target"] * np.ones((w, 1))
        if self.varies and rng.random() < 0.5:
            given["dt"] = dt = PERIOD * rng.uniform(0.2, 3.0)
        if rng.random() < share:
            good = given.get("dt")
            given, bad = self.spoiled(given)
            dt = dt if given.get("dt") is good else PERIOD
        out = self.one.step(**given)
        self.hold(*(np.reshape(v, (w, -1)) for v in (out.qdot_cmd, out.q_cmd, np.array(out.status))), bad, dt)
        assert [text != "" for text in np.atleast_1d(np.array(out.problem, object))] == list(bad), given

    def hold(self, u, q_cmd, status, bad, dt):
        """Hold the commands of a step, (w, 3) each, against the limits and those before."""
        assert np.isfinite(u).all() and np.abs(u).max() <= RATE * SLACK
        assert (((status[:, 0] & int(Status.INVALID_INPUT)) != 0) == bad).all()
        change = u - self.last
        assert np.abs(change).max() <= ACCELERATION * dt * SLACK + 1e-15
        assert not (status & int(Status.ACCELERATION_EXCEEDED)).any()
        starts = np.isnan(self.q_cmd[:, 0])
        before = np.where(starts[:, None] & ~bad[:, None], self.q, self.q_cmd)
        unknown = starts & bad
        assert np.isnan(q_cmd[unknown]).all()
        assert (np.abs(q_cmd - before)[~unknown] <= np.abs(u[~unknown]) * dt + 1e-12).all()  # NaN is no less
        self.q = self.q + dt * u
        if not self.varies:
            assert not (status & int(Status.JERK_EXCEEDED)).any()
            if "jerk" in LAWS[self.law]["limits"]:
                assert np.abs(change - self.change).max() <= JERK * PERIOD**2 * SLACK
            lower, upper = ARM.position_limit.T
            assert (self.q <= upper + 1e-9).all() and (self.q >= lower - 1e-9).all()
        self.last, self.change, self.q_cmd = u.copy(), change, q_cmd.copy()


@pytest.mark.parametrize(
    ("seed", "calls"),
    [*((seed, 750) for seed in range(14)), *(pytest.param(seed, 5000, marks=pytest.mark.long) for seed in range(14, 34))],
)  # fmt: skip
def test_nothing_raises_no_limit_is_exceeded_and_commands_are_continuous_from_the_first_call_on(seed, calls):
    sequence = Sequence(seed)
    for k in range(calls):
        if k % 250 == 249:
            sequence.reset()
        sequence.step(0.9 if k % 250 < 5 else 0.06)


def test_a_jacobian_of_anything_raises_nothing():
    rng = np.random.default_rng(0)
    law = rmrc.Law(3, 2, LAWS["jerk"], period=PERIOD)
    scrap, rates = SCRAP["pose"] + SCRAP["dt"], []
    for k in range(1500):
        J, twist = rng.normal(size=(2, 3)), rng.normal(size=2) * 10 ** rng.uniform(-2, 3)
        if k % 7 == 0:
            J = scrap[rng.integers(len(scrap))]
        if k % 11 == 0:
            twist = scrap[rng.integers(len(scrap))]
        rates.append(law.step(J, twist).qdot_cmd.copy())
    hold_limits(np.array(rates), "jerk")


@pytest.mark.parametrize("bad", [np.nan, -np.inf, 1e308])
@pytest.mark.parametrize("row", [0, 1])
def test_an_entry_of_a_jacobian_that_is_no_number_brakes_and_is_told(row, bad):
    law, J = rmrc.Law(3, 2, {"limits": {"acceleration": 2.0}}, period=PERIOD), np.eye(2, 3)
    for _ in range(20):
        before = law.step(J, np.ones(2)).qdot_cmd.copy()
    J[row, 1] = bad
    out = law.step(J, np.ones(2))
    assert out.status & Status.INVALID_INPUT
    assert "the Jacobian" in out.problem
    # nearer to rest by what the acceleration allows in a period
    assert_allclose(np.abs(out.qdot_cmd), np.maximum(np.abs(before) - 2.0 * PERIOD, 0.0), atol=1e-15)


def test_a_law_without_an_arm_has_positions_once_they_are_given_and_loads_no_mujoco():
    law, J, q = rmrc.Law(3, 2, period=PERIOD), np.eye(2, 3), np.array([0.1, 0.2, 0.3])
    assert np.isnan(law.step(J, np.ones(2)).q_cmd).all()
    out = law.step(J, np.ones(2), q)
    assert_allclose(out.q_cmd, q + PERIOD * out.qdot_cmd, atol=1e-15)
    code = "import sys, rmrc; rmrc.Law(7, 6); print('mujoco' in sys.modules, 'rmrc.law.jacobian_law' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]
