import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from oracles import error_parts
from project import ROOT
from rmrc.results.columns import COLUMNS
from rmrc.results.expectations import blank, check, refused
from rmrc.results.run import Run
from rmrc.results.scorecard import Figure, Scorecard, scorecard
from rmrc.scenario import Check, load
from rmrc.scenario.choices import IN_RUNS, Status
from rmrc.scenario.profile import Profile
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError
from wording import says

PLANE = ("x", "y")
SPACE = ("x", "y", "z", "rx", "ry", "rz")


def make_run(ticks, joints=("shoulder", "elbow"), axes=PLANE, period=0.001, **given):
    """Return a run that stands still, but for the columns and fields that are given."""
    n = len(joints)
    width = {"n": n, "k": min(n, len(axes)), "nq": n, "6": 6, "7": 7}
    columns = {
        name: np.zeros((ticks, width[column.width]) if column.width else ticks)
        for name, column in COLUMNS.items()
    }
    columns["time"] = columns["path_time"] = np.arange(ticks) * period
    columns["status"] = np.zeros(ticks, np.int64)
    columns |= {name: np.asarray(values) for name, values in given.items() if name in COLUMNS}
    fields = {"is_slide": (False,) * n, "length": 1.0, "planned": ticks, "wall_time": 0.5}
    fields |= {name: value for name, value in given.items() if name not in COLUMNS}
    return Run("case", tuple(joints), axes=axes, period=period, columns=columns, **fields)


def values(run):
    return {name: figure.value for name, figure in scorecard(run).items()}


# Figures by hand --------------------------------------------------------------------------------


def test_rates_of_four_ticks_are_those_computed_by_hand():
    # shoulder: rms = sqrt((9 + 16) / 4); elbow: rms = sqrt((1 + 1 + 1 + 1) / 4)
    rates = [[0, 1], [3, -1], [-4, 1], [0, -1]]
    got = values(make_run(4, period=0.5, qdot=rates, qdot_cmd=2.0 * np.array(rates)))
    for group, factor in (("joint_rate", 1.0), ("joint_rate_cmd", 2.0)):
        assert got[f"{group}.peak"] == 4.0 * factor
        assert got[f"{group}.peak_time"] == 1.0
        assert got[f"{group}.peak_joint"] == "shoulder"
        assert got[f"{group}.rms"] == 2.5 * factor
        assert got[f"{group}.shoulder.peak"] == 4.0 * factor
        assert got[f"{group}.shoulder.peak_time"] == 1.0
        assert got[f"{group}.shoulder.rms"] == 2.5 * factor
        assert got[f"{group}.elbow.peak"] == 1.0 * factor
        assert got[f"{group}.elbow.peak_time"] == 0.0  # the first of equals
        assert got[f"{group}.elbow.rms"] == 1.0 * factor


def test_rms_of_all_joints_is_that_of_the_joint_with_the_largest_not_of_the_one_with_the_peak():
    got = values(make_run(4, qdot=[[5, 3], [0, 3], [0, 3], [0, 3]]))
    assert got["joint_rate.peak_joint"] == "shoulder"
    assert got["joint_rate.shoulder.rms"] == 2.5
    assert got["joint_rate.rms"] == got["joint_rate.elbow.rms"] == 3.0


def test_acceleration_is_the_difference_over_the_period_at_the_later_tick():
    got = values(make_run(3, period=0.5, qdot=[[0, 0], [1, -1], [1, 2]]))
    assert got["joint_acceleration.peak"] == 6.0
    assert got["joint_acceleration.peak_time"] == 1.0
    assert got["joint_acceleration.peak_joint"] == "elbow"
    assert got["joint_acceleration.shoulder.peak"] == 2.0
    assert got["joint_acceleration.elbow.peak"] == 6.0


def test_torque_peaks_are_magnitudes():
    got = values(make_run(2, tau=[[1, -9], [-2, 3]]))
    assert got["tau.peak"] == 9.0
    assert got["tau.peak_time"] == 0.0
    assert got["tau.peak_joint"] == "elbow"
    assert got["tau.shoulder.peak"] == 2.0
    assert got["tau.elbow.peak"] == 9.0


def test_errors_count_the_controlled_rows_only():
    # Rows y, rx, ry are not controlled: their 100 must not show.
    error = [[3, 100, 4, 100, 100, -2], [0, 100, 0, 100, 100, 0]]
    got = values(make_run(2, axes=("x", "z", "rz"), pose_error=error))
    assert got["position_error.max"] == 5.0
    assert got["position_error.max_time"] == 0.0
    assert got["position_error.rms"] == pytest.approx(5.0 / math.sqrt(2.0), rel=1e-15)
    assert got["position_error.end"] == 0.0
    assert got["orientation_error.max"] == 2.0
    assert got["orientation_error.rms"] == pytest.approx(math.sqrt(2.0), rel=1e-15)


@pytest.mark.parametrize(
    ("axes", "absent"),
    [(("x", "y"), "orientation_error"), (("rx", "rz"), "position_error"), (("x", "rz"), None)],
)
def test_an_error_is_absent_when_no_such_axis_is_controlled(axes, absent):
    groups = {name.partition(".")[0] for name in blank(("a", "b"), axes)}
    assert {"position_error", "orientation_error"} - groups == ({absent} if absent else set())


SPLIT = (
    "position_error_along",
    "position_error_across",
    "orientation_error_along",
    "orientation_error_across",
)


def test_error_along_and_across_split_by_the_direction_of_each_tick():
    # Tick 0 loses rz, tick 1 loses x: each direction is a row, and no length mixes them.
    got = values(
        make_run(
            2,
            axes=("x", "rz"),
            length=2.0,
            pose_error=[[4, 0, 0, 0, 0, 1.5], [4, 0, 0, 0, 0, 1.5]],
            u_min=[[0, 0, 0, 0, 0, 1], [1, 0, 0, 0, 0, 0]],
        )
    )
    assert [got[f"{name}.end"] for name in SPLIT] == [4.0, 0.0, 0.0, 1.5]
    assert [got[f"{name}.max"] for name in SPLIT] == [4.0, 4.0, 1.5, 1.5]
    assert [got[f"{name}.max_time"] for name in SPLIT] == [0.001, 0.0, 0.0, 0.001]
    assert got["position_error_along.rms"] == math.sqrt(4.0**2 / 2.0)
    assert got["orientation_error_along.rms"] == math.sqrt(1.5**2 / 2.0)


def test_error_along_a_slanted_direction_is_that_along_its_part_of_the_same_unit():
    slanted = {
        "axes": ("x", "z", "rz"),
        "length": 2.0,
        "pose_error": [[4, 0, 3, 0, 0, 1.5]],
        "u_min": [[0.36, 0, 0.48, 0, 0, 0.8]],
    }
    # The linear part is (0.6, 0.8): 0.6 * 4 + 0.8 * 3 = 4.8, of a distance of 5; the only rotation is along.
    got = values(make_run(1, **slanted))
    # A few roundings of numbers below 10.
    assert [got[f"{name}.end"] for name in SPLIT] == pytest.approx([4.8, 1.4, 1.5, 0.0], rel=1e-14)
    # A weight of 16/9 on x: what costs the least torque is (4/3 * 0.36, 0.48), which is (1, 1) in meters.
    got = values(make_run(1, **slanted, weights=(16 / 9, 1.0, 1.0)))
    wanted = [7 / math.sqrt(2), 1 / math.sqrt(2), 1.5, 0.0]
    assert [got[f"{name}.end"] for name in SPLIT] == pytest.approx(wanted, rel=1e-14)


@pytest.mark.parametrize("noise", [0.0, 1e-17])
def test_of_a_direction_without_linear_part_all_of_the_position_error_is_across(noise):
    error, lost = [[4, 3, 0, 0, 0, 1.5]], [[noise, -noise, 0, 0, 0, 1]]
    got = values(make_run(1, axes=("x", "y", "rz"), pose_error=error, u_min=lost))
    assert [got[f"{name}.end"] for name in SPLIT] == [0.0, 5.0, 1.5, 0.0]


def unit_vectors(size):
    parts = arrays(float, size, elements=st.floats(-1.0, 1.0))
    return parts.filter(lambda v: np.linalg.norm(v) > 0.1).map(lambda v: v / np.linalg.norm(v))


@given(
    arrays(float, 6, elements=st.floats(-10.0, 10.0)),
    st.data(),
    st.sets(st.sampled_from(range(6)), min_size=1),
    st.floats(0.01, 10.0),
)
def test_parts_are_the_sides_of_a_right_triangle_over_the_error(error, data, rows, length):
    rows = sorted(rows)
    u = np.zeros(6)
    u[rows] = data.draw(unit_vectors(len(rows)))
    axes = tuple(SPACE[row] for row in rows)
    got = values(make_run(1, axes=axes, length=length, pose_error=[error], u_min=[u]))
    for kind, some in (
        ("position", [row for row in rows if row < 3]),
        ("orientation", [row for row in rows if row >= 3]),
    ):
        assert (f"{kind}_error_along.end" in got) == bool(some)
        if not some:
            continue
        size, along, across = (got[f"{kind}_error{part}.end"] for part in ("", "_along", "_across"))
        assert along <= size and across <= size
        # Squares of up to 3 products, each rounded a few times: some 20 roundings of 1e-16.
        assert along**2 + across**2 == pytest.approx(
            sum(error[row] ** 2 for row in some), rel=1e-14, abs=1e-26
        )
        if np.linalg.norm(u[some]) > 1e-6:
            wanted = abs(u[some] @ error[some]) / np.linalg.norm(u[some])
            assert along == pytest.approx(wanted, rel=1e-9, abs=1e-14)


@pytest.mark.parametrize(
    "task",
    [
        "task.length=0.3",
        "task={axes: [x, y, z, rx, ry, rz], length: 0.25, weights: [1, 2, 0.5, 0.1, 3, 0.7]}",
        "task={axes: [x, y, z, rx, rz], length: 4.0, weights: [0.2, 1, 5, 2, 0.1]}",  # more joints than rows
    ],
)
def test_error_parts_of_a_run_past_a_wrist_singularity_are_those_that_numpy_finds(task):
    scenario = load(
        ROOT / "scenarios/stanford_wrist.yaml",
        [task, "target.path=[{turn: {axis: z, angle: 45 deg}}]", "control.period=0.004"],
    )
    prepared = prepare(scenario)
    (run,) = Simulation([prepared]).run()
    arm, rows = prepared.arm, [SPACE.index(axis) for axis in scenario.task.axes]
    weights = scenario.task.weights or (1.0,) * len(rows)
    parts = [
        error_parts(
            e,
            arm.jacobian(q),
            rows,
            weights,
            scenario.task.length,
            np.where(arm.is_slide, scenario.task.length, 1.0),
        )
        for e, q in zip(run["pose_error"], run["q"], strict=True)
    ]
    along, across = np.array(parts).transpose(1, 0, 2)
    got = scorecard(run)
    for name, part in zip(SPLIT, (along[:, :3], across[:, :3], along[:, 3:], across[:, 3:]), strict=True):
        size = np.linalg.norm(part, axis=1)
        # u_min is known to rounding over the gap of sigma, 1e-16 / 0.01, of errors up to 0.1.
        assert got[f"{name}.max"].value == pytest.approx(size.max(), rel=1e-9), name
        assert got[f"{name}.rms"].value == pytest.approx(math.sqrt(np.mean(size**2)), rel=1e-9), name
        assert got[f"{name}.end"].value == pytest.approx(size[-1], rel=1e-9, abs=1e-13), name
        assert got[f"{name}.max"].unit == ("m" if name.startswith("position") else "rad")
        assert size.max() > 1e-6, "a part of nothing but rounding would show no slip"
    for kind in ("position", "orientation"):
        whole = got[f"{kind}_error.max"].value
        assert max(got[f"{kind}_error_{part}.max"].value for part in ("along", "across")) <= whole


def test_the_share_of_a_torque_is_the_largest_of_the_joints_that_have_a_limit():
    tau = [[1, -9, 3], [-2, 3, -40]]
    joints = ("a", "b", "c")
    got = values(make_run(2, joints, tau=tau, torque_limit=(4.0, 10.0, math.inf)))
    assert got["tau.share_of_limit"] == 0.9
    got = values(make_run(2, joints, tau=tau, torque_limit=(2.0, 10.0, 100.0)))
    assert got["tau.share_of_limit"] == 1.0
    for none in ((), (math.inf,) * 3):
        assert math.isnan(values(make_run(2, joints, tau=tau, torque_limit=none))["tau.share_of_limit"])


def test_the_peak_of_plain_rates_is_the_largest_of_all_joints_and_ticks():
    got = values(make_run(3, qdot=np.ones((3, 2)), qdot_plain=[[1, -2], [-8, 3], [8, 7]]))
    assert [got[f"joint_rate_plain.peak{one}"] for one in ("", "_joint", "_time")] == [8.0, "shoulder", 0.001]


def test_the_total_of_a_torque_has_what_compensates_gravity_and_its_share_may_exceed_the_limit():
    tau, gravity = [[1, -4], [-2, 3]], [[2, -7], [-5, -3]]
    got = values(make_run(2, tau=tau, tau_gravity=gravity, torque_limit=(5.0, 10.0)))
    assert (got["tau_total.peak"], got["tau_total.peak_joint"], got["tau_total.peak_time"]) == (
        11.0,
        "elbow",
        0.0,
    )
    assert (got["tau.share_of_limit"], got["tau_total.share_of_limit"]) == (0.4, 7 / 5)


def test_contact_and_torque_limits_have_their_time_their_first_time_and_who_it_was():
    status = [
        0,
        Status.CONTACT,
        Status.TORQUE_LIMITED,
        Status.TORQUE_LIMITED | Status.CONTACT,
        Status.CONTACT,
    ]
    tau = [[0, 0], [9.9, 0], [9, -5], [10, 4], [0, 0]]  # the elbow is first, though the shoulder is later
    run = make_run(
        5, period=0.5, status=status, tau=tau, torque_limit=(10.0, 5.0), touching=("link", "floor")
    )
    got = values(run)
    assert (got["contact.time"], got["contact.first_time"]) == (1.5, 0.5)
    assert got["contact.first_bodies"] == "link – floor"
    assert (got["torque_limited.time"], got["torque_limited.first_time"]) == (1.0, 1.0)
    assert got["torque_limited.first_joint"] == "elbow"


@pytest.mark.parametrize(("plant", "share"), [("servo", 1.0), ("ideal", math.nan)])
def test_the_share_of_a_run_that_asks_for_too_much_is_all_and_an_ideal_arm_has_no_torque(plant, share):
    # blow_up drives the servos against their limits; MuJoCo clamps the force at the limit itself.
    scenario = load(ROOT / "scenarios/blow_up.yaml", [f"plant.kind={plant}"])
    (run,) = Simulation([prepare(scenario)]).run()
    assert scorecard(run)["tau.share_of_limit"].value == pytest.approx(share, abs=0.0, nan_ok=True)


def test_singularity_figures_are_the_extremes_of_their_columns():
    got = values(
        make_run(
            3,
            sigma=[[2, 0.5], [2, 0.1], [2, 0.2]],
            condition=[4, math.inf, 10],
            manipulability=[1.0, 0.2, 0.4],
            damping=[0.0, 0.03, 0.01],
        )
    )
    assert (got["sigma.min"], got["sigma.min_time"]) == (0.1, 0.001)
    second = values(
        make_run(3, path_rate=[1, 0.2, 0.5], secondary_sigma=[0.5, 0.3, 0.4], secondary_error=[3, 0, 4])
    )
    assert (second["path_rate.min"], second["secondary_sigma.min"]) == (0.2, 0.3)
    assert (second["secondary_error.max"], second["secondary_error.end"]) == (4.0, 4.0)
    none = values(make_run(3, secondary_sigma=[math.nan] * 3, secondary_error=[math.nan] * 3))
    assert math.isnan(none["secondary_sigma.min"])
    assert math.isnan(none["secondary_error.rms"])
    assert got["condition.max"] == math.inf
    assert got["manipulability.min"] == 0.2
    assert got["damping.max"] == 0.03


def test_each_status_counts_for_itself_when_several_hold_at_once():
    both = Status.DAMPED | Status.STOPPED
    got = values(make_run(4, period=0.25, status=[0, Status.DAMPED, both, Status.SINGULAR]))
    times = {name: time for name, time in got.items() if name.startswith("status_time.")}
    nonzero = {"OK": 0.25, "DAMPED": 0.5, "STOPPED": 0.25, "SINGULAR": 0.25}
    assert times == {
        f"status_time.{name}": nonzero.get(name, 0.0) for name in ("OK", *(one.name for one in IN_RUNS))
    }


def test_the_longest_time_stuck_is_one_stretch_and_the_first_of_equals():
    there = Status.STUCK | Status.DAMPED
    got = values(make_run(10, period=0.5, status=[there, 0, there, there, 1, there, there, 0, 0, there]))
    assert (got["stuck.longest"], got["stuck.longest_time"]) == (1.0, 1.0)
    assert (got["stuck.share"], got["status_time.STUCK"]) == (0.6, 3.0)
    never = values(make_run(2))
    assert (never["stuck.longest"], never["stuck.share"]) == (0.0, 0.0)
    assert math.isnan(never["stuck.longest_time"])


def test_effort_of_a_run_that_was_cut_short():
    got = values(make_run(3, period=0.5, planned=4, wall_time=0.25))
    assert got["duration"] == 1.5
    assert got["ticks"] == 3
    assert got["completed"] == 0.75
    assert got["wall_time"] == 0.25
    assert got["speed"] == 6.0


HOME = (1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0)


def returning(start, end, **given):
    """Return the figures of three ticks from one position of the joints to another, the target back at its start."""
    away = (*np.add(HOME[:3], 0.5), 0.0, 1.0, 0.0, 0.0)
    poses = given.pop("pose_ref", [HOME, away, HOME])
    return values(make_run(3, q=[start, np.full(len(start), 99.0), end], pose_ref=poses, **given))


def test_the_return_is_the_largest_change_of_a_joint_and_a_full_turn_is_none():
    got = returning([0.1, 0.2], [0.4, -0.3])
    assert (got["return.joint_change"], got["return.change_joint"]) == (
        pytest.approx(0.5, rel=1e-12),
        "elbow",
    )
    got = returning([3.0, 0.2], [-3.0, 0.0])  # 6 rad one way, 2π − 6 the other
    assert got["return.joint_change"] == pytest.approx(2.0 * math.pi - 6.0, rel=1e-12)
    assert got["return.change_joint"] == "shoulder"
    got = returning([0.0, 0.0], [4.0 * math.pi, 0.25])
    assert (got["return.joint_change"], got["return.change_joint"]) == (0.25, "elbow")
    got = returning([0.0, 0.0], [0.0, 4.0 * math.pi], is_slide=(False, True))  # a slide has no turns
    assert (got["return.joint_change"], got["return.change_joint"]) == (4.0 * math.pi, "elbow")


def test_a_return_is_undefined_unless_the_path_was_gone_to_its_end_and_leads_back():
    beside, turned = np.array(HOME), np.array(HOME)
    beside[0] += 2e-3
    turned[3:] = math.cos(1e-3), 0.0, 0.0, math.sin(1e-3)  # 2e-3 rad about z
    undefined = (
        {"planned": 4},
        {"pose_ref": [HOME, HOME, beside]},
        {"pose_ref": [HOME, HOME, turned], "axes": ("x", "rz")},
    )
    for case in undefined:
        got = returning([0.0, 0.0], [1.0, 1.0], **case)
        assert math.isnan(got["return.joint_change"]), case
        assert got["return.change_joint"] == ""
    defined = (
        {"pose_ref": [HOME, HOME, turned]},  # turns do not count in the plane
        {"pose_ref": [HOME, HOME, beside], "axes": ("y", "rz")},
        {"pose_ref": [HOME, HOME, np.add(HOME, 5e-4)]},
        {"pose_ref": [HOME, HOME, (*HOME[:3], -1.0, 0.0, 0.0, 0.0)], "axes": SPACE},  # the same rotation
    )
    for case in defined:
        assert returning([0.0, 0.0], [1.0, 0.5], **case)["return.joint_change"] == 1.0, case


# Closed forms -----------------------------------------------------------------------------------


def test_a_sine_has_peak_A_rms_A_over_root_two_and_peak_acceleration_A_omega():
    amplitude, periods, ticks = 1.7, 3, 3000
    omega = 2.0 * math.pi * periods / (ticks * 0.001)
    rate = amplitude * np.sin(omega * np.arange(ticks) * 0.001)
    got = values(make_run(ticks, qdot=np.column_stack([rate, 0.5 * rate])))
    # 1000 ticks a period: the crest is a tick (phase π/2 = 250 ticks), so only sin() rounds.
    assert got["joint_rate.peak"] == pytest.approx(amplitude, rel=1e-12)
    assert got["joint_rate.peak_time"] == pytest.approx(0.25 * 2.0 * math.pi / omega, abs=1e-12)
    # Over whole periods the mean of sin² of equally spaced samples is exactly 1/2.
    assert got["joint_rate.rms"] == pytest.approx(amplitude / math.sqrt(2.0), rel=1e-12)
    # The steepest difference is across a zero at a tick: A sin(ωh)/h = Aω (1 − (ωh)²/6 + …).
    h = omega * 0.001
    slope = amplitude * omega
    assert got["joint_acceleration.peak"] == pytest.approx(slope * (1.0 - h**2 / 6.0), rel=h**4)
    assert got["joint_acceleration.elbow.peak"] == pytest.approx(slope / 2.0, rel=h**2)


# Names ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ticks", [0, 1, 2, 5])
@pytest.mark.parametrize("axes", [PLANE, SPACE, ("rz",)])
def test_the_names_depend_on_joints_and_axes_alone(ticks, axes):
    joints = ("a", "b", "c")
    assert list(scorecard(make_run(ticks, joints, axes))) == list(blank(joints, axes))


def test_figures_of_a_planar_arm_are_these():
    joint = [f"{g}.{{}}.{s}" for g in ("joint_rate", "joint_rate_cmd") for s in ("peak_time", "rms")]
    groups = ("joint_rate", "joint_rate_cmd", "joint_acceleration", "tau")
    joint += [f"{g}.{{}}.peak" for g in groups]
    expected = {name.format(j) for name in joint for j in ("shoulder", "elbow")}
    expected |= {f"{g}.{s}" for g in groups for s in ("peak", "peak_time", "peak_joint")}
    expected |= {"joint_rate.rms", "joint_rate_cmd.rms"}
    expected |= {"tau.share_of_limit", "tau_total.share_of_limit"}
    for group in ("tau_total", "joint_rate_plain", "joint_acceleration_cmd", "joint_jerk_cmd"):
        expected |= {f"{group}.{s}" for s in ("peak", "peak_time", "peak_joint")}
    expected |= {"joint_acceleration_cmd.rms", "chatter", "chatter_joint"}
    first = ("time", "joint", "condition", "value", "bound")
    expected |= {"profile.refused", *(f"profile.first_{s}" for s in first)}
    expected |= {f"contact.{s}" for s in ("time", "first_time", "first_bodies")}
    expected |= {f"torque_limited.{s}" for s in ("time", "first_time", "first_joint")}
    expected |= {"slip.max", "slip.max_time"}
    errors = ("position_error", "position_error_along", "position_error_across", "secondary_error")
    expected |= {f"{g}.{s}" for g in errors for s in ("rms", "max", "max_time", "end")}
    expected |= {"return.joint_change", "return.change_joint"}
    expected |= {"sigma.min", "sigma.min_time", "condition.max", "manipulability.min"}
    expected |= {
        "damping.max",
        "path_rate.min",
        "secondary_sigma.min",
        "duration",
        "ticks",
        "completed",
        "wall_time",
        "speed",
    }
    expected |= {f"status_time.{name}" for name in ("OK", *(one.name for one in IN_RUNS))}
    expected |= {"stuck.longest", "stuck.longest_time", "stuck.share"}
    names = list(blank(("shoulder", "elbow"), PLANE))
    assert set(names) == expected
    assert len(names) == len(expected)


def test_every_figure_has_a_unit_and_a_meaning_unless_it_is_a_name():
    card = scorecard(make_run(2, axes=SPACE))
    for name, figure in card.items():
        assert figure.meaning
        assert bool(figure.unit) != isinstance(figure.value, str), name


def test_units_follow_the_kind_of_the_joint():
    card = scorecard(make_run(2, joints=("turn", "slide"), is_slide=(False, True)))
    units = {name: card[name].unit for name in card}
    assert (units["joint_rate.turn.peak"], units["joint_rate.slide.rms"]) == ("rad/s", "m/s")
    assert units["joint_acceleration.slide.peak"] == "m/s²"
    assert (units["tau.turn.peak"], units["tau.slide.peak"]) == ("N·m", "N")
    assert (units["joint_rate.peak"], units["tau.peak"]) == ("rad/s or m/s", "N·m or N")
    card = scorecard(make_run(2))
    assert (card["joint_rate.peak"].unit, card["tau.peak"].unit) == ("rad/s", "N·m")


# Degenerate runs --------------------------------------------------------------------------------


def test_a_run_without_ticks_has_undefined_figures_and_zero_durations():
    got = values(make_run(0, axes=SPACE, planned=100))
    zero = {name for name in got if name.startswith("status_time.")}
    zero |= {
        "contact.time",
        "torque_limited.time",
        "stuck.longest",
        "duration",
        "ticks",
        "completed",
        "speed",
    }
    for name, value in got.items():
        if name in zero:
            assert value == 0.0, name
        elif name.endswith(("_joint", "_bodies", "_condition")):
            assert value == "", name
        else:
            assert name == "wall_time" or math.isnan(value), name


def test_a_run_of_one_tick_lacks_only_its_acceleration_and_what_did_not_happen():
    got = values(make_run(1, axes=SPACE, qdot=[[1.0, -2.0]]))
    undefined = {name for name, value in got.items() if value == "" or value != value}
    # a run that knows no torque limits has no share of them, and what never was has no time when that began
    never = {"tau.share_of_limit", "tau_total.share_of_limit", "stuck.longest_time"}
    never |= {"contact.first_time", "contact.first_bodies"}
    never |= {"torque_limited.first_time", "torque_limited.first_joint", "chatter_joint"}
    never |= {name for name in got if name.startswith("profile.")}
    assert undefined == never | {name for name in got if name.startswith("joint_acceleration.")}
    assert (got["joint_rate.peak"], got["joint_rate.peak_joint"]) == (2.0, "elbow")


def test_a_run_of_no_wall_time_and_no_plan_has_no_speed_and_no_share():
    got = values(make_run(0, wall_time=0.0, planned=0))
    assert math.isnan(got["speed"])
    assert math.isnan(got["completed"])


# Nested -----------------------------------------------------------------------------------------


def test_nested_is_strict_json_and_follows_the_dots():
    card = scorecard(make_run(1, qdot=[[1.0, -2.0]], condition=[math.inf], wall_time=0.0))
    nested = json.loads(json.dumps(card.nested(), allow_nan=False))
    assert nested["joint_rate"]["peak"] == 2.0
    assert nested["joint_rate"]["peak_joint"] == "elbow"
    assert nested["joint_rate"]["shoulder"] == {"peak": 1.0, "peak_time": 0.0, "rms": 1.0}
    assert nested["joint_acceleration"]["peak"] is None
    assert nested["joint_acceleration"]["peak_joint"] is None
    assert nested["condition"]["max"] == "inf"
    assert nested["ticks"] == 1


@given(
    st.lists(
        st.sampled_from(["peak", "rms", "a", "a.peak", "a.peak.rms", "peak.peak", ".", "b c"]),
        min_size=1,
        unique=True,
    )
)
def test_nested_keeps_every_figure_whatever_the_joints_are_called(joints):
    # all its figures are defined: commands that shake, of a robot that may not
    ones = (1.0,) * len(joints)
    profile = Profile(robot="any", joints=len(joints), rate={"value": ones, "source": "here"})
    status, ones = [Status.STUCK | Status.CONTACT | Status.TORQUE_LIMITED] * 3, (1.0,) * len(joints)
    commands = np.outer([1.0, -1.0, 1.0], ones)
    given = {"torque_limit": ones, "touching": ("a", "b"), "profile": profile, "qdot_cmd": commands}
    run = make_run(3, joints, status=status, tau=[ones] * 3, **given)
    card = scorecard(run)

    def flat(tree, prefix=""):
        for key, value in tree.items():
            if isinstance(value, dict):
                yield from flat(value, f"{prefix}{key}.")
            else:
                yield f"{prefix}{key}", value

    pairs = list(flat(card.nested()))
    assert len(pairs) == len(card)
    assert dict(pairs) == {name: figure.value for name, figure in card.items()}


def test_a_scorecard_is_a_frozen_mapping_in_order():
    card = scorecard(make_run(1))
    assert card["ticks"] == Figure(1, "1", "control ticks recorded")
    assert (card.name, card.joints) == ("case", ("shoulder", "elbow"))
    assert len(card) == len(list(card)) == len(card.figures)
    with pytest.raises(KeyError):
        card["tick"]
    with pytest.raises(dataclasses.FrozenInstanceError):
        card.name = "other"


# Expectations -----------------------------------------------------------------------------------


def card_of(value, unit="rad/s"):
    return Scorecard("case", (), {"joint_rate.peak": Figure(value, unit, "")})


@pytest.mark.parametrize(
    ("value", "wanted", "missed_by", "message"),
    [
        (2.5, Check(below=3), 0.0, "expected below 3 rad/s, got 2.5"),
        (3.21, Check(below=3), 0.21, "expected below 3 rad/s, got 3.21, 0.21 too high"),
        (3.0, Check(below=3), 0.0, "expected below 3 rad/s, got 3, exactly the bound"),
        (3.5, Check(above=3), 0.0, "expected above 3 rad/s, got 3.5"),
        (2.5, Check(above=3), -0.5, "expected above 3 rad/s, got 2.5, 0.5 too low"),
        (3.0, Check(above=3), 0.0, "expected above 3 rad/s, got 3, exactly the bound"),
        (
            0.5,
            Check(above=1, below=2.25),
            -0.5,
            "expected above 1 and below 2.25 rad/s, got 0.5, 0.5 too low",
        ),
        (1.25, Check(equals=1, within=0.25), 0.0, "expected 1 within 0.25 rad/s, got 1.25"),
        (0.75, Check(equals=1, within=0.25), 0.0, "expected 1 within 0.25 rad/s, got 0.75"),
        (1.5, Check(equals=1, within=0.25), 0.25, "expected 1 within 0.25 rad/s, got 1.5, 0.25 too high"),
        (0.25, Check(equals=1, within=0.25), -0.5, "expected 1 within 0.25 rad/s, got 0.25, 0.5 too low"),
        (1.0, Check(equals=1, within=0), 0.0, "expected 1 within 0 rad/s, got 1"),
        (
            4.0,
            Check(below=3.5, equals=1, within=0.25),
            2.75,
            "expected below 3.5 and 1 within 0.25 rad/s, got 4, 2.75 too high",
        ),
        (math.inf, Check(below=3), math.inf, "expected below 3 rad/s, got inf, inf too high"),
        (math.inf, Check(above=3), 0.0, "expected above 3 rad/s, got inf"),
    ],
)
def test_an_outcome_says_what_was_wanted_and_by_how_much_it_was_missed(value, wanted, missed_by, message):
    (outcome,) = check(card_of(value), {"joint_rate.peak": wanted})
    assert outcome.name == "joint_rate.peak"
    assert outcome.value == value
    assert outcome.ok == (not message.endswith(("high", "low", "bound")))
    assert outcome.missed_by == pytest.approx(missed_by, rel=1e-12)
    assert str(outcome) == f"joint_rate.peak: {message}"


@pytest.mark.parametrize("wanted", [Check(below=3), Check(above=-3), Check(equals=0, within=1e300)], ids=str)
def test_an_undefined_figure_meets_nothing(wanted):
    (outcome,) = check(card_of(math.nan), {"joint_rate.peak": wanted})
    assert not outcome.ok
    assert math.isnan(outcome.missed_by)
    text = f"joint_rate.peak: expected {outcome.wanted}, but it is undefined for this run"
    assert str(outcome) == text


@pytest.mark.parametrize(
    ("value", "shown", "missed_by"),
    [(4.5, 4.5, 1.5), (2.0, 2.0, 0.0), (math.nan, None, None), (math.inf, "inf", "inf")],
)
def test_facts_of_an_outcome_are_strict_json(value, shown, missed_by):
    (outcome,) = check(card_of(value), {"joint_rate.peak": Check(below=3)})
    assert json.loads(json.dumps(outcome.facts(), allow_nan=False)) == {
        "name": "joint_rate.peak",
        "value": shown,
        "wanted": "below 3 rad/s",
        "missed_by": missed_by,
        "ok": value < 3,
        "text": str(outcome),
    }


def test_a_plain_number_has_no_unit_in_its_message():
    (outcome,) = check(card_of(12, "1"), {"joint_rate.peak": Check(below=10)})
    assert str(outcome) == "joint_rate.peak: expected below 10, got 12, 2 too high"


@given(st.floats(allow_nan=False), st.floats(-1e6, 1e6), st.floats(0, 1e6))
def test_ok_is_what_the_comparison_says_and_a_miss_has_its_sign(value, bound, within):
    card = card_of(value)
    for wanted, ok in (
        (Check(below=bound), value < bound),
        (Check(above=bound), value > bound),
        (Check(equals=bound, within=within), abs(value - bound) <= within),
    ):
        (outcome,) = check(card, {"joint_rate.peak": wanted})
        assert outcome.ok == ok
        if not ok and value != bound:
            assert (outcome.missed_by > 0) == (value > bound)


def test_outcomes_come_in_the_order_of_the_expectations():
    card = scorecard(make_run(2))
    names = ["speed", "joint_rate.peak", "joint_rate.elbow.rms"]
    outcomes = check(card, {name: Check(above=-1) for name in names})
    assert [outcome.name for outcome in outcomes] == names
    assert all(outcome.ok for outcome in outcomes)


def test_names_that_cannot_be_expected_are_refused_with_the_way_out():
    names = [
        "joint_rate.peek",
        "joint_rate.peak",
        "joint_rate.sholder.rms",
        "tau.peak_joint",
        "return.change_joint",
        "contact.first_bodies",
        "torque_limited.first_joint",
        "chatter_joint",
        "profile.first_condition",
        "orientation_error.max",
        "orientation_error_across.end",
        "nonsense",
        "",
    ]
    groups = (
        "joint_rate, joint_rate_cmd, joint_rate_plain, joint_acceleration, joint_acceleration_cmd, "
        "joint_jerk_cmd, chatter, chatter_joint, tau, tau_total, position_error, "
        "position_error_along, position_error_across, secondary_error, return, sigma, condition, manipulability, damping, path_rate, "
        "secondary_sigma, status_time, stuck, contact, slip, torque_limited, profile, duration, ticks, completed, wall_time, speed"
    )
    reasons = {
        "joint_rate.peek": '… metric … "joint_rate.peak"…',
        "joint_rate.sholder.rms": '… metric … "joint_rate.shoulder.rms"…',
        "tau.peak_joint": "… joint … number … tau.peak",
        "return.change_joint": "… joint … number … return.joint_change",
        "contact.first_bodies": "… bodies … number … contact.time",
        "torque_limited.first_joint": "… joint … number … torque_limited.time",
        "chatter_joint": "… joint … number … chatter",
        "profile.first_condition": "… condition … number … profile.refused",
        "orientation_error.max": "… rx, ry, rz … task.axes",
        "orientation_error_across.end": "… rx, ry, rz … task.axes",
        "nonsense": f"… metric … {groups}",
        "": f"… metric … {groups}",
    }
    reasons = {name: says(reason) for name, reason in reasons.items()}
    assert refused(names, blank(("shoulder", "elbow"), PLANE)) == reasons
    with pytest.raises(ScenarioError) as raised:
        check(scorecard(make_run(2)), dict.fromkeys(names, Check(below=1)))
    lines = [says(f"expect.{name}: {reason}") for name, reason in reasons.items()]
    assert str(raised.value).splitlines() == lines


def test_a_task_without_positions_refuses_position_errors():
    names = ["position_error.end", "position_error_along.end", "orientation_error.end"]
    reasons = refused(names, blank(("a",), ("rz",)))
    assert reasons == dict.fromkeys(names[:2], says("… x, y, z … task.axes"))


def test_every_number_of_a_scorecard_can_be_expected():
    joints = ("shoulder", "elbow")
    names = list(blank(joints, SPACE))
    texts = {name for name in names if name.endswith(("_joint", "_bodies", "_condition"))}
    assert len(texts) == 14
    assert refused(names, blank(joints, SPACE)).keys() == texts
