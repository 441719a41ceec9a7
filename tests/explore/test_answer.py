"""The page shows the results of `rmrc run`, to the bit; and a saved scenario gives them again."""

import json
import threading

import numpy as np
import pytest

import rmrc
from rmrc.explore import plots, saving
from rmrc.explore.answer import Explored
from rmrc.scenario import load, loads
from rmrc.support.errors import ScenarioError

SHORT = "target.path=[{line: {by: [0.02, 0.0]}}]"
LAMBDA, SCHEDULE = "control.inverse.damping.maximum", "control.inverse.damping.schedule"
VALUES = {LAMBDA: 0.05, SCHEDULE: "constant", "plant.delay": 0.002}


@pytest.fixture
def explored(scenario):
    return Explored(scenario(SHORT))


def test_an_answer_is_the_run_of_the_scenario_with_these_values(scenario, explored):
    alone = rmrc.run(scenario(SHORT, *(f"{key}={value}" for key, value in VALUES.items())))
    explored.answer({"control.feedback": 5.0})  # an earlier setting has no effect on a later one
    run = explored.answer(VALUES).run
    for name, column in alone.columns.items():
        assert column.tobytes() == run.columns[name].tobytes(), name
    assert run["qdot_cmd"].tobytes() != explored.answer({**VALUES, LAMBDA: 0.06}).run["qdot_cmd"].tobytes()


@pytest.mark.parametrize("other", [False, True])
def test_the_curves_of_the_rates_are_the_columns(explored, other):
    answer = explored.answer(VALUES)
    beside = explored.written.run if other else None
    rates, sigma, errors = plots.plots(answer.run, beside, dark=False, with_plain=True)
    assert np.array_equal(rates.data[0], answer.run["time"])
    shown = {one["label"]: values for one, values in zip(rates.series, rates.data, strict=True)}
    for j, name in enumerate(answer.run.joints):
        assert np.array_equal(shown[f"{name}, commanded"], answer.run["qdot_cmd"][:, j])
        most = 3.0 * rates.scales["y"]["range"][1]  # a length of the axis beyond its end: nobody sees more
        plain = answer.run["qdot_plain"][:, j].clip(-most, most)
        assert np.array_equal(shown[f"{name}, plain inverse"], plain)
        if other:
            assert np.array_equal(shown[f"{name}, baseline"], beside["qdot_cmd"][:, j])
    assert np.array_equal(sigma.data[1 + other], answer.run["sigma"][:, -1])
    if other:  # all of it is on its axis, which is logarithmic
        assert np.array_equal(sigma.data[1], beside["sigma"][:, -1])
    for plot in (rates, sigma, errors):
        assert plot.scales["x"] == {"time": False}  # seconds, no dates
        assert len(plot.data) == len(plot.series)
        assert len({len(values) for values in plot.data}) == 1


def test_a_run_of_another_length_stands_beside(explored):
    slowed = explored.answer({"control.limits.rate": 0.05, "control.at_singularity": "slow"})
    assert len(slowed.run) > len(explored.written.run)
    for one, other in ((slowed, explored.written), (explored.written, slowed)):
        for plot in plots.plots(one.run, other.run, dark=True, with_plain=False):
            assert all(np.isfinite(plot.scales["y"]["range"]))


def test_a_stopped_run_is_no_answer(explored):
    stop = threading.Event()
    stop.set()
    assert explored.answer(VALUES, stop) is None


def test_a_setting_that_cannot_be_is_refused_by_its_key(explored):
    with pytest.raises(ScenarioError, match="nullspace"):
        explored.answer({"control.nullspace.objective": "manipulability", "control.nullspace.gain": -1.0})


def test_what_is_saved_runs_to_the_same_columns_and_figures(explored, tmp_path):
    answer = explored.answer(VALUES)
    file, columns = saving.save(answer, tmp_path / "new")
    assert (file.name, columns.name) == ("test.explore.yaml", "test.explore.npz")
    again, kept = rmrc.run(load(file)), rmrc.Run.read(columns)
    assert again.name == kept.name == "test-explore"
    for name, column in again.columns.items():
        assert column.tobytes() == kept.columns[name].tobytes(), name
    same = {name for name in again.scorecard if name not in ("wall_time", "speed")}
    figures = [
        json.dumps({name: card[name].value for name in same}, sort_keys=True)
        for card in (again.scorecard, answer.run.scorecard)
    ]
    assert figures[0] == figures[1]


def test_the_control_block_makes_the_same_control_law(scenario, explored):
    answer = explored.answer(VALUES)
    text = scenario(SHORT).to_yaml().partition("control:")[0] + saving.control_block(answer)
    rest = {"target": "{path: [{line: {by: [0.02, 0.0]}}]}", "plant": "{delay: 0.002}"}
    again = loads(text + "".join(f"{key}: {value}\n" for key, value in rest.items()))
    assert again.control == answer.prepared.scenario.control


def test_a_strip_has_a_lane_for_what_acted_and_an_instant(explored):
    limited = explored.answer({"control.limits.rate": 0.05}).run
    lanes = plots.strip(limited, 0.1, float(limited["time"][-1]))
    assert "rate limited" in lanes
    assert "t = 0.100 s" in lanes
    assert "rate limited" not in plots.strip(explored.written.run, 0.0, 1.0)


def test_figures_stand_beside_those_of_another_run(explored):
    answer = explored.answer(VALUES)
    told = plots.table(answer.run, explored.written.run, "as written")
    peak = answer.run.scorecard["joint_rate_cmd.peak"].value
    assert f"{peak:.4g}" in told
    assert "as written" in told
    assert "as written" not in plots.table(answer.run, None, "as written")
