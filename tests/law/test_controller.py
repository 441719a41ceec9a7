"""The law in a loop of one's own: the same rates as a run, nothing raised, nothing kept."""

import math
import tracemalloc

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from project import ROOT
from rmrc.arm import load as load_arm
from rmrc.law.controller import Controller
from rmrc.law.law import Law
from rmrc.law.task import choose
from rmrc.scenario import ControlSection, LimitsSection, NullspaceSection, SecondarySection, load
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ModelError

# Servos whose encoders are right, without wrench, payload or screw: all of the loop is here.
SERVOS = ["approach_singularity", "slow_wrist", "algorithmic_singularity"]
MORE_SERVOS = [
    "at_the_stop", "beyond_reach", "blow_up", "full_reach", "joint_limit", "line_tracking", "more_rows_than_joints",
    "null_space", "only_some_velocities", "posture_sweep", "stanford_line", "stanford_wrist", "stanford_wrist_close",
    "stop_and_wait",
]  # fmt: skip


def reference_at(reference, path_tick):
    """Return pose and twist at a tick of the path, between two of them as theory.md has it, but in Python's floats."""
    before = int(path_tick)
    part = path_tick - before
    pose, twist = reference.pose[before].tolist(), reference.twist[before].tolist()
    if part == 0.0:
        return pose, twist
    end, end_twist = reference.pose[before + 1].tolist(), reference.twist[before + 1].tolist()
    turned = 1.0 if pose[3] * end[3] + pose[4] * end[4] + pose[5] * end[5] + pose[6] * end[6] >= 0.0 else -1.0
    end[3:] = [turned * value for value in end[3:]]
    pose = [a + part * (b - a) for a, b in zip(pose, end, strict=True)]
    norm = math.sqrt(sum(value * value for value in pose[3:]))
    pose[3:] = [value / norm for value in pose[3:]]
    return pose, [a + part * (b - a) for a, b in zip(twist, end_twist, strict=True)]


def own_loop(prepared, count, attached=True, law=None):
    """Return the commands of a loop as a user writes it: one's own MjData, `mj_step`, a reference."""
    arm, reference = prepared.arm, prepared.reference
    model = prepared.plant.model([prepared.plant])
    data, wiring = mujoco.MjData(model), arm.wire(model)
    data.qpos[:] = prepared.qpos
    mujoco.mj_forward(model, data)
    controller = Controller(law or prepared.law, data if attached else None)
    rates, path_tick = np.empty((count, arm.n)), 0.0
    for t in range(count):
        pose, twist = reference_at(reference, path_tick)
        command = controller.step(data.qpos[wiring.qpos], data.qvel[wiring.dof], pose, twist)
        rates[t] = data.ctrl[wiring.actuator] = command.qdot
        path_tick = min(path_tick + command.path_rate, reference.ticks - 1.0)
        for _ in range(prepared.plant.substeps):
            mujoco.mj_step(model, data)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
    return rates


def ran(name):
    prepared = prepare(load(ROOT / f"scenarios/{name}.yaml", ["plant.kind=servo"]))
    return prepared, Simulation([prepared]).run()[0]


@pytest.mark.parametrize(
    "name", [*SERVOS, *(pytest.param(one, marks=pytest.mark.long) for one in MORE_SERVOS)]
)
def test_an_own_loop_gives_the_bits_of_a_run(name):
    prepared, run = ran(name)
    assert_array_equal(own_loop(prepared, len(run)), run["qdot_cmd"])


def test_another_law_gives_other_bits():
    prepared, run = ran("approach_singularity")
    control = prepared.scenario.control
    other = Law(
        prepared.task,
        control.model_copy(update={"feedback": control.feedback * (1 + 1e-15)}),
        prepared.law.posture,
    )
    assert (own_loop(prepared, len(run), law=other) != run["qdot_cmd"]).any()


@pytest.mark.parametrize("name", ["approach_singularity", "stanford_wrist"])
def test_the_arms_own_chain_gives_the_same_but_for_rounding(name):
    prepared, run = ran(name)
    chain = own_loop(prepared, len(run), attached=False)
    assert_allclose(chain, run["qdot_cmd"], rtol=0, atol=3e-12)
    assert (chain != run["qdot_cmd"]).any()  # they are two ways


def test_where_encoders_are_off_the_chain_sees_what_the_law_of_a_run_sees():
    prepared, run = ran("encoder_offsets")
    controller = Controller(prepared.law)
    for t in range(len(run)):
        q = run["q"][t] + prepared.encoder_offset
        command = controller.step(q, run["qdot"][t], run["pose_ref"][t], run["twist_ref"][t])
        assert_array_equal(command.qdot, run["qdot_cmd"][t])
        assert_array_equal(command.sigma, run["sigma"][t])
        assert command.status == run["status"][t] and command.damping == run["damping"][t]


# One arm ----------------------------------------------------------------------------------------

ARM = load_arm(ROOT / "models/planar_3link.xml")
START = np.array([0.3, 0.5, 0.4])


def controller(data=None, arm=ARM, **control):
    return Controller(Law(choose(arm, ["x", "y"]), ControlSection(**control), START), data)


def ahead(arm=ARM):
    pose = arm.pose(START)
    pose[0] += 0.01
    return pose, np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_a_step_keeps_nothing():
    one, (pose, twist), rates = controller(), ahead(), np.zeros(3)
    for _ in range(100):
        one.step(START, rates, pose, twist)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(10_000):
            one.step(START, rates, pose, twist)
        grown, peak = (size - before for size in tracemalloc.get_traced_memory())
        kept = [np.array(one.step(START, rates, pose, twist).qdot) for _ in range(100)]
        control = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 1000 and peak < 5000
    assert control > 100 * 24 and len(kept) == 100  # negative control: what a caller keeps is seen


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e11])
@pytest.mark.parametrize("what", range(4))
def test_what_is_not_finite_brakes(what, bad):
    one, (pose, twist) = controller(limits=LimitsSection(braking=2.0)), ahead()
    given = [START, np.zeros(3), pose, twist]
    last = one.step(*given).qdot.copy()
    wrong = [value.copy() for value in given]
    wrong[what][1] = bad
    for k in range(1, 400):
        command = one.step(*wrong)
        # a deceleration of 2 for so many milliseconds
        assert_allclose(command.qdot, np.sign(last) * np.maximum(0, np.abs(last) - 2e-3 * k), atol=1e-12)
        assert command.status == Status.STOPPED and command.path_rate == 0.0
        assert np.isnan(command.sigma).all() and np.isnan(command.damping)
    assert not command.qdot.any()
    again = one.step(*given)
    assert_allclose(again.qdot, last, rtol=1e-12) and not again.status & Status.STOPPED


def test_a_controller_that_forgets_begins_anew():
    one, (pose, twist) = controller(limits=LimitsSection(acceleration=3.0)), ahead()
    first = [one.step(START + 1e-3 * t, np.zeros(3), pose, twist).qdot.copy() for t in range(50)]
    more = one.step(START, np.zeros(3), pose, twist).qdot.copy()
    one.reset()
    assert_array_equal(
        [one.step(START + 1e-3 * t, np.zeros(3), pose, twist).qdot for t in range(50)][-1], first[-1]
    )
    one.reset()
    assert (one.step(START, np.zeros(3), pose, twist).qdot != more).any()


def test_a_command_is_overwritten_by_the_next():
    one, (pose, twist) = controller(), ahead()
    command = one.step(START, np.zeros(3), pose, twist)
    before = command.qdot.copy()
    assert one.step(START, np.zeros(3), pose, -twist) is command is one.command
    assert (command.qdot != before).all()
    assert command.pose_error[:2] == pytest.approx([0.01, 0.0])


SECONDARY = NullspaceSection(objective="secondary", secondary=SecondarySection(site="wrist", axes=("x",)))


def test_kinematics_that_are_not_known_are_refused():
    with pytest.raises(ModelError, match='do not say where site "wrist" is; give MuJoCo\'s data'):
        controller(nullspace=SECONDARY)
    partly = load_arm(ARM.path, joints=ARM.joints[:2])
    with pytest.raises(ModelError, match=f'where joint "{ARM.joints[2]}", which is not driven, is'):
        Controller(Law(choose(partly, ["x", "y"]), ControlSection(), START[:2]))
    other = mujoco.MjModel.from_xml_path(str(ROOT / "models/stanford.xml"))
    with pytest.raises(ModelError, match=r"the model of the data lacks a part of .*planar_3link\.xml"):
        controller(mujoco.MjData(other))


def test_an_arm_is_found_in_another_model(tmp_path):
    """Sites and joints have other numbers there: before the arm there is a thing with both."""
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    thing = f'<body><joint name="thing"/>{inertia}<site name="thing"/></body>'
    text = ARM.path.read_text("utf-8").replace("<worldbody>", f"<worldbody>{thing}")
    path = tmp_path / "scene.xml"
    path.write_text(text.replace('file="', f'file="{ARM.path.parent}/'), "utf-8")
    model = mujoco.MjModel.from_xml_path(str(path))
    data, own = mujoco.MjData(model), mujoco.MjData(ARM.model)
    wiring = ARM.wire(model)
    data.qpos[wiring.qpos] = own.qpos[ARM.wiring.qpos] = START
    for m, d in ((model, data), (ARM.model, own)):
        mujoco.mj_fwdPosition(m, d)
    pose, twist = ahead()
    there, here = (
        controller(d, nullspace=SECONDARY).step(START, np.zeros(3), pose, twist) for d in (data, own)
    )
    assert (wiring.site, *wiring.joint) != (ARM.wiring.site, *ARM.wiring.joint)
    assert_allclose(there.qdot, here.qdot, rtol=1e-12, atol=1e-12)


def test_a_controller_keeps_its_jerk_limit_when_it_brakes_for_lack_of_a_measurement():
    limits = LimitsSection(jerk=100.0, acceleration=3.0, braking=2.0)
    one, (pose, twist) = controller(limits=limits), ahead()
    given, blind = (START, np.zeros(3), pose, twist), (START * np.nan, np.zeros(3), pose, twist)
    rates = [one.step(*(given if t < 200 or t > 900 else blind)).qdot.copy() for t in range(1100)]
    assert not rates[900].any() and np.abs(rates[199]).max() > 0.1
    changes = np.diff(rates, axis=0, prepend=0.0)
    assert np.abs(changes).max() <= 3e-3 * (1 + 1e-9)
    assert np.abs(np.diff(changes, axis=0, prepend=0.0)).max() <= 100e-6 * (
        1 + 1e-9
    )  # rounding: 1e-16 / 1e-4
    one.reset()
    assert_array_equal([one.step(*given).qdot for _ in range(50)][-1], rates[49])
