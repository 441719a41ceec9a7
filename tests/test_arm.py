"""Any MJCF as an arm: chain, limits, Jacobian, adaptation; and every refusal in full."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from chains import random_chain
from rmrc import arm as arms
from rmrc.support.errors import ModelError
from screws import screw_chain
from wording import says

# A cart with a gripper: a motor with gear, a limited joint force, a servo, a joint that is not the arm's.
CART = """<mujoco><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0" range="-1 2"/>
<geom size="0.1" name="ball"/><body name="arm" pos="0 0 0.1"><joint name="swing" axis="0 1 0" actuatorfrcrange="-3 4"/>
<geom type="box" size="0.1 0.2 0.3" pos="0 0 0.3" quat="0.6 0.8 0 0"/><site name="hand" pos="0 0 1"/>
<body name="finger"><joint name="grip" axis="1 0 0"/><geom size="0.02"/></body></body></body></worldbody>
<actuator><motor name="push" joint="rail" gear="5" ctrlrange="-2 2"/>
<velocity name="swing" joint="swing" kv="10" gear="2" ctrlrange="-3 6" forcerange="-7 9"/>
<position name="grip" joint="grip" kp="1"/></actuator>
<keyframe><key name="up" qpos="0.5 0.1 0.2" ctrl="0 0 0"/></keyframe></mujoco>"""


def load(tmp_path, text, site="tip", joints=None):
    path = tmp_path / "model.xml"
    path.write_text(text)
    return arms.load(path, site, joints)


@pytest.fixture
def cart(tmp_path):
    return load(tmp_path, CART, "hand")


def test_chain_is_found_from_the_site_and_limits_from_joints_and_actuators(cart):
    assert cart.joints == ("rail", "swing")
    assert cart.is_slide.tolist() == [True, False]
    assert_allclose(cart.position_limit, [[-1, 2], [-np.inf, np.inf]])
    # Only a velocity servo's control is a rate: at gear 2, a control of 3 turns the joint at 1.5 rad/s.
    assert_allclose(cart.rate_limit, [np.inf, 1.5])
    # A motor: gear · control. A servo: the tighter of 3 N·m at the joint and gear · 7 behind the actuator.
    assert_allclose(cart.torque_limit, [10, 3])


def test_a_damper_s_control_is_no_limit_of_torque(tmp_path):
    damper = '<damper name="brake" joint="swing" kv="3" ctrlrange="0 1"/></actuator>'
    assert_allclose(load(tmp_path, CART.replace("</actuator>", damper), "hand").torque_limit, [10, 3])


def test_configuration_takes_a_keyframe_or_positions_of_the_arm(cart):
    assert_allclose(cart.configuration("up"), [0.5, 0.1, 0.2])
    assert_allclose(cart.configuration([0.7, 0.3]), [0.7, 0.3, 0.2])  # the rest stays where it is at home


def test_home_of_a_model_without_such_a_keyframe_is_its_zero_position(tmp_path, cart):
    assert_allclose(cart.configuration("home"), cart.configuration("up"))  # the only keyframe
    arm = load(tmp_path, random_chain(1, 3))
    assert_allclose(arm.configuration("home"), arm.model.qpos0)


def derivative_of_pose(arm, q, h=1e-6):
    """J by central differences."""
    columns = []
    for step in np.eye(arm.n) * h:
        plus, minus = arm.pose(q + step), arm.pose(q - step)
        turn = (
            Rotation.from_quat(plus[3:], scalar_first=True)
            * Rotation.from_quat(minus[3:], scalar_first=True).inv()
        )
        columns.append(np.concatenate([plus[:3] - minus[:3], turn.as_rotvec()]) / (2 * h))
    return np.transpose(columns)


@pytest.mark.parametrize(("order", "slide_axis"), [("hinge first", "0 0 -1"), ("slide first", "0 0 1")])
def test_a_screw_is_one_joint(tmp_path, order, slide_axis):
    arm = load(tmp_path, screw_chain(0.05, slide_axis, order))
    assert arm.joints == ("turn", "screw", "swing")
    assert_allclose(arm.pitch, [0, 0.05 if slide_axis == "0 0 1" else -0.05, 0])
    q = np.array([0.3, -0.4, 0.5])
    # The equality counts from `ref`: travel - 0.01 = 0.02 + 0.05 (screw - 20 deg).
    travel = 0.03 + 0.05 * (q[1] - np.radians(20))
    assert arm.configuration(q)[arm.wiring.follower_qpos] == pytest.approx(travel, abs=1e-15)
    # Central differences: h² and rounding over h.
    assert_allclose(arm.jacobian(q), derivative_of_pose(arm, q), rtol=0, atol=1e-8)
    # The hinge may turn 120 deg either way; its slide ends at -0.08 and 0.2 m.
    ends = np.radians(20) + (np.array([-0.08, 0.2]) - 0.03) / 0.05
    assert_allclose(arm.position_limit[1], [max(-np.radians(120), ends[0]), min(np.radians(120), ends[1])])


def test_inertia_is_what_a_lone_joint_feels(cart):
    # rail: the mass of all bodies; MuJoCo's own masses are the oracle
    assert cart.inertia[0] == pytest.approx(cart.model.body_mass[1:].sum(), rel=1e-12)


def test_unknown_keyframe_is_refused_with_the_known_ones(cart):
    with pytest.raises(ModelError) as caught:
        cart.configuration("upp")
    assert str(caught.value) == says(f'{cart.path}: … keyframe "upp" … "up"… home, up')
    assert caught.value.about == "start"
