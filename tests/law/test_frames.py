"""Rows along the axes of the world, the base or the site, against mj_jacSite and scipy's rotations."""

import itertools

import mujoco
import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from chains import random_chain, seeds
from project import ROOT, examples, mostly_long
from rmrc.arm import load
from rmrc.law.bare import resolve_rates
from rmrc.law.controller import Controller
from rmrc.law.kinematics import BASE, FRAMES, SITE, WORLD
from rmrc.law.task import Task, View
from rmrc.scenario import ControlSection
from rmrc.scenario.choices import INVERSES, LIMITS, OBJECTIVES, POLICIES
from rmrc.support.spatial import AXES

# J, error and twist of arms of a meter are a few dozen roundings of 1e-16 away from the oracle's; what is
# inverted with singular values above 0.1, by an exact inverse, a hundred times that.
ROUNDING = 1e-11

PUMA = load(ROOT / "models/puma560.xml")
Q = np.array([0.3, -0.9, 3.4, 0.2, 0.9, 0.3])


def site_axes(arm, q):
    """Return position and rotation matrix of the site, and mj_jacSite."""
    data = mujoco.MjData(arm.model)
    data.qpos[:] = arm.configuration(q)
    mujoco.mj_fwdPosition(arm.model, data)
    J = np.zeros((6, arm.model.nv))
    site = arm.model.site(arm.site).id
    mujoco.mj_jacSite(arm.model, data, J[:3], J[3:], site)
    dof = [int(arm.model.joint(name).dofadr[0]) for name in arm.joints]
    base = data.xmat[arm.wiring.base].reshape(3, 3).copy()
    return data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy(), J[:, dof], base


def both(R):
    """Return the matrix that turns both halves of a twist."""
    return np.kron(np.eye(2), R)


def control(**more):
    plain = {"limits": {"on_excess": "none", "position": False}, "inverse": {"method": "inverse"}}
    return ControlSection.model_validate(plain | more)


def command(arm, frame, rows, q, pose, twist, section):
    data = mujoco.MjData(arm.model)
    data.qpos[:] = arm.configuration(q)
    mujoco.mj_fwdPosition(arm.model, data)
    task = Task(arm, np.array(rows), frame=frame)
    return Controller(arm, control=section, task=task).step_data(data, pose=pose, twist=twist)


def test_the_frames_have_their_codes():
    assert [FRAMES[code] for code in (WORLD, BASE, SITE)] == ["world", "base", "site"]


def turned_base(text):
    """Return a model whose arm stands on a body that is turned."""
    turn = '<body name="stand" pos="0.1 -0.2 0.3" quat="0.5 0.1 -0.7 0.4">'
    return text.replace("<worldbody>", f"<worldbody>{turn}", 1).replace(
        "</worldbody>", "</body></worldbody>", 1
    )


def stand(tmp_path_factory, seed, n=6):
    text = random_chain(seed, n).replace(
        '<body name="ball" pos="3 0 0"><freejoint/><geom size="0.1"/></body>', ""
    )
    path = tmp_path_factory.mktemp("chain") / "arm.xml"
    path.write_text(turned_base(text))
    return load(path)


@examples(5, 15)
@given(seeds)
def test_the_law_sees_the_jacobian_error_and_twist_along_the_axes_of_its_frame(tmp_path_factory, seed):
    rng = np.random.default_rng(seed)
    arm = stand(tmp_path_factory, seed)
    q, twist = rng.uniform(-1, 1, 6), rng.normal(size=6)
    point, R, J, B = site_axes(arm, q)
    turn = Rotation.from_rotvec(rng.normal(size=3))
    wanted = np.concatenate(
        [point + 0.1 * rng.normal(size=3), (turn * Rotation.from_matrix(R)).as_quat(scalar_first=True)]
    )
    error = np.concatenate([wanted[:3] - point, turn.as_rotvec()])
    rows = np.sort(rng.choice(6, rng.integers(1, 7), replace=False)).tolist()
    for frame, axes in (("world", np.eye(3)), ("base", B), ("site", R)):
        if frame == "site" and len({3, 4, 5} - set(rows)) == 1:
            continue  # a free axis has a test of its own
        got = command(
            arm, frame, rows, q, wanted, twist, control(inverse={"method": "transpose"}, feedback=3.0)
        )
        A = (both(axes).T @ J)[rows]
        v = (both(axes).T @ (twist + 3.0 * error))[rows]
        assert_allclose(got.pose_error, both(axes).T @ error, rtol=0, atol=ROUNDING)
        assert_allclose(got.sigma, np.linalg.svd(A, compute_uv=False), rtol=0, atol=ROUNDING)
        direction = A.T @ v  # the transpose is along it, whatever its step
        assert_allclose(
            got.qdot_cmd / np.linalg.norm(got.qdot_cmd),
            direction / np.linalg.norm(direction),
            rtol=0,
            atol=1e-9,
        )


def test_the_frame_of_all_six_rows_changes_no_rates_of_an_exact_inverse_but_its_weights_do():
    point, R, _, _ = site_axes(PUMA, Q)
    pose, twist = (
        np.concatenate([point, Rotation.from_matrix(R).as_quat(scalar_first=True)]),
        np.arange(1.0, 7.0),
    )
    rates = {
        frame: command(PUMA, frame, range(6), Q, pose, twist, control()).qdot_cmd.copy() for frame in FRAMES
    }
    for frame in FRAMES:
        assert_allclose(rates[frame], rates["world"], rtol=1e-9, atol=1e-9)
    damped = control(inverse={"method": "damped", "damping": {"schedule": "constant", "maximum": 0.5}})
    weights = [9.0, 1, 1, 1, 1, 1]
    found = {}
    for frame in ("world", "site"):
        task = Task(PUMA, np.arange(6), weights=weights, frame=frame)
        controller = Controller(PUMA, control=damped, task=task)
        found[frame] = controller.step(Q, pose=pose, twist=twist).qdot_cmd.copy()
    assert np.abs(found["site"] - found["world"]).max() > 0.01


def test_whitneys_rates_along_the_hand_are_those_of_the_body_jacobian():
    # Whitney's hand moves at 0.1 m/s along its own z and turns about it; J^-1 of the rows along the hand
    point, R, J, _ = site_axes(PUMA, Q)
    pose = np.concatenate([point, Rotation.from_matrix(R).as_quat(scalar_first=True)])
    hand = np.array([0, 0, 0.1, 0, 0, 0.2])
    got = command(PUMA, "site", range(6), Q, pose, both(R) @ hand, control()).qdot_cmd
    assert_allclose(both(R).T @ J @ got, hand, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("free", [0, 1, 2])
@pytest.mark.parametrize("about", [0.0, 1.0, 3.0, -3.1])
def test_a_free_axis_of_the_site_has_no_error_and_the_others_are_its_tilt(free, about):
    """However far the site has turned about the axis, what is fed back is the shortest turn of the axis itself."""
    point, R, J, _ = site_axes(PUMA, Q)
    axis = np.eye(3)[free]
    tilt = Rotation.from_rotvec(np.delete([0.2, -0.3, 0.1], free) @ np.delete(np.eye(3), free, axis=0))
    wanted = (Rotation.from_matrix(R) * tilt * Rotation.from_rotvec(about * axis)).as_quat(scalar_first=True)
    rows = [row for row in range(6) if row != 3 + free]
    section = control(inverse={"method": "pseudoinverse"}, feedback=1.0)
    got = command(PUMA, "site", rows, Q, np.concatenate([point, wanted]), np.zeros(6), section)
    want = tilt.as_rotvec()
    want[free] = about
    assert_allclose(got.pose_error, [0, 0, 0, *want], rtol=0, atol=ROUNDING)
    pose = np.array([*point, *Rotation.from_matrix(R).as_quat(scalar_first=True)])
    by_numpy = View("site", free=free).error(np.array([*point, *wanted]), pose)
    assert_allclose(by_numpy, got.pose_error, rtol=0, atol=ROUNDING)
    body = both(R).T @ J
    assert_allclose((body @ got.qdot_cmd)[rows], got.pose_error[rows], rtol=0, atol=1e-9)
    # the arm has one motion left that the task does not feel, a turn about the axis
    left = np.linalg.svd(body[rows])[2][-1]
    felt = body @ left
    assert np.abs(felt[rows]).max() < 1e-12 < abs(felt[3 + free])


def test_a_rotation_vector_would_feed_back_beside_the_tilt():
    """The negative control of the test above: with a turn of 3 rad it is off by half of that."""
    tilt, about = Rotation.from_rotvec([0.2, -0.3, 0.0]), Rotation.from_rotvec([0, 0, 3.0])
    plain = (tilt * about).as_rotvec()[:2]
    cosine = plain @ [0.2, -0.3] / np.linalg.norm(plain) / np.hypot(0.2, 0.3)
    assert cosine < 0.2


@examples(5, 15)
@given(seeds)
def test_the_rates_of_an_objective_are_not_felt_along_any_frame(tmp_path_factory, seed):
    rng = np.random.default_rng(seed)
    arm = stand(tmp_path_factory, seed, 7)
    q, rows = rng.uniform(-1, 1, 7), [0, 1, 2, 3, 4]
    point, R, J, B = site_axes(arm, q)
    pose = np.concatenate([point, Rotation.from_matrix(R).as_quat(scalar_first=True)])
    section = control(
        inverse={"method": "pseudoinverse"},
        nullspace={"objective": "rates", "rates": rng.normal(size=7).tolist()},
    )
    for frame, axes in (("base", B), ("site", R)):
        got = command(arm, frame, rows, q, pose, np.zeros(6), section).qdot_cmd
        felt = (both(axes).T @ J @ got)[rows]
        assert np.abs(got).max() > 1e-3
        # relative to the rates: the directions of small σ are found to 1e-16 σ_1/σ
        assert np.abs(felt).max() < 1e-9 * np.abs(got).max()


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("rows", [[0, 1, 2], [0, 2, 3, 4], [0, 1, 2, 3, 4]])
def test_the_gradient_of_manipulability_is_that_of_the_turned_rows(frame, rows):
    """Against differences of the product of singular values of mj_jacSite, of sixth order: 1e-9 at this step."""
    task, step = Task(PUMA, np.array(rows), frame=frame), 2e-3

    def w(q):
        _, R, J, B = site_axes(PUMA, q)
        axes = {"world": np.eye(3), "base": B, "site": R}[frame]
        return np.prod(np.linalg.svd((both(axes).T @ J)[rows], compute_uv=False))

    factors = {-3: -1, -2: 9, -1: -45, 1: 45, 2: -9, 3: 1}
    slope = [sum(f * w(Q + i * step * e) for i, f in factors.items()) / (60 * step) for e in np.eye(6)]
    section = control(
        inverse={"method": "pseudoinverse"}, nullspace={"objective": "manipulability"}, feedback=0.0
    )
    controller = Controller(PUMA, control=section, task=task)
    controller.step(Q, pose=PUMA.pose(Q))
    got = controller._worlds[0]["scratch"]["qdot0"][:6]  # what is left of the wish in the null space
    _, R, J, B = site_axes(PUMA, Q)
    A = (both({"world": np.eye(3), "base": B, "site": R}[frame]).T @ J)[rows]
    N = np.eye(6) - np.linalg.pinv(A) @ A
    assert_allclose(got, N @ slope, rtol=0, atol=1e-8)
    if frame == "site" and len(rows) == 4:  # negative control: the gradient of the world's rows is another
        world = [sum(f * np.prod(np.linalg.svd(site_axes(PUMA, Q + i * step * e)[2][rows], compute_uv=False))
                     for i, f in factors.items()) / (60 * step) for e in np.eye(6)]  # fmt: skip
        assert np.abs(N @ world - N @ slope).max() > 1e-3


@pytest.mark.parametrize("method", INVERSES.names)
def test_every_inverse_gives_the_rates_of_the_turned_problem(method):
    """Rows along the site are the world's rows of the same arm seen from a world that is turned like the site."""
    rows = range(6) if INVERSES[method].needs_square else [0, 1, 2, 3, 5]
    point, R, J, _ = site_axes(PUMA, Q)
    pose, twist = (
        np.concatenate([point, Rotation.from_matrix(R).as_quat(scalar_first=True)]),
        np.arange(1.0, 7.0),
    )
    section = control(inverse={"method": method, "damping": {"maximum": 0.1, "below": 0.3}}, feedback=0.0)
    got = command(PUMA, "site", rows, Q, pose, twist, section).qdot_cmd.copy()
    want = resolve_rates(
        (both(R).T @ J)[list(rows)],
        (both(R).T @ twist)[list(rows)],
        method,
        schedule="smallest_singular_value",
        damping_below=0.3,
    )
    assert_allclose(got, want, rtol=1e-8, atol=1e-9)


GRID = [*itertools.product(["base", "site"], LIMITS.names, POLICIES.names, ["none", "secondary"])]


@pytest.mark.parametrize(("frame", "on_excess", "policy", "objective"), mostly_long(GRID, 9))
def test_every_limit_policy_and_objective_runs_along_a_frame(simulate, frame, on_excess, policy, objective):
    _, run = simulate(
        "arm.model=models/puma560.xml", "arm.site=tool", "arm.start=[0.3, -0.9, 3.4, 0.2, 0.9, 0.3]", "plant.kind=ideal",
        f"task={{axes: [x, y, z, rx, ry], frame: {frame}}}", "target.path=[{line: {by: [0.02, 0.01, 0.02], frame: site}}]",
        f"control.limits={{rate: 3.0, on_excess: {on_excess}}}", f"control.at_singularity={policy}",
        f"control.nullspace={{objective: {objective}, secondary: {{axes: [rz], frame: {frame}}}}}",
        "control.inverse.method=pseudoinverse",
    )  # fmt: skip
    rows = [AXES.index(axis) for axis in run.axes]
    assert run.is_complete
    assert np.abs(run["pose_error"][-1, rows]).max() < 1e-4
    assert run.scorecard["position_error.end"].value < 1e-4


def test_the_objectives_are_those_that_the_tests_above_know():
    assert OBJECTIVES.names == ("none", "posture", "joint_limits", "manipulability", "rates", "secondary")


def test_the_error_of_a_second_task_is_along_its_own_site(simulate):
    """Of a planar arm: the way that the tip has gone, along the y of the tip as it is turned now."""
    _, run = simulate(
        "arm.model=models/planar_3link.xml", "arm.start=[0.4, -0.8, 0.3]", "plant.kind=ideal", "task.axes=[x]",
        "target.path=[{line: {by: [0.2, 0.0]}}]", "control.inverse.method=pseudoinverse", "control.limits.on_excess=none",
        "control.nullspace={objective: secondary, secondary: {axes: [y], frame: site}}",
    )  # fmt: skip
    angle, away = run["q"].sum(axis=1), run["pose"][:, :3] - run["pose"][0, :3]
    along_y = -np.sin(angle) * away[:, 0] + np.cos(angle) * away[:, 1]
    assert_allclose(run["secondary_error"], np.abs(along_y), rtol=0, atol=1e-9)
    assert np.abs(away[:, 1]).max() > 1e-3  # negative control: along the world's y it would have had to stay
