"""Rows along the axes of the world, the base or the site, against mj_jacSite and scipy's rotations."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from chains import random_chain, seeds
from project import ROOT, examples
from rmrc.arm import load
from rmrc.law.controller import Controller
from rmrc.law.task import Task, View
from rmrc.scenario import ControlSection

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


def stand(tmp_path_factory, seed, n=6):
    text = random_chain(seed, n).replace(
        '<body name="ball" pos="3 0 0"><freejoint/><geom size="0.1"/></body>', ""
    )
    path = tmp_path_factory.mktemp("chain") / "arm.xml"
    turn = '<worldbody><body name="stand" pos="0.1 -0.2 0.3" quat="0.5 0.1 -0.7 0.4">'
    text = text.replace("<worldbody>", turn, 1).replace("</worldbody>", "</body></worldbody>", 1)
    path.write_text(text)
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
        section = control(inverse={"method": "transpose"}, feedback=3.0)
        got = command(arm, frame, rows, q, wanted, twist, section)
        A = (both(axes).T @ J)[rows]
        v = (both(axes).T @ (twist + 3.0 * error))[rows]
        assert_allclose(got.pose_error, both(axes).T @ error, rtol=0, atol=ROUNDING)
        assert_allclose(got.sigma, np.linalg.svd(A, compute_uv=False), rtol=0, atol=ROUNDING)
        direction, rates = A.T @ v, got.qdot_cmd  # the transpose is along it, whatever its step
        unit = direction / np.linalg.norm(direction)
        assert_allclose(rates / np.linalg.norm(rates), unit, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("free", "about"), [(0, 0.0), (1, 3.0), (2, 1.0), (2, -3.1)])
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
