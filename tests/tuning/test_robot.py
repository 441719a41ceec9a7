"""Robots that are told, published or assumed: what their scenarios have, what is asked of them, what is said."""

import math

import numpy as np
import pytest

from project import ROOT
from rmrc.textbook.stability import edge_gain
from rmrc.tuning.robot import DELAY, GAIN_MARGIN, LAG, LOOPS, NOISE, read_range
from rmrc.tuning.trials import Trials
from rmrc.tuning.tune import Tuning

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [30 deg, -60 deg]}}
task: {{axes: [x, y]}}
control: {{period: 0.004, feedback: 5, limits: {{rate: 2.0}}}}
target: {{path: [{{line: {{to: [1.9, 0.0]}}}}], limits: {{velocity: 0.5}}}}
plant: {{kind: servo, timestep: 0.004}}
"""
FEW = [
    "control.inverse.method=damped",
    "control.inverse.damping.schedule=constant",
    "control.at_singularity=damp",
]


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "quick.yaml"
    path.write_text(TEXT)
    return path


@pytest.mark.parametrize(
    ("given", "unit", "wanted"),
    [
        ("8ms", "s", (0.008, 0.008)), ("6ms..12ms", "s", (0.006, 0.012)),
        ("0..10 ms", "s", (0.0, 0.01)), ((0, 0.01), "s", (0.0, 0.01)), ("1e-5", "rad", (1e-5, 1e-5)),
        ("0..0.01deg", "rad", (0.0, math.radians(0.01))), ("0.2%", "1", (0.002, 0.002)),
        (("6ms", "12 ms"), "s", (0.006, 0.012)),
    ],
)  # fmt: skip
def test_a_range_is_read_with_its_unit(given, unit, wanted):
    assert read_range(given, unit) == pytest.approx(wanted, rel=1e-15)


def changed(variants):
    return [{".".join(map(str, it.key)): it.value for it in variant.changes} for variant in variants]


def test_perturbed_scenarios_are_on_the_slowest_the_quickest_and_drawn_loops(path):
    robot = {"delay": "6ms..12ms", "lag": 0.01, "noise": (0.0, 1e-4)}
    worlds = changed(Tuning(path, **robot, perturbed=6).scenarios)
    delays = [world["plant.delay"] for world in worlds]
    assert (delays[0], delays[1], delays[2], delays[4], delays[6]) == (0.012, 0.006, 0.012, 0.012, 0.012)
    assert all(0.006 < delays[i] < 0.012 for i in (3, 5))
    assert {world["plant.lag"] for world in worlds} == {0.01}
    assert [world["arm.encoder.noise"] for world in worlds[:2]] == [1e-4, 0.0]


def test_a_calibration_is_off_in_links_and_zeros_to_either_side(path):
    off = ["plant.joint_offset=[0.1, -0.2]"]
    worlds = changed(Tuning(path, off, delay=0.008, calibration=0.002, perturbed=8).scenarios)
    assert "plant.stretch" not in worlds[0]
    factors = np.array([[*world["plant.stretch"].values()] for world in worlds[1:]])
    zeros = np.array([world["plant.joint_offset"] for world in worlds[1:]]) - [0.1, -0.2]
    for values in (factors - 1.0, zeros):
        assert np.abs(values).max() <= 0.002
        assert values.min() < -0.0005 and values.max() > 0.0005


def test_what_nobody_tells_is_assumed_and_what_anybody_tells_is_not(path):
    assumed = Tuning(path).robot
    assert assumed.ranges == {"delay": (0.0, DELAY), "lag": (0.0, LAG), "noise": (NOISE, NOISE)}
    assert assumed.origin == "assumed"
    slow = Tuning(path, ["control.period=0.008", "plant.timestep=0.004"]).robot
    assert slow.ranges["delay"] == (0.0, 0.016)  # two periods
    for told in ("plant.delay=0.004", "arm.encoder.noise=1.0e-6", "tune.lag=0.01", "plant.loss=0.01"):
        assert not Tuning(path, [told]).robot.origin
    section = Tuning(path, ["tune={delay: [0.006, 0.012], calibration: 0.001}"]).robot
    assert (section.ranges, section.calibration) == ({"delay": (0.006, 0.012)}, 0.001)
    # an option wins over the section
    both = Tuning(path, ["tune.delay=[0.006, 0.012]"], delay="1ms").robot
    assert both.ranges["delay"] == (0.001, 0.001)
    ideal = Tuning(path, ["tune.delay=0.01"], ideal=True)
    assert (ideal.robot.words, ideal.options.margin, changed(ideal.scenarios)[0]) == ("", 1.0, {})
    # what the scenario cannot have is left out: no command would arrive before the end
    short = Tuning(path, ["target.path=[{hold: {for: 0.004}}]"], only=["control.inverse.method=damped"])
    assert "delay" not in short.robot.ranges and any("plant.delay" in reason for reason in short.left_out)


def test_the_scenario_itself_is_run_on_loops_from_the_quickest_up_to_the_slowest(path):
    work = Tuning(path, delay="6ms..12ms", lag=(0.0, 0.006), noise=1e-5)
    loops, slowest = changed(work.loops), changed(work.scenarios)[0]
    assert all(loop.keys() == slowest.keys() for loop in loops)  # nothing else differs
    delays, lags = ([loop[key] for loop in (*loops, slowest)] for key in ("plant.delay", "plant.lag"))
    assert delays == pytest.approx(np.linspace(0.006, 0.012, LOOPS + 1))
    assert lags == pytest.approx(np.linspace(0.0, 0.006, LOOPS + 1))
    assert Tuning(path, delay="8ms").loops == ()


def test_feedback_is_tried_up_to_the_edge_of_the_loop(path):
    edge = edge_gain(0.004, 0.012, 0.005) / GAIN_MARGIN
    tuned = Tuning(path, perturbed=0, runs=30, only=FEW, delay="6ms..12ms", lag="5ms").run()
    largest = max(trial.setting.feedback for trial in tuned.tried[1:])
    assert 0.6 * edge < largest <= float(f"{edge:.3g}")


def test_the_worst_of_the_loops_counts(path):
    tuned = Tuning(path, delay="2ms..12ms", perturbed=2, runs=60, only=FEW).run()
    best = tuned.verdict.recommended
    assert {0, 1, 2} <= best.outcomes.keys()
    assert best.worst.error == max(outcome.error for outcome in best.outcomes.values())
    assert best.outcomes[1].error < best.outcomes[0].error  # the quick loop is not the hard one


def test_what_breaks_a_limit_on_a_loop_between_is_not_recommended(path, monkeypatch):
    # no world shows it: what the search comes to first may rest at a singularity and leave it on another branch
    options = {"delay": "2ms..12ms", "perturbed": 1, "runs": 60, "only": FEW, "threads": 1}
    first = Tuning(path, **options).run().verdict.recommended
    run = Trials.run

    def breaks(trials, jobs, ends=None):
        outcomes = run(trials, jobs, ends)
        return [
            outcome._replace(excess=0.1) if setting == first.setting and world in trials.loops else outcome
            for (setting, world), outcome in zip(jobs, outcomes, strict=True)
        ]

    monkeypatch.setattr(Trials, "run", breaks)
    tuned = Tuning(path, **options).run()
    (broken,) = (trial for trial in tuned.tried if trial.setting == first.setting)
    assert broken not in tuned.feasible and broken.outcomes[0].excess <= 0.0
    best = tuned.verdict.recommended
    assert best.setting != first.setting and best.worst.error >= first.worst.error
    assert len(best.outcomes) == 2 + LOOPS and best.worst.excess <= 0.0
