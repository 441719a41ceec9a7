"""The base of an arm is where the data have it, whatever carries it: MuJoCo's own frames and Jacobians say so."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from law.test_controller import own_loop
from rmrc.law.controller import Controller
from rmrc.scenario import Scenario
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.spatial import pose_inverse, pose_product

JOINTS = ("a", "b", "c")
START = np.array([-0.6, 1.4, -0.5])
ARM = """<body name="A" pos="0 .2 .2"><joint name="a" axis="0 0 1" range="-2.5 2.5"/><geom size=".03 .15" type="capsule"/>
<body name="B" pos=".3 0 0"><joint name="b" axis="0 0 1" range="-2.5 2.5"/><geom size=".03 .1" type="capsule"/>
<site name="elbow" pos=".1 0 0"/>
<body name="C" pos=".3 0 0"><joint name="c" axis="0 0 1" range="-2.5 2.5"/><geom size=".02 .05" type="capsule"/>
<site name="tip" pos=".1 0 .05" euler=".3 0 0"/></body></body></body>"""
BASES = {
    "hinge": '<joint name="waist" axis=".2 0 1"/>',
    "free": '<freejoint name="root"/>',
    "mocap": "",
}


def text(base):
    is_mocap = base == "mocap"
    inertia = "" if is_mocap else '<inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/>'
    return (
        f'<mujoco model="scene"><compiler angle="radian"/><worldbody><body name="torso" pos="0 0 .4" '
        f'mocap="{str(is_mocap).lower()}">{BASES[base]}{inertia}{ARM}</body></worldbody></mujoco>'
    )


def scene(base):
    return mujoco.MjModel.from_xml_string(text(base))


def controller(model, **options):
    law = {
        "feedback": 4.0,
        "inverse": {"method": "pseudoinverse"},
        "limits": {"rate": None, "on_excess": "none"},
    }
    about = {
        "site": "tip",
        "joints": JOINTS,
        "task": {"axes": ["x", "y", "rz"], "frame": "base"},
        "control": law,
    }
    return Controller(model, period=0.01, **(about | options))


def place(data, rng):
    """Move everything that is no joint of the arm."""
    model = data.model
    mujoco.mj_integratePos(model, data.qpos, rng.normal(size=model.nv), 1.0)
    data.qpos[[model.joint(name).qposadr[0] for name in JOINTS]] = START + rng.uniform(-0.2, 0.2, 3)
    if model.nmocap:
        data.mocap_pos[:] = rng.normal(size=(model.nmocap, 3))
        data.mocap_quat[:] = Rotation.random(model.nmocap, random_state=rng).as_quat(scalar_first=True)
    mujoco.mj_fwdPosition(model, data)


def pose_of(position, matrix):
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ravel(matrix))
    return np.r_[position, quat]


def jacobian(data):
    model = data.model
    full = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, full[:3], full[3:], model.site("tip").id)
    return full[:, [model.joint(name).dofadr[0] for name in JOINTS]]


@pytest.mark.parametrize("base", BASES)
def test_a_frame_of_the_base_is_where_the_data_have_it(base):
    model, rng = scene(base), np.random.default_rng(1)
    c, data = controller(model), mujoco.MjData(model)
    for _ in range(5):
        place(data, rng)
        torso, site = data.body("torso"), data.site("tip")
        R, twist = torso.xmat.reshape(3, 3), rng.normal(size=6)
        moved = jacobian(data) @ c.step_data(data, twist=twist, frame="base").qdot_cmd
        assert_allclose((R.T @ moved.reshape(2, 3).T).T.ravel()[[0, 1, 5]], twist[[0, 1, 5]], atol=1e-9)
        own = pose_product(pose_inverse(pose_of(torso.xpos, R)), pose_of(site.xpos, site.xmat))
        assert_allclose(c.step_data(data, pose=own, frame="base").pose_error, 0.0, atol=1e-12)
        shift = np.array([0.01, -0.02, 0.03])
        out = c.step_data(data, pose=np.r_[own[:3] + shift, own[3:]], frame="base")
        assert_allclose(out.pose_error, np.r_[shift, 0, 0, 0], atol=1e-12)
        # the arm's own functions see the same
        assert_allclose(c.arm.pose(data)[:3], site.xpos, atol=1e-12)
        assert_allclose(np.abs(c.arm.pose(data)[3:] @ pose_of(site.xpos, site.xmat)[3:]), 1.0, atol=1e-12)
        assert_allclose(c.arm.jacobian(data), jacobian(data), atol=1e-12)


def test_without_data_the_base_stands_where_the_model_has_it():
    """Also after data; and where a joint moves the base, a step without data is refused."""
    model = scene("mocap")
    c, data = controller(model), mujoco.MjData(model)
    place(data, np.random.default_rng(3))
    q = data.qpos.copy()
    before = c.step(q, twist=[0.1, 0, 0, 0, 0, 0], frame="base").copy()
    c.step_data(data)
    c.reset()
    after = c.step(q, twist=[0.1, 0, 0, 0, 0, 0], frame="base")
    assert_array_equal(after.qdot_cmd, before.qdot_cmd)
    assert_allclose(after.pose, c.arm.pose(q), atol=1e-12)
    floating = controller(scene("free")).step(START)
    assert floating.status & Status.INVALID_INPUT
    assert floating.problem == 'joint "root" moves the site and is not actuated: step_data reads its position'


def test_a_run_and_a_loop_of_its_own_agree_about_a_base_that_turns(tmp_path):
    """The arm turns a waist that nothing holds; the rows of the task are those of the base."""
    path = tmp_path / "model.xml"
    mujoco.mj_saveLastXML(str(path), scene("hinge"))
    about = {
        "name": "turning", "arm": {"model": path, "site": "tip", "joints": JOINTS, "start": START.tolist(), "others": "free"},
        "task": {"axes": ["x", "y"], "frame": "base"}, "control": {"period": 0.004, "feedback": 5.0},
        "target": {"path": [{"line": {"by": [0.1, -0.2, 0.0]}}]}, "plant": {"kind": "servo"},
    }  # fmt: skip
    prepared = prepare(Scenario.model_validate(about))
    (done,) = Simulation([prepared]).run()
    assert np.ptp(done["qpos"][:, 0]) > 0.01
    assert_allclose(own_loop(prepared, len(done)), done["qdot_cmd"], rtol=0, atol=1e-12)
