"""Run a scenario beside its baseline, or variants side by side; record them, and write files at the end."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import partial, reduce
from os import PathLike
from pathlib import Path
from typing import Any

from rmrc.recording import unlogged
from rmrc.results import facts
from rmrc.results.leaving import Leaving, array_size, refuse_unwritable
from rmrc.results.run import Run, Runs, save_runs
from rmrc.scenario import Scenario, Source, Variant, choices, draft_of
from rmrc.show.sheets import Sheet, as_markdown
from rmrc.show.tables import markdown
from rmrc.simulation.footprint import refuse_excess
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Watcher
from rmrc.study import compare_table
from rmrc.study.study import Ran, Study
from rmrc.support.errors import ScenarioError
from rmrc.support.interruption import interruptible


class Job:
    """A scenario, or variants of it: validated, ready to run, and its results once it ran.

    Attributes:
        name: Name of the scenario.
        variants: The variants; none for a scenario and its baseline.
        worlds: The worlds to run.
        files: The files to write, the recording first; after the run, those that are there.
        results: Results of the worlds, as far as they came.
        interrupted: Whether Ctrl-C ended the run.
        failures: Reasons why files could not be written, one line each.
    """

    def __init__(
        self, source: Source, folder: str | PathLike[str] | None = None, record: bool = True,
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
        written = draft_of(source)
        self._study, self._overrides = Study(written.overridden(overrides)), tuple(overrides)
        prepare_all, prepare_beside = self._study.prepare_all, self._study.prepare_beside
        self.variants = tuple(variants)
        self.worlds = prepare_all(self.variants) if variants else prepare_beside()
        self._written = self.worlds[0].scenario
        self.name, self._records = self._written.name, record and folder is not None
        with suppress(ScenarioError):  # without the overrides, it may be incomplete
            self._written = written.scenario()
        stem, suffixes = f"{self.name}{'.compare' * bool(variants)}", (".rrd", ".npz", ".json")
        self.files = [Path(folder, f"{stem}{suffix}") for suffix in suffixes[not record :]] if folder else []
        self.results, self.interrupted, self.failures = list[Ran](), False, list[str]()
        self._stated = list[dict[str, str]]()
        refuse_excess(self.worlds, recorded=self._records)
        refuse_unwritable(self.files, sum(map(_size_of, self.worlds)), ", or shorten target.path")

    @property
    def labels(self) -> list[str]:
        """Labels of the variants, or the name of the scenario."""
        return [variant.label for variant in self.variants] or [self.name]

    @property
    def runs(self) -> Runs:
        """The runs of the variants, or that of the scenario, by label."""
        return Runs((label, result.run) for label, result in zip(self.labels, self.results, strict=False))

    def compile(self) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds."""
        self._study.compile(self.worlds)

    def run(self, on_ticks: Callable[[int], None] = lambda _: None) -> None:
        """Run to the end, to divergence or to Ctrl-C, and write the files in each case.

        A failing recording, as on a full disk, does not end the run; it is deleted, as the other files need
        the space.

        Args:
            on_ticks: Called after each block with its number of ticks.
        """
        leaving = Leaving()
        with interruptible() as stop, ExitStack() as stack:
            recording: Any = None
            if self._records:
                recording, show = self._recording()
                stack.enter_context(recording)

            def watch(index: int, part: Run) -> None:
                if recording and not leaving.failures and not leaving.attempt(partial(show, index, part)):
                    recording.part_path.unlink(missing_ok=True)  # so that the columns have its room
                on_ticks(len(part))

            self._keep(self._study.step(self.worlds, stop, [watch]))
            is_recorded = recording and not leaving.failures
            for path, write in zip(self.files[-2:], (self._save_columns, self._save_facts), strict=False):
                leaving.write([path], write)
            if is_recorded:
                leaving.write(self.files[:1], lambda _: recording.finish(self._markdown()))
            self.files = [path for path in self.files if path in leaving.files]
            self.interrupted, self.failures = stop.is_set(), leaving.failures

    def table(self) -> Sheet:
        """Return the table of variants."""
        stated = dict(pair for each in self._stated for pair in each.items())
        return compare_table.table(self.name, self.labels, self.results, stated)

    def _recording(self) -> tuple[Any, Watcher]:
        """Return a new recording, and the function that writes a block of ticks to it."""
        with unlogged():  # each imports rerun, a third of a second
            from rmrc.recording.comparison import Overlay
            from rmrc.recording.single import Recorder

        if self.variants:
            worlds = list(zip(self.labels, self.worlds, strict=True))
            overlay = Overlay(self.files[0], self.name, worlds)
            return overlay, overlay.write
        recorder = Recorder(self.files[0], *self.worlds)
        return recorder, lambda index, part: (recorder.write, recorder.write_baseline)[index](part)

    def _markdown(self) -> str:
        """Return the metrics that a recording shows."""
        if self.variants:
            return as_markdown(replace(self.table(), title=""))
        (result, *beside) = self.results
        return markdown(result.scorecard, result.outcomes, beside[0].scorecard if beside else None)

    def _save_columns(self, path: Path) -> None:
        save = partial(save_runs, runs=self.runs) if self.variants else self.results[0].run.save
        save(path)

    def _save_facts(self, path: Path) -> None:
        known: dict[str, Any]
        each = [result.facts() for result in self.results]
        if self.variants:
            for variant, stated, its in zip(self.variants, self._stated, each, strict=True):
                its |= {"label": variant.label, "overrides": list(map(str, variant.changes))}
                its |= {"expected_of_others": stated}
            known = {"overrides": self._overrides, "variants": each}
        else:
            known = each[0] | {"verdict": self.results[0].run.verdict}
            for its in each[1:]:
                del its["expect"]
                known["baseline"] = its | {"changes": self.worlds[0].scenario.baseline}
        facts.save(path, {"name": self.name, **known})

    def _keep(self, results: list[Ran]) -> None:
        """Keep results: a scenario's with the run of its baseline, variants' with the outcomes that count.

        A file states its expectations for its own law; those of `--set` or `--vary` are for variants as they
        are.
        """
        self.results, written = results, self._written
        if not self.variants:
            baseline = results[1].run if len(results) > 1 else None
            results[0] = replace(results[0], run=replace(results[0].run, baseline=baseline))
            return
        for i, result in enumerate(results):
            scenario = result.prepared.scenario
            chosen = _choices(scenario)
            others = {key: value for key, value in _choices(written).items() if chosen[key] != value}
            counted = [
                outcome
                for outcome in result.outcomes
                if not others or scenario.expect[outcome.name] != written.expect.get(outcome.name)
            ]
            self._stated.append(others if len(counted) < len(scenario.expect) else {})
            results[i] = replace(result, outcomes=tuple(counted))


def _size_of(world: Prepared) -> int:
    """Return the size of the columns of a world [B]."""
    n = world.arm.n
    return array_size(world.reference.ticks, n, min(n, len(world.task.rows)), len(world.qpos))


def _choices(scenario: Scenario) -> dict[str, str]:
    """Return the named choices of a scenario's law, which are not numbers such as a damping or a limit.

    A scenario states its expectations for these choices: they do not bind another inverse, as where the plain
    inverse is expected to blow up.
    """
    keys = [f"control.{choice.key}" for choice in choices.CHOICES]
    return {key: str(reduce(getattr, key.split("."), scenario)) for key in keys}
