"""Runs that end early: where they end depends on nothing beside them, and what was ended could not count."""

import functools

import numpy as np
import pytest

from project import ROOT
from rmrc.scenario import changes_of, draft_of
from rmrc.simulation.simulation import ASKED, Simulation
from rmrc.study.study import Study
from rmrc.tuning.bar import FAR, NEW, Bar
from rmrc.tuning.front import Point
from rmrc.tuning.trials import Ending
from rmrc.tuning.tune import Tuning

pytestmark = pytest.mark.usefixtures("unmargined")

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [30 deg, -60 deg]}}
task: {{axes: [x, y]}}
control:
  period: 0.002
  inverse: {{method: damped, damping: {{schedule: constant, maximum: 0.3}}}}
  feedback: 2
  limits: {{rate: 2.0}}
target: {{path: [{{line: {{to: [1.93, 0.0]}}}}, {{line: {{to: [1.8, 0.0]}}}}], limits: {{velocity: 0.5}}}}
plant: {{kind: ideal}}
"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "quick.yaml"
    path.write_text(TEXT)
    return path


def slow(index, run):
    """End every second world once its position error is above 1 mm."""
    return index % 2 == 0 and np.linalg.norm(run["pose_error"][:, :2], axis=1).max() > 1e-3


def test_where_a_rule_ends_a_run_depends_on_nothing_beside_it(path):
    study = Study(draft_of(path))
    worlds = [
        study.prepare(changes_of({"control.feedback": gain})) for gain in (1.0, 2.0, 3.0, 5.0, 8.0, 9.0)
    ]
    whole = Simulation(worlds).run()
    runs, ended = [], []
    for threads, keeps in ((1, True), (3, True), (2, False)):
        simulation = Simulation(worlds, threads, keep_columns=keeps)
        simulation.step(rule=slow)
        ended.append(simulation.ended())
        runs.append([card["duration"].value for card in simulation.scorecards()])
        if keeps:
            for run, all_of_it in zip(simulation.runs(), whole, strict=True):  # up to there, to the bit
                assert np.array_equal(run["q"], all_of_it["q"][: len(run)])
    assert runs[0] == runs[1] == runs[2]
    assert ended[0] == ended[1] == ended[2]
    for index, (run, is_ended) in enumerate(zip(whole, ended[0], strict=True)):
        late = np.flatnonzero(np.linalg.norm(run["pose_error"][:, :2], axis=1) > 1e-3)
        should = index % 2 == 0 and late.size > 0 and late[0] < len(run) - ASKED
        assert is_ended == should
        if should:  # at the next time that the rule is asked
            assert runs[0][index] == pytest.approx(ASKED * (late[0] // ASKED + 1) * 0.002)
    assert 0 < sum(ended[0]) < 6


def beaten(points, rate, error, rival, wanted):
    """The definition: too far off, or some point is as good, and so is one of the same inverse."""
    as_good = any(p.peak_rate <= rate * (1 + NEW) and p.error <= error * (1 + NEW) for p in points)
    return error > wanted or (as_good and rival <= error * (1 + NEW))


def test_the_bar_is_its_definition():
    random = np.random.default_rng(7)
    for _ in range(50):
        points = [Point(*pair, 1.0) for pair in random.uniform(1.0, 2.0, (6, 2)).tolist()]
        own = [points[0]] if random.random() < 0.5 else []
        bar = Bar.of(points, own)
        least = min(one.error for one in points)
        wanted = max([FAR * least, *(one.error for one in own)])
        rate, error, rival = random.uniform(0.9, 2.1, (3, 40))
        error[:5] *= 20.0
        found = bar.beats(rate, error, rival)
        assert found.tolist() == [
            beaten(points, *one, wanted) for one in zip(rate, error, rival, strict=True)
        ]
        assert 0 < found.sum() < 40
        # what is alike to the least is not left
        assert not bar.beats(rate, np.minimum(error, 1.01 * least), rival, 1.02).any()
    assert Bar.of([], []) is None


@pytest.fixture
def unmodeled(monkeypatch):
    """Leave a search without a model, so that all its looks are on the scenarios."""
    monkeypatch.setattr("rmrc.tuning.tune.Tuning._model", lambda *_: None)


@pytest.mark.usefixtures("unmodeled")
def test_what_was_ended_could_not_count(path):
    # By runs to the end, without a rule: what was ended breaks a limit, or is beaten by what was found.
    found = Tuning(path, ideal=True, perturbed=1, runs=120, threads=2).run()
    points = [one.worst.point for one in found.feasible]
    ended = [one for one in found.tried if one.worst.ended]
    assert len(ended) > 10
    study = Study(draft_of(path))
    some = ended[::4]
    where = [next(copy for copy, out in one.outcomes.items() if out.ended) for one in some]
    worlds = [
        study.prepare((*one.setting.changes, *found.scenarios[copy].changes))
        for one, copy in zip(some, where, strict=True)
    ]
    simulation = Simulation(worlds, keep_columns=False)
    simulation.step()
    wanted = max(FAR * min(one.error for one in points), found.own.worst.error)
    saved = 0
    for one, copy, card in zip(some, where, simulation.scorecards(), strict=True):
        rate, error = card["joint_rate.peak"].value, card["position_error.max"].value
        assert error >= one.outcomes[copy].error  # as far as it came
        assert rate >= one.outcomes[copy].peak_rate
        same = [
            b.worst.error
            for b in found.feasible
            if b.setting.structure.inverse == one.setting.structure.inverse
        ]
        rival = min(same, default=np.inf)
        assert rate > 2.0 * 1.01 or beaten(points, rate, error, rival, wanted)
        saved += card["duration"].value > one.outcomes[copy].time
    assert saved == len(some)  # negative control: they were ended, and not at their end


@pytest.mark.long
@pytest.mark.usefixtures("unmodeled")
def test_a_search_that_ends_runs_finds_what_one_that_does_not_finds(path, monkeypatch):
    only = ["control.inverse.method=damped", "control.inverse.damping.schedule=constant,smallest_singular_value",
            "control.at_singularity=damp"]  # fmt: skip
    search = functools.partial(Tuning, path, only=only, ideal=True, perturbed=1, runs=240, threads=2)
    early = search().run()
    monkeypatch.setattr(Ending, "__call__", lambda *_: False)
    patient = search().run()
    assert not any(one.worst.ended for one in patient.tried)
    best, reference = early.verdict.recommended.worst, patient.verdict.recommended.worst
    assert best.error <= 1.02 * reference.error
    ticks = [
        sum(out.time for one in found.tried for out in one.outcomes.values()) for found in (early, patient)
    ]
    assert ticks[0] < 0.95 * ticks[1]  # few neighbors that were guessed from runs must be ended
