"""Damping and dry friction of joints, and what the drives give for them; joints beside the arm that give way."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from physics import moved
from project import ROOT
from rmrc.arm import load

# One joint without gravity: what it does at a constant rate is told by the balance of its torques alone.
WHEEL = """<mujoco><worldbody><body name="wheel"><joint name="j" axis="0 0 1" {joint}/>
<geom type="box" size=".1 .1 .1" mass="3"/><site name="tip" pos=".2 0 0"/></body></worldbody>{tail}</mujoco>"""
DAMPED, DRY, DRAG = 'damping="2"', 'frictionloss="0.5"', 'damping="2 0.4 0.3"'
FLAG = '<mujoco><option><flag contact="disable"/></option>'
TURN, PERIOD = 0.4, 0.001


def turning(path, kind, compensates=True, arm=None, **plant):
    """Return an arm that goes round with its hand and stops, and what it did."""
    return moved(
        path, kind, ({"turn": {"axis": "z", "angle": 0.5}}, {"hold": {"for": 0.2}}), arm=arm, axes=("rz",),
        control={"feedback": 20.0, "inverse": {"method": "pseudoinverse"}, "limits": {"on_excess": "none", "position": False}},
        limits={"angular_velocity": TURN, "angular_acceleration": 2.0, "angular_jerk": 20.0},
        friction_compensation=compensates, **plant,
    )  # fmt: skip


@pytest.fixture
def wheel(tmp_path):
    """Return a function: attributes of the joint -> file of the model."""

    def write(joint, tail=""):
        path = tmp_path / "wheel.xml"
        path.write_text(WHEEL.format(joint=joint, tail=tail))
        return path

    return write


@pytest.mark.parametrize(
    ("kind", "joint"), [("servo", DAMPED), ("torque", DRY), ("servo", DRAG), ("torque", f"{DRAG} {DRY}")]
)
def test_the_torque_at_a_constant_rate_is_what_resists_it_and_the_rate_is_kept(wheel, kind, joint):
    """damping · q̇ + loss: the numbers of the file, far beyond the rate at which dry friction still creeps."""
    _, done = turning(wheel(joint), kind)
    middle = np.abs(done["qdot"][:, 0] - TURN) < 1e-6
    assert middle.sum() > 200
    given = {DAMPED: 2.0 * TURN, DRY: 0.0, DRAG: 2.0 * TURN + 0.4 * TURN**2 + 0.3 * TURN**3}
    damping = next(torque for name, torque in given.items() if joint.startswith(name))
    assert_allclose(done["tau"][middle, 0][1:], damping + 0.5 * (DRY in joint), atol=1e-4)
    # what the joint lacks of its rate at any tick is what a free one lacks, but for dry friction at rest
    _, free = turning(wheel(""), kind)
    lag = [np.abs(one["pose_error"][:, 5]).max() for one in (done, free)]
    assert lag[0] < (2.0 if DRY in joint else 1.01) * lag[1] + 1e-5


def test_servos_take_a_step_with_damping_as_one_without():
    """kv = M/h + d by (26): M + h d is the inertia that an implicit step of h feels."""
    arm = load(ROOT / "models/xarm7.xml", "tool")
    data = mujoco.MjData(arm.model)
    data.qpos[:] = arm.configuration("home")
    mujoco.mj_fwdPosition(arm.model, data)
    M = np.zeros((arm.model.nv,) * 2)
    mujoco.mj_fullM(arm.model, data, M)
    start = (0.0, -0.3, 0.0, 1.2, 0.0, 1.5, 0.0)
    prepared, _ = turning(arm.path, "servo", arm={"site": "tool", "start": start})
    assert_allclose(prepared.plant.kv, np.diag(M) / 0.001 + [10, 10, 5, 5, 5, 2, 2], rtol=1e-12)


def test_computed_torque_beside_joints_that_give_way_gives_the_acceleration_that_it_wants(tmp_path):
    """The rail and the turntable are pushed by the arm and move, and the arm moves as if they were at rest."""
    text = (ROOT / "tests/models/idle_rail.xml").read_text()
    path = tmp_path / "rail.xml"
    path.write_text(text.replace('name="rail"', 'name="rail" damping="3"').replace("<mujoco>", FLAG))
    arm = {"site": "hand", "joints": ("shoulder", "elbow"), "others": "free"}
    move, without = ({"line": {"by": (0.03, 0.0, -0.03)}},), {"feedback": 0.0}
    prepared, done = moved(path, "torque", move, arm=arm, control=without, gravity_compensation=False)
    assert done.is_complete
    sent, qdot = done["qdot_cmd"], done["qdot"]
    before = np.vstack([np.zeros(2), sent[:-1]])
    wanted = sent - before + PERIOD * prepared.plant.bandwidth * (sent - qdot)
    assert_allclose(np.diff(qdot, axis=0), wanted[:-1], rtol=0, atol=1e-9)
    others = np.ptp(np.delete(done["qpos"], prepared.arm.wiring.qpos, axis=1), axis=0)
    assert others.min() > 0.01  # or there was nothing to feel


@pytest.mark.parametrize(("joint", "timestep"), [(DAMPED, PERIOD), (DAMPED, PERIOD / 4), (DRAG, PERIOD)])
def test_computed_torque_of_a_damped_joint_gives_the_acceleration_that_it_wants(wheel, joint, timestep):
    """MuJoCo's implicit steps resist a change by the slope of damping times the step, a tenth of the inertia here."""
    prepared, done = turning(wheel(joint), "torque", timestep=timestep)
    sent, qdot = done["qdot_cmd"], done["qdot"]
    before = np.vstack([np.zeros(1), sent[:-1]])
    wanted = sent - before + PERIOD * prepared.plant.bandwidth * (sent - qdot)
    assert np.abs(wanted).max() > 1e-4
    assert_allclose(np.diff(qdot, axis=0), wanted[:-1], rtol=0, atol=1e-9)
