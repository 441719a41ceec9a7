"""Variants of a scenario from file to files: run as one batch, scored, and shown in one picture each way."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from pathlib import Path

from rmrc.recording import unlogged
from rmrc.results import facts
from rmrc.results.run import Run
from rmrc.results.scorecard import Outcome, Scorecard, check, scorecard
from rmrc.scenario import Draft, Scenario, Variant, choices, draft_of
from rmrc.simulation.prepare import Prepared
from rmrc.simulation.simulation import Simulation
from rmrc.study.batch import Batch, OnTicks, Recording
from rmrc.study.compare_table import Row, markdown
from rmrc.study.filters import compile_for, filter_factor
from rmrc.study.study import Study
from rmrc.support.errors import ScenarioError

# What a scenario chooses by name for its law. It states its expectations for these choices: another inverse
# is not bound to what the one as written shall do, as where the plain inverse is expected to blow up.
# Numbers, such as a damping or a limit, are settings of the same law.
CHOICES = tuple(f"control.{one.key}" for one in choices.CHOICES)


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

    @property
    def row(self) -> Row:
        """Its row of the table."""
        return Row(self.variant.label, self.run, self.scorecard, self.outcomes, self.stated_for)


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


class Comparison(Batch):
    """Variants of a scenario that were checked and are ready to run."""

    kinds = (".rrd", ".json", ".png", ".svg")
    suffix = ".compare"

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
        self._overrides = tuple(overrides)
        written = draft_of(source)
        base, self.variants = written.overridden(overrides), tuple(variants)
        worlds = Study(base).prepare_all(self.variants)
        self._written = _sound(written, base)
        super().__init__(worlds[0].scenario.name, worlds, folder, record)

    def compile(self) -> Simulation:
        """Load the compiled law, or compile it the first time, which takes seconds."""
        if self._simulation is None:
            for one in self.worlds:
                compile_for(one)
        return super().compile()

    def _recording(self) -> tuple[Recording, Callable[[int, Run], None]]:
        with unlogged():
            from rmrc.recording.comparison import Overlay  # with rerun, a third of a second

        worlds = [(v.label, one) for v, one in zip(self.variants, self.worlds, strict=True)]
        overlay = Overlay(self.file(".rrd"), self.name, worlds)
        return overlay, overlay.write

    def run(self, on_ticks: OnTicks | None = None) -> Results:
        """Run all variants to the end, to divergence or to Ctrl-C, and write the files whichever it was.

        Args:
            on_ticks: Called with the number of ticks of each block that was finished.
        """
        with self._ran(on_ticks) as ran:
            triples = zip(self.variants, self.worlds, ran.runs, strict=True)
            found = tuple(self._scored(*one, ran.interrupted) for one in triples)
            ran.write(".json", lambda path: self._save_facts(path, found))
            if not ran.interrupted:  # which takes longer than one waits after Ctrl-C
                is_drawn = ran.leaving.attempt(lambda: self._draw(ran.runs)) and any(map(len, ran.runs))
                ran.leaving.files += [self.file(kind) for kind in (".png", ".svg") if is_drawn]
            ran.finish(lambda: markdown([one.row for one in found]))
        return Results(self.name, found, ran.files, ran.interrupted, ran.failures)

    def _draw(self, runs: Sequence[Run]) -> None:
        """Draw the filters; without a tick of any run there is nothing to draw."""
        from rmrc.study.filter_figure import filter_factors  # with matplotlib, half a second

        curves = [
            (variant.label, filter_factor(prepared, run))
            for variant, prepared, run in zip(self.variants, self.worlds, runs, strict=True)
            if len(run)
        ]
        if curves:
            filter_factors(self.name, curves, [self.file(".png"), self.file(".svg")])

    def _save_facts(self, path: Path, compared: Sequence[Compared]) -> None:
        known = [
            {
                "label": one.variant.label,
                "overrides": [str(change) for change in one.variant.changes],
                "expected_of_others": one.stated_for,
                **facts.run_facts(
                    one.status, one.run, one.scorecard, one.outcomes, prepared.scenario, prepared.arm.notes
                ),
            }
            for one, prepared in zip(compared, self.worlds, strict=True)
        ]
        about = {"name": self.name, "overrides": self._overrides, "variants": known}
        facts.save(path, about, "matplotlib")

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
