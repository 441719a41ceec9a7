"""Scorecards and the keys of a scenario as tables: for a terminal, and as markdown for a recording.

Both forms show the same sheets, and these hold every metric with information. Nothing depends on color alone,
is cut off, or is read as markup.
"""

import math
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from rmrc.scenario import SchemaRow
from rmrc.show.sheets import UNDEFINED, Sheet, as_markdown, number
from rmrc.show.terminal import Fitted, as_table
from rmrc.support.legible import escaped

if TYPE_CHECKING:  # it imports numba, which a table of keys does not need
    from rmrc.results.expectations import Outcome
    from rmrc.results.scorecard import Figure, Scorecard

_PEAKS = (
    "joint_rate",
    "joint_rate_cmd",
    "joint_rate_plain",
    "joint_acceleration",
    "joint_acceleration_cmd",
    "joint_jerk_cmd",
    "tau",
    "tau_total",
)
_ERRORS = (
    "position_error",
    "orientation_error",
    "position_error_along",
    "position_error_across",
    "orientation_error_along",
    "orientation_error_across",
    "secondary_error",
)


def render(
    card: "Scorecard", outcomes: Sequence["Outcome"] = (), baseline: "Scorecard | None" = None
) -> RenderableType:
    """Return the relevant metrics, and the expectations of them, for a terminal.

    Args:
        card: The scorecard.
        outcomes: Outcomes of the scenario's expectations; none: no such table.
        baseline: The metrics of the baseline beside them, if any.
    """
    *others, rest, status = sheets(card, outcomes, baseline)
    parts = [part for sheet in others for part in (as_table(sheet), Text())]
    return Group(Text(card.name, style="bold"), Text(), *parts, _Beside(as_table(rest), as_table(status)))


class _Beside:
    """Two tables side by side, or one below the other if the terminal is too narrow."""

    GAP = 4

    def __init__(self, left: Fitted, right: Fitted) -> None:
        self.left, self.right = left, right

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        if self.left.width + self.GAP + self.right.width <= options.max_width:
            grid = Table.grid(padding=(0, self.GAP))
            grid.add_row(self.left, self.right)
            yield grid
        else:
            yield from (self.left, Text(), self.right)


def markdown(
    card: "Scorecard", outcomes: Sequence["Outcome"] = (), baseline: "Scorecard | None" = None
) -> str:
    """Return the tables of `render` as a markdown document.

    Args:
        card: The scorecard.
        outcomes: Outcomes of the scenario's expectations; none: no such table.
        baseline: The metrics of the baseline beside them, if any.
    """
    blocks = [f"# {escaped(card.name)}", *map(as_markdown, sheets(card, outcomes, baseline))]
    return "\n\n".join(blocks) + "\n"


def schema(rows: Sequence[SchemaRow]) -> RenderableType:
    """Return the keys of a scenario for a terminal: keys whole, the rest beside them, or below if narrow."""
    return _Keys(rows)


class _Keys:
    """Keys with a description of each, words whole."""

    GAP, INDENT = 2, 4

    def __init__(self, rows: Sequence[SchemaRow]) -> None:
        self.told = [(row.key, f"{_kind(row)}\n{row.meaning}") for row in rows]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        longest = max(len(key) for key, _ in self.told)
        word = max(len(word) for _, told in self.told for word in told.split())
        if longest + self.GAP + word <= options.max_width:
            table = Table(box=None, show_header=False, pad_edge=False, padding=(0, self.GAP, 0, 0))
            table.add_column(no_wrap=True, style="bold", width=longest)
            table.add_column(overflow="fold")
            for key, told in self.told:
                table.add_row(Text(key), Text(told))
            yield table
            return
        for key, told in self.told:
            yield Text(key, style="bold")
            yield Padding(Text(told), (0, 0, 0, self.INDENT))


def schema_text(rows: Sequence[SchemaRow]) -> str:
    """Return the keys of a scenario, one per line, aligned and never wrapped: for a pipe or a file."""
    table = [("key", "type", "unit", "default", "meaning"), *rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)) for row in table)
    return "".join(f"{line.rstrip()}\n" for line in lines)


# Sheets -----------------------------------------------------------------------------------------


# Jerks without an expectation are shown if a limit acts on them.
_OF_JERK = ("status_time.JERK_LIMITED", "status_time.JERK_EXCEEDED")


class _Figures:
    """The metrics of a card; those not yet shown remain for the last sheet.

    Metrics without information are not shown, neither of the card nor of the baseline beside it: undefined
    ones, torques of a plant without any, torques with gravity compensation where there is none, a jerk
    without limits, and events that did not happen: contacts, actuators at their limits, commands that a
    profile refuses, damping, slowing and standing still.
    """

    def __init__(self, card: "Scorecard", beside: "Scorecard | None", expected: Collection[str]) -> None:
        self.card, self.beside, self.expected = card, beside, frozenset(expected)
        shown = [_said(one) for one in (card, beside) if one]
        self.left = {
            name: one for name, one in card.items() if name in expected or any(name in said for said in shown)
        }

    def other(self, name: str) -> str:
        """Return a metric of the baseline beside the card, as text."""
        figure = None if self.beside is None else self.beside.figures.get(name)
        return "" if figure is None else _text(figure)

    def text(self, name: str) -> str:
        """Return a metric as text, and an empty text for one that this card does not have."""
        figure = self.left.pop(name, None)
        return "" if figure is None else _text(figure)

    def texts(self, group: str, *names: str) -> tuple[str, ...]:
        """Return some metrics of a group."""
        return tuple(self.text(f"{group}.{name}") for name in names)

    def unit(self, name: str) -> str:
        """Return the unit of a metric that this card has."""
        return _unit(self.card[name])


def _said(card: "Scorecard") -> set[str]:
    """Return the names of the metrics with information."""
    silent = [] if card["chatter"].value else ["chatter_joint"]
    if not float(card["profile.refused"].value) > 0.0:
        silent.append("profile.")
    silent += [group for group in ("contact.", "torque_limited.") if not card[f"{group}time"].value]
    if all(_same(card[f"tau_total.{name}"], card[f"tau.{name}"]) for name in ("peak", "share_of_limit")):
        silent.append("tau_total.")
    if not card["ticks"].value:
        return {name for name in card if not name.startswith(tuple(silent))}
    silent += ["secondary_error."] * math.isnan(float(card["secondary_error.max"].value))
    silent += ["tau."] * (not card["tau.peak"].value) + ["damping."] * (not card["damping.max"].value)
    silent += ["stuck."] * (not card["stuck.longest"].value)
    silent += ["path_rate."] * (card["path_rate.min"].value == 1.0)
    silent += ["joint_jerk_cmd."] * (not any(card[name].value for name in _OF_JERK))
    return {
        name
        for name, one in card.items()
        if not (name.startswith(tuple(silent)) or one.value == "" or one.value != one.value)
        and (one.value or not name.startswith("status_time."))
    }


def sheets(
    card: "Scorecard", outcomes: Sequence["Outcome"] = (), baseline: "Scorecard | None" = None
) -> list[Sheet]:
    """Return the tables without a form.

    Args:
        card: The scorecard.
        outcomes: Outcomes of the scenario's expectations; none: no such table.
        baseline: The metrics of the baseline beside them, if any.
    """
    figures = _Figures(card, baseline, [one.name for one in outcomes])
    found = [_outcomes(outcomes)] if outcomes else []
    found += [_peaks(figures), _joints(figures), _errors(figures)]
    status = _status(figures)
    others = [
        (name, figures.text(name), figures.unit(name), *_beside(figures, name)) for name in list(figures.left)
    ]
    headings = ("", "value", "unit", *_over(figures))
    rest = Sheet("Singularity and run", headings, others, frozenset({0, 2}))
    return [*found, rest, status]


def _outcomes(outcomes: Sequence["Outcome"]) -> Sheet:
    rows = [("ok" if one.ok else "MISSED", str(one)) for one in outcomes]
    return Sheet("Expected", ("", ""), rows, frozenset({0, 1}))


def _peaks(figures: _Figures) -> Sheet:
    rows = []
    for group in (one for one in _PEAKS if f"{one}.peak" in figures.left):
        peak, joint, time, rms = figures.texts(group, "peak", "peak_joint", "peak_time", "rms")
        told = group, peak, figures.unit(f"{group}.peak"), joint, time, rms
        rows.append((*told, *_beside(figures, f"{group}.peak")))
    headings = ("", "peak", "unit", "joint", "at [s]", "rms", *_over(figures, "peak"))
    return Sheet("Peaks", headings, rows, frozenset({0, 2, 3}))


def _joints(figures: _Figures) -> Sheet:
    """Return one row per joint; units stand in the headings, or beside the joint where they differ."""
    columns = (
        ("rate", "joint_rate", "peak"), ("", "joint_rate", "peak_time"), ("", "joint_rate", "rms"),
        ("command", "joint_rate_cmd", "peak"), ("", "joint_rate_cmd", "peak_time"),
        ("", "joint_rate_cmd", "rms"), ("accel.", "joint_acceleration", "peak"),
        *[("torque", "tau", "peak")] * any(name.startswith("tau.") for name in figures.left),
    )  # fmt: skip
    words = {"peak": "peak", "peak_time": "at", "rms": "rms"}
    joints = figures.card.joints
    kinds = [figures.unit(f"joint_rate.{joint}.peak").removesuffix("/s") for joint in joints]
    mixed = len(set(kinds)) > 1
    headings = ["joint"]
    for over, group, suffix in columns:
        units = {figures.unit(f"{group}.{joint}.{suffix}") for joint in joints}
        unit = units.pop() if len(units) == 1 else ""
        headings.append(f"{over}\n{words[suffix]}\n{unit}")
    rows = [
        (
            f"{joint} [{kind}]" if mixed else joint,
            *(figures.text(f"{group}.{joint}.{suffix}") for _, group, suffix in columns),
        )
        for joint, kind in zip(joints, kinds, strict=True)
    ]
    return Sheet("Joints", tuple(headings), rows)


def _errors(figures: _Figures) -> Sheet:
    rows = [
        (
            group, *figures.texts(group, "rms", "max", "max_time", "end"), figures.unit(f"{group}.rms"),
            *_beside(figures, f"{group}.max"),
        )
        for group in _ERRORS
        if f"{group}.max" in figures.left
    ]  # fmt: skip
    headings = ("", "rms", "max", "at [s]", "end", "unit", *_over(figures, "max"))
    return Sheet("Errors", headings, rows, frozenset({0, 5}))


def _status(figures: _Figures) -> Sheet:
    prefix, duration = "status_time.", figures.card["duration"].value
    rows = []
    for name in [name for name in figures.left if name.startswith(prefix)]:
        seconds = figures.card[name].value
        share = f"{float(seconds) / float(duration):.1%}" if duration else UNDEFINED
        rows.append((name.removeprefix(prefix), figures.text(name), share, *_beside(figures, name)))
    return Sheet("Time in each status", ("", "s", "share", *_over(figures, "s")), rows)


def _beside(figures: _Figures, name: str) -> tuple[str, ...]:
    """Return the cell of the baseline beside the card, if there is one."""
    return () if figures.beside is None else (figures.other(name),)


def _over(figures: _Figures, what: str = "") -> tuple[str, ...]:
    """Return the heading of that cell."""
    return () if figures.beside is None else (f"baseline\n{what}".strip(),)


# Texts ------------------------------------------------------------------------------------------


def _same(one: "Figure", other: "Figure") -> bool:
    return _text(one) == _text(other)


def _text(figure: "Figure") -> str:
    value = figure.value
    if isinstance(value, str):
        return value or UNDEFINED
    if isinstance(value, int):
        return str(value)
    # A time must identify its tick, even late in a run.
    return f"{value:.3f}" if figure.unit == "s" and 10.0 <= value < 1000.0 else number(value)


def _unit(figure: "Figure") -> str:
    return "" if figure.unit == "1" else figure.unit


def _kind(row: SchemaRow) -> str:
    """Return type, unit and default of a key in one line."""
    unit = f" [{row.unit}]" if row.unit not in ("", "1") else ""
    default = ", required" if row.default == "required" else f", default {row.default}"
    return f"{row.type}{unit}{default}"
