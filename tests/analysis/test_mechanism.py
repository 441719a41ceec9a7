"""A platform on three legs whose loops MuJoCo closes, against the textbook's lines of the legs."""

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from project import ROOT
from rmrc import arm as arms
from rmrc.arm.inventory import find_mechanism
from rmrc.textbook.planar import platform_inverse_jacobian, platform_leg_lengths

PATH = ROOT / "models/mechanisms/planar_3rpr.xml"
BASE = np.array([[0.0, 0.0], [3.0, 0.0], [1.5, 2.6]])
PLATFORM = np.array([[-0.5, -0.3], [0.5, -0.3], [0.0, 0.6]])


@pytest.fixture(scope="module")
def arm():
    return arms.load(PATH, "tool")


def first_leg(pose):
    """Return the joints from the ground through leg 1 to the platform: its angle, its length, the platform's angle."""
    x, y, angle = pose
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    leg = [x, y] + turn @ PLATFORM[0] - BASE[0]
    direction = np.arctan2(leg[1], leg[0])
    return np.array([direction, np.hypot(*leg), angle - direction])


@given(st.tuples(st.floats(1.2, 1.7), st.floats(0.7, 1.1), st.floats(-0.2, 0.4)))
def test_rates_of_the_drives_are_along_the_lines_of_their_legs(arm, pose):
    assume(abs(np.linalg.det(platform_inverse_jacobian(BASE, PLATFORM, pose))) > 1e-3)
    found = find_mechanism(arm, first_leg(pose))
    assert found.rows == ("x", "y", "rz") and found.drives == ("leg_1", "leg_2", "leg_3")
    assert found.gap < 1e-9 and found.freedom == 0
    # Loops are closed to 1e-10 m, legs are longer than 0.3 m.
    assert_allclose(found.lengths, platform_leg_lengths(BASE, PLATFORM, pose), atol=1e-8)
    assert_allclose(found.inverse, platform_inverse_jacobian(BASE, PLATFORM, pose), atol=1e-8)


def test_the_table_has_these_numbers_and_zero_for_rounding(rmrc):
    code, out, _ = rmrc("inspect", str(PATH), "--site", "tool")
    assert code == 0
    found = arms.load(PATH, "tool")
    mechanism = find_mechanism(found, found.configuration("home")[found.wiring.qpos])
    lines = [line.split() for line in out.splitlines()]
    for name, length, rates in zip(mechanism.drives, mechanism.lengths, mechanism.inverse, strict=True):
        (cells,) = [cells for cells in lines if name in cells and len(cells) >= 5 and _numbers(cells[-4:])]
        assert_allclose(_numbers(cells[-4:]), [length, *rates], rtol=1e-3, atol=1e-12)


def _numbers(cells):
    try:
        return [float(cell.replace("\N{MINUS SIGN}", "-")) for cell in cells]
    except ValueError:
        return []


def test_the_physics_moves_the_platform_as_the_lines_of_the_legs_say():
    model = mujoco.MjModel.from_xml_path(str(PATH))
    data, site = mujoco.MjData(model), model.site("tool").id
    mujoco.mj_resetDataKeyframe(model, data, 0)
    legs = [model.joint(f"leg_{i}").dofadr[0] for i in (1, 2, 3)]
    data.ctrl[:] = [0.3, -0.2, 0.1]
    twist, off, swapped = np.zeros(6), [], []
    for step in range(600):
        mujoco.mj_step(model, data)
        if step > 100 and step % 50 == 0:
            mujoco.mj_forward(model, data)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, site, twist, 0)
            x, y, _ = data.site_xpos[site]
            angle = np.arctan2(data.site_xmat[site, 3], data.site_xmat[site, 0])
            K = platform_inverse_jacobian(BASE, PLATFORM, [x, y, angle])
            rates = K @ [twist[3], twist[4], twist[2]]
            off.append(rates - data.qvel[legs])
            swapped.append(rates[[0, 2, 1]] - data.qvel[legs])
    assert np.abs(data.qvel[legs] - data.ctrl).max() < 0.02  # the drives do move
    # MuJoCo's constraints are soft: they hold the loops to micrometers, and their rates to a thousandth of the drives'.
    assert np.abs(off).max() < 1e-3
    assert np.abs(swapped).min(axis=0)[1:].min() > 0.1


def test_where_the_lines_meet_in_a_point_the_platform_moves_with_its_drives_locked(arm):
    angles = np.linspace(-np.pi, np.pi, 200)
    determinant = [
        np.linalg.det(platform_inverse_jacobian(BASE, PLATFORM, [1.45, 0.9, angle])) for angle in angles
    ]
    first = np.flatnonzero(np.diff(np.sign(determinant)))[0]
    low, high = angles[first : first + 2]
    for _ in range(60):
        middle = 0.5 * (low + high)
        sign = (
            np.linalg.det(platform_inverse_jacobian(BASE, PLATFORM, [1.45, 0.9, middle])) * determinant[first]
        )
        low, high = (middle, high) if sign > 0.0 else (low, middle)
    regular, singular = (find_mechanism(arm, first_leg([1.45, 0.9, angle])) for angle in (low - 0.3, low))
    assert regular.gap < 1e-9 and regular.freedom == 0
    assert singular.gap < 1e-9 and singular.freedom == 1


def test_a_parallelogram_carries_its_bar_without_turning_it_or_does_not_close(tmp_path):
    text = (ROOT / "tests/models/loop.xml").read_text("utf-8")
    motor = '<actuator><motor name="m" joint="shoulder"/></actuator></mujoco>'
    (tmp_path / "loop.xml").write_text(text.replace("</mujoco>", motor))
    arm = arms.load(tmp_path / "loop.xml", "hand")
    closed = find_mechanism(arm, np.array([0.3, -0.3]))
    assert closed.gap < 1e-9 and closed.drives == ("shoulder",) and closed.rows == ("x",)
    # Every point of the bar moves as its joint, 0.5 m from the shoulder: x = 0.5 cos q.
    assert_allclose(closed.inverse, [[1.0 / (-0.5 * np.sin(0.3))]], atol=1e-9)
    assert find_mechanism(arm, np.array([0.3, 0.4])).gap > 0.01


def test_an_arm_without_loops_is_no_mechanism():
    for name in ("planar_2link", "helical", "fr3"):  # couplings of joints, and fingers of a hand, are none
        found = arms.load(ROOT / f"models/{name}.xml")
        assert find_mechanism(found, found.configuration("home")[found.wiring.qpos]) is None
