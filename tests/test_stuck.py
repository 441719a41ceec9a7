"""An arm that stands still while it should move is STUCK, and no other; and `run` says so in a line."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from project import ROOT
from rmrc.scenario import load
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.spatial import AXES

COARSE, IDEAL = "control.period=0.002", "plant.kind=ideal"
GENTLE = "target.limits={velocity: 0.25, acceleration: 1.0, jerk: 10.0}"
TWO = (COARSE, IDEAL, GENTLE, "arm.start=[25 deg, -50 deg]")
OUT = "target.path=[{line: {to: [2.0, 0]}}, {line: {to: [1.8, 0]}}, {hold: {for: 0.5}}]"
TORUS = (
    COARSE, IDEAL, GENTLE, "arm.model=models/torus_3r.xml", "task.axes=[x, y, z]", "arm.start=[0, 169 deg, -159 deg]",
    "target.path=[{line: {by: [-0.3, 0, -0.12]}}, {line: {by: [0.3, 0, 0.12]}}]",
)  # fmt: skip
STUCK_RUNS = {
    # the truncated inverse drops the direction in which it would have to bend the elbow, and never comes back
    "truncated, straight": (*TWO, OUT, "control.inverse.method=truncated", "control.feedback=5"),
    "beyond reach": (*TWO, "target.path=[{line: {to: [2.3, 0]}}, {line: {to: [1.8, 0]}}]"),
    "two joints at their limits": TORUS,
}  # fmt: skip
OTHER_RUNS = {
    "straight and back": (*TWO, OUT),
    "a slow start": (*TWO, OUT, "control.limits.acceleration=0.5"),

    "told to stop": (*TWO, OUT, "control.at_singularity=stop", "control.stop.sigma=0.2"),
    "slowed down": (*TWO, OUT, "control.at_singularity=slow", "control.inverse.method=inverse", "control.limits.rate=0.5"),
    "without feed-forward": (*TWO, OUT, "control.feedforward=false"),
}  # fmt: skip


def stands_by_hand(prepared, run):
    """Return at which ticks a run is stuck by the equations, of its columns and MuJoCo's Jacobian."""
    rows = [AXES.index(axis) for axis in run.axes]
    scale = 1.0 / np.where(np.array(rows) < 3, run.length, 1.0)
    still, found = 0.0, []
    for t in range(len(run)):
        J = prepared.arm.jacobian(run["q"][t])[rows]
        wanted = np.linalg.norm(scale * run["twist_ref"][t, rows])
        error = scale * run["pose_error"][t, rows]
        forward = prepared.scenario.control.feedforward * scale * run["twist_ref"][t, rows]
        asked = np.linalg.norm(forward + prepared.scenario.control.feedback * error)
        done = np.linalg.norm(scale * (J @ run["qdot_cmd"][t]))
        if run["status"][t] & Status.STOPPED or max(wanted, asked) <= 1e-3:
            still = 0.0
        elif wanted > 1e-3:
            still = still + run.period if done <= max(0.02 * wanted, 1e-4) else 0.0
        elif done > max(0.02 * asked, 1e-4):
            still = 0.0
        found.append(still > 0.2)
    return np.array(found)


@pytest.mark.parametrize("name", STUCK_RUNS | OTHER_RUNS)
def test_a_run_is_stuck_where_its_columns_say_so_and_nowhere_else(simulate, name):
    prepared, run = simulate(*(STUCK_RUNS | OTHER_RUNS)[name])
    is_stuck = run["status"] & Status.STUCK > 0
    assert_array_equal(is_stuck, stands_by_hand(prepared, run))
    assert np.any(is_stuck) == (name in STUCK_RUNS)


def test_a_locked_arm_is_stuck_until_its_path_ends_and_one_that_comes_back_is_not(simulate):
    _, run = simulate(*STUCK_RUNS["truncated, straight"])
    assert run["status"][-1] & Status.STUCK, "the reference has come to rest, the arm is still not there"
    assert np.linalg.norm(run["pose_error"][-1, :2]) > 0.1
    (back,) = Simulation([prepare(load(ROOT / "scenarios/beyond_reach.yaml"))]).run()
    assert np.any(back["status"] & Status.STUCK) and not back["status"][-1] & Status.STUCK
    assert np.linalg.norm(back["pose_error"][-1, :2]) < 0.002
