"""What is between the command and the plant, against queues, exponentials, roots and the law of large numbers."""

import math
from collections import deque

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from loops import controller_of
from oracle_way import edge, ends, formula, response
from oracles import known_model
from project import ROOT, mostly_long
from rmrc.plants.transmission import oscillator
from rmrc.results.columns import COLUMNS
from rmrc.scenario import Scenario, load
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.runs import NOT_KEPT
from rmrc.support.errors import ScenarioError
from wording import says

PERIOD = 0.01
DRIVES = ROOT / "tests/models/drives"


# The edge of stability ----------------------------------------------------------------------------------------------

TICKS, OFF = 1200, 1e-5


def standing(gain, **plant):
    """Return an arm that is held a hundredth of a millimeter beside where it stands, near a regular posture."""
    return prepare(Scenario.model_validate({
        "name": "edge", "task": {"axes": ("x", "y")},
        "arm": {"model": ROOT / "models/planar_2link.xml", "site": "tip", "start": (0.5, -1.5)},
        "control": {
            "period": PERIOD, "feedback": gain / PERIOD, "inverse": {"method": "pseudoinverse"},
            "limits": {"on_excess": "none"},
        },
        "target": {"path": ({"set": {"by": (OFF, OFF), "for": TICKS * PERIOD}},)},
        "plant": {"kind": "ideal", **plant},
    }))  # fmt: skip


def are_stable(worlds):
    """Return of each world whether its error falls from the second quarter of its run to the last, and is small."""
    runs = Simulation(worlds).run()
    errors = [np.linalg.norm(run["pose_error"], axis=1) for run in runs]
    quarters = [[part.max() for part in np.array_split(error, 4)] for error in errors]
    return [last < second < 10 * OFF for _, second, _, last in quarters]  # larger ones are not linear


def at_the_edge(gain, **plant):
    """Whether a loop is stable 2 % below a gain, and unstable 2 % above it."""
    return are_stable([standing(0.98 * gain, **plant), standing(1.02 * gain, **plant)]) == [True, False]


@pytest.mark.parametrize("d", range(6))
def test_the_edge_of_stability_is_that_of_an_integrator_with_so_many_ticks_of_delay(d):
    assert at_the_edge(formula(d), delay=d * PERIOD)


@pytest.mark.parametrize("d", [1, 3])
def test_a_tick_more_or_less_has_another_edge(d):
    assert not at_the_edge(formula(d), delay=(d - 1) * PERIOD)
    assert not at_the_edge(formula(d), delay=(d + 1) * PERIOD)


def lagging(d, lag):
    """Return the polynomials P, Q of P + K T Q, of 1/(s (lag s + 1)) behind a hold and d ticks of delay [Astrom97]."""
    T, a = PERIOD, np.exp(-PERIOD / lag)
    numerator = np.array([T - lag + lag * a, lag - lag * a - T * a]) / T
    return np.polymul(np.poly([1.0, a]), [1.0] + d * [0.0]), numerator


@pytest.mark.parametrize(("d", "lag"), [(0, 0.004), (0, 0.03), (1, 0.01), (3, 0.05), (5, 0.002)])
def test_with_a_lag_the_edge_is_where_a_root_of_the_characteristic_equation_leaves_the_circle(d, lag):
    P, Q = lagging(d, lag)
    gain = edge(lambda gain: ends(np.polyadd(P, gain * Q)) < 1.0)
    assert at_the_edge(gain, delay=d * PERIOD, lag=lag)
    assert not at_the_edge(1.05 * gain, delay=d * PERIOD, lag=lag)


def between(delay):
    """Return P, Q of P + K T Q for an integrator with a delay of any number of ticks: shares of two commands."""
    d, part = divmod(delay, 1.0)
    return np.polymul([1.0, -1.0], [1.0] + (int(d) + 1) * [0.0]), np.array([1.0 - part, part])


def test_the_edge_is_continuous_in_the_delay():
    delays, edges = np.arange(0.0, 3.01, 0.25), []
    for delay in delays:
        P, Q = between(delay)
        edges.append(edge(lambda gain, P=P, Q=Q: ends(np.polyadd(P, gain * Q)) < 1.0))
        assert at_the_edge(edges[-1], delay=delay * PERIOD), delay
    assert_allclose([edges[0], edges[4], edges[8], edges[12]], [formula(d) for d in range(4)], atol=1e-5)
    for d in (1, 2, 3):  # and right beside whole ticks it is that of these
        assert at_the_edge(formula(d), delay=(d - 1e-3) * PERIOD)
        assert at_the_edge(formula(d), delay=(d + 1e-3) * PERIOD)


# A plain queue ------------------------------------------------------------------------------------------------------


class Queue:
    """What was sent so many ticks ago, at first nothing."""

    def __init__(self, ticks, n):
        self._queue = deque([np.zeros(n)] * ticks)

    def pass_on(self, rates):
        self._queue.append(rates.copy())
        return self._queue.popleft()


def own_loop(prepared, model, start, tell, ticks):
    """Return q, rates sent and rates told of a loop as a user writes it: MjData, a controller, a queue."""
    arm, reference = prepared.arm, prepared.reference
    data, wiring = mujoco.MjData(model), arm.wire(model)
    data.qpos[:] = prepared.qpos
    mujoco.mj_forward(model, data)
    start(data)
    controller, queue, found = controller_of(prepared), Queue(ticks, arm.n), []
    for pose, twist in zip(reference.pose, reference.twist, strict=True):
        q = data.qpos[wiring.qpos].copy()
        sent = controller.step_data(data, pose=pose, twist=twist).qdot_cmd.copy()
        told = queue.pass_on(sent)
        tell(data, told)
        found.append((q, sent, told))
        for _ in range(prepared.plant.substeps):
            mujoco.mj_step(model, data)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
    return tuple(map(np.array, zip(*found, strict=True)))


def nothing(data):
    """Leave what the model has."""


def servos(ticks):
    """Return a world of rate servos, its model, and what starts and tells them."""
    sets = ["plant.kind=servo", "control.feedback=15", f"plant.delay={0.001 * ticks:.3f}"]
    prepared = prepare(load(ROOT / "scenarios/approach_singularity.yaml", sets))
    model = known_model(prepared)
    actuator = prepared.arm.wire(model).actuator

    def tell(data, rates):
        data.ctrl[actuator] = rates

    return prepared, model, nothing, tell


def own_drives(ticks):
    """Return a world of position servos of its model's own, which integrate what they are told."""
    prepared = drives("position", ticks)

    def tell(data, rates):
        data.ctrl[:] += np.array([2.0, 1.0]) * rates * 0.004

    def start(data):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)

    model = mujoco.MjModel.from_xml_path(str(prepared.arm.path))
    return prepared, model, start, tell


def drives(model, ticks, **plant):
    """Return an arm under the actuators of its model, on a short line."""
    path = DRIVES / f"{model}.xml" if isinstance(model, str) else model
    return prepare(Scenario.model_validate({
        "name": "drives", "arm": {"model": path, "site": "hand"}, "task": {"axes": ("x", "z")},
        "control": {"period": 0.004, "feedback": 5.0},
        "target": {"path": ({"line": {"by": (0.05, 0.0, 0.05)}}, {"hold": {"for": 0.2}})},
        "plant": {"kind": "model", "delay": 0.004 * ticks, **plant},
    }))  # fmt: skip


@pytest.mark.parametrize("ticks", mostly_long([0, 1, 7], 2))
@pytest.mark.parametrize("world", [servos, own_drives])
def test_a_delay_of_whole_ticks_is_a_queue_bit_for_bit(world, ticks):
    prepared, model, start, tell = world(ticks)
    (run,) = Simulation([prepared]).run()
    for name, values in zip(
        ("q", "qdot_cmd", "qdot_arrived"), own_loop(prepared, model, start, tell, ticks), strict=True
    ):
        assert_array_equal(run[name], values)
    with pytest.raises(AssertionError):
        assert_array_equal(own_loop(prepared, model, start, tell, ticks + 1)[0], run["q"])


def test_it_is_what_a_delay_of_mujocos_own_actuators_is(tmp_path):
    (tmp_path / "arm.xml").write_bytes((DRIVES / "arm.xml").read_bytes())
    text = (DRIVES / "velocity.xml").read_text("utf-8")
    for name in ("a", "b"):
        assert text.count(f'name="{name}"') == 1
        text = text.replace(f'name="{name}"', f'name="{name}" delay=".012" nsample="7"')
    (tmp_path / "late.xml").write_text(text, "utf-8")
    (own,) = Simulation([drives(tmp_path / "late.xml", 0)]).run()
    (ours,) = Simulation([drives("velocity", 3)]).run()
    # the steps of MuJoCo's time are sums, and ours are products: what they round carries on to 1e-12
    assert_allclose(ours["q"], own["q"], rtol=0, atol=1e-10)
    (less,) = Simulation([drives("velocity", 2)]).run()
    assert np.abs(less["q"] - own["q"]).max() > 1e-4


# What arrives -------------------------------------------------------------------------------------------------------


def test_a_delay_may_be_as_long_as_the_run_and_no_longer(simulate, scenario):
    target = "target.path=[{set: {by: [0.1, 0.1], for: 0.5}}]"
    _, run = simulate(target, "plant={kind: ideal, delay: 0.5}")
    (first,) = np.flatnonzero(run["qdot_arrived"].any(axis=1))
    assert first == 500 == len(run) - 1
    assert_array_equal(run["qdot_arrived"][-1], run["qdot_cmd"][0])
    for delay in ("0.501", "1.0e+300"):
        with pytest.raises(ScenarioError) as caught:
            prepare(scenario(target, f"plant.delay={delay}"))
        assert str(caught.value) == says(f"--set plant.delay: … 0.501 s … {float(delay):g} s; … target.path")


def test_nothing_between_is_nothing_changed(simulate):
    _, run = simulate()
    assert run["qdot_arrived"].tobytes() == run["qdot_cmd"].tobytes()


@pytest.mark.parametrize("kind", ["ideal", "servo", "torque"])
@pytest.mark.parametrize("lag", ["0.02", "[0, 0.05]"])
def test_a_lag_is_exact_for_a_command_that_is_constant_during_a_tick(simulate, kind, lag):
    prepared, run = simulate(f"plant.kind={kind}", f"plant.lag={lag}", "control.feedback=5")
    T, y, told = run.period, np.zeros(2), []
    # the mean and the end of y = u + (y0 − u) exp(−s/L), by Gauss' rule, exact to rounding
    s, w = np.polynomial.legendre.leggauss(20)
    L = np.maximum(np.broadcast_to(prepared.scenario.plant.lag, 2), 1e-9)
    decay = np.exp(-np.outer((s + 1) * T / 2, 1 / L))
    for u in run["qdot_cmd"]:
        told.append(np.where(L > 1e-6, w @ (u + (y - u) * decay) / 2, u))
        y = u + (y - u) * np.exp(-T / L)
    # rounding of a thousand ticks
    assert_allclose(run["qdot_arrived"], told, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("frequency", "damping"), [(12.0, 0.05), (3.0, 1.0), (40.0, 0.0), (8.0, 4.0)])
def test_a_resonance_is_exact_for_a_command_that_is_constant_during_a_tick(simulate, frequency, damping):
    plant = f"plant={{kind: servo, resonance: {{frequency: {frequency}, damping: {damping}}}}}"
    _, run = simulate(
        plant, "control.feedback=0", "control.period=0.004", "target.path=[{line: {by: [0.02, 0.02]}}]"
    )
    w, x, told = 2 * np.pi * frequency, np.zeros((2, 2)), []
    end, mean = response(np.array([[0, 1], [-w * w, -2 * damping * w]]), np.array([0, w * w]), run.period)
    for u in run["qdot_cmd"]:
        known = np.vstack([x, u])
        told.append(mean @ known)
        x = end @ known
    assert_allclose(run["qdot_arrived"], told, rtol=0, atol=1e-11)  # rounding of 500 ticks


@pytest.mark.parametrize("kind", ["servo", "torque"])
def test_play_loses_its_width_at_each_turn(simulate, kind):
    turns = "target={path: [{line: {by: [0.1, 0.1]}}, {line: {by: [-0.1, -0.1]}}, {line: {by: [0.1, 0.1]}}]}"
    _, run = simulate(turns, "control.feedback=0", f"plant={{kind: {kind}, backlash: [0.02, 0.005]}}")
    drive, joint = (run.period * np.cumsum(run[name], axis=0) for name in ("qdot_cmd", "qdot_arrived"))
    play = np.array([0.02, 0.005])
    turned = [
        int(i) for i in np.flatnonzero(np.diff(np.sign(run["qdot_cmd"][:, 0]))) if 100 < i < len(run) - 100
    ]
    assert len(turned) == 2
    # first half of it is crossed, then all of it twice; a joint moves with its drive or not at all
    legs = [np.abs(np.diff(each[[0, *turned, -1]], axis=0)) for each in (drive, joint)]
    # sums of a thousand rates; the drive turns within a tick
    assert_allclose(legs[0] - legs[1], np.outer([0.5, 1.0, 1.0], play), rtol=0, atol=1e-5)
    rests, follows = run["qdot_arrived"] == 0.0, np.abs(run["qdot_arrived"] - run["qdot_cmd"]) < 1e-12
    assert (~rests & ~follows).sum(axis=0).max() <= 3  # and in between in the ticks in which it is reached
    assert np.abs(drive - joint).max(axis=0) == pytest.approx(play / 2, abs=1e-12)


ANGLES = st.floats(1e-5 * math.tau, 1e3 * math.tau)


@given(ANGLES, st.one_of(st.just(1.0), st.floats(0.0, 2.0), st.floats(0.0, 10.0)))
def test_the_matrices_of_a_resonance_are_exponentials(angle, damping):
    end, mean = response(np.array([[0, angle], [-angle, -2 * damping * angle]]), np.zeros(2), 1.0)
    E, m = oscillator(angle, damping)
    # expm squares some 14 times what is off by 1e-16; `oscillator` divides 20 · 1e-16 by an angle of 6e-5
    assert_allclose(E, end[:, :2], rtol=0, atol=1e-10)
    assert_allclose(m, mean[:2], rtol=0, atol=1e-10)


def arrivals(run):
    """Return of each tick which command was in effect at its end, -1 before the first: by its first joint."""
    sent = run["qdot_cmd"][:, 0]
    assert len(set(sent)) == len(sent)
    index = {value: k for k, value in enumerate(sent)}
    return np.array([index.get(value, -1) for value in run["qdot_arrived"][:, 0]])


# no two commands are alike, so that each can be told by its value
VARIED = (
    "control.feedback=1", "plant.kind=ideal",
    "target.path=[{arc: {center: [0.9, 0.3], angle: 50 deg}}]", "target.limits={velocity: 0.1}",
)  # fmt: skip


def test_lost_commands_are_as_many_as_shall_be_and_the_last_one_that_came_holds(simulate):
    _, run = simulate(*VARIED, "plant.loss=0.3", "plant.seed=4")
    k, n = arrivals(run), len(run)
    assert np.all(np.diff(k) >= 0)
    lost = k != np.arange(n)
    for t in np.flatnonzero(lost):
        assert k[t] == (k[t - 1] if t else -1)
    # five standard deviations of a binomial distribution
    assert abs(lost.mean() - 0.3) < 5 * math.sqrt(0.3 * 0.7 / n)
    # and no more in turn than chance has it: the share of pairs
    assert abs((lost[1:] & lost[:-1]).mean() - 0.09) < 5 * math.sqrt(0.09 * 0.91 / n)
    with pytest.raises(AssertionError):
        assert abs(lost.mean() - 0.35) < 5 * math.sqrt(0.35 * 0.65 / n)


def test_with_jitter_commands_come_in_order_and_none_later_than_it_may(simulate):
    _, run = simulate(*VARIED, "plant.delay=0.002", "plant.jitter=0.005", "plant.seed=4")
    t = np.arange(len(run))
    drawn_at = t + 2.0 + 5.0 * np.random.default_rng([4, 1]).random((len(t), 2))[:, 0]
    newest = np.array(
        [max((k for k in range(max(0, i - 8), i + 1) if drawn_at[k] <= i), default=-1) for i in t]
    )
    assert np.all(np.diff(newest) >= 0)
    assert np.sum(np.diff(newest) == 0) > 0 and np.diff(newest).max() > 1  # some wait, some are overtaken
    whole = np.array(
        [not np.any((drawn_at > i) & (drawn_at < i + 1)) for i in t]
    )  # nothing came within the tick
    told = np.where(newest[:, None] >= 0, run["qdot_cmd"][newest], 0.0)
    assert whole.sum() > 100
    assert_array_equal(run["qdot_arrived"][whole], told[whole])
    assert (run["qdot_arrived"][~whole] != told[~whole]).any()


def test_the_seed_decides_what_is_late_and_lost(simulate):
    chance = "plant={kind: ideal, jitter: 0.003, loss: 0.1, seed: 1}"
    (_, first), (_, same), (_, other) = (
        simulate(chance, seed) for seed in ("plant.seed=1", "plant.seed=1", "plant.seed=2")
    )
    for name in COLUMNS:
        assert first[name].tobytes() == same[name].tobytes()
    assert (first["q"] != other["q"]).any()


MIXED = (
    (), ("plant.delay=0.0055",), ("plant.delay=0.2",), ("plant={lag: 0.02, jitter: 0.01, seed: 3}",), ("plant={loss: 0.4}",),
    ("plant.resonance.frequency=9",), ("plant.backlash=0.01",),
    ("plant={delay: 0.001, loss: 0.1, lag: [0, 0.1], resonance: {frequency: 30}}",),
)  # fmt: skip


@pytest.mark.parametrize("keeps", [True, False])
def test_worlds_of_all_kinds_have_the_same_bits_side_by_side(scenario, keeps):
    prepared = [prepare(scenario("control.feedback=2", *one)) for one in MIXED]
    alone = [Simulation([one]).run()[0] for one in prepared]
    if keeps:
        together = Simulation(prepared, threads=2).run()
        for run, want in zip(together, alone, strict=True):
            for name in COLUMNS:
                assert run[name].tobytes() == want[name].tobytes(), name
        return
    simulation = Simulation(prepared, keep_columns=False)
    simulation.step()
    assert [figures(one) for one in simulation.scorecards()] == [figures(run.scorecard) for run in alone]


def figures(scorecard):
    """Return the figures as text, which has all bits of them; NaN is itself there."""
    return repr({name: one.value for name, one in scorecard.figures.items() if name not in NOT_KEPT})


# Refused ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        (["plant={kind: ideal, resonance: {frequency: 12}}"], "--set plant: plant.resonance: … ideal … plant.lag … servo, torque, model"),
        (["plant.resonance.frequency=0.001"], "--set plant.resonance.frequency: … 0.01 … 1e+06 Hz … 0.001 s … 0.001 Hz"),
        (["plant.resonance={frequency: 2.0e+6}"], "--set plant.resonance: plant.resonance.frequency: … 1e+06 Hz … 2e+06 Hz"),
        (["plant.resonance={frequency: 9, damping: 11}"], "--set plant.resonance: plant.resonance.damping: … 10 … 11 … plant.lag"),
        (["plant={kind: ideal, backlash: 0.01}"], "--set plant: plant.backlash: … ideal … servo, torque, model"),
        (["plant.backlash=[0.1]"], "--set plant.backlash: … 2 values … shoulder, elbow … 1"),
        (["plant.lag=[0.1, 0.1, 0.1]"], "--set plant.lag: … 2 values … shoulder, elbow … 3"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused_in_a_line(scenario, sets, said):
    with pytest.raises(ScenarioError) as caught:
        prepare(scenario(*sets))
    assert str(caught.value) == says(said)
