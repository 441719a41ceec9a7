"""Run a scenario beside its baseline, or variants side by side; record them, and write files at the end."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial, reduce
from pathlib import Path
from typing import Any

from rmrc.recording import unlogged
from rmrc.results import facts
from rmrc.results.leaving import Leaving, array_size, refuse_unwritable
from rmrc.results.run import Run, Runs, save_runs
from rmrc.scenario import Scenario, Source, Variant, choices, draft_of
from rmrc.show.sheets import Sheet
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
        self, source: Source, folder: Path | None = None, record: bool = True,
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
        self._overrides, self.variants = tuple(overrides), tuple(variants)
        self._study = Study(written.overridden(overrides))
        prepare_all, prepare_beside = self._study.prepare_all, self._study.prepare_beside
        self.worlds = prepare_all(self.variants) if variants else prepare_beside()
        try:
            self._written = written.scenario()
        except ScenarioError:  # the overrides complete it
            self._written = self.worlds[0].scenario
        self.name, self._records = self.worlds[0].scenario.name, record and folder is not None
        stem, kinds = f"{self.name}{'.compare' * bool(variants)}", (".rrd", ".npz", ".json")
        self.files = [folder / f"{stem}{kind}" for kind in kinds[not record :]] if folder else []
        self.results, self.interrupted, self.failures = tuple[Ran, ...](), False, list[str]()
        refuse_excess(self.worlds, recorded=self._records)
        refuse_unwritable(self.files, sum(map(_size_of, self.worlds)), ", or shorten target.path")

    def compile(self) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds."""
        self._study.compile(self.worlds)

    def run(self, on_ticks: Callable[[int], None] = lambda _: None) -> None:
        """Run to the end, to divergence or to Ctrl-C, and write the files in each case.

        A failing recording, as on a full disk, does not end the run; it is deleted if the other files need
        the space.

        Args:
            on_ticks: Called after each block with its number of ticks.
        """
        leaving = Leaving()
        with interruptible() as stop, ExitStack() as stack:
            recording, show = self._recording() if self._records else (None, None)
            if recording:
                stack.enter_context(recording)

            def watch(index: int, part: Run) -> None:
                if show and not leaving.failures:
                    leaving.attempt(partial(show, index, part))
                on_ticks(len(part))

            self.results = self._scored(self._study.step(self.worlds, stop, [watch]))
            spare = recording.part_path if recording and leaving.failures else None
            for path, write in zip(self.files[-2:], (self._save_columns, self._save_facts), strict=False):
                leaving.write([path], write, spare)
            if recording and spare is None:
                leaving.write(self.files[:1], lambda _: recording.finish(self._markdown()))
            self.files = [path for path in self.files if path in leaving.files]
            self.interrupted, self.failures = stop.is_set(), leaving.failures

    @property
    def runs(self) -> Runs:
        """The runs of the variants by their labels, or that of the scenario by its name."""
        labels = [variant.label for variant in self.variants] or [self.name]
        return Runs((label, one.run) for label, one in zip(labels, self.results, strict=False))

    def table(self) -> Sheet:
        """Return the table of variants."""
        stated = dict(pair for one in self.results for pair in self._stated_for(one).items())
        return compare_table.table(self.name, list(self.runs), self.results, stated)

    def _recording(self) -> tuple[Any, Watcher]:
        """Return a new recording, and the function that writes a block of ticks to it."""
        with unlogged():  # each imports rerun, a third of a second
            from rmrc.recording.comparison import Overlay
            from rmrc.recording.single import Recorder

        if self.variants:
            worlds = zip((variant.label for variant in self.variants), self.worlds, strict=True)
            overlay = Overlay(self.files[0], self.name, list(worlds))
            return overlay, overlay.write
        recorder = Recorder(self.files[0], *self.worlds)
        writers = recorder.write, recorder.write_baseline
        return recorder, lambda index, part: writers[index](part)

    def _markdown(self) -> str:
        """Return the metrics that a recording shows."""
        if self.variants:
            return compare_table.markdown(self.table())
        (one, *beside) = self.results
        return markdown(one.scorecard, one.outcomes, beside[0].scorecard if beside else None)

    def _save_columns(self, path: Path) -> None:
        save = partial(save_runs, runs=self.runs) if self.variants else self.results[0].run.save
        save(path)

    def _save_facts(self, path: Path) -> None:
        known: dict[str, Any]
        each = [one.facts() for one in self.results]
        if self.variants:
            for variant, one, its in zip(self.variants, self.results, each, strict=True):
                its |= {"label": variant.label, "overrides": list(map(str, variant.changes))}
                its |= {"expected_of_others": self._stated_for(one)}
            known = {"overrides": self._overrides, "variants": each}
        else:
            known = each[0] | {"verdict": self.results[0].run.verdict}
            for its in each[1:]:
                del its["expect"]
                known["baseline"] = its | {"changes": self.worlds[0].scenario.baseline}
        facts.save(path, {"name": self.name, **known})

    def _scored(self, results: Sequence[Ran]) -> tuple[Ran, ...]:
        """Return results with the outcomes that count, and a scenario's run with that of its baseline."""
        if self.variants:
            return tuple(map(self._counted, results))
        (one, *beside) = results
        baseline = beside[0].run if beside else None
        return replace(one, run=replace(one.run, baseline=baseline)), *beside

    def _counted(self, result: Ran) -> Ran:
        """Return a result without the outcomes of expectations that the file states for another law."""
        one, own = result.prepared.scenario, self._written
        if _choices(one) == _choices(own):
            return result
        # those of `--set` or `--vary` are for the variants as they are
        counted = [known for known in result.outcomes if one.expect[known.name] != own.expect.get(known.name)]
        return replace(result, outcomes=tuple(counted))

    def _stated_for(self, result: Ran) -> dict[str, str]:
        """Return the choices for which the file states expectations that do not count for a variant."""
        chosen, own = _choices(result.prepared.scenario), _choices(self._written)
        is_counted = len(result.outcomes) == len(result.prepared.scenario.expect)
        return {} if is_counted else {key: value for key, value in own.items() if chosen[key] != value}


def _size_of(one: Prepared) -> int:
    """Return the memory for the columns of a world [B]."""
    n = one.arm.n
    return array_size(one.reference.ticks, n, min(n, len(one.task.rows)), len(one.qpos))


def _choices(one: Scenario) -> dict[str, str]:
    """Return the named choices of a scenario's law, which are not numbers such as a damping or a limit.

    A scenario states its expectations for these choices: they do not bind another inverse, as where the plain
    inverse is expected to blow up.
    """
    keys = [f"control.{choice.key}" for choice in choices.CHOICES]
    return {key: str(reduce(getattr, key.split("."), one)) for key in keys}
