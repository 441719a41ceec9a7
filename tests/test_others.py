"""What is not the arm stays where a run starts: held by actuators, or locked; and all that asks sees it there.

The oracles are plain loops over MuJoCo: the author's model with drives on the arm's joints, told the rates that the
run recorded; and models in which what is locked has no joints.
"""

import re

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from physics import moved
from project import ROOT
from rmrc import arm as arms

MODELS = ROOT / "tests/models"
PERIOD, TIMESTEP = 0.002, 0.001
LINKS = ("shoulder", "elbow")
# Of each model: its site, the arm's joints, and the ranges of qpos of what is not the arm.
KNOWN = {
    "tendon_gripper": ("hand", LINKS), "two_arms": ("left", ("l1", "l2")), "idle_rail": ("hand", LINKS),
    "loose_gripper": ("hand", LINKS), "hostile_default": ("hand", LINKS),
}  # fmt: skip
ROUNDING = (
    1e-11  # a few hundred steps of numbers near 1, each rounded to 1e-16 and carried on by stiff servos
)


def run(model, kind="servo", start="home", others="hold", seconds=0.2, joints=None, site=None, **plant):
    """Return the world of a short move, and a pause, of an arm of these models, and what it did."""
    known = KNOWN.get(model, (site, joints))
    path = MODELS / f"{model}.xml" if model in KNOWN else model
    arm = {"site": known[0], "joints": known[1], "start": start, "others": others}
    move = ({"line": {"by": (0.03, 0.0, -0.03)}}, {"hold": {"for": seconds}})
    control = {"period": PERIOD, "feedback": 20.0}
    return moved(path, kind, move, arm=arm, control=control, timestep=TIMESTEP, **plant)


def plain_loop(prepared, done, ctrl, act=0.0):
    """Return qpos and xpos at each tick of MuJoCo's own loop: servos are told what the run sent.

    Args:
        ctrl: What the author's actuators get that are not the arm's, by name.
        act: Their activations.
    """
    arm, plant = prepared.arm, prepared.scenario.plant
    spec = mujoco.MjSpec.from_file(str(arm.path))
    for key in list(spec.keys):
        spec.delete(key)
    for actuator in [one for one in spec.actuators if one.target in arm.joints]:
        spec.delete(actuator)
    for joint, kv in zip(arm.joints, prepared.plant.kv, strict=True):
        servo = spec.add_actuator(name=f"own:{joint}", target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_velocity(kv=kv)
    spec.option.timestep, spec.option.integrator = TIMESTEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    if arm.followers:
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    for equality in (one for one in spec.equalities if one.name1 in [each.name for each in arm.followers]):
        equality.solref, equality.solimp[:2] = [0.1 * TIMESTEP, 1.0], 0.9999
    own = [body for body in spec.bodies if any(joint.name in arm.joints for joint in body.joints)]
    for body in [*own, *(one for link in own for one in link.find_all("body"))]:
        body.gravcomp = float(plant.is_compensated and not body.name.startswith("rope"))
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = prepared.qpos
    data.act[:] = act
    for name, value in ctrl.items():
        data.actuator(name).ctrl = value
    qpos, xpos = [], []
    for rates in done["qdot_cmd"]:
        mujoco.mj_kinematics(model, data)
        qpos.append(data.qpos.copy())
        xpos.append(data.xpos.copy())
        for joint, rate in zip(arm.joints, rates, strict=True):
            data.actuator(f"own:{joint}").ctrl = rate
        mujoco.mj_step(model, data, round(PERIOD / TIMESTEP))
    return np.array(qpos), np.array(xpos)


def welded():
    """Return the text of the model with the idle rail, at its keyframe `moved`, without the rail and the table's joint."""
    text = (MODELS / "idle_rail.xml").read_text()
    x, _, z = 0.7 * np.array([1.0, 0.0, 0.2]) / np.sqrt(1.04)
    text = text.replace('<body name="cart">', f'<body name="cart" pos="{x:.17g} 0 {z:.17g}">')
    turn = f'quat="{np.cos(-0.3):.17g} 0 {np.sin(-0.3):.17g} 0"'
    text = text.replace('<body name="table" pos="0 0 .1">', f'<body name="table" pos="0 0 .1" {turn}>')
    return re.sub('<joint name="(rail|table)".*?/>|<keyframe>.*</keyframe>', "", text)


# Held -------------------------------------------------------------------------------------------


def test_a_gripper_that_a_control_of_255_holds_open_does_what_it_does_in_the_authors_model():
    prepared, done = run("tendon_gripper")
    assert_array_equal(prepared.held[0], [255.0])
    qpos, _ = plain_loop(prepared, done, {"grip": 255.0})
    assert_allclose(done["qpos"], qpos, atol=ROUNDING)
    assert_allclose(done["qpos"][:, 2:], 0.04, atol=1e-6)
    # the control of 0, which it had before, shuts it
    shut, _ = plain_loop(prepared, done, {"grip": 0.0})
    assert np.abs(shut[-1, 2:] - 0.04).max() > 0.02


@pytest.mark.parametrize("kind", ["servo", "torque"])
def test_a_second_arm_holds_its_posture_as_its_own_actuators_do(kind):
    prepared, done = run("two_arms", kind, friction_compensation=False)
    # gear 2 at -0.5 rad: length -1; 100 ctrl + 3 + 100 = 0. The integrator's activation is its length, 1.2 rad.
    assert_allclose(prepared.held[0], [-1.03, 0.0])
    assert_allclose(prepared.held[1], [1.2])
    if kind == "servo":
        qpos, _ = plain_loop(prepared, done, {"r1": -1.03}, act=[1.2])
        assert_allclose(done["qpos"], qpos, atol=ROUNDING)
        zero, _ = plain_loop(prepared, done, {})
        assert np.abs(zero[-1, 2:4] - zero[0, 2:4]).max() > 0.3
    # its own weight makes it sag by less than weight · arm / stiffness
    assert np.abs(done["qpos"][:, 2:4] - done["qpos"][0, 2:4]).max() < 0.03


HELD = {
    '<position joint="o" kp="20" timeconst="0.1"/>': (0.8, 0.8),
    '<general joint="o" biastype="affine" dyntype="integrator" gainprm="4" biasprm="0 -8 0" actlimited="true" actrange="-1 1"/>': (0.0, 1.0),
    '<position joint="o" kp="20" delay="0.1" nsample="60"/>': (0.8, None),
    '<motor joint="o"/>': (0.0, None),
}  # fmt: skip


@pytest.mark.parametrize("actuator", HELD)
def test_an_actuator_gets_what_holds_its_joint_and_a_joint_that_none_holds_is_locked(tmp_path, actuator):
    control, activation = HELD[actuator]
    path = tmp_path / "model.xml"
    path.write_text(f"""<mujoco><worldbody><body><joint name="j" axis="0 1 0"/><geom size=".1" pos=".2 0 0"/>
    <site name="tip" pos=".4 0 0"/></body><body pos="0 1 0"><joint name="o" axis="0 0 1" damping="2"/>
    <geom size=".1" pos=".2 0 0"/></body></worldbody><actuator>{actuator}</actuator>
    <keyframe><key name="home" qpos="0.1 0.8"/></keyframe></mujoco>""")
    arm = arms.load(path, "tip")
    ctrl, act = arm.held("home", arm.configuration("home"))
    assert_allclose(ctrl, [control])
    assert_allclose(act, [] if activation is None else [activation])
    is_held = control != 0.0 or activation is not None
    assert arm.others.locked == (frozenset() if is_held else {1})
    if is_held and "range" not in actuator:  # a model of its own: MuJoCo sees no force at the start
        data = mujoco.MjData(arm.model)
        data.qpos[:], data.ctrl[:] = arm.configuration("home"), ctrl
        data.act[:] = act
        if arm.model.nhistory:
            mujoco.mj_initCtrlHistory(arm.model, data, 0, None, np.full(60, control))
        mujoco.mj_forward(arm.model, data)
        assert_allclose(data.qfrc_actuator, 0.0, atol=1e-12)
    done = run(path, site="tip", joints=("j",), seconds=0.3)[1] if "range" not in actuator else None
    if done is not None:  # gravity has no lever on a vertical axis
        assert_allclose(done["qpos"][:, 1], 0.8, atol=1e-9)


# Locked -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "floats"), [("servo", True), ("torque", False)])
def test_an_arm_on_locked_joints_moves_as_on_none(tmp_path, kind, floats):
    about = {"gravity_compensation": floats, "start": "moved"} | ({"kv": 300.0} if kind == "servo" else {})
    prepared, done = run("idle_rail", kind, **about)
    path = tmp_path / "welded.xml"
    path.write_text(welded())
    _, alone = run(path, kind, site="hand", joints=LINKS, **about | {"start": (0.4, 0.8)})
    for name in ("q", "tau", "pose"):
        assert_allclose(done[name], alone[name], atol=1e-9, err_msg=name)
    assert_allclose(done["qpos"][:, :2], [[0.7, -0.6]] * len(done), atol=1e-12)
    # what is not locked does move
    if kind == "servo":
        _, loose = run("idle_rail", kind, others="free", **about)
        assert np.abs(loose["qpos"][-1, :2] - [0.7, -0.6]).max() > 0.01


@pytest.mark.parametrize("kind", ["servo", "torque"])
def test_limits_springs_equalities_and_contacts_do_not_move_what_is_locked(kind):
    prepared, done = run("loose_gripper", kind)
    model = prepared.arm.model
    locked = {model.joint(j).name for j in prepared.arm.others.locked}
    assert locked == {"left", "right", "thumb", "flag"}
    wheel = model.joint("wheel").qposadr[0]
    still = [a for a in prepared.arm.others.addresses if a != wheel]
    assert_allclose(done["qpos"][:, still], np.tile(prepared.qpos[still], (len(done), 1)), atol=1e-12)
    # the wheel follows the elbow as the author's equality has it
    assert np.ptp(done["qpos"][:, wheel]) > 0.05
    assert_allclose(done["qpos"][-1, wheel], 2.0 * done["q"][-1, 1], atol=0.01)
    _, loose = run("loose_gripper", kind, others="free")
    assert np.abs(loose["qpos"][-1, still] - prepared.qpos[still]).max() > 0.01


def test_passive_joints_of_a_closed_loop_with_a_driven_one_are_free(tmp_path):
    """A four-bar gripper: one joint has an actuator, a connect closes the loop over two that have none."""
    body = (
        '<body name="{0}" pos="{1}"><joint name="{0}" axis="0 1 0"/><geom size=".02" pos=".1 0 0"/>{2}</body>'
    )
    bar = body.format("bar", ".1 0 0", "")
    text = f"""<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/><geom size=".1"/>
    <site name="tip" pos=".2 0 0"/>{body.format("crank", "0 0 0", bar)}{body.format("rocker", ".2 0 .1", "")}
    {body.format("lid", "0 0 .3", "")}</body></worldbody>
    <equality><connect body1="bar" body2="rocker" anchor=".1 0 0"/></equality>{{}}</mujoco>"""
    path, drive = tmp_path / "model.xml", '<actuator><position joint="crank" kp="10"/></actuator>'
    for actuators, locked in ((drive, {"lid"}), ("", {"crank", "bar", "rocker", "lid"})):
        path.write_text(text.format(actuators))
        arm = arms.load(path, "tip")
        assert {arm.model.joint(j).name for j in arm.others.locked} == locked


# One configuration for all ----------------------------------------------------------------------


def test_an_arm_that_stands_elsewhere_has_the_kinematics_and_statics_of_there():
    home = arms.load(MODELS / "idle_rail.xml", "hand", LINKS)
    there = home.at(home.configuration("moved"))
    q, model = np.array([0.2, 0.9]), home.model
    data = mujoco.MjData(model)
    data.qpos[:] = [0.7, -0.6, *q]
    mujoco.mj_forward(model, data)
    assert_allclose(there.pose(q)[:3], data.site("hand").xpos, atol=1e-12)
    assert_allclose(there.rest_torques(q)[0], data.qfrc_bias[2:], atol=1e-12)
    full = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, full[:3], full[3:], model.site("hand").id)
    assert_allclose(there.jacobian(q), full[:, 2:], atol=1e-12)
    data.qpos[:] = [0.7, -0.6, 0.0, 0.0]
    mujoco.mj_kinematics(model, data)
    assert_allclose(np.cumsum(there.chain.step, axis=0), data.xanchor[2:], atol=1e-12)
    # negative control: at home these differ
    assert np.abs(home.pose(q) - there.pose(q)).max() > 0.5
    assert home.at(home.configuration("home")) is home


# Added actuators --------------------------------------------------------------------------------


def test_what_a_default_says_of_actuators_is_not_said_of_those_that_are_added(tmp_path):
    text = (MODELS / "hostile_default.xml").read_text()
    path = tmp_path / "mild.xml"
    path.write_text(re.sub("<default>.*</default>", "", text, flags=re.DOTALL))
    _, hostile = run("hostile_default")
    _, mild = run(path, site="hand", joints=LINKS)
    for name in hostile.columns:
        assert_array_equal(hostile[name], mild[name], err_msg=name)
    assert np.abs(hostile["qdot_cmd"]).max() > 0.1  # which its ctrlrange would clamp


# What motion capture places -----------------------------------------------------------------------

CARRIED = """<mujoco><compiler angle="radian"/><worldbody>
 <body name="cart" mocap="true" pos="0.1 0 0.5"><body name="upper"><joint name="shoulder" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.03"/><body name="lower" pos="0.5 0 0">
   <joint name="elbow" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/>
   <site name="tip" pos="0.4 0 0"/></body></body></body>
 <body name="wall" mocap="true" pos="3 0 0"><geom type="box" size="0.05 0.5 0.5"/></body></worldbody>
<keyframe><key name="home" qpos="-0.5 1.2"/>
 <key name="moved" qpos="-0.5 1.2" mpos="0.3 -0.2 0.6  3 0 0" mquat="0.8 0 0 0.6  1 0 0 0" qvel="0.1 0"/>
</keyframe></mujoco>"""


@pytest.mark.parametrize(("start", "kind"), [("home", "servo"), ("moved", "ideal"), ("moved", "torque")])
def test_bodies_of_motion_capture_start_where_the_keyframe_has_them(tmp_path, start, kind):
    path = tmp_path / "carried.xml"
    path.write_text(CARRIED)
    prepared, done = run(path, kind, start, site="tip", joints=LINKS)
    model = mujoco.MjModel.from_xml_string(CARRIED)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(start).id)
    mujoco.mj_kinematics(model, data)
    poses, _ = prepared.arm.frames(done["qpos"][:1])
    assert_allclose(poses[0, :, :3], data.xpos, rtol=0, atol=1e-12)
    # of the physics, of the law's chain and of the path
    assert_allclose(done["pose"][0, :3], data.site("tip").xpos, rtol=0, atol=1e-12)
    assert_allclose(done["pose_ref"][0, :3], data.site("tip").xpos, rtol=0, atol=1e-12)
    assert np.abs(done["pose_error"][:, [0, 2]]).max() < 1e-3
    (rest,) = [one for one in ("home", "moved") if one != start]
    mujoco.mj_resetDataKeyframe(model, data, model.key(rest).id)
    mujoco.mj_kinematics(model, data)
    assert np.abs(done["pose"][0, :3] - data.site("tip").xpos).max() > 0.1
