"""Variants of a scenario from file to files: run as one batch, scored, and shown in one picture each way."""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial, reduce
from pathlib import Path

from rmrc.recording import unlogged
from rmrc.results import facts
from rmrc.results.leaving import Leaving, refuse_unwritable
from rmrc.results.run import Run
from rmrc.results.scorecard import Outcome, Scorecard, check, scorecard
from rmrc.scenario import Draft, Scenario, Variant, draft_of
from rmrc.simulation.footprint import refuse_excess
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.study.compare_table import Row, markdown
from rmrc.study.filters import compile_for, filter_factor
from rmrc.study.study import Listed, Study
from rmrc.support.errors import ScenarioError
from rmrc.support.interruption import interruptible

# What a scenario chooses by name for its law. It states its expectations for these choices: another inverse
# is not bound to what the one as written shall do, as where the plain inverse is expected to blow up.
# Numbers, such as a damping or a limit, are settings of the same law.
CHOICES = (
    "control.inverse.method",
    "control.inverse.damping.schedule",
    "control.nullspace.objective",
    "control.nullspace.secondary.priority",
    "control.limits.on_excess",
    "control.at_singularity",
)


@dataclass(frozen=True)
class Compared:
    """What one variant gave.

    Attributes:
        variant: Its label and changes.
        run: As far as it came.
        scorecard: Its figures.
        outcomes: Of the expectations that count.
        stated_for: If expectations of the scenario do not count: the choices in which the variant differs,
            and what the scenario has there.
        status: How it ended.
    """

    variant: Variant
    run: Run
    scorecard: Scorecard
    outcomes: tuple[Outcome, ...]
    stated_for: Mapping[str, str]
    status: str


@dataclass(frozen=True)
class Results:
    """What a comparison left.

    Attributes:
        name: Of the scenario.
        variants: In order.
        files: Written, the recording first.
        interrupted: Whether Ctrl-C ended it; there is no picture then.
        failures: Why other files could not be written, a line each.
    """

    name: str
    variants: tuple[Compared, ...]
    files: tuple[Path, ...]
    interrupted: bool
    failures: tuple[str, ...] = ()


class Comparison:
    """Variants of a scenario that were checked and are ready to run."""

    def __init__(
        self,
        source: str | os.PathLike[str] | Scenario | Draft,
        variants: Sequence[Variant],
        overrides: Sequence[str] = (),
        folder: Path = Path("recordings"),
        record: bool = True,
    ) -> None:
        """Check all that can be checked of all variants before anything moves.

        Args:
            source: The scenario, or its file.
            variants: What is compared, such as `rmrc.scenario.variants(["control.feedback=5,10"])`.
            overrides: `KEY=VALUE` texts that hold for all.
            folder: Where the files go; made if it is missing.
            record: Whether to write a recording.

        Raises:
            ScenarioError: All that is wrong with all variants, a line each, which names the variant; what is
                wrong with every one of them is said once.
            OSError: The files cannot be written.
        """
        self.folder, self._record, self._overrides = folder, record, tuple(overrides)
        written = draft_of(source)
        base, self.variants = written.overridden(overrides), tuple(variants)
        self.prepared = Study(base).prepare_all(Listed(self.variants, "variant"))
        refuse_excess(self.prepared, recorded=record)
        self.name = self.prepared[0].scenario.name
        self._written = _sound(written, base)
        self._simulation: Simulation | None = None
        refuse_unwritable(self._files())

    @property
    def ticks(self) -> int:
        """How many control ticks all variants take together."""
        return sum(one.reference.ticks for one in self.prepared)

    def compile(self) -> Simulation:
        """Load the compiled law, or compile it the first time, which takes seconds."""
        if self._simulation is None:
            self._simulation = Simulation(self.prepared)
            for one in self.prepared:
                compile_for(one)
        return self._simulation

    def run(self, on_ticks: Callable[[int], None] | None = None) -> Results:
        """Run all variants to the end, to divergence or to Ctrl-C, and write the files whichever it was.

        Args:
            on_ticks: Called with the number of ticks of each block that was finished.
        """
        simulation, leaving = self.compile(), Leaving()
        recorder, failed = None, False
        with interruptible() as stop, ExitStack() as stack:
            if self._record:
                with unlogged():
                    from rmrc.recording.comparison import Overlay  # with rerun, a third of a second

                worlds = [(v.label, one) for v, one in zip(self.variants, self.prepared, strict=True)]
                recorder = stack.enter_context(Overlay(self._file(".rrd"), self.name, worlds))

            def on_block(variant: int, part: Run) -> None:
                nonlocal failed
                if recorder is not None and not failed:
                    failed = not leaving.attempt(partial(recorder.write, variant, part))
                if on_ticks is not None:
                    on_ticks(len(part))

            runs = simulation.run(on_block, stop)
            compared = tuple(
                self._scored(*one, stop.is_set())
                for one in zip(self.variants, self.prepared, runs, strict=True)
            )
            part_path = recorder.part_path if recorder is not None and failed else None
            leaving.write(self._file(".json"), partial(self._save_facts, compared), part_path)
            # which takes longer than one waits after Ctrl-C
            if not stop.is_set() and leaving.attempt(partial(self._draw, runs)) and any(map(len, runs)):
                leaving.files += [self._file(".png"), self._file(".svg")]
            if recorder is not None and not failed:
                rows = [Row(c.variant.label, c.run, c.scorecard, c.outcomes, c.stated_for) for c in compared]
                leaving.write(self._file(".rrd"), partial(recorder.finish, markdown(rows)))
        files = tuple(path for path in self._files() if path in leaving.files)
        return Results(self.name, compared, files, stop.is_set(), tuple(leaving.failures))

    def _files(self) -> list[Path]:
        kinds = [".rrd"] * self._record + [".json", ".png", ".svg"]
        return [self._file(kind) for kind in kinds]

    def _file(self, suffix: str) -> Path:
        return self.folder / f"{self.name}.compare{suffix}"

    def _draw(self, runs: Sequence[Run]) -> None:
        """Draw the filters; without a tick of any run there is nothing to draw."""
        from rmrc.study.filter_figure import filter_factors  # with matplotlib, half a second

        curves = [
            (variant.label, filter_factor(prepared, run))
            for variant, prepared, run in zip(self.variants, self.prepared, runs, strict=True)
            if len(run)
        ]
        if curves:
            filter_factors(self.name, curves, [self._file(".png"), self._file(".svg")])

    def _save_facts(self, compared: Sequence[Compared]) -> None:
        known = [
            {
                "label": one.variant.label,
                "overrides": [str(change) for change in one.variant.changes],
                "expected_of_others": one.stated_for,
                **facts.run_facts(one.status, one.run, one.scorecard, one.outcomes, prepared.scenario),
            }
            for one, prepared in zip(compared, self.prepared, strict=True)
        ]
        about = {"name": self.name, "overrides": self._overrides, "variants": known}
        facts.save(self._file(".json"), about, "matplotlib")

    def _scored(self, variant: Variant, prepared: Prepared, run: Run, interrupted: bool) -> Compared:
        card, one = scorecard(run), prepared.scenario
        differs = {
            key: as_written
            for key, as_written in _choices(self._written).items()
            if _choices(one)[key] != as_written
        }
        # what `--set` or `--vary` expects is asked of the variants as they are
        expect = {
            name: wanted
            for name, wanted in one.expect.items()
            if not differs or self._written.expect.get(name) != wanted
        }
        stated_for = differs if len(expect) < len(one.expect) else {}
        outcomes = tuple(check(card, expect))
        status = facts.status_of(run.divergence, run.is_complete, interrupted)
        return Compared(variant, run, card, outcomes, stated_for, status)


def _sound(written: Draft, base: Draft) -> Scenario:
    """Return the scenario as its file has it; of a file that is not whole, what `--set` makes of it."""
    try:
        return written.scenario()
    except ScenarioError:
        return base.scenario()


def _choices(one: Scenario) -> dict[str, str]:
    """Return what a scenario chooses by name for its law."""
    return {key: str(reduce(getattr, key.split("."), one)) for key in CHOICES}
