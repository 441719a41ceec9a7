"""tau = Jᵀ wrench against MuJoCo's Jacobian, its mj_applyFT, and actuators that hold the arm still."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc.arm import load
from rmrc.textbook.chains import equilibrium_torques, joint_torques

MODELS = {"planar_2link": "tip", "planar_3link": "tip", "stanford": "tool"}


@pytest.fixture(params=MODELS)
def arm(request, monkeypatch):
    monkeypatch.chdir(ROOT)
    return load(ROOT / f"models/{request.param}.xml", MODELS[request.param])


def random_pose_and_wrench(arm, seed):
    rng = np.random.default_rng(seed)
    lower, upper = arm.position_limit.T
    return rng.uniform(lower, upper), rng.normal(size=6) * 10


@pytest.mark.parametrize("seed", range(4))
def test_equivalent_torques_are_those_of_mj_jac_and_of_mj_applyFT(arm, seed):
    q, wrench = random_pose_and_wrench(arm, seed)
    model, data = arm.model, mujoco.MjData(arm.model)
    data.qpos[arm.wiring.qpos] = q
    mujoco.mj_forward(model, data)
    tau = joint_torques(arm.jacobian(q), wrench)
    applied = np.zeros(model.nv)
    site = data.site_xpos[arm.wiring.site]
    mujoco.mj_applyFT(model, data, wrench[:3], wrench[3:], site, arm.wiring.body, applied)
    full = np.zeros((6, model.nv))
    mujoco.mj_jac(model, data, full[:3], full[3:], site, arm.wiring.body)
    # rounding of some twenty products of numbers up to 30
    assert_allclose(tau, applied[arm.wiring.dof], rtol=0, atol=1e-11)
    assert_allclose(tau, (full.T @ wrench)[arm.wiring.dof], rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("model", "axes", "wrench"),
    [
        ("planar_2link", "[x, y]", "[4, -3, 2, 0.5, 0.2, 1]"),
        ("planar_3link", "[x, y, rz]", "[4, -3, 2, 0.5, 0.2, 1]"),
        ("stanford", "[x, y, z, rx, ry, rz]", "[5, -3, 4, 0.5, 0.2, 0.4]"),
    ],
)
@pytest.mark.parametrize("plant", ["servo", "torque"])
def test_actuators_that_hold_the_arm_still_give_the_equilibrium_torques(simulate, model, axes, wrench, plant):
    prepared, run = simulate(
        f"arm.model=models/{model}.xml", f"arm.site={MODELS[model]}", "arm.start=home", f"task.axes={axes}",
        "target.path=[{hold: {for: 2.0}}]", f"plant.wrench={wrench}", f"plant.kind={plant}",
        "control.inverse.method=inverse",
    )  # fmt: skip
    assert np.abs(run["qdot"][-1]).max() < 1e-9  # settled: exp(−20/s · 2 s) of a first sag of millimeters
    want = equilibrium_torques(prepared.arm.jacobian(run["q"][-1]), np.array(prepared.scenario.plant.wrench))
    assert np.abs(want).max() > 1
    assert_allclose(run["tau"][-1], want, rtol=1e-6, atol=1e-6)
    with pytest.raises(AssertionError):  # the sign is part of it
        assert_allclose(run["tau"][-1], -want, rtol=1e-6, atol=1e-6)
