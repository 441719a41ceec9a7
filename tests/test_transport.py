"""What is between the command and the plant: delay and lag, against queues, exponentials and roots."""

from collections import deque

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from oracle_way import edge, ends, formula
from project import ROOT
from rmrc.law.controller import Controller
from rmrc.scenario import Scenario, load
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
    controller, queue, found = Controller(prepared.law, data), Queue(ticks, arm.n), []
    for pose, twist in zip(reference.pose, reference.twist, strict=True):
        q = data.qpos[wiring.qpos].copy()
        sent = controller.step(q, data.qvel[wiring.dof], pose, twist).qdot.copy()
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
    model = prepared.plant.model([prepared.plant])
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


@pytest.mark.parametrize("ticks", [0, 1, 7])
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


def test_a_delay_longer_than_the_run_leaves_the_arm_where_it_is(simulate):
    _, run = simulate("plant.delay=1.0e+9", "plant.kind=ideal")
    assert not run["qdot_arrived"].any() and np.ptp(run["q"], axis=0).max() == 0.0


def test_nothing_between_is_nothing_changed(simulate):
    _, run = simulate()
    assert run["qdot_arrived"].tobytes() == run["qdot_cmd"].tobytes()


@pytest.mark.parametrize("kind", ["ideal", "servo", "torque"])
@pytest.mark.parametrize("lag", ["0.02", "[0, 0.05]"])
def test_a_lag_is_exact_for_a_command_that_is_constant_during_a_tick(simulate, kind, lag):
    prepared, run = simulate(f"plant.kind={kind}", f"plant.lag={lag}", "control.feedback=5")
    T, y, told = run.period, np.zeros(2), []
    for u in run["qdot_cmd"]:
        # the mean and the end of y = u + (y0 − u) exp(−s/L), by Gauss' rule, exact to rounding
        s, w = np.polynomial.legendre.leggauss(20)
        L = np.maximum(np.broadcast_to(prepared.scenario.plant.lag, 2), 1e-9)
        decay = np.exp(-np.outer((s + 1) * T / 2, 1 / L))
        told.append(np.where(L > 1e-6, w @ (u + (y - u) * decay) / 2, u))
        y = u + (y - u) * np.exp(-T / L)
    # rounding of a thousand ticks
    assert_allclose(run["qdot_arrived"], told, rtol=0, atol=1e-12)
