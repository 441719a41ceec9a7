"""Copies of a controller, pickled ones among them: they go on as it would, and on their own."""

import copy
import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import rmrc
from project import ROOT
from rmrc.arm import load as load_arm

ARM = load_arm(ROOT / "models/planar_3link.xml")
HOME = ARM.configuration("home")[ARM.wiring.qpos]
LAW = {"feedback": 8, "limits": {"rate": 1.5, "acceleration": 8, "jerk": 200}}
WAYS = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
}


def moving(**more):
    """Return a controller in the middle of a motion, in a loop that jitters, and the positions of its arm."""
    one = rmrc.Controller(ARM, control=LAW | more, period=0.004, task={"axes": ["x", "y"]})
    one.reset(HOME)
    return one, onwards(one, HOME, 60)[1]


def onwards(one, q, steps=40):
    """Go on with a motion; return its commands, (steps, 2, n), and the last positions."""
    sent = []
    for k in range(steps):
        dt = 0.003 + 0.0005 * (k % 5)
        out = one.step(q, twist=[0.4 * np.sin(0.1 * k), 0.3, 0, 0, 0, 0], dt=dt)
        sent.append([out.qdot_cmd.copy(), out.q_cmd.copy()])
        q = q + dt * out.qdot_cmd
    return np.array(sent), q


@pytest.mark.parametrize("way", WAYS)
def test_a_copy_goes_on_as_the_original_and_on_its_own(way):
    one, q = moving()
    first, second = WAYS[way](one), WAYS[way](one)
    assert_array_equal(first.command.qdot_cmd, one.command.qdot_cmd)
    assert first.command.status == one.command.status and first.joints == one.joints
    wanted = onwards(first, q)[0]
    assert_array_equal(onwards(one, q)[0], wanted)  # which the steps of its copy have not moved
    assert_array_equal(onwards(second, q)[0], wanted)
    fresh = rmrc.Controller(ARM, control=LAW, period=0.004, task={"axes": ["x", "y"]})
    assert (onwards(fresh, q)[0] != wanted).any()  # memory matters
