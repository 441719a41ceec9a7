"""Each question takes a file, an arm or a scenario, and gives one answer; every mistake in full."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import rmrc
from project import ROOT
from rmrc import arm as arms
from rmrc.scenario import loads
from rmrc.support.errors import ModelError, QuestionError
from rmrc.support.spatial import quat_to_matrix
from wording import says

TWO, STANFORD = ROOT / "models/planar_2link.xml", ROOT / "models/stanford.xml"
Q = [0.3, -1.1]
SCENARIO = f"""
name: asked
arm: {{model: {TWO}, site: tip, start: {Q}}}
task: {{axes: [x], length: 0.5}}
target: {{path: [{{hold: {{for: 0.1}}}}]}}
"""

# What is asked of a model: name -> (question, what of the answer is compared).
QUESTIONS = {
    "inspect": (rmrc.inspect, lambda found: (found.q, found.sigma)),
    "ik": (lambda model, **more: rmrc.ik(model, to_q=[1.0, 1.2], **more), lambda found: (found.start, found.q)),
    "statics": (
        lambda model, **more: rmrc.statics(model, [1, 2, 3], **more),
        lambda found: (found.balance.q, found.balance.torque, found.balance.reaction),
    ),
    "workspace": (
        lambda model, **more: rmrc.workspace(model, cells=8, samples=1000, **more),
        lambda found: (found.home, found.free.values["sigma_min"], found.free.reached),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", QUESTIONS)
def test_a_file_an_arm_and_a_scenario_are_the_same_model(name):
    ask, of = QUESTIONS[name]
    answer = of(ask(TWO, q=Q))
    for same in (ask(str(TWO), q=Q), ask(arms.load(TWO), q=Q), ask(TWO, site="tip", q=np.array(Q))):
        for one, other in zip(of(same), answer, strict=True):
            assert_array_equal(one, other)
    assert_array_equal(of(ask(TWO))[0], of(ask(TWO, keyframe="home"))[0])
    # A scenario brings its start, its rows and its length; without them the answer is another.
    axes = {} if name == "statics" else {"axes": ["x"], "length": 0.5}
    brought = of(ask(loads(SCENARIO)))
    for one, other in zip(brought, of(ask(TWO, q=Q, **axes)), strict=True):
        assert_array_equal(one, other)
    assert not all(map(np.array_equal, brought, of(ask(TWO))))


def refused(ask, *arguments, **more):
    """Return what a question says that cannot be answered."""
    with pytest.raises((QuestionError, ModelError)) as caught:
        ask(*arguments, **more)
    return str(caught.value)


@pytest.mark.parametrize("name", QUESTIONS)
def test_what_does_not_fit_is_refused_in_one_line(name):
    ask, _ = QUESTIONS[name]
    for more, message in (
        ({"q": Q, "keyframe": "home"}, "… q or keyframe …"),
        ({"q": [1.0]}, "q … 2 … shoulder, elbow … (1,)"),
        ({"q": [1.0, np.nan]}, "q … finite … [1.0, nan]"),
        ({"q": ["60 deg", 0]}, "q … numbers … ['60 deg', 0]"),
        ({"site": "tip", "body": "forearm"}, "… site or body …"),
    ):
        assert refused(ask, TWO, **more) == says(message)
    assert refused(ask, arms.load(TWO), site="wrist") == says('… site "tip" … "wrist"; …')
    assert refused(ask, ROOT / "models/planar_2links.xml") == says('… "planar_2link.xml"…')


def test_rows_frames_errors_goals_and_wrenches_that_will_not_do_are_refused_in_one_line():
    for more, message in (
        ({"length": -1.0}, "length … 0 … -1"),
        ({"axes": ["x", "v"]}, 'axes: … "v" … x y z rx ry rz'),
        ({"axes": []}, "axes … one … x y z rx ry rz"),
        ({"frame": "sight"}, 'frame: … "sight" … "site"… world base site'),
        ({"joint_error": [0.1]}, "joint error … 2 … shoulder, elbow … (1,)"),
    ):
        assert refused(rmrc.inspect, TWO, Q, **more) == says(message)
    for more, message in (
        ({}, "… to… x, y… to_q"),
        ({"to": [1, 1], "to_q": [1, 1]}, "… to… x, y… to_q"),
        ({"to": [1]}, "to … 2 … x, y … (1,)"),
        ({"to": [1.0, np.nan]}, "to … finite … [1.0, nan]"),
        ({"to": [1.0, 1.0], "quat": [0, 0, 0, 0]}, "quat … zero … 0, 0, 0, 0"),
        ({"to": [1, 1], "method": "dampd"}, 'method … damped, newton … "dampd"'),
        ({"to": [1, 1], "tolerance": np.nan}, "tolerance … > 0, got nan"),
        ({"to": [1, 1], "method": "newton", "every": True}, '… all … "damped"… "newton"'),
    ):
        assert refused(rmrc.ik, TWO, **more) == says(message)
    for more, message in (
        ({"wrench": [1, 2]}, "wrench … 6 … fx, fy, fz, nx, ny, nz … (2,)"),
        ({"wrench": [1, 2, np.inf]}, "wrench … finite … [1.0, 2.0, inf, 0.0, 0.0, 0.0]"),
        ({"wrench": [1, 2, 3], "hold": -1}, "hold … > 0 … 1000 s, got -1"),
        ({"wrench": [1, 2, 3], "frame": "hand"}, 'frame: … "hand" … world base site'),
    ):
        assert refused(rmrc.statics, STANFORD, **more) == says(message)


def test_a_goal_is_values_or_joint_positions():
    arm = arms.load(STANFORD)
    q = arm.sampled(1)[0]
    pose = arm.pose(q)
    for goal in ({"to_q": q}, {"to": pose[:3], "quat": 2.0 * pose[3:]}):
        found = rmrc.ik(arm, **goal)
        assert found.found and found.method == "damped"
        there = arm.pose(found.q)  # by MuJoCo
        assert_allclose(there[:3], pose[:3], rtol=0, atol=1e-9)
        assert_allclose(quat_to_matrix(there[3:]), quat_to_matrix(pose[3:]), rtol=0, atol=1e-9)
    assert rmrc.ik(arm, to_q=q, q=q, method="newton").steps == 0


def test_a_wrench_is_six_values_or_a_force_along_the_worlds_axes_or_the_sites():
    arm = arms.load(STANFORD)
    q, wrench = arm.sampled(1)[0], np.array([1.0, -2.0, 3.0, 0.4, 0.5, -0.6])
    R = quat_to_matrix(arm.pose(q)[3:])
    along_site = (wrench.reshape(2, 3) @ R).ravel()
    found = rmrc.statics(arm, along_site, q, frame="site")
    assert_allclose(found.balance.equilibrium, -arm.jacobian(q).T @ wrench, rtol=0, atol=1e-12)
    force = rmrc.statics(arm, wrench[:3], q).balance.wrench
    assert force.tolist() == [1.0, -2.0, 3.0, 0.0, 0.0, 0.0]
    assert found.held is None and found.elsewhere is None
