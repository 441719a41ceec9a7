"""The robots among the arms: they are what their makers publish, hold themselves, and are singular where it is said.

The oracles are the makers' tables, through rmrc.textbook and scipy, and closed forms of the singularities.
"""

import functools

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from project import ROOT
from test_models import fresh, moving, site_jacobian
from twins import TWINS

ROUNDING = 1e-12

every_twin = pytest.mark.parametrize("name", TWINS)


def spec_of(name):
    return mujoco.MjSpec.from_file(str(ROOT / f"models/{name}.xml"))


@functools.cache
def loaded(name):
    return spec_of(name).compile()


def arm_joints(name):
    return loaded(name).njnt - TWINS[name].hand


@functools.cache
def data_of(name):
    return mujoco.MjData(loaded(name))


def jacobian(name, q):
    """J of the tool, its columns those of the arm's joints."""
    model, data = loaded(name), data_of(name)
    data.qpos[: len(q)] = q
    mujoco.mj_fwdKinematics(model, data)
    return site_jacobian(model, data, "tool")[:, : arm_joints(name)]


def lost(name, q):
    """Singular values of J, the least last."""
    return np.linalg.svd(jacobian(name, q), compute_uv=False)


@every_twin
def test_conventions_of_a_robot_hold(name):
    model = loaded(name)
    assert all(model.jnt_limited) and all(model.actuator_ctrllimited)
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert model.opt.timestep == 0.002
    assert not np.any(model.geom_contype | model.geom_conaffinity)
    assert not np.any(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH) and model.nmesh == 0
    assert all(model.body_mass[moving(model)] > 0)
    assert (ROOT / f"models/{name}.xml").stat().st_size < 16_000
    # Position servos, one a joint in the order of q: force = kp (ctrl - q) - kv qdot.
    servos = range(arm_joints(name))
    assert_allclose(model.actuator_trnid[servos, 0], servos)
    kp, bias = model.actuator_gainprm[servos, 0], model.actuator_biasprm[servos]
    assert np.all(kp > 0)
    assert_allclose(bias[:, :2], np.outer(kp, [0, -1]), atol=0)
    assert np.all(bias[:, 2] < 0)
    assert_allclose(model.actuator_ctrlrange[servos], model.jnt_range[servos])
    limits = model.actuator_forcelimited[servos] | model.jnt_actfrclimited[servos]
    assert np.all(limits)


@every_twin
def test_home_lies_within_limits_and_its_controls_hold_it(name):
    model = loaded(name)
    home, data = model.key("home"), mujoco.MjData(model)
    low, high = model.jnt_range.T
    assert np.all((low <= home.qpos) & (home.qpos <= high))
    n = arm_joints(name)
    assert_allclose(home.ctrl[:n], home.qpos[:n], atol=0)
    mujoco.mj_resetDataKeyframe(model, data, home.id)
    mujoco.mj_forward(model, data)
    # At rest kp times the sag is gravity, but for what friction bears.
    sag = np.abs(data.qfrc_bias[:n]) / model.actuator_gainprm[:n, 0]
    while data.time < 3.0:
        mujoco.mj_step(model, data)
    assert np.all(np.abs(data.qpos[:n] - home.qpos[:n]) <= sag + 1e-3)
    assert_allclose(data.qpos[n:], home.qpos[n:], atol=1e-3)
    assert np.all(np.abs(data.qvel) < 1e-3)


def check_tool(model, name, q):
    twin = TWINS[name]
    data, wanted = fresh(model, [*q, *np.zeros(twin.hand)]), twin.tool(q)
    assert_allclose(data.site("tool").xpos, wanted[:3, 3], rtol=0, atol=twin.rounding)
    # UR's own table rounds lengths only.
    right = 2e-5 if name == "so101" else ROUNDING
    assert_allclose(data.site("tool").xmat.reshape(3, 3), wanted[:3, :3], rtol=0, atol=right)


def within(name, unit):
    low, high = loaded(name).jnt_range[: arm_joints(name)].T
    return low + (high - low) * np.array(unit[: len(low)])


@every_twin
@settings(max_examples=30)
@given(unit=st.lists(st.floats(0, 1), min_size=7, max_size=7))
def test_the_tool_is_where_its_maker_has_it(name, unit):
    check_tool(loaded(name), name, within(name, unit))


@pytest.mark.parametrize(
    ("name", "body", "off"),
    [
        ("ur5e", "forearm_link", [0, 0.005, 0]),
        ("fr3", "fr3_link5", [1e-9, 0, 0]),
        ("xarm7", "link4", [0, 0, 1e-9]),
        ("so101", "wrist", [0, 1e-4, 0]),
    ],
)
def test_a_misplaced_link_is_seen(name, body, off):
    spec = spec_of(name)
    spec.body(body).pos = np.add(spec.body(body).pos, off)
    with pytest.raises(AssertionError):
        check_tool(spec.compile(), name, within(name, [0.6] * 7))


@every_twin
def test_no_posture_is_as_far_from_singular_as_the_default_damping_wants(name):
    """models/README.md: no posture has sigma_min above 0.28."""
    rng = np.random.default_rng(0)
    found = [lost(name, within(name, rng.uniform(0, 1, 7)))[-1] for _ in range(1000)]
    assert max(found) < 0.28


@settings(max_examples=30)
@given(unit=st.lists(st.floats(0, 1), min_size=7, max_size=7))
def test_the_determinant_of_the_ur5e_is_its_closed_form(unit):
    q = within("ur5e", unit)
    rho = 0.425 * np.cos(q[1]) + 0.392 * np.cos(q[1] + q[2]) - 0.1 * np.sin(q[1:4].sum())
    closed = -0.425 * 0.392 * np.sin(q[2]) * np.sin(q[4]) * rho
    assert np.linalg.det(jacobian("ur5e", q)) == pytest.approx(closed, abs=1e-12)


@settings(max_examples=20)
@given(unit=st.lists(st.floats(0, 1), min_size=7, max_size=7))
def test_the_fr3_is_longest_with_its_elbow_bent(unit):
    """From shoulder to wrist are two triangles; they lie in line where theta_4 is the sum of their angles."""
    model, q = loaded("fr3"), within("fr3", unit)

    def length(elbow):
        data = fresh(model, [*q[:3], elbow, *q[4:], 0, 0])
        return np.linalg.norm(data.body("fr3_link5").xpos - data.body("fr3_link2").xpos)

    longest = -np.arctan(0.0825 / 0.316) - np.arctan(0.0825 / 0.384)
    assert np.degrees(longest) == pytest.approx(-26.76, abs=5e-3)
    assert length(longest) == pytest.approx(np.hypot(0.316, 0.0825) + np.hypot(0.384, 0.0825), abs=1e-12)
    assert length(longest) > max(length(longest + 0.1), length(longest - 0.1))


def xarm7_wrist(elbow):
    """Return theta_6 at which axis 7 meets the line from shoulder to elbow, if theta_5 is 90 degrees.

    In the plane of link 4 the elbow is the origin and axis 5 the line x = 0.0775, with the wrist at y = -0.3425.
    Axis 7 crosses axis 5 at 0.076 m / sin(theta_6) from the wrist, and the line crosses it at y.
    """
    x, y = -0.0525 * np.cos(elbow) - 0.293 * np.sin(elbow), 0.0525 * np.sin(elbow) - 0.293 * np.cos(elbow)
    return -np.arcsin(0.076 / (0.3425 + 0.0775 * y / x))


@pytest.mark.parametrize("elbow", [30.0, 70.0, 80.0, 120.0])
def test_the_wrist_of_the_xarm7_is_singular_where_axis_7_meets_the_line_through_the_elbow(elbow):
    elbow, rng = np.radians(elbow), np.random.default_rng(0)
    for waist, shoulder, roll, hand in rng.uniform(-1.5, 1.5, (5, 4)):
        q = np.array([waist, shoulder, roll, elbow, np.pi / 2, xarm7_wrist(elbow), hand])
        assert lost("xarm7", q)[-1] < ROUNDING
        q[5] = 0.0
        assert lost("xarm7", q)[-1] > 0.02
