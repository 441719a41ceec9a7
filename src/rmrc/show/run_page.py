"""The page of a run, or of variants side by side: result, arm, plots, metrics, and the scenario to paste."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rmrc.results.run import read_runs
from rmrc.scenario import loads
from rmrc.scenario.reading import block
from rmrc.show import tables
from rmrc.show.figure import plot
from rmrc.show.page import Page, Section, code, items, picture, plots, table
from rmrc.show.panels import Runs
from rmrc.show.sheets import Sheet, number
from rmrc.support.errors import QuestionError, ScenarioError

# Metrics of variants side by side; they also get the time in each status that any variant has.
FIGURES = (
    "joint_rate_cmd.peak", "joint_rate.peak", "joint_rate.rms", "joint_acceleration_cmd.peak",
    "joint_jerk_cmd.peak", "chatter", "tau.peak", "tau.share_of_limit", "position_error.max",
    "position_error.end", "orientation_error.max", "orientation_error.end", "sigma.min", "condition.max",
    "damping.max", "path_rate.min", "duration", "completed",
)  # fmt: skip


def page(columns: Path) -> Page:
    """Return the page of a run or of a comparison.

    Args:
        columns: The `.npz` that `run` or `compare` wrote; its `.json` lies beside it.

    Raises:
        OSError: A file cannot be read.
        QuestionError: The file is of another kind, is damaged, or has no tick.
    """
    runs, beside = read_runs(columns), columns.with_suffix(".json")
    for label, run in runs.items():
        if not len(run):
            raise QuestionError(f"{columns}: {label} has no ticks to report")
    try:
        facts = json.loads(beside.read_text("utf-8"))
        return _page(runs, facts, facts.get("variants") or [facts])
    except FileNotFoundError:
        message = f"{beside}: is missing next to the columns; `run` and `compare` write both"
        raise QuestionError(message) from None
    except (
        KeyError,
        TypeError,
        AttributeError,
        IndexError,
        ValueError,
    ):  # the columns were found to be sound
        message = f"{beside}: does not contain the scorecard of this run, or is damaged"
        raise QuestionError(message) from None


def _page(runs: Runs, facts: Mapping[str, Any], variants: Sequence[Mapping[str, Any]]) -> Page:
    """Return the page.

    Args:
        runs: A run, or several.
        facts: What lies beside the columns.
        variants: The facts about each run.
    """
    run, *others = runs.values()
    outcomes = list[str]()
    for variant in variants:
        rows = [("ok" if each["ok"] else "MISSED", each["text"]) for each in variant["expect"]]
        outcomes.append(table(Sheet(variant["label"] if others else "", ("", ""), rows, frozenset({0, 1}))))
        outcomes += [items([f"The run diverged: {variant['divergence']}."])] if variant["divergence"] else []
    if others:
        metrics = [table(_side_by_side(runs))]
    else:
        baseline = None if run.baseline is None else run.baseline.scorecard
        metrics = [table(sheet) for sheet in tables.sheets(run.scorecard, (), baseline)]
    names = "arm and its path" if run.screws else "path"
    drawn = plot(runs, panels=["arm", "path"] if run.screws else ["path"], width=7.16)
    assumed = dict.fromkeys(line for variant in variants for line in variant["assumed"])
    scenario = "The scenario" + " of the first variant; the others differ in the keys that name them" * bool(
        others
    )
    return Page(
        f"{facts['name']}: {len(runs)} variants" if others else facts["name"],
        facts.get("verdict", ""),
        [
            Section(f"The {names}", [picture(drawn, f"The {names}")]),
            Section("Expectations", outcomes),
            Section("Over time", [plots(runs)], is_wide=True),
            Section("Metrics", metrics, is_wide=True),
            Section("Assumptions: in neither the scenario nor the model", [items([*assumed])]),
            Section(scenario, [code(_scenario(variants[0]["scenario"]), "Copy the scenario")]),
        ],
    )


def _side_by_side(runs: Runs) -> Sheet:
    """Return metrics as rows and variants as columns."""
    cards = [run.scorecard for run in runs.values()]
    times = [name for name in cards[0] if name.startswith("status_time.")]
    rows = []
    for name in (*FIGURES, *times):
        values = [float(card[name].value) if name in card else math.nan for card in cards]
        if any(value > 0.0 or (value == 0.0 and name in FIGURES) for value in values):
            unit = next(card[name].unit for card in cards if name in card)
            rows.append((name, *map(number, values), "" if unit == "1" else unit))
    return Sheet("", ("", *runs, "unit"), rows, frozenset({0, len(cards) + 1}))


def _scenario(scenario: Mapping[str, Any]) -> str:
    """Return the scenario to paste, without defaults; its model is the file of that name in its folder."""
    try:
        named = loads(block(scenario), "report").model_dump(mode="json", exclude_defaults=True)
    except ScenarioError:  # its model is missing, or another version wrote it: show all of it
        named = {**scenario, "arm": dict(scenario["arm"])}
    named["arm"]["model"] = Path(scenario["arm"]["model"]).name
    return block(named)
