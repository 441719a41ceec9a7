"""Robots that are told, published or assumed: what their scenarios have, what is asked of them, what is said."""

import dataclasses
import math
import threading

import numpy as np
import pytest

from project import ROOT
from rmrc.scenario.profile import load_profile
from rmrc.study.margins.margins import bears
from rmrc.study.study import Study
from rmrc.support.errors import ScenarioError
from rmrc.textbook.stability import edge_gain
from rmrc.tuning import report
from rmrc.tuning.perturbed import LOOPS
from rmrc.tuning.robot import DELAY, GAIN_MARGIN, LAG, NOISE, read_range
from rmrc.tuning.space import FEEDBACK, Setting, Structure
from rmrc.tuning.trials import Trials
from rmrc.tuning.tune import Tuning
from wording import says

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
        ("8ms", "s", (0.008, 0.008)), ("6ms..12ms", "s", (0.006, 0.012)), ("6..12ms", "s", (0.006, 0.012)),
        ("0..10 ms", "s", (0.0, 0.01)), ("0.006..0.012", "s", (0.006, 0.012)), ("0.5ms..0.01s", "s", (5e-4, 0.01)),
        (0.008, "s", (0.008, 0.008)), ((0, 0.01), "s", (0.0, 0.01)), ("1e-5", "rad", (1e-5, 1e-5)),
        ("0..0.01deg", "rad", (0.0, math.radians(0.01))), ("0.2%", "1", (0.002, 0.002)),
    ],
)  # fmt: skip
def test_a_range_is_read_with_its_unit(given, unit, wanted):
    assert read_range(given, unit) == pytest.approx(wanted, rel=1e-15)


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"delay": "12ms..6ms"}, "--delay: … >= 0 … smallest first … 12ms..6ms"),
        ({"delay": "-1ms"}, "--delay: … >= 0 … -1ms"),
        ({"delay": "8"}, "--delay: … less than 1 s … 8: write 8ms or 8s"),
        ({"lag": "5 mm"}, "--lag: … 8ms or 6ms..12ms … 5 mm … s"),
        ({"lag": "6ms.."}, "--lag: … 8ms or 6ms..12ms … 6ms.. …"),
        ({"noise": "nan"}, "--noise: … 1e-5 … nan …"),
        ({"noise": "1ms"}, "--noise: … 1e-5 … 1ms … rad"),
        ({"calibration": -0.1}, "--calibration: … >= 0 … -0.1"),
    ],
)
def test_a_range_that_is_none_is_a_line(path, given, line):
    with pytest.raises(ScenarioError) as caught:
        Tuning(path, robot=given)
    assert str(caught.value).splitlines() == [says(line)]


def test_the_ideal_loop_takes_no_robot_beside(path):
    with pytest.raises(ScenarioError) as caught:
        Tuning(path, robot={"delay": "8ms"}, ideal=True)
    assert str(caught.value).splitlines() == [says("--ideal: … --delay …")]


def changed(work):
    return [
        {".".join(map(str, change.key)): change.value for change in copy.changes} for copy in work.scenarios
    ]


def test_copies_are_on_the_slowest_the_quickest_and_drawn_loops(path):
    work = Tuning(path, robot={"delay": "6ms..12ms", "lag": 0.01, "noise": (0.0, 1e-4)}, perturbed=6)
    delays = [one["plant.delay"] for one in changed(work)]
    assert (delays[0], delays[1], delays[2], delays[4], delays[6]) == (0.012, 0.006, 0.012, 0.012, 0.012)
    assert all(0.006 < delays[i] < 0.012 for i in (3, 5))
    assert {one["plant.lag"] for one in changed(work)} == {0.01}
    noises = [one["arm.encoder.noise"] for one in changed(work)]
    assert noises[0] == 1e-4
    assert noises[1] == 0.0
    assert len(set(noises)) == 4
    assert work.robot.words == "delay 6 to 12 ms, lag 10 ms, encoder noise 0 to 0.0001 rad"
    assert work.margin == GAIN_MARGIN
    assert Tuning(path, robot={"delay": 0.01}, gain_margin=1.5).margin == 1.5
    assert Tuning(path, ideal=True).margin == 1.0


def test_a_calibration_is_off_in_links_and_zeros_to_either_side(path):
    work = Tuning(path, robot={"delay": 0.008, "calibration": 0.002}, perturbed=8)
    assert "plant.stretch" not in changed(work)[0]
    factors = np.array([[*one["plant.stretch"].values()] for one in changed(work)[1:]])
    zeros = np.array([one["plant.joint_offset"] for one in changed(work)[1:]])
    for values in (factors - 1.0, zeros):
        assert values.shape == (8, 2)
        assert np.abs(values).max() <= 0.002
        assert values.min() < -0.0005
        assert values.max() > 0.0005
    assert set(changed(work)[1]["plant.stretch"]) <= set(work._nominal.arm.body_names)


def test_what_nobody_tells_is_assumed_and_what_anybody_tells_is_not(path):
    assumed = Tuning(path).robot
    assert dataclasses.astuple(assumed)[:3] == ((0.0, DELAY), (0.0, LAG), (NOISE, NOISE))
    assert assumed.is_assumed
    slow = Tuning(path, ["control.period=0.008", "plant.timestep=0.004"]).robot
    assert slow.delay == (0.0, 0.016)  # two periods
    for told in (
        ["plant.delay=0.004"],
        ["plant.lag=0.004"],
        ["arm.encoder.noise=1.0e-6"],
        ["tune.lag=0.01"],
        ["plant.loss=0.01"],
        ["plant.resonance.frequency=20.0"],
    ):
        assert not Tuning(path, told).robot.is_assumed
    block = Tuning(path, ["tune={delay: [0.006, 0.012], noise: 0.001 deg, calibration: 0.001}"]).robot
    assert (block.delay, block.lag, block.calibration) == ((0.006, 0.012), None, 0.001)
    assert block.noise == pytest.approx((math.radians(0.001),) * 2)
    # an option wins over the section
    both = Tuning(path, ["tune.delay=[0.006, 0.012]"], robot={"delay": "1ms"}).robot
    assert both.delay == (0.001, 0.001)
    ideal = Tuning(path, ["tune.delay=0.01"], ideal=True)
    assert ideal.robot.words == ""
    assert changed(ideal)[0] == {}


def test_a_profile_tells_of_the_loop():
    scenario = ROOT / "scenarios/ur5e_wrist.yaml"
    robot = Tuning(scenario, ["control.limits.profile=ur5e", "control.period=0.002"], perturbed=0).robot
    assert robot.delay == tuple(load_profile("ur5e").loop.delay.value)
    assert (robot.profile, robot.is_assumed) == ("ur5e", False)


def test_what_the_scenario_cannot_have_is_not_assumed_and_told(path):
    work = Tuning(path, ["target.path=[{hold: {for: 0.004}}]"], only=["control.inverse.method=damped"])
    assert work.robot.delay is None and work.robot.noise  # no command would arrive before the end
    assert work.robot.is_assumed
    assert any("plant.delay" in reason for reason in work.left_out)


@pytest.mark.long
def test_feedback_is_tried_up_to_the_edge_of_the_loop(path):
    fine = ["control.period=0.001", "plant.timestep=0.001"]
    found = Tuning(
        path, fine, robot={"delay": "6ms..12ms", "lag": "5ms"}, perturbed=0, runs=12, only=FEW
    ).run()
    assert found.bounds[FEEDBACK][1] == pytest.approx(edge_gain(0.001, 0.012, 0.005) / GAIN_MARGIN)
    bare = Tuning(path, fine, robot={"delay": "12ms"}, gain_margin=1.0, perturbed=0, runs=12, only=FEW).run()
    assert bare.bounds[FEEDBACK][1] == pytest.approx(edge_gain(0.001, 0.012))
    assumed = Tuning(path, fine, perturbed=0, runs=12, only=FEW).run()
    assert assumed.bounds[FEEDBACK][1] == pytest.approx(edge_gain(0.001, DELAY, LAG) / GAIN_MARGIN)
    # without a loop it is five periods for 1/e, which the servos bear
    assert Tuning(path, ideal=True, perturbed=0, runs=12, only=FEW).run().bounds[FEEDBACK][1] == 0.2 / 0.004


@pytest.mark.long
def test_what_is_recommended_for_an_assumed_robot_bears_its_margin(path):
    # by the test of stability alone, for each that is feasible, and for some that are not
    fine = ["control.period=0.001", "plant.timestep=0.001"]
    work = Tuning(path, fine, perturbed=1, runs=160, only=FEW, threads=1)
    found = work.run()
    study = Study(work.scenario)

    def bear(some):
        return bears(study, [(*one.setting.changes, *work.scenarios[0].changes) for one in some], GAIN_MARGIN)

    assert found.feasible
    assert all(bear(found.feasible[::4]))
    assert found.margins["recommended"].gain.value >= GAIN_MARGIN  # which it has been tried with
    told = Tuning(
        path, fine, robot={"delay": (0.0, DELAY), "lag": (0.0, LAG)}, gain_margin=1.0, perturbed=1, runs=160,
        only=FEW,
    ).run()  # fmt: skip
    best = told.verdict.recommended
    assert best.feedback > 1.1 * found.verdict.recommended.feedback  # negative control: without the margin
    assert bear([best]) == [False]
    assert any("gain margin" in line for line in report.doubts(told))
    facts = dict(report.facts(work, found))
    assert facts["robot"].startswith("assumed: delay 0 to 8 ms, lag 0 to 5 ms, encoder noise 1e-05 rad")
    assert "--delay, --lag and --noise" in facts["robot"]


@pytest.mark.usefixtures("unmargined")
def test_a_number_at_its_search_bound_is_told(path):
    # the less damping the better, as no rate limit acts: the best is the least that is tried
    found = Tuning(
        path, ["control.limits.rate=20"], robot={"delay": "8ms"}, perturbed=0, runs=50, only=FEW
    ).run()
    best = found.verdict.recommended
    values = best.setting.values
    at = [key for key, (low, high) in found.bounds.items()
          if values.get(key) in (float(f"{low:.3g}"), float(f"{high:.3g}"))]  # fmt: skip
    said = [line for line in report.doubts(found) if "search bound" in line]
    assert sorted(line.split()[1] for line in said) == sorted(at) != []


def test_the_worst_of_the_loops_counts(path):
    found = Tuning(path, robot={"delay": "2ms..12ms"}, perturbed=2, runs=60, only=FEW).run()
    best = found.verdict.recommended
    assert found.margins["recommended"].is_stable
    assert all(one.gain.edge.low >= GAIN_MARGIN for one in found.margins.values())  # as they have been tried
    assert sorted(best.outcomes) == [0, 1, 2]
    assert best.worst.error == max(out.error for out in best.outcomes.values())
    assert best.outcomes[1].error < best.outcomes[0].error  # the quick loop is not the hard one


def test_the_scenario_itself_is_run_on_loops_from_the_quickest_up_to_the_slowest(path):
    work = Tuning(path, robot={"delay": "6ms..12ms", "lag": (0.0, 0.006), "noise": 1e-5})
    loops = [{".".join(map(str, change.key)): change.value for change in loop.changes} for loop in work.loops]
    slowest = changed(work)[0]
    assert all(loop.keys() == slowest.keys() for loop in loops)  # nothing else differs
    delays, lags = ([one[key] for one in (*loops, slowest)] for key in ("plant.delay", "plant.lag"))
    assert delays == pytest.approx(np.linspace(0.006, 0.012, LOOPS + 1))
    assert lags == pytest.approx(np.linspace(0.0, 0.006, LOOPS + 1))
    assert Tuning(path, robot={"delay": "8ms"}).loops == Tuning(path, ideal=True).loops == ()
    assert Tuning(path, robot={"delay": "6ms..12ms"}, perturbed=0).loops == ()  # the scenario alone, as asked


@pytest.mark.usefixtures("unmargined")
def test_what_breaks_a_limit_on_a_loop_between_is_not_recommended(path, monkeypatch):
    # no copy shows it: what the search comes to first may rest at a singularity and leave it on another branch
    work = {"robot": {"delay": "2ms..12ms"}, "perturbed": 1, "runs": 60, "only": FEW, "threads": 1}
    first = Tuning(path, **work).run().verdict
    between, asked = Trials.between, []

    def breaks(trials, settings):
        asked.extend(settings)
        found = between(trials, settings)
        return [out._replace(excess=0.1) if one == first.recommended.setting else out
                for one, out in zip(settings, found, strict=True)]  # fmt: skip

    monkeypatch.setattr(Trials, "between", breaks)
    found = Tuning(path, **work).run()
    assert first.recommended.between.excess <= 0.0  # negative control: by its own runs it is recommended
    (broken,) = (one for one in found.tried if one.setting == first.recommended.setting)
    assert broken not in found.feasible
    assert all(out.excess <= 0.0 for out in broken.outcomes.values())
    best = found.verdict.recommended
    assert best.setting in asked and best.between.excess <= 0.0
    assert best.worst.error >= first.recommended.worst.error


def test_a_stop_at_full_reach_that_copies_bear_saturates_drives_on_loops_between():
    # the elbow rests 1 mrad from straight: which way it turns as it leaves, and how hard, is a matter of less
    work = Tuning(ROOT / "scenarios/approach_singularity.yaml", robot={"delay": "6ms..12ms"})
    trials = Trials(Study(work.scenario), work.scenarios, 1, threading.Event(), None, loops=work.loops)
    stops = Setting(Structure("damped", "rate_bound", "stop"), (2.38, 5.07, 0.0231))
    tame = Setting(Structure("damped", "constant", "damp"), (0.05, 5.0))
    trials.allow([10.0] * len(work.scenarios))
    assert all(out.excess <= 0.0 for out in trials.run([(stops, copy) for copy in range(trials.scenarios)]))
    broken, kept = trials.between([stops, tame])
    assert broken.excess > 0.0 and "is at its limit for" in broken.missed
    assert kept.excess <= 0.0  # negative control
