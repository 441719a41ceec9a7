"""What a profile accepts, against the vendor's own document, written once more: plain numpy over whole columns."""

import json
import math
from collections import Counter

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from project import ROOT, mostly_long, told
from rmrc.results.columns import COLUMNS
from rmrc.results.events import CHATTER_FLOOR, CHATTER_TIME, CONDITIONS, chatter, refused
from rmrc.results.expectations import check
from rmrc.results.run import Run
from rmrc.results.scorecard import scorecard
from rmrc.scenario import draft_of, load, loads
from rmrc.scenario.profile import SHIPPED, Profile, load_profile
from rmrc.simulation.prepare import expected_profile, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.parcel import pack
from rmrc.study.picks import Choice
from rmrc.study.sweep import Sweep
from rmrc.support.errors import ScenarioError
from wording import says

# frankarobotics/docs, robot_specifications.rst, "Necessary conditions" and "Position-based velocity limits", with
# control-parameters-joint-fr3.csv of May 2026; and the csv before October 2025 with the functions of libfranka's
# rate_limiting.h, where each line of a joint is max rate, offset, twice the deceleration, and where it ends.
RATES, ACCELERATION, JERK = np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]), 10.0, 5000.0
DOCS = {
    "q_max": [2.9007, 1.8361, 2.9007, -0.1169, 2.8763, 4.6216, 3.0508],
    "q_min": [-2.9007, -1.8361, -2.9007, -3.0770, -2.8763, 0.4398, -3.0508],
    "offset": [0.6599, 0.2517, 0.2000, 0.3533, 0.5757, 0.4878, 0.4628],
    "dec": [6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0],
}
HEADER_UPPER = [
    (0.30, 12.0, 2.75010), (0.20, 5.17, 1.79180), (0.20, 7.00, 2.90650), (0.30, 8.00, -0.1458),
    (0.35, 34.0, 2.81010), (0.35, 11.0, 4.52050), (0.35, 34.0, 3.01960),
]  # fmt: skip
HEADER_LOWER = [2.750100, 1.791800, 2.906500, 3.048100, 2.810100, -0.54092, 3.019600]  # what is added to q
HEADER = {
    "q_max": [2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159],
    "q_min": [-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159],
}


def rate_bounds_of_the_docs(q):
    """Return the lower and upper rate limits at positions, (T, 7) each."""
    q_max, q_min, offset, dec = (np.array(DOCS[name]) for name in ("q_max", "q_min", "offset", "dec"))
    upper = np.minimum(RATES, np.maximum(0.0, -offset + np.sqrt(np.maximum(0.0, 2.0 * dec * (q_max - q)))))
    lower = np.maximum(-RATES, np.minimum(0.0, offset - np.sqrt(np.maximum(0.0, 2.0 * dec * (-q_min + q)))))
    return lower, upper


def rate_bounds_of_the_header(q):
    """The same by computeLowerLimitsJointVelocity and computeUpperLimitsJointVelocity, without their tolerance."""
    columns = []
    for j, (offset, twice, end) in enumerate(HEADER_UPPER):
        most, at = RATES[j], q[:, j]
        upper = np.minimum(most, np.maximum(0.0, -offset + np.sqrt(np.maximum(0.0, twice * (end - at)))))
        lower = np.maximum(
            -most, np.minimum(0.0, offset - np.sqrt(np.maximum(0.0, twice * (HEADER_LOWER[j] + at))))
        )
        columns.append((lower, upper))
    lower, upper = zip(*columns, strict=True)
    return np.array(lower).T, np.array(upper).T


PORTS = {
    "franka_fr3": (DOCS, rate_bounds_of_the_docs),
    "franka_fr3_before_5_9": (HEADER, rate_bounds_of_the_header),
}


def verdict_by_numpy(name, q, commands, period):
    """Return the ticks that break a condition, and of the first: condition, joint, tick, value, bound."""
    document, rate_bounds = PORTS[name]
    last = np.vstack([np.zeros((1, 7)), commands[:-1]])
    acceleration = (commands - last) / period
    jerk = (acceleration - np.vstack([np.zeros((1, 7)), acceleration[:-1]])) / period
    ends = np.broadcast_to(document["q_min"], q.shape), np.broadcast_to(document["q_max"], q.shape)
    conditions = [
        ("position", q, *ends),
        ("rate", commands, *rate_bounds(q)),
        ("acceleration", acceleration, np.full(q.shape, -ACCELERATION), np.full(q.shape, ACCELERATION)),
        ("jerk", jerk, np.full(q.shape, -JERK), np.full(q.shape, JERK)),
    ]
    broken = np.array([~((lower < x) & (x < upper)) for _, x, lower, upper in conditions])
    ticks = np.flatnonzero(broken.any(axis=(0, 2)))
    if not len(ticks):
        return 0, None
    tick = ticks[0]
    which, joint = np.argwhere(broken[:, tick])[0]
    condition, x, lower, upper = conditions[which]
    value = x[tick, joint]
    bound = lower[tick, joint] if value <= lower[tick, joint] else upper[tick, joint]
    return len(ticks), (condition, joint, tick, value, bound)


TICKS, PERIOD = 400, 0.001


def random_streams(rng, count):
    """Return positions and commands, (TICKS, count, 7): of all kinds, so that each condition is the first one broken.

    Each joint comes up to a rate that may be too fast, in 0.4 s, with noise whose jerk is up to a bound about the
    published one. A share of the joints starts near an end of its range, or beyond it.
    """
    low, high = np.array(DOCS["q_min"]), np.array(DOCS["q_max"])
    x = np.arange(1, TICKS + 1)[:, None, None] / TICKS
    cruise = rng.choice([0.0, 0.3, 0.95, 1.3], (1, count, 1), p=[0.3, 0.3, 0.35, 0.05]) * RATES.min()
    rise = cruise * rng.uniform(-1.0, 1.0, (1, count, 7)) * (3.0 * x**2 - 2.0 * x**3)
    jerk = JERK * 10.0 ** rng.uniform(-2.0, 0.05, (1, count, 1))
    noise = 0.5 * jerk * PERIOD * rng.uniform(-1.0, 1.0, (TICKS, count, 7))
    commands = rise + np.cumsum(noise, axis=0) * PERIOD
    places = rng.choice([0.5, 0.03, 0.97, -0.01], (1, count, 7), p=[0.94, 0.029, 0.029, 0.002])
    q = low + (high - low) * places + np.cumsum(commands, axis=0) * PERIOD
    return q, commands


def refused_by_us(profile, q, commands, period=PERIOD):
    """Return how many commands of one run, (T, n), are refused, and the first."""
    acceleration = np.diff(commands, axis=0, prepend=0.0) / period
    jerk = np.diff(acceleration, axis=0, prepend=0.0) / period
    return refused(profile, q.T, commands.T, acceleration.T, jerk.T)


@pytest.mark.parametrize("count", [300, pytest.param(1000, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", mostly_long(PORTS, len(PORTS)))
def test_the_verdict_on_random_runs_is_that_of_the_published_conditions(name, count):
    q, commands = random_streams(np.random.default_rng(5), count)
    met = Counter()
    for w in range(count):
        count_of_ours, got = refused_by_us(load_profile(name), q[:, w], commands[:, w])
        broken, first = verdict_by_numpy(name, q[:, w], commands[:, w], PERIOD)
        assert count_of_ours == broken
        met[first and first[0]] += 1
        if first is None:
            assert (got.condition, got.joint) == ("", -1)
            continue
        condition, joint, tick, value, bound = first
        assert (got.condition, got.joint, got.tick) == (condition, joint, tick)
        # differences of the same numbers, divided twice, and a root: a few roundings
        assert got.value == pytest.approx(value, rel=1e-12)
        assert got.bound == pytest.approx(bound, rel=1e-12, abs=1e-14)
    assert (
        set(met) == {None, *CONDITIONS} and min(met.values()) > count / 200
    )  # negative control: each is met, and none


def test_the_versions_of_the_fr3_differ_where_they_should():
    # between the old end of joint 1 and the new one
    q = np.full((TICKS, 7), 0.0)
    q[..., 0], q[..., 3], q[..., 5] = 2.80, -1.5, 2.0
    still = np.zeros_like(q)
    (count, first), new = (
        refused_by_us(load_profile(name), q, still) for name in ("franka_fr3_before_5_9", "franka_fr3")
    )
    assert (count, first.condition) == (TICKS, "position")
    # the new one does not let it go further: the root of 12 (2.9007 − 2.8) is above 0.6599
    assert new[0] == 0


def one_condition(**given):
    return Profile(
        robot="one joint", joints=1, **{name: {"source": "here", **one} for name, one in given.items()}
    )


BEFORE = {
    "position": ({"position": {"lower": [-1.5], "upper": [2.0]}}, 2.0, -1.5),
    "rate": ({"rate": {"value": [2.62]}}, 2.62, -2.62),
    "acceleration": ({"acceleration": {"value": [10.0]}}, 10.0, -10.0),
    "jerk": ({"jerk": {"value": [5000.0]}}, 5000.0, -5000.0),
}


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("side", [1, 2])
def test_the_bound_itself_is_refused_and_the_number_before_it_is_accepted(condition, side):
    given, period = BEFORE[condition], 2.0**-10  # so that products with it are exact
    bound = given[side]
    for value, is_refused in ((bound, True), (math.nextafter(bound, 0.0), False), (math.nan, True)):
        # a step from rest: the first acceleration is v/T, and the first jerk v/T²
        command = value * period ** max(0, CONDITIONS.index(condition) - 1)
        q, commands = np.zeros((2, 1, 1))
        (q if condition == "position" else commands)[0, 0] = command
        count, first = refused_by_us(one_condition(**given[0]), q, commands, period)
        assert count == is_refused
        if is_refused and not math.isnan(value):
            assert (first.value, first.bound) == (value, bound)


def test_the_rate_near_an_end_may_not_reach_the_taper():
    # √(2 · 0.5 · 1) − 0.25 at 1 rad from either end, exactly
    taper = {"lower": [-1.0], "upper": [1.0], "offset": [0.25], "deceleration": [0.5]}
    profile = one_condition(rate_near_ends=taper)
    for rate, is_refused in ((0.75, True), (-0.75, True), (math.nextafter(0.75, 0), False)):
        assert refused_by_us(profile, np.zeros((1, 1)), np.full((1, 1), rate))[0] == is_refused


# Figures ------------------------------------------------------------------------------------------


def chatter_by_numpy(commands, period, floor):
    """Return how many changes of sign come within CHATTER_TIME of the one before, of each joint."""
    acceleration = np.diff(commands, axis=0, prepend=0.0) / period
    counts = []
    for column in acceleration.T:
        (large,) = np.nonzero(np.abs(column) > floor)
        changes = large[1:][np.diff(np.sign(column[large])) != 0]
        counts.append(np.count_nonzero(np.diff(changes) <= round(CHATTER_TIME / period)))
    return np.array(counts)


@given(st.integers(0, 2**32), st.sampled_from([0.0005, 0.001, 0.008, 0.025]), st.floats(-3.0, 2.0))
def test_chatter_is_what_numpy_counts_in_random_columns(seed, period, size):
    rng = np.random.default_rng(seed)
    commands = (
        np.cumsum(10.0**size * rng.normal(size=(300, 4)) * (rng.random((300, 4)) < 0.2), axis=0) * period
    )
    acceleration = np.diff(commands, axis=0, prepend=0.0).T / period
    counts = chatter(acceleration, np.full(4, CHATTER_FLOOR), period)
    np.testing.assert_array_equal(counts, chatter_by_numpy(commands, period, CHATTER_FLOOR))


def stream(commands, period=PERIOD, **given):
    """Return a run of one joint with these commands."""
    width = {"n": 1, "k": 1, "nq": 1, "6": 6, "7": 7}
    columns = {
        name: np.zeros((len(commands), width[one.width]) if one.width else len(commands))
        for name, one in COLUMNS.items()
    }
    columns["time"], columns["qdot_cmd"] = np.arange(len(commands)) * period, np.array(commands)[:, None]
    columns["status"] = np.zeros(len(commands), np.int64)
    return Run("stream", ("a",), (False,), ("x",), 1.0, period, columns, len(commands), **given)


def test_a_switching_command_chatters_as_often_as_it_switches_and_a_smooth_one_never():
    time = np.arange(2000) * PERIOD
    # ±3,400 rad/s² that change their sign 55 times a second, as of a law that switches at a wrist singularity
    switching = np.cumsum(3400.0 * np.sign(np.sin(math.pi * 55.0 * time + 0.1))) * PERIOD
    card = scorecard(stream(switching))
    assert card["chatter"].value == pytest.approx(
        55.0, rel=0.03
    )  # the first change and the ends do not count
    assert card["chatter_joint"].value == "a"
    assert card["joint_acceleration_cmd.rms"].value == pytest.approx(3400.0, rel=1e-9)
    # 2 m/s of a path that goes to and fro once a second, as hard as 80 rad/s², is no chatter
    for smooth in (2.0 * np.sin(2 * math.pi * time) ** 3, switching * 1e-4, np.zeros(2000)):
        card = scorecard(stream(smooth))
        assert (card["chatter"].value, card["chatter_joint"].value) == (0.0, "")
    # a floor above it hides it
    assert scorecard(stream(switching, chatter_floor=(3500.0,)))["chatter"].value == 0.0


def test_the_peaks_of_commands_are_those_of_differences_from_rest():
    card = scorecard(stream([1.0, 1.0, 0.0, 4.0], period=0.5))
    # accelerations 2, 0, −2, 8; jerks 4, −4, −4, 20
    assert card["joint_acceleration_cmd.peak"].value == 8.0
    assert card["joint_acceleration_cmd.rms"].value == math.sqrt((4 + 0 + 4 + 64) / 4)
    assert (card["joint_jerk_cmd.peak"].value, card["joint_jerk_cmd.peak_time"].value) == (20.0, 1.5)
    assert card["joint_jerk_cmd.peak"].unit == "rad/s³"


# Scenarios ----------------------------------------------------------------------------------------

FR3 = ROOT / "scenarios/fr3_elbow.yaml"
SHORT = "target.path=[{line: {by: [0.005, 0, 0]}}]"
HELD = [SHORT, "expect={profile: franka_fr3}"]


def fr3(*overrides):
    (run,) = Simulation([prepare(load(FR3, [*HELD, *overrides]))]).run()
    return run


def test_figures_of_kept_columns_and_of_running_sums_and_of_a_file_are_the_same(tmp_path):
    for more in ([], ["target.limits.jerk=1.0e+6", "target.limits.acceleration=100"]):
        one = prepare(load(FR3, [*HELD, *more]))
        (run,) = Simulation([one]).run()
        bare = Simulation([one], keep_columns=False)
        bare.step()
        run.save(tmp_path / "run.npz")
        cards = run.scorecard, bare.scorecards()[0], Run.read(tmp_path / "run.npz").scorecard
        kept = [
            {name: repr(figure) for name, figure in card.items() if name not in ("wall_time", "speed")}
            for card in cards
        ]
        assert kept[0] == kept[1] == kept[2]
        count, first = verdict_by_numpy("franka_fr3", run["q"], run["qdot_cmd"], run.period)
        assert run.scorecard["profile.refused"].value == count
        assert bool(more) == bool(count)  # as written it is accepted, with a path that jerks it is not
        if first:
            got = [run.scorecard[f"profile.first_{name}"].value for name in ("condition", "joint")]
            assert got == [first[0], run.joints[first[1]]]


def test_an_arm_without_a_profile_has_no_figures_of_one():
    card = scorecard(stream([0.0, 9.0]))
    assert math.isnan(card["profile.refused"].value) and card["profile.first_condition"].value == ""
    (outcome,) = check(card, {"profile": "franka_fr3"})
    assert not outcome.ok and says("profile: … undefined …") == str(outcome)


def test_run_says_what_is_refused_first_and_exits_1(rmrc, tmp_path):
    jerky = ["--set", "target.limits.jerk=1.0e+6", "--set", "target.limits.acceleration=100", "--set", SHORT]
    held = ["--set", "expect={profile: franka_fr3}", "--out", str(tmp_path), "--quiet"]
    code, _, err = rmrc("run", str(FR3), *held, *jerky)
    assert code == 1
    (line,) = [one for one in told(err).splitlines() if "profile" in one]
    assert line == says('… profile: … franka_fr3 … rad/s² … "fr3_joint2" … s … 10 … commands …')
    facts = json.loads((tmp_path / "fr3_elbow.json").read_text())
    (outcome,) = facts["expect"]
    assert outcome["name"] == "profile" and outcome["ok"] is False and outcome["text"] in line
    assert facts["scorecard"]["profile"]["refused"] == outcome["value"] > 0


def test_a_sweep_has_the_verdict_of_each_run_in_its_row(tmp_path):
    text = FR3.read_text().replace("../models", str(ROOT / "models"))
    (tmp_path / "mine.yaml").write_text(OWN)
    (tmp_path / "case.yaml").write_text(text)
    vary = "sweep={vary: {target.limits.jerk: [10.0, 1.0e+6]}}"
    held = [SHORT, "target.limits.acceleration=100", "expect={profile: mine.yaml}", vary]
    sweep = Sweep(tmp_path / "case.yaml", held, folder=tmp_path / "out", threads=1)
    sweep.run()
    rows = pq.read_table(sweep.dataset.file).to_pylist()
    assert [row["met"] for row in rows] == [True, False]
    assert [row["profile.first_condition"] for row in rows] == [None, "jerk"]
    assert rows[0]["profile.refused"] == 0.0 and rows[1]["profile.first_value"] > 100.0
    assert rows[0]["chatter"] == 0.0 and rows[0]["joint_jerk_cmd.peak"] < 100.0
    assert sweep.summary().extremes[-1].most[1] == 1  # of profile.refused, the run that has the most
    assert sweep.chosen(Choice.read("worst:1")) == [1]
    # the file goes along to where the scenario is run
    assert pack(draft_of(tmp_path / "case.yaml", held)).models["mine.yaml"].file.endswith("mine.yaml")


def test_a_profile_sets_what_is_not_written():
    def control(written):
        text = f"name: x\narm: {{model: {ROOT}/models/fr3.xml}}\ncontrol: {written}\n"
        return loads(f"{text}target: {{path: [{{hold: {{for: 1}}}}]}}\n").control

    found = control("{limits: {profile: franka_fr3}}")
    assert found.period == 0.001
    # below the published bounds by libfranka's own margin
    assert found.limits.rate == tuple(RATES - 1e-3)
    assert found.limits.acceleration == (ACCELERATION - 1e-3,) * 7
    assert found.limits.jerk == (JERK - 1e-3,) * 7
    assert control("{limits: {profile: xarm7}}").period == 0.004
    # what is written wins, null as well
    found = control("{period: 0.002, limits: {profile: xarm7, rate: 1.5, acceleration: null}}")
    assert (found.period, found.limits.rate, found.limits.acceleration) == (0.002, 1.5, None)


def test_another_profile_takes_the_place_of_all_that_the_first_one_set():
    one = load(FR3, ["control.limits={profile: franka_fr3}"])
    other = one.set({"control.limits.profile": "xarm7"})
    assert other == load(FR3, ["control.limits={profile: xarm7}"])
    assert (other.control.period, other.control.limits.jerk) == (0.004, None)
    assert one.set({"control.limits.profile": None}) == load(FR3, ["control.limits={}"])
    assert one.set({"control.feedback": 3.0}).control.limits == one.control.limits
    assert one.set({"control.limits.rate": None}).control.limits.rate is None
    assert one.set({"control.limits.rate": None}).control.limits.jerk == one.control.limits.jerk


def test_a_scenario_with_a_profile_is_read_back_from_its_own_text():
    one = load(FR3, ["control.limits={profile: franka_fr3}", "expect={profile: franka_fr3}"])
    assert loads(one.to_yaml()) == one


def test_joints_brake_before_the_positions_of_the_profile_so_that_no_rate_near_an_end_is_met():
    one = prepare(load(FR3, ["control.limits={profile: franka_fr3_before_5_9}"]))
    law, profile = one.law, load_profile("franka_fr3_before_5_9")
    taper = profile.rate_near_ends
    (lower, upper), b = law.position_limit, law.braking
    assert (lower > taper.lower).all() and (upper < taper.upper).all()
    for j in range(7):
        distance = np.linspace(0.0, 1.0, 2001)  # from where the joint is to the stop of the law
        braked = np.sqrt(2.0 * b[j] * distance)
        q = np.repeat((upper[j] - distance)[:, None], 7, axis=1)
        allowed = rate_bounds_of_the_header(q)[1][:, j]
        fast = braked < RATES[j] - 1e-3
        assert (braked[fast] < allowed[fast]).all()


def test_joints_that_are_driven_into_their_ends_keep_to_the_rates_there(tmp_path):
    """All but jerk, which the law bounds by itself: the joints race to their ends, where the rates fall to 0."""
    published = yaml.safe_load(SHIPPED["franka_fr3_before_5_9"].read_text())
    del published["jerk"]
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(published))
    race = ["task.axes=[z]", "control.nullspace={objective: rates, rates: [2, 0, 0, 0, 0, 0, 5]}"]
    held = ["target.path=[{hold: {for: 3}}]", f"expect={{profile: {tmp_path}/own.yaml}}", *race]
    verdicts = []
    for limits in ("profile: franka_fr3_before_5_9", f"rate: {RATES.tolist()}, acceleration: 9.999"):
        (run,) = Simulation([prepare(load(FR3, [*held, f"control.limits={{{limits}}}"]))]).run()
        left = (HEADER["q_max"] - run["q"][-1])[[0, 6]]
        assert (np.abs(left) < 0.02).all()  # negative control: they do get there
        verdicts.append(run.scorecard["profile.first_condition"].value)
    assert verdicts == ["", "acceleration"]  # which gives way where the position would be passed


def test_every_shipped_profile_names_a_source_for_each_number_and_is_read():
    assert {"franka_fr3", "franka_panda", "ur5e", "ur10e", "xarm7", "gen3", "iiwa14"} <= set(SHIPPED)
    for name in SHIPPED:
        profile = load_profile(name)
        assert profile.name == name and profile.rate and profile.position
        assert len(profile.rate.source) > 20


def test_the_assumptions_of_a_run_say_what_came_of_the_profile():
    assumed = [
        one.text for one in prepare(load(FR3, ["control.limits={profile: franka_fr3, rate: 1.0}"])).assumed
    ]
    (line,) = [text for text in assumed if "profile" in text]
    words = "control.period 0.001, … control.limits.acceleration 9.999, … control.limits.jerk 4999.999, …"
    assert line == says(f"… franka_fr3: … {words}")
    assert "limits.rate" not in line


# A user's own -------------------------------------------------------------------------------------

OWN = """\
robot: mine
joints: 7
rate: {value: [1, 1, 1, 1, 1, 1, 1], source: data sheet}
jerk: {value: [100, 100, 100, 100, 100, 100, 100], source: measured}
loop: {delay: {value: [0.01, 0.02], source: measured}}
"""


def own(tmp_path, text=OWN):
    (tmp_path / "mine.yaml").write_text(text)
    scenario = FR3.read_text().replace("../models", str(ROOT / "models"))
    (tmp_path / "case.yaml").write_text(scenario)
    return tmp_path / "case.yaml"


def test_a_profile_of_ones_own_is_a_file_beside_the_scenario(tmp_path):
    one = load(own(tmp_path), ["control.limits={profile: mine.yaml}", "expect={profile: mine.yaml}"])
    assert one.control.limits.rate == (0.999,) * 7
    assert one.expect["profile"] == str(tmp_path / "mine.yaml")
    assert expected_profile(prepare(one).scenario).name == "mine"
    assert load_profile(one.expect["profile"]).loop.delay.value == (0.01, 0.02)
    assert one.draft.profiles == ["mine.yaml"]
    vary = "sweep.vary={control.limits.profile: [null, franka_fr3, b.yaml], control.limits: [{profile: c.yaml}, {}]}"
    assert draft_of(own(tmp_path), [vary]).profiles == ["c.yaml", "b.yaml"]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (OWN.replace("joints: 7\n", ""), "… mine.yaml… joints … required"),
        (OWN.replace("source: measured}\nloop", "speed: 1}\nloop"), "… mine.yaml:4… jerk.source … required …"),
        (OWN + "paint: red\n", "… mine.yaml:6… paint … unknown key …"),
        (OWN.replace("[1, 1, 1, 1, 1, 1, 1]", "[1, 1]"), "… mine.yaml:3… rate.value … 2 … 7 joints"),
        (OWN.replace("[1, 1, 1, 1, 1, 1, 1]", "[1, 1, 1, -1, 1, 1, 1]"), "… mine.yaml:3… rate.value[3] … -1"),
        (OWN.replace("[1, 1, 1, 1, 1, 1, 1]", "[1, 1, 1, 0.001, 1, 1, 1]"), "… rate.value … margin 0.001 … 0.001"),
        (OWN + "position: {lower: [1,1,1,1,1,1,1], upper: [0,2,2,2,2,2,2], source: x}\n", "… position.lower[0] … upper[0] … 0 … 1"),
        ("[", "… mine.yaml… YAML…"),
        ("", "… mine.yaml… empty"),
    ],
)  # fmt: skip
def test_a_wrong_profile_is_one_line_with_its_place(tmp_path, text, wanted):
    with pytest.raises(ScenarioError) as caught:
        load(own(tmp_path, text), ["control.limits={profile: mine.yaml}"])
    (line,) = str(caught.value).splitlines()
    assert line == says(wanted) and "control.limits.profile" in line


@pytest.mark.parametrize(
    ("override", "wanted"),
    [
        ("control.limits.profile=franka_fr4", '… control.limits.profile: … "franka_fr4" … "franka_fr3"…'),
        ("control.limits.profile=gone.yaml", "… control.limits.profile: … gone.yaml…"),
        ("control.limits.profile=3", "… control.limits.profile: … text … 3 …"),
        ("expect.profile=robot", '… expect.profile: … "robot" … franka_fr3 …'),
        ("expect.profile={below: 1}", "… expect.profile: … franka_fr3 … below …"),
        ("expect.joint_rate.peak=franka_fr3", "… expect.joint_rate.peak: … mapping … franka_fr3…"),
    ],
)
def test_what_names_no_profile_is_refused_on_one_line(override, wanted):
    with pytest.raises(ScenarioError) as caught:
        load(FR3, [override])
    (line,) = str(caught.value).splitlines()
    assert line == says(wanted)


@pytest.mark.parametrize(
    ("overrides", "wanted"),
    [
        (["control.limits={profile: ur5e}"], "… control.limits.profile: ur5e … 6 joints … 7 (fr3_joint1…"),
        (["expect={profile: ur10e}"], "… expect.profile: ur10e … 6 joints … 7 (fr3_joint1…"),
        (["expect={profile: franka_fr3}", "control.period=0.002"], "… expect.profile: franka_fr3 … 0.001 s … 0.002 s … control.period: 0.001"),
        (["control.limits={profile: ur5e}", "control.at_singularity=slow"], "… control.limits.profile: ur5e … 6 joints …"),
    ],
)  # fmt: skip
def test_a_profile_that_does_not_fit_the_arm_is_refused_on_one_line(overrides, wanted):
    with pytest.raises(ScenarioError) as caught:
        prepare(load(FR3, [SHORT, *overrides]))
    (line,) = str(caught.value).splitlines()
    assert line == says(wanted)


def test_null_asks_for_no_profile():
    assert "profile" not in load(FR3, ["expect.profile=franka_fr3", "expect.profile=null"]).expect
