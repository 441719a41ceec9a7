"""Variants beside each other: a row a variant, for a terminal and as markdown."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from rmrc.output.sheets import UNDEFINED, Sheet, as_markdown, as_table, number
from rmrc.run import Run
from rmrc.scorecard import Outcome, Scorecard, joint_changes

# A joint that comes back so far from where it started has flipped [rad]; a sliding one by that share of the
# characteristic length. Tracking errors are a hundred times less, an elbow on its other side is far beyond.
FLIPPED = 0.5


class Row(NamedTuple):
    """What one variant gave.

    Attributes:
        label: Of the variant.
        run: As far as it came.
        card: Its figures.
        outcomes: Of the scenario's expectations.
    """

    label: str
    run: Run
    card: Scorecard
    outcomes: Sequence[Outcome]


def render(name: str, rows: Sequence[Row]) -> RenderableType:
    """Return the table for a terminal of 100 columns or more.

    Args:
        name: Of the scenario.
        rows: One or more.
    """
    columns = _columns(rows)
    # In a heading, each unit of an arm with joints of both kinds has a line of its own.
    over = tuple("\n".join([title, "\nor ".join(units)]) for title, _, units in columns)
    sheet = Sheet("", ("variant", *over, "flipped", "expect"), _cells(rows, columns), _words(columns))
    return Group(Text(name, style="bold"), Text(), as_table(sheet))


def markdown(rows: Sequence[Row]) -> str:
    """Return the same as markdown, with the units in a row of their own: the recording has little room.

    Args:
        rows: One or more.
    """
    columns = _columns(rows)
    units = ("", *(", ".join(units) for _, _, units in columns), "", "")
    over = ("variant", *(title for title, _, _ in columns), "flipped", "expect")
    return as_markdown(Sheet("", over, [units, *_cells(rows, columns)], _words(columns))) + "\n"


def flipped(run: Run) -> str:
    """Return which joints came back to another posture after a path that ends where it began.

    Returns:
        `no`, or the names of the joints that flipped; the largest change with its unit for a redundant
        arm, whose posture may drift without a flip; `-` where the path does not lead back.
    """
    changes = joint_changes(run)
    if math.isnan(changes[0]):
        return UNDEFINED
    if len(run.axes) < len(run.joints):
        largest = int(np.argmax(changes))
        return f"{number(changes[largest])} {run.joint_unit(largest)}"
    far = changes / np.where(run.is_slide, run.length, 1.0) > FLIPPED
    return ", ".join(joint for joint, is_far in zip(run.joints, far, strict=True) if is_far) or "no"


class _Column(NamedTuple):
    title: str
    figure: str
    units: list[str]


def _columns(rows: Sequence[Row]) -> list[_Column]:
    """Return the columns of numbers that any row has."""
    titles = {
        "joint_rate.peak": "rate\npeak",
        "joint_rate.rms": "rate\nrms",
        "joint_acceleration.peak": "accel.\npeak",
        "error_along.max": "error\nalong",
        "error_across.max": "error\nacross",
        "position_error.end": "pos. at\nend",
        "orientation_error.end": "rot. at\nend",
        "status_time.DAMPED": "time\nDAMPED",
    }
    columns = []
    for figure, title in titles.items():
        units = [unit for row in rows if figure in row.card for unit in row.card[figure].unit.split(" or ")]
        if units:
            columns.append(_Column(title, figure, list(dict.fromkeys(units))))
    return columns


def _words(columns: Sequence[_Column]) -> frozenset[int]:
    return frozenset({0, len(columns) + 1, len(columns) + 2})


def _cells(rows: Sequence[Row], columns: Sequence[_Column]) -> list[tuple[str, ...]]:
    return [
        (_label(row), *(_figure(row, column.figure) for column in columns), flipped(row.run), _expect(row))
        for row in rows
    ]


def _figure(row: Row, figure: str) -> str:
    return number(float(row.card[figure].value)) if figure in row.card else UNDEFINED


def _label(row: Row) -> str:
    """Return the label, and below it how far the run came if that was not to the end."""
    if row.run.divergence:
        return f"{row.label}\ndiverged at {row.run.divergence.time:.3f} s"
    return row.label if row.run.is_complete else f"{row.label}\nunfinished"


def _expect(row: Row) -> str:
    missed = sum(not outcome.ok for outcome in row.outcomes)
    return (f"missed {missed}" if missed else "met") if row.outcomes else UNDEFINED
