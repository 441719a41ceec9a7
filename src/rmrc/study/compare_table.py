"""Table of variants: one row per variant, for a terminal and as Markdown."""

import math
from collections.abc import Sequence

import numpy as np

from rmrc.results.metrics import joint_changes
from rmrc.results.run import Run
from rmrc.scenario.choices import IN_RUNS
from rmrc.show.sheets import UNDEFINED, Sheet, number
from rmrc.study.study import Result

# A joint that ends this far from its start has flipped [rad]; a sliding one by that share of the
# characteristic length. Tracking errors are a hundred times smaller, and an elbow on its other side is far
# beyond.
FLIPPED = 0.5

# Headings of the metrics in groups that stay together where a terminal is narrow.
_FIGURES = (
    {"joint_rate.peak": "rate\npeak", "joint_rate_cmd.peak": "command\npeak", "joint_rate.rms": "rate\nrms",
     "joint_acceleration.peak": "accel.\npeak", "tau.share_of_limit": "torque\npeak"},
    {"position_error_along.max": "pos.\nerror\nalong", "position_error_across.max": "pos.\nerror\nacross",
     "orientation_error_along.max": "rot.\nerror\nalong",
     "orientation_error_across.max": "rot.\nerror\nacross", "position_error.end": "pos.\nerror\nat end",
     "orientation_error.end": "rot.\nerror\nat end"},
    {f"status_time.{status.name}": f"time\n{status.name}" for status in IN_RUNS},
)  # fmt: skip


def table(name: str, labels: Sequence[str], results: Sequence[Result]) -> Sheet:
    """Return the table.

    Args:
        name: Name of the scenario.
        labels: Label of each variant.
        results: Result of each.
    """
    groups = [[_column(results, *figure) for figure in titles.items()] for titles in _FIGURES]
    words = [("flipped", *(flipped(result.run) for result in results)), ("expect", *map(_expect, results))]
    groups = [[*filter(None, group)] for group in (*groups, words) if any(group)]
    variants = ("variant", *map(_label, labels, results))
    heading, *rows = zip(variants, *(column for group in groups for column in group), strict=True)
    of_words = frozenset({0, len(heading) - 2, len(heading) - 1})
    return Sheet(name, heading, rows, of_words, tuple(map(len, groups)))


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
        return f"{number(changes.max())} {run.joint_unit(int(changes.argmax()))}"
    far = changes / np.where(run.is_slide, run.length, 1.0) > FLIPPED
    return ", ".join(joint for joint, is_far in zip(run.joints, far, strict=True) if is_far) or "no"


def _column(results: Sequence[Result], metric: str, title: str) -> tuple[str, ...]:
    """Return the heading of a metric with its units, and its cells; nothing if no variant has it."""
    figures = [result.scorecard.get(metric) for result in results]
    units = dict.fromkeys(unit for figure in figures if figure for unit in figure.unit.split(" or "))
    if not units or (title.startswith("time") and not any(figure and figure.value for figure in figures)):
        return ()
    heading = "\nor ".join("of limit" if unit == "1" else unit for unit in units)
    cells = [number(float(figure.value)) if figure else UNDEFINED for figure in figures]
    return f"{title}\n{heading}", *cells


def _label(label: str, result: Result) -> str:
    """Return the label, and below it the progress of an incomplete run."""
    if result.run.divergence:
        return f"{label}\ndiverged at {result.run.divergence.time:.3f} s"
    return label if result.run.is_complete else f"{label}\nunfinished"


def _expect(result: Result) -> str:
    missed = sum(not outcome.ok for outcome in result.outcomes)
    return (f"missed {missed}" if missed else "met") if result.outcomes else UNDEFINED
