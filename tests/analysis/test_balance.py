"""Torques and link loads at rest against MuJoCo and closed forms; what needs no torque; and all of it held."""

import copy
import functools
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from chains import random_chain, seeds
from project import ROOT
from rmrc import arm as arms
from rmrc.analysis.statics import FEEDBACK, STILL, balance, elsewhere, statics
from rmrc.scenario.sections import ToolSection
from rmrc.support.spatial import quat_to_matrix
from screws import screw_chain

MODELS = sorted(path.stem for path in (ROOT / "models").glob("*.xml"))
# Some dozens of products of lengths of a meter with forces of some hundred newtons.
ROUNDING = 1e-10

SPRINGS = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body gravcomp="0.25">
<joint name="a" axis="0 1 0" stiffness="7" springref="20"/><geom size="0.1" pos="0.5 0 0" mass="3"/>
<body pos="1 0 0"><joint name="b" type="slide" axis="1 0 0" stiffness="50"/><geom size="0.1" mass="2"/>
<site name="tip"/></body></body></worldbody></mujoco>"""


@functools.cache
def shipped(name):
    """Return an arm that is not changed."""
    return arms.load(ROOT / f"models/{name}.xml")


@pytest.fixture
def made(tmp_path):
    """Return a function: MJCF, site -> arm."""

    def make(text, site=None):
        path = tmp_path / "made.xml"
        path.write_text(text)
        return arms.load(path, site)

    return make


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    """Return a function: seed, whether joints follow others -> random arm."""
    path = tmp_path_factory.mktemp("chains") / "chain.xml"

    def make(seed, followers=False):
        path.write_text(random_chain(seed, followers=followers))
        return arms.load(path)

    return make


def at_random(arm, seed):
    return arm.sampled(1, seed)[0], np.random.default_rng(seed).normal(size=6) * 10


def all_arms(made, every=1):
    for i, name in list(enumerate(MODELS))[::every]:
        arm = shipped(name)
        yield arm, *at_random(arm, i)
    for order in ("hinge first", "slide first"):
        arm = made(screw_chain(order=order, ratio=-0.07))
        yield arm, *at_random(arm, 5)


def hold(arm, q, wrench, gravity=False, seconds=10.0):
    return statics(arm, wrench, q, gravity=gravity, hold=seconds).held


# Torques and loads -------------------------------------------------------------------------------


def at_rest(arm, q, wrench, gravity):
    """Return MuJoCo's inverse dynamics at rest under a wrench, and what the wrench does to the joints, (nv,)."""
    model = copy.copy(arm.model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    model.opt.gravity *= gravity
    data, body, pushed = mujoco.MjData(model), arm.wiring.body, np.zeros(model.nv)
    data.qpos[:] = arm.configuration(q)
    mujoco.mj_kinematics(model, data)
    site, (force, moment) = data.site_xpos[arm.wiring.site], np.reshape(wrench, (2, 3))
    data.xfrc_applied[body] = *force, *(moment + np.cross(site - data.xipos[body], force))
    mujoco.mj_inverse(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    mujoco.mj_applyFT(model, data, force, moment, site, body, pushed)
    return data, pushed


def gathered(arm, values):
    """Return the sums over the joints that each actuator moves, (n,), of values of all joints, (nv,)."""
    sums = values[arm.wiring.dof]
    for address, follower in zip(arm.wiring.follower_dof, arm.followers, strict=True):
        sums[follower.leader] += follower.ratio * values[address]
    return sums


def check(borne):
    """Torques are those of inverse dynamics, loads its forces between bodies, and bearings do no work."""
    arm, model = borne.arm, borne.arm.model
    data, pushed = at_rest(arm, borne.q, borne.wrench, borne.bears_weight)
    assert_allclose(borne.equivalent, gathered(arm, pushed), atol=ROUNDING)
    assert_allclose(borne.torque, gathered(arm, data.qfrc_inverse - pushed), atol=ROUNDING)
    assert borne.disagreement <= ROUNDING
    halves = {arm.joints[each.leader]: each for each in arm.followers if each.pitch}
    poses = arm.frames(arm.configuration(borne.q)[None])[0][0]
    for j, name in enumerate(arm.axis_names):
        joint = model.joint(name).id
        body, along = model.jnt_bodyid[joint], (data.qfrc_bias - pushed)[model.jnt_dofadr[joint]]
        if name in halves:  # of a screw, the link is all that its first half moves
            other = model.joint(halves[name].name)
            along += halves[name].ratio * (data.qfrc_bias - pushed)[other.dofadr[0]]
            first = model.jnt_bodyid[min(joint, other.id)]
        else:
            first = body
        assert borne.driven[j] == pytest.approx(along, abs=ROUNDING)
        R = quat_to_matrix(poses[body, 3:])
        moment, force = data.cfrc_int[first].reshape(2, 3)
        anchor = poses[body, :3] + R @ model.jnt_pos[joint]
        moment = moment + np.cross(data.subtree_com[model.body_rootid[first]] - anchor, force)
        assert_allclose(borne.reaction[j], [*(R.T @ force), *(R.T @ moment)], atol=ROUNDING)
        if name not in halves:  # bearings do no work: all that is along the axis is the actuator's
            half = borne.reaction[j].reshape(2, 3)[0 if np.isinf(arm.chain.pitch[j]) else 1]
            assert borne.axis[j] @ half == pytest.approx(borne.driven[j], abs=ROUNDING)


def in_world(borne):
    """Return the reactions along world axes, (ℓ, 6)."""
    arm = borne.arm
    quats = arm.frames(arm.configuration(borne.q)[None])[0][0, arm.model.jnt_bodyid[arm.wiring.axis], 3:]
    R = np.array([quat_to_matrix(quat) for quat in quats])
    return (borne.reaction.reshape(-1, 2, 3) @ R.swapaxes(1, 2)).reshape(-1, 6)


@given(seeds)
def test_any_chain_with_what_hangs_beside_it_bears_what_mujoco_says(chain, seed):
    """A branch hangs on the first link, beside the chain; joints follow others on the chain and on the branch."""
    arm = chain(seed, followers=seed % 3 == 0)
    check(balance(arm, *at_random(arm, seed), gravity=seed % 2 == 0))


@pytest.mark.parametrize("gravity", [False, True])
def test_every_model_screws_and_followers_bear_what_mujoco_says(made, gravity):
    for arm, q, wrench in all_arms(made):
        check(balance(arm, q, wrench, gravity))
    for name in ("telescope", "mimic"):
        arm = arms.load(ROOT / f"tests/models/{name}.xml", "tip")
        check(balance(arm, *at_random(arm, 2), gravity))


@pytest.mark.parametrize("frame", ["body", "tool"])
def test_a_gripper_and_a_tool_are_borne_too(frame):
    tool = ToolSection(body="palm", position=(0.1, 0.0, 0.05), mass=0.2)
    arm = arms.load(ROOT / "tests/models/gripper.xml", **{frame: "palm" if frame == "body" else tool})
    borne = balance(arm, *at_random(arm, 4), gravity=True)
    check(borne)
    bodies = arm.model.body_subtreemass[arm.model.jnt_bodyid[arm.wiring.axis]]
    assert_allclose(
        in_world(borne)[:, :3], [[*-borne.wrench[:2], 9.81 * m - borne.wrench[2]] for m in bodies]
    )


def test_a_wrench_or_a_weight_that_is_wrong_is_seen():
    arm = shipped("stanford")
    q, wrench = at_random(arm, 3)
    for wrong in (-wrench, np.roll(wrench, 1)):
        with pytest.raises(AssertionError):
            check(replace(balance(arm, q, wrong), wrench=wrench))
    for gravity in (False, True):
        with pytest.raises(AssertionError):
            check(replace(balance(arm, q, wrench, gravity), bears_weight=not gravity))


def test_springs_and_gravity_that_the_model_compensates_itself(made):
    arm = made(SPRINGS)
    q = np.array([0.3, 0.2])
    borne = balance(arm, q, np.zeros(6), gravity=True)
    # a turns about y, so that a positive angle lowers what is in front of it
    away, below = 0.5 * np.cos(q[0]), 1.2 * np.cos(q[0])
    assert_allclose(
        borne.gravity, [-9.81 * (0.75 * 3 * away + 2 * below), -9.81 * 2 * np.sin(q[0])], atol=1e-12
    )
    assert_allclose(borne.springs, [7 * (q[0] - np.radians(20)), 50 * q[1]], atol=1e-12)
    assert_allclose(borne.torque, borne.gravity + borne.springs, atol=0)
    floating = balance(arm, q, np.zeros(6))
    assert not floating.gravity.any()
    assert_allclose(floating.torque, borne.springs)


def test_a_weight_that_the_actuators_compensate_themselves_is_borne_by_them(made):
    """As controllers of robots do it; where the model compensates it apart, neither drive nor link bears it."""
    path = ROOT / "tests/models/drives/compensated.xml"
    text, q = path.read_text(), [0.3, 0.4]
    everywhere = text.replace('name="elbow"', 'name="elbow" actuatorgravcomp="true"')
    check(balance(made(everywhere), q, [1, 2, 3, 0.4, 0.5, 0.6], gravity=True))
    # the shoulder's actuator bears 1 + 0.6 kg; half of the forearm is compensated apart from the elbow's
    borne = balance(arms.load(path), q, np.zeros(6), gravity=True)
    lever = np.cos(q[0]) * np.array([0.2, 0.4]) + [0, 0.15 * np.cos(sum(q))]
    assert_allclose(
        borne.torque, -9.81 * np.array([lever @ [1, 0.6], 0.3 * 0.15 * np.cos(sum(q))]), atol=1e-12
    )
    assert_allclose(in_world(borne)[:, 2], [9.81 * 1.6, 9.81 * 0.3], atol=1e-12)
    assert hold(borne.arm, q, [0, 0, -5], gravity=True)["agrees"]


def test_margin_is_what_is_left_of_the_limits():
    borne = balance(shipped("planar_2link"), np.radians([0, 60]), [0, -120, 0, 0, 0, 0])
    assert_allclose(borne.torque, [180, 60], atol=1e-9)
    assert_allclose(borne.margin, [-80, -10], atol=1e-9)
    assert borne.exceeded == ("shoulder", "elbow")
    # 50 N·m, by cos 60°: just what the elbow has, and its last digit does not decide
    assert balance(borne.arm, np.radians([0, 60]), [0, -100, 0, 0, 0, 0]).exceeded == ("shoulder",)


# What needs no torque ----------------------------------------------------------------------------


def test_wrenches_that_need_no_torque_are_all_of_them_and_no_other(made):
    for arm, q, _ in all_arms(made, 3):
        J, free = arm.jacobian(q), [each.wrench for each in statics(arm, [0, 0, 0], q).free]
        assert len(free) == 6 - np.linalg.matrix_rank(J)
        assert not free or np.linalg.matrix_rank(free) == len(free)
        assert all(np.abs(J.T @ wrench).max() < 1e-9 * np.linalg.norm(wrench) for wrench in free)


def test_a_force_along_a_stretched_arm_needs_no_torque_and_one_along_a_bent_arm_does():
    arm = shipped("planar_2link")
    words = "cannot move along x; a force along x needs no torque"
    assert words in [each.words for each in statics(arm, [1, 0, 0], [0, 0]).free]
    assert words not in [each.words for each in statics(arm, [1, 0, 0], [0, 0.5]).free]


# Held in the physics -----------------------------------------------------------------------------


def test_held_the_examples_of_the_notes_are_what_the_actuators_read():
    arm = shipped("planar_2link")
    held = hold(arm, np.radians([0, 60]), [0, -1, 0, 0, 0, 0])
    assert held["agrees"]
    # The arm gives way by tau/stiffness, 1e-5 rad, and the torques change by as much.
    assert_allclose(held["measured"], [1.5, 0.5], atol=1e-4)
    stiffness = arm.inertia / 0.001 * FEEDBACK
    assert_allclose(held["run"]["q"][-1] - np.radians([0, 60]), -held["measured"] / stiffness, rtol=1e-3)

    held = hold(arm, np.radians([90, 0]), [0, -1000, 0, 0, 0, 0])
    assert held["agrees"] and np.abs(held["measured"]).max() < 1e-6
    # Negative control: along x the same force would need 2000 N·m, and the arm is thrown off.
    held = hold(arm, np.radians([90, 0]), [-1000, 0, 0, 0, 0, 0], seconds=1.0)
    assert not held["still"] and not held["agrees"] and held["at_limit"].all()


def test_models_and_screws_hold_what_statics_says(made):
    for arm, q, wrench in all_arms(made, 5):
        held = hold(arm, q, 0.1 * wrench, True)  # a newton or so: no wrist comes to its torque limit
        assert held["agrees"], (arm.path.stem, held["difference"], held["allowed"], held["rate"])
        ended = balance(arm, held["run"]["q"][-1], 0.1 * wrench, True)
        friction = arm.model.dof_frictionloss @ np.abs(
            arm.motion
        )  # what it may bear is beside that, and known
        assert (held["allowed"] - friction < 0.01 * ended.size).all()
        assert_allclose(held["measured"], ended.torque, atol=held["allowed"].max())
        # Negative control: the wrench of the other sign is not what they read.
        wrong = balance(arm, ended.q, -0.1 * wrench, True)
        assert (np.abs(held["measured"] - wrong.torque) > held["allowed"]).any()


def test_a_singular_wrist_and_springs_are_held_too(made):
    # joints 4 and 6 of the wrist turn against each other for free in the task
    wrist = shipped("stanford"), [0.2, 0.3, 0.6, 0.4, 0.0, 0.1], [5, -3, 4, 0.5, 0.2, 0.4], False
    for arm, q, wrench, gravity in (wrist, (made(SPRINGS), [0.3, 0.2], [1, 2, 3, 0, 0, 0], True)):
        held = hold(arm, q, wrench, gravity)
        assert held["agrees"], (held["difference"], held["allowed"], held["rate"])
        assert np.abs(held["run"]["q"][-1] - q).max() < 1e-2


RUBBING = """<mujoco><compiler angle="radian"/><worldbody><body name="upper"><joint name="shoulder" axis="0 1 0" {}/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".03"/><body name="lower" pos=".4 0 0">
<joint name="elbow" axis="0 1 0" {}/><geom type="capsule" fromto=".08 0 0 .3 0 0" size=".02"/>
<site name="hand" pos=".3 0 0"/></body></body>
<body name="table" pos="0 0 -.2"><geom type="box" size="1 1 .1"/></body></worldbody></mujoco>"""


def test_a_joint_that_creeps_below_its_friction_is_still(made):
    """As MuJoCo's friction is soft: stiffer than by default, it takes seconds to give way."""
    friction = 'frictionloss="0.3" solimpfriction="0.999 0.999 0.001"'
    rubbing, asked = made(RUBBING.format(friction, friction)), ([-0.5, -0.3], [0, 0, -0.4, 0, 0, 0])
    held = hold(rubbing, *asked, seconds=4.0)
    assert held["agrees"] and STILL < held["rate"] < 1e-4 and np.abs(held["difference"]).max() > 1e-3
    # what the servo brakes counts beside the friction: a joint that falls is not still
    assert not hold(rubbing, *asked, seconds=0.05)["agrees"]
    smooth = hold(made(RUBBING.format("", "")), *asked)
    assert smooth["agrees"] and smooth["rate"] <= STILL and np.abs(smooth["difference"]).max() < 1e-4


HELD = [-0.6, 0.3], [0, 0, -1, 0, 0, 0]


def test_what_bears_a_part_of_the_wrench_is_seen(made):
    text = RUBBING.format("", "")
    lying = hold(made(text), [0.0, 0.3], HELD[1], seconds=3.0)  # 0.2 m of lower are 6 cm below the table
    at_end = hold(made(RUBBING.format("", 'range="-1 0.3" limited="true"')), *HELD, seconds=3.0)
    for supported in (lying, at_end):
        assert not supported["agrees"] and "contact or the end of a range" in supported["verdict"]
    assert hold(made(text), *HELD, seconds=3.0)["verdict"].startswith("met")


@pytest.mark.parametrize(
    ("name", "here", "there"), [("stanford", "tool", "wrist"), ("puma560", "wrist", "tool")]
)
def test_a_wrench_elsewhere_on_its_body_asks_for_the_same_torques_and_does_the_same_work(name, here, there):
    arm, other = (arms.load(ROOT / f"models/{name}.xml", site) for site in (here, there))
    rng = np.random.default_rng(8)
    for q in arm.sampled(5):
        wrench = rng.normal(size=6)
        found = elsewhere(arm, q, wrench, there)
        R_a, R_b = (quat_to_matrix(one.pose(q)[3:]) for one in (other, arm))
        in_world = (found["wrench"].reshape(2, 3) @ R_a.T).ravel()
        # J of each site, by MuJoCo.
        assert_allclose(other.jacobian(q).T @ in_world, arm.jacobian(q).T @ wrench, atol=ROUNDING)
        rates = rng.normal(size=arm.n)
        twist_a, twist_b = (
            (one.jacobian(q) @ rates).reshape(2, 3) @ R for one, R in ((other, R_a), (arm, R_b))
        )
        assert_allclose(found["velocity_transform"] @ twist_b.ravel(), twist_a.ravel(), atol=ROUNDING)
        assert_allclose(found["force_transform"], np.linalg.inv(found["velocity_transform"]).T, atol=ROUNDING)
        # Negative control: the transpose of the same direction, as a source prints it.
        printed = found["velocity_transform"].T @ (wrench.reshape(2, 3) @ R_b).ravel()
        assert np.abs(printed - found["wrench"]).max() > 1e-3
