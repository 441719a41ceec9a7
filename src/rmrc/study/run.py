"""`rmrc.run` and `rmrc.compare`: run a scenario beside its baseline, or variants of it; record them.

Variants have tables, with a row each, for a terminal and as Markdown.
"""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.recording import unlogged
from rmrc.results.metrics import joint_changes
from rmrc.results.run import Run, Runs, save_facts, save_runs, versions
from rmrc.scenario import Source, Variant, draft_of, grid
from rmrc.scenario.changes import hinted
from rmrc.scenario.choices import IN_RUNS
from rmrc.show.sheets import UNDEFINED, Sheet, as_markdown, number
from rmrc.show.tables import markdown
from rmrc.simulation.footprint import refuse_excess
from rmrc.study.study import Result, Study, Values
from rmrc.support.errors import RmrcError
from rmrc.support.files import refuse_unwritable
from rmrc.support.process import interruptible

# A joint that ends this far from its start has flipped [rad]; a sliding one by that share of the
# characteristic length. Tracking errors are a hundred times smaller, and an elbow on its other side is far
# beyond.
FLIPPED = 0.5

# The metrics of each table.
_RATES = (
    "joint_rate.peak", "joint_rate_cmd.peak", "joint_rate.rms", "joint_acceleration.peak",
    "tau.share_of_limit",
)  # fmt: skip
_ERRORS = (
    "position_error_along.max", "position_error_across.max", "orientation_error_along.max",
    "orientation_error_across.max", "position_error.end", "orientation_error.end",
)  # fmt: skip
_TIMES = tuple(f"status_time.{status.name}" for status in IN_RUNS)


def tables(name: str, labels: Sequence[str], results: Sequence[Result]) -> list[Sheet]:
    """Return the tables: rates, errors, times in each status, and how the variants ended.

    Args:
        name: Name of the scenario.
        labels: Label of each variant.
        results: Result of each.
    """
    variants = ("variant", *map(_label, labels, results))
    sheets = []
    for metrics in (_RATES, _ERRORS, _TIMES):
        columns = [column for metric in metrics if (column := _column(results, metric))]
        if columns:
            heading, *rows = zip(variants, *columns, strict=True)
            sheets.append(Sheet(name if metrics is _RATES else "", heading, rows))
    ends = ("flipped", *(flipped(result.run) for result in results)), ("expect", *map(_expect, results))
    heading, *rows = zip(variants, *ends, strict=True)
    return [*sheets, Sheet("", heading, rows, frozenset({0, 1, 2}))]


def flipped(run: Run) -> str:
    """Return the joints that ended in another posture after a closed path.

    Returns:
        `no`, or the names of the flipped joints; for a redundant arm, whose posture may drift, the largest
        change with its unit; `-` for an open path.
    """
    changes = joint_changes(run)
    if math.isnan(changes[0]):
        return UNDEFINED
    if len(run.axes) < len(run.joints):
        return f"{number(changes.max())} {run.joint_unit(int(changes.argmax()))}"
    far = changes / np.where(run.is_slide, run.length, 1.0) > FLIPPED
    return ", ".join(joint for joint, is_far in zip(run.joints, far, strict=True) if is_far) or "no"


def _column(results: Sequence[Result], metric: str) -> tuple[str, ...]:
    """Return the heading of a metric with its units, and its cells; nothing if no variant has it."""
    figures = [result.scorecard.get(metric) for result in results]
    units = dict.fromkeys(unit for figure in figures if figure for unit in figure.unit.split(" or "))
    if not units or (metric in _TIMES and not any(figure and figure.value for figure in figures)):
        return ()
    group, _, last = metric.replace("error_", "error\n_").partition(".")
    heading = "\nor ".join(unit for unit in units if unit != "1")
    cells = [number(float(figure.value)) if figure else UNDEFINED for figure in figures]
    return f"{group}\n{last}\n{heading}".strip(), *cells


def _label(label: str, result: Result) -> str:
    """Return the label, and below it the progress of an incomplete run."""
    if result.run.divergence:
        return f"{label}\ndiverged at {result.run.divergence.time:.3f} s"
    return label if result.run.is_complete else f"{label}\nunfinished"


def _expect(result: Result) -> str:
    missed = sum(not outcome.ok for outcome in result.outcomes)
    return (f"missed {missed}" if missed else "met") if result.outcomes else UNDEFINED


class Job:
    """A scenario, or variants of it: validated, ready to run, and its results once it ran.

    Attributes:
        name: Name of the scenario.
        variants: The variants; none for a scenario and its baseline.
        labels: Labels of the variants, or the name of the scenario.
        worlds: The worlds to run.
        files: The files to write, the recording first; after the run, those that are there.
        results: Results of the worlds, as far as they came.
        interrupted: Whether Ctrl-C ended the run.
        failures: Reasons why files could not be written, one line each.
    """

    def __init__(
        self, source: Source, folder: str | os.PathLike[str] | None = None, record: bool = True,
        variants: Sequence[Variant] = (), overrides: Sequence[str] = (),
    ) -> None:  # fmt: skip
        """Check all that can be checked before anything moves.

        Args:
            source: The scenario, its file, or the name of a shipped one.
            folder: Folder for the files; created if missing. None: writes nothing.
            record: Whether to write a recording.
            variants: Variants to compare; none: runs the scenario beside its baseline, if it has one.
            overrides: `KEY=VALUE` texts that hold for all.

        Raises:
            ScenarioError: Lists all problems, one line each; a problem of every variant appears once.
            OSError: The files cannot be written.
        """
        self._study, self._overrides = Study(draft_of(source).overridden(overrides)), tuple(overrides)
        self.variants = tuple(variants)
        self.worlds = self._study.prepare_all(variants) if variants else self._study.prepare_beside()
        self.name = self.worlds[0].scenario.name
        self.labels = [variant.label for variant in variants] or [self.name]
        stem = Path(folder or "", f"{self.name}.compare" if variants else self.name)
        suffixes = (".rrd", ".npz", ".json") if record else (".npz", ".json")
        self.files = [Path(f"{stem}{suffix}") for suffix in suffixes] if folder else []
        self._records = record and bool(self.files)
        self.results, self.interrupted, self.failures = list[Result](), False, list[str]()
        refuse_excess(self.worlds, recorded=self._records)
        refuse_unwritable(self.files)

    @property
    def runs(self) -> Runs:
        """The runs of the variants, or that of the scenario, by label."""
        return Runs((label, result.run) for label, result in zip(self.labels, self.results, strict=False))

    def compile(self) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds."""
        self._study.compile(self.worlds)

    def run(self, on_ticks: Callable[[int], None] = lambda _: None) -> None:
        """Run to the end, to divergence or to Ctrl-C, and write the files in each case.

        The recording comes last: one that fails, as on a full disk, costs the other files nothing. Runs
        without a tick have none.

        Args:
            on_ticks: Called after each block with its number of ticks.
        """
        with interruptible() as stop:
            self.results = self._study.step(self.worlds, stop, lambda _, part: on_ticks(len(part)))
            self.interrupted = stop.is_set()
            if not self.variants and len(self.results) > 1:
                run, baseline = (result.run for result in self.results)
                self.results[0] = replace(self.results[0], run=replace(run, baseline=baseline))
            written = [path for path in self.files[-2:] if self._attempt(self._save, path)]
            has_ticks = any(map(len, self.runs.values()))
            if self._records and has_ticks and self._attempt(self._record, self.files[0]):
                written.insert(0, self.files[0])
            self.files = written

    def _attempt(self, write: Callable[..., None], *arguments: Any) -> bool:
        """Return whether a part of the writing succeeded, and keep the reason if not."""
        try:
            write(*arguments)
        except OSError as error:
            reason = f"{error.filename}: {(error.strerror or str(error)).lower()}"
            self.failures.append(str(error) if isinstance(error, RmrcError) else reason)
            return False
        return True

    def tables(self) -> list[Sheet]:
        """Return the tables of the variants."""
        return tables(self.name, self.labels, self.results)

    def _record(self, path: Path) -> None:
        """Write the recording of the runs that have ticks."""
        with unlogged():  # rerun, which takes a third of a second
            from rmrc.recording.recorder import write

        if self.variants:
            results = zip(self.labels, self.results, strict=True)
            worlds = {label: (each.prepared, each.run) for label, each in results if len(each.run)}
            write(path, worlds, None, {"Table": "\n\n".join(map(as_markdown, self.tables()))})
            return
        result, *others = self.results
        card = markdown(result.scorecard, result.outcomes, others[0].scorecard if others else None)
        beside = [(each.prepared, each.run) for each in others if len(each.run)]
        world = (result.prepared, result.run)
        write(path, {self.name: world}, beside[0] if beside else None, {"Scorecard": card})

    def _save(self, path: Path) -> None:
        """Write the columns, or the facts."""
        if path.suffix == ".json":
            save_facts(path, self.facts())
        elif self.variants:
            save_runs(path, self.runs)
        else:
            self.results[0].run.save(path)

    def facts(self) -> dict[str, Any]:
        """Return what NAME.json says, ready for strict JSON."""
        result, *others = self.results
        if self.variants:
            variants = [
                {**result.facts(), "label": label, "overrides": list(map(str, changes))}
                for (label, changes), result in zip(self.variants, self.results, strict=True)
            ]
            return {
                "name": self.name, "overrides": self._overrides, "variants": variants,
                "versions": versions(),
            }  # fmt: skip
        known = {"name": self.name, **result.facts(), "verdict": result.run.verdict}
        for baseline in others:
            known["baseline"] = {**baseline.facts(), "changes": result.prepared.scenario.baseline}
            del known["baseline"]["expect"]
        return {**known, "versions": versions()}


@hinted
def run(scenario: Source, *, out: str | os.PathLike[str] | None = None, record: bool = True) -> Run:
    """Run a scenario; the function behind `rmrc run`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        out: Folder for NAME.rrd, NAME.npz and NAME.json; created if missing. None: writes nothing.
        record: Whether to write the recording NAME.rrd.

    Returns:
        The run, up to a possible divergence in `run.divergence`; `run.baseline` is the run of its baseline,
        if there is one.

    Raises:
        ScenarioError: Lists all problems, before the run starts.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C; the files hold the ticks until then.

    Example:
        >>> result = run("line_tracking")
        >>> result["qdot_cmd"].shape == (len(result), 2)
        True
        >>> result.scorecard["position_error.max"].unit
        'm'
    """
    return next(iter(_runs(Job(scenario, out, record)).values()))


@hinted
def compare(
    scenario: Source, vary: Values, *, out: str | os.PathLike[str] | None = None, record: bool = True
) -> Runs:
    """Run variants of a scenario side by side; the function behind `rmrc compare`.

    Args:
        scenario: The scenario, its file, or the name of a shipped one.
        vary: Values of keys; their combinations are the variants, 2 to 50.
        out: Folder for NAME.compare.rrd, .npz and .json; created if missing. None: writes nothing.
        record: Whether to write the recording.

    Returns:
        The runs by the labels of the variants; the last key changes fastest.

    Raises:
        ScenarioError: Lists the problems of all variants, before the run starts.
        OSError: A file cannot be written.
        KeyboardInterrupt: Ctrl-C; the files hold the ticks until then.

    Example:
        >>> runs = compare("line_tracking", {"control.inverse.method": ["inverse", "damped"]})
        >>> list(runs)
        ['inverse', 'damped']
    """
    return _runs(Job(scenario, out, record, grid(vary)))


def _runs(job: Job) -> Runs:
    """Run a job, and raise what a verb prints on stderr."""
    job.run()
    if job.interrupted:
        raise KeyboardInterrupt
    if job.failures:
        raise OSError("; ".join(job.failures))
    return job.runs
