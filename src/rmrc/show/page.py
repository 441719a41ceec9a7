"""A page to send: one self-contained HTML file, which loads no other file and prints well.

Pages of runs, comparisons, sweeps and searches have this template: a sentence, and sections with tables,
pictures, plots with a cursor, and texts to copy.

That of a run, or of variants side by side, has the result, the arm, plots, metrics, and the scenario to
paste.
"""

import base64
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from rmrc.results.run import Run, read_runs
from rmrc.scenario import loads
from rmrc.scenario.reading import block
from rmrc.show import tables
from rmrc.show.figure import plot
from rmrc.show.figures import as_svg
from rmrc.show.palette import css
from rmrc.show.panels import LOOKS, Curve, Lane, Panel, Runs, extremes, lanes, panels
from rmrc.show.sheets import Sheet, number
from rmrc.support.errors import QuestionError, ScenarioError
from rmrc.support.files import reading, written_whole
from rmrc.support.spatial import Array
from rmrc.support.text import visible

# Nothing may be loaded, sent or framed: the page contains everything that it needs.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
ICON = "data:image/svg+xml,%3Csvg xmlns=%22http://www.w3.org/2000/svg%22/%3E"
# Largest number of values of a plot. In a longer run, each span of time keeps the least and the largest one.
ROOM = 60_000


class Section(NamedTuple):
    """A part of a page.

    Attributes:
        title: Its heading.
        parts: What `table`, `items`, `picture`, `code` and `plots` return.
        is_wide: Whether it has the whole width of a wide window.
    """

    title: str
    parts: Sequence[str]
    is_wide: bool = False


@dataclass(frozen=True)
class Page:
    """A page.

    Attributes:
        title: Its heading.
        lead: The sentence below; may be empty.
        sections: Its parts; those without content are not shown.
    """

    title: str
    lead: str
    sections: Sequence[Section]

    def write(self, path: Path) -> None:
        """Write the page, atomically."""
        with written_whole(path) as temporary:
            temporary.write_text(self.html(), "utf-8")

    def html(self) -> str:
        """Return the page as text."""
        assets = files("rmrc.show").joinpath("assets")
        style, script = (
            "\n".join(assets.joinpath(name).read_text("utf-8") for name in names)
            for names in (("uPlot.min.css", "page.css"), ("uPlot.iife.min.js", "page.js"))
        )
        body = "\n".join(
            f"<section{' class=wide' * section.is_wide}><h2>{_text(section.title)}</h2>\n"
            + "\n".join(section.parts)
            + "\n</section>"
            for section in self.sections
            if any(section.parts)
        )
        title, lead = _text(self.title), f'<p class="lead">{_text(self.lead)}</p>' if self.lead else ""
        return (
            f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n'
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<link rel="icon" href="{ICON}">\n<style>{style}</style></head>\n'
            f"<body><header><h1>{title}</h1>{lead}</header>\n<main>\n{body}\n</main>\n"
            f"<script>{script}</script>\n</body></html>\n"
        )


def table(sheet: Sheet) -> str:
    """Return a table with its notes; a cell that is `ok` or `MISSED` has that color as well."""
    rows = "".join(f"<tr>{_cells(row, sheet, is_head=False)}</tr>" for row in sheet.rows)
    caption = f"<caption>{_text(sheet.title)}</caption>" if sheet.title else ""
    head = (
        f"<thead><tr>{_cells(sheet.headings, sheet, is_head=True)}</tr></thead>"
        if any(sheet.headings)
        else ""
    )
    drawn = f'<div class="scroll" tabindex="0"><table>{caption}{head}<tbody>{rows}</tbody></table></div>'
    return drawn * bool(rows) + "".join(f"<p>{_text(note)}</p>" for note in sheet.notes)


def items(lines: Sequence[str]) -> str:
    """Return a list of sentences."""
    return f"<ul>{''.join(f'<li>{_text(line)}</li>' for line in lines)}</ul>" if lines else ""


def picture(figure: Figure, caption: str) -> str:
    """Return a picture as vector graphics, once per page; the caption describes it."""
    svg = re.sub(r"(?s)^.*?(?=<svg)|<metadata>.*?</metadata>", "", as_svg(figure)).replace(
        "<svg", f'<svg role="img" aria-label="{escape(caption)}"', 1
    )
    return f"<figure>{svg}<figcaption>{_text(caption)}</figcaption></figure>"


def code(text: str, button: str) -> str:
    """Return lines of text, once per page, with a button that copies them."""
    return (
        f'<p class="screen"><button type="button" data-copies="text">{_text(button)}</button></p>'
        f'<pre id="text" tabindex="0">{_text(text)}</pre>'
    )


def plots(runs: Run | Runs) -> str:
    """Return plots over time with cursor and zoom, once per page; each run has one tick at least."""
    data, headings = list[dict[str, Any]](), list[str]()
    for panel in panels(runs):
        data.append(_plotted(panel))
        beyond = f' <span class="peak">{_text("; ".join(panel.beyond))}</span>' if panel.beyond else ""
        headings.append(f"{_text(f'{panel.title} [{panel.unit}]')}{beyond}")
    if states := lanes(runs):
        first, *_ = data
        data.append(
            {**first, "title": "Status", "curves": [], "levels": [], "lanes": list(map(_lane, states))}
        )
        headings.append("Status")
    boxes = (
        f'<div><h3>{heading}</h3><div class="plot" id="plot-{i}"></div></div>'
        for i, heading in enumerate(headings)
    )
    # Within a script only "</" and "<!" have a meaning for the parser of the page.
    text = json.dumps(data, allow_nan=False).replace("<", "\\u003c")
    return (
        '<p class="screen">Move over a plot to read values, drag to zoom in on a time, and click a name '
        'below a plot to hide or show its line. <button type="button" id="whole">Show the whole time</button>'
        f'</p><div class="plots">{"".join(boxes)}</div>'
        f'<script type="application/json" id="data">{text}</script>'
    )


def _plotted(panel: Panel) -> dict[str, Any]:
    """Return what the page draws of a panel, with all curves at the same times.

    A curve keeps its value until the next tick, because runs may have different periods.
    """
    time = np.unique(np.round(np.concatenate([curve.time for curve in panel.curves]), 9))
    values = list[Array]()
    for curve in panel.curves:
        rows = np.searchsorted(curve.time, time + 1e-9, side="right") - 1
        values.append(np.where(time > curve.time[-1] + 1e-9, np.nan, curve.values[rows]))
    if len(time) * (len(values) + 1) > ROOM:
        spans = max(1, ROOM // (2 * len(values) * (len(values) + 1)))
        rows = np.unique(np.concatenate([extremes(some, spans) for some in values]))
        time, values = time[rows], [some[rows] for some in values]
    if panel.is_logarithmic:
        values = [np.where(some > 0.0, some, np.nan) for some in values]
    return {
        "title": panel.title, "range": panel.range, "logarithmic": panel.is_logarithmic,
        "time": _packed(time), "lanes": [],
        "levels": [{"value": level.value, "color": css(level.color)} for level in panel.levels],
        "curves": [
            {**_look(curve), "values": _packed(some)}
            for curve, some in zip(panel.curves, values, strict=True)
        ],
    }  # fmt: skip


def _look(curve: Curve) -> dict[str, Any]:
    """Return label, color, width and dashes [px] of a curve."""
    width, dashes = 1.25 * LOOKS[curve.role][0], [2.0 * part for part in curve.dashes]
    return {"label": curve.label, "color": css(curve.color), "width": width, "dash": dashes}


def _lane(lane: Lane) -> dict[str, Any]:
    return {"name": lane.name, "spans": lane.spans, "color": css(lane.color)}


def _packed(values: Array) -> str:
    """Return values as little-endian 32-bit floats in base64."""
    with np.errstate(over="ignore"):  # values beyond the range have no place in a plot
        return base64.b64encode(values.astype("<f4").tobytes()).decode()


def _cells(cells: Sequence[str], sheet: Sheet, is_head: bool) -> str:
    """Return a row of a table; its first cell names the row."""
    row = []
    for i, cell in enumerate(cells):
        style = {"ok": ["ok"], "MISSED": ["missed"]}.get(cell, []) + ["word"] * (i in sheet.left)
        scope = "col" if is_head else "row" if i == 0 else ""
        tag, more = ("th", f' scope="{scope}"') if scope and cell.strip() else ("td", "")
        more += f' class="{" ".join(style)}"' if style else ""
        row.append(f"<{tag}{more}>{_text(cell)}</{tag}>")
    return "".join(row)


def _text(text: str) -> str:
    return escape(visible(text, keep="\n"))


# Metrics of variants side by side; they also get the time in each status that any variant has.
FIGURES = (
    "joint_rate_cmd.peak", "joint_rate.peak", "joint_rate.rms", "joint_acceleration_cmd.peak",
    "joint_jerk_cmd.peak", "chatter", "tau.peak", "tau.share_of_limit", "position_error.max",
    "position_error.end", "orientation_error.max", "orientation_error.end", "sigma.min", "condition.max",
    "damping.max", "path_rate.min", "duration", "completed",
)  # fmt: skip


def page_of_run(columns: Path) -> Page:
    """Return the page of a run or of a comparison.

    Args:
        columns: The `.npz` that `run` or `compare` wrote; its `.json` lies beside it.

    Raises:
        OSError: A file cannot be read.
        QuestionError: The file is of another kind, is damaged, or has no tick.
    """
    runs, beside = read_runs(columns), columns.with_suffix(".json")
    for label, run in runs.items():
        if not len(run):
            raise QuestionError(f"{columns}: {label} has no ticks to report")
    if not beside.exists():
        raise QuestionError(f"{beside}: is missing next to the columns; `run` and `compare` write both")
    with reading(beside, "the scorecard of this run"):
        facts = json.loads(beside.read_text("utf-8"))
        return _page(runs, facts, facts.get("variants") or [facts])


def _page(runs: Runs, facts: Mapping[str, Any], variants: Sequence[Mapping[str, Any]]) -> Page:
    """Return the page.

    Args:
        runs: A run, or several.
        facts: What lies beside the columns.
        variants: The facts about each run.
    """
    run, *others = runs.values()
    outcomes = list[str]()
    for variant in variants:
        rows = [("ok" if each["ok"] else "MISSED", each["text"]) for each in variant["expect"]]
        outcomes.append(table(Sheet(variant["label"] if others else "", ("", ""), rows, frozenset({0, 1}))))
        outcomes += [items([f"The run diverged: {variant['divergence']}."])] if variant["divergence"] else []
    if others:
        metrics = [table(_side_by_side(runs))]
    else:
        baseline = None if run.baseline is None else run.baseline.scorecard
        metrics = [table(sheet) for sheet in tables.sheets(run.scorecard, (), baseline)]
    names = "arm and its path" if run.screws else "path"
    drawn = plot(runs, panels=["arm", "path"] if run.screws else ["path"], width=7.16)
    assumed = dict.fromkeys(line for variant in variants for line in variant["assumed"])
    scenario = "The scenario" + " of the first variant; the others differ in the keys that name them" * bool(
        others
    )
    return Page(
        f"{facts['name']}: {len(runs)} variants" if others else facts["name"],
        facts.get("verdict", ""),
        [
            Section(f"The {names}", [picture(drawn, f"The {names}")]),
            Section("Expectations", outcomes),
            Section("Over time", [plots(runs)], is_wide=True),
            Section("Metrics", metrics, is_wide=True),
            Section("Assumptions: in neither the scenario nor the model", [items([*assumed])]),
            Section(scenario, [code(_scenario(variants[0]["scenario"]), "Copy the scenario")]),
        ],
    )


def _side_by_side(runs: Runs) -> Sheet:
    """Return metrics as rows and variants as columns."""
    cards = [run.scorecard for run in runs.values()]
    times = [name for name in cards[0] if name.startswith("status_time.")]
    rows = []
    for name in (*FIGURES, *times):
        values = [float(card[name].value) if name in card else math.nan for card in cards]
        if any(value > 0.0 or (value == 0.0 and name in FIGURES) for value in values):
            unit = next(card[name].unit for card in cards if name in card)
            rows.append((name, *map(number, values), "" if unit == "1" else unit))
    return Sheet("", ("", *runs, "unit"), rows, frozenset({0, len(cards) + 1}))


def _scenario(scenario: Mapping[str, Any]) -> str:
    """Return the scenario to paste, without defaults; its model is the file of that name in its folder."""
    try:
        named = loads(block(scenario), "report").model_dump(mode="json", exclude_defaults=True)
    except ScenarioError:  # its model is missing, or another version wrote it: show all of it
        named = {**scenario, "arm": dict(scenario["arm"])}
    named["arm"]["model"] = Path(scenario["arm"]["model"]).name
    return block(named)
