"""A search: what it promises is what a run gives, the optimum is found, and mistakes are a line each."""

import dataclasses
import functools
import math
import os
import threading

import numpy as np
import pyarrow.parquet as pq
import pytest

import rmrc as package
from project import ROOT, mostly_long
from rmrc.cli.tune import _estimate
from rmrc.results.columns import Divergence
from rmrc.results.scorecard import Figure, scorecard
from rmrc.scenario import Variant, changes_of, draft_of, load
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.study.study import Result, Study
from rmrc.support.errors import ScenarioError
from rmrc.tuning import figure as tuning_figure
from rmrc.tuning import report
from rmrc.tuning import tables as tuning_table
from rmrc.tuning.bearing import Bearing
from rmrc.tuning.perturbed import Spread
from rmrc.tuning.search import Search
from rmrc.tuning.space import (
    FEEDBACK,
    NUMBERS,
    WORDS,
    Setting,
    Space,
    Structure,
    all_structures,
    meets_limits,
    own_setting,
)
from rmrc.tuning.trials import CHATTER, Limits, Outcome, Trials, worst
from rmrc.tuning.tried import Tried, best
from rmrc.tuning.tune import Tuning as AnyTuning
from rmrc.tuning.verdict import judge
from wording import says

# test_robot.py has them measured
pytestmark = pytest.mark.usefixtures("unmargined")

# From 60 deg of the elbow to 30 deg, in 40 ticks without physics.
TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [30 deg, -60 deg]}}
task: {{axes: [x, y]}}
control:
  period: 0.02
  inverse: {{method: damped, damping: {{schedule: constant, maximum: 0.3}}}}
  feedback: 2
  limits: {{rate: 2.0, on_excess: none}}
target: {{path: [{{line: {{to: [1.93, 0.0]}}}}], limits: {{velocity: 0.5}}}}
plant: {{kind: ideal}}
"""


# The loop as the scenario has it; test_robot.py has others.
Tuning = functools.partial(AnyTuning, ideal=True)


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "quick.yaml"
    path.write_text(TEXT)
    return path


def texts(made):
    """Return what makes a copy or a setting, as the command line takes it."""
    return [str(change) for change in made.changes]


def runs_of(path, overrides=()):
    (run,) = Simulation([prepare(load(path, overrides))]).run()
    return run


def measured(run, length=1.0):
    """Error, peak rate and duration, from the columns."""
    rows = [axis in run.axes for axis in ("x", "y", "z", "rx", "ry", "rz")]
    error = run["pose_error"] * rows
    largest = max(
        np.linalg.norm(error[:, :3], axis=1).max(), length * np.linalg.norm(error[:, 3:], axis=1).max()
    )
    rates = np.abs(run["qdot"]).max(axis=0) / np.where(run.is_slide, length, 1.0)
    return largest, rates.max(), len(run) * run.period


def test_what_is_pasted_is_what_was_run_and_the_worst_copy_counts(path, tmp_path):
    work = Tuning(path, perturbed=3, seed=5, runs=60, threads=1)
    found = work.run()
    best = found.verdict.recommended
    assert len(found.scenarios) == 4
    # the block takes the place of the section
    before, _, after = TEXT.partition("control:")
    pasted = tmp_path / "pasted.yaml"
    pasted.write_text(before + found.block + "target:" + after.partition("\ntarget:")[2])
    each = [measured(runs_of(pasted, texts(copy))) for copy in found.scenarios]
    # norms of numpy and of the scorecard differ by rounding; rates do not
    assert best.worst.error == pytest.approx(max(error for error, _, _ in each), rel=1e-14)
    assert best.worst.peak_rate == max(rate for _, rate, _ in each)
    assert best.worst.time == max(time for _, _, time in each)
    assert len({error for error, _, _ in each}) == 4  # negative control: the scenarios differ
    cards = [scorecard(runs_of(pasted, texts(copy))) for copy in found.scenarios]
    assert best.worst.error == max(card["position_error.max"].value for card in cards)
    # the numbers have the digits that are printed
    assert all(number == float(f"{number:.3g}") for one in found.tried for number in one.setting.numbers)
    # and so for every setting that was tried on all scenarios
    for one in found.feasible[::15]:
        cards = [scorecard(runs_of(path, (*texts(one.setting), *texts(copy)))) for copy in found.scenarios]
        assert [one.outcomes[i].error for i in range(4)] == [
            card["position_error.max"].value for card in cards
        ]


def test_the_files_hold_what_was_found_and_can_be_run(path, tmp_path):
    work = Tuning(path, perturbed=1, runs=50, threads=2)
    found = work.run()
    files = work.write(found, tmp_path / "deep/out")
    assert [file.name for file in files] == ["quick.tune.yaml", "quick.tune.png", "quick.tune.parquet"]
    best = found.verdict.recommended
    written = load(files[0])
    assert (written.name, written.arm.model) == ("quick-tuned", ROOT / "models/planar_2link.xml")
    assert measured(runs_of(files[0]))[1] == best.outcomes[0].peak_rate
    assert files[1].read_bytes()[:4] == b"\x89PNG"
    rows = pq.read_table(files[2]).to_pylist()
    assert [row["index"] for row in rows] == list(range(len(found.tried)))
    assert sum(row["scenarios"] for row in rows) == found.runs <= 50
    (recommended,) = [row for row in rows if row["role"] and "recommended" in row["role"]]
    assert (recommended["error"], recommended["feasible"]) == (best.worst.error, True)
    assert recommended["control.inverse.method"] == best.setting.structure.method
    assert rows[0]["role"].startswith("as written")
    assert {row["on_front"] for row in rows} == {True, False}


def test_threads_change_nothing_and_another_seed_does(path):
    one, two = (Tuning(path, perturbed=2, runs=24, threads=threads).run() for threads in (1, 2))
    assert [(a.setting, a.outcomes) for a in one.tried] == [(a.setting, a.outcomes) for a in two.tried]
    assert one.block == two.block
    other = Tuning(path, perturbed=2, runs=24, threads=2, seed=1).run()
    assert [a.setting for a in one.tried] != [a.setting for a in other.tried]
    assert one.scenarios[1:] != other.scenarios[1:]


def test_the_optimum_of_damping_and_feedback_is_that_of_a_fine_grid(path):
    # The less damping the smaller the error, and the higher the rates: the best damping is where they meet the limit.
    only = ["control.inverse.method=damped", "control.inverse.damping.schedule=constant",
            "control.at_singularity=damp"]  # fmt: skip
    limit = ["control.limits.rate=0.7"]
    found = Tuning(path, limit, only=only, perturbed=0, runs=120, threads=2).run()
    best = found.verdict.recommended
    study = Study(draft_of(path, limit))
    grid = [
        (damping, feedback)
        for damping in best.setting.numbers[0] * np.geomspace(0.3, 3.0, 17)
        for feedback in np.geomspace(1.0, 10.0, 12)
    ]
    key = "control.inverse.damping.maximum"
    worlds = [study.prepare(changes_of({key: d, "control.feedback": k})) for d, k in grid]
    simulation = Simulation(worlds, 2, keep_columns=False)
    simulation.step()
    cards = simulation.scorecards()
    # rates may be 1 % above, as the search has it
    able = [i for i, card in enumerate(cards) if card["joint_rate.peak"].value <= 0.7 * 1.01]
    least = min(cards[i]["position_error.max"].value for i in able)
    assert 0 < len(able) < len(grid)  # the limit does act
    # The grid's steps are 15 %, and the search ends with 1 %: it is as good or better, give or take 1 %.
    found_least = min(one.worst.error for one in found.feasible)
    assert 0.95 * least <= found_least <= 1.01 * least
    assert best.worst.error <= 1.02 * found_least  # of errors that are alike, the lowest rate
    # negative control: the scenario's own setting is far off
    assert found.own.worst.error > 1.1 * least


def test_a_search_of_a_scenario_object_is_that_of_its_file(path):
    only = {"only": ["control.at_singularity=damp"], "perturbed": 1, "runs": 20}
    by_file, by_object = Tuning(path, **only).run(), Tuning(load(path), **only).run()
    assert [(one.setting, one.outcomes) for one in by_file.tried] == [
        (one.setting, one.outcomes) for one in by_object.tried
    ]
    assert by_file.block == by_object.block


def test_the_best_within_limits_is_tried_where_a_limit_acts_and_where_it_is_asked_for(path):
    def tried(*only):
        found = Tuning(path, only=only, perturbed=0, runs=70).run()
        return {one.setting.structure.on_excess for one in found.tried if one is not found.own}

    assert tried() == {""}
    assert tried("control.limits.on_excess=optimal") == {"optimal"}
    statuses = {0.0: False, 1.0 * Status.DAMPED: False, 1.0 * (Status.DAMPED | Status.POSITION_LIMITED): True}
    for status, acts in statuses.items():
        assert meets_limits({"status": np.array([0.0, status])}) == acts
    with pytest.raises(ScenarioError) as refused:
        Tuning(path, only=["control.limits.on_excess=clamp"])
    assert str(refused.value) == says("--only control.limits.on_excess: … none … optimal …")


def test_only_what_is_allowed_is_chosen_and_the_setting_as_written_is_compared(path):
    only = ["control.inverse.method=jparse", "control.feedback=4,8", "control.at_singularity=damp"]
    found = Tuning(path, only=only, perturbed=0, runs=60).run()
    others = [one for one in found.tried if one is not found.own]
    assert {one.setting.structure for one in others} == {Structure("jparse", "", "damp")}
    assert {one.setting.numbers[1] for one in others} == {4.0, 8.0}
    assert found.own.setting.is_written
    assert found.own not in found.feasible
    assert found.verdict.second is None
    assert "damping" not in found.block


def test_limits_that_nothing_keeps_are_named(path):
    only = ["control.at_singularity=damp"]
    found = Tuning(path, ["control.limits.rate=0.01"], only=only, perturbed=1, runs=50).run()
    assert (found.feasible, found.block, found.verdict.front) == ((), "", ())
    nearest = found.verdict.nearest
    peak = nearest.worst.excess
    assert peak > 0
    assert all(one.worst.excess >= peak for one in found.tried if len(one.outcomes) == 2)
    assert nearest.worst.missed.endswith("and 0.01 is allowed")


def test_accelerations_are_held_against_their_limit(path):
    free = Tuning(path, perturbed=0, runs=40).run()
    bound = Tuning(path, ["control.limits.acceleration=1.5"], perturbed=0, runs=40).run()
    for found, limit in ((free, math.inf), (bound, 1.5)):
        for one in found.tried[::9]:
            run = runs_of(
                path,
                (
                    f"control.limits.acceleration={'null' if limit == math.inf else limit}",
                    *texts(one.setting),
                ),
            )
            peak = np.abs(np.diff(run["qdot"], axis=0)).max() / run.period
            rate = np.abs(run["qdot"]).max()
            # 1 % for overshoot, as the output says
            kept = peak <= 1.01 * limit and rate <= 1.01 * 2.0
            if run.completed == 1.0 and len(run) * run.period <= 1.1 * found.own.worst.time + 1e-9:
                assert one.keeps_limits == kept
    assert not all(one.keeps_limits for one in bound.tried)


def test_a_slide_counts_by_the_length_and_an_angle_times_it(tmp_path):
    text = f"""
name: slide
arm: {{model: {ROOT}/models/stanford.xml, site: wrist, start: [0, 90 deg, 0.7, -80 deg, 40 deg, 0]}}
task: {{length: 0.5}}
control: {{period: 0.01}}
target: {{path: [{{line: {{by: [0.05, 0.02, 0.1], turn: {{axis: z, angle: 10 deg}}}}}}]}}
plant: {{kind: ideal}}
"""
    path = tmp_path / "slide.yaml"
    path.write_text(text)
    work = Tuning(path, ["control.limits.rate=null"], perturbed=2, runs=60, threads=1)
    found = work.run()
    for one in [found.own, *found.feasible[::15]]:
        each = [measured(runs_of(path, (*texts(one.setting), *texts(copy))), 0.5) for copy in found.scenarios]
        for i, name in enumerate(("error", "peak_rate", "time")):
            assert getattr(one.worst, name) == pytest.approx(max(one[i] for one in each), rel=1e-12)
    starts = np.array([load(path, texts(copy)).arm.start for copy in found.scenarios[1:]])
    nominal = np.radians([0, 90, np.degrees(0.7), -80, 40, 0])
    off = np.abs(starts - nominal) / [1, 1, 0.5, 1, 1, 1]
    assert 0 < off.max() <= np.radians(1.0)
    # no axis of the task has an absolute point
    assert all(not any("target.offset" in text for text in texts(copy)) for copy in found.scenarios)


def test_copies_start_within_the_limits_of_the_joints(tmp_path):
    path = tmp_path / "quick.yaml"
    # the elbow of this arm ends at -160 deg
    path.write_text(TEXT.replace("-60 deg", "-159.9 deg").replace("to: [1.93, 0.0]", "by: [0.01, 0.0]"))
    work = Tuning(path, perturbed=8, runs=100)
    elbows = [load(path, texts(copy)).arm.start[1] for copy in work.scenarios]
    assert min(elbows) == pytest.approx(math.radians(-160), abs=1e-6)
    assert len(set(elbows)) > 4


def test_joints_that_are_not_driven_stay_where_the_scenario_has_them(tmp_path):
    links = "".join(
        f'<body pos="1 0 0"><joint name="{name}" axis="0 0 1"/><geom size="0.1"/>' for name in "abc"
    )
    keys = '<key name="home" qpos="0 0.5 -1"/><key name="away" qpos="0.7 0.5 -1"/>'
    (tmp_path / "arm.xml").write_text(
        f'<mujoco><worldbody>{links}<site name="tip" pos="1 0 0"/></body></body></body></worldbody>'
        f"<keyframe>{keys}</keyframe></mujoco>"
    )
    path = tmp_path / "quick.yaml"
    arm = "arm: {model: arm.xml, site: tip, joints: [b, c], start: START}"
    path.write_text(TEXT.replace(TEXT.split("\n")[2], arm).replace("to: [1.93, 0.0]", "by: [0.1, 0.0]"))
    with pytest.raises(ScenarioError) as caught:
        Tuning(path, ["arm.start=away"])
    assert str(caught.value).splitlines() == [says('--start: … 0 … arm.start "away" … not actuated … home')]
    assert Tuning(path, ["arm.start=away"], spread=Spread(0.0)).spread_in_words
    for copy in Tuning(path, ["arm.start=home"]).scenarios:
        assert prepare(load(path, ["arm.start=home", *texts(copy)])).qpos[0] == 0.0


def test_a_name_keeps_its_length_and_limits_of_slides_are_drawn_over_the_length(path, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(tuning_figure, "draw_front", lambda *arguments: drawn.append(arguments))
    arm = {"model": f"{ROOT}/models/planar_rp.xml", "site": "tip", "start": "home"}
    rail = [f"arm.{key}={value}" for key, value in arm.items()] + [
        "task.length=0.5",
        "control.limits.rate=[2, 3]",
    ]
    work = Tuning(
        path, [f"name={'x' * 100}", "target.path=[{line: {by: [0.1, 0.0]}}]", *rail], perturbed=0, runs=12
    )
    file, *_ = work.write(work.run(), tmp_path)
    assert load(file).name == "x" * 94 + "-tuned"
    ((name, *_, limits, _),) = drawn
    assert (name, limits) == ("x" * 100, [2.0, 6.0])


def test_an_arm_that_holds_still_has_a_picture_without_warnings(path, tmp_path):
    work = Tuning(path, ["target.path=[{hold: {for: 0.1}}]"], perturbed=0, runs=12)
    found = work.run()
    assert found.own.worst.point[:2] == (0.0, 0.0)
    assert len(work.write(found, tmp_path)) == 3  # warnings are errors here
    assert ("tried on", "the scenario alone") in report.facts(work, found)
    titles = [
        sheet.title for sheet in tuning_table.sheets("", [], report.front(found), report.named(found)[:1])
    ]
    assert titles[-1] == "Recommendations, and others"  # a table of no costs is none


def test_times_are_those_of_the_path_where_the_setting_as_written_does_not_complete_it(path):
    work = Tuning(path, perturbed=0, runs=12)
    found = work.run()
    assert (
        dict(report.facts(work, found))["time"]
        == "at most 1.1 times that of the setting as written, for each perturbed scenario"
    )
    found.own.outcomes[0] = found.own.outcomes[0]._replace(completed=0.5)
    own = Tried(found.own.setting, found.own.outcomes)
    assert dict(report.facts(work, dataclasses.replace(found, own=own)))["time"] == (
        "at most 1.1 times that of the setting as written, or of the path if that does not complete it, for each perturbed scenario"
    )


def test_a_slow_run_ends_when_the_scenario_says_so_or_when_it_takes_longer_than_allowed(path):
    # beyond reach, where "slow" stands still
    overrides = [
        "target.path=[{line: {to: [2.2, 0.0]}}]",
        "control.at_singularity=slow",
        "control.slow.longest=1.5",
    ]
    study = Study(draft_of(path, overrides))
    trials = Trials(study, [Variant("")], 1, threading.Event(), None)
    setting = Setting(Structure("pseudoinverse", "", "slow"), (2.0,))
    run = runs_of(path, [*overrides, *texts(setting)])
    assert run.completed < 1.0
    for share, same in ((1.2, False), (9.0, True)):
        trials.allow([share * trials.planned[0]])
        (outcome,) = trials.run([(setting, 0)])
        assert outcome.excess > 0
        assert (outcome.time == len(run) * run.period) == same


def test_times_are_measured_by_the_setting_as_written_or_by_the_path_where_it_does_not_complete_it(path):
    slow = [
        "target.path=[{line: {to: [2.2, 0.0]}}]",
        "control.at_singularity=slow",
        "control.inverse.method=pseudoinverse",
        "control.slow.longest=1.5",
    ]
    late = ["control.at_singularity=stop", "control.stop.sigma=50"]
    for overrides in (slow, late, []):
        run = runs_of(path, overrides)
        trials, allowed = (
            Trials(Study(draft_of(path, overrides)), [Variant("")], 1, threading.Event(), None),
            [],
        )
        trials.allow = allowed.extend
        own = own_setting(load(path, overrides))
        assert Search(None, trials, 9, 0).begin(own, 1.1)
        assert (run.completed < 1.0) == (overrides is slow)
        assert allowed == [1.1 * (trials.planned[0] if overrides is slow else len(run) * run.period)]


def test_each_copy_has_its_own_time(path):
    trials = Trials(Study(draft_of(path)), [Variant("")] * 2, 1, threading.Event(), None)
    trials.allow([0.001, 100.0])
    setting = Setting(Structure("damped", "constant", "damp"), (0.1, 2.0))
    short, long = trials.run([(setting, 0), (setting, 1)])
    assert long.excess <= 0 < short.excess


@pytest.mark.parametrize(
    "vary", mostly_long(["arm: [{model: MODEL, site: tip, start: home}]", "arm.model: [MODEL]"], 2)
)
@pytest.mark.usefixtures("undrawn")
def test_the_models_of_a_sweep_are_found_from_elsewhere(tmp_path, vary):
    model = ROOT / "models/planar_2link.xml"
    path = tmp_path / "arms.yaml"
    text = f"{TEXT}sweep: {{vary: {{{vary}}}}}\n".replace(str(model), "MODEL")
    path.write_text(text.replace("MODEL", os.path.relpath(model, tmp_path)))
    work = Tuning(path, perturbed=0, runs=12)
    file, *_ = work.write(work.run(), tmp_path / "else/where")
    assert load(file).arm.model == model
    assert draft_of(file).models == [os.path.relpath(model, tmp_path / "else/where")]


def test_what_is_drawn_is_within_its_bounds_and_moves_the_target(path):
    spread = Spread(0.0, 0.01, 0.0)
    scenarios = Tuning(path, perturbed=4, spread=spread).scenarios
    offsets = np.array([load(path, texts(copy)).target.offset for copy in scenarios])
    assert np.abs(offsets).max() <= 0.01
    assert (offsets[1:, :2] != 0).all()
    assert (offsets[:, 2] == 0).all()  # z is no axis of the task
    loaded = Tuning(path, ["plant.kind=servo", "control.period=0.002", "plant.timestep=0.002", "plant.payload=3"],
                    spread=Spread(0.0, 0.0, 2.0), perturbed=4).scenarios  # fmt: skip
    assert "payload up to 2 kg more" in Tuning(path, ["plant.kind=servo", "control.period=0.002", "plant.timestep=0.002"],
                                               spread=Spread(payload=2.0)).spread_in_words  # fmt: skip
    # a line to a point does not count where only the hand's angle does
    turning = Tuning(path, ["task.axes=[rz]"])
    assert all("target.offset" not in text for copy in turning.scenarios for text in texts(copy))
    assert turning.spread_in_words == (
        "joints start within 1 deg; no target offset, because the task has no absolute point"
    )
    further = Tuning(path, ["target.offset=[0.5, 0.25]"], perturbed=2, spread=spread).scenarios[1:]
    offsets = [load(path, texts(copy)).target.offset for copy in further]
    assert (np.abs(np.array(offsets) - [0.5, 0.25, 0.0]).max(axis=0) <= [0.01, 0.01, 0.0]).all()
    masses = [float(texts(copy)[0].removeprefix("plant.payload=")) for copy in loaded[1:]]
    assert all(3 <= mass <= 5 for mass in masses)
    assert len(set(masses)) == 4


@pytest.mark.parametrize(
    ("options", "lines"),
    [
        ({"spread": Spread(payload=1.0)}, ["--payload: … 0 … ideal … plant.kind"]),
        ({"perturbed": -1, "slower": 0.9, "runs": 1, "seed": -2, "threads": -1, "spread": Spread(-1.0, math.nan, -1.0)}, [
            "--perturbed: … 0 … -1", "--seed: … 0 … -2", "--start: … 0 … -1", "--offset: … 0 … nan",
            "--payload: … 0 … -1", "--slower: … 1 … 0.9", "--threads: … 1 … -1"]),
        ({"runs": 9}, ["--runs: … 10 … 9"]),
        ({"only": ["control.feedback"]},
         ["--only control.feedback: … KEY=V1,V2,... … control.inverse.method=damped,filtered"]),
        ({"only": ["control.period=0.1"]}, ["--only control.period: … " + ", ".join((*WORDS, *NUMBERS))]),
        ({"only": ["control.fedback=1"]}, ["--only control.fedback: … " + ", ".join((*WORDS, *NUMBERS))]),
        ({"only": ["control.at_singularity=dampen", "control.feedback=x", "control.inverse.gamma=1", "control.inverse.gamma=1"]}, [
            '--only control.at_singularity: … damp, slow, stop … dampen … "damp"…',
            "--only control.feedback: … numbers … x", "--only control.inverse.gamma: … twice"]),
        ({"only": ["control.inverse.gamma=0.5,1.5"]}, ["--only control.inverse.gamma: … 1 … 1.5"]),
        ({"only": ["control.at_singularity=slow"], "overrides": ["control.feedforward=false"]},
         ['--only control.at_singularity: "slow" … control.feedforward: true … false']),
        ({"overrides": ["control.feedback=-1"]}, ["--set control.feedback: … 0 … -1"]),
    ],
)  # fmt: skip
def test_a_mistake_is_a_line_before_anything_is_run(path, options, lines):
    overrides = options.pop("overrides", ())
    with pytest.raises(ScenarioError) as caught:
        Tuning(path, overrides, **options)
    assert str(caught.value).splitlines() == list(map(says, lines))


def test_what_the_scenario_cannot_have_is_left_out_and_told(path):
    work = Tuning(path, ["task.axes=[x]"])
    assert list(work.left_out) == [says('control.inverse.method: "inverse" … 1 … 2 …')]


def test_a_copy_that_cannot_be_is_told_by_its_name(path):
    with pytest.raises(ScenarioError) as caught:  # a target that is a million kilometers off
        Tuning(path, perturbed=2, spread=Spread(0.0, 1e9, 0.0))
    wanted = "perturbed scenario {} (target.offset=[…]): {}:…: target.path: … s … 0.02 s … 10000000; … target.limits or control.period …"
    assert str(caught.value).splitlines() == [says(wanted.format(i, path)) for i in (1, 2)]


# A hinge and a slide on a task of 0.5 m.
LIMITS = Limits(
    ("arm", "rail"), ("rad", "m"), np.array([1.0, 0.5]), 0.5, np.array([2.0, 1.0]), np.array([math.inf, 4.0]),
    np.array([100.0, math.inf]),
)  # fmt: skip
GOOD = {"position_error.max": 0.1, "orientation_error.max": 0.3, "joint_rate.arm.peak": 1.5, "joint_rate.rail.peak": 0.9,
        "joint_acceleration.rail.peak": 2.0, "duration": 3.0, "completed": 1.0, "chatter": 0.0, "chatter_joint": "arm",
        "joint_acceleration_cmd.rms": 1.2, "joint_jerk_cmd.peak": 50.0, "joint_jerk_cmd.peak_joint": "arm",
        "torque_limited.time": 0.0, "torque_limited.first_joint": "arm", "profile.refused": math.nan,
        "profile.first_condition": "jerk"}  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "divergence", "excess", "missed"),
    [
        ({}, None, 3.0 / 3.3 - 1, "it takes 3 s, and 3.3 is allowed"),
        ({"joint_rate.arm.peak": 2.019}, None, 2.019 / 2.02 - 1, "the rate of arm is 2.019 rad/s, and 2 is allowed"),
        ({"joint_rate.rail.peak": 1.011}, None, 1.011 / 1.01 - 1, "the rate of rail is 1.011 m/s, and 1 is allowed"),
        ({"joint_acceleration.rail.peak": 8.08}, None, 1.0,
         "the acceleration of rail is 8.08 m/s², and 4 is allowed"),
        ({"duration": 6.6}, None, 1.0, "it takes 6.6 s, and 3.3 is allowed"),
        ({"completed": 0.8}, None, 0.25, "80% of the path is completed in 3 s"),
        ({"joint_jerk_cmd.peak": 202.0}, None, 1.0, "the commanded jerk of arm is 202 rad/s³, and 100 is allowed"),
        ({"chatter": 15.0}, None, 2.0, f"the acceleration of arm changes its sign 15 times per second, and {CHATTER:g}"),
        ({"torque_limited.time": 0.06}, None, 1.0, "the actuator of arm is at its limit for 0.06 s, and 0.03 is allowed"),
        ({"profile.refused": 2.0}, None, 2.0, "the profile refuses 2 commands, the first for the jerk"),
        ({}, Divergence(1, 0.1, "rail", "not finite"), math.inf, "it diverged"),
    ],
)  # fmt: skip
def test_what_is_measured_is_held_against_each_limit(changed, divergence, excess, missed):
    out = LIMITS.measure(result(changed, divergence), 3.3)
    rates = changed.get("joint_rate.arm.peak", 1.5), changed.get("joint_rate.rail.peak", 0.9) / 0.5
    assert (out.error, out.peak_rate) == (0.15, max(rates))  # 0.3 rad on 0.5 m; the slide over 0.5 m
    assert out.roughness == 1.2
    assert out.excess == pytest.approx(excess, abs=1e-8)
    assert out.missed.startswith(missed)
    # of several runs, the worst of each figure counts, and what is exceeded most
    least = LIMITS.measure(result({"duration": 1.0}), 9.0)
    assert worst([least, out])[2:] == worst([out, least])[2:] == out[2:]


def result(changed, divergence=None, ended=False):
    card = {name: Figure(value, "", "") for name, value in (GOOD | changed).items()}
    return Result(0, None, card, (), divergence, False, ended)


def test_a_run_that_was_ended_misses_no_part_of_its_path():
    out = LIMITS.measure(result({"completed": 0.3, "duration": 1.0}, ended=True), 3.3)
    assert out.excess < 0
    assert (out.ended, worst([out, out]).ended) == (True, True)
    assert not Tried(Setting(Structure("jparse", "", "damp"), (1.0, 1.0)), {0: out}).keeps_limits


def tried(structure, error, rate, time=1.0, number=1.0, excess=-1.0):
    setting = Setting(structure, (number,) * len(structure.keys))
    return Tried(setting, {0: Outcome(error, rate, time, rate, 1.0, excess, "")})


def test_the_verdict_is_the_least_error_then_the_smoothest_then_the_lowest_feedback_then_the_simplest():
    first, stopping, other = (Structure("jparse", "", "damp"), Structure("jparse", "", "stop"),
                              Structure("filtered", "", "damp"))  # fmt: skip
    own = tried(other, 5.0, 5.0)
    a, b = tried(first, 1.0, 3.0), tried(first, 1.009, 2.0, number=1.05)
    c, d = tried(stopping, 1.009, 2.0), tried(other, 1.2, 2.1)
    alone = judge([own, a, c, b, d], [own, a, c, b, d], own)
    assert alone.recommended is b  # 0.9 % more error, smoother; as good as the one that stops, and simpler
    assert alone.second is d
    assert alone.better is b
    assert [one.worst[:2] for one in alone.front] == [(1.009, 2.0), (1.0, 3.0)]
    fast = tried(other, 4.0, 0.1)
    assert judge([fast, a], [fast, a, own], own).better is a
    assert judge([own, a], [own, a], tried(other, 0.5, 0.5)).better is None
    # what is recommended is what dominates, if it does; without a, one that is smoother would be as good as b
    lower = tried(other, 1.025, 1.0)
    assert judge([a, b, lower], [a, b, lower, own], tried(other, 9.0, 2.5)).better is b
    same = tried(other, 1.009, 2.0)
    equal = judge([b, same], [b, same], own)
    assert (equal.recommended, equal.alike, equal.second) == (same, (b,), None)
    near, far = tried(first, 1.0, 1.0, excess=0.2), tried(other, 1.0, 1.0, excess=0.3)
    assert judge([], [far, near], far).nearest is near
    strong, weak = (tried(first, 1.0, 2.0, number=number) for number in (40.0, 30.0))
    assert best([strong, weak]) is weak
    assert best([strong, tried(first, 1.03, 2.0, number=30.0)]) is strong  # 3 % of error are not alike
    assert len(set(all_structures())) == 3 * (7 + 5) + 5


def test_a_plain_inverse_is_recommended_near_a_singularity_only_where_nothing_else_is_left():
    def come_to(method, error, condition):
        one = tried(Structure(method, "constant" if method == "damped" else "", "damp"), error, 1.0)
        one.outcomes[0] = one.outcomes[0]._replace(condition=condition)
        return one

    damped, others = (
        come_to("damped", 1.5, 400.0),
        [come_to(m, 1.0, 400.0) for m in ("pseudoinverse", "inverse")],
    )
    verdict = judge([damped, *others], [damped, *others], damped)
    assert (verdict.recommended, verdict.second) == (damped, others[0])
    assert others[0] in verdict.front  # it is shown all the same
    assert best(others) is others[0]
    far = come_to("pseudoinverse", 1.0, 90.0)
    assert best([come_to("damped", 1.5, 90.0), far]) is far  # negative control: no singularity is near


def test_what_an_inverse_did_not_bear_none_of_its_settings_is_tried_with():
    damped, other = Structure("damped", "constant", "damp"), Structure("jparse", "", "stop")
    space = Space((damped, other), {FEEDBACK: (1.0, 100.0)}, {}, {})

    def setting(structure, feedback):
        return Setting(structure, tuple(feedback if key == FEEDBACK else 0.1 for key in structure.keys))

    bearing = Bearing()
    assert bearing.within(setting(damped, 100.0), space).feedback == 100.0  # nothing is known
    bearing.probed |= {50.0: True, 60.0: False}
    assert bearing.within(setting(damped, 55.0), space).feedback == 55.0
    assert bearing.within(setting(other, 90.0), space).feedback == 54.8  # √(50 · 60)
    bearing.add(setting(damped, 40.0), bears=False)
    assert bearing.within(setting(damped, 45.0), space).feedback == 32.0
    assert bearing.within(setting(other, 45.0), space).feedback == 45.0  # which is another inverse
    bearing.add(setting(damped, 39.8), bears=True)
    assert (
        bearing.within(setting(damped, 45.0), space).feedback == 39.8
    )  # as near to the edge as is told apart
    only = Space((damped,), {}, {FEEDBACK: (10.0, 30.0, 80.0)}, {})
    assert bearing.within(setting(damped, 80.0), only).feedback == 30.0


def test_what_an_inverse_bore_it_need_not_be_asked_with_less():
    damped, other, free = (Structure(name, "", "damp") for name in ("filtered", "truncated", "transpose"))

    def setting(structure, feedback):
        return Setting(structure, tuple(feedback if key == FEEDBACK else 0.1 for key in structure.keys))

    bearing = Bearing({50.0: True, 50.5: False})
    space = Space((damped, other, free), {FEEDBACK: (1.0, 100.0)}, {}, {})
    assert bearing.within(setting(other, 80.0), space).feedback == 49.8  # 99.5 % of what was borne
    assert bearing.within(setting(other, 49.0), space).feedback == 49.0
    assert not bearing.implies(setting(damped, 10.0))  # nothing is known of it
    bearing.add(setting(damped, 50.0), bears=True)
    bearing.add(setting(free, 50.0), bears=True)
    assert bearing.implies(setting(damped, 49.7)) and not bearing.implies(setting(damped, 50.0))
    assert not bearing.implies(setting(other, 10.0)) and not bearing.implies(setting(free, 10.0))
    bearing.add(setting(damped, 30.0), bears=False)  # which settings differ in
    assert not bearing.implies(setting(damped, 40.0)) and bearing.implies(setting(damped, 29.0))
    some = [setting(damped, 20.0), setting(other, 5.0), setting(damped, 30.0), setting(damped, 30.0)]
    assert sorted(one.feedback for one in bearing.to_ask(some)) == [5.0, 30.0]


def test_what_is_recommended_was_asked_itself_whether_it_bears_its_margin(path):
    found = AnyTuning(path, perturbed=1, runs=60).run()
    named = [one for one in (found.verdict.recommended, found.verdict.second) if one]
    assert named and all(one.bears is not None and not one.is_implied for one in named)


def test_how_long_a_search_may_take_is_told_before_it_begins(path):
    work = Tuning(path, perturbed=1, runs=60, threads=1)
    assert work.longest(3.0, 2000) == 6000.0
    assert _estimate(work, 3.0, 2000).startswith("a run takes 3 s: 2000 runs take at most 100 minutes")
    assert "--runs 200 take at most 10 minutes; Ctrl-C" in _estimate(work, 3.0, 2000)
    assert "--runs" not in _estimate(work, 3.0, work.least_runs)  # there is no shorter one
    assert 0.0 < work.begin() < 60.0
    assert work.run().feasible  # by the run that there is


def test_the_setting_as_written_is_told_to_be_what_it_is(path):
    found = Tuning(path, perturbed=0, runs=40).run()
    own = tried(Structure("jparse", "", "damp"), 4.0, 2.0)
    half = tried(Structure("filtered", "", "damp"), 2.0, 1.0)

    def said(own, *others):
        some = [own, *others]
        verdict = judge([one for one in some if one.keeps_limits], some, own)
        return report.as_written(dataclasses.replace(found, own=own, feasible=tuple(some), verdict=verdict))

    assert said(own) == "The setting as written is on the Pareto front: no tried setting dominates it."
    recommended = "The setting as written is dominated: the recommended setting has 0.5 times its error at 0.5 times its peak rate."
    assert said(own, half) == recommended
    costly = tried(Structure("inverse", "", "damp"), 1.0, 9.0)
    assert said(own, half, costly) == recommended.replace("the recommended setting", "filtered")
    hair = tried(Structure("filtered", "", "damp"), 4.0, 1.9999)
    assert said(own, hair) == (
        "The setting as written is dominated, but not significantly: the recommended setting is better by less than 0.1%."
    )
    shorter = tried(Structure("filtered", "", "damp"), 4.0, 2.0, time=0.5)
    assert said(own, shorter) == (
        "The setting as written is dominated: the recommended setting has its error and its peak rate in 0.5 s and not in 1 s."
    )
    still, moving = (
        tried(Structure(name, "", "damp"), 0.0, rate) for name, rate in (("jparse", 1.0), ("inverse", 2.0))
    )
    assert said(moving, still).endswith(
        "the recommended setting has 1 times its error at 0.5 times its peak rate."
    )
    verdict = judge([half], [costly, half], costly)
    assert report.as_written(dataclasses.replace(found, own=costly, feasible=(half,), verdict=verdict)) == (
        "The setting as written is outside --only; no setting within --only dominates it."
    )
    limited = tried(own.setting.structure, 1.0, 1.0, excess=0.1)
    limited.outcomes[0] = limited.outcomes[0]._replace(
        missed="the rate of elbow is 2 rad/s, and 1 is allowed"
    )
    assert said(limited, half) == (
        "The setting as written violates a limit: the rate of elbow is 2 rad/s, and 1 is allowed."
    )


def test_the_search_is_a_name_of_the_package(path):
    assert package.tune(path, perturbed=0, runs=12, only=["control.at_singularity=damp"]).feasible


def nearer():
    """Return the approach as far as 5 mm from full reach, where there is an error to save."""
    return load(ROOT / "scenarios/approach_singularity.yaml", ["target.path[0].line.to=[1.995, 0]"])


@pytest.mark.long
def test_the_shipped_default_of_approach_singularity_is_dominated():
    found = Tuning(nearer(), runs=600).run()
    own, better = found.own.worst, found.verdict.better.worst
    assert found.own.keeps_limits
    assert better.excess <= 0
    assert better.error < 0.1 * own.error
    assert better.peak_rate < own.peak_rate
    assert found.verdict.recommended.setting.structure.method in ("inverse", "pseudoinverse", "damped")


def test_the_shipped_default_of_approach_singularity_is_dominated_by_few_runs():
    path = nearer()
    only = ["control.inverse.method=damped", "control.inverse.damping.schedule=smallest_singular_value",
            "control.at_singularity=damp"]  # fmt: skip
    found = Tuning(path, only=only, perturbed=1, runs=16).run()
    better = found.verdict.better
    # by single runs, as anybody would
    for copy, own, mended in zip(
        found.scenarios, found.own.outcomes.values(), map(better.outcomes.get, range(2)), strict=True
    ):
        for outcome, setting in ((own, ()), (mended, texts(better.setting))):
            card = scorecard(runs_of(path, (*setting, *texts(copy))))
            assert outcome.error == card["position_error.max"].value
            assert outcome.peak_rate == card["joint_rate.peak"].value
    assert better.worst.error < found.own.worst.error
    assert better.worst.peak_rate <= found.own.worst.peak_rate
