"""The page of a run, or of variants side by side: settings, results, and the scenario to paste."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rmrc.results.run import Run, read_runs
from rmrc.scenario import loads
from rmrc.scenario.wording import block
from rmrc.show import tables, traces
from rmrc.show.axes import NAMES, applies
from rmrc.show.page import Page
from rmrc.show.plot import plot
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.support.errors import QuestionError, ScenarioError

# Metrics of variants side by side; they also get the time in each status that any variant has.
FIGURES = (
    "joint_rate_cmd.peak", "joint_rate.peak", "joint_rate.rms", "joint_acceleration_cmd.peak",
    "joint_jerk_cmd.peak", "chatter", "tau.peak", "tau.share_of_limit", "position_error.max",
    "position_error.end", "orientation_error.max", "orientation_error.end", "sigma.min", "condition.max",
    "damping.max", "path_rate.min", "duration", "completed",
)  # fmt: skip
# The contents of the panels of a figure.
DRAWN = {
    "path": "path", "rates": "rates", "sigma": "singular values", "error": "errors", "torque": "torques",
    "pace": "pace", "status": "status", "g": "filter g(σ)",
}  # fmt: skip


def page(columns: Path) -> Page:
    """Return the page of a run or of a comparison.

    Args:
        columns: The `.npz` that `run` or `compare` wrote; its `.json` lies beside it.

    Raises:
        OSError: A file cannot be read.
        QuestionError: The file is of another kind, is damaged, or has no tick.
    """
    runs, facts = read_runs(columns), _facts(columns.with_suffix(".json"))
    for label, run in runs.items():
        if not len(run):
            raise QuestionError(f"{columns}: {label} has no ticks to report")
    try:
        made = _of_one(runs, facts) if len(runs) == 1 and "scorecard" in facts else _of_several(runs, facts)
        made.section("Made with", "The same versions give the same bits on one machine.")
        made.table(versions(facts.get("versions", {})))
    except (KeyError, TypeError, AttributeError, IndexError):  # the columns were found to be sound
        told = f"{columns.with_suffix('.json')}: does not contain the scorecard of this run, or is damaged"
        raise QuestionError(told) from None
    made.table(_hashes([columns, columns.with_suffix(".json")]))
    return made


def versions(found: Mapping[str, str]) -> Sheet:
    """Return the table of versions."""
    return Sheet("", ("", "version"), list(found.items()), frozenset({0, 1}))


def _hashes(paths: Sequence[Path]) -> Sheet:
    rows = [(path.name, hashlib.sha256(path.read_bytes()).hexdigest()) for path in paths]
    return Sheet("Files", ("", "SHA-256"), rows, frozenset({0, 1}))


def _facts(path: Path) -> dict[str, Any]:
    """Return the contents of a JSON file of `run` or `compare`."""
    try:
        facts = json.loads(path.read_text("utf-8"))
        if isinstance(facts, dict) and ("scorecard" in facts or "variants" in facts):
            return facts
    except FileNotFoundError:
        raise QuestionError(
            f"{path}: is missing next to the columns; `run` and `compare` write both"
        ) from None
    except ValueError:
        pass
    raise QuestionError(f"{path}: does not contain the scorecard of a run, or is damaged")


def _of_one(runs: Mapping[str, Run], facts: Mapping[str, Any]) -> Page:
    (run,) = runs.values()
    made = Page(facts["name"], facts.get("verdict", ""))
    _outcomes(made, facts)
    made.section("Inputs")
    made.table(_asked(facts["scenario"]))
    if facts["assumed"]:
        made.section("Assumptions", "These are in neither the scenario nor the model.")
        made.items(facts["assumed"])
    made.section("Results")
    made.figure(plot(run), f"{run.name}: {_drawn({'': run})}")
    made.section("Over time")
    made.plots(traces.of_run(run))
    made.section("Metrics")
    for sheet in tables.sheets(run.scorecard, (), None if run.baseline is None else run.baseline.scorecard):
        made.table(sheet)
    _scenario(made, facts["scenario"])
    return made


def _of_several(runs: Mapping[str, Run], facts: Mapping[str, Any]) -> Page:
    variants = facts["variants"]
    made = Page(f"{facts['name']}: {len(runs)} variants")
    made.section("Side by side")
    made.table(_beside(runs, variants))
    for one in variants:
        _outcomes(made, one, f" of {one['label']}")
    made.section("Results")
    made.figure(plot(runs), f"{facts['name']}: {_drawn(runs)}")
    made.section("Over time")
    made.plots(traces.of_runs(runs))
    made.section("Inputs", "The first variant; the others differ in the keys that name them.")
    made.table(_asked(variants[0]["scenario"]))
    assumed = dict.fromkeys(line for one in variants for line in one["assumed"])
    if assumed:
        made.section("Assumptions", "These are in neither the scenario nor the model.")
        made.items(list(assumed))
    _scenario(made, variants[0]["scenario"])
    return made


def _drawn(runs: Mapping[str, Run]) -> str:
    """Return the names of the panels of a figure, in words."""
    names = [DRAWN[name] for name in NAMES if any(applies(name, run) for run in runs.values())]
    return f"{', '.join(names[:-1])} and {names[-1]}"


def _outcomes(made: Page, facts: Mapping[str, Any], whose: str = "") -> None:
    if facts["expect"]:
        rows = [("ok" if one["ok"] else "MISSED", one["text"]) for one in facts["expect"]]
        made.section(f"Expectations{whose}")
        made.table(Sheet("", ("", "expectation"), rows, frozenset({0, 1})))
    if facts["divergence"]:
        made.items([f"The run diverged: {facts['divergence']}."])


def _beside(runs: Mapping[str, Run], variants: Sequence[Mapping[str, Any]]) -> Sheet:
    """Return metrics as rows and variants as columns."""
    cards = [run.scorecard for run in runs.values()]
    times = [name for name in cards[0] if name.startswith("status_time.")]
    happened = [name for name in times if any(float(card[name].value) for card in cards if name in card)]
    rows = []
    for name in (*FIGURES, *happened):
        known = [card[name] for card in cards if name in card]
        cells = [number(float(card[name].value)) if name in card else UNDEFINED for card in cards]
        if known and set(cells) != {UNDEFINED}:
            rows.append((name, *cells, known[0].unit.replace("1", "", known[0].unit == "1")))
    met = [
        UNDEFINED if not one["expect"] else "MISSED" if any(not e["ok"] for e in one["expect"]) else "ok"
        for one in variants
    ]
    rows.append(("expectations", *met, ""))
    left = frozenset({0, len(cards) + 1})
    return Sheet("", ("", *runs, "unit"), rows, left)


def _asked(scenario: Mapping[str, Any]) -> Sheet:
    """Return the decisive settings of a run, in a few rows."""
    arm, task, control, target, plant = (
        scenario[name] for name in ("arm", "task", "control", "target", "plant")
    )
    limits, inverse = control["limits"], control["inverse"]
    damping = inverse["damping"]
    is_damped = "damped" in inverse["method"]
    kinds = ("profile", "rate", "acceleration", "jerk")
    bounds = [f"{name} {limits[name]}" for name in kinds if limits[name] is not None]
    rows = [
        ("arm", f"{Path(arm['model']).name}, site {arm['site'] or 'of its last body'}"),
        ("task", f"{' '.join(task['axes'])}, along the axes of the {task['frame']}"),
        ("path", ", ".join(next(iter(part)) for part in target["path"])),
        ("inverse", inverse["method"] + (f", damping {damping['schedule']}" if is_damped else "")),
        ("feedback", f"{control['feedback']:g} /s, control period {1e3 * control['period']:g} ms"),
        ("near a singularity", control["at_singularity"]),
        ("limits", ", ".join(bounds) or "of the model"),
        ("where a limit is exceeded", limits["on_excess"]),
        ("plant", plant["kind"] + (f", commands {1e3 * plant['delay']:g} ms late" if plant["delay"] else "")),
    ]  # fmt: skip
    return Sheet("", ("", "as it ran"), rows, frozenset({0, 1}))


def _scenario(made: Page, scenario: Mapping[str, Any]) -> None:
    """Add the scenario to copy, without defaults."""
    try:
        named = loads(block(scenario), "report").model_dump(mode="json", exclude_defaults=True)
    except ScenarioError:  # its model is missing, or another version wrote it: show all of it
        named = {**scenario, "arm": dict(scenario["arm"])}
    named["arm"]["model"] = Path(scenario["arm"]["model"]).name
    note = (
        "Keys with default values are left out. The model is the file of this name in the scenario's folder."
    )
    made.section("The scenario", note)
    made.code(block(named), "Copy the scenario")
