"""`rmrc.plot` and `rmrc.render`: pictures and films of a verb's output; and the report page of a sweep."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TypeAlias

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rmrc.results.run import Run, read_runs
from rmrc.scenario import Source, Variant, block, draft_of, grid, loads
from rmrc.show.figure import plot as plot_runs
from rmrc.show.figures import COLUMN, Picture, plain, save
from rmrc.show.page import Page, Section, picture, table
from rmrc.show.palette import paints
from rmrc.show.sheets import Sheet, number
from rmrc.simulation.prepare import Prepared
from rmrc.study.dataset import Table
from rmrc.study.study import Study, Values
from rmrc.study.sweep import Swept
from rmrc.support.errors import QuestionError
from rmrc.support.files import reading
from rmrc.support.text import quoted, visible

Worlds: TypeAlias = dict[str, tuple[Prepared, Run]]

# Files of a run.
SUFFIXES = (".npz", ".json", ".rrd")

# Panels of a figure of a sweep, from the top.
PANELS = ("distributions", "keys")
# Bins of a histogram; spread above which a scale is logarithmic; different words that an axis has room for.
BINS, WIDE, MOST_WORDS = 20, 30.0, 12


def plot(
    result: Run | Mapping[str, Run] | Table | str | PathLike[str],
    path: str | PathLike[str] | None = None, panels: Sequence[str] = (),
    width: float = 7.16, font: float = 8.0,
) -> Figure:  # fmt: skip
    """Draw a run, several side by side, or a sweep; the function behind `rmrc plot`.

    Args:
        result: A run; runs by label, as `compare` returns them; the rows that `sweep` returns; or the file of
            either, `NAME.npz` or `NAME.sweep.parquet`.
        path: File to write atomically: `.png`, `.svg` or `.pdf`; None: no file.
        panels: Panels among `rmrc.show.figure.NAMES`, in this order from the top; for a sweep, distributions
            and keys; none: all that have data, but arm and joints.
        width: Width of the figure [in]: 3.5 and 7.16 are one and two columns of a journal.
        font: Font size [pt].

    Returns:
        The figure, which a notebook shows.

    Raises:
        OSError: A file cannot be read or written.
        QuestionError: The file is of another kind, or damaged; or it has no data to draw.
    """
    to = None if path is None else Path(path)
    if isinstance(result, str | PathLike):
        file = Path(result)
        result = Swept.of(file) if file.suffix == ".parquet" else read_runs(file)
    elif not isinstance(result, Run | Mapping):
        result = Swept.of(Path("the table"), result)
    if isinstance(result, Swept):
        return sweep_figure(result, to, panels, width, font)
    runs = {result.name: result} if isinstance(result, Run) else result
    for label, run in runs.items():
        if not len(run):
            raise QuestionError(f"{quoted(label)} has no ticks to draw")
    return plot_runs(runs, to, panels, width, font)


def sweep_figure(
    swept: Swept, path: Path | None, panels: Sequence[str] = (), width: float = 7.16, font: float = 8.0
) -> Figure:
    """Draw a sweep: distributions of its metrics, and the first metric over each varied key.

    Args:
        swept: Its rows.
        path: File to write atomically: `.png`, `.svg` or `.pdf`; None: no file.
        panels: Panels among distributions and keys; none: both.
        width: Width of the figure [in].
        font: Font size [pt].

    Raises:
        QuestionError: There are no numbers to draw.
    """
    panels, metrics = panels or PANELS, list(swept.figures)
    axes_of_keys = {key: _coordinates(swept.rows[key]) for key in swept.varied}
    cells = [(name, "") for name in metrics if "distributions" in panels]
    if "keys" in panels:
        cells += [(name, key) for name in metrics[:1] for key, x in axes_of_keys.items() if x]
    if not cells:
        raise QuestionError(f"{swept.name}: no run has numbers to draw")
    columns = min(len(cells), 3 if width > COLUMN else 1)
    lines = math.ceil(len(cells) / columns)
    units = {name: f" [{unit}]" if unit not in ("", "1") else "" for name, unit in swept.units.items()}
    with mpl.rc_context({"font.size": font}):
        picture = Picture(figsize=(width, lines * (1.4 + 0.07 * font)), layout="constrained")
        for i, (name, key) in enumerate(cells):
            axes, values = picture.add_subplot(lines, columns, i + 1), swept.figures[name]
            seen = values[np.isfinite(values)]
            scale = "log" if seen.min() > 0.0 and seen.max() > WIDE * seen.min() else "linear"
            label = f"{plain(name)}{units[name]}"
            if key:
                axes.scatter(axes_of_keys[key], values, s=4.0, color=paints(1)[0])
                axes.set(xlabel=f"{plain(key)}{units[key]}", ylabel=label, yscale=scale)
            else:
                bins = np.geomspace(seen.min(), seen.max(), BINS + 1) if scale == "log" else BINS
                axes.hist(seen, bins, color=paints(1)[0])  # type: ignore[arg-type]
                axes.set(xlabel=label, ylabel="runs", xscale=scale)
        save(picture, [path] if path else [])
    return picture


def _coordinates(values: Sequence[object]) -> list[float] | list[str]:
    """Return the values of a key in all runs: numbers, or a few different words; none for many words."""
    if all(value is None or isinstance(value, int | float) for value in values):
        return [math.nan if value is None else float(value) for value in values]  # type: ignore[arg-type]
    return [*map(str, values)] if len({*map(str, values)}) <= MOST_WORDS else []


def sweep_page(swept: Swept) -> Page:
    """Return the report page of a sweep."""
    (ends, extremes), status = swept.sheets(), swept.rows["status"]
    settings = []
    for i in sorted({i for pair in swept.extremes().values() for i in pair}):
        values = [swept.rows[key][i] for key in swept.varied]
        texts = [number(value) if isinstance(value, float) else str(value) for value in values]
        settings.append((str(i), *texts))
    sections = [
        Section("End of the runs", [table(replace(ends, title=""))]),
        Section("Extremes", [table(extremes)]),
        Section("Settings of these runs", [table(Sheet("", ("run", *swept.varied), settings))]),
    ]
    if swept.figures:
        drawn = picture(sweep_figure(swept, None, width=9.6, font=9.0), "Runs by value, and a dot a run")
        sections += [Section("Distributions, and the first metric over the varied keys", [drawn])]
    return Page(ends.title, f"{status.count('complete')} of {len(status)} runs completed the path.", sections)


def render(
    source: Source, path: str | PathLike[str], vary: Values | None = None, *,
    at: float | None = None, begin: float = 0.0, end: float | None = None,
    speed: float = 1.0, fps: float = 20.0, size: tuple[int, int] | None = None,
) -> None:  # fmt: skip
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
    from rmrc.recording import film

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
    if isinstance(source, str | PathLike) and Path(source).suffix in SUFFIXES:
        if variants or overrides:
            raise QuestionError(f"{source}: is a finished run whose keys cannot change; give the scenario")
        return saved(Path(source))
    study = Study(draft_of(source).overridden(overrides))
    worlds = study.prepare_all(variants) if variants else [study.prepare()]
    labels = [variant.label for variant in variants] or [worlds[0].scenario.name]
    results = study.step(worlds)
    return {label: (result.prepared, result.run) for label, result in zip(labels, results, strict=True)}


def saved(path: Path) -> Worlds:
    """Return the runs of a file with their worlds, rebuilt from its JSON, by label.

    Args:
        path: NAME.npz, or its .rrd or .json.

    Raises:
        OSError: One of the two files is missing.
        QuestionError: One lacks data, or they are of different runs.
        ScenarioError: The scenario can no longer be prepared, as without its model.
    """
    runs, beside = read_runs(path.with_suffix(".npz")), path.with_suffix(".json")
    with reading(beside, f"what a run left beside {path.stem}.npz"):
        facts = json.loads(beside.read_text("utf-8"))
        variants = facts.get("variants") or [facts | {"label": facts["name"]}]
        texts = {variant["label"]: block(variant["scenario"]) for variant in variants}
    if list(texts) != list(runs):
        raise QuestionError(f"{visible(str(beside))}: belongs to another run than {path.stem}.npz next to it")
    return {label: (Study(loads(text, str(beside))).prepare(), runs[label]) for label, text in texts.items()}
