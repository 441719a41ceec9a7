"""What a controller is made of and told: models, laws in files, poses and twists in any form and frame, batches."""

import inspect

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

import rmrc
from project import ROOT
from rmrc.arm import load as load_arm
from rmrc.law.controller import Controller
from rmrc.scenario import ControlSection, TaskSection, load
from rmrc.scenario.choices import DAMPING_BELOW, DAMPING_MAXIMUM, INVERSES, SCHEDULES, Status
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


def test_a_specification_is_given_a_site_where_a_body_is_controlled_and_stays_as_it_is():
    spec = mujoco.MjSpec.from_file(str(PUMA))
    count, body = len(spec.sites), ARM.model.body(int(ARM.model.nbody) - 1).name
    by_file, by_spec = (rates(Controller(model, body=body), twist=TWIST) for model in (PUMA, spec))
    assert_array_equal(by_spec, by_file)
    assert len(spec.sites) == count
    with pytest.raises(ModelError, match="a compiled model needs a site at the frame that is controlled"):
        Controller(spec.compile(), body=body)


def test_actuators_are_found_and_those_that_are_not_there_are_told():
    assert Controller("ur5e").actuators.tolist() == [0, 1, 2, 3, 4, 5]
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint name="a"/><geom size="1"/><body pos="1 0 0"><joint name="b" axis="0 1 0"/>'
        '<geom size="1"/><site name="tip" pos="1 0 0"/></body></body></worldbody>'
        '<actuator><motor joint="b"/></actuator></mujoco>'
    )
    with pytest.raises(ModelError, match='no actuator drives joint "a"'):
        Controller(model, "tip").actuators  # noqa: B018


@pytest.mark.parametrize(
    ("about", "error", "says"),
    [
        ({"model": "pume560"}, ModelError, "no such model file"),
        ({"model": "\n<mujoco/>"}, QuestionError, "give a file, or mujoco.MjSpec.from_string"),
        ({"model": 3}, QuestionError, "model must be a file, an Arm, an MjModel or an MjSpec, got int"),
        ({"site": "no such"}, ModelError, 'has no site "no such"'),
        ({"site": "tool", "body": "link6"}, QuestionError, "give site or body, not both"),
        ({"model": ARM, "site": "tool"}, QuestionError, "an Arm has its site and joints"),
        ({"period": 0.0}, QuestionError, "period must be > 0 and finite"),
        ({"watchdog": -1.0}, QuestionError, "watchdog must be > 0 and finite"),
        ({"control": 3}, QuestionError, "control must be a mapping, a file, a ControlSection or a Scenario, got int"),
        ({"control": "nowhere.yaml"}, ScenarioError, "nowhere.yaml: no such file"),
        ({"control": {"feedbak": 3}}, ScenarioError, 'control.feedbak: unknown key; did you mean "feedback"'),
        ({"control": {"control": {"feedback": -3}}}, ScenarioError, "control.feedback: must be >= 0, got -3"),
        ({"control": {"limits": {"rate": [1.0, 2.0]}}}, ScenarioError, "control.limits.rate: must have 6 values"),
        ({"control": {"at_singularity": "slow"}, "task": {"weights": [1.0]}}, ScenarioError, "task.weights"),
        ({"control": {"inverse": {"method": "inverse"}}, "task": {"axes": ["x"]}}, ScenarioError, "6 joints"),
        ({"task": {"axes": ["w"]}}, ScenarioError, "task.axes[0]: must be one of"),
    ],
)  # fmt: skip
def test_what_no_controller_can_be_made_of_is_told(about, error, says):
    with pytest.raises(error) as caught:
        Controller(**({"model": PUMA} | about))
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "q", [np.zeros(5), np.zeros((2, 5)), np.zeros((1, 1, 6)), np.full(6, np.nan), "home", np.zeros((0, 6))]
)
def test_positions_that_no_arm_has_are_refused_by_reset(q):
    with pytest.raises(QuestionError, match="q must be"):
        Controller(ARM).reset(q)


# Laws -------------------------------------------------------------------------------------------

DAMPING = {"maximum": 0.1, "below": 0.3}  # of a law without an arm
KEYS = {"period": 0.002, "feedback": 7.0, "inverse": {"method": "jparse", "damping": DAMPING}}


def test_a_law_is_the_same_from_a_mapping_a_section_and_a_file(tmp_path):
    text = "period: 0.002\nfeedback: 7\ninverse: {method: jparse, damping: {maximum: 0.1, below: 0.3}}\n"
    block = "control:\n" + "".join(f"  {line}\n" for line in text.splitlines())
    for name, content in {"keys": text, "block": block}.items():
        (tmp_path / f"{name}.yaml").write_text(content, "utf-8")
    sources = [
        KEYS,
        {"control": KEYS},
        ControlSection(**KEYS),
        tmp_path / "keys.yaml",
        str(tmp_path / "block.yaml"),
    ]
    for source in sources:
        assert Controller(ARM, control=source).control == ControlSection(**KEYS)
    (tmp_path / "wrong.yaml").write_text("feedback: 7\nperiod: fast\n", "utf-8")
    with pytest.raises(ScenarioError, match=r"wrong\.yaml:2:9: control\.period: must be a number"):
        Controller(ARM, control=tmp_path / "wrong.yaml")


def test_a_scenario_gives_its_law_task_and_frame_and_what_is_given_is_first():
    scenario = load(ROOT / "scenarios/stanford_wrist.yaml")
    for source in (scenario, ROOT / "scenarios/stanford_wrist.yaml", "stanford_wrist"):
        one = Controller(scenario.arm.model, control=source)
        assert one.control == scenario.control and one.arm.site == scenario.arm.site
        assert one.task.axes == scenario.task.axes and one.task.length == scenario.task.length
    one = Controller(scenario.arm.model, control=scenario, task=TaskSection(axes=("x", "y")), period=0.004)
    assert one.task.axes == ("x", "y") and one.period == one.control.period == 0.004


def test_a_period_needs_no_whole_steps_of_mujoco():
    assert Controller(ARM, control={"period": 0.0025, "feedback": 1}).period == 0.0025


def test_the_defaults_of_one_inverse_are_those_of_a_scenario():
    defaults, inverse = inspect.signature(rmrc.resolve_rates).parameters, ControlSection().inverse
    assert (defaults["method"].default, defaults["schedule"].default) == (
        inverse.method,
        inverse.damping.schedule,
    )
    J, t = np.diag([1.5, 0.2, 0.004]), np.array([1.0, -2.0, 3.0])
    homes = {
        "damping_maximum": DAMPING_MAXIMUM.null, "damping_below": DAMPING_BELOW.null,
        "damping_manipulability_below": inverse.damping.manipulability_below,
        "damping_error_gain": inverse.damping.error_gain, "tolerance": inverse.tolerance, "cutoff": inverse.cutoff,
        "gamma": inverse.gamma, "rate_bound": inverse.rate_bound,
    }  # fmt: skip
    for method, schedule in [
        *((name, "constant") for name in INVERSES.names),
        *(("damped", name) for name in SCHEDULES.names),
    ]:
        chosen = {"method": method, "schedule": schedule, "error": 0.5}
        want = rmrc.resolve_rates(J, t, **chosen, **homes)
        assert_array_equal(rmrc.resolve_rates(J, t, **chosen), want)


def test_without_a_task_it_is_what_the_arm_can_do():
    assert Controller("planar_2link").task.axes == ("x", "y")


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


@pytest.mark.parametrize(
    "turn", [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0.5, 0.5, -0.5, 0.5]]
)
def test_every_branch_of_a_matrix_gives_its_rotation(turn):
    """Each of the four rows may be the largest; the oracle is scipy."""
    nearby = Rotation.from_quat(turn, scalar_first=True) * Rotation.from_rotvec([0.1, -0.2, 0.15])
    T = np.eye(4)
    T[:3, :3] = nearby.as_matrix()
    one = Controller(ARM, control={"limits": {"on_excess": "none"}})
    one.step(Q, pose=T)
    back = one.command.pose_error[3:].copy()
    one.step(Q, pose=np.r_[np.zeros(3), nearby.as_quat(scalar_first=True)])
    assert_allclose(back, one.command.pose_error[3:], atol=1e-12)


def test_frames_turn_pose_and_twist():
    spec = mujoco.MjSpec.from_file(str(ROOT / "models/ur5e.xml"))
    spec.worldbody.first_body().pos, spec.worldbody.first_body().quat = (
        [0.1, -0.2, 0.3],
        [0.5, 0.1, -0.7, 0.4],
    )
    base = Controller(spec, "tool")
    q = base.arm.configuration("home")[base.arm.wiring.qpos] + 0.1
    site, foot = (np.asarray(pose) for pose in (base.arm.pose(q), base.arm.base_pose))
    R_site, R_foot = (Rotation.from_quat(pose[3:], scalar_first=True) for pose in (site, foot))
    assert np.abs(foot[3:] - [1, 0, 0, 0]).max() > 0.1  # it is turned
    target, turn = site[:3] + np.array([0.01, 0.02, -0.01]), Rotation.from_rotvec([0.05, 0.0, -0.02]) * R_site
    twist = np.r_[R_site.apply(TWIST[:3]), R_site.apply(TWIST[3:])]

    def answer(**given):
        base.reset(q)
        return base.step(q, **given).qdot_cmd.copy()

    def seen_from(pose, R):
        p = R.inv().apply(target - pose[:3])
        return np.r_[p, (R.inv() * turn).as_quat(scalar_first=True)], np.r_[
            R.inv().apply(twist[:3]), R.inv().apply(twist[3:])
        ]

    want = answer(pose=np.r_[target, turn.as_quat(scalar_first=True)], twist=twist)
    for name, pose, R in (("base", foot, R_foot), ("site", site, R_site)):
        own_pose, own_twist = seen_from(pose, R)
        assert_allclose(answer(pose=own_pose, twist=own_twist, frame=name), want, rtol=0, atol=1e-12)
        # negative control: the same numbers along world axes are another wish
        assert np.abs(answer(pose=own_pose, twist=own_twist) - want).max() > 1e-3
    assert_allclose(answer(twist=TWIST, frame="site"), answer(twist=twist), rtol=0, atol=1e-12)
    assert_allclose(answer(frame="site"), 0.0, atol=1e-12)


def test_pose_alone_is_feedback_and_twist_alone_is_feedforward():
    p, turn = wanted_pose()
    pose = np.r_[p, turn.as_quat(scalar_first=True)]
    one = Controller(
        ARM,
        control={"inverse": {"method": "pseudoinverse"}, "feedback": 3.0, "limits": {"on_excess": "none"}},
    )
    J = ARM.jacobian(Q)
    error = np.r_[
        p - ARM.pose(Q)[:3], (turn * Rotation.from_quat(ARM.pose(Q)[3:], scalar_first=True).inv()).as_rotvec()
    ]
    # residuals of a solve: rounding times the condition number, some hundreds here
    assert_allclose(J @ rates(one, pose=pose), 3.0 * error, atol=1e-12)
    assert_allclose(J @ rates(one, twist=TWIST), TWIST, atol=1e-12)
    assert_allclose(J @ rates(one, pose=pose, twist=TWIST), TWIST + 3.0 * error, atol=1e-12)
    assert_allclose(rates(one), 0.0, atol=1e-14)


# Batches ----------------------------------------------------------------------------------------


def test_a_world_of_a_batch_is_the_same_alone_to_the_bit():
    rng, law = (
        np.random.default_rng(0),
        {"limits": {"rate": 1.0, "acceleration": 4.0}, "nullspace": {"objective": "posture"}},
    )
    many, alone = Controller(ARM, control=law), Controller(ARM, control=law)
    starts = Q + rng.uniform(-0.2, 0.2, (5, 6))
    poses = np.array([ARM.pose(q) for q in starts + rng.uniform(-0.1, 0.1, (5, 6))])
    twists = rng.normal(size=(5, 6))

    def run(controller, starts, poses, twists):
        controller.reset(starts)
        q, found = starts.copy(), []
        for _ in range(20):
            out = controller.step(q, pose=poses, twist=twists)
            q = q + controller.period * out.qdot_cmd
            found.append(out.qdot_cmd.copy())
        return np.array(found)

    together = run(many, starts, poses, twists)
    assert together.shape == (20, 5, 6)
    for w in range(5):
        assert_array_equal(run(alone, starts[w], poses[w], twists[w]), together[:, w])
    assert many.command.status.shape == (5,) and len(many.command.limited_by) == 5
    assert many.command.damping.shape == (5,)


def test_one_wish_is_that_of_all_worlds_and_one_bad_world_leaves_the_others():
    one = Controller(ARM)
    one.reset(np.tile(Q, (3, 1)))
    pose = ARM.pose(Q) + np.array([0.01, 0, 0, 0, 0, 0, 0])
    one.step(np.tile(Q, (3, 1)), pose=pose)
    first = one.step(np.tile(Q, (3, 1)), pose=pose).qdot_cmd.copy()  # which starts from the one before
    assert_array_equal(first[0], first[2])
    one.reset()
    one.step(np.tile(Q, (3, 1)), pose=pose)
    q = np.tile(Q, (3, 1))
    q[1, 2] = np.nan
    out = one.step(q, pose=pose)
    assert [bool(s & Status.INVALID_INPUT) for s in out.status] == [False, True, False]
    assert_array_equal(out.qdot_cmd[[0, 2]], first[[0, 2]])
    assert [text != "" for text in out.problem] == [False, True, False]
    out = one.step(Q[:3], pose=pose)
    assert all(out.status & Status.INVALID_INPUT) and "reset made a batch of 3" in out.problem[0]
    for wrong in (mujoco.MjData(ARM.model), [mujoco.MjData(ARM.model)], None):
        out = one.step_data(wrong)
        assert "a batch of 3: step_data reads a list of as many mujoco.MjData" in out.problem[0]


def seen(q, model=ARM.model):
    """Return data of the arm with fresh kinematics."""
    data = mujoco.MjData(model)
    data.qpos[:6] = q
    mujoco.mj_fwdPosition(model, data)
    return data


def test_data_of_a_batch_are_a_list_and_each_world_is_the_same_alone_to_the_bit():
    rng, one, alone = np.random.default_rng(2), Controller(ARM), Controller(ARM)
    other = mujoco.MjModel.from_xml_path(str(PUMA))  # models may differ, if each has the arm
    starts = Q + rng.uniform(-0.2, 0.2, (4, 6))
    data = [seen(q, model) for q, model in zip(starts, [ARM.model, other, other, ARM.model], strict=True)]
    twists = rng.normal(size=(4, 6))
    one.reset(starts)
    together = np.array([one.step_data(list(data), twist=twists).qdot_cmd.copy() for _ in range(3)])
    assert one.command.problem == [""] * 4
    for w in range(4):
        alone.reset(starts[w])
        for t in range(3):
            assert_array_equal(alone.step_data(data[w], twist=twists[w]).qdot_cmd, together[t, w])


def test_stale_kinematics_brake_their_world_alone_and_say_what_to_call():
    one = Controller(ARM, control={"limits": {"acceleration": 2.0}})
    one.reset(np.tile(Q, (2, 1)))
    data = [seen(Q), seen(Q)]
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
    out = one.step_data(data, twist=TWIST)
    assert out.problem == ["", ""] and not any(s & Status.INVALID_INPUT for s in out.status)
    # one arm; what has no kinematics at all; and what has other positions since
    single = Controller(ARM)
    assert single.step_data(mujoco.MjData(ARM.model), twist=TWIST).problem.startswith(
        "the kinematics of data"
    )
    fresh = seen(Q)
    assert single.step_data(fresh, twist=TWIST).problem == ""
    mujoco.mj_resetData(ARM.model, fresh)
    assert single.step_data(fresh, twist=TWIST).problem.startswith("the kinematics of data")
    # a position that is none is told as such
    bad = seen(Q)
    bad.qpos[2] = np.nan
    assert "is not finite" in single.step_data(bad, twist=TWIST).problem


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


def test_a_law_without_an_arm_has_batches_limits_and_words():
    rng = np.random.default_rng(1)
    J, twist = rng.normal(size=(4, 3, 7)), rng.normal(size=(4, 3))
    law = rmrc.Law(7, 3, {"limits": {"rate": 0.5}, "period": 0.01})
    law.reset(worlds=4)
    together = law.step(J, twist).qdot_cmd.copy()
    assert np.abs(together).max() == pytest.approx(0.5)
    alone = rmrc.Law(7, 3, {"limits": {"rate": 0.5}})
    for w in range(4):
        alone.reset()
        assert_array_equal(alone.step(J[w], twist[w]).qdot_cmd, together[w])
    assert "rate" in alone.command.limited_by or not alone.command.status & Status.RATE_LIMITED
    told = {
        "J must be (3, 7), got (4, 3, 7); reset makes a batch": (J, twist),
        "twist must be (3,), got (6,)": (J[0], np.zeros(6)),
        "J must be numbers, got str": ("J", twist[0]),
        "the Jacobian, or the pose of the site, is not finite, or beyond 1e+10": (J[0] * np.nan, twist[0]),
    }
    for text, given in told.items():
        out = alone.step(*given)
        assert out.problem == text and out.status & Status.INVALID_INPUT
    limited = rmrc.Law(2, 2, position_limit=[[-1, 1], [-1, 1]])
    assert limited.step(np.eye(2), np.ones(2)).problem.startswith("q is needed")
    assert limited.step(np.eye(2), np.ones(2), np.zeros(2)).problem == ""


JOINTS_OF_MORE = load_arm(ROOT / "models/xarm7.xml")
ERROR_SCHEDULE = {"method": "damped", "damping": {"schedule": "error", "error_gain": 0.3}}


@pytest.mark.parametrize("which", ["error", "gradient", "M", "qdot0"])
def test_what_depends_on_the_arm_may_be_given_with_each_step(which):
    """The same law with an arm, and on what this file makes of that arm: MuJoCo's M, numpy's slope, the second task."""
    arm = JOINTS_OF_MORE
    q = arm.configuration("home")[arm.wiring.qpos] + 0.1
    section = {
        "error": {"inverse": ERROR_SCHEDULE},
        "gradient": {
            "inverse": {"damping": DAMPING},
            "nullspace": {"objective": "manipulability", "gain": 2.0},
            "joint_weights": [1, 2, 3, 1, 1, 2, 1],
        },
        "M": {"inverse": {"method": "damped", "metric": "inertia", "damping": DAMPING}},
        "qdot0": {"inverse": {"damping": DAMPING}, "nullspace": {"objective": "rates", "rates": [0.1] * 7}},
    }[which]
    task = {"axes": ["x", "y", "z", "rx", "ry", "rz"], "length": 1.0}
    whole, bare = Controller(arm, control=section, task=task), rmrc.Law(7, 6, section)
    J, more = arm.jacobian(q), {}
    pose, sent = arm.pose(q), TWIST
    if which == "error":
        pose = pose + np.array([0.03, -0.02, 0.01, 0, 0, 0, 0])
        error = np.r_[0.03, -0.02, 0.01, np.zeros(3)]
        sent, more = TWIST + whole.control.feedback * error, {"error": np.linalg.norm(error)}
    if which == "gradient":
        scale = np.sqrt(1 / np.array(section["joint_weights"]))

        def w(q):
            return np.sqrt(np.linalg.det((J := arm.jacobian(q) * scale) @ J.T))

        more = {"gradient": [(w(q + step) - w(q - step)) / 2e-5 for step in 1e-5 * np.eye(7)]}
    if which == "M":
        data = seen_of(arm, arm.configuration("home")[arm.wiring.qpos])
        bare.step(
            J, sent, M=inertia_of(arm, data)
        )  # whose diagonal is the unit, as that of home is of an arm
        more = {"M": inertia_of(arm, seen_of(arm, q))}
    whole.reset(q)
    want, out = whole.step(q, pose=pose, twist=TWIST), bare.step(J, sent, **more)
    assert out.problem == "", out.problem
    # central differences of 1e-5 leave 1e-10 of a slope of order one, times the gain; the rest is rounding
    assert_allclose(out.qdot_cmd, want.qdot_cmd, rtol=0, atol=1e-8 if which == "gradient" else 1e-11)
    given = {"error": 2.0, "gradient": np.ones(7), "M": 3 * np.eye(7) + 1.0, "qdot0": -np.ones(7)}[which]
    before = out.qdot_cmd.copy()
    assert np.abs(bare.step(J, sent, **{which: given}).qdot_cmd - before).max() > 1e-3, "it is read"


def seen_of(arm, q):
    data = mujoco.MjData(arm.model)
    data.qpos[arm.wiring.qpos] = q
    mujoco.mj_forward(arm.model, data)
    return data


def inertia_of(arm, data):
    full = np.zeros((arm.model.nv, arm.model.nv))
    mujoco.mj_fullM(arm.model, data, full)
    return full[np.ix_(arm.wiring.dof, arm.wiring.dof)]


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
    batch = rmrc.Law(3, 3, {"nullspace": {"objective": "manipulability"}})
    batch.reset(worlds=2)
    J = np.array([J, J])
    assert batch.step(J, twist, gradient=np.zeros((2, 3))).problem == ["", ""]
    assert batch.step(J, twist, gradient=np.zeros(3)).problem == ["", ""]
    assert "made a batch of 2" in batch.step(J, twist, gradient=np.zeros(2)).problem[0]
    assert batch.step(J, twist, gradient=np.full(3, np.nan)).problem[1].startswith("gradient is not finite")


@pytest.mark.parametrize(
    ("arguments", "control", "says"),
    [
        ((0, 6), None, "n must be 1 or more"),
        ((7, 7), None, "m 1 to 6"),
        (
            (7, 6),
            {"nullspace": {"objective": "secondary"}},
            'use rmrc.Controller, or "rates", and give qdot0',
        ),
        ((7, 6), {"at_singularity": "stop"}, "use rmrc.Controller"),
        ((7, 6), {"at_singularity": "singularity_consistent"}, "use rmrc.Controller"),
        ((7, 6), {"at_singularity": "keep_out"}, "use rmrc.Controller"),
        ((7, 6), {"nullspace": {"objective": "joint_limits"}}, "needs position_limit"),
        ((7, 6), {"limits": {"jerk": [1.0]}}, "must have 7 values"),
    ],
)
def test_what_a_jacobian_alone_cannot_do_is_refused(arguments, control, says):
    with pytest.raises((QuestionError, ScenarioError)) as caught:
        rmrc.Law(*arguments, control)
    assert says in str(caught.value) and "\n" not in str(caught.value)
