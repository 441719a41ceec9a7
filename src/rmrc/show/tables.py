"""The scorecard of a run as sheets: the few metrics that matter, or all that say something.

In a terminal, sheets are tables of rich, in which words wrap and numbers stay whole. Nothing depends on
color alone, is cut off, or is read as markup.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.table import Table
from rich.text import Text

from rmrc.show.sheets import UNDEFINED, Sheet, as_markdown, number
from rmrc.support.text import escaped, visible

if TYPE_CHECKING:
    from rmrc.results.expectations import Outcome
    from rmrc.results.scorecard import Scorecard

_STYLES = {"ok": "green", "met": "green", "MISSED": "bold red", "missed": "bold red"}


def render(sheets: Sequence[Sheet]) -> RenderableType:
    """Return sheets one below another, with an empty line between them."""
    parts: list[RenderableType] = []
    for sheet in sheets:
        parts += [Text()] * bool(parts)
        parts += [Text(visible(sheet.title), "bold")] * bool(sheet.title)
        parts += [_Columns(sheet)] * bool(sheet.headings)
        parts += [Text(visible(note)) for note in sheet.notes]
    return Group(*parts)


class _Columns:
    """A table, or several below one another with some of its columns each where the terminal is narrow."""

    def __init__(self, sheet: Sheet) -> None:
        self._sheet, self._gap = sheet, 2 if len(sheet.headings) < 6 else 1
        columns = zip(sheet.headings, *sheet.rows, strict=True)
        self._least = [_least(*column, is_text=i in sheet.left) for i, column in enumerate(columns)]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for i, part in enumerate(self._parts(options.max_width)):
            yield from [Text()] * bool(i)
            yield self._table(part)

    def _parts(self, width: int) -> Iterator[list[int]]:
        """Yield the columns of each table, each with the first, which names the rows."""
        part = [0]
        for column in range(1, len(self._least)):
            if len(part) > 1 and sum(self._least[i] + self._gap for i in [*part, column]) - self._gap > width:
                yield part
                part = [0]
            part.append(column)
        yield part

    def _table(self, part: Sequence[int]) -> Table:
        sheet = self._sheet
        table = Table(
            box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, self._gap - 1, 0, 0),
            collapse_padding=True, show_header=any(sheet.headings[i] for i in part),
        )  # fmt: skip
        for i in part:
            is_text = i in sheet.left
            heading = sheet.headings[i] if is_text else "\n".join(sheet.headings[i].split())
            table.add_column(
                _styled(heading), justify="left" if is_text else "right", no_wrap=not is_text, overflow="fold"
            )
        for row in sheet.rows:
            table.add_row(
                *(_styled(row[i], _STYLES.get(row[i].split(",")[0].split(" ")[0], "")) for i in part)
            )
        return table


def _least(heading: str, *cells: str, is_text: bool) -> int:
    """Return the width of a column whose words, or whose numbers and words of the heading, stay whole."""
    pieces = [*heading.split(), *(part for cell in cells for part in (cell.split() if is_text else [cell]))]
    return max(map(cell_len, pieces), default=0)


def _styled(text: str, style: str = "") -> Text:
    return Text(visible(text, keep="\n"), style)


# The metrics that matter; the expected ones are shown beside them.
FEW = (
    *("joint_rate.peak", "joint_rate_cmd.peak", "joint_rate_plain.peak"),
    *("position_error.max", "position_error.end", "orientation_error.max", "orientation_error.end"),
    *("sigma.min", "damping.max", "tau.share_of_limit"),
    *("stuck.longest", "contact.time", "contact.first_bodies", "profile.refused"),
)
PLAIN, STATUS = "joint_rate_plain", "status_time."
# Metrics that say something only if another one is above 0: of events, and of jerks on which a limit acts.
EVENTS = {
    "profile.": ("profile.refused",), "contact.": ("contact.time",), "stuck.": ("stuck.longest",),
    "torque_limited.": ("torque_limited.time",), "tau.": ("tau.peak",), "damping.": ("damping.max",),
    "joint_jerk_cmd.": (f"{STATUS}JERK_LIMITED", f"{STATUS}JERK_EXCEEDED"),
}  # fmt: skip


def few(card: "Scorecard", outcomes: Sequence["Outcome"] = (), baseline: "Scorecard | None" = None) -> Sheet:
    """Return the metrics that matter, with their expectations and the baseline beside them.

    Args:
        card: The scorecard.
        outcomes: Outcomes of the scenario's expectations.
        baseline: The metrics of its baseline, if it has one.
    """
    rows, also, telling = [], list[str](), _telling(card, baseline)
    expected = {one.name: one for one in outcomes}
    for name in dict.fromkeys((*(name for name in FEW if name in telling), *expected)):
        unit, outcome = _unit(card, name), expected.get(name)
        value = _text(card, name) if name in card or outcome is None else number(outcome.value)
        if outcome is not None and outcome.ok and name not in FEW:
            also.append(f"{name} {value} {unit}".strip())
            continue
        wanted = ""
        if outcome is not None:
            wanted = f"{'ok' if outcome.ok else 'MISSED'}, {outcome.wanted.removesuffix(f' {unit}')}"
        beside = ("",) * bool(baseline) if name.startswith(PLAIN) else _beside(baseline, name)
        rows.append((name, value, unit, wanted, *beside))
    notes = [f"{PLAIN}: of the plain inverse, at this run's own states"] * (f"{PLAIN}.peak" in telling)
    notes += [f"also ok: {', '.join(also)}"] * bool(also)
    for title, each in (("", card), ("baseline: ", baseline)):
        if each is not None:
            names = [name for name in each if name.startswith(STATUS) and each[name].value]
            times = [f"{name.removeprefix(STATUS)} {_text(each, name)} s" for name in names]
            notes += [f"{title}{', '.join(times)}"] * bool(times)
    headings = ("", "value", "unit", "expected" if outcomes else "", *_over(baseline))
    return Sheet("", headings, rows, frozenset({0, 2, 3}), tuple(notes))


def sheets(
    card: "Scorecard", outcomes: Sequence["Outcome"] = (), baseline: "Scorecard | None" = None
) -> list[Sheet]:
    """Return all metrics that say something of a run or of its baseline; arguments as of `few`."""
    telling = _telling(card, baseline) | {one.name for one in outcomes}
    names = [name for name in card if name in telling]
    peaks = [name.removesuffix(".peak") for name in names if name.endswith(".peak")]
    whole = [group for group in peaks if f"{group}.peak_joint" in card]
    errors = [group for group in (name.removesuffix(".max") for name in names) if f"{group}.end" in card]
    of_joints = {"peak": "peak", "peak_time": "at [s]", "rms": "rms"}
    of_errors = {"max": "max", "max_time": "at [s]", "rms": "rms", "end": "end"}
    tables, shown = list[Sheet](), set[str]()
    rows = list[tuple[str, ...]]()
    if outcomes:
        rows = [("ok" if one.ok else "MISSED", str(one)) for one in outcomes]
        tables.append(Sheet("Expected", ("", ""), rows, frozenset({0, 1})))
    for title, groups, columns in (
        ("Peaks", whole, {**of_joints, "peak_joint": "joint"}),
        ("Joints", [group for group in peaks if group not in whole], of_joints),
        ("Errors", errors, of_errors),
    ):
        first, rows = next(iter(columns)), []
        for group in groups:
            parts = [f"{group}.{column}" for column in columns]
            cells = [_text(card, part) if part in telling else "" for part in parts]
            unit = _unit(card, f"{group}.{first}")
            rows.append((group, *cells, unit, *_beside(baseline, f"{group}.{first}")))
            shown.update(parts)
        headings = ("", *columns.values(), "unit", *_over(baseline, first))
        words = [i for i, heading in enumerate(headings) if heading in ("", "joint", "unit")]
        tables.append(Sheet(title, headings, rows, frozenset(words)))
    others = [name for name in names if name not in shown and not name.startswith(STATUS)]
    rows = [(name, _text(card, name), _unit(card, name), *_beside(baseline, name)) for name in others]
    headings = ("", "value", "unit", *_over(baseline))
    tables.append(Sheet("Singularity and run", headings, rows, frozenset({0, 2})))
    rows, duration = [], float(card["duration"].value)
    for name in [name for name in names if name.startswith(STATUS)]:
        share = f"{float(card[name].value) / duration:.1%}" if duration else UNDEFINED
        rows.append((name.removeprefix(STATUS), _text(card, name), share, *_beside(baseline, name)))
    return [*tables, Sheet("Time in each status", ("", "s", "share", *_over(baseline)), rows)]


def markdown(
    card: "Scorecard", outcomes: Sequence["Outcome"] = (), baseline: "Scorecard | None" = None
) -> str:
    """Return the tables of `sheets` as a Markdown document; arguments as of `few`."""
    blocks = [f"# {escaped(card.name)}", *map(as_markdown, sheets(card, outcomes, baseline))]
    return "\n\n".join(blocks) + "\n"


def _telling(*cards: "Scorecard | None") -> set[str]:
    """Return the names of the metrics that say something of any of some runs.

    Undefined ones do not, nor a pace that is never reduced, a status that never came, and torques with
    gravity compensation where there is none.
    """
    telling = set[str]()
    for card in filter(None, cards):
        silent = [
            group for group, of in EVENTS.items() if not any(float(card[name].value) > 0 for name in of)
        ]
        silent += ["path_rate."] * (card["path_rate.min"].value == 1.0)
        silent += ["tau_total."] * (card["tau_total.peak"].value == card["tau.peak"].value)
        telling |= {
            name
            for name, figure in card.items()
            if _text(card, name) != UNDEFINED
            and not name.startswith(tuple(silent))
            and (figure.value or not name.startswith(STATUS))
        }
    return telling


def _beside(baseline: "Scorecard | None", name: str) -> tuple[str, ...]:
    """Return the cell of the baseline, if there is one."""
    return () if baseline is None else (_text(baseline, name) if name in baseline else "",)


def _over(baseline: "Scorecard | None", what: str = "") -> tuple[str, ...]:
    """Return the heading of that cell."""
    return () if baseline is None else (f"baseline\n{what}".strip(),)


def _text(card: "Scorecard", name: str) -> str:
    value, unit = card[name].value, card[name].unit
    if isinstance(value, str):
        return value or UNDEFINED
    if isinstance(value, int):
        return str(value)
    # A time must identify its tick, even late in a run.
    return f"{value:.3f}" if unit == "s" and 10.0 <= value < 1000.0 else number(value)


def _unit(card: "Scorecard", name: str) -> str:
    return "" if name not in card or card[name].unit == "1" else card[name].unit
