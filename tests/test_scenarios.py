"""Every scenario that is shipped does what its `expect` says, and could fail to."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from project import ROOT
from rmrc import arm as arms
from rmrc import textbook
from rmrc.results.expectations import check
from rmrc.scenario import load
from rmrc.textbook.inverse import weighted_left_inverse
from shipped import shipped
from verdicts import denied

SCENARIOS = sorted(path.stem for path in (ROOT / "scenarios").glob("*.yaml"))


def outcomes(name, *overrides):
    run = shipped(name, *overrides)
    assert run.is_complete
    return run, check(run.scorecard, load(ROOT / f"scenarios/{name}.yaml", overrides).expect)


@pytest.mark.parametrize("name", SCENARIOS)
def test_shipped_scenario_meets_its_expectations(name):
    run, results = outcomes(name)
    assert denied(run.verdict, run) == [], run.verdict
    assert results, "a shipped scenario says what it expects"
    assert all(outcome.ok for outcome in results), [str(outcome) for outcome in results if not outcome.ok]


# More damping than the arms need: with what fits them, some do no worse.
DAMPED = "control.inverse={method: damped, damping: {maximum: 0.1, below: 0.3}}"
FAULTS = [
    ("approach_singularity", "control.limits.rate=0.5"),
    ("stanford_line", "control.feedback=1"),
    ("slow_wrist", "control.at_singularity=damp"),
    ("joint_limit", "control.limits.on_excess=clamp"),
    ("ur5e_own_drives", "control.feedback=2"),
    ("spray_past_the_wrist", "task.axes=[x, y, z, rx, ry, rz]"),
    ("start_by_pose", "arm.pose.orientation=[160 deg, 0, 0]"),
    # blind to the buckling: what the elbow does moves the tip neither in x nor in y
    ("hold_at_singularity", "task.axes=[x, y]"),
]


@pytest.mark.parametrize(("name", "fault"), FAULTS)
def test_expectations_find_a_law_that_does_worse(name, fault):
    _, results = outcomes(name, fault)
    assert not all(outcome.ok for outcome in results)


# What the textbook has for |det J| at the joint positions that a path leads to.
CLOSED = {
    "anthropomorphic_elbow": lambda q: textbook.anthropomorphic_determinant([0.8, 0.6], q),
    "torus_elbow": lambda q: textbook.torus_determinant([1.2, 0.6, 0.5], q),
    "helical_crank": lambda q: textbook.helical_determinant(0.5 / (2 * np.pi), 0.5, q),
    "annulus_6_3": lambda q: textbook.two_link_determinant([6, 3], q),
    "stanford_boom": textbook.stanford_determinant,
    "puma_elbow": textbook.puma_determinant,
    "three_roll": textbook.three_roll_determinant,
}


@pytest.mark.parametrize("name", CLOSED)
def test_an_arm_is_expected_to_be_as_near_to_its_singularity_as_the_closed_form_says(name):
    scenario = load(ROOT / f"scenarios/{name}.yaml")
    (goal,) = scenario.target.path[0].configurations
    expected = scenario.expect["manipulability.min"]
    assert abs(CLOSED[name](goal)) == pytest.approx(expected.equals, abs=0.02 * expected.within + 5e-5)
    assert expected.within < 0.05 * expected.equals


@pytest.mark.parametrize(
    ("name", "column", "formula"),
    [
        ("anthropomorphic_shoulder", "joint_rate.waist.peak", 0.2 / 0.1),
        ("torus_axis", "joint_rate.theta_1.peak", 0.2 / 0.1),
        ("rp_pivot", "joint_rate.pivot.peak", 0.2 / 0.1),
        ("stanford_shoulder", "joint_rate.theta_2.peak", 0.2 / 0.5),
        ("spherical_wrist_pole", "joint_rate.theta_1.peak", 0.5 / np.tan(np.radians(10))),
        ("puma_wrist", "joint_rate.theta_4.peak", 0.5 / np.tan(np.radians(10))),
    ],
)
def test_a_rate_past_a_singularity_is_expected_as_the_closed_form_says(name, column, formula):
    assert load(ROOT / f"scenarios/{name}.yaml").expect[column].equals == pytest.approx(formula, abs=1e-3)


def test_more_rows_than_joints_are_the_textbooks_left_inverse_at_every_tick():
    run, _ = outcomes("more_rows_than_joints")
    feedback = load(ROOT / "scenarios/more_rows_than_joints.yaml").control.feedback
    arm = arms.load(ROOT / "models/planar_2link.xml", "tip")
    rows, W, without_weights = [0, 1, 5], np.diag([1.0, 1.0, 0.001]), []
    for t in range(0, len(run), 50):
        twist = (run["twist_ref"][t] + feedback * run["pose_error"][t])[rows]
        J = arm.jacobian(run["q"][t])[rows]
        # The normal equations have κ(J)² = 6, over √0.001, of digits less than the law: 1e-13.
        wanted = weighted_left_inverse(J, W) @ twist
        np.testing.assert_allclose(run["qdot_cmd"][t], wanted, atol=1e-12)
        without_weights.append(np.abs(weighted_left_inverse(J, np.eye(3)) @ twist - wanted).max())
    assert max(without_weights) > 0.01  # rad/s: such a law would be seen


def test_a_jet_that_may_turn_about_itself_has_no_wrist_singularity():
    run, _ = outcomes("spray_past_the_wrist")
    assert np.degrees(run["q"][:, 4]).min() < -20  # through theta_5 = 0
    # At theta_5 = 0 axes 4 and 6 are one: the six rows of mj_jacSite lose a direction, and the five do not.
    arm = arms.load_asked(load(ROOT / "scenarios/spray_past_the_wrist.yaml").arm)
    q = run["q"][np.argmin(np.abs(run["q"][:, 4]))]
    axes = Rotation.from_quat(arm.pose(q)[3:], scalar_first=True).as_matrix().T
    J = np.vstack([axes @ arm.jacobian(q)[:3], axes @ arm.jacobian(q)[3:]])
    six, five = (np.linalg.svd(rows, compute_uv=False)[-1] for rows in (J, J[:5]))
    assert six < 1e-3 < 0.25 < five
