"""What drives and links bear against MuJoCo, levers, energy and power; what costs nothing; and all of it held."""

import functools
from dataclasses import replace
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from chains import random_chain, seeds
from project import ROOT, mostly_long
from rmrc import arm as arms
from rmrc.analysis.statics.balance import Cost, balance, elsewhere, link_frames, wrench_costs
from rmrc.analysis.statics.hold import FEEDBACK, STILL
from rmrc.analysis.statics.report import verdict
from rmrc.analysis.statics.statics import statics
from rmrc.scenario.arm import ToolSection
from rmrc.support.errors import QuestionError
from rmrc.support.spatial import pose_error, quat_to_matrix
from screws import screw_chain
from wording import says

MODELS = sorted(path.stem for path in (ROOT / "models").glob("*.xml"))
# Some dozens of products of lengths of a meter with forces of some ten newtons.
ROUNDING = 1e-11

SPRINGS = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body gravcomp="0.25">
<joint name="a" axis="0 1 0" stiffness="7" springref="20"/><geom size="0.1" pos="0.5 0 0" mass="3"/>
<body pos="1 0 0"><joint name="b" type="slide" axis="1 0 0" stiffness="50"/><geom size="0.1" mass="2"/>
<site name="tip"/></body></body></worldbody></mujoco>"""

# Points up or down by one joint, around by the other: no force along its only link can be given.
PAN_TILT = """<mujoco><worldbody><body><joint name="pan" axis="0 0 1"/><geom size="0.1"/>
<body><joint name="tilt" axis="0 -1 0"/><geom size="0.1" pos="0.5 0 0"/><site name="tip" pos="1 0 0"/>
</body></body></worldbody></mujoco>"""


@functools.cache
def shipped(name):
    """Return an arm that is not changed."""
    return arms.load(ROOT / f"models/{name}.xml")


@pytest.fixture
def made(tmp_path):
    """Return a function: MJCF -> arm."""

    def make(text):
        path = tmp_path / "made.xml"
        path.write_text(text)
        return arms.load(path)

    return make


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    """Return a function: seed -> random arm."""
    path = tmp_path_factory.mktemp("chains") / "chain.xml"

    def make(seed):
        path.write_text(random_chain(seed))
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


def forward(arm, q):
    data = mujoco.MjData(arm.model)
    data.qpos[:] = arm.configuration(q)
    mujoco.mj_forward(arm.model, data)
    return data


def check_torques(borne):
    """−Jᵀ F undoes what MuJoCo's mj_applyFT does, and equals what is left from link to link."""
    arm, data = borne.arm, forward(borne.arm, borne.q)
    applied = np.zeros(arm.model.nv)
    site = data.site_xpos[arm.wiring.site]
    mujoco.mj_applyFT(arm.model, data, borne.wrench[:3], borne.wrench[3:], site, arm.wiring.body, applied)
    pushed = applied[arm.wiring.dof]
    for address, one in zip(arm.wiring.follower_dof, arm.followers, strict=True):
        pushed[one.leader] += one.ratio * applied[address]
    assert_allclose(borne.equivalent, pushed, rtol=0, atol=ROUNDING)
    assert_allclose(borne.equilibrium, -pushed, rtol=0, atol=ROUNDING)
    assert_allclose(borne.propagated, -pushed, rtol=0, atol=ROUNDING)
    assert borne.disagreement <= ROUNDING


def check_links(borne):
    """Each link takes −f and the moment of −f about its joint; bearings and links work in no joint's motion."""
    arm, data = borne.arm, forward(borne.arm, borne.q)
    force, moment = borne.wrench[:3], borne.wrench[3:]
    site, R = data.site_xpos[arm.wiring.site], borne.frames[:, :3, :3]
    for j, origin in enumerate(borne.frames[:, :3, 3]):
        want = -np.concatenate([force, moment + np.cross(site - origin, force)])
        assert_allclose(borne.reaction_world[j], want, atol=ROUNDING)
        assert_allclose(borne.reaction[j, :3], R[j].T @ want[:3], atol=ROUNDING)
        assert_allclose(borne.reaction[j, 3:], R[j].T @ want[3:], atol=ROUNDING)
        fz, nz = borne.structure[j, [2, 5]]
        slides, pitch = arm.chain.kinds[j] == "slide", arm.chain.pitch[j]
        assert (fz if slides else nz + pitch * fz) == pytest.approx(0, abs=ROUNDING)
        drives = np.zeros(6)
        drives[2 if slides else 5] = borne.driven[j]
        if len(arm.chain.names) == arm.n:
            assert borne.driven[j] == pytest.approx(borne.equilibrium[j], abs=ROUNDING)
        assert_allclose(borne.structure[j] + drives, borne.reaction[j], atol=ROUNDING)


def check_power(borne, seed):
    """tau·qdot + wrench·twist = 0, with a twist of differences of poses."""
    qdot, step = np.random.default_rng(seed).normal(size=borne.arm.n), 1e-6
    poses = [borne.arm.pose(borne.q + sign * step * qdot) for sign in (1, -1)]
    twist = pose_error(*poses) / (2 * step)
    # central differences with a step of 1e-6, times a wrench of some ten
    assert borne.equilibrium @ qdot + borne.wrench @ twist == pytest.approx(0, abs=1e-6)


@given(seeds)
def test_any_chain_bears_what_mujoco_levers_and_power_say(chain, seed):
    arm = chain(seed)
    borne = balance(arm, *at_random(arm, seed))
    check_torques(borne)
    check_links(borne)
    check_power(borne, seed)


def test_every_model_and_screws_bear_what_mujoco_levers_and_power_say(made):
    for arm, q, wrench in all_arms(made):
        borne = balance(arm, q, wrench)
        check_torques(borne)
        check_links(borne)
        check_power(borne, 1)


@pytest.mark.parametrize("check", [check_torques, check_links, lambda borne: check_power(borne, 1)])
def test_a_wrench_of_the_wrong_sign_or_along_other_axes_is_seen(check):
    arm = shipped("stanford")
    q, wrench = at_random(arm, 3)
    for wrong in (-wrench, np.roll(wrench, 1)):
        with pytest.raises(AssertionError):
            check(replace(balance(arm, q, wrong), wrench=wrench))


def test_a_screw_without_its_pitch_is_seen(made):
    arm = made(screw_chain(ratio=0.07))
    q, wrench = at_random(arm, 5)
    hinge = replace(arm, followers=(replace(arm.followers[0], pitch=1e-9),))
    borne = balance(hinge, q, wrench)
    assert borne.disagreement > 0.1  # the second route knows of it by its pitch alone
    with pytest.raises(AssertionError):
        check_links(borne)


def test_frames_are_mujocos_axes_and_at_0_the_worlds_turned_the_shortest_way(made):
    for arm, q, _ in all_arms(made, 2):
        data = forward(arm, q)
        frames, tip = link_frames(arm, q)
        assert_allclose(frames[:, :3, 2], data.xaxis[arm.wiring.joint], atol=ROUNDING)
        offset = data.xanchor[arm.wiring.joint] - frames[:, :3, 3]
        assert_allclose(np.cross(offset, frames[:, :3, 2]), 0, atol=ROUNDING)
        pose = arm.pose(q)
        assert_allclose(tip[:3, 3], pose[:3], atol=ROUNDING)
        assert_allclose(tip[:3, :3], quat_to_matrix(pose[3:]), atol=ROUNDING)
        for R in link_frames(arm, np.zeros(arm.n))[0][:, :3, :3]:
            assert_allclose(R @ R.T, np.eye(3), atol=ROUNDING)
            # the shortest way is by the angle between the two z, or half a turn about x
            angle = np.arccos(np.clip(R[2, 2], -1, 1))
            assert np.trace(R) == pytest.approx(1 + 2 * np.cos(angle), abs=ROUNDING)


@pytest.mark.parametrize("axis", [[0, 0, -1], [1e-9, 0, -1], [0, 0, 1], [0.6, 0, -0.8]])
def test_a_frame_is_a_rotation_near_half_a_turn_too(made, axis):
    text = PAN_TILT.replace("0 0 1", " ".join(f"{x:.17g}" for x in axis))
    R = link_frames(made(text), [0.0, 0.0])[0][0, :3, :3]
    assert_allclose(R[:, 2], np.array(axis) / np.linalg.norm(axis), atol=1e-15)
    assert_allclose(R @ R.T, np.eye(3), atol=1e-15)


def test_the_two_examples_of_the_notes():
    arm = shipped("planar_2link")
    # 1000 N times cos 90° = 6e-17
    pressed = balance(arm, np.radians([0, 60]), [0, -1, 0, 0, 0, 0])
    assert_allclose(pressed.equivalent, [-1.5, -0.5], atol=1e-12)
    assert_allclose(pressed.equilibrium, [1.5, 0.5], atol=1e-12)
    stretched = balance(arm, np.radians([90, 0]), [0, -1000, 0, 0, 0, 0])
    assert_allclose(stretched.equivalent, 0, atol=1e-12)
    # it goes through the links: z is the axis of the joints, so that nothing bends them
    assert_allclose(stretched.reaction_world, [[0, 1000, 0, 0, 0, 0]] * 2, atol=1e-12)


@pytest.mark.parametrize("every", [2, pytest.param(1, marks=pytest.mark.long)])
def test_gravity_and_springs_are_how_the_energy_rises(made, chain, every):
    own = (arms.load(ROOT / f"models/{name}.xml") for name in MODELS[::every])
    for arm in (*own, made(screw_chain()), chain(11), chain(12)):
        q = arm.sampled(1)[0]
        weight, springs = arm.rest_torques(q)
        arm.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        for j, e in enumerate(np.eye(arm.n) * 1e-4):
            up, down = (forward(arm, q + sign * e).energy[0] for sign in (1, -1))
            # second-order differences of energies of some hundred joules
            assert (weight + springs)[j] == pytest.approx((up - down) / 2e-4, abs=1e-5), arm.joints[j]
        assert not springs.any()


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


def test_margin_is_what_is_left_of_the_limits():
    borne = balance(shipped("planar_2link"), np.radians([0, 60]), [0, -120, 0, 0, 0, 0])
    assert_allclose(borne.torque, [180, 60], atol=1e-9)
    assert_allclose(borne.margin, [-80, -10], atol=1e-9)
    assert borne.exceeded == ("shoulder", "elbow")
    # 50 N·m, by cos 60°: just what the elbow has, and its last digit does not decide
    assert balance(borne.arm, np.radians([0, 60]), [0, -100, 0, 0, 0, 0]).exceeded == ("shoulder",)


# What costs nothing ------------------------------------------------------------------------------


def words(arm, q, kind, length=1.0):
    """Return what wrenches of a kind cost: rows of the wrench and the words, and the counts."""
    (group,) = [one for one in wrench_costs(arm, q, length) if one.kind == kind]
    return [(one.wrench, one.cost) for one in group.directions], (group.free, group.free_only_here)


def test_costs_are_those_of_their_torques_orthogonal_and_complete(made):
    length = 0.4
    for arm, q, _ in all_arms(made, 3):
        J, scale = arm.jacobian(q), np.where(arm.is_slide, length, 1.0)
        for group, rows in zip(wrench_costs(arm, q, length), (range(6), range(3), range(3, 6)), strict=True):
            unscaled = np.array([one.wrench * ([length] * 3 + [1] * 3) for one in group.directions])
            assert_allclose(unscaled @ unscaled.T, np.eye(len(rows)), atol=1e-9)
            for one in group.directions:
                tau = scale * (J.T @ one.wrench)
                assert np.linalg.norm(tau) == pytest.approx(one.sigma, abs=1e-8)
                assert one.amplification == (1 / one.sigma if one.sigma else np.inf)
            rank = np.linalg.matrix_rank(J[list(rows)])
            assert (group.free, group.free_only_here) == (len(rows) - rank, 0)


def test_of_a_planar_arm_a_force_along_z_costs_nothing_and_stretched_one_along_the_links():
    arm = shipped("planar_2link")
    x, z, y = np.eye(6)[[0, 2, 1]]
    found, counts = words(arm, [0, 0], "force")
    assert [cost for _, cost in found] == [Cost.ALWAYS, Cost.SINGULAR, Cost.TORQUE]
    assert_allclose([wrench for wrench, _ in found], [z, x, y], atol=1e-12)
    assert counts == (2, 1)
    # Negative control: bent, that force costs a torque, and nothing is said of a singularity.
    found, counts = words(arm, [0, 0.5], "force")
    assert [cost for _, cost in found] == [Cost.ALWAYS, Cost.TORQUE, Cost.TORQUE]
    assert counts == (1, 0)
    # Between the two it is nearly free: 1/sigma is 2/sin(elbow) where sigma_1 = sqrt(5), and more by 25 %.
    found, counts = words(arm, [0, 1e-3], "force")
    assert found[1][1] is Cost.NEARLY and counts == (1, 0)
    (group,) = [one for one in wrench_costs(arm, [0, 1e-3]) if one.kind == "force"]
    assert group.directions[1].amplification == pytest.approx(np.sqrt(5) / np.sin(1e-3), rel=1e-6)


def test_two_joints_can_always_bear_four_wrenches_for_nothing_three_of_them_the_same():
    found, counts = words(shipped("planar_2link"), [0.2, 0.7], "wrench")
    assert [cost for _, cost in found[:4]] == [Cost.ALWAYS] * 3 + [Cost.OTHERS]
    assert_allclose([wrench for wrench, _ in found[:3]], np.eye(6)[[2, 3, 4]], atol=1e-12)
    assert counts == (4, 0)


def test_a_straight_wrist_bears_one_more_wrench_for_nothing():
    arm = shipped("stanford")
    found, counts = words(arm, [0.3, 0.9, 0.6, 0.4, 0.0, 0.1], "wrench")
    assert [cost for _, cost in found].count(Cost.SINGULAR) == 1 and found[0][1] is Cost.SINGULAR
    assert counts == (1, 1)
    assert words(arm, [0.3, 0.9, 0.6, 0.4, 0.5, 0.1], "wrench")[1] == (0, 0)


def test_where_more_is_free_than_elsewhere_but_some_is_free_elsewhere_too(made):
    arm = made(PAN_TILT)
    found, counts = words(arm, [0.4, 0.3], "force")
    along = np.array([np.cos(0.4) * np.cos(0.3), np.sin(0.4) * np.cos(0.3), np.sin(0.3)])
    assert found[0][1] is Cost.OTHERS and counts == (1, 0)
    assert_allclose(found[0][0][:3], along, atol=1e-12)
    # Straight up, panning moves nothing: all but one direction of force is free, and it cannot be said which
    # of the two is the one of elsewhere.
    found, counts = words(arm, [0.4, np.pi / 2], "force")
    assert [cost for _, cost in found] == [Cost.MIXED, Cost.MIXED, Cost.TORQUE]
    assert counts == (2, 1)


def test_what_is_always_free_is_free_elsewhere_and_what_is_not_is_not(chain):
    for seed in range(2):
        arm = chain(seed)
        q, elsewhere = arm.sampled(2, seed + 100)
        for group in wrench_costs(arm, q):
            for one in group.directions:
                free = np.abs(arm.jacobian(elsewhere).T @ one.wrench).max() < 1e-9
                assert free == (one.cost is Cost.ALWAYS)
            assert all(a.sigma <= b.sigma for a, b in pairwise(group.directions))


# Held in the physics -----------------------------------------------------------------------------


def test_held_the_examples_of_the_notes_are_what_the_actuators_read():
    arm = shipped("planar_2link")
    held = hold(arm, np.radians([0, 60]), [0, -1, 0, 0, 0, 0])
    assert held.agrees
    # The arm gives way by tau/stiffness, 1e-5 rad, and the torques change by as much.
    assert_allclose(held.measured, [1.5, 0.5], atol=1e-4)
    stiffness = arm.inertia / 0.001 * FEEDBACK
    assert_allclose(held.ended.q - held.wanted.q, -held.measured / stiffness, rtol=1e-3)

    held = hold(arm, np.radians([90, 0]), [0, -1000, 0, 0, 0, 0])
    assert held.agrees
    assert np.abs(held.measured).max() < 1e-6
    # Negative control: along x the same force would need 2000 N·m, and the arm is thrown off.
    held = hold(arm, np.radians([90, 0]), [-1000, 0, 0, 0, 0, 0], seconds=1.0)
    assert not held.is_still and not held.agrees
    assert held.at_limit.all()


@pytest.mark.parametrize(("gravity", "every"), mostly_long([(True, 5), (True, 1), (False, 1)], 3))
def test_every_model_and_screws_hold_what_statics_says(made, gravity, every):
    for arm, q, wrench in all_arms(made, every):
        held = hold(arm, q, 0.1 * wrench, gravity)  # a newton or so: no wrist comes to its torque limit
        assert held.agrees, (arm.path.stem, held.difference, held.allowed, held.rate)
        assert held.ended.gravity.any() <= gravity
        # What dry friction may bear is beside that, and known.
        assert (
            held.allowed - arm.model.dof_frictionloss @ np.abs(arm.motion) < 0.01 * held.ended.size.max()
        ).all()
        # Negative control: the wrench of the other sign is not what they read.
        wrong = balance(arm, held.ended.q, -0.1 * wrench, gravity)
        assert not replace(held, ended=wrong).agrees


def test_any_chain_holds_what_statics_says(chain):
    for seed in range(2):
        arm = chain(seed)
        held = hold(arm, *at_random(arm, seed), gravity=seed % 2 == 0)
        assert held.agrees, (seed, held.difference, held.allowed, held.rate)


@pytest.mark.parametrize("frame", ["body", "tool", "none"])
def test_what_carries_no_site_is_held_too(frame):
    """The body of a hand that is chosen, one that is named, and a tool of 0.2 kg at some way from it."""
    tool = ToolSection(body="palm", position=(0.1, 0.0, 0.05), mass=0.2)
    asked = {"body": {"body": "palm"}, "tool": {"tool": tool}, "none": {}}[frame]
    arm = arms.load(ROOT / "tests/models/gripper.xml", **asked)
    held = hold(arm, arm.configuration("home")[arm.wiring.qpos], [0, 0, -1, 0, 0, 0], gravity=frame == "tool")
    assert held.agrees, (held.difference, held.allowed)


def test_singular_or_not_every_joint_is_held():
    # The hands of joints 4 and 6 turn against each other for free in the task; as joints they do not.
    arm = shipped("stanford")
    held = hold(arm, [0.2, 0.3, 0.6, 0.4, 0.0, 0.1], [5, -3, 4, 0.5, 0.2, 0.4])
    assert held.agrees
    assert np.abs(held.ended.q - held.wanted.q).max() < 1e-2


def test_springs_are_held_too(made):
    arm = made(SPRINGS)
    for gravity in (False, True):
        held = hold(arm, [0.3, 0.2], [1, 2, 3, 0, 0, 0], gravity)
        assert held.agrees, (held.difference, held.allowed)


RUBBING = """<mujoco><compiler angle="radian"/><worldbody><body name="upper"><joint name="shoulder" axis="0 1 0" {}/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".03"/><body name="lower" pos=".4 0 0">
<joint name="elbow" axis="0 1 0" {}/><geom type="capsule" fromto=".08 0 0 .3 0 0" size=".02"/>
<site name="hand" pos=".3 0 0"/></body></body>
<body name="table" pos="0 0 -.2"><geom type="box" size="1 1 .1"/></body></worldbody></mujoco>"""


def test_a_joint_that_creeps_below_its_friction_is_still(made):
    """As MuJoCo's friction is soft: stiffer than by default, it takes seconds to give way."""
    friction = 'frictionloss="0.3" solimpfriction="0.999 0.999 0.001"'
    held = hold(made(RUBBING.format(friction, friction)), [-0.5, -0.3], [0, 0, -0.4, 0, 0, 0], seconds=4.0)
    assert held.agrees and STILL < held.rate < 1e-4 and np.abs(held.difference).max() > 1e-3
    smooth = hold(made(RUBBING.format("", "")), [-0.5, -0.3], [0, 0, -0.4, 0, 0, 0])
    assert smooth.agrees and smooth.rate <= STILL and np.abs(smooth.difference).max() < 1e-4
    # what the servo brakes counts beside the friction: a joint that falls is not still
    assert not hold(
        made(RUBBING.format(friction, friction)), [-0.5, -0.3], [0, 0, -0.4, 0, 0, 0], seconds=0.05
    ).agrees


def test_what_bears_a_part_of_the_wrench_is_named(made):
    text = RUBBING.format("", "")
    lying = hold(
        made(text), [0.0, 0.3], [0, 0, -1, 0, 0, 0], seconds=3.0
    )  # 0.2 m of lower are 6 cm below the table
    assert not lying.agrees and verdict(lying).endswith(
        "lower touches table, which carries part of the load: give other positions by --q or --keyframe."
    ), verdict(lying)
    ended = RUBBING.format("", 'range="-1 0.3" limited="true"')
    at_end = hold(made(ended), *HELD, seconds=3.0)
    assert not at_end.agrees and "elbow is at the end of the range" in verdict(at_end)
    assert verdict(hold(made(text), *HELD, seconds=3.0)).startswith("met")


FINGER = """<body pos=".3 0 0"><joint name="finger" axis="0 1 0" {}/>
<geom type="capsule" fromto="0 0 0 .1 0 0" size=".02" contype="0" conaffinity="0"/></body><site name="hand\""""
CLOSES = """<actuator><position joint="finger" kp="0.5"/></actuator>
<keyframe><key name="home" qpos="0 0 0" ctrl="0.2"/></keyframe></mujoco>"""
HELD = [-0.6, 0.3], [0, 0, -1, 0, 0, 0]


@pytest.mark.parametrize(
    ("at", "instead", "said"),
    [
        ('<site name="hand"', FINGER.format(""), 'joint "finger"'),
    ],
)
def test_what_else_bears_a_part_is_named(made, at, instead, said):
    text = RUBBING.format("", "").replace(at, instead)
    held = hold(made(text.replace("</mujoco>", CLOSES) if "finger" in text else text), *HELD, seconds=1.0)
    assert not held.agrees and said in verdict(held), verdict(held)


def test_an_arm_waits_for_what_it_carries(made):
    """A damped finger comes to rest after the arm would; then the drives give what statics says."""
    text = RUBBING.format("", "").replace('<site name="hand"', FINGER.format('damping="0.003"'))
    held = hold(made(text.replace("</mujoco>", CLOSES)), *HELD, seconds=10.0)
    assert held.agrees and len(held.run) > len(hold(made(RUBBING.format("", "")), *HELD).run)


def test_an_arm_is_not_held_beyond_its_limits():
    arm = shipped("planar_2link")
    with pytest.raises(QuestionError) as caught:
        hold(arm, [0.0, 3.0], np.zeros(6))
    assert str(caught.value) == says('… hold: joint "elbow" … [-2.79253, 2.79253] rad … 3; …')


def test_what_does_not_fit_is_refused():
    arm = shipped("planar_2link")
    with pytest.raises(QuestionError) as caught:
        balance(arm, [0, 0], [1, 2, 3])
    assert str(caught.value) == says("… wrench … 6 … [f; n] … (3,)")
    with pytest.raises(QuestionError) as caught:
        balance(arm, [0], np.zeros(6))
    assert str(caught.value) == says("q … 2 … joint … (1,)")


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
        in_world = (found.wrench.reshape(2, 3) @ R_a.T).ravel()
        # J of each site, by MuJoCo.
        assert_allclose(other.jacobian(q).T @ in_world, arm.jacobian(q).T @ wrench, atol=ROUNDING)
        rates = rng.normal(size=arm.n)
        twist_a, twist_b = (
            (one.jacobian(q) @ rates).reshape(2, 3) @ R for one, R in ((other, R_a), (arm, R_b))
        )
        assert_allclose(found.velocity_transform @ twist_b.ravel(), twist_a.ravel(), atol=ROUNDING)
        assert_allclose(found.force_transform, np.linalg.inv(found.velocity_transform).T, atol=ROUNDING)
        # Negative control: the transpose of the same direction, as a source prints it.
        printed = found.velocity_transform.T @ (wrench.reshape(2, 3) @ R_b).ravel()
        assert np.abs(printed - found.wrench).max() > 1e-3


def test_a_wrench_on_another_body_is_refused(tmp_path):
    path = tmp_path / "chain.xml"
    path.write_text(random_chain(1, 5, ranges=True))
    with pytest.raises(QuestionError) as caught:
        elsewhere(arms.load(path, "tip"), np.zeros(5), np.ones(6), "middle")
    assert str(caught.value) == says('--at: "middle" … "tip": tip')
