"""What a profile accepts, against the vendor's own document, written once more: plain numpy over whole columns."""

import json
import math
from collections import Counter

import numpy as np
import pytest
import yaml

from project import ROOT, told
from rmrc.results.metrics import CONDITIONS
from rmrc.results.scorecard import scorecard
from rmrc.scenario import load, loads
from rmrc.scenario.profile import SHIPPED, Profile, load_profile
from rmrc.simulation.prepare import expected_profile, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError
from standing import make_run
from wording import says

# frankarobotics/docs, robot_specifications.rst, "Necessary conditions" and "Position-based velocity limits", with
# control-parameters-joint-fr3.csv of May 2026.
RATES, ACCELERATION, JERK = np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]), 10.0, 5000.0
Q_MAX = np.array([2.9007, 1.8361, 2.9007, -0.1169, 2.8763, 4.6216, 3.0508])
Q_MIN = np.array([-2.9007, -1.8361, -2.9007, -3.0770, -2.8763, 0.4398, -3.0508])
OFFSET = np.array([0.6599, 0.2517, 0.2000, 0.3533, 0.5757, 0.4878, 0.4628])
DECELERATION = np.array([6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0])
TICKS, PERIOD = 400, 0.001


def rate_bounds(q):
    """Return the lower and upper rate limits at positions, (T, 7) each."""
    up, down = (np.sqrt(np.maximum(0.0, 2.0 * DECELERATION * room)) for room in (Q_MAX - q, q - Q_MIN))
    upper = np.minimum(RATES, np.maximum(0.0, up - OFFSET))
    return np.maximum(-RATES, np.minimum(0.0, OFFSET - down)), upper


def verdict_by_numpy(q, commands, period):
    """Return the ticks that break a condition, and of the first: condition, joint, tick, value, bound."""
    rest = np.zeros((1, 7))
    acceleration = np.diff(commands, axis=0, prepend=rest) / period
    jerk = np.diff(acceleration, axis=0, prepend=rest) / period
    conditions = [
        ("position", q, np.broadcast_to(Q_MIN, q.shape), np.broadcast_to(Q_MAX, q.shape)),
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


def random_streams(rng, count):
    """Return positions and commands, (TICKS, count, 7): of all kinds, so that each condition is the first one broken.

    Each joint comes up to a rate that may be too fast, in 0.4 s, with noise whose jerk is up to a bound about the
    published one. A share of the joints starts near an end of its range, or beyond it.
    """
    x = np.arange(1, TICKS + 1)[:, None, None] / TICKS
    cruise = rng.choice([0.0, 0.3, 0.95, 1.3], (1, count, 1), p=[0.3, 0.3, 0.35, 0.05]) * RATES.min()
    rise = cruise * rng.uniform(-1.0, 1.0, (1, count, 7)) * (3.0 * x**2 - 2.0 * x**3)
    jerk = JERK * 10.0 ** rng.uniform(-2.0, 0.05, (1, count, 1))
    noise = 0.5 * jerk * PERIOD * rng.uniform(-1.0, 1.0, (TICKS, count, 7))
    commands = rise + np.cumsum(noise, axis=0) * PERIOD
    places = rng.choice([0.5, 0.03, 0.97, -0.01], (1, count, 7), p=[0.94, 0.029, 0.029, 0.002])
    return Q_MIN + (Q_MAX - Q_MIN) * places + np.cumsum(commands, axis=0) * PERIOD, commands


def card_of(commands, q=None, period=PERIOD, **more):
    """Return the scorecard of a run with these commands, (T, n)."""
    commands = np.array(commands, float).reshape(len(commands), -1)
    joints, q = "abcdefg"[: commands.shape[1]], np.zeros_like(commands) if q is None else q
    return scorecard(make_run(len(commands), joints, ("x",), period, q=q, qdot_cmd=commands, **more))


def first_of(card):
    names = "condition", "joint", "time", "value", "bound"
    return [card[f"profile.first_{name}"].value for name in names]


def test_the_verdict_on_random_runs_is_that_of_the_published_conditions():
    count, met, profile = 200, Counter(), load_profile("franka_fr3")
    q, commands = random_streams(np.random.default_rng(5), count)
    for w in range(count):
        card = card_of(commands[:, w], q[:, w], profile=profile)
        broken, first = verdict_by_numpy(q[:, w], commands[:, w], PERIOD)
        assert card["profile.refused"].value == broken
        met[first and first[0]] += 1
        if first is not None:
            condition, joint, tick, value, bound = first
            got = first_of(card)
            assert got[:2] == [condition, "abcdefg"[joint]]
            # differences of the same numbers, divided twice, and a root: a few roundings
            assert got[2:] == pytest.approx([tick * PERIOD, value, bound], rel=1e-12, abs=1e-14)
    # negative control: each is met, and none
    assert set(met) == {None, *CONDITIONS} and min(met.values()) > count / 200


BEFORE = {
    "position": ({"lower": [-1.5], "upper": [2.0]}, 2.0, -1.5), "rate": ({"value": [2.62]}, 2.62, -2.62),
    "acceleration": ({"value": [10.0]}, 10.0, -10.0), "jerk": ({"value": [5000.0]}, 5000.0, -5000.0),
}  # fmt: skip


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("side", [1, 2])
def test_the_bound_itself_is_refused_and_the_number_before_it_is_accepted(condition, side):
    written, period = BEFORE[condition][0], 2.0**-10  # so that products with it are exact
    bound, profile = BEFORE[condition][side], {"robot": "one joint", "joints": 1}
    profile = Profile(**profile, **{condition: {"source": "here", **written}})
    for value, is_refused in ((bound, True), (math.nextafter(bound, 0.0), False), (math.nan, True)):
        # a step from rest: the first acceleration is v/T, and the first jerk v/T²
        command = np.full((1, 1), value * period ** max(0, CONDITIONS.index(condition) - 1))
        still = np.zeros((1, 1))
        card = card_of(
            *((still, command) if condition == "position" else (command, still)), period, profile=profile
        )
        assert card["profile.refused"].value == is_refused
        if is_refused and not math.isnan(value):
            assert first_of(card)[3:] == [value, bound]


def test_a_switching_command_chatters_as_often_as_it_switches_and_a_smooth_one_never():
    time = np.arange(2000) * PERIOD
    # ±3,400 rad/s² that change their sign 55 times a second, as of a law that switches at a wrist singularity
    switching = np.cumsum(3400.0 * np.sign(np.sin(math.pi * 55.0 * time + 0.1))) * PERIOD
    card = card_of(switching)
    assert card["chatter"].value == pytest.approx(
        55.0, rel=0.03
    )  # the first change and the ends do not count
    assert card["chatter_joint"].value == "a"
    assert card["joint_acceleration_cmd.rms"].value == pytest.approx(3400.0, rel=1e-9)
    # 2 m/s of a path that goes to and fro once a second, as hard as 80 rad/s², is no chatter
    for smooth in (2.0 * np.sin(2 * math.pi * time) ** 3, switching * 1e-4, np.zeros(2000)):
        assert card_of(smooth)["chatter"].value == 0.0
    # a floor above it hides it
    assert card_of(switching, chatter_floor=(3500.0,))["chatter"].value == 0.0


# Scenarios ----------------------------------------------------------------------------------------

FR3 = ROOT / "scenarios/fr3_elbow.yaml"
SHORT = "target.path=[{line: {by: [0.005, 0, 0]}}]"


def test_run_says_what_is_refused_first_and_exits_1(rmrc, tmp_path):
    jerky = ["--set", "target.limits.jerk=1.0e+6", "--set", "target.limits.acceleration=100", "--set", SHORT]
    held = ["--set", "expect={profile: franka_fr3}", "--out", str(tmp_path), "--quiet"]
    code, _, err = rmrc("run", str(FR3), *held, *jerky)
    assert code == 1
    (line,) = [one for one in told(err).splitlines() if "profile" in one]
    assert line == says('… profile: … franka_fr3 … refused… acceleration … "fr3_joint2" … s')
    facts = json.loads((tmp_path / "fr3_elbow.json").read_text())
    (outcome,) = facts["expect"]
    assert outcome["name"] == "profile" and outcome["ok"] is False and outcome["text"] in line
    assert facts["scorecard"]["profile"]["refused"] == outcome["value"] > 0


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
        left = np.array([2.7437, 3.0159]) - run["q"][-1, [0, 6]]
        assert (np.abs(left) < 0.02).all()  # negative control: they do get there
        verdicts.append(run.scorecard["profile.first_condition"].value)
    assert verdicts == ["", "acceleration"]  # which gives way where the position would be passed


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
    assert loads(one.to_yaml()) == one
    assert tmp_path / "mine.yaml" in one.draft.files()


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (OWN.replace("joints: 7\n", ""), "… mine.yaml… joints … required…"),
        (OWN.replace("[1, 1, 1, 1, 1, 1, 1]", "[1, 1]"), "… mine.yaml:3… rate.value … 2 … 7 joints"),
    ],
)  # fmt: skip
def test_a_wrong_profile_is_one_line_with_its_place(tmp_path, text, wanted):
    with pytest.raises(ScenarioError) as caught:
        load(own(tmp_path, text), ["control.limits={profile: mine.yaml}"])
    (line,) = str(caught.value).splitlines()
    assert line == says(wanted) and "control.limits.profile" in line


def test_a_profile_that_does_not_fit_the_arm_is_refused_on_one_line():
    with pytest.raises(ScenarioError) as caught:
        prepare(load(FR3, [SHORT, "control.limits={profile: ur5e}"]))
    assert str(caught.value) == says("… control.limits.profile: ur5e … 6 joints … 7 (fr3_joint1…")
