"""What an actuator can take limits a Controller: its range through its gear, and its force where data show it."""

import warnings

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from rmrc.law.controller import Controller
from rmrc.scenario.choices import Status
from rmrc.support.errors import ModelWarning

PERIOD, BEND = 0.002, 1.3
# A flat arm of two joints, a finger behind it, and a weight on request.
ARM = """<mujoco><compiler angle="radian"/><option timestep="0.002" integrator="implicitfast" gravity="0 0 {gravity}"/>
<default><geom contype="0" conaffinity="0"/></default><worldbody>
<body><joint name="a" axis="{axis}" range="-3 3" damping=".5"/><geom type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="1"/>
<body pos=".4 0 0"><joint name="b" axis="{axis}" range="-2.8 2.8" damping=".5"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".5"/><site name="tip" pos=".3 0 0"/>
<body pos=".3 0 0"><joint name="finger" axis="0 0 1" range="-1 1"/><geom size=".01" mass=".01"/></body></body></body></worldbody>
<tendon><fixed name="one"><joint joint="b" coef="-.5"/></fixed>
<fixed name="two"><joint joint="a" coef="1"/><joint joint="b" coef="1"/></fixed></tendon>
<actuator>{actuators}</actuator></mujoco>"""
OTHER = '<position joint="a" kp="300" kv="30"/>'


def arm(actuators, gravity=0.0, axis="0 0 1"):
    return mujoco.MjModel.from_xml_string(ARM.format(actuators=actuators, gravity=gravity, axis=axis))


def controller(model, start=(0.3, BEND - 0.3), limits=None, **options):
    law = {
        "feedback": 5,
        "inverse": {"method": "pseudoinverse"},
        "limits": limits or {"rate": 2.0, "acceleration": 8},
    }
    axes = ["x", "z"] if model.opt.gravity.any() else ["x", "y"]
    c = Controller(model, "tip", law, period=PERIOD, joints=["a", "b"], task={"axes": axes}, **options)
    c.reset(np.array(start))
    return c


def stepped(c, data, seconds, goal):
    """Step arm and law; return commands (T, 2), positions (T, 2) and statuses (T,)."""
    q_cmd, q, status = [], [], []
    for _ in range(round(seconds / PERIOD)):
        mujoco.mj_fwdPosition(data.model, data)
        out = c.step_data(data, pose=goal)
        data.ctrl[: len(c.actuators)] = c.controls()
        mujoco.mj_step(data.model, data)
        q_cmd.append(out.q_cmd.copy()), q.append(data.qpos[:2].copy()), status.append(out.status)
    return np.array(q_cmd), np.array(q), np.array([int(each) for each in status])


# Servos of joint b that end where it is bent by 1.3 rad, whatever their control counts in.
SERVOS = {
    "range": '<position joint="b" kp="300" kv="30" ctrlrange="-2 1.3"/>',
    "gear turns back": '<position joint="b" gear="-2" kp="80" kv="8" ctrlrange="-2.6 4"/>',
    "gain and offset": '<general joint="b" gainprm="30" biastype="affine" biasprm="60 -300 -30" ctrlrange="-20 11"/>',
    "integrated": '<intvelocity joint="b" kp="300" actrange="-2 1.3"/>',
}


@pytest.mark.parametrize("servo", SERVOS)
def test_a_position_command_ends_with_the_range_of_its_servo_and_turns_at_once(servo):
    model = arm(OTHER + SERVOS[servo])
    c, data = controller(model), mujoco.MjData(model)
    data.qpos[:2] = c.command.q_cmd
    if model.na:
        data.act[:] = data.qpos[1]
    start = c.arm.pose(data)
    beyond = c.arm.pose([0.3, 1.8])  # within the joints' range
    q_cmd, q, status = stepped(c, data, 3.0, beyond)
    assert q_cmd[:, 1].max() == pytest.approx(BEND, abs=1e-9) and abs(q[-1, 1] - BEND) < 2e-3
    assert status[-1] & Status.POSITION_LIMITED and status[-1] & Status.STUCK
    assert c.command.limited_by == {"position": ("b",)}
    rates = np.diff(q_cmd, axis=0) / PERIOD
    assert np.abs(np.diff(rates, axis=0)).max() / PERIOD < 8 * (1 + 1e-6)
    q_cmd, q, status = stepped(c, data, 3.0, start)
    assert (np.diff(q_cmd[:20, 1]) < 0).all()  # nothing has wound up
    assert_allclose(q[-1], [0.3, BEND - 0.3], atol=1e-3)
    assert not status[-1]


def test_a_rate_servo_limits_the_rates_and_is_told():
    model = arm('<velocity joint="a" kv="30"/><velocity joint="b" gear="-2" kv="9" ctrlrange="-1 1"/>')
    with pytest.warns(ModelWarning, match=r"b 0\.5 of 2 rad/s; write control\.limits\.rate: \[2, 0\.5\]"):
        c = controller(model)
    data, (fastest, statuses) = mujoco.MjData(model), (0.0, 0)
    data.qpos[:2] = [0.3, 1.0]
    goal = c.arm.pose([0.3, 2.2])
    for _ in range(1500):
        mujoco.mj_fwdPosition(model, data)
        out = c.step_data(data, pose=goal)
        data.ctrl[c.actuators] = c.controls()
        assert abs(data.ctrl[1]) <= 1.0 + 1e-9
        mujoco.mj_step(model, data)
        fastest, statuses = max(fastest, abs(out.qdot_cmd[1])), statuses | out.status
        assert ("b" in out.limited_by.get("rate", ())) == bool(out.status & Status.RATE_LIMITED)
    assert fastest == pytest.approx(0.5) and statuses & Status.RATE_LIMITED
    assert np.abs(out.pose_error[:2]).max() < 1e-3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        controller(model, limits={"rate": None})  # then the range is the limit
        free = controller(model, actuators=False)
    rates = [abs(free.step([0.3, 1.0], pose=goal).qdot_cmd[1]) for _ in range(500)]
    assert max(rates) > 1.0  # negative control


@pytest.mark.parametrize("force", [2.0, 40.0])
def test_a_command_does_not_run_away_from_an_arm_that_its_actuator_cannot_lift(force):
    """At rest MuJoCo's servo gives kp (q_cmd − q), which is at most its forcerange; level, the arm needs 6 N·m."""
    servos = f'<position joint="a" kp="200" kv="20" forcerange="{-force} {force}"/><position joint="b" kp="200" kv="20"/>'
    model = arm(servos, gravity=-9.81, axis="0 -1 0")
    data, law = mujoco.MjData(model), {"feedback": 5, "limits": {"rate": 2.0, "acceleration": 8}}
    data.qpos[:2], data.ctrl[1] = [-1.5, 0.3], 0.3
    c, free = (
        Controller(model, "tip", law, period=PERIOD, joints=["a"], task={"axes": ["z"]}, actuators=actuators)
        for actuators in (True, False)
    )
    c.reset(data)
    goal = c.arm.pose([-0.2])
    q_cmd, q, status = stepped(c, data, 8.0, goal)
    if force == 40.0:
        assert not status[-1] and abs(c.command.pose_error[2]) < 1e-3
        return
    assert np.abs(q[-1] - q[-200]).max() < 1e-3 and q[-1, 0] < -1.0
    assert status[-1] & Status.TORQUE_LIMITED and status[-1] & Status.STUCK
    assert c.command.limited_by["torque"] == ("a",)
    # it stopped where the force was all given, and has not moved on since
    assert force / 200 < q_cmd[-1, 0] - q[-1, 0] < 0.2 and q_cmd[-1, 0] == q_cmd[-1000, 0]
    mujoco.mj_fwdPosition(model, data)
    for _ in range(500):
        out = free.step_data(data, pose=goal)
    assert out.q_cmd[0] > q[-1, 0] + 1.0  # negative control: the integral of the rates
    assert not out.status & (Status.TORQUE_LIMITED | Status.STUCK)
