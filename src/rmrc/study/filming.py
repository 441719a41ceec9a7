"""`rmrc.render`: a picture or a film of runs, from their files or from a scenario."""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rmrc.results.run import Run, read_runs
from rmrc.scenario import Source, Variant, block, draft_of, grid, loads
from rmrc.simulation.prepare import Prepared
from rmrc.study.study import Study
from rmrc.study.verbs import Values
from rmrc.support.errors import QuestionError, ScenarioError
from rmrc.support.legible import visible

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
    from rmrc.film import film

    worlds = worlds_of(source, grid(vary) if vary else ())
    film.render(worlds, Path(path), film.Cut(at, begin, end, speed, fps), size)


def worlds_of(source: Source, variants: Sequence[Variant] = (), overrides: Sequence[str] = ()) -> Worlds:
    """Return runs with their worlds, by label: those of a file, or of a scenario that is run here.

    Args:
        source: NAME.npz, or its .rrd or .json; or a scenario, its file, or the name of a shipped one.
        variants: Variants of the scenario to run; none: the scenario alone, by its name.
        overrides: `KEY=VALUE` texts that hold for all.

    Raises:
        QuestionError: A file is missing or lacks data; or its scenario can no longer be prepared.
        ScenarioError: Lists all problems of the scenario, before the run starts.
    """
    if isinstance(source, str | os.PathLike) and Path(source).suffix in SUFFIXES:
        if variants or overrides:
            name = visible(str(source))
            raise QuestionError(f"{name}: is a finished run whose keys cannot change; give the scenario")
        return saved(Path(source))
    study = Study(draft_of(source).overridden(overrides))
    worlds = study.prepare_all(variants) if variants else [study.prepare()]
    labels = [variant.label for variant in variants] or [worlds[0].scenario.name]
    results = study.step(worlds)
    return {label: (one.prepared, one.run) for label, one in zip(labels, results, strict=True)}


def saved(path: Path) -> Worlds:
    """Return the runs of a file with their worlds, rebuilt from its JSON, by label.

    Args:
        path: NAME.npz, or its .rrd or .json.

    Raises:
        QuestionError: One of the two files is missing or lacks data; or the scenario can no longer be
            prepared, as without its model.
    """
    runs, beside = read_runs(path.with_suffix(".npz")), path.with_suffix(".json")
    name = visible(str(beside))
    try:
        facts: dict[str, Any] = json.loads(beside.read_text("utf-8"))
        variants = facts.get("variants") or [facts | {"label": facts["name"]}]
        scenarios = {one["label"]: one["scenario"] for one in variants}
        return {label: (Study(loads(block(scenarios[label]))).prepare(), run) for label, run in runs.items()}
    except FileNotFoundError:
        raise QuestionError(
            f"{name}: is missing; `run` and `compare` write it, and it names the model"
        ) from None
    except ScenarioError as error:
        raise QuestionError(f"{name}: can no longer be drawn: {error.problems[0]}") from None
    except (ValueError, LookupError, TypeError, AttributeError):
        raise QuestionError(f"{name}: is damaged, or belongs to another run than {path.stem}.npz") from None
