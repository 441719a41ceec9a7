"""What is between the command and the plant, against queues, exponentials, roots and the law of large numbers."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from oracle_way import edge, ends, formula, response
from project import ROOT
from rmrc.scenario import Scenario
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

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


def drives(model, ticks, **plant):
    """Return an arm under the actuators of its model, on a short line."""
    path = DRIVES / f"{model}.xml" if isinstance(model, str) else model
    return prepare(Scenario.model_validate({
        "name": "drives", "arm": {"model": path, "site": "hand"}, "task": {"axes": ("x", "z")},
        "control": {"period": 0.004, "feedback": 5.0},
        "target": {"path": ({"line": {"by": (0.05, 0.0, 0.05)}}, {"hold": {"for": 0.2}})},
        "plant": {"kind": "model", "delay": 0.004 * ticks, **plant},
    }))  # fmt: skip


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


# no two commands are alike, so that each can be told by its value
VARIED = (
    "control.feedback=1", "plant.kind=ideal",
    "target.path=[{arc: {center: [0.9, 0.3], angle: 50 deg}}]", "target.limits={velocity: 0.1}",
)  # fmt: skip


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
