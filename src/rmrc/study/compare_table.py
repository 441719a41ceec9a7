"""Table of variants: one row per variant, for a terminal and as Markdown."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rmrc.results.metrics import joint_changes
from rmrc.results.run import Run
from rmrc.scenario import Variant
from rmrc.scenario.choices import IN_RUNS
from rmrc.show.sheets import UNDEFINED, Sheet, as_markdown, number
from rmrc.study.study import Ran
from rmrc.support.legible import escaped

# A joint that ends this far from its start has flipped [rad]; a sliding one by that share of the
# characteristic length. Tracking errors are a hundred times smaller, and an elbow on its other side is far
# beyond.
FLIPPED = 0.5

# Headings of the metrics in groups that stay together where a terminal is narrow.
_FIGURES = (
    {
        "joint_rate.peak": "rate\npeak",
        "joint_rate_cmd.peak": "command\npeak",
        "joint_rate.rms": "rate\nrms",
        "joint_acceleration.peak": "accel.\npeak",
        "tau.share_of_limit": "torque\npeak",
    },
    {
        "position_error_along.max": "pos.\nerror\nalong",
        "position_error_across.max": "pos.\nerror\nacross",
        "orientation_error_along.max": "rot.\nerror\nalong",
        "orientation_error_across.max": "rot.\nerror\nacross",
        "position_error.end": "pos.\nerror\nat end",
        "orientation_error.end": "rot.\nerror\nat end",
    },
    {f"status_time.{one.name}": f"time\n{one.name}" for one in IN_RUNS},
)
_TIMES = "status_time."


@dataclass(frozen=True, eq=False)
class Compared(Ran):
    """The result of one variant.

    Attributes:
        variant: Its label and changes.
        stated_for: If some expectations do not apply: the choices in which the variant differs, with the
            scenario's values.
    """

    variant: Variant
    stated_for: Mapping[str, str]


def sheets(name: str, rows: Sequence[Compared]) -> list[Sheet]:
    """Return the table for a terminal, with the name above and notes below.

    Args:
        name: Name of the scenario.
        rows: One or more.
    """
    variants, groups = _columns(rows)
    columns = [variants, *(column for group in groups for column in group)]
    table = _sheet(columns, tuple(map(_over, columns)), tuple(map(len, groups)))
    parts = [Sheet(name), table]
    parts += [Sheet("", notes=(note,)) for note in _notes(rows)]
    return [*parts[:-1], replace(parts[-1], is_spaced=False)]


def _over(column: "_Column") -> str:
    """Return a heading, with one line per unit for an arm with both kinds of joints."""
    return "\n".join([column.title, "\nor ".join(column.units)]) if column.units else column.title


def markdown(rows: Sequence[Compared]) -> str:
    """Return the same as Markdown, one narrow table per group, to fit the recording.

    Args:
        rows: One or more.
    """
    variants, groups = _columns(rows)
    blocks = []
    for group in groups:
        columns = [variants, *group]
        units = tuple(", ".join(one.units) for one in columns)
        sheet = _sheet(columns, tuple(one.title for one in columns))
        blocks.append(as_markdown(replace(sheet, rows=[units, *sheet.rows]) if any(units) else sheet))
    return "\n\n".join([*blocks, *map(escaped, _notes(rows))]) + "\n"


def _sheet(columns: Sequence["_Column"], headings: tuple[str, ...], groups: tuple[int, ...] = ()) -> Sheet:
    rows = list(zip(*(one.cells for one in columns), strict=True))
    words = frozenset(index for index, one in enumerate(columns) if one.words)
    return Sheet("", headings, rows, words, groups)


def flipped(run: Run) -> str:
    """Return the joints that ended in another posture after a closed path.

    Returns:
        `no`, or the names of the flipped joints; for a redundant arm, whose posture may drift, the largest
        change with its unit; `-` for an open path.
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
    units: Sequence[str]
    cells: Sequence[str]
    words: bool = False


def _columns(rows: Sequence[Compared]) -> tuple[_Column, list[list[_Column]]]:
    """Return the names of the variants, and the columns in groups: settings, then results."""
    groups = []
    for titles in _FIGURES:
        group = []
        for figure, title in titles.items():
            cards = [row.scorecard for row in rows if figure in row.scorecard]
            units = [unit for card in cards for unit in card[figure].unit.split(" or ")]
            is_time = figure.startswith(_TIMES)
            if units and not (is_time and all(row.scorecard[figure].value == 0.0 for row in rows)):
                known = ["of limit" if unit == "1" else unit for unit in dict.fromkeys(units)]
                group.append(_Column(title, known, [_figure(row, figure) for row in rows]))
        groups.append(group)
    ends = [
        _Column("flipped", [], [flipped(row.run) for row in rows], words=True),
        _Column("expect", [], [_expect(row) for row in rows], words=True),
    ]
    variants = _Column("variant", [], [_label(row) for row in rows], words=True)
    return variants, [group for group in (*groups, ends) if group]


def _notes(rows: Sequence[Compared]) -> list[str]:
    """Return the note about expectations that do not apply, if any."""
    wanted = dict.fromkeys(pair for row in rows for pair in row.stated_for.items())
    law = " and ".join(f"{key}={value}" for key, value in wanted)
    return (
        [f'"-": the expectations of the scenario are for {law}; they are not checked for other choices.']
        if wanted
        else []
    )


def _figure(row: Compared, figure: str) -> str:
    return number(float(row.scorecard[figure].value)) if figure in row.scorecard else UNDEFINED


def _label(row: Compared) -> str:
    """Return the label, and below it the progress of an incomplete run."""
    if row.run.divergence:
        return f"{row.variant.label}\ndiverged at {row.run.divergence.time:.3f} s"
    return row.variant.label if row.run.is_complete else f"{row.variant.label}\nunfinished"


def _expect(row: Compared) -> str:
    missed = sum(not outcome.ok for outcome in row.outcomes)
    return (f"missed {missed}" if missed else "met") if row.outcomes else UNDEFINED
