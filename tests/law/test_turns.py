"""A hinge without range is a circle: the same pose gives the same rates, whatever the number of turns."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import rmrc
from project import examples

# Joints: a hinge without range, one with a range of many turns, a slide without range, two hinges without range;
# of the latter, the second leads a hinge by a ratio.
ARM = """<mujoco><compiler angle="radian"/><worldbody>
<body><joint name="free" axis="0 0 1"/><geom size=".02"/>
<body pos=".4 0 .1"><joint name="ranged" axis="0 1 0" range="-40 40"/><geom size=".02"/>
<body pos=".3 0 0"><joint name="slide" type="slide" axis="1 0 0"/><geom size=".02"/>
<body pos=".1 .05 0"><joint name="roll" axis="1 0 0"/><geom size=".02"/>
<body pos=".2 0 0"><joint name="leader" axis="0 1 0"/><geom size=".02"/>
<body pos=".2 0 0"><joint name="follower" axis="0 0 1"/><geom size=".02"/>
<site name="tip" pos=".1 0 .05"/></body></body></body></body></body></body></worldbody>
<equality><joint joint1="follower" joint2="leader" polycoef="0 {ratio} 0 0 0"/></equality></mujoco>"""
NAMES = ("free", "ranged", "slide", "roll", "leader")
POSTURE = np.array([0.3, -0.5, 0.1, 2.9, -1.0])
Q = np.array([0.1, 0.4, -0.2, -2.8, 0.7])
TURN = 2 * math.pi


def controller(ratio=2, **control):
    """Return a controller of three task rows of an arm of five joints, so that two are left to the posture."""
    model = mujoco.MjModel.from_xml_string(ARM.format(ratio=ratio))
    law = {
        "inverse": {"method": "pseudoinverse"},
        "limits": {"on_excess": "none"},
        "feedback": 0.5,
        **control,
    }
    task = {"axes": ["x", "y", "z"], "length": 1}
    c = rmrc.Controller(model, site="tip", control=law, task=task, period=0.01)
    assert c.joints == NAMES
    return c


def by_posture(q, ratio=2):
    c = controller(ratio, nullspace={"objective": "posture", "gain": 1.5, "posture": POSTURE.tolist()})
    return c.step(q, twist=[0.05, -0.02, 0.03, 0, 0, 0]).qdot_cmd.copy()


def to_target(q, ratio=2):
    return controller(ratio).step(q, q_target=POSTURE).qdot_cmd.copy()


def turned(**turns):
    return Q + TURN * np.array([turns.get(name, 0) for name in NAMES])


@pytest.mark.parametrize("rates", [by_posture, to_target])
@given(st.tuples(*[st.integers(-20, 20)] * 3))
@examples(10, 100)
def test_rates_do_not_depend_on_the_number_of_turns(rates, turns):
    free, roll, leader = turns
    # sines of 126 rad are off by 1e-14 of it
    assert_allclose(rates(turned(free=free, roll=roll, leader=leader)), rates(Q), rtol=0, atol=1e-12)


@pytest.mark.parametrize("rates", [by_posture, to_target])
def test_joints_that_are_no_circle_count_every_turn(rates):
    for one in ({"ranged": 1}, {"slide": 1}):
        assert np.abs(rates(turned(**one)) - rates(Q)).max() > 0.1, one
    # after a turn of its leader, a hinge of half the rate points the other way; after two, it does not
    assert np.abs(to_target(turned(leader=1), ratio=0.5) - to_target(Q, ratio=0.5)).max() > 0.1


def test_a_target_is_approached_the_shorter_way_round():
    way = POSTURE - Q
    way[3] -= TURN  # 5.7 rad are 0.58 rad the other way round
    assert_allclose(to_target(Q), 0.5 * way, rtol=1e-12)
    assert_allclose(to_target(turned(free=-7, roll=3)), 0.5 * way, rtol=1e-12)
