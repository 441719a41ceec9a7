"""Any control rate: every plant takes a whole number of MuJoCo's steps per period, and says which."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc.scenario import load
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from wording import says

LINE = ROOT / "scenarios/line_tracking.yaml"
# Steps of at most 1 ms in a period, counted by hand.
STEPS = {"30 Hz": 34, "300 Hz": 4, "0.0333": 34, "1/7": 143, "0.0005": 1}


def line(period, kind, *more):
    """Return a prepared line along which an arm goes in a second or so, with limits that a slow loop can keep."""
    slow = (f"plant.kind={kind}", "plant.timestep=null", "expect={}", "control.feedback=2", "plant.kv=null")
    return prepare(load(LINE, [f"control.period={period}", *slow, *more]))


@pytest.mark.parametrize(("period", "steps"), STEPS.items())
def test_servos_take_the_longest_steps_of_a_millisecond_at_most_and_the_run_is_a_loop_over_them(
    period, steps
):
    prepared = line(period, "servo")
    seconds = prepared.scenario.control.period
    (run,) = Simulation([prepared]).run()
    assert run.is_complete and run.divergence is None
    assert_allclose(run["time"], np.arange(len(run)) * seconds, rtol=1e-15, atol=0)
    model = prepared.plant.own_model()
    assert model.opt.timestep == pytest.approx(seconds / steps, rel=1e-12)
    data = mujoco.MjData(model)
    data.qpos[:] = prepared.qpos
    for t in range(len(run)):
        assert_allclose(data.qpos, run["q"][t], rtol=0, atol=1e-9)  # thousands of steps, each of 1e-16
        data.ctrl[:] = run["qdot_cmd"][t]
        for _ in range(steps):
            mujoco.mj_step(model, data)
    told = [one.text for one in prepared.assumed if one.is_otherwise and "divide" in one.text]
    is_chosen = steps != round(1000 * seconds, 9)
    assert told == (
        [says(f"timestep {seconds / steps:g} s … to divide … {seconds:g} s")] if is_chosen else []
    )


@pytest.mark.parametrize("kind", ["torque", "model", "ideal"])
@pytest.mark.parametrize("period", ["30 Hz", "240 Hz"])
def test_other_plants_follow_the_path_at_any_rate(kind, period):
    prepared = line(period, kind)
    (run,) = Simulation([prepared]).run()
    seconds = prepared.scenario.control.period
    assert run.is_complete
    assert_allclose(run["time"], np.arange(len(run)) * seconds, rtol=1e-15, atol=0)
    if kind != "ideal":  # which has no steps
        steps = prepared.plant.substeps
        own = prepared.arm.model.opt.timestep if kind == "model" else 0.001
        assert steps * prepared.plant.timestep == pytest.approx(seconds, rel=1e-12)
        assert seconds / steps <= own * (1 + 1e-9) < seconds / (steps - 1)
        # a longer period holds each torque for longer: a rate error of 1 may become no less than 0 at its end
        assert prepared.plant.bandwidth == (1 / seconds if seconds > 0.002 else 500)
    assert run.scorecard["position_error.end"].value < 0.02 * np.ptp(run["pose_ref"][:, :2])
