"""What is between the command and the plant: the edge of stability of a delay, MuJoCo's own delay, and play."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from oracle_way import formula
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
