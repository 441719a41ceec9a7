"""Numbers that come from the arm: the length and the damping, against MuJoCo's Jacobians and numpy."""

import math

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from project import ROOT
from rmrc import Controller
from rmrc.analysis.check import check
from rmrc.analysis.inspection import inspect
from rmrc.analysis.scaling import scales
from rmrc.arm import load as load_arm
from rmrc.arm.geometry import damping_maximum
from rmrc.law.task import choose
from rmrc.scenario import loads
from rmrc.simulation.prepare import prepare

AXES = ("x", "y", "z", "rx", "ry", "rz")
PATH = "target: {path: [{line: {by: [0.05, 0.05, 0.05]}}]}"


def jacobians(arm, q):
    """Return J along world axes at joint positions, (s, 6, n), by MuJoCo alone."""
    model, data, joints = arm.model, mujoco.MjData(arm.model), [arm.model.joint(name) for name in arm.joints]
    J = np.zeros((len(q), 6, model.nv))
    for at, rows in zip(q, J, strict=True):
        data.qpos[[joint.qposadr[0] for joint in joints]] = at
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, rows[:3], rows[3:], model.site(arm.site).id)
    return J[:, :, [joint.dofadr[0] for joint in joints]]


def rule(J, rows):
    """Return length and usual σ_min of an arm of hinges, from the equations of docs/theory.md."""
    distance = math.sqrt(np.mean(np.sum(J[:, :3] ** 2, axis=1)))
    length = float(f"{distance:.2g}") if min(rows) < 3 <= max(rows) else 1.0
    A = J[:, rows] / np.where(np.array(rows) < 3, length, 1.0)[:, None]
    return length, np.median(np.linalg.svd(A, compute_uv=False)[:, -1])


def numbers(one):
    """Return length, ε and λ_max of a Controller."""
    damping = one.control.inverse.damping
    return one.task.length, damping.below, damping.maximum


# The rule -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "site"), [("ur5e", "tool"), ("so101", None), ("planar_6_3", None)])
def test_length_and_damping_are_those_of_the_rule(name, site):
    """On the rule's own configurations exactly, and on 4000 random ones as far as the median of 128 is known."""
    arm = load_arm(ROOT / f"models/{name}.xml", site)
    one = Controller(arm)
    rows = [AXES.index(axis) for axis in one.task.axes]
    length, usual = rule(jacobians(arm, arm.proportions.q), rows)
    assert one.task.length == length
    below, maximum = numbers(one)[1:]
    assert below == float(f"{usual / 3:.2g}")
    assert 0 <= maximum - below / math.sqrt(2) < 10 ** (math.floor(math.log10(maximum)) - 1)
    limits = np.array([arm.model.joint(name).range for name in arm.joints]).T
    length_, usual_ = rule(jacobians(arm, np.random.default_rng(1).uniform(*limits, (4000, arm.n))), rows)
    assert_allclose(length, length_, rtol=0.05)
    assert_allclose(usual, usual_, rtol=0.1)


# Its users ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["puma560", "so101"])
def test_a_run_a_controller_and_every_question_have_the_same_numbers(name):
    arm = load_arm(ROOT / f"models/{name}.xml")
    one, suits = Controller(arm), scales(arm)
    axes = ", ".join(one.task.axes)
    run = prepare(loads(f"name: x\narm: {{model: {arm.path}}}\ntask: {{axes: [{axes}]}}\n{PATH}"))
    assert numbers(one) == (run.task.length, *damping_of(run.scenario))
    assert (suits.task.length, suits.below) == numbers(one)[:2]
    assert inspect(arm).task.length == check(arm).scales.task.length == one.task.length
    assert choose(arm).length == one.task.length
    assert_allclose(inspect(arm).sigma, np.linalg.svd(one.task.matrix(arm.jacobian(inspect(arm).q)))[1])
    assert loads(run.scenario.to_yaml()) == run.scenario


def damping_of(scenario):
    damping = scenario.control.inverse.damping
    return damping.below, damping.maximum


def test_what_is_given_stays_and_the_others_follow():
    path = ROOT / "models/ur5e.xml"
    length, below, maximum = numbers(Controller(path, "tool"))

    def some(task=None, **damping):
        keys = {"axes": AXES} | (task or {})
        return numbers(Controller(path, "tool", {"inverse": {"damping": damping}}, task=keys))

    assert some(below=0.2) == (length, 0.2, damping_maximum(0.2))
    assert some(maximum=0.3) == (length, below, 0.3)
    assert some(below=0.2, maximum=0.5) == (length, 0.2, 0.5)
    arm = load_arm(path, "tool")
    usual = np.median(np.linalg.svd(arm.proportions.jacobian, compute_uv=False)[:, -1])
    assert some({"length": 1}) == (1.0, float(f"{usual / 3:.2g}"), damping_maximum(float(f"{usual / 3:.2g}")))
    assert Controller(path, "tool", {"inverse": {"damping": {"below": 0.2}}}).assumed[-1] == (
        f"from the arm: length {length:g} m, damping maximum 0.15"
    )
    inverse = {"inverse": {"method": "pseudoinverse"}}
    assert Controller(path, "tool", inverse, task={"length": 1}).assumed == ()  # it reads none of them
