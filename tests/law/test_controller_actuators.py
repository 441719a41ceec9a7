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


@pytest.mark.parametrize(
    ("on_excess", "jerk"), [("scale", 300.0), ("redistribute", None), ("optimal", 300.0), ("clamp", None)]
)
def test_commands_come_to_the_end_of_a_range_within_all_limits(on_excess, jerk):
    """Goals beyond random ranges, and input that is refused at times: differences of q_cmd are the oracle."""
    rng = np.random.default_rng(7)
    ends = np.add(np.sort(rng.uniform(-2, 2, (2, 2)), axis=1), [0, 0.4])
    (a, b), (c0, c1) = ends
    model = arm(
        f'<position joint="a" kp="300" kv="30" ctrlrange="{a} {b}"/>'
        f'<position joint="b" gear="-2" kp="80" kv="8" ctrlrange="{-2 * c1} {-2 * c0}"/>'
    )
    limits = {"rate": 2.0, "acceleration": 10.0, "jerk": jerk, "on_excess": on_excess}
    c, data = controller(model, ends.mean(axis=1), limits), mujoco.MjData(model)
    data.qpos[:2] = c.command.q_cmd
    q_cmd = [c.command.q_cmd.copy()] * 3
    for t in range(1500):
        if t % 300 == 0:
            goal = c.arm.pose(rng.uniform([-3, -2.8], [3, 2.8]))
        mujoco.mj_fwdPosition(model, data)
        out = c.step_data(data, pose=goal if rng.random() > 0.005 else np.full(7, np.nan))
        data.ctrl[:] = c.controls()
        mujoco.mj_step(model, data)
        q_cmd.append(out.q_cmd.copy())
        assert not out.status & (Status.ACCELERATION_EXCEEDED | Status.JERK_EXCEEDED)
    assert (q_cmd >= ends[:, 0]).all() and (q_cmd <= ends[:, 1]).all()
    assert np.isclose(q_cmd, ends[:, 0], atol=1e-3).any() or np.isclose(q_cmd, ends[:, 1], atol=1e-3).any()
    for order, limit in ((1, 2.0), (2, 10.0), (3, jerk)):
        if limit is not None:
            assert np.abs(np.diff(q_cmd, order, axis=0)).max() <= limit * PERIOD**order + 1e-12


def test_the_other_joints_make_up_for_a_servo_that_is_at_its_end():
    """With one row, joint a can do what b does not; and a range that is not in the way limits nothing."""
    model = arm(OTHER + SERVOS["range"])
    data = mujoco.MjData(model)
    c = Controller(model, "tip", {"feedback": 5}, period=PERIOD, joints=["a", "b"], task={"axes": ["y"]})
    data.qpos[:2] = [0.3, 1.2]
    c.reset(data)
    goal = c.arm.pose([0.6, 1.3])
    q_cmd, _, status = stepped(c, data, 4.0, goal)
    assert abs(c.command.pose_error[1]) < 1e-3 and q_cmd[:, 1].max() <= BEND + 1e-12
    assert not (status & Status.STUCK).any()


@pytest.mark.parametrize(
    ("beside", "end"),
    [
        ('<position joint="finger" kp="1" ctrlrange="-.1 .1"/>', 2.8),  # of a joint that is not driven
        ('<position tendon="two" kp="1" ctrlrange="-.1 .1"/>', 2.8),  # of two joints
        ('<motor joint="b" ctrlrange="-.1 .1"/>', 2.8),  # no position
        ('<position tendon="one" kp="1" ctrlrange="-.65 9"/>', BEND),  # of b alone
    ],
)
def test_only_servos_of_one_driven_joint_count(beside, end):
    c = controller(arm(OTHER + '<position joint="b" kp="300" inheritrange="1"/>' + beside))
    assert_allclose(c.arm.servo_limits[0][:, 1], [-2.8, end])
    assert_allclose(c.arm.servo_limits[0][:, 0], [-np.inf, np.inf])


RATES = '<velocity joint="a" kv="30"/><velocity joint="b" gear="-2" kv="9" ctrlrange="-1 1"/>'


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


STRONG = '<position joint="a" kp="900" kv="60"/>'


@pytest.mark.parametrize(
    ("drive", "holds"),
    [
        ('<position joint="b" kp="500" kv="30" forcerange="-30 .3"/>', False),
        (
            '<position joint="b" kp="500" kv="30" forcerange="-.3 30"/>',
            True,
        ),  # the side that bears the weight
        ('<position joint="b" kp="500" forcerange="-.3 .3"/><velocity joint="b" kv="30"/>', True),
    ],
)
def test_the_force_that_counts_is_that_of_the_servo_towards_the_command(drive, holds):
    """Joint b bears 0.5 kg · g · 0.15 m · cos 0.7 = 0.56 N·m at the start, and 0.65 N·m at the goal."""
    model = arm(STRONG + drive, -9.81, "0 1 0")
    c, data = controller(model, (0.3, -1.0)), mujoco.MjData(model)
    data.qpos[:2] = [0.3, -1.0]
    goal = c.arm.pose([0.9, -1.4])
    for _ in range(1500):
        mujoco.mj_fwdPosition(model, data)
        out = c.step_data(data, pose=goal)
        data.ctrl[0], data.ctrl[1] = out.q_cmd * [1.0, -2.0 if "gear" in drive else 1.0]
        mujoco.mj_step(model, data)
    assert (np.linalg.norm(out.pose_error[:3]) > 0.02) == holds
