"""Margins: the edges that runs find, against equations and against plain runs; and what is no instability."""

import math
import os
import signal
import threading

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import rmrc
from project import ROOT, mostly_long
from rmrc.scenario import changes_of, draft_of, loads
from rmrc.scenario.choices import Status
from rmrc.study.margins.kicks import KICK, resting, twin_of
from rmrc.study.margins.margins import Asking, margins_of
from rmrc.study.margins.report import report
from rmrc.study.margins.ringing import STILL_RINGS, judged, reverses, still_ringing, window, without_trend
from rmrc.study.margins.search import ACCURACY, bears, close_in, gain
from rmrc.study.study import Study
from rmrc.support.errors import ScenarioError
from rmrc.textbook.stability import edge_delay, edge_gain
from wording import says

TEXT = f"""
name: short
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [30 deg, 60 deg]}}
task: {{axes: [x, y]}}
control: {{period: 0.01, feedback: 10, inverse: {{method: inverse}}}}
target: {{path: [{{line: {{by: [0.05, 0.05]}}}}], limits: {{velocity: 0.5}}}}
plant: {{kind: ideal}}
"""
PERIOD = 0.01


@pytest.fixture(scope="module")
def short():
    return Study(loads(TEXT))


def judge(study, **changes):
    (found,) = judged(study, [study.prepare(changes_of(changes))], threading.Event())
    return found


def gain_margins(study, settings, threads=1):
    """Return the intervals with the gain margins of settings."""
    searches = [gain(study.prepare(one).scenario, one) for one in settings]
    close_in(study, searches, threading.Event(), threads)
    return [search.edge for search in searches]


# The edges -----------------------------------------------------------------------------------------


def test_the_edge_of_the_ideal_plant_is_that_of_the_equation(short):
    ticks = np.array([0, 1, 5])
    found = gain_margins(short, [changes_of({"plant.delay": PERIOD * d}) for d in ticks])
    wanted = 2.0 * np.sin(np.pi / (2 * (2 * ticks + 1))) / PERIOD
    assert_allclose([10.0 * edge.value for edge in found], wanted, rtol=0.02)
    assert all(1.0 < edge.high / edge.low <= 1.0 + ACCURACY for edge in found)


def test_so_it_is_between_ticks_and_with_a_lag(short):
    late = [(0.5, 0.0), (2.7, 0.0), (1.0, 1.5), (0.6, 8.0), (4.0, 4.0)]
    settings = [{"plant.delay": PERIOD * d, "plant.lag": PERIOD * lag} for d, lag in late]
    found = gain_margins(short, [changes_of(one) for one in settings])
    wanted = [edge_gain(PERIOD, PERIOD * d, PERIOD * lag) for d, lag in late]
    assert_allclose([10.0 * edge.value for edge in found], wanted, rtol=0.02)


def test_the_same_dead_time_can_be_added_as_the_equation_says(short):
    for own in (0.0, 0.04):
        one = short.prepare(changes_of({"plant.delay": own})).scenario
        found = rmrc.margins(one, accuracy=0.04, threads=1)
        assert found.is_stable and found.late == (own, 0.0)
        assert_allclose(own + found.delay.value + PERIOD / 2, own + found.delay.ideal + PERIOD / 2, rtol=0.02)
        # π/2/K is the dead time of a loop without a period
        assert_allclose(own + found.delay.ideal + PERIOD / 2, math.pi / 20.0, rtol=0.01)
        assert (found.lag.edge.high == math.inf) == (found.lag.ideal == math.inf)


def test_a_dead_time_that_a_short_path_cannot_show_is_more_than_most_of_its_time(short):
    """With 2/s the ideal plant bears 0.78 s of dead time, and the run takes 0.65 s, in which none would arrive."""
    scenario, ends = short.prepare().scenario, short.prepare().reference.duration
    found = rmrc.margins(scenario.set({"control.feedback": 2.0}), accuracy=0.5, threads=1).delay
    assert found.ideal > 1.1 * ends and found.edge.high == math.inf
    assert_allclose([found.edge.low, found.bound], 0.9 * ends, rtol=1e-9)


@pytest.mark.long
def test_so_it_is_where_what_is_written_leaves_nothing_to_add(short):
    scenario = short.prepare().scenario
    # 0.6 s and more are beyond 0.9 of the path
    late = rmrc.margins(
        scenario.set({"control.feedback": 2.0, "plant.delay": 0.63}), accuracy=0.5, threads=1
    ).delay
    assert late.edge == (0.0, math.inf)


def late_swings(scenario, feedback):
    """Return how far joints swing between neighbors in the last fifth of a plain run."""
    run = rmrc.run(scenario.set({"control.feedback": feedback}))
    if run.divergence:
        return math.inf
    q = run["q"][-len(run) // 5 :]
    return np.abs(np.diff(q, 3, axis=0)).max()


ARMS = {
    "servo": {}, "torque": {},
    "model": {"arm.model": str(ROOT / "models/ur5e.xml"), "arm.start": "home", "arm.site": None},
}  # fmt: skip


@pytest.mark.parametrize("kind", mostly_long(["servo", "torque", "model"], 99))
def test_edges_of_physical_plants_part_plain_runs_that_settle_from_those_that_swing(kind):
    """A plain run alone: at rest behind its path, the arm is still, or swings from tick to tick."""
    one = loads(TEXT).set(
        {
            **ARMS[kind], "plant.kind": kind, "plant.delay": 0.03, "plant.timestep": 0.002,
            "control.period": 0.002, "control.inverse.method": "damped",
            "target.path": [{"line": {"by": [0.05, 0.0]}}, {"hold": {"for": 4.0}}],
        }
    )  # fmt: skip
    (edge,) = gain_margins(Study(one), [()])
    assert edge.is_found
    stable, unstable = (late_swings(one, 10.0 * edge.value * share) for share in (0.85, 1.2))
    assert unstable > 20.0 * stable


def test_a_loop_bears_so_many_times_its_feedback_up_to_the_edge_of_the_equation(short):
    edge = edge_gain(PERIOD, 0.03)
    # the last two are judged with a quarter of the edge first, and have nothing to show with what is asked
    asked = [(0.45, True), (0.55, False), (0.3, True), (0.01, True), (0.05, True)]
    settings = [changes_of({"plant.delay": 0.03, "control.feedback": share * edge}) for share, _ in asked]
    assert bears(short, settings, 2.0) == [is_borne for _, is_borne in asked]
    # a lag that nobody knows of: not even the quarter is borne, and what is asked decides
    slow = {"plant.kind": "servo", "plant.timestep": 0.01, "plant.kv": 0.05, "control.feedback": 0.01 * edge}
    assert bears(short, [changes_of(slow)], 2.0) == [
        not judge(short, **slow | {"control.feedback": 0.02 * edge}).is_unstable
    ]


def test_a_sparing_search_finds_the_same_edges_by_fewer_runs(short):
    late = changes_of({"plant.delay": 0.02})
    usual, sparing, warm = (
        margins_of(short, [late], threading.Event(), accuracy=0.05, **how)[0]
        for how in ({}, {"is_sparing": True}, {"is_sparing": True, "expected": edge_gain(PERIOD, 0.02)})
    )
    assert warm.runs <= sparing.runs < 0.75 * usual.runs
    assert warm.gain.edge.low < sparing.gain.edge.high and sparing.gain.edge.low < warm.gain.edge.high
    for one, other in zip(usual.all, sparing.all, strict=True):
        assert max(one.edge.low, other.edge.low) < min(one.edge.high, other.edge.high)  # both hold the edge
        assert other.edge.high <= 1.05 * (1.0 + 1e-9) * other.edge.low or one.name != "gain"


def test_a_search_begins_above_what_was_stable_before_unless_that_is_beyond_an_unstable_factor(short):
    feedback = 0.5 * edge_gain(PERIOD, 0.02)  # it bears twice as much, by the equation
    loop = changes_of({"plant.delay": 0.02, "control.feedback": feedback})
    found, wrong = (
        margins_of(short, [loop], threading.Event(), accuracy=0.5, is_sparing=True, stable=stable)[0]
        for stable in (1.98, 3.0)
    )
    assert found.is_stable and 1.98 <= found.gain.edge.low < found.gain.value < found.gain.edge.high < 2.7
    assert wrong.is_stable and wrong.gain.edge.low < 2.0 <= wrong.gain.edge.high < 3.0


def test_a_sparing_search_makes_commands_ten_times_as_late_at_most_and_finds_edges_before_that(short):
    delay = 0.02
    edge, most = edge_gain(PERIOD, delay), 9.0 * (delay + 0.5 * PERIOD)
    feedbacks = (0.03 * edge, 0.5 * edge)
    loops = [changes_of({"plant.delay": delay, "control.feedback": one}) for one in feedbacks]
    slow, quick = margins_of(short, loops, threading.Event(), accuracy=0.05, is_sparing=True)
    # by the equation, the first bears three times as much, and the second half of it
    ideal = [edge_delay(one, PERIOD, 0.0) - delay for one in feedbacks]
    assert ideal[1] < 0.5 * most < 2.0 * most < ideal[0]
    for one in (slow.delay, slow.lag):
        assert_allclose([one.edge.low, one.bound], most, rtol=1e-9)
        assert one.edge.high == math.inf
    assert slow.is_stable and quick.is_stable
    assert_allclose(quick.delay.value + delay + PERIOD / 2, ideal[1] + delay + PERIOD / 2, rtol=0.05)


@pytest.mark.long
def test_more_delay_leaves_less_gain_and_a_finer_search_comes_nearer(short):
    delays = (0.0, 0.015, 0.04, 0.1)
    found = gain_margins(short, [changes_of({"plant.delay": delay}) for delay in delays])
    assert sorted((edge.value for edge in found), reverse=True) == [edge.value for edge in found]
    scenario = short.prepare().scenario
    coarse, fine = (Asking(scenario, accuracy=share, threads=1).run().gain.edge for share in (0.2, 0.05))
    assert fine.high / fine.low <= 1.05 < coarse.high / coarse.low <= 1.2


def test_bits_do_not_depend_on_threads_or_on_what_is_asked_beside(short):
    settings = [changes_of({"plant.delay": delay}) for delay in (0.0, 0.02)]
    both = gain_margins(short, settings, threads=2)
    assert both == [gain_margins(short, [one], threads=1)[0] for one in settings]


# Unstable as written -------------------------------------------------------------------------------


def test_a_loop_that_is_unstable_as_written_is_told_by_how_much_its_gain_must_fall(short):
    one = short.prepare(changes_of({"plant.delay": 0.05, "control.feedback": 60.0})).scenario
    found = rmrc.margins(one, threads=1)
    assert not found.is_stable and found.written.reason == "rings"
    assert found.delay is None and found.lag is None
    assert_allclose(60.0 * found.gain.value, edge_gain(PERIOD, 0.05), rtol=0.02)
    shown = report(found)
    assert not shown.met
    assert shown.problem == says(
        "the loop is unstable as written: it keeps ringing … up to … times its 60 1/s …"
    )


def test_what_was_recommended_without_delay_is_unstable_with_eight_milliseconds():
    study = Study(draft_of("approach_singularity", ["target.path[0].line.to=[1.995, 0]"]))
    recommended = {
        "control.inverse.damping.maximum": 0.0281, "control.inverse.damping.below": 0.0625,
        "control.feedback": 200.0,
    }  # fmt: skip
    assert judge(study, **recommended).reason == ""
    assert judge(study, **recommended, **{"plant.delay": 0.008}).reason != ""
    settings = [changes_of({**recommended, "control.feedback": gain}) for gain in (200.0, 100.0)]
    assert bears(study, settings, 2.0) == [True, True]
    late = [(*one, *changes_of({"plant.delay": 0.008})) for one in settings]
    assert bears(study, late, 1.0) == [False, True] and bears(study, late, 2.0) == [False, False]


def test_a_limit_cycle_that_swallows_the_kick_is_told_by_its_commands(short):
    changes = {"control.feedback": 500.0, "control.limits.rate": 1.0}
    longer = resting(short.prepare(changes_of(changes)), 600)
    (ran,) = short.step([longer])
    limited = ran.run["status"].astype(int) & Status.RATE_LIMITED != 0
    assert reverses(ran.run["qdot_cmd"], limited, 0, 600)
    assert not reverses(ran.run["qdot_cmd"], np.zeros(600, bool), 0, 600)
    assert not reverses(np.abs(ran.run["qdot_cmd"]), limited, 0, 600)
    assert judge(short, **changes).is_unstable


@pytest.mark.parametrize("feedback", [250.0, 400.0, 1e4])
def test_a_loop_without_limits_is_unstable_wherever_it_swings_to(short, feedback):
    assert judge(short, **{"control.feedback": feedback, "control.limits.on_excess": "none"}).is_unstable


def test_what_diverges_is_unstable(short):
    found = judge(short, **{"control.feedback": 1e12, "control.limits.on_excess": "none"})
    assert found.reason == "diverged" and found.time > 0.0 and found.left == math.inf


# What is none --------------------------------------------------------------------------------------


# First those where worlds and their twins part: at a stop, a limit, or a singularity.
HARD = ["at_the_stop", "blow_up", "beyond_reach", "slow_wrist", "stop_and_wait"]
OTHERS = sorted({path.stem for path in (ROOT / "scenarios").glob("*.yaml")} - {*HARD, "example_5_5"})


@pytest.mark.parametrize("name", [*HARD[:3], *mostly_long([*HARD[3:], *OTHERS], 99)])
def test_scenarios_are_stable_as_they_are_written(name):
    assert judge(Study(name)).reason == ""


@pytest.mark.long
@pytest.mark.parametrize("name", [*HARD, *OTHERS])
def test_with_eight_milliseconds_shipped_scenarios_bear_about_what_the_equations_say(name):
    late = {"plant.delay": 0.008}
    found = Asking(ROOT / f"scenarios/{name}.yaml", ["plant.delay=0.008"]).run()
    assert found.is_stable and len(found.all) == 3 and report(found).met
    for one in found.all:
        low, high = one.edge
        assert 0.0 < low < high and low <= one.bound * (1 + 1e-9)
        # Limits and servos take little of what the ideal plant bears; a model's own drives have a lag that no key tells.
        assert low >= (0.5 if found.scenario.plant.kind == "model" else 0.9) * one.rule
        assert high <= 1.1 * one.ideal or high == math.inf
    # The edge is one: half of it is stable, and twice is not.
    written, (low, high) = found.scenario.control.feedback, found.gain.edge
    half, twice = (
        judge(Study(name), **late | {"control.feedback": written * one}) for one in (0.5 * low, 2 * high)
    )
    assert not half.is_unstable and twice.is_unstable


T = np.arange(3000)


@pytest.mark.parametrize(
    ("swings", "rings"),
    [
        (np.sin(0.3 * T), True),
        (1e-3 * np.exp(0.004 * T) * np.sin(0.3 * T), True),
        (np.exp(-0.004 * T) * np.sin(0.3 * T), False),
        (np.exp(-0.00003 * T) * np.sin(0.3 * T), True),  # fades so slowly that nobody waits for it
        (np.exp(0.004 * T), False),  # parts, as past a singularity, and does not swing
        (0.002 * np.sin(0.3 * T), False),  # what rounding or a last digit leaves
        (np.where(T < 1000, 0.1, 100.0 * np.exp(-0.004 * (T - 1000.0))) * np.sin(0.3 * T), False),
        (np.where(T < 1000, 100.0 * np.exp(-0.01 * T), 1e-2 * np.exp(0.004 * (T - 1000.0))) * np.sin(0.3 * T), True),
    ],
    ids=["endless", "grows", "fades", "fades slowly", "parts", "rounding", "a stop, fades", "grows late"],
)  # fmt: skip
def test_what_is_called_ringing(swings, rings):
    flat = np.zeros((3000, 2))
    flat[:, 1] = swings
    assert (still_ringing(flat, 0, 3000) >= STILL_RINGS) == rings


def test_the_mean_around_each_is_taken_away():
    line = np.column_stack([2.0 * T, np.sin(2 * np.pi * T / 25)])
    left = without_trend(line, 25)
    assert left.shape == (2988, 2)
    assert_allclose(left[12:, 0], 0.0, atol=1e-8)  # rounding of sums of 1e7
    assert_allclose(left[12:, 1], line[12:2988, 1], atol=1e-9)


# The twin ------------------------------------------------------------------------------------------


def test_a_twin_has_the_path_but_for_its_kicks_and_rests_behind_it(short):
    one = short.prepare()
    path = one.reference
    longer = resting(one, path.ticks + 50)
    twin = twin_of(longer, (3, 40), 1e-3)
    own, moved = longer.reference.samples, twin.reference.samples
    assert len(own) == len(moved) == path.ticks + 50
    assert_array_equal(own[: path.ticks], path.samples)
    assert_array_equal(own[path.ticks :, :7], np.tile(path.pose[-1], (50, 1)))
    assert not own[path.ticks :, 7:].any()
    kicked = np.flatnonzero(np.any(own != moved, axis=1))
    assert_array_equal(kicked, [*range(3, 13), *range(40, 50)])  # 1/K is ten ticks
    assert_allclose(np.abs(moved[kicked, :3] - own[kicked, :3]), 1e-3, rtol=1e-9)
    assert_array_equal(own[:, 7:], moved[:, 7:])


def test_a_window_is_a_period_of_the_slowest_oscillation(short):
    def of(**changes):
        return window(short.prepare(changes_of(changes)).scenario)

    assert of() == math.ceil(2 * math.pi / (10 * PERIOD)) | 1
    assert of(**{"control.feedback": 200.0}) == 5
    assert of(**{"control.feedback": 200.0, "plant.delay": 0.1}) == 43  # 4 (10 + 1/2) ticks


def test_without_feedback_there_is_no_loop(short):
    one = short.prepare(changes_of({"control.feedback": 0})).scenario
    with pytest.raises(ScenarioError) as error:
        rmrc.margins(one)
    assert str(error.value) == says("control.feedback: must be > 0, got 0: … feedback …")


@pytest.mark.parametrize("accuracy", [0.0, 0.001, 2.0, math.nan])
def test_the_accuracy_is_within_reason(accuracy):
    with pytest.raises(ScenarioError) as error:
        rmrc.margins("line_tracking", accuracy=accuracy)
    assert str(error.value) == f"--accuracy: must be between 0.005 and 0.5, got {accuracy:g}"


def test_what_was_found_is_kept_when_it_is_interrupted(short):
    rounds = []

    def interrupt(runs):
        rounds.append(runs)
        if len(rounds) == 2:
            os.kill(os.getpid(), signal.SIGINT)

    found = Asking(short.prepare().scenario, threads=1).run(interrupt)
    assert found.interrupted and found.is_stable and found.runs == sum(rounds)
    assert 1.0 <= found.gain.edge.low < found.gain.edge.high
    assert found.gain.edge.high > (1.0 + ACCURACY) * found.gain.edge.low
    assert "Interrupted" in " ".join(report(found).sheets[1].notes)


def test_the_kick_is_small_against_all_that_is_judged(short):
    """Twice or half the kick, the same edge: the loop answers it as a linear one does."""
    longer = resting(short.prepare(), 300)
    runs = short.step([longer, twin_of(longer, (0,), KICK), twin_of(longer, (0,), 2.0 * KICK)])
    q = [ran.run["q"] for ran in runs]
    assert_allclose(q[2] - q[0], 2.0 * (q[1] - q[0]), atol=1e-5 * KICK)


def test_a_law_that_never_looks_bears_any_delay_and_the_answer_says_why(short):
    # By (113) only the law's own sum is fed back, without dead time: its edge is K T = 2.
    blind = short.prepare(changes_of({"plant.delay": 0.04, "control.state": "integrated"})).scenario
    found = Asking(blind, threads=1).run()
    assert found.is_stable and found.delay.edge.high == math.inf
    assert_allclose(10.0 * found.gain.edge.value, 2.0 / PERIOD, rtol=0.02)
    assert "gets no feedback from the plant" in " ".join(report(found).sheets[1].notes)
