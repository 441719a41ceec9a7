"""The law in a loop of one's own: the same rates as a run, nothing raised, nothing kept."""

import array
import copy
import math
import re
import tracemalloc

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from loops import controller_of
from project import ROOT
from rmrc.arm import load as load_arm
from rmrc.law.controller import Controller
from rmrc.scenario import load
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

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


def own_loop(prepared, count, attached=True, **control):
    """Return the commands of a loop as a user writes it: one's own MjData, `mj_step`, a reference."""
    arm, reference = prepared.arm, prepared.reference
    model = copy.copy(prepared.plant.model())
    for name, values in prepared.plant.difference(model, arm.wire(model)).items():
        getattr(model, name)[...] = values
    data, wiring = mujoco.MjData(model), arm.wire(model)
    data.qpos[:] = prepared.qpos
    mujoco.mj_forward(model, data)
    controller = controller_of(prepared, **control)
    rates, path_tick = np.empty((count, arm.n)), 0.0
    for t in range(count):
        pose, twist = reference_at(reference, path_tick)
        wanted = {"pose": np.array(pose), "twist": np.array(twist)}
        if attached:
            out = controller.step_data(data, **wanted)
        else:
            out = controller.step(data.qpos[wiring.qpos], data.qvel[wiring.dof], **wanted)
        rates[t] = data.ctrl[wiring.actuator] = out.qdot_cmd
        path_tick = min(path_tick + out.path_rate, reference.ticks - 1.0)
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
    feedback = prepared.scenario.control.feedback * (1 + 1e-15)
    assert (own_loop(prepared, len(run), feedback=feedback) != run["qdot_cmd"]).any()


@pytest.mark.parametrize("name", ["approach_singularity", "stanford_wrist"])
def test_the_arms_own_chain_gives_the_same_but_for_rounding(name):
    prepared, run = ran(name)
    chain = own_loop(prepared, len(run), attached=False)
    assert_allclose(chain, run["qdot_cmd"], rtol=0, atol=3e-12)
    assert (chain != run["qdot_cmd"]).any()  # they are two ways


def test_where_encoders_are_off_the_chain_sees_what_the_law_of_a_run_sees():
    prepared, run = ran("encoder_offsets")
    controller = controller_of(prepared)
    for t in range(min(len(run), 500)):
        q = run["q"][t] + prepared.hardware.encoders.offset
        out = controller.step(q, run["qdot"][t], pose=run["pose_ref"][t], twist=run["twist_ref"][t])
        assert_array_equal(out.qdot_cmd, run["qdot_cmd"][t])
        assert_array_equal(out.sigma, run["sigma"][t])
        assert_array_equal(out.qdot_plain, run["qdot_plain"][t])
        assert out.status == run["status"][t] and out.damping == run["damping"][t]


# One arm ----------------------------------------------------------------------------------------

ARM = load_arm(ROOT / "models/planar_3link.xml")
START = np.array([0.3, 0.5, 0.4])
REST = np.zeros(3)
PLANAR = {"axes": ["x", "y"]}


def controller(start=START, task=PLANAR, arm=ARM, **control):
    found = Controller(arm, control=control, task=task)
    found.reset(start)
    return found


def ahead(arm=ARM):
    pose = arm.pose(START)
    pose[0] += 0.01
    return {"pose": pose, "twist": np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])}


def seen(arm, q, model=None):
    """Return fresh data of an arm."""
    model = model or arm.model
    data = mujoco.MjData(model)
    data.qpos[arm.wire(model).qpos] = q
    mujoco.mj_fwdPosition(model, data)
    return data


def allocated(call, times):
    """Return by how much the memory of this process grows while something is called so often, and at most meanwhile."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(times):
            call()
        now, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    return now - before, peak - before


@pytest.mark.parametrize("way", ["chain", "data", "poses", "batch", "watched"])
def test_a_step_keeps_nothing(way):
    one, wanted, data = controller(), ahead(), seen(ARM, START)
    call = lambda: one.step(START, REST, **wanted)  # noqa: E731
    if way == "data":
        call = lambda: one.step_data(data, **wanted)  # noqa: E731
    elif way == "poses":
        T = np.eye(4)
        call = lambda: (one.step(START, pose=T, frame="site"), one.step(START, q_target=START))[0]  # noqa: E731
    elif way == "batch":
        one.reset(np.tile(START, (5, 1)))
        many = {name: np.tile(value, (5, 1)) for name, value in wanted.items()}
        starts = np.tile(START, (5, 1))
        call = lambda: one.step(starts, **many)  # noqa: E731
    elif way == "watched":
        one.watchdog = 1.0
    for _ in range(100):
        call()
    # What steps keep or take, they do each time; what something else in the tests' process does meanwhile, it does once.
    grown, peak = map(min, zip(*(allocated(call, 1000) for _ in range(3)), strict=True))
    assert grown < 1000 and peak < 5000
    # negative controls: what a caller keeps is seen, each time, and what a call takes for a while
    kept = []
    assert min(allocated(lambda: kept.append(np.array(call().qdot_cmd)), 100) for _ in range(3))[0] > 100 * 24
    assert min(allocated(lambda: np.zeros(1000), 100) for _ in range(3))[1] > 5000


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e11])
@pytest.mark.parametrize("what", ["q", "qdot", "pose", "twist"])
def test_what_is_not_finite_brakes(what, bad):
    one = controller(limits={"braking": 2.0})
    given = {"q": START, "qdot": np.zeros(3), **ahead()}
    last = one.step(**given).qdot_cmd.copy()
    wrong = {name: value.copy() for name, value in given.items()}
    wrong[what][1] = bad
    for k in range(1, 400):
        out = one.step(**wrong)
        # a deceleration of 2 for so many milliseconds
        assert_allclose(out.qdot_cmd, np.sign(last) * np.maximum(0, np.abs(last) - 2e-3 * k), atol=1e-12)
        assert out.status == Status.INVALID_INPUT | Status.STOPPED and out.path_rate == 0.0
        assert np.isnan(out.sigma).all() and np.isnan(out.damping)
    assert not out.qdot_cmd.any()
    assert out.problem.startswith(what) and ("elbow" in out.problem or what in ("pose", "twist"))
    again = one.step(**given)
    assert_allclose(again.qdot_cmd, last, rtol=1e-12)
    assert not again.status & (Status.STOPPED | Status.INVALID_INPUT) and again.problem == ""


WRONG = {
    "a length": ({"q": np.zeros(2)}, "q must be (3,), got (2,)"),
    "one number": ({"q": 0.5}, "q must be (3,), got ()"),
    "a text": ({"q": "home"}, "q must be numbers, got str"),
    "nothing": ({"q": None}, "q must be (3,), got None"),
    "ragged": ({"pose": [[1, 2], [3]]}, "pose must be numbers, got list"),
    "complex": ({"twist": np.full(6, 1j)}, "twist must be real, got complex numbers"),
    "a pose": ({"pose": np.zeros(5)}, "pose must be (7,), (6,) or (4, 4), got (5,)"),
    "no rotation": (
        {"pose": np.zeros((4, 4))},
        "pose is not finite, or beyond 1e+10, or its orientation is no rotation",
    ),
    "a reflection": ({"pose": np.diag([1.0, 1.0, -1.0, 1.0])}, "orientation is no rotation"),
    "no quaternion": ({"pose": np.zeros(7)}, "orientation is no rotation"),
    "a twist": ({"twist": np.zeros(3)}, "twist must be (6,), got (3,)"),
    "a frame": ({"frame": "tool"}, "frame must be one of world, base, site, got 'tool'"),
    "no frame": ({"frame": None}, "frame must be one of world, base, site, got None"),
    "two wishes": ({"q_target": START}, "give pose and twist, or q_target and qdot_target, not both"),
    "a rate": ({"qdot": np.array([np.nan, 0.0, 0.0])}, "qdot of shoulder is not finite, or beyond 1e+10"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_has_another_form_brakes_and_is_told(name):
    given, told = WRONG[name]
    one, right = controller(limits={"braking": 2.0}), {"q": START, **ahead()}
    last = one.step(**right).qdot_cmd.copy()
    out = one.step(**(right | given))
    assert out.status == Status.INVALID_INPUT | Status.STOPPED
    assert told in out.problem
    assert_allclose(out.qdot_cmd, np.sign(last) * np.maximum(0, np.abs(last) - 2e-3), atol=1e-12)
    again = one.step(**right)
    assert again.problem == "" and not again.status & Status.INVALID_INPUT


def test_what_holds_the_numbers_does_not_matter():
    one, right = controller(), {"q": START, "qdot": REST, **ahead()}
    want = one.step(**right).qdot_cmd.copy()
    strided = np.zeros((3, 2))
    strided[:, 0] = START
    for q in (START.tolist(), tuple(START), strided[:, 0], array.array("d", START)):
        one.reset(START)
        assert_array_equal(one.step(**(right | {"q": q})).qdot_cmd, want)
    one.reset(START)
    single = one.step(**(right | {"q": START.astype(np.float32), "pose": right["pose"].tolist()})).qdot_cmd
    assert_allclose(single, want, rtol=1e-4)


def test_a_controller_that_forgets_begins_anew():
    one, wanted = controller(limits={"acceleration": 3.0}), ahead()
    first = [one.step(START + 1e-3 * t, **wanted).qdot_cmd.copy() for t in range(50)]
    more = one.step(START, **wanted).qdot_cmd.copy()
    one.reset()
    assert_array_equal([one.step(START + 1e-3 * t, **wanted).qdot_cmd for t in range(50)][-1], first[-1])
    one.reset()
    assert (one.step(START, **wanted).qdot_cmd != more).any()


def test_a_command_is_overwritten_by_the_next_and_a_copy_is_not():
    one, wanted = controller(), ahead()
    out = one.step(START, **wanted)
    kept, before = out.copy(), out.qdot_cmd.copy()
    assert one.step(START, pose=wanted["pose"], twist=-wanted["twist"]) is out is one.command
    assert (out.qdot_cmd != before).all()
    assert_array_equal(kept.qdot_cmd, before)
    assert out.pose_error[:2] == pytest.approx([0.01, 0.0])


def test_a_position_is_the_integral_of_the_commands_within_the_range():
    one, wanted = controller(period=0.002), ahead()
    q, told = START.copy(), START.copy()
    for _ in range(100):
        out = one.step(q, **wanted)
        told += 0.002 * out.qdot_cmd
        assert_allclose(out.q_cmd, told, atol=1e-14)  # a hundred roundings of 1
        q = q + 1e-3  # whatever the arm does
    upper = ARM.position_limit[:, 1]
    one.reset(upper - 1e-4)
    for _ in range(100):
        out = one.step(START, qdot_target=np.ones(3))
    assert_allclose(out.q_cmd, upper, atol=1e-15)


SECONDARY = {"objective": "secondary", "secondary": {"site": "wrist", "axes": ["x"]}}


def test_what_the_chain_does_not_tell_is_read_from_data():
    partly = load_arm(ARM.path, joints=ARM.joints[:2])
    one = controller(START[:2], arm=partly)
    out = one.step(START[:2], **ahead())
    assert out.status & Status.INVALID_INPUT
    assert (
        out.problem
        == f'joint "{ARM.joints[2]}" moves the site and is not actuated: step_data reads its position'
    )
    data = seen(ARM, START)
    assert one.step_data(data, **ahead()).problem == ""
    other = mujoco.MjModel.from_xml_path(str(ROOT / "models/stanford.xml"))
    out = one.step_data(mujoco.MjData(other), **ahead())
    assert out.status & Status.INVALID_INPUT and re.search(
        r"the model of the data lacks a part of .*planar_3link\.xml", out.problem
    )
    assert one.step_data(None, **ahead()).problem == "step_data reads an mujoco.MjData, got NoneType"
    assert one.step_data(data, **ahead()).problem == ""


@pytest.mark.parametrize("is_stale", [False, True])
def test_after_data_that_are_refused_a_step_is_by_the_chain_and_not_by_those_before(is_stale):
    one, data, q = controller(START), seen(ARM, START), START + 0.2
    one.step_data(data)
    data.qpos[ARM.wiring.qpos] += 0.1 * is_stale
    assert bool(one.step_data(data).problem) == is_stale
    other = mujoco.MjModel.from_xml_path(str(ROOT / "models/stanford.xml"))
    assert one.step_data(mujoco.MjData(other)).problem
    for twist in ([0.0] * 6, np.zeros(6)):  # taken with care, and as it is
        out = one.step(q, twist=twist)
        assert out.problem == ""
        assert_allclose(out.pose, ARM.pose(q), atol=1e-12)


def test_an_arm_is_found_in_another_model(tmp_path):
    """Sites and joints have other numbers there: before the arm there is a thing with both."""
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    thing = f'<body><joint name="thing"/>{inertia}<site name="thing"/></body>'
    text = ARM.path.read_text("utf-8").replace("<worldbody>", f"<worldbody>{thing}")
    path = tmp_path / "scene.xml"
    path.write_text(text.replace('file="', f'file="{ARM.path.parent}/'), "utf-8")
    model = mujoco.MjModel.from_xml_path(str(path))
    wiring = ARM.wire(model)
    there, here, chain = (
        one(controller(nullspace=SECONDARY)).qdot_cmd
        for one in (
            lambda c: c.step_data(seen(ARM, START, model), **ahead()),
            lambda c: c.step_data(seen(ARM, START), **ahead()),
            lambda c: c.step(START, **ahead()),
        )
    )
    assert (wiring.site, *wiring.joint) != (ARM.wiring.site, *ARM.wiring.joint)
    assert_allclose(there, here, rtol=1e-12, atol=1e-12)
    assert_allclose(chain, here, rtol=1e-12, atol=1e-12)


def test_a_body_is_found_in_a_model_that_has_no_site_there():
    """The arm has a site of its own for it, which the user's model lacks."""
    model = mujoco.MjModel.from_xml_path(str(ROOT / "models/ur5e.xml"))
    one = Controller("ur5e", body="wrist_2_link")
    assert "wrist_2_link" not in [model.site(i).name for i in range(model.nsite)]
    q = one.arm.configuration("home")[one.arm.wiring.qpos]
    data = mujoco.MjData(model)
    data.qpos[:5] = q
    mujoco.mj_fwdPosition(model, data)
    twist = np.array([0.1, -0.05, 0.02, 0.1, 0.0, -0.2])
    chain = one.step(q, twist=twist).copy()
    one.reset()
    out = one.step_data(data, twist=twist)
    assert_allclose(out.pose[:3], data.body("wrist_2_link").xpos, atol=1e-14)
    assert_allclose(out.qdot_cmd, chain.qdot_cmd, rtol=1e-11, atol=1e-12)


def test_plain_rates_are_unknown_where_no_twist_is_resolved():
    one, wanted = controller(), ahead()
    assert np.isfinite(one.step(START, **wanted).qdot_plain).all()
    for given in ({"q_target": START}, {"qdot_target": 0 * START}):
        assert np.isnan(one.step(START, **given).qdot_plain).all()
    assert np.isnan(one.step(np.nan * START, **wanted).qdot_plain).all()


def test_a_controller_keeps_its_jerk_limit_when_it_brakes_for_lack_of_a_measurement():
    one, wanted = controller(limits={"jerk": 100.0, "acceleration": 3.0, "braking": 2.0}), ahead()
    rates = [
        one.step(START if t < 200 or t > 900 else START * np.nan, **wanted).qdot_cmd.copy()
        for t in range(1100)
    ]
    assert not rates[900].any() and np.abs(rates[199]).max() > 0.1
    changes = np.diff(rates, axis=0, prepend=0.0)
    assert np.abs(changes).max() <= 3e-3 * (1 + 1e-9)
    assert np.abs(np.diff(changes, axis=0, prepend=0.0)).max() <= 100e-6 * (
        1 + 1e-9
    )  # rounding: 1e-16 / 1e-4
    one.reset()
    assert_array_equal([one.step(START, **wanted).qdot_cmd for _ in range(50)][-1], rates[49])
