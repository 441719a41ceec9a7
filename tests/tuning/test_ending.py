"""Runs that end early: where they end depends on nothing beside them, and what was ended could not count."""

import numpy as np
import pytest

from project import ROOT
from rmrc.scenario import changes_of, draft_of
from rmrc.simulation.simulation import ASKED, Simulation
from rmrc.study.study import Study
from rmrc.tuning.tune import Tuning

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


def test_what_was_ended_could_not_count(path):
    # By runs to the end, without a rule: what was ended breaks a limit, or something is as good in both.
    tuned = Tuning(path, ideal=True, perturbed=1, runs=120, threads=2).run()
    points = [trial.worst.point for trial in tuned.feasible]
    ended = [trial for trial in tuned.tried if trial.worst.ended][::4]
    study = Study(draft_of(path))
    where = [next(i for i, outcome in trial.outcomes.items() if outcome.ended) for trial in ended]
    worlds = [
        study.prepare((*trial.setting.changes, *tuned.scenarios[world].changes))
        for trial, world in zip(ended, where, strict=True)
    ]
    simulation = Simulation(worlds, keep_columns=False)
    simulation.step()
    useful = max(3.0 * min(point.error for point in points), tuned.own.worst.error)
    for trial, world, card in zip(ended, where, simulation.scorecards(), strict=True):
        outcome, rate, error = (
            trial.outcomes[world],
            card["joint_rate.peak"].value,
            card["position_error.max"].value,
        )
        assert (outcome.error, outcome.peak_rate) <= (error, rate)  # as far as it came
        as_good = any(point.peak_rate <= 1.01 * rate and point.error <= 1.01 * error for point in points)
        assert rate > 2.0 * 1.01 or error > useful or as_good
        assert card["duration"].value > outcome.time  # negative control: it was ended, and not at its end
    assert len(ended) > 5
