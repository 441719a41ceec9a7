"""Scorecards and the keys of a scenario as tables: for a terminal, and as markdown for a recording.

Both forms show the same sheets, and these hold every figure that says something. Nothing depends on color
alone, is cut off, or is read as markup.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from rmrc.scenario import SchemaRow
from rmrc.show.sheets import UNDEFINED, Sheet, as_markdown, escaped, number
from rmrc.show.terminal import Fitted, as_table

if TYPE_CHECKING:  # with numba, which a table of keys does without
    from rmrc.results.scorecard import Figure, Outcome, Scorecard

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


def render(card: "Scorecard", outcomes: Sequence["Outcome"] = ()) -> RenderableType:
    """Return all figures, and what was expected of them, for a terminal.

    Args:
        card: The figures.
        outcomes: Of the scenario's expectations; none: no such table.
    """
    *sheets, rest, status = _sheets(card, outcomes)
    parts = [part for sheet in sheets for part in (as_table(sheet), Text())]
    return Group(Text(card.name, style="bold"), Text(), *parts, _Beside(as_table(rest), as_table(status)))


class _Beside:
    """Two tables beside each other, or below where the terminal is not wide enough."""

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


def markdown(card: "Scorecard", outcomes: Sequence["Outcome"] = ()) -> str:
    """Return what `render` shows as a markdown document.

    Args:
        card: The figures.
        outcomes: Of the scenario's expectations; none: no such table.
    """
    blocks = [f"# {escaped(card.name)}", *map(as_markdown, _sheets(card, outcomes))]
    return "\n\n".join(blocks) + "\n"


def schema(rows: Sequence[SchemaRow]) -> RenderableType:
    """Return the keys of a scenario for a terminal: keys whole, the rest beside them, or below if narrow."""
    return _Keys(rows)


class _Keys:
    """Keys with what there is to say about each, words whole."""

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
    """Return the keys of a scenario a line each, aligned, never wrapped: for a pipe or a file."""
    table = [("key", "type", "unit", "default", "meaning"), *rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)) for row in table)
    return "".join(f"{line.rstrip()}\n" for line in lines)


# Sheets -----------------------------------------------------------------------------------------


class _Figures:
    """The figures of a card; those not yet shown are left over for the last sheet.

    What says nothing is not shown: torques with gravity compensation where there is none, and what did not
    happen of contacts, of drives at their limits and of commands that a profile refuses.
    """

    def __init__(self, card: "Scorecard") -> None:
        silent = [] if card["chatter"].value else ["chatter_joint"]
        if not float(card["profile.refused"].value) > 0.0:
            silent.append("profile.")
        silent += [group for group in ("contact.", "torque_limited.") if not card[f"{group}time"].value]
        if all(_same(card[f"tau_total.{name}"], card[f"tau.{name}"]) for name in ("peak", "share_of_limit")):
            silent.append("tau_total.")
        self.card = card
        self.left = {name: one for name, one in card.items() if not name.startswith(tuple(silent))}

    def text(self, name: str) -> str:
        """Return a figure as text, and nothing for one that this card does not have."""
        figure = self.left.pop(name, None)
        return "" if figure is None else _text(figure)

    def texts(self, group: str, *names: str) -> tuple[str, ...]:
        """Return some figures of a group."""
        return tuple(self.text(f"{group}.{name}") for name in names)

    def unit(self, name: str) -> str:
        """Return the unit of a figure that this card has."""
        return _unit(self.card[name])


def _sheets(card: "Scorecard", outcomes: Sequence["Outcome"]) -> list[Sheet]:
    figures = _Figures(card)
    sheets = [_outcomes(outcomes)] if outcomes else []
    sheets += [_peaks(figures), _joints(figures), _errors(figures)]
    status = _status(figures)
    others = [(name, figures.text(name), figures.unit(name)) for name in list(figures.left)]
    rest = Sheet("Singularity and run", ("", "value", "unit"), others, frozenset({0, 2}))
    return [*sheets, rest, status]


def _outcomes(outcomes: Sequence["Outcome"]) -> Sheet:
    rows = [("ok" if one.ok else "MISSED", str(one)) for one in outcomes]
    return Sheet("Expected", ("", ""), rows, frozenset({0, 1}))


def _peaks(figures: _Figures) -> Sheet:
    rows = []
    for group in (one for one in _PEAKS if f"{one}.peak" in figures.left):
        peak, joint, time, rms = figures.texts(group, "peak", "peak_joint", "peak_time", "rms")
        rows.append((group, peak, figures.unit(f"{group}.peak"), joint, time, rms))
    return Sheet("Peaks", ("", "peak", "unit", "joint", "at [s]", "rms"), rows, frozenset({0, 2, 3}))


def _joints(figures: _Figures) -> Sheet:
    """Return one row per joint; units stand in the headings, or beside the joint where they differ."""
    columns = (
        ("rate", "joint_rate", "peak"), ("", "joint_rate", "peak_time"), ("", "joint_rate", "rms"),
        ("command", "joint_rate_cmd", "peak"), ("", "joint_rate_cmd", "peak_time"),
        ("", "joint_rate_cmd", "rms"), ("accel.", "joint_acceleration", "peak"), ("torque", "tau", "peak"),
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
        (group, *figures.texts(group, "rms", "max", "max_time", "end"), figures.unit(f"{group}.rms"))
        for group in _ERRORS
        if f"{group}.rms" in figures.card
    ]
    return Sheet("Errors", ("", "rms", "max", "at [s]", "end", "unit"), rows, frozenset({0, 5}))


def _status(figures: _Figures) -> Sheet:
    prefix, duration = "status_time.", figures.card["duration"].value
    rows = []
    for name in [name for name in figures.card if name.startswith(prefix)]:
        seconds = figures.card[name].value
        share = f"{float(seconds) / float(duration):.1%}" if duration else UNDEFINED
        rows.append((name.removeprefix(prefix), figures.text(name), share))
    return Sheet("Time in each status", ("", "s", "share"), rows)


# Texts ------------------------------------------------------------------------------------------


def _same(one: "Figure", other: "Figure") -> bool:
    return _text(one) == _text(other)


def _text(figure: "Figure") -> str:
    value = figure.value
    if isinstance(value, str):
        return value or UNDEFINED
    if isinstance(value, int):
        return str(value)
    # A time must name its tick, even late in a run.
    return f"{value:.3f}" if figure.unit == "s" and 10.0 <= value < 1000.0 else number(value)


def _unit(figure: "Figure") -> str:
    return "" if figure.unit == "1" else figure.unit


def _kind(row: SchemaRow) -> str:
    """Return type, unit and default of a key in one line."""
    unit = f" [{row.unit}]" if row.unit not in ("", "1") else ""
    default = ", required" if row.default == "required" else f", default {row.default}"
    return f"{row.type}{unit}{default}"
