"""An arm that stands still while it should move is STUCK; the loop of `oracles.py` says the same at every tick."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from oracles import NumpyLoop
from rmrc.scenario.choices import Status
from shipped import shipped

GENTLE = (
    "control.period=0.004",
    "plant.kind=ideal",
    "target.limits={velocity: 0.25, acceleration: 1.0, jerk: 10.0}",
)
TWO = (*GENTLE, "arm.start=[25 deg, -50 deg]")
OUT = "target.path=[{line: {to: [2.0, 0]}}, {line: {to: [1.8, 0]}}, {hold: {for: 0.5}}]"
RUNS = {
    # the truncated inverse drops the direction in which it would have to bend the elbow, and never comes back
    "straight": (True, *TWO, OUT, "control.inverse={method: truncated, cutoff: 0.05}", "control.feedback=5"),
    "beyond reach": (True, *TWO, "target.path=[{line: {to: [2.3, 0]}}, {line: {to: [1.8, 0]}}]"),
    "straight and back": (False, *TWO, OUT),
    "told to stop": (False, *TWO, OUT, "control.at_singularity=stop", "control.stop.sigma=0.2"),
    "without feed-forward": (False, *TWO, OUT, "control.feedforward=false"),
}


def is_stuck(run):
    return run["status"] & Status.STUCK > 0


@pytest.mark.parametrize("name", RUNS)
def test_a_run_is_stuck_where_its_columns_say_so_and_nowhere_else(simulate, name):
    expected, *overrides = RUNS[name]
    prepared, run = simulate(*overrides)
    assert_array_equal(is_stuck(run), NumpyLoop(prepared).run()["status"] & Status.STUCK > 0)
    assert np.any(is_stuck(run)) == expected


def test_an_arm_that_comes_back_is_stuck_no_more():
    back = shipped("beyond_reach")
    assert np.any(is_stuck(back)) and not is_stuck(back)[-1]
    assert np.linalg.norm(back["pose_error"][-1, :2]) < 0.002
