"""Table of variants: one row per variant, for a terminal and as Markdown."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise

import numpy as np

from rmrc.results.metrics import joint_changes
from rmrc.results.run import Run
from rmrc.scenario.choices import IN_RUNS
from rmrc.show.sheets import UNDEFINED, Sheet, as_markdown, number
from rmrc.study.study import Ran

# A joint that ends this far from its start has flipped [rad]; a sliding one by that share of the
# characteristic length. Tracking errors are a hundred times smaller, and an elbow on its other side is far
# beyond.
FLIPPED = 0.5

# Headings of the metrics in groups that stay together where a terminal is narrow.
_FIGURES = (
    {
        "joint_rate.peak": "rate\npeak", "joint_rate_cmd.peak": "command\npeak",
        "joint_rate.rms": "rate\nrms", "joint_acceleration.peak": "accel.\npeak",
        "tau.share_of_limit": "torque\npeak",
    },
    {
        **{f"{kind}_error_{part}.max": f"{short}.\nerror\n{part}"
           for kind, short in (("position", "pos"), ("orientation", "rot")) for part in ("along", "across")},
        "position_error.end": "pos.\nerror\nat end", "orientation_error.end": "rot.\nerror\nat end",
    },
    {f"status_time.{one.name}": f"time\n{one.name}" for one in IN_RUNS},
)  # fmt: skip


def table(name: str, labels: Sequence[str], results: Sequence[Ran], stated: Mapping[str, str]) -> Sheet:
    """Return the table.

    Args:
        name: Name of the scenario.
        labels: Label of each variant.
        results: Result of each.
        stated: The choices for which the scenario states expectations, if these do not apply to some variant.
    """
    groups = [[_column(results, *one) for one in titles.items()] for titles in _FIGURES]
    groups = [[column for column in group if column] for group in groups]
    words = [("flipped", *(flipped(one.run) for one in results)), ("expect", *map(_expect, results))]
    groups = [group for group in (*groups, words) if group]
    variants = ("variant", *map(_label, labels, results))
    heading, *rows = zip(variants, *(column for group in groups for column in group), strict=True)
    law = " and ".join(f"{key}={value}" for key, value in stated.items())
    note = f'"-": the expectations of the scenario are for {law}; they are not checked for other choices.'
    left = frozenset({0, len(heading) - 2, len(heading) - 1})
    return Sheet(name, heading, rows, left, tuple(map(len, groups)), (note,) if law else ())


def markdown(sheet: Sheet) -> str:
    """Return the table as Markdown: a narrow one per group of columns, to fit the recording."""
    parts = []
    for first, last in pairwise(accumulate(sheet.groups, initial=1)):
        heading, *rows = ((row[0], *row[first:last]) for row in (sheet.headings, *sheet.rows))
        left = frozenset({0, *(column - first + 1 for column in sheet.left if first <= column < last)})
        parts.append(Sheet("", heading, rows, left))
    parts[-1] = replace(parts[-1], notes=sheet.notes)
    return "\n\n".join(map(as_markdown, parts)) + "\n"


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


def _column(results: Sequence[Ran], metric: str, title: str) -> tuple[str, ...]:
    """Return the heading of a metric with its units, and its cells; nothing if no variant has it."""
    found = [one.scorecard.get(metric) for one in results]
    units = dict.fromkeys(unit for figure in found if figure for unit in figure.unit.split(" or "))
    if not units or (title.startswith("time") and not any(figure and figure.value for figure in found)):
        return ()
    heading = "\nor ".join("of limit" if unit == "1" else unit for unit in units)
    return f"{title}\n{heading}", *(number(float(one.value)) if one else UNDEFINED for one in found)


def _label(label: str, result: Ran) -> str:
    """Return the label, and below it the progress of an incomplete run."""
    if result.run.divergence:
        return f"{label}\ndiverged at {result.run.divergence.time:.3f} s"
    return label if result.run.is_complete else f"{label}\nunfinished"


def _expect(result: Ran) -> str:
    missed = sum(not outcome.ok for outcome in result.outcomes)
    return (f"missed {missed}" if missed else "met") if result.outcomes else UNDEFINED
