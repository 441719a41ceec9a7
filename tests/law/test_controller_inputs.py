"""What a controller is made of and told: models, laws in files, poses and twists in any form and frame, batches."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

import rmrc
from project import ROOT
from rmrc.arm import load as load_arm
from rmrc.law.controller import Controller
from rmrc.scenario.choices import Status
from rmrc.support.errors import ModelError, QuestionError, ScenarioError

PUMA = ROOT / "models/puma560.xml"
ARM = load_arm(PUMA)
Q = np.array([0.2, -0.9, 0.7, 0.4, 0.6, -0.3])
TWIST = np.array([0.1, -0.05, 0.02, 0.2, 0.1, -0.3])


def rates(controller, **given):
    controller.reset(Q)
    out = controller.step(Q, **given)
    assert out.problem == "", out.problem
    return out.qdot_cmd.copy()


# Models -----------------------------------------------------------------------------------------


def test_an_arm_is_the_same_from_a_file_a_name_a_model_and_a_specification():
    spec = mujoco.MjSpec.from_file(str(PUMA))
    compiled = spec.copy().compile()
    models = [PUMA, str(PUMA), "puma560", ARM, spec, compiled]
    found = [rates(Controller(model), twist=TWIST) for model in models]
    for one in found[1:]:
        assert_array_equal(one, found[0])
    assert np.abs(found[0]).max() > 0.01


@pytest.mark.parametrize(
    ("about", "error", "says"),
    [
        ({"model": "pume560"}, ModelError, "no such model file"),
        ({"model": 3}, QuestionError, "model must be a file, an Arm, an MjModel or an MjSpec, got int"),
        ({"watchdog": "soon"}, QuestionError, "watchdog must be > 0 and finite [s], or None, got soon"),
        ({"period": 0.0}, QuestionError, "period must be > 0 and finite"),
        ({"joints": []}, ModelError, "must name one joint or more; the chain: theta_1, "),
        ({"control": {"feedbak": 3}}, ScenarioError, 'control.feedbak: unknown key; did you mean "feedback"'),
        ({"control": {"limits": {"rate": [1.0, 2.0]}}}, ScenarioError, "control.limits.rate: must have 6 values"),
    ],
)  # fmt: skip
def test_what_no_controller_can_be_made_of_is_told(about, error, says):
    with pytest.raises(error) as caught:
        Controller(**({"model": PUMA} | about))
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


# Laws -------------------------------------------------------------------------------------------

DAMPING = {"maximum": 0.1, "below": 0.3}  # of a law without an arm


# Poses, twists, frames --------------------------------------------------------------------------


def wanted_pose():
    pose = ARM.pose(Q)
    turn = Rotation.from_rotvec([0.02, -0.03, 0.01]) * Rotation.from_quat(pose[3:], scalar_first=True)
    return pose[:3] + np.array([0.01, -0.005, 0.002]), turn


def test_a_pose_is_the_same_as_quaternion_matrix_and_rotation_vector():
    p, turn = wanted_pose()
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn.as_matrix(), p
    quat = turn.as_quat(scalar_first=True)
    one = Controller(ARM)
    want = rates(one, pose=np.r_[p, quat])
    for pose in (np.r_[p, -quat], np.r_[p, 0.5 * quat], np.r_[p, turn.as_rotvec()], T, T.tolist()):
        assert_allclose(rates(one, pose=pose), want, rtol=0, atol=1e-12)
    assert np.abs(want).max() > 0.1


def test_frames_turn_pose_and_twist():
    spec = mujoco.MjSpec.from_file(str(ROOT / "models/ur5e.xml"))
    foot = spec.worldbody.first_body()
    foot.pos, foot.quat = [0.1, -0.2, 0.3], [0.5, 0.1, -0.7, 0.4]
    base = Controller(spec, "tool")
    q = base.arm.configuration("home")[base.arm.wiring.qpos] + 0.1
    site, foot = (np.asarray(pose) for pose in (base.arm.pose(q), base.arm.base_pose))
    R_site, R_foot = (Rotation.from_quat(pose[3:], scalar_first=True) for pose in (site, foot))
    assert np.abs(foot[3:] - [1, 0, 0, 0]).max() > 0.1  # it is turned
    target, turn = site[:3] + np.array([0.01, 0.02, -0.01]), Rotation.from_rotvec([0.05, 0.0, -0.02]) * R_site
    twist = R_site.apply(TWIST.reshape(2, 3)).ravel()

    def answer(**given):
        base.reset(q)
        return base.step(q, **given).qdot_cmd.copy()

    want = answer(pose=np.r_[target, turn.as_quat(scalar_first=True)], twist=twist)
    for name, pose, R in (("base", foot, R_foot), ("site", site, R_site)):
        p = R.inv().apply(target - pose[:3])
        own_pose = np.r_[p, (R.inv() * turn).as_quat(scalar_first=True)]
        own_twist = R.inv().apply(twist.reshape(2, 3)).ravel()
        assert_allclose(answer(pose=own_pose, twist=own_twist, frame=name), want, rtol=0, atol=1e-12)
        # negative control: the same numbers along world axes are another wish
        assert np.abs(answer(pose=own_pose, twist=own_twist) - want).max() > 1e-3
    assert_allclose(answer(twist=TWIST, frame="site"), answer(twist=twist), rtol=0, atol=1e-12)
    assert_allclose(answer(frame="site"), 0.0, atol=1e-12)


# Batches ----------------------------------------------------------------------------------------


def seen(arm, q):
    """Return data of an arm with fresh kinematics and forces."""
    data = mujoco.MjData(arm.model)
    data.qpos[arm.wiring.qpos] = q
    mujoco.mj_forward(arm.model, data)
    return data


@pytest.mark.parametrize("reads_data", [False, True])
def test_a_world_of_a_batch_is_the_same_alone_to_the_bit(reads_data):
    rng = np.random.default_rng(0)
    law = {"limits": {"rate": 1.0, "acceleration": 4.0}, "nullspace": {"objective": "posture"}}
    starts = Q + rng.uniform(-0.2, 0.2, (5, 6))
    poses = np.array([ARM.pose(q) for q in starts + rng.uniform(-0.1, 0.1, (5, 6))])
    twists = rng.normal(size=(5, 6))

    def run(starts, poses, twists):
        one, q, sent = Controller(ARM, control=law), starts.copy(), []
        one.reset(starts)
        for _ in range(20):
            if reads_data:
                data = [seen(ARM, row) for row in q] if q.ndim > 1 else seen(ARM, q)
                out = one.step_data(data, pose=poses, twist=twists)
            else:
                out = one.step(q, pose=poses, twist=twists)
            q = q + one.period * out.qdot_cmd
            sent.append(out.qdot_cmd.copy())
        return np.array(sent)

    together = run(starts, poses, twists)
    for w in range(5):
        assert_array_equal(run(starts[w], poses[w], twists[w]), together[:, w])


def test_one_wish_is_that_of_all_worlds_and_one_bad_world_leaves_the_others():
    one, pose, q = Controller(ARM), ARM.pose(Q) + np.array([0.01, 0, 0, 0, 0, 0, 0]), np.tile(Q, (3, 1))
    one.reset(q)
    first = one.step(q, pose=pose).qdot_cmd.copy()
    assert_array_equal(first[0], first[2])
    one.reset()
    q[1, 2] = np.nan
    out = one.step(q, pose=pose)
    assert [bool(s & Status.INVALID_INPUT) for s in out.status] == [False, True, False]
    assert_array_equal(out.qdot_cmd[[0, 2]], first[[0, 2]])
    assert [text != "" for text in out.problem] == [False, True, False]
    assert "reset made a batch of 3" in one.step(Q[:3], pose=pose).problem[0]
    for wrong in (mujoco.MjData(ARM.model), [mujoco.MjData(ARM.model)], None):
        assert "step_data reads a list of as many mujoco.MjData" in one.step_data(wrong).problem[0]


def test_stale_kinematics_brake_their_world_alone_and_say_what_to_call():
    one, data = Controller(ARM, control={"limits": {"acceleration": 2.0}}), [seen(ARM, Q), seen(ARM, Q)]
    one.reset(np.tile(Q, (2, 1)))
    for _ in range(5):
        moving = one.step_data(data, twist=TWIST).qdot_cmd.copy()
    data[1].qpos[5] += 1e-6  # what mj_step does: it leaves positions that are newer than the kinematics
    out = one.step_data(data, twist=TWIST)
    assert out.problem[0] == "" and "call mj_fwdPosition, or mj_kinematics" in out.problem[1]
    assert [bool(s & Status.INVALID_INPUT) for s in out.status] == [False, True]
    # braked, by no more than its acceleration
    assert np.abs(out.qdot_cmd[1]).sum() < np.abs(moving[1]).sum()
    assert np.abs(out.qdot_cmd[1] - moving[1]).max() <= 2.0 * one.period * (1 + 1e-9)
    mujoco.mj_kinematics(ARM.model, data[1])
    assert one.step_data(data, twist=TWIST).problem == ["", ""]
    # one arm: what has no kinematics at all, and a position that is none
    single, bad = Controller(ARM), seen(ARM, Q)
    assert single.step_data(mujoco.MjData(ARM.model)).problem.startswith("the kinematics of data")
    bad.qpos[2] = np.nan
    assert "is not finite" in single.step_data(bad).problem


# Without an arm -----------------------------------------------------------------------------------


def test_a_jacobian_gives_the_rates_of_the_arm_that_has_it():
    """The same law on J of MuJoCo and the feedback of this file: two ways to the twist, and one law behind."""
    section = {
        "inverse": {"damping": DAMPING},
        "limits": {"rate": 0.8, "acceleration": 5.0},
        "feedback": 2.0,
        "joint_weights": [1, 2, 1, 3, 1, 1],
    }
    arm = Controller(ARM, control=section, task={"length": 1})
    law = rmrc.Law(6, 6, section, position_limit=ARM.position_limit, joints=ARM.joints)
    p, turn = wanted_pose()
    pose, q = np.r_[p, turn.as_quat(scalar_first=True)], Q.copy()
    arm.reset(Q)
    law.reset(Q)
    for _ in range(50):
        want = arm.step(q, pose=pose, twist=TWIST)
        out = law.step(ARM.jacobian(q), TWIST + 2.0 * want.pose_error, q)
        assert_allclose(out.qdot_cmd, want.qdot_cmd, rtol=0, atol=1e-11)
        assert out.status == want.status and out.limited_by == want.limited_by
        q = q + arm.period * want.qdot_cmd
    assert want.status & (Status.RATE_LIMITED | Status.ACCELERATION_LIMITED)


XARM = load_arm(ROOT / "models/xarm7.xml")
ERROR_SCHEDULE = {"method": "damped", "damping": {"schedule": "error", "error_gain": 0.3}}
WEIGHTS = [1, 2, 3, 1, 1, 2, 1]
GIVEN = {
    "error": ({"inverse": ERROR_SCHEDULE}, 2.0),
    "gradient": ({"joint_weights": WEIGHTS, "nullspace": {"objective": "manipulability", "gain": 2.0}}, np.ones(7)),
    "M": ({"inverse": {"method": "damped", "metric": "inertia"}}, 3 * np.eye(7) + 1.0),
    "qdot0": ({"nullspace": {"objective": "rates", "rates": [0.1] * 7}}, -np.ones(7)),
}  # fmt: skip


@pytest.mark.parametrize("which", GIVEN)
def test_what_depends_on_the_arm_may_be_given_with_each_step(which):
    """The same law with an arm, and on what this file makes of that arm: MuJoCo's M, numpy's slope, the second task."""
    section, other = GIVEN[which]
    section = {"inverse": {"damping": DAMPING}} | section
    section["inverse"].setdefault("damping", DAMPING)
    home = XARM.configuration("home")[XARM.wiring.qpos]
    q, task = home + 0.1, {"axes": ["x", "y", "z", "rx", "ry", "rz"], "length": 1.0}
    whole, bare = Controller(XARM, control=section, task=task), rmrc.Law(7, 6, section)
    J, more, pose, sent = XARM.jacobian(q), {}, XARM.pose(q), TWIST
    if which == "error":
        error = np.r_[0.03, -0.02, 0.01, np.zeros(3)]
        pose, more = pose + np.r_[error[:3], np.zeros(4)], {"error": np.linalg.norm(error)}
        sent = TWIST + whole.control.feedback * error
    if which == "gradient":
        w = lambda q: np.prod(np.linalg.svd(XARM.jacobian(q) / np.sqrt(WEIGHTS), compute_uv=False))  # noqa: E731
        more = {"gradient": [(w(q + step) - w(q - step)) / 2e-5 for step in 1e-5 * np.eye(7)]}
    if which == "M":
        bare.step(J, sent, M=inertia(home))  # whose diagonal is the unit, as that of home is of an arm
        more = {"M": inertia(q)}
    whole.reset(q)
    want, out = whole.step(q, pose=pose, twist=TWIST), bare.step(J, sent, **more)
    assert out.problem == "", out.problem
    # central differences of 1e-5 leave 1e-10 of a slope of order one, times the gain; the rest is rounding
    assert_allclose(out.qdot_cmd, want.qdot_cmd, rtol=0, atol=1e-8 if which == "gradient" else 1e-11)
    before = out.qdot_cmd.copy()
    assert np.abs(bare.step(J, sent, **{which: other}).qdot_cmd - before).max() > 1e-3, "it is read"


def inertia(q):
    full = np.zeros((XARM.model.nv, XARM.model.nv))
    mujoco.mj_fullM(XARM.model, seen(XARM, q), full)
    return full[np.ix_(XARM.wiring.dof, XARM.wiring.dof)]


def test_what_is_missing_or_wrong_beside_a_jacobian_brakes_and_is_told():
    J, twist = np.eye(3), np.ones(3)
    law = rmrc.Law(3, 3, {"inverse": {"metric": "inertia"}})
    told = {
        'M is needed: the metric "inertia" reads it': {},
        "M must be (3, 3), got (3,)": {"M": np.ones(3)},
        "M is not positive definite, or not finite": {"M": -np.eye(3)},
        'error is given, and the schedule "error" is not chosen': {"M": np.eye(3), "error": 1.0},
    }
    for text, given in told.items():
        assert law.step(J, twist, **given).problem == text
    assert law.step(J, twist, M=np.eye(3)).problem == ""
    out = law.step(J, twist, M=np.diag([1.0, -1.0, 1.0]))
    assert out.problem.startswith("M is not positive definite") and out.status & Status.INVALID_INPUT
