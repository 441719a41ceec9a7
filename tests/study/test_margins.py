"""Margins: the edges that runs find, against equations and against plain runs; and what is no instability."""

import math
import threading

import numpy as np
import pytest
from numpy.testing import assert_allclose

import rmrc
from project import ROOT
from rmrc.scenario import changes_of, draft_of, load, loads
from rmrc.study.margins import ACCURACY, STILL_RINGS, bears, judged, still_ringing
from rmrc.study.margins_report import report
from rmrc.study.study import Study
from rmrc.textbook.stability import edge_gain
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
    return judged(study.prepare(changes_of(changes)), threading.Event())


def margins_of(study, changes, **how):
    return rmrc.margins(study.prepare(changes_of(changes)).scenario, **how)


# The edges -----------------------------------------------------------------------------------------


def test_the_edge_of_the_ideal_plant_is_that_of_the_equation_between_ticks_and_with_a_lag(short):
    late = [(0.0, 0.0), (1.0, 0.0), (5.0, 0.0), (0.5, 0.0), (2.7, 0.0), (1.0, 1.5), (0.6, 8.0), (4.0, 4.0)]
    settings = [{"plant.delay": PERIOD * d, "plant.lag": PERIOD * lag} for d, lag in late]
    edges = [margins_of(short, changes).gain for changes in settings]
    # 2 sin(π/(2 (2 d + 1)))/T for d whole ticks without a lag
    wanted = [edge_gain(PERIOD, PERIOD * d, PERIOD * lag) for d, lag in late]
    assert_allclose(wanted[:3], [2.0 * math.sin(math.pi / (4 * d + 2)) / PERIOD for d in (0, 1, 5)])
    assert_allclose([10.0 * edge.value for edge in edges], wanted, rtol=0.02)
    assert all(1.0 < edge.high / edge.low <= 1.0 + ACCURACY for edge in edges)


def test_the_same_dead_time_can_be_added_as_the_equation_says(short):
    for own in (0.0, 0.04):
        found = margins_of(short, {"plant.delay": own}, accuracy=0.04, threads=1)
        assert found.is_stable
        assert_allclose(own + found.delay.value + PERIOD / 2, own + found.delay.ideal + PERIOD / 2, rtol=0.02)
        # π/2/K is the dead time of a loop without a period
        assert_allclose(own + found.delay.ideal + PERIOD / 2, math.pi / 20.0, rtol=0.01)
        assert (found.lag.high == math.inf) == (found.lag.ideal == math.inf)


def late_swings(scenario, feedback):
    """Return how far joints swing between neighbors in the last fifth of a plain run."""
    run = rmrc.run(scenario.set({"control.feedback": feedback}))
    q = run["q"][-len(run) // 5 :]
    return math.inf if run.divergence else np.abs(np.diff(q, 3, axis=0)).max()


def test_the_edge_of_a_servo_parts_plain_runs_that_settle_from_those_that_swing():
    """A plain run alone: at rest behind its path, the arm is still, or swings from tick to tick."""
    one = loads(TEXT).set(
        {
            "plant.kind": "servo", "plant.delay": 0.03, "plant.timestep": 0.002, "control.period": 0.002,
            "control.inverse.method": "damped",
            "target.path": [{"line": {"by": [0.05, 0.0]}}, {"hold": {"for": 4.0}}],
        }
    )  # fmt: skip
    edge = rmrc.margins(one).gain
    assert edge.is_found
    stable, unstable = (late_swings(one, 10.0 * edge.value * share) for share in (0.85, 1.2))
    assert unstable > 20.0 * stable


def test_a_loop_bears_so_many_times_its_feedback_up_to_the_edge_of_the_equation(short):
    edge = edge_gain(PERIOD, 0.03)
    # the last two are judged with a quarter of the edge first, and have nothing to show as they are
    shares = {0.45: True, 0.55: False, 0.3: True, 0.01: True, 0.05: True}
    settings = [changes_of({"plant.delay": 0.03, "control.feedback": share * edge}) for share in shares]
    assert bears(short, settings, 2.0) == bears(short, settings, 2.0, threads=2) == [*shares.values()]
    # a lag that nobody knows of: not even the quarter is stable, and the loop itself decides
    slow = {"plant.kind": "servo", "plant.timestep": 0.01, "plant.kv": 0.05, "control.feedback": 0.01 * edge}
    twice = judge(short, **slow | {"control.feedback": 0.02 * edge})
    assert bears(short, [changes_of(slow)], 2.0) == [not twice.is_unstable]


# Unstable as written -------------------------------------------------------------------------------


def test_a_loop_that_is_unstable_as_written_is_told_by_how_much_its_gain_must_fall(short):
    found = margins_of(short, {"plant.delay": 0.05, "control.feedback": 60.0}, threads=1)
    assert not found.is_stable and found.written.reason == "rings"
    assert found.delay is None and found.lag is None
    assert_allclose(60.0 * found.gain.value, edge_gain(PERIOD, 0.05), rtol=0.02)
    assert not report(found).met
    assert report(found).problem == says(
        "the loop is unstable as written: it keeps ringing … up to … times its 60 1/s …"
    )


def test_what_was_recommended_without_delay_is_unstable_with_eight_milliseconds():
    study = Study(draft_of("approach_singularity", ["target.path[0].line.to=[1.995, 0]"]))
    law = {"control.inverse.damping.maximum": 0.0281, "control.inverse.damping.below": 0.0625}
    settings = [changes_of({**law, "control.feedback": gain}) for gain in (200.0, 100.0)]
    assert bears(study, settings, 2.0) == [True, True]
    late = [(*one, *changes_of({"plant.delay": 0.008})) for one in settings]
    assert bears(study, late, 1.0) == [False, True] and bears(study, late, 2.0) == [False, False]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"control.feedback": 500.0, "control.limits.rate": 1.0}, "reverses"),  # swallows the kick
        ({"control.feedback": 250.0, "control.limits.on_excess": "none"}, "rings"),
        ({"control.feedback": 1e12, "control.limits.on_excess": "none"}, "diverged"),
    ],
)
def test_it_is_unstable_whatever_hides_the_kick(short, changes, reason):
    found = judge(short, **changes)
    assert found.is_unstable and reason in (found.reason, "rings", "reverses")
    assert (found.remainder == math.inf) == (reason == "diverged")


# What is none --------------------------------------------------------------------------------------


# Where worlds and their twins part: at a stop, a limit, or a singularity.
@pytest.mark.parametrize("name", ["at_the_stop", "blow_up", "beyond_reach"])
def test_scenarios_are_stable_as_they_are_written(name):
    assert judge(Study(name)).reason == ""


def test_with_eight_milliseconds_a_shipped_scenario_bears_about_what_the_equations_say():
    found = rmrc.margins(load(ROOT / "scenarios/line_tracking.yaml", ["plant.delay=0.008"]))
    assert found.is_stable and len(found.all) == 3 and report(found).met
    for edge in found.all:
        assert 0.0 < edge.low < edge.high and edge.low <= edge.bound * (1 + 1e-9)
        # Limits and servos take little of what the ideal plant bears.
        assert edge.low >= 0.9 * edge.rule
        assert edge.high <= 1.1 * edge.ideal or edge.high == math.inf


T = np.arange(3000)


@pytest.mark.parametrize(
    ("swings", "rings"),
    [
        (np.sin(0.3 * T), True),
        (1e-3 * np.exp(0.004 * T) * np.sin(0.3 * T), True),
        (np.exp(-0.004 * T) * np.sin(0.3 * T), False),
        (np.exp(-0.00003 * T) * np.sin(0.3 * T), True),  # fades so slowly that nobody waits for it
        (np.exp(0.004 * T), False),  # parts, as past a singularity, and does not swing
        (np.where(T < 2000, 200.0, np.where(T < 2700, 50.0, 40.0)) * np.sin(0.3 * T), True),  # no response to a kick
        (0.002 * np.sin(0.3 * T), False),  # what rounding or a last digit leaves
        (np.where(T < 1000, 0.1, 100.0 * np.exp(-0.004 * (T - 1000.0))) * np.sin(0.3 * T), False),
        (np.where(T < 1000, 100.0 * np.exp(-0.01 * T), 1e-2 * np.exp(0.004 * (T - 1000.0))) * np.sin(0.3 * T), True),
    ],
    ids=["endless", "grows", "fades", "fades slowly", "parts", "alone", "rounding", "a stop, fades", "grows late"],
)  # fmt: skip
def test_what_is_called_ringing(swings, rings):
    assert (still_ringing(np.column_stack([np.zeros(3000), swings])) >= STILL_RINGS) == rings


# Mistakes, Ctrl-C, and a law without feedback ------------------------------------------------------


def test_a_law_that_never_looks_bears_any_delay_and_the_answer_says_why(short):
    # By (113) only the law's own sum is fed back, without dead time: its edge is K T = 2.
    found = margins_of(short, {"plant.delay": 0.04, "control.state": "integrated"})
    assert found.is_stable and found.delay.high == math.inf
    assert_allclose(10.0 * found.gain.value, 2.0 / PERIOD, rtol=0.02)
    assert "gets no feedback from the plant" in " ".join(report(found).sheets[1].notes)
