"""Variants of a scenario from file to files: run as one batch, scored, and shown in one picture each way."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from rmrc import facts, scenario
from rmrc.filter_factors import compile_for, filter_factor
from rmrc.interruption import interruptible
from rmrc.preparation import Prepared, prepare_many
from rmrc.run import Run
from rmrc.scenario import Variant
from rmrc.scorecard import Outcome, Scorecard, check, scorecard
from rmrc.simulation import Simulation


@dataclass(frozen=True)
class Compared:
    """What one variant gave.

    Attributes:
        variant: Its label and overrides.
        run: As far as it came.
        scorecard: Its figures.
        outcomes: Of the scenario's expectations.
        status: How it ended.
    """

    variant: Variant
    run: Run
    scorecard: Scorecard
    outcomes: tuple[Outcome, ...]
    status: str


@dataclass(frozen=True)
class Results:
    """What a comparison left.

    Attributes:
        name: Of the scenario.
        variants: In order.
        files: Written, the recording first.
        interrupted: Whether Ctrl-C ended it.
    """

    name: str
    variants: tuple[Compared, ...]
    files: tuple[Path, ...]
    interrupted: bool


class Comparison:
    """Variants of a scenario that were checked and are ready to run."""

    def __init__(
        self,
        path: Path,
        varied: Sequence[str],
        overrides: Sequence[str] = (),
        folder: Path = Path("recordings"),
        record: bool = True,
    ) -> None:
        """Check all that can be checked of all variants before anything moves.

        Args:
            path: Of the scenario.
            varied: `KEY=V1,V2,...` texts; their combinations are the variants.
            overrides: `KEY=VALUE` texts that hold for all.
            folder: Where the files go; made if it is missing.
            record: Whether to write a recording.

        Raises:
            ScenarioError: All that is wrong with all variants, a line each, which names the variant; what is
                wrong with every one of them is said once.
            OSError: The folder cannot be written.
        """
        self.folder, self._record, self._overrides = folder, record, tuple(overrides)
        self.variants = scenario.variants(varied)
        self.prepared = prepare_many(path, self._overrides, self.variants)
        self.name = self.prepared[0].scenario.name
        self._simulation: Simulation | None = None
        folder.mkdir(parents=True, exist_ok=True)

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
        from rmrc.output.comparison_table import Row, markdown

        simulation = self.compile()
        with ExitStack() as stack:
            recorder = None
            if self._record:
                from rmrc.output.overlay import Overlay  # with rerun, a third of a second

                worlds = [(v.label, one) for v, one in zip(self.variants, self.prepared, strict=True)]
                recorder = stack.enter_context(Overlay(self._file(".rrd"), self.name, worlds))

            def on_block(variant: int, part: Run) -> None:
                if recorder is not None:
                    recorder.write(variant, part)
                if on_ticks is not None:
                    on_ticks(len(part))

            stop = stack.enter_context(interruptible())
            runs = simulation.run(on_block, stop)
            compared = tuple(
                _scored(*one, stop.is_set()) for one in zip(self.variants, self.prepared, runs, strict=True)
            )
            self._save_facts(compared)
            pictures = self._draw(runs)
            if recorder is not None:
                rows = [Row(c.variant.label, c.run, c.scorecard, c.outcomes) for c in compared]
                recorder.finish(markdown(rows))
        files = [self._file(".rrd")] * self._record + [self._file(".json"), *pictures]
        return Results(self.name, compared, tuple(files), stop.is_set())

    def _file(self, suffix: str) -> Path:
        return self.folder / f"{self.name}.compare{suffix}"

    def _draw(self, runs: Sequence[Run]) -> list[Path]:
        """Draw the filters; without a tick of any run there is nothing to draw."""
        from rmrc.output.figures import filter_factors  # with matplotlib, half a second

        curves = [
            (variant.label, filter_factor(prepared, run))
            for variant, prepared, run in zip(self.variants, self.prepared, runs, strict=True)
            if len(run)
        ]
        paths = [self._file(".png"), self._file(".svg")] if curves else []
        if curves:
            filter_factors(self.name, curves, paths)
        return paths

    def _save_facts(self, compared: Sequence[Compared]) -> None:
        known = [
            {
                "label": one.variant.label,
                "overrides": one.variant.overrides,
                **facts.run_facts(one.status, one.run, one.scorecard, one.outcomes, prepared.scenario),
            }
            for one, prepared in zip(compared, self.prepared, strict=True)
        ]
        about = {"name": self.name, "overrides": self._overrides, "variants": known}
        facts.save(self._file(".json"), about, "matplotlib")


def _scored(variant: Variant, prepared: Prepared, run: Run, interrupted: bool) -> Compared:
    card = scorecard(run)
    outcomes = tuple(check(card, prepared.scenario.expect))
    return Compared(variant, run, card, outcomes, facts.status_of(run, interrupted))
