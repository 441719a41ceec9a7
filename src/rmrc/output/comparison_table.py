"""Variants beside each other: a row a variant, for a terminal and as markdown."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from rmrc.output.sheets import UNDEFINED, Sheet, as_markdown, as_table, escaped, number
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
    return Group(Text(name, style="bold"), Text(), as_table(_sheet(rows)))


def markdown(name: str, rows: Sequence[Row]) -> str:
    """Return what `render` shows as a markdown document.

    Args:
        name: Of the scenario.
        rows: One or more.
    """
    return f"# {escaped(name)}\n\n{as_markdown(_sheet(rows))}\n"


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


def _sheet(rows: Sequence[Row]) -> Sheet:
    columns = [
        ("rate\npeak", "joint_rate.peak"),
        ("rate\nrms", "joint_rate.rms"),
        ("accel.\npeak", "joint_acceleration.peak"),
        ("error\nalong", "error_along.max"),
        ("error\nacross", "error_across.max"),
        ("pos. err.\nat end", "position_error.end"),
        ("rot. err.\nat end", "orientation_error.end"),
        ("time\nDAMPED", "status_time.DAMPED"),
    ]
    columns = [(title, figure) for title, figure in columns if any(figure in row.card for row in rows)]
    headings = [f"{title}\n{_unit(figure, rows)}" for title, figure in columns]
    cells = [
        (_label(row), *(_figure(row, figure) for _, figure in columns), flipped(row.run), _expect(row))
        for row in rows
    ]
    words = frozenset({0, len(columns) + 1, len(columns) + 2})
    return Sheet("", ("variant", *headings, "flipped", "expect"), cells, words)


def _unit(figure: str, rows: Sequence[Row]) -> str:
    """Return the units of a figure, each in a line: arms may have joints of both kinds."""
    units = (unit for row in rows if figure in row.card for unit in row.card[figure].unit.split(" or "))
    return "\nor ".join(dict.fromkeys(units))


def _figure(row: Row, figure: str) -> str:
    return number(float(row.card[figure].value)) if figure in row.card else UNDEFINED


def _label(row: Row) -> str:
    """Return the label, and below it when the run ended if that was too early."""
    if row.run.divergence:
        return f"{row.label}\ndiverged at {row.run.divergence.time:.3f} s"
    return row.label if row.run.is_complete else f"{row.label}\ninterrupted"


def _expect(row: Row) -> str:
    missed = sum(not outcome.ok for outcome in row.outcomes)
    return (f"missed {missed}" if missed else "met") if row.outcomes else UNDEFINED
