"""Advice in a world with loads: what is recommended bears a payload that the scenario does not name."""

import re

import pytest

import rmrc

SEEDS = (0, 1, 2)
ENDS = ("position_error.end", "orientation_error.end")


def metrics(scenario, **changes):
    """Return the metrics of a run with a delay of 8 ms, which are not those of the search."""
    card = rmrc.run(scenario.set({"plant.delay": 0.008, **changes}), record=False).scorecard
    return {name: card[name].value for name in (*ENDS, "position_error.max")}


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    """Return what `tune` prints for a small search, and its result."""
    from typer.testing import CliRunner

    from rmrc.cli import app

    out = tmp_path_factory.mktemp("answer")
    command = ["tune", "line_tracking", "--delay", "8ms", "--runs", "60", "--out", str(out)]
    printed = CliRunner().invoke(app, command).output
    return printed, rmrc.tune("line_tracking", runs=60, delay="8ms")


def test_the_loads_are_scaled_to_the_arm_and_told(answer):
    printed, tuned = answer
    assert re.search(r"payload 0\.\d+ kg,\s+friction", printed)
    payloads = [
        change.value for world in tuned.scenarios for change in world.changes if "payload" in change.key
    ]
    assert len(payloads) == len(tuned.scenarios) - 1 and max(payloads) > 0.0


def test_none_has_a_smaller_error_by_more_than_two_percent(answer):
    _, tuned = answer
    least = min(trial.worst.error for trial in tuned.feasible)
    assert tuned.verdict.recommended.worst.error <= 1.02 * least
    # Negative control: the settings differ by more.
    assert max(trial.worst.error for trial in tuned.feasible) > 1.05 * least


def test_it_prints_what_a_kilogram_costs(answer):
    assert re.search(r"A kilogram moves the end of the path by [\d.]+ u?mm", answer[0])


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
def test_a_restricted_search_finds(seed):
    """The setting as written errs by 43 mm, and a coarse grid of λ and K reaches 14.5 mm."""
    tuned = rmrc.tune(
        "approach_singularity",
        {"control.at_singularity": ["damp"]},
        delay=("6ms", "12ms"),
        runs=700,
        seed=seed,
    )
    assert tuned.verdict.recommended.worst.error <= 0.016


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
def test_an_unknown_payload_costs_no_more_than_as_written(seed, tmp_path):
    rmrc.tune("ur5e_elbow", delay="8ms", seed=seed, out=tmp_path)
    written, tuned = rmrc.load("ur5e_elbow"), rmrc.load(tmp_path / "ur5e_elbow.tune.yaml")
    loaded, before = metrics(tuned, **{"plant.payload": 2.0}), metrics(written, **{"plant.payload": 2.0})
    assert all(loaded[name] <= before[name] for name in ENDS)
    assert metrics(tuned)["position_error.max"] <= metrics(written)["position_error.max"]
