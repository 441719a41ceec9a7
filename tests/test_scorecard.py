"""The scorecard of a run against numpy over its columns, by hand, and its expectations."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from rmrc.results.expectations import blank, check, refuse_unknown
from rmrc.results.scorecard import Figure, Scorecard, scorecard
from rmrc.scenario import Check
from rmrc.scenario.choices import IN_RUNS, Status
from rmrc.support.errors import ScenarioError
from standing import make_run, random_columns
from wording import says

PLANE = ("x", "y")
SPACE = ("x", "y", "z", "rx", "ry", "rz")


def random_run(rng, ticks, special):
    """Return a run of random numbers; a share of the entries is NaN, infinite, or equal to others."""
    columns = random_columns(rng, ticks, N, K)
    for numbers in columns.values():
        chosen = rng.random(numbers.shape) < special
        numbers[chosen] = rng.choice([math.nan, math.inf, -math.inf, 3.0, -3.0, 0.0, -0.0], chosen.sum())
    columns["status"] = rng.integers(0, 2 ** len(IN_RUNS), ticks) & rng.integers(0, 2 ** len(IN_RUNS), ticks)
    return make_run(ticks, "abcd", AXES, PERIOD, length=LENGTH, weights=WEIGHTS, **columns)


def values(run):
    return {name: figure.value for name, figure in scorecard(run).items()}


# By numpy ---------------------------------------------------------------------------------------

N, K, LENGTH, PERIOD = 4, 3, 0.7, 0.002
AXES, ROWS, WEIGHTS = ("x", "z", "ry"), [0, 2, 4], (0.3, 2.0, 5.0)
SCALE = np.sqrt(WEIGHTS) / [LENGTH, LENGTH, 1.0]


def from_rest(column):
    """Return the difference quotient of a column before which all was at rest."""
    return np.diff(column, axis=0, prepend=0.0) / PERIOD


def by_numpy(run):
    """Return the magnitudes of joints and of errors by group."""
    e, u = run["pose_error"][:, ROWS], run["u_min"][:, ROWS]
    errors = {"secondary_error": np.abs(run["secondary_error"])}
    for name, rows in (("position", [0, 1]), ("orientation", [2])):
        lost, size = (SCALE * u)[:, rows], np.linalg.norm(e[:, rows], axis=1)
        is_lost = np.linalg.norm(u[:, rows], axis=1, keepdims=True) > 1e-9
        direction = np.where(is_lost, lost / np.linalg.norm(lost, axis=1, keepdims=True), 0.0)
        along = np.sum(direction * e[:, rows], axis=1)
        across = np.linalg.norm(e[:, rows] - direction * along[:, None], axis=1)
        errors[f"{name}_error"] = size
        errors[f"{name}_error_along"] = np.minimum(np.abs(along), size)
        errors[f"{name}_error_across"] = np.minimum(across, size)
    joints = {
        "joint_rate": run["qdot"], "joint_rate_cmd": run["qdot_cmd"], "joint_rate_plain": run["qdot_plain"],
        "joint_acceleration": np.diff(run["qdot"], axis=0) / PERIOD,
        "joint_acceleration_cmd": from_rest(run["qdot_cmd"]),
        "joint_jerk_cmd": from_rest(from_rest(run["qdot_cmd"])),
        "tau": run["tau"], "tau_total": run["tau"] + run["tau_gravity"],
    }  # fmt: skip
    return {name: np.abs(column) for name, column in joints.items()}, errors


@pytest.mark.parametrize(("seed", "special"), [(0, 0.0), (1, 0.02), (2, 0.5)])
def test_peaks_means_extremes_and_times_are_those_of_numpy(seed, special):
    run = random_run(np.random.default_rng(seed), 400, special)
    with np.errstate(invalid="ignore"):
        joints, errors = by_numpy(run)
    got, time = values(run), run["time"]

    def same(name, size, when="peak_time", what="peak"):
        first, times = size.argmax(), time[len(time) - len(size) :]  # of the first NaN, if there is one
        assert_allclose(got[f"{name}.{what}"], size[first], rtol=1e-12)
        wanted = math.nan if math.isnan(size[first]) else times[first]
        assert_array_equal(got.get(f"{name}.{when}", wanted), wanted)

    for name, size in joints.items():
        same(name, size.max(axis=1))
        rms = np.sqrt(np.square(size).mean(axis=0))
        assert_allclose(got.get(f"{name}.rms", rms.max()), rms.max(), rtol=1e-12)
        for j, joint in enumerate("abcd"):
            if f"{name}.{joint}.peak" in got:
                same(f"{name}.{joint}", size[:, j])
                assert_allclose(got.get(f"{name}.{joint}.rms", rms[j]), rms[j], rtol=1e-12)
    for name, size in errors.items():
        same(name, size, "max_time", "max")
        assert_allclose(got[f"{name}.rms"], math.sqrt(np.square(size).mean()), rtol=1e-12)
        assert_allclose(got[f"{name}.end"], size[-1], rtol=1e-12)
    for name in ("condition", "damping", "slip"):
        same(name, run[name], "max_time", "max")
    for name in ("manipulability", "path_rate", "secondary_sigma"):
        assert_array_equal(got[f"{name}.min"], run[name].min())
    assert_array_equal(got["sigma.min"], run["sigma"][:, -1].min())
    for one in IN_RUNS:
        count = np.count_nonzero(run["status"] & one)
        assert got[f"status_time.{one.name}"] == pytest.approx(count * PERIOD, rel=1e-12)
    first = time[(run["status"] & Status.CONTACT > 0).argmax()]
    assert got["contact.first_time"] == first
    stuck = "".join(".#"[bool(status & Status.STUCK)] for status in run["status"])
    longest = max(map(len, stuck.split(".")))
    assert got["stuck.longest"] == pytest.approx(longest * PERIOD)
    assert got["stuck.longest_time"] == time[stuck.index("#" * longest)]


# By hand ----------------------------------------------------------------------------------------


def test_torques_have_shares_of_the_limits_of_the_joints_that_have_one():
    tau, joints = [[1, -9, 3], [-2, 3, -40]], ("a", "b", "c")
    got = values(make_run(2, joints, tau=tau, torque_limit=(4.0, 10.0, math.inf)))
    assert (got["tau.share_of_limit"], got["tau.peak_joint"]) == (0.9, "c")
    gravity = [[2, -7, 0], [-5, -3, 0]]
    got = values(make_run(2, joints, tau=tau, tau_gravity=gravity, torque_limit=(5.0, 10.0, math.inf)))
    assert got["tau_total.share_of_limit"] == 1.6
    for none in ((), (math.inf,) * 3):
        assert math.isnan(values(make_run(2, joints, tau=tau, torque_limit=none))["tau.share_of_limit"])


def test_contact_and_torque_limits_have_their_time_their_first_time_and_who_it_was():
    contact, limited = Status.CONTACT, Status.TORQUE_LIMITED
    tau = [[0, 0], [9.9, 0], [9, -5], [10, 4], [0, 0]]  # the elbow is first, though the shoulder is later
    run = make_run(
        5, period=0.5, status=[0, contact, limited, limited | contact, contact], tau=tau,
        torque_limit=(10.0, 5.0), touching=("link", "floor"),
    )  # fmt: skip
    got = values(run)
    assert (got["contact.time"], got["contact.first_time"]) == (1.5, 0.5)
    assert got["contact.first_bodies"] == "link – floor"
    assert (got["torque_limited.time"], got["torque_limited.first_time"]) == (1.0, 1.0)
    assert (got["torque_limited.first_joint"], got["status_time.OK"]) == ("elbow", 0.5)


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
    beside = (HOME[0] + 2e-3, *HOME[1:])
    turned = np.array([*HOME[:3], math.cos(1e-3), 0, 0, math.sin(1e-3)])  # 2e-3 rad about z
    for pose, axes, is_defined in (
        (beside, PLANE, False), (turned, ("x", "rz"), False), (turned, PLANE, True), (beside, ("y", "rz"), True),
        ((*HOME[:3], -1.0, 0.0, 0.0, 0.0), SPACE, True),  # the same rotation
    ):  # fmt: skip
        got = returning([0.0, 0.0], [1.0, 0.5], pose_ref=[HOME, HOME, pose], axes=axes)
        assert got["return.joint_change"] == 1.0 if is_defined else math.isnan(got["return.joint_change"])
    assert math.isnan(returning([0.0, 0.0], [1.0, 1.0], planned=4)["return.joint_change"])


# Names ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("ticks", "axes"), [(0, PLANE), (1, SPACE), (2, ("rz",))])
def test_the_names_depend_on_joints_and_axes_alone(ticks, axes):
    joints = ("a", "b", "c")
    assert list(scorecard(make_run(ticks, joints, axes))) == list(blank(joints, axes))
    groups = {name.partition(".")[0] for name in blank(joints, axes)}
    assert ("position_error" in groups, "orientation_error" in groups) == (axes != ("rz",), axes != PLANE)


# Expectations -----------------------------------------------------------------------------------


def card_of(value, unit="rad/s"):
    return Scorecard("case", (), {"joint_rate.peak": Figure(value, unit, "")})


def test_an_outcome_says_what_was_wanted_and_by_how_much_it_was_missed():
    (outcome,) = check(card_of(0.25), {"joint_rate.peak": Check(equals=1, within=0.25)})
    assert (outcome.ok, outcome.missed_by) == (False, -0.5)
    assert str(outcome) == "joint_rate.peak: expected 1 within 0.25 rad/s, got 0.25, 0.5 too low"


@given(st.floats(allow_nan=False), st.floats(-1e6, 1e6), st.floats(0, 1e6))
def test_ok_is_what_the_comparison_says_and_a_miss_has_its_sign(value, bound, within):
    (undefined,) = check(card_of(math.nan), {"joint_rate.peak": Check(equals=bound, within=1e300)})
    assert not undefined.ok and math.isnan(undefined.missed_by)
    for wanted, ok in (
        (Check(below=bound), value < bound),
        (Check(above=bound), value > bound),
        (Check(equals=bound, within=within), abs(value - bound) <= within),
    ):
        (outcome,) = check(card_of(value), {"joint_rate.peak": wanted})
        assert outcome.ok == ok
        assert ok or value == bound or (outcome.missed_by > 0) == (value > bound)
        assert json.loads(json.dumps(outcome.facts(), allow_nan=False))["text"] == str(outcome)


def test_names_that_cannot_be_expected_are_refused_with_the_way_out(scenario):
    reasons = {
        "joint_rate.peek": '… metric … "joint_rate.peak"…', "tau.peak_joint": "… number",
        "orientation_error.max": "… task.axes",
    }  # fmt: skip
    known = scenario("expect={ticks: {above: 1}}")
    refuse_unknown(known, ("shoulder", "elbow"))
    wrong = known.model_copy(update={"expect": {**known.expect, **dict.fromkeys(reasons, Check(below=1))}})
    with pytest.raises(ScenarioError) as raised:
        refuse_unknown(wrong, ("shoulder", "elbow"))
    for line, (name, reason) in zip(str(raised.value).splitlines(), reasons.items(), strict=True):
        assert line == says(f"…expect.{name}: {reason}")
