"""Recordings rebuilt from the columns of a run and the scenario in its JSON file."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rmrc.recording import unlogged
from rmrc.results.expectations import check
from rmrc.results.run import Run
from rmrc.show.tables import markdown
from rmrc.simulation.prepare import Prepared
from rmrc.study import compare_table
from rmrc.study.filming import Worlds, saved
from rmrc.study.study import Ran, Study

# Ticks of a block.
BLOCK = 1000


def rerecord(path: Path, recording: Path) -> None:
    """Write the recording of a run or a comparison from its other files.

    Args:
        path: NAME.npz, with NAME.json in the same folder.
        recording: File to write, ending in `.rrd`.

    Raises:
        QuestionError: One of the two is missing, damaged or lacks data; or the model no longer exists.
        OSError: The recording cannot be written.
    """
    worlds = saved(path)
    facts = json.loads(path.with_suffix(".json").read_text("utf-8"))
    if "variants" in facts:
        _write_all(worlds, facts["variants"], recording)
    else:
        ((prepared, run),) = worlds.values()
        _write_one(prepared, run, recording)


def _write_one(prepared: Prepared, run: Run, recording: Path) -> None:
    with unlogged():
        from rmrc.recording.single import Recorder  # imports rerun, a third of a second

    baseline = None if run.baseline is None else Study(prepared.scenario).prepare_beside()[1]
    with Recorder(recording, prepared, baseline) as recorder:
        for part in _blocks(run):
            recorder.write(part)
        for part in _blocks(run.baseline) if run.baseline is not None else ():
            recorder.write_baseline(part)
        outcomes = check(run.scorecard, prepared.scenario.expect)
        beside = None if run.baseline is None else run.baseline.scorecard
        recorder.finish(markdown(run.scorecard, outcomes, beside))


def _write_all(worlds: Worlds, facts: Sequence[dict[str, Any]], recording: Path) -> None:
    with unlogged():
        from rmrc.recording.comparison import Overlay  # imports rerun, a third of a second

    name = next(iter(worlds.values()))[0].scenario.name
    with Overlay(recording, name, [(label, prepared) for label, (prepared, _) in worlds.items()]) as overlay:
        for index, (_, run) in enumerate(worlds.values()):
            for part in _blocks(run):
                overlay.write(index, part)
        results, stated = [], dict[str, str]()
        for index, (prepared, run) in enumerate(worlds.values()):
            counted = {one["name"] for one in facts[index].get("expect", ())}
            expected = {name: one for name, one in prepared.scenario.expect.items() if name in counted}
            outcomes = tuple(check(run.scorecard, expected))
            results.append(Ran(index, prepared, run.scorecard, outcomes, run.divergence, False, False, run))
            stated |= facts[index].get("expected_of_others", {})
        table = compare_table.table(name, list(worlds), results, stated)
        overlay.finish(compare_table.markdown(table))


def _blocks(run: Run) -> Iterator[Run]:
    """Yield a run in parts; after a divergence, the last part has it."""
    for first in range(0, max(len(run), 1), BLOCK):
        last = first + BLOCK >= len(run)
        columns = {name: values[first : first + BLOCK] for name, values in run.columns.items()}
        yield replace(run, columns=columns, divergence=run.divergence if last else None, baseline=None)
