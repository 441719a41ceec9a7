"""Compare variants of a scenario: run them, score them, and draw them together."""

from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from pathlib import Path

from rmrc.recording import unlogged
from rmrc.results import facts
from rmrc.results.run import save_runs
from rmrc.scenario import Draft, Scenario, Source, Variant, choices, draft_of
from rmrc.simulation.simulation import Watcher
from rmrc.study.batch import Batch, Recording, size_of
from rmrc.study.compare_table import Compared, markdown
from rmrc.study.filters import compile_for, filter_factor
from rmrc.study.study import Ran, Study
from rmrc.support.errors import ScenarioError

# The choices of a scenario's law by name. A scenario states its expectations for these choices: they do not
# bind another inverse, as where the plain inverse is expected to blow up. Numbers, such as a damping or a
# limit, are settings of the same law.
CHOICES = tuple(f"control.{one.key}" for one in choices.CHOICES)


class Comparison(Batch[Compared]):
    """Validated variants of a scenario, ready to run."""

    kinds = (".rrd", ".npz", ".json", ".png", ".svg")
    suffix = ".compare"

    def __init__(
        self,
        source: Source,
        variants: Sequence[Variant],
        overrides: Sequence[str] = (),
        folder: Path = Path("recordings"),
        record: bool = True,
    ) -> None:
        """Validate all variants before the run starts.

        Args:
            source: The scenario, or its file.
            variants: Variants to compare, such as `rmrc.scenario.variants(["control.feedback=5,10"])`.
            overrides: `KEY=VALUE` texts for all variants.
            folder: Folder for the files; created if missing.
            record: Whether to write a recording.

        Raises:
            ScenarioError: Lists the problems of all variants, one line each with the variant; a problem of
                every variant appears once.
            OSError: The files cannot be written.
        """
        self._overrides = tuple(overrides)
        written = draft_of(source)
        base, self.variants = written.overridden(overrides), tuple(variants)
        study = Study(base)
        worlds = study.prepare_all(self.variants)
        self._written = _sound(written, base)
        super().__init__(study, worlds[0].scenario.name, worlds, folder, record, sum(map(size_of, worlds)))

    def compile(self) -> None:
        """Load the compiled law, or compile it on first use, which takes seconds."""
        for one in self.worlds:
            compile_for(one)
        super().compile()

    def _recording(self) -> tuple[Recording, Watcher]:
        with unlogged():
            from rmrc.recording.comparison import Overlay  # imports rerun, a third of a second

        worlds = [(v.label, one) for v, one in zip(self.variants, self.worlds, strict=True)]
        overlay = Overlay(self.file(".rrd"), self.name, worlds)
        return overlay, overlay.write

    def _writers(self, results: Sequence[Compared]) -> Iterator[tuple[Sequence[str], Callable[..., None]]]:
        ran = {one.variant.label: one.run for one in results}
        yield [".npz"], lambda path: save_runs(path, ran)
        yield [".json"], lambda path: self._save_facts(path, results)
        if any(len(one.run) for one in results) and not results[0].interrupted:
            # which takes longer than a user waits after Ctrl-C
            yield [".png", ".svg"], lambda *paths: self._draw(results, paths)

    def _markdown(self, results: Sequence[Compared]) -> str:
        return markdown(results)

    def _draw(self, results: Sequence[Compared], paths: Sequence[Path]) -> None:
        """Draw the filters of the variants with at least one tick."""
        from rmrc.study.filter_figure import filter_factors  # imports matplotlib, half a second

        ran = [one for one in results if len(one.run)]
        curves = [(one.variant.label, filter_factor(one.prepared, one.run)) for one in ran]
        filter_factors(self.name, curves, paths)

    def _save_facts(self, path: Path, results: Sequence[Compared]) -> None:
        known = [
            {
                "label": one.variant.label,
                "overrides": [str(change) for change in one.variant.changes],
                "expected_of_others": one.stated_for,
                **one.facts(),
            }
            for one in results
        ]
        about = {"name": self.name, "overrides": self._overrides, "variants": known}
        facts.save(path, about, "matplotlib")

    def _scored(self, results: Sequence[Ran]) -> tuple[Compared, ...]:
        return tuple(map(self._compared, results))

    def _compared(self, result: Ran) -> Compared:
        one, own = result.prepared.scenario, self._written
        chosen = _choices(one)
        differs = {key: written for key, written in _choices(own).items() if chosen[key] != written}
        # expectations of `--set` or `--vary` apply to the variants as they are
        outcomes = tuple(
            outcome
            for (name, wanted), outcome in zip(one.expect.items(), result.outcomes, strict=True)
            if not differs or own.expect.get(name) != wanted
        )
        stated_for = differs if len(outcomes) < len(one.expect) else {}
        known = vars(result) | {"outcomes": outcomes}
        return Compared(**known, variant=self.variants[result.index], stated_for=stated_for)


def _sound(written: Draft, base: Draft) -> Scenario:
    """Return the scenario of the file, or with `--set` if the file alone is incomplete."""
    try:
        return written.scenario()
    except ScenarioError:
        return base.scenario()


def _choices(one: Scenario) -> dict[str, str]:
    """Return the named choices of a scenario's control law."""
    return {key: str(reduce(getattr, key.split("."), one)) for key in CHOICES}
