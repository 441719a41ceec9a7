"""`rmrc.render`: a picture or a film of runs, from their files or from a scenario."""

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rmrc.results.run import Run, read_runs
from rmrc.scenario import Source, Variant, block, draft_of, grid, loads
from rmrc.simulation.prepare import Prepared
from rmrc.study.study import Study
from rmrc.study.verbs import Values
from rmrc.support.errors import QuestionError, ScenarioError
from rmrc.support.legible import quoted, visible

if TYPE_CHECKING:
    from rmrc.film.film import Watch

Worlds = dict[str, tuple[Prepared, Run]]

SUFFIXES = (".npz", ".json", ".rrd")


def render(
    source: Source,
    path: str | os.PathLike[str],
    vary: Values | None = None,
    *,
    at: float | None = None,
    begin: float = 0.0,
    end: float | None = None,
    speed: float = 1.0,
    fps: float = 20.0,
    size: tuple[int, int] | None = None,
) -> None:
    """Draw one run, or several side by side: the arm by MuJoCo's renderer, and its rates below.

    Off screen, by EGL or OSMesa; the function behind `rmrc render`.

    Args:
        source: Output of `run` or `compare`: NAME.npz or its .rrd or .json; or a scenario, which is run
            first.
        path: File to write atomically: `.png`, `.gif` or `.mp4`, which needs the extra `film`.
        vary: For a scenario: values of keys; draws their combinations side by side.
        at: Time of a picture [s]; None: when the first run is nearest to a singularity.
        begin: Start of a film [s].
        end: End of a film [s]; None: end of the longest run.
        speed: Simulated seconds per second of film.
        fps: Frames per second; for a GIF, the nearest rate that the format supports.
        size: Width and height [pixels]; None: 480 × 480 for each run.

    Raises:
        QuestionError: This machine cannot draw, the files lack data, or the model has changed since the run.
        ScenarioError: Lists the problems of the scenario, before the run starts.
        OSError: The file cannot be written.
    """
    from rmrc.film.film import Cut

    is_left = isinstance(source, str | os.PathLike) and Path(source).suffix in SUFFIXES
    if is_left and vary:
        raise QuestionError(f"{source}: is a finished run whose keys cannot vary; give the scenario")
    worlds = left(Path(source)) if is_left else ran(source, grid(vary) if vary else ())  # type: ignore[arg-type]
    draw(worlds, Path(path), Cut(at, begin, end, speed, fps), size)


def draw(
    worlds: Worlds, path: Path, cut: Any, size: tuple[int, int] | None, watch: "Watch | None" = None
) -> None:
    """Draw worlds that ran; see `render`."""
    from rmrc.film.film import KINDS, render

    if path.suffix not in KINDS:
        raise QuestionError(f"--out {visible(str(path))}: must end in {', '.join(KINDS[:-1])} or {KINDS[-1]}")
    for label, (_, run) in worlds.items():
        if not len(run):
            raise QuestionError(f"{quoted(label)} has no ticks to draw")
    render(worlds, path, cut, size, watch or (lambda _: nullcontext(lambda _: None)))


def ran(source: Source, variants: Sequence[Variant], overrides: Sequence[str] = ()) -> Worlds:
    """Run a scenario, or variants of it, and return each with its world, by label.

    Args:
        source: The scenario, its file, or the name of a shipped one.
        variants: Variants to run; None: the scenario alone, by its name.
        overrides: `KEY=VALUE` texts that hold for all.

    Raises:
        ScenarioError: Lists all problems, before the run starts.
    """
    study = Study(draft_of(source).overridden(overrides))
    worlds = study.prepare_all(variants) if variants else [study.prepare()]
    labels = [variant.label for variant in variants] or [worlds[0].scenario.name]
    study.compile(worlds)
    results = study.step(worlds)
    return {label: (world, one.run) for label, world, one in zip(labels, worlds, results, strict=True)}


def left(path: Path) -> Worlds:
    """Return the runs of a file with their worlds, rebuilt from its JSON, by label.

    Args:
        path: NAME.npz, or its .rrd or .json.

    Raises:
        QuestionError: One of the two files is missing or lacks data; or the scenario can no longer be
            prepared, as without its model.
    """
    runs, beside = read_runs(path.with_suffix(".npz")), path.with_suffix(".json")
    scenarios = _scenarios(beside)
    if list(scenarios) != list(runs):
        raise QuestionError(
            f"{visible(str(beside))}: belongs to another run than {visible(path.stem)}.npz next to it"
        )
    worlds = {}
    for label, run in runs.items():
        try:
            worlds[label] = Study(loads(block(scenarios[label]))).prepare(), run
        except ScenarioError as error:
            (first, *_) = error.problems
            raise QuestionError(f"{visible(str(beside))}: can no longer be drawn: {first}") from None
    return worlds


def _scenarios(path: Path) -> Mapping[str, dict[str, Any]]:
    """Return the scenarios in a JSON file of `run` or `compare`, by label."""
    if not path.exists():
        raise QuestionError(
            f"{visible(str(path))}: is missing; `run` and `compare` write it, and it names the model"
        )
    try:
        facts = json.loads(path.read_text("utf-8"))
        if "variants" in facts:
            return {one["label"]: one["scenario"] for one in facts["variants"]}
        return {facts["name"]: facts["scenario"]}
    except (ValueError, KeyError, TypeError):
        raise QuestionError(
            f"{visible(str(path))}: does not contain the scenario of a run, or is damaged"
        ) from None
