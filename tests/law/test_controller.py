"""The law in a loop of one's own: the same rates as a run, nothing raised, nothing kept."""

import copy
import math
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


@pytest.mark.parametrize("name", ["approach_singularity", "slow_wrist", "algorithmic_singularity"])
def test_an_own_loop_gives_the_bits_of_a_run(name):
    prepared, run = ran(name)
    assert_array_equal(own_loop(prepared, len(run)), run["qdot_cmd"])


@pytest.mark.parametrize("name", ["stanford_wrist"])
def test_the_arms_own_chain_gives_the_same_but_for_rounding(name):
    prepared, run = ran(name)
    chain = own_loop(prepared, len(run), attached=False)
    assert_allclose(chain, run["qdot_cmd"], rtol=0, atol=3e-12)
    assert (chain != run["qdot_cmd"]).any()  # they are two ways


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


@pytest.mark.parametrize("way", ["chain", "data", "poses", "batch"])
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
    one.watchdog = 1.0
    for _ in range(100):
        call()
    # What steps keep or take, they do each time; what something else in the tests' process does meanwhile, it does once.
    grown, peak = map(min, zip(*(allocated(call, 1000) for _ in range(3)), strict=True))
    assert grown < 4000 and peak < 5000  # the smallest object a step would be 16,000
    # negative controls: what a caller keeps is seen, each time, and what a call takes for a while
    kept = []
    assert min(allocated(lambda: kept.append(np.array(call().qdot_cmd)), 100) for _ in range(3))[0] > 100 * 24
    assert min(allocated(lambda: np.zeros(1000), 100) for _ in range(3))[1] > 5000


@pytest.mark.parametrize(
    ("what", "bad"), [("q", np.nan), ("qdot", np.inf), ("pose", 1e11), ("twist", np.nan)]
)
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


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"q": np.zeros(2)}, "q must be (3,), got (2,)"),
        ({"twist": np.full(6, 1j)}, "twist must be real, got complex numbers"),
        ({"pose": np.diag([1.0, 1.0, -1.0, 1.0])}, "orientation is no rotation"),
        ({"frame": "tool"}, "frame must be one of world, base, site, got 'tool'"),
        ({"q_target": START}, "give pose and twist, or q_target and qdot_target, not both"),
    ],
)
def test_what_cannot_be_used_is_told(wrong, told):
    assert told in controller().step(**{"q": START, **ahead(), **wrong}).problem


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


def test_what_the_chain_does_not_tell_is_read_from_data():
    one = controller(START[:2], arm=load_arm(ARM.path, joints=ARM.joints[:2]))
    out = one.step(START[:2], **ahead())
    assert (
        out.status & Status.INVALID_INPUT and "is not actuated: step_data reads its position" in out.problem
    )
    data, other = seen(ARM, START), mujoco.MjModel.from_xml_path(str(ROOT / "models/stanford.xml"))
    assert one.step_data(data, **ahead()).problem == ""
    assert "the model of the data lacks a part of" in one.step_data(mujoco.MjData(other), **ahead()).problem
    assert one.step_data(None, **ahead()).problem == "step_data reads an mujoco.MjData, got NoneType"
    assert one.step_data(data, **ahead()).problem == ""
