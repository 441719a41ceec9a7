"""Run a scenario beside its baseline, or variants side by side; record them, and write files at the end."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from rmrc.recording import unlogged
from rmrc.results import facts
from rmrc.results.leaving import refuse_unwritable
from rmrc.results.run import Run, Runs, save_runs
from rmrc.scenario import Source, Variant, draft_of
from rmrc.show.sheets import Sheet, as_markdown
from rmrc.show.tables import markdown
from rmrc.simulation.footprint import refuse_excess
from rmrc.simulation.simulation import Watcher
from rmrc.study import compare_table
from rmrc.study.study import Result, Study
from rmrc.support.errors import RmrcError
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
        self._study, self._overrides = Study(draft_of(source).overridden(overrides)), tuple(overrides)
        prepare_all, prepare_beside = self._study.prepare_all, self._study.prepare_beside
        self.variants = tuple(variants)
        self.worlds = prepare_all(self.variants) if variants else prepare_beside()
        self.name, self._records = self.worlds[0].scenario.name, record and folder is not None
        stem, suffixes = f"{self.name}{'.compare' * bool(variants)}", (".rrd", ".npz", ".json")
        self.files = [Path(folder, f"{stem}{suffix}") for suffix in suffixes[not record :]] if folder else []
        self.results, self.interrupted, self.failures = list[Result](), False, list[str]()
        refuse_excess(self.worlds, recorded=self._records)
        refuse_unwritable(self.files)

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
        with interruptible() as stop, ExitStack() as stack:
            recording: Any = None
            if self._records:
                recording, show = self._recording()
                stack.enter_context(recording)

            def watch(index: int, part: Run) -> None:
                if recording and not self.failures and not self._attempt(show, index, part):
                    recording.part_path.unlink(missing_ok=True)  # so that the columns have its room
                on_ticks(len(part))

            self.results = self._study.step(self.worlds, stop, watch)
            self.interrupted = stop.is_set()
            if not self.variants and len(self.results) > 1:
                run, baseline = (result.run for result in self.results)
                self.results[0] = replace(self.results[0], run=replace(run, baseline=baseline))
            is_recorded = not self.failures
            written = [path for path in self.files[-2:] if self._attempt(self._save, path)]
            if recording and is_recorded and self._attempt(recording.finish, self._markdown()):
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

    def table(self) -> Sheet:
        """Return the table of variants."""
        return compare_table.table(self.name, self.labels, self.results)

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

    def _save(self, path: Path) -> None:
        """Write the columns, or the facts."""
        if path.suffix == ".json":
            self._save_facts(path)
        elif self.variants:
            save_runs(path, self.runs)
        else:
            self.results[0].run.save(path)

    def _save_facts(self, path: Path) -> None:
        known, *others = (result.facts() for result in self.results)
        if self.variants:
            known = {"overrides": self._overrides, "variants": [known, *others]}
            for (label, changes), its in zip(self.variants, known["variants"], strict=True):
                its |= {"label": label, "overrides": list(map(str, changes))}
        else:
            known["verdict"] = self.results[0].run.verdict
            for its in others:
                del its["expect"]
                known["baseline"] = its | {"changes": self.worlds[0].scenario.baseline}
        facts.save(path, {"name": self.name, **known})
