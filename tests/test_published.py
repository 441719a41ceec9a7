"""What other libraries publish in their own tests, each with its source: our chains and our law give it, too."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc import Controller, resolve_rates
from rmrc.textbook.chains import DHChain

QUARTER = np.pi / 2
REVOLUTE = ("revolute",) * 7


def tool(length):
    return np.array([0.0, 0.0, length])


# A Motoman SIA10 as in orocos_kinematics_dynamics, orocos_kdl/tests/solvertest.cpp, in either convention of its own.
SIA10 = DHChain(
    tuple((alpha, 0.0, d, 0.0) for alpha, d in zip(
        [0, QUARTER, -QUARTER, QUARTER, -QUARTER, QUARTER, -QUARTER], [0.36, 0, 0.36, 0, 0.36, 0, 0], strict=True
    )), REVOLUTE,
)  # fmt: skip
SIA10_STANDARD = DHChain(
    tuple((alpha, 0.0, d, 0.0) for alpha, d in zip(
        [QUARTER, -QUARTER, QUARTER, -QUARTER, QUARTER, -QUARTER, 0], [0.36, 0, 0.36, 0, 0.36, 0, 0], strict=True
    )), REVOLUTE, "standard",
)  # fmt: skip
SIA10_TOOL = 0.155

# The Panda of the Robotics Toolbox, roboticstoolbox/models/ETS/Panda.py; its tool is turned by -45° and 0.103 m long.
PANDA = DHChain(
    (
        (0, 0, 0.333, 0), (-QUARTER, 0, 0, 0), (QUARTER, 0, 0.316, 0), (QUARTER, 0.0825, 0, 0),
        (-QUARTER, -0.0825, 0.384, 0), (QUARTER, 0, 0, 0), (QUARTER, 0.088, 0, 0),
    ), REVOLUTE,
)  # fmt: skip
PANDA_TOOL = 0.107 + 0.103
# tests/test_ERobot.py: q, and what it has there, to the eight digits that are printed
PANDA_Q = [1.4, 0.2, 1.8, 0.7, 0.1, 3.1, 2.9]
PANDA_POSE = [
    [-0.50827907, -0.57904589, 0.63746234, 0.44682295],
    [0.83014553, -0.52639462, 0.18375824, 0.16168396],
    [0.22915229, 0.62258699, 0.74824773, 0.96798113],
    [0, 0, 0, 1],
]
PANDA_J = [
    [-1.61683957e-01, 1.07925929e-01, -3.41453006e-02, 3.35029257e-01, -1.07195463e-02, 1.03187865e-01, 0],
    [4.46822947e-01, 6.25741987e-01, 4.16474664e-01, -8.04745724e-02, 7.78257566e-02, -1.17720983e-02, 0],
    [0, -2.35276631e-01, -8.20187641e-02, -5.14076923e-01, -9.98040745e-03, -2.02626953e-01, 0],
    [0, -9.85449730e-01, 3.37672585e-02, -6.16735653e-02, 6.68449878e-01, -1.35361558e-01, 6.37462344e-01],
    [0, 1.69967143e-01, 1.95778638e-01, 9.79165111e-01, 1.84470262e-01, 9.82748279e-01, 1.83758244e-01],
    [1, 0, 9.80066578e-01, -1.93473657e-01, 7.20517510e-01, -1.26028049e-01, 7.48247732e-01],
]
PANDA_W = 0.006559178039088341


def jacobian(chain, q, length):
    """J of the point so far along the last axis, along base axes."""
    return chain.jacobian(q, point=tool(length))


def manipulability(J):
    return np.sqrt(np.linalg.det(J @ J.T))


@pytest.mark.parametrize(
    ("second", "fourth", "third", "zero"),
    [(0.5, -QUARTER, 0.4, 1), (0.2, -QUARTER, 0.4, 2), (0, -QUARTER, 0.4, 2), (0, 0, 0, 4)],
)
def test_kdl_s_singular_values_and_scaled_damping(second, fourth, third, zero):
    """IkVelSolverWDLSTest: ε = λ = 0.1, a twist of 0.05 in all six. One of its seven σ is always zero, as n > m.

    Its λ is sqrt(1 − (σ_min/ε)²) λ: the schedule `smallest_singular_value`, so that its rates are ours.
    """
    J = jacobian(SIA10, [0, second, third, fourth, 0, 0, 0], SIA10_TOOL)
    u, sigma, vt = np.linalg.svd(J)
    assert 1 + np.count_nonzero(sigma < 0.1) == zero
    scaled = 0.1 * np.sqrt(max(0.0, 1 - (sigma[-1] / 0.1) ** 2))
    twist = np.full(6, 0.05)
    theirs = vt[:6].T @ (sigma / (sigma**2 + scaled**2) * (u.T @ twist))
    chosen = {"schedule": "smallest_singular_value", "damping_maximum": 0.1, "damping_below": 0.1}
    assert_allclose(resolve_rates(J, twist, "damped", **chosen), theirs, atol=1e-12)


def test_kdl_s_forward_kinematics():
    """FdSolverDevelopmentTest, to the three digits of its source."""
    end = SIA10_STANDARD.frames([0.2, 0.6, 1.0, 0.5, -1.4, 0.3, -0.8])[-1]
    assert_allclose(end[:3, 3] + end[:3, :3] @ tool(SIA10_TOOL), [-0.547, -0.301, 0.924], atol=1e-3)
    assert_allclose(end[0, :3], [0.503, 0.286, -0.816], atol=1e-3)


def test_the_toolbox_s_panda():
    end = PANDA.frames(PANDA_Q)[-1]
    turn = np.array([[1, 1, 0], [-1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)  # by -45°
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = end[:3, :3] @ turn, end[:3, 3] + end[:3, :3] @ tool(PANDA_TOOL)
    assert_allclose(pose, PANDA_POSE, atol=1e-8)
    J = jacobian(PANDA, PANDA_Q, PANDA_TOOL)
    assert_allclose(J, PANDA_J, atol=1e-9)
    assert manipulability(J) == pytest.approx(PANDA_W, rel=1e-9)


# What mink at cf1a302 and pink at f568e80 promise of a UR5e in their unit tests, at this home of theirs, with their rates.
UR5E = ROOT / "models/ur5e.xml"
UR5E_HOME = np.radians([-90, -90, 90, -90, -90, 0])
EXACT = {"inverse": {"method": "pseudoinverse"}, "limits": {"rate": np.pi}}


def site_pose(q):
    model = mujoco.MjModel.from_xml_path(str(UR5E))
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    J = np.zeros((6, 6))
    mujoco.mj_jacSite(model, data, J[:3], J[3:], model.site("tool").id)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = data.site("tool").xmat.reshape(3, 3), data.site("tool").xpos
    return T, J


def test_a_task_that_is_fulfilled_needs_no_rates():
    """mink and pink, tests/test_solve_ik.py, test_single_task_fulfilled; mink allows 1e-10."""
    loop = Controller(UR5E, "tool", EXACT | {"feedback": 200.0}, period=0.005)
    assert_allclose(loop.step(UR5E_HOME, pose=site_pose(UR5E_HOME)[0]).qdot_cmd, 0, atol=1e-10)


def test_a_target_beside_the_tool_is_approached_straight():
    """pink, tests/test_solve_ik.py, test_single_task_translation: 0.1 m along −y of the tool; nothing else moves."""
    T, J = site_pose(UR5E_HOME)
    T[:3, 3] -= 0.1 * T[:3, 1]
    loop = Controller(UR5E, "tool", EXACT | {"feedback": 10.0}, period=0.001)
    twist = J @ loop.step(UR5E_HOME, pose=T).qdot_cmd
    assert_allclose(T[:3, :3].T @ twist[:3], [0, -1.0, 0], atol=1e-12)
    assert_allclose(twist[3:], 0, atol=1e-12)


def test_position_limits_nearby_leave_what_does_not_reach_them():
    """mink and pink, test_configuration_limit_repulsion: limits so near that 5.5e-4 rad/s reach them in 1 ms."""
    slack, period = 5.5e-4, 0.001
    spec = mujoco.MjSpec.from_file(str(UR5E))
    for joint, q in zip(spec.joints, UR5E_HOME, strict=True):
        joint.range = [q - slack * period, q + slack * period]
    loop = Controller(spec, "tool", EXACT, period=period)
    for way in (np.ones(6), -np.ones(6)):
        loop.reset(UR5E_HOME)
        got = np.abs(loop.step(UR5E_HOME, qdot_target=way).qdot_cmd)
        assert (got > 0).all() and (got <= slack + 1e-10).all()
