"""A Controller takes positions in each form that a user has: of the arm, of all joints, or as MuJoCo's data."""

import re

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from project import ROOT
from rmrc.law.controller import Controller
from rmrc.scenario.choices import Status
from rmrc.support.errors import ModelError, QuestionError

ARMS = sorted(path.stem for path in ROOT.glob("models/*.xml") if "<actuator>" in path.read_text("utf-8"))
LOOP = re.search(
    r"^```python\n(.*?)^```$", (ROOT / "docs/python.md").read_text("utf-8"), re.MULTILINE | re.DOTALL
)[1]

pytestmark = [
    pytest.mark.filterwarnings("ignore:Attaching a spec with an empty prefix"),
    pytest.mark.filterwarnings("ignore:.*rate servos take less"),
]


def with_cube(name, is_first):
    """Return a shipped model in a scene with a free cube before or behind it, and its keyframe."""
    scene = mujoco.MjSpec()

    def add_cube():
        cube = scene.worldbody.add_body(name="cube", pos=[1.5, 1.2, 0.05])
        cube.add_freejoint()
        cube.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.03, 0.03, 0.03], mass=0.1)

    if is_first:
        add_cube()
    attach(scene, name)
    if not is_first:
        add_cube()
    model = scene.compile()
    assert (model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE) == is_first
    return model


def attach(scene, name, **place):
    arm = mujoco.MjSpec.from_file(str(ROOT / f"models/{name}.xml"))
    scene.option.timestep, scene.option.integrator = arm.option.timestep, arm.option.integrator
    scene.attach(arm, prefix="", frame=scene.worldbody.add_frame(**place))


@pytest.mark.parametrize("name", ARMS)
def test_the_documented_loop_runs_on_each_shipped_arm(name, monkeypatch):
    """Position servos bring it there but for gravity's droop between two ticks; rate servos sag by 2 cm."""
    model, names = mujoco.MjModel.from_xml_path(str(ROOT / f"models/{name}.xml")), {}
    monkeypatch.setattr(mujoco.MjModel, "from_xml_path", lambda _: model)
    exec(LOOP.replace("print(", "print_ = ("), names)
    c, out, data = names["c"], names["out"], names["data"]
    rows = [row for row in c.task.rows if row < 3]
    home = mujoco.MjData(model)
    home.qpos[:] = model.key("home").qpos
    mujoco.mj_fwdPosition(model, home)
    goal = home.site(c.arm.site).xpos - [0, 0, 0.1]
    near = 0.003 if model.actuator_biasprm[c.arm.wiring.actuator, 1].all() else 0.02
    assert np.abs(data.site(c.arm.site).xpos - goal)[rows].max(initial=0.0) < near
    assert not out.status & (Status.INVALID_INPUT | Status.STUCK | Status.STOPPED)


@pytest.mark.parametrize("is_first", [True, False])
def test_all_forms_of_positions_mean_the_same(is_first):
    model = with_cube("fr3", is_first)
    c, data = Controller(model, "tool"), mujoco.MjData(model)
    data.qpos[:] = model.key("home").qpos
    own = data.qpos[[model.joint(name).qposadr[0] for name in c.joints]] + 0.1
    data.qpos[[model.joint(name).qposadr[0] for name in c.joints]] = own
    mujoco.mj_fwdPosition(model, data)
    full = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, full[:3], full[3:], model.site("tool").id)
    J = full[:, [model.joint(name).dofadr[0] for name in c.joints]]
    for q in (own, own.tolist(), data.qpos, data.qpos.tolist(), data):
        c.reset(q)
        assert_array_equal(c.command.q_cmd, own)
        assert_allclose(c.arm.pose(q)[:3], data.site("tool").xpos, atol=1e-12)
        assert_allclose(c.arm.jacobian(q), J, atol=1e-12)
        assert_array_equal(c.arm.configuration(q), data.qpos)
    for q in ([own, own], [data.qpos, data.qpos], [data, data]):
        c.reset(q)
        assert_array_equal(c.command.q_cmd, [own, own])


def test_a_scene_that_is_not_the_arms_own_model_is_read_by_names():
    """The arm is of a file, the data of a scene that mounts it elsewhere; qpos of the scene alone says too little."""
    scene = mujoco.MjSpec()
    cube = scene.worldbody.add_body(name="cube", pos=[2, 0, 0.5])
    cube.add_freejoint()
    cube.add_geom(size=[0.05, 0.05, 0.05])
    attach(scene, "ur5e", pos=[0.3, -0.2, 0.5], euler=[0.0, 0.0, 40.0])
    model = scene.compile()
    c, data = Controller("ur5e"), mujoco.MjData(model)
    data.qpos[:] = model.key("home").qpos
    mujoco.mj_fwdPosition(model, data)
    c.reset(data)
    assert_array_equal(c.command.q_cmd, data.qpos[7:])
    assert_allclose(c.arm.pose(data)[:3], data.site("tool").xpos, atol=1e-12)
    assert_allclose(c.step_data(data).pose[:3], data.site("tool").xpos, atol=1e-12)
    assert np.abs(c.arm.pose(data.qpos[7:])[:3] - data.site("tool").xpos).max() > 0.1  # where the file has it
    says = r"q must be \(6,\), or mujoco.MjData of a model with the arm"
    for call in (c.reset, c.arm.pose, c.arm.jacobian, c.arm.configuration):
        with pytest.raises(QuestionError, match=says):
            call(data.qpos)
        with pytest.raises(ModelError, match=r"the model of the data lacks a part of .*ur5e"):
            call(mujoco.MjData(mujoco.MjModel.from_xml_path(str(ROOT / "models/stanford.xml"))))
    for bad in ([[1], [2, 3]], 6 * ["a"], np.full(6, np.nan)):
        with pytest.raises(QuestionError, match=r"q must be (numbers|finite)"):
            c.arm.pose(bad)
