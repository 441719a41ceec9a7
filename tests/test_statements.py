"""What the documents and the comments of scenarios say in words holds: each sentence is quoted, and its run looked at.

A sentence that is written anew fails here until its test is, too.
"""

import importlib
import itertools
import re
from functools import cache

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from pages import PAGES
from project import ROOT
from rmrc import arm as arms
from rmrc.results.scorecard import scorecard
from rmrc.scenario import load, loads, schema_rows
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError


def says(document, sentence):
    """Whether a file has a sentence, however its lines are broken."""
    text = (ROOT / document).read_text("utf-8")
    return sentence in " ".join(word for word in text.split() if word != "#")


def assert_says(document, sentence):
    assert says(document, sentence), f'{document} does not say "{sentence}"'


def scenario_says(name, *sentences):
    for sentence in sentences:
        assert_says(f"scenarios/{name}.yaml", sentence)


@cache
def ran(name, *overrides):
    """Return (prepared, run, values of the figures) of a shipped scenario."""
    prepared = prepare(load(ROOT / f"scenarios/{name}.yaml", overrides))
    (run,) = Simulation([prepared]).run()
    return prepared, run, {figure: one.value for figure, one in scorecard(run).items()}


def ratio(a, b):
    return a / b


PLAIN = ("control.inverse.method=inverse", "control.limits={on_excess: none, position: false}")


def test_a_sentence_that_is_not_there_is_seen():
    assert says("scenarios/blow_up.yaml", "a target 1 mm beyond full reach. Look at the commanded rates")
    assert not says("scenarios/blow_up.yaml", "a target 2 mm beyond full reach")


# Scenarios --------------------------------------------------------------------------------------


def test_two_tasks_that_cannot_both_be_done_meet_where_the_arm_itself_is_not_singular():
    scenario_says(
        "algorithmic_singularity",
        "the line leads to where the wrist would have to be more than a link's length above the tip",
        "while the arm itself is far from any singularity",
    )
    prepared, run, figures = ran("algorithmic_singularity")
    wrist = prepared.arm.pose(run["q"][0], "wrist")[1]
    assert (
        wrist - run["pose_ref"][:, 1].min() > 0.6 > wrist - run["pose_ref"][0, 1]
    )  # the last link has 0.6 m
    assert figures["sigma.min"] > 0.5


def test_damping_sets_in_where_the_approach_says_and_costs_millimeters():
    scenario_says(
        "approach_singularity",
        "driven straight to 3 mm beyond full reach",
        "Damping sets in below sigma = 0.3 and leaves some millimeters of error along the lost direction",
    )
    _, run, figures = ran("approach_singularity")
    assert run["pose_ref"][:, 0].max() - 2.0 == pytest.approx(0.003, abs=1e-9)
    np.testing.assert_array_equal((run["status"] & Status.DAMPED) > 0, run["sigma"][:, -1] < 0.3)
    assert 0.01 < figures["position_error_along.max"] < 0.03 and figures["joint_rate_plain.peak"] > 15.0
    prepared = prepare(load(ROOT / "scenarios/approach_singularity.yaml"))
    beside = prepare(prepared.scenario.changed(*prepared.scenario.baseline_changes))
    (plain,) = Simulation([beside]).run()
    np.testing.assert_array_equal(plain["qdot_cmd"], plain["qdot_plain"])
    assert scorecard(plain)["joint_rate_cmd.peak"].value > 1000.0


def test_a_tip_is_off_by_what_the_jacobian_makes_of_the_encoders():
    scenario_says(
        "encoder_offsets",
        "the tip is soon 3 mm off and stays so, by J δ of the offsets δ",
        "three standard deviations of J δ are 0.0103",
    )
    prepared, run, _ = ran("encoder_offsets")
    error = np.linalg.norm(run["pose_error"][:, :2], axis=1)
    soon = run["time"] > 0.2
    assert np.all((error[soon] > 0.0025) & (error[soon] < 0.0030))
    J = prepared.arm.jacobian(run["q"][-1])[:2]
    # To second order: half of reach times the square of the offsets, 1e-5 m.
    assert np.linalg.norm(J @ prepared.encoder_offset) == pytest.approx(error[-1], abs=1e-5)
    assert 3.0 * np.radians(0.1) * np.linalg.norm(J) == pytest.approx(0.0103, abs=5e-5)


def test_wrong_lengths_cost_their_share_of_the_distance_whatever_the_gain():
    scenario_says(
        "wrong_lengths",
        "0.5 % of its distance from the shoulder beyond its target, 9.75 mm at 1.95 m and 5 mm at 1 m, whatever the gain",
        "--vary control.feedback=5,20,80",
        "law and arm have the same lengths",
    )
    for gain in (5, 20, 80):
        _, run, _ = ran("wrong_lengths", f"control.feedback={gain}")
        out = np.argmax(run["pose_ref"][:, 0])  # where it begins to wait
        rests = run["pose_ref"][:, 0] == run["pose_ref"][out, 0]
        held = np.flatnonzero(rests)[-1]
        # what rate servos are off on the way is gone but for 1 % after a second of the lowest gain
        np.testing.assert_allclose(run["pose_error"][[held, -1], 0], [-0.00975, -0.005], rtol=0, atol=1e-5)
    known = ("arm.stretch={link_1: 1.005, link_2: 1.005}", "plant.stretch={}")
    assert ran("wrong_lengths", *known)[2]["position_error.end"] < 1e-9


def test_ten_times_the_period_makes_nine_times_the_error():
    scenario_says("example_5_5", "ten times the period makes nine times the error")
    (_, _, short), (_, _, long) = ran("example_5_5"), ran("example_5_5", "control.period=1.0e-3")
    assert ratio(long["position_error.end"], short["position_error.end"]) == pytest.approx(9.0, abs=0.1)


def test_damping_pays_at_full_reach_the_pseudoinverse_races_and_truncation_locks():
    scenario_says(
        "full_reach",
        "Damping keeps it below 1.2 rad/s and pays with 13 mm along the arm; "
        "the pseudoinverse asks for more than 10 rad/s at the last millimeter",
        "`truncated` locks the arm straight for good",
    )
    _, _, damped = ran("full_reach")
    assert damped["joint_rate_cmd.elbow.peak"] < 1.2
    assert damped["position_error_along.max"] == pytest.approx(0.013, abs=5e-4)
    _, run, figures = ran("full_reach", "control.inverse.method=pseudoinverse")
    assert figures["joint_rate_cmd.elbow.peak"] > 10.0
    fastest = np.abs(run["qdot_cmd"]).max(axis=1).argmax()
    assert 0.0 < 2.0 - np.linalg.norm(run["pose"][fastest, :2]) < 0.001
    gentle = ("target.limits.acceleration=1", "target.limits.jerk=10")
    _, run, _ = ran("full_reach", "control.inverse.method=truncated", *gentle)
    assert run.is_complete and run["pose_ref"][-1, 0] == pytest.approx(1.5)
    assert np.linalg.norm(run["pose"][-1, :2]) > 1.999 and abs(run["qdot"][-1]).max() < 0.01


def test_the_same_force_would_need_ten_times_the_elbow_of_a_bent_arm():
    scenario_says(
        "hold_at_singularity",
        "tau, which stays below a twentieth of the actuators' limits. With the arm bent by 60 deg, the same force "
        "would need ten times the torque of the elbow",
    )
    prepared, _, figures = ran("hold_at_singularity")
    assert figures["tau.share_of_limit"] < 1 / 20
    bent = prepared.arm.jacobian(np.radians([-30.0, 60.0]))[:3].T @ [-1000.0, 0.0, 0.0]
    assert abs(bent[1]) == pytest.approx(10.0 * prepared.arm.torque_limit[1], rel=1e-12)


def test_the_shoulder_brakes_at_its_limit_and_the_tip_stays_on_its_circle():
    scenario_says(
        "joint_limit",
        "until the shoulder meets its limit of 170 deg",
        "The shoulder brakes in time, elbow and wrist take over its part, and the tip stays on its circle",
    )
    _, run, figures = ran("joint_limit")
    # A servo follows its command to some 1e-5 rad.
    assert np.degrees(run["q"][:, 0].max()) == pytest.approx(170.0, abs=1e-3)
    assert figures["position_error.max"] < 2e-4


def test_weights_say_which_of_three_rows_gives_way():
    scenario_says("more_rows_than_joints", "the weights decide which of them is larger")
    weights = ("[1,1,0.001]", "[1,1,1]", "[0.001,0.001,1]")
    assert all(says("scenarios/more_rows_than_joints.yaml", one) for one in weights)
    each = [ran("more_rows_than_joints", f"task.weights={one}")[2] for one in weights]
    position = [one["position_error.max"] for one in each]
    orientation = [one["orientation_error.max"] for one in each]
    assert position == sorted(position) and orientation == sorted(orientation, reverse=True)
    assert position[0] < 0.001 < 0.1 < position[2] and orientation[2] < 0.001 < 0.1 < orientation[0]


def test_rows_of_a_plane_never_move():
    scenario_says("only_some_velocities", "Of all six rows, y, rx and rz never move")
    prepared, run, _ = ran("only_some_velocities")
    largest = np.max([np.abs(prepared.arm.jacobian(q)) for q in run["q"][::50]], axis=(0, 2))
    assert np.all(largest[[1, 3, 5]] < 1e-12) and np.all(largest[[0, 2, 4]] > 0.1)


def test_postures_are_swept_with_nothing_to_be_seen_at_the_tip():
    scenario_says(
        "posture_sweep",
        "the elbow passes from one side to the other without any effect on the tip",
        "at the wrist, which turns back 0.3 deg before its limit",
    )
    prepared, run, figures = ran("posture_sweep")
    elbow, wrist = np.degrees(run["q"][:, 1:]).T
    assert elbow[0] < -80 and elbow.max() > 40
    assert figures["position_error.max"] < 1e-4
    left = wrist.min() - np.degrees(prepared.arm.position_limit[2, 0])
    assert left == pytest.approx(0.3, abs=0.05) and wrist[-1] > wrist.min() + 1


def test_a_slowed_hand_turns_its_wrist_by_nearly_half_a_turn_within_the_rates():
    scenario_says(
        "slow_wrist",
        "theta_4 and theta_6 turn by nearly half a turn within their rate limits and the hand stays on its path",
        "an error that is a fortieth of the damped hand's",
    )
    prepared, run, figures = ran("slow_wrist")
    assert np.all(np.abs(run["qdot"]) < prepared.arm.rate_limit)
    assert np.all(np.abs(np.degrees(np.ptp(run["q"][:, [3, 5]], axis=0)) - 177) < 2)
    damped = ran("stanford_wrist")[2]["orientation_error.max"]
    assert ratio(damped, figures["orientation_error.max"]) == pytest.approx(40.0, abs=2.0)


def test_the_plain_inverse_races_past_the_wrist_and_damping_gives_way():
    scenario_says(
        "stanford_wrist",
        "the plain inverse without limits requests tens of rad/s",
        "at an error of up to half a degree and 13 mm",
    )
    for plant in ("servo", "ideal"):
        _, _, plain = ran("stanford_wrist", *PLAIN, f"plant.kind={plant}")
        assert 20.0 < plain["joint_rate_cmd.peak"] < 60.0
    _, _, figures = ran("stanford_wrist")
    assert np.degrees(figures["orientation_error.max"]) == pytest.approx(0.5, abs=0.05)
    assert figures["position_error.max"] == pytest.approx(0.013, abs=5e-4)


def test_the_closer_the_hand_the_faster_the_exact_way_and_the_less_the_damped_one():
    scenario_says(
        "stanford_wrist_close",
        "ten times closer: the exact motion is ten times faster",
        "a hand that passes closer has smaller joint rates and smaller errors",
    )

    def exact(name):
        """The rate at which the wanted hand goes around the boom, by the angle of its axis about the boom's."""
        w, x, y, z = ran(name)[1]["pose_ref"][:, 3:].T
        around = np.unwrap(np.arctan2(2 * (y * z - w * x), 1 - 2 * (x * x + y * y)))
        return np.abs(np.diff(around)).max() / 0.001

    # Differences over a tick of a motion that takes some 70 and 7 ticks: the second is 2 % less than the rate.
    assert ratio(exact("stanford_wrist_close"), exact("stanford_wrist")) == pytest.approx(10.0, rel=0.05)
    close, far = ran("stanford_wrist_close")[2], ran("stanford_wrist")[2]
    for figure in ("joint_rate.peak", "orientation_error.max", "position_error.max"):
        assert close[figure] < 0.5 * far[figure]


def test_the_best_rates_halve_the_error_where_the_inverse_asks_for_several_times_the_limits():
    name = "best_within_limits"
    scenario_says(
        name,
        "the hand is off by 202 mrad and 40 mm",
        "105 mrad and 27 mm",
        "with six times the acceleration",
    )
    found = {how: ran(name, f"control.limits.on_excess={how}")[2] for how in ("scale", "optimal")}
    for how, turned, off in (("scale", 202, 40), ("optimal", 105, 27)):
        # as printed, and what processors round differently beside a singularity
        assert 1e3 * found[how]["orientation_error.max"] == pytest.approx(turned, rel=0.03)
        assert 1e3 * found[how]["position_error.max"] == pytest.approx(off, rel=0.03)
    hard = [found[how]["joint_acceleration_cmd.peak"] for how in ("optimal", "scale")]
    assert ratio(*hard) == pytest.approx(6.0, rel=0.1)


def test_an_arm_stops_before_its_singularity_and_its_elbow_keeps_its_side():
    scenario_says(
        "stop_and_wait",
        "it stops where sigma_min falls below 0.2",
        "the elbow, which keeps its side",
    )
    _, run, _ = ran("stop_and_wait")
    stopped = (run["status"] & Status.STOPPED) > 0
    first = stopped.argmax()
    assert run["sigma"][first, -1] <= 0.2 < run["sigma"][first - 1, -1]
    assert np.degrees(run["q"][:, 1]).max() < -20


def test_lines_are_followed_at_their_speed_far_from_singularities():
    scenario_says("line_tracking", "follows lines at 0.25 m/s, far from its singularities")
    _, run, figures = ran("line_tracking")
    assert np.linalg.norm(run["twist_ref"][:, :3], axis=1).max() == pytest.approx(0.25, rel=1e-9)
    assert figures["sigma.min"] > 0.5


# How-to -----------------------------------------------------------------------------------------


def test_the_plain_inverse_runs_into_all_limits_and_the_damped_one_into_none():
    assert_says(
        PAGES["Compare methods"],
        "The plain inverse runs into the joints' limits of rate, position and torque; the damped inverse reaches "
        "none of them",
    )
    _, _, plain = ran("stanford_wrist", "control.inverse.method=inverse")
    _, _, damped = ran("stanford_wrist")
    limits = ("RATE_LIMITED", "POSITION_LIMITED", "ACCELERATION_LIMITED")
    assert plain["tau.share_of_limit"] == 1.0 and all(
        plain[f"status_time.{one}"] > 0.05 for one in limits[:2]
    )
    assert damped["tau.share_of_limit"] < 0.5 and not any(damped[f"status_time.{one}"] for one in limits)


def test_few_keys_have_no_default():
    assert_says(
        PAGES["Write a scenario"], "Everything but `name`, `arm.model` and `target.path` has a default."
    )
    required = {row.key for row in schema_rows() if row.default == "required"}
    top = {key for key in required if not key.startswith(("target.path", "expect", "look", "sweep"))}
    assert top | {"target.path"} == {"name", "arm.model", "target.path"}


def test_mistakes_of_a_text_come_all_at_once_and_those_of_its_model_after_them():
    assert_says(
        PAGES["Write a scenario"],
        "The program reports all mistakes in its keys and values at once, each with file, line, column and key. "
        "It reports mistakes that only the model reveals after these are corrected.",
    )
    text = (ROOT / "scenarios/blow_up.yaml").read_text("utf-8").replace("../models", f"{ROOT}/models")
    wrong = text.replace("feedback: 20", "feedback: -1").replace("kv: 1000", "kw: 1000")
    wrong = wrong.replace("site: tip", "site: none")
    with pytest.raises(ScenarioError) as raised:
        loads(wrong, "x.yaml")
    assert [
        re.match(r"x\.yaml:\d+:\d+: ([\w.]+): ", line)[1] for line in map(str, raised.value.problems)
    ] == [
        "control.feedback",
        "plant.kw",
    ]
    with pytest.raises(ScenarioError, match=r"^x\.yaml:\d+:\d+: arm\.site: "):
        prepare(loads(text.replace("site: tip", "site: none"), "x.yaml"))


def test_a_ur5e_cannot_do_what_its_wrist_singularity_asks_and_damped_it_need_not():
    scenario_says(
        "ur5e_wrist",
        "the plain inverse without limits asks for more than 30 rad/s, ten times the limits of the actuators",
        "there the hand is level, so that it must be at least 1 deg off, and it is less than 2 deg",
        "sin(1.5558 deg) sin(40 deg) = sin(1 deg)",
    )
    assert np.sin(np.radians(1.5558)) * np.sin(np.radians(40.0)) == pytest.approx(
        np.sin(np.radians(1)), rel=1e-4
    )
    prepared, _, damped = ran("ur5e_wrist")
    _, _, plain = ran("ur5e_wrist", *PLAIN, "plant.kind=ideal")
    assert plain["joint_rate_cmd.peak"] > 30.0 > 9.5 * prepared.scenario.control.limits.rate
    assert np.radians(1.0) < damped["orientation_error.max"] < np.radians(2.0)
    scenario_says(
        "ur5e_wrist_close",
        "the exact motion is ten times faster, and too fast for a servo",
        "with hardly any error, because the required change is a tenth as large",
    )
    _, _, close = ran("ur5e_wrist_close")
    _, _, exact = ran("ur5e_wrist_close", *PLAIN, "plant.kind=ideal")
    assert exact["joint_rate_cmd.peak"] > 10 * plain["joint_rate_cmd.peak"]
    assert close["joint_rate.peak"] < damped["joint_rate.peak"] / 3
    assert ratio(damped["orientation_error.max"], close["orientation_error.max"]) == pytest.approx(
        10.0, rel=0.1
    )


def test_a_ur5e_comes_back_from_beyond_its_reach_with_the_error_that_was_asked_for():
    scenario_says(
        "ur5e_elbow",
        "to 10 mm beyond where its elbow is straight",
        "the error is those 10 mm and the error of damping",
    )
    _, _, figures = ran("ur5e_elbow")
    # The flange is 0.1 m below the wrist: to tilt it instead takes a hundredth off.
    assert 0.010 / 1.01 < figures["position_error.max"] < 0.020 and figures["joint_rate.peak"] < np.pi


def test_a_ur5e_follows_late_by_its_own_drives():
    scenario_says(
        "ur5e_own_drives",
        "lag behind it by their damping over their stiffness, 0.2 s",
        "at most 16 mm late, while the rate servos (--set plant.kind=servo) are 0.1 mm late",
        "With 0.418 m, as in ur5e_elbow, the lag carries the elbow through straight, and the arm comes back bent to "
        "the other side",
    )
    prepared, run, own = ran("ur5e_own_drives")
    stiffness, damping = (-prepared.arm.model.actuator_biasprm[:, i] for i in (1, 2))
    assert_allclose(damping / stiffness, 0.2, rtol=1e-12)
    _, _, servo = ran("ur5e_own_drives", "plant.kind=servo")
    assert 0.0155 < own["position_error.max"] < 0.0165 and 0.5e-4 < servo["position_error.max"] < 1.5e-4
    (far,) = [piece.line.by[0] for piece in load("ur5e_elbow").target.path[:1]]
    _, beyond, _ = ran(
        "ur5e_own_drives", f"target.path[0].line.by[0]={far}", f"target.path[1].line.by[0]={-far}"
    )
    assert far == 0.418 and (run["q"][:, 2] > 0.0).all()
    assert beyond["q"][0, 2] > 1.0 and beyond["q"][-1, 2] < 0.0


def test_an_fr3_is_singular_with_its_elbow_bent():
    scenario_says(
        "fr3_elbow",
        "singular, at theta_4 = -26.76 deg: with the elbow bent, not straight",
        "With damping, the elbow stops before that angle and comes back on the same side. The pseudoinverse takes "
        "it through, with actuators at their limits, and the hand is off by at least twice as much",
    )
    _, run, damped = ran("fr3_elbow")
    _, through, plain = ran("fr3_elbow", "control.inverse.method=pseudoinverse")
    assert np.degrees(run["q"][:, 3]).max() < -30.0 and damped["return.joint_change"] < 1e-3
    assert np.degrees(through["q"][:, 3]).max() > -26.7 and plain["tau.share_of_limit"] == 1.0
    # on which side of the singularity it ends is chance: 0.029 m or 0.277 m, as time steps and speeds have it
    assert ratio(plain["position_error.max"], damped["position_error.max"]) > 1.9


def test_the_wrist_of_an_xarm7_is_not_singular_where_its_axes_are_parallel():
    scenario_says(
        "xarm7_wrist",
        "not singular at theta_6 = 0, where both are parallel, but at theta_6 = -12.3 deg (for this elbow)",
        "Damping takes the peak of the joint rates from 2.1 to 0.9 rad/s and gives way by 8 mm, which are back at the end",
    )
    prepared, run, damped = ran("xarm7_wrist")
    _, _, plain = ran("xarm7_wrist", "control.inverse.method=pseudoinverse")
    at = [np.radians([0, -20, 0, 70, 90, wrist, 0]) for wrist in (0.0, -12.3285)]
    parallel, crossed = (np.linalg.svd(prepared.arm.jacobian(q), compute_uv=False)[-1] for q in at)
    assert parallel > 0.03 and crossed < 1e-6
    assert plain["joint_rate.peak"] == pytest.approx(2.1, abs=0.05)
    assert damped["joint_rate.peak"] == pytest.approx(0.9, abs=0.05)
    assert (
        damped["position_error.max"] == pytest.approx(0.008, abs=5e-4) and damped["position_error.end"] < 1e-4
    )


def test_the_weights_say_what_an_arm_of_five_joints_gives_up():
    scenario_says(
        "so101_five_joints",
        "the gripper turns with the shoulder, by 22 deg",
        "With weights of 1 a radian counts as much as a meter; the gripper goes 6 of 100 mm",
    )
    _, _, kept = ran("so101_five_joints")
    assert np.degrees(kept["orientation_error.max"]) == pytest.approx(22.0, abs=0.5)
    _, run, _ = ran("so101_five_joints", "task.weights=[1,1,1,1,1,1]")
    assert run["pose"][:, 1].max() == pytest.approx(0.006, abs=5e-4)


def test_a_round_jet_turns_by_itself_where_six_rows_flip_the_wrist():
    scenario_says(
        "spray_past_the_wrist",
        "1 deg beside theta_5 = 0",
        "sigma_min stays above 0.26 and theta_5 passes through 0",
        "a jet that turns by 1.6 deg about itself",
        "sigma_min falls to 0.005 and the wrist flips at 4 rad/s",
    )
    _, run, figures = ran("spray_past_the_wrist")
    assert figures["sigma.min"] > 0.26 and run["q"][:, 4].min() < 0
    assert np.degrees(np.ptp(run["pose_error"][:, 5])) == pytest.approx(1.6, abs=0.05)
    _, run, figures = ran("spray_past_the_wrist", "task.axes=[x, y, z, rx, ry, rz]")
    assert figures["sigma.min"] == pytest.approx(0.005, abs=5e-4)
    assert figures["joint_rate.peak"] == pytest.approx(4.0, abs=0.01)
    # of the wanted hand, axis 6 comes by axis 4 of an arm that stands there as near as it says: with 1/6 of the rows'
    # errors the plain six rows are off; the ideal law without limits is not
    _, run, _ = ran(
        "spray_past_the_wrist",
        "task.axes=[x,y,z,rx,ry,rz]",
        "plant.kind=ideal",
        "control.limits={on_excess: none, position: false}",
    )
    assert np.degrees(np.abs(run["q"][:, 4])).min() == pytest.approx(1.0, abs=0.05)


def test_a_spline_of_a_recorded_circle_is_off_by_hundredths_of_a_millimeter():
    scenario_says(
        "recorded_motion",
        "has 41 rows of a circle, 0.1 s apart",
        "is off the circle by 0.008 mm",
        "peaks at 2 (2 pi 0.2)/T = 0.63 m/s, more than target.limits allow by default",
    )
    _, run, _ = ran("recorded_motion")
    away = np.linalg.norm(run["pose_ref"][:, :2] - [1.0, 0.5], axis=1) - 0.2
    assert np.abs(away).max() == pytest.approx(8e-6, abs=1e-6)
    with pytest.raises(ScenarioError, match=r"speed: auto"):
        ran("recorded_motion", "target.limits.velocity=0.25")


def test_straight_down_is_a_motion_in_the_plane_of_the_links():
    scenario_says("start_by_pose", "shoulder_lift, elbow and wrist_1 do it, and the other three rest")
    _, run, _ = ran("start_by_pose")
    assert (np.ptp(run["q"], axis=0) > 0.05).tolist() == [False, True, True, True, False, False]


# Questions --------------------------------------------------------------------------------------


def test_a_force_across_the_stretched_arm_needs_twenty_times_the_shoulder():
    assert_says("docs/questions.md", "The same force across the arm would need 2000 N·m.")
    arm = arms.load(ROOT / "models/planar_2link.xml")
    torques = arm.jacobian(np.radians([90.0, 0.0]))[:3].T @ [1000.0, 0.0, 0.0]
    assert abs(torques[0]) == pytest.approx(2000.0, rel=1e-12)


def test_the_puma_has_eight_postures_without_its_limits(rmrc, monkeypatch):
    assert_says("docs/questions.md", "With `--no-limits` there are 8.")
    monkeypatch.chdir(ROOT)
    goal = ("ik", "models/puma560.xml", "--to", "0.4,0.2,0.9,0,90 deg,0", "--all")
    assert_says("docs/questions.md", " ".join(goal).replace(goal[3], f'"{goal[3]}"'))
    assert rmrc(*goal, "--no-limits")[1].startswith("puma560, tool: 8 postures;")


# Models -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("site", "at_home"), [("wrist", 0.26), ("tool", 0.25)])
def test_no_posture_of_the_puma_is_far_from_its_singularities(site, at_home):
    assert_says(
        "models/README.md",
        "For `puma560` it is 0.26 at the wrist and 0.25 at the tool: no posture has more than 0.27",
    )
    arm = arms.load(ROOT / "models/puma560.xml", site)
    home = np.linalg.svd(arm.jacobian(arm.keyframes["home"]), compute_uv=False)[-1]
    assert home == pytest.approx(at_home, abs=0.005)
    low, high = arm.position_limit.T
    found = np.random.default_rng(1).uniform(low, high, (2000, 6))
    assert max(np.linalg.svd(arm.jacobian(q), compute_uv=False)[-1] for q in found) < 0.27


UNITS = {"°": np.pi / 180.0, "in": 0.0254, "m": 1.0, "rad": 1.0}


def model_tables():
    """Yield (arm, row, value) of the tables of models/README.md; of two arms in a table, each has its own value."""
    text = (ROOT / "models/README.md").read_text("utf-8").replace("−", "-")
    for heading, body in re.findall(r"^## ([\w, ]+)\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL):
        names = heading.split(", ")
        for row, value in re.findall(r"^\| ([^|]+?) \| ([^|]+?) \|", body, re.MULTILINE):
            for index, name in enumerate(names):
                chosen = re.sub(r"([-\d.]+) or ([-\d.]+)", rf"\{index + 1}", value)
                chosen = re.sub(r"(\([^)]*\)) or (\([^)]*\))", rf"\{index + 1}", chosen)
                yield name, row, chosen


def in_the_file(arm, row):
    """Return what a model has of a row."""
    model = arm.model
    moving = model.body_mass > 0
    masses, moments = model.body_mass[moving], model.body_inertia[moving]
    return {
        "mass, each link": masses,
        "masses": masses,
        "masses, links 2 to 6": masses[1:],
        "moments along": moments.min(axis=1),
        "moments across": moments.max(axis=1),
        "armature": model.dof_armature[[model.joint(name).dofadr[0] for name in arm.joints]],
        "rate limits": stated_rates(arm) if np.isinf(arm.rate_limit).all() else arm.rate_limit,
        "torque limits": arm.torque_limit,
        "torque and force limits": arm.torque_limit,
        "position limits": arm.position_limit.ravel(),
    }[row]


def stated_rates(arm):
    """Return the rate limits that the scenarios of an arm have: MJCF has none beside position servos."""
    scenarios = [load(path) for path in sorted((ROOT / "scenarios").glob(f"{arm.path.stem}_*.yaml"))]
    (rates,) = {np.broadcast_to(one.control.limits.rate, arm.n).tobytes() for one in scenarios}
    return np.frombuffer(rates)


def numbers(value):
    return [float(one) for one in re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.])", value)]


def limits(value):
    """Return the ends of ranges such as `±170°, 12 to 50 in`."""
    ends = []
    for piece in re.sub(r" \([^)]*\)", "", value).split(", "):
        low, high, unit = re.fullmatch(r"(?:±|(-?[\d.]+) to )(-?[\d.]+) ?(°|in|m|rad)", piece).groups()
        ends += [float(end) * UNITS[unit] for end in (low or f"-{high}", high)]
    return ends


ROWS = [case for case in model_tables() if re.match(r"mass|moments a|armature|[\w ]+ limits", case[1])]


def test_every_arm_has_rows_of_each_kind():
    names = {path.stem for path in (ROOT / "models").glob("*.xml")}
    for kind in ("armature", "rate limits", "position limits", r"torque (?:and force )?limits"):
        assert {name for name, row, _ in ROWS if re.fullmatch(kind, row)} == names, kind


@pytest.mark.parametrize(("name", "row", "value"), ROWS)
def test_tables_of_the_models_are_what_the_files_have(name, row, value):
    arm = arms.load(ROOT / f"models/{name}.xml")
    said, have = limits(value) if row == "position limits" else numbers(value), in_the_file(arm, row)
    said = said * (len(have) // len(said)) if len(said) < 3 else said  # one for all joints, or for all links
    # Of six or seven digits the last is rounded.
    np.testing.assert_allclose(said, have, rtol=2e-6)


@pytest.mark.parametrize(
    ("name", "sentence", "least", "most"),
    [
        ("anthropomorphic", "60, 60, 20 N m | our choice: more than four times gravity", 4.0, 5.0),
        ("torus_3r", "80, 40, 15 N m | our choice: more than five times gravity", 5.0, 5.5),
        ("torus_3r_short", "80, 40, 15 N m | our choice: more than five times gravity", 5.0, 5.5),
        ("spherical_wrist", "5 N m | our choice: eight times gravity", 7.9, 8.1),
        ("stanford", "15, 15, 10 N m | our choice: twice gravity anywhere, and more", 2.0, 2.5),
    ],
)
def test_drives_hold_their_arm_so_often(name, sentence, least, most):
    assert_says("models/README.md", sentence)
    arm = arms.load(ROOT / f"models/{name}.xml")
    data, (low, high) = mujoco.MjData(arm.model), arm.position_limit.T
    rng, borne = np.random.default_rng(0), np.zeros(arm.n)
    # The largest is where links are level: random positions come to 2 % of it.
    for _ in range(3000):
        data.qpos[:] = rng.uniform(low, high)
        mujoco.mj_forward(arm.model, data)
        borne = np.maximum(borne, np.abs(data.qfrc_bias))
    times = np.min(arm.torque_limit[borne > 0.01] / borne[borne > 0.01])
    assert least < times < most * 1.02


@pytest.mark.parametrize(
    ("name", "sentence", "acceleration"),
    [
        ("planar_2link", "100, 50 N m | our choice: about 25 rad/s² with the arm outstretched", 25.0),
        ("planar_6_3", "4000, 500 N m | our choice: about 2.7 rad/s² with the arm outstretched", 2.7),
    ],
)
def test_drives_turn_an_outstretched_arm_so_fast(name, sentence, acceleration):
    assert_says("models/README.md", sentence)
    arm = arms.load(ROOT / f"models/{name}.xml")
    data, inertia = mujoco.MjData(arm.model), np.zeros((arm.n, arm.n))
    mujoco.mj_forward(arm.model, data)
    mujoco.mj_fullM(arm.model, data, inertia)
    # All links swing with the first joint.
    assert arm.torque_limit[0] / inertia[0, 0] == pytest.approx(acceleration, rel=0.02)


# Theory -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sentence", "name", "value"),
    [
        ("Pairs are rotated until |a_p·a_q| ≤ 3·10⁻¹⁵ ‖a_p‖ ‖a_q‖", "law.svd.ORTHOGONAL", 3e-15),
        ("orthonormalizes the basis every 64 ticks", "law.law.REFRESH", 64),
        ("g_i = 0 where σ_i ≤ 10⁻¹⁴ σ_1", "law.svd.RANK_FLOOR", 1e-14),
        ("where σ > 10⁻⁶ ‖A_2‖ (Frobenius), else 0", "law.priority.TOLERANCE", 1e-6),
        ("the largest s ≤ 8 with |a_j + s b_j| ≤ 0.95 q̇_max,j", "law.policies.FASTEST", 8.0),
        ("the largest s ≤ 8 with |a_j + s b_j| ≤ 0.95 q̇_max,j", "law.policies.USABLE", 0.95),
        ("or A_F has lost rank (σ_k ≤ 10⁻⁶ σ_1(A))", "law.redistribution.LOST", 1e-6),
        ("`SINGULAR` | 32 | σ_k ≤ σ_1 / 100", "law.law.SINGULAR_BELOW", 0.01),
        ("is not finite, or beyond 10¹⁰, ends its world as diverged", "plants.lockstep.LARGEST", 1e10),
        ("J_a is refused there (|s_β| ≤ 10⁻¹²", "textbook.euler.SINGULAR", 1e-12),
        ("a direction with σ_i ≤ 10⁻⁹ σ_1 is lost", "law.task.RANK_TOLERANCE", 1e-9),
        ("μ begins with 0.03", "law.descent.FIRST_SHARE", 0.03),
        ("A goal counts as reached if |e| ≤ 10⁻⁹", "analysis.ik.solve.TOLERANCE", 1e-9),
        ("Otherwise the search begins again at up to 200", "analysis.ik.solve.RESTARTS", 200),
        ("for 64 configurations side by side", "law.svd.LANES", 64),
        ("ends where it began (to 1 mm and 1 mrad)", "results.scorecard.CLOSED", 1e-3),
        ("acceleration stay within 1.01 times their limits", "tuning.trials.TOLERANCE", 0.01),
    ],
)
def test_numbers_of_the_theory_are_those_of_the_code(sentence, name, value):
    assert says(PAGES["Theory"], sentence) or says(PAGES["Statuses"], sentence)
    module, _, constant = name.rpartition(".")
    assert getattr(importlib.import_module(f"rmrc.{module}"), constant) == value


def sweeps(matrix, basis):
    """Count the sweeps of one-sided Jacobi rotations (7), pair by pair; the rows of a basis are turned in place."""
    rows, count, largest = basis @ matrix, 0, 1.0
    while largest > 3e-7:  # the next sweep would be left with its square
        count, largest = count + 1, 0.0
        for p, q in itertools.combinations(range(len(rows)), 2):
            product, norms = rows[p] @ rows[q], np.sum(rows[[p, q]] ** 2, axis=1)
            if abs(product) > 3e-15 * np.sqrt(norms.prod()):
                zeta = (norms[1] - norms[0]) / (2.0 * product)
                t = np.copysign(1.0, zeta) / (abs(zeta) + np.hypot(1.0, zeta))
                turn = np.array([[1.0, -t], [t, 1.0]]) / np.hypot(1.0, t)
                rows[[p, q]], basis[[p, q]] = turn @ rows[[p, q]], turn @ basis[[p, q]]
                largest = max(largest, abs(t))
    return count


def test_neighboring_ticks_need_two_sweeps_rarely_one_or_three():
    assert_says("docs/theory.md", "At a period of 1 ms it needs two sweeps, rarely one or three")
    prepared, run, _ = ran("stanford_wrist")
    basis, counts = np.eye(6), []
    near = np.argmin(run["sigma"][:, -1])  # where the hand passes its singularity
    for t in range(near - 200, near + 200):
        jacobian = prepared.arm.jacobian(run["q"][t])
        counts.append(sweeps(prepared.task.matrix(jacobian), basis))
    assert set(counts[1:]) <= {1, 2, 3} and np.mean(np.array(counts[1:]) == 2) > 0.6


# Scaling ----------------------------------------------------------------------------------------


def test_what_is_read_from_the_model_of_large_sweeps_follows_from_its_table():
    text = (ROOT / "docs/scaling.md").read_text("utf-8")
    table = {
        name: [float(one) for one in values.split()]
        for name, values in re.findall(r"^(\S.*?)  +([-+.e\d ]+)$", text, re.MULTILINE)
    }
    (one_run,), (million,) = (
        table["run [s a run]"],
        {one[1] for name, one in table.items() if name == "hours, runs:"},
    )
    assert million == 1e6
    seconds = {name: 3600.0 * of[1] for name, of in table.items() if len(of) == 3}  # of a million runs
    hours = {name: of[2] for name, of in table.items() if len(of) == 3}  # of a billion
    runs, checks = "runs, on the workers", "checks, on the workers"
    pieces, one_file = "pieces, in scheduler and client", "one file, in the client"
    cores = 3200 * (seconds[runs] + seconds[checks])
    batch = one_run * hours["runs in a batch"]
    for sentence, value, said in (
        ("3,200 cores would be done in 8 s", seconds[runs], 8),
        ("the scheduler and the client, 41 s", seconds[pieces], 41),
        ("after them the one file, 105 s", seconds[one_file], 105),
        ("600 cores are as fast", 3200 * seconds[runs] / 600, seconds[pieces]),
        ("one machine of 16 cores takes 27 minutes", cores / 16 / 60, 27),
        ("which the client makes alone: 29 h, and 758 GB", hours[one_file], 29),
        ("which the client makes alone: 29 h, and 758 GB", hours["file [GB]"], 758),
        ("2.0 ms a piece", 1000 * table["empty piece [s]"][0], 2.0),
        ("a batch of 161 runs takes 4.1 s", batch, 4.1),
        ("about 1,900 cores are all that it keeps busy", 3200 * hours[runs] / hours[pieces], 1900),
        ("3.6 h for all pieces", hours[pieces], 3.6),
        ("2.5 h of rows", hours["rows, to the client's network"], 2.5),
        ("2.2 h, which are 7,000 core hours", hours[runs], 2.2),
        ("2.2 h, which are 7,000 core hours", 3200 * hours[runs], 7000),
        ("a sweep of 10⁶ runs has half of these 40,000", 2 * table["pieces, checks and batches"][1], 40000),
    ):
        assert_says("docs/scaling.md", sentence)
        assert value == pytest.approx(said, rel=0.045), sentence
    busy = re.search(r"(\d) to (\d) % is Python.*?(\d+) to (\d+) threads", text, re.DOTALL)
    few, many, least, most = map(float, busy.groups())
    assert (100 / many // 1, 100 / few) == (least, most)
