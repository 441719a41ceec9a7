"""Tables of variants: one row per variant, for a terminal and as Markdown."""

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

# The metrics of each table.
_RATES = (
    "joint_rate.peak", "joint_rate_cmd.peak", "joint_rate.rms", "joint_acceleration.peak",
    "tau.share_of_limit",
)  # fmt: skip
_ERRORS = (
    "position_error_along.max", "position_error_across.max", "orientation_error_along.max",
    "orientation_error_across.max", "position_error.end", "orientation_error.end",
)  # fmt: skip
_TIMES = tuple(f"status_time.{status.name}" for status in IN_RUNS)


def tables(name: str, labels: Sequence[str], results: Sequence[Result]) -> list[Sheet]:
    """Return the tables: rates, errors, times in each status, and how the variants ended.

    Args:
        name: Name of the scenario.
        labels: Label of each variant.
        results: Result of each.
    """
    variants = ("variant", *map(_label, labels, results))
    sheets = []
    for metrics in (_RATES, _ERRORS, _TIMES):
        columns = [column for metric in metrics if (column := _column(results, metric))]
        if columns:
            heading, *rows = zip(variants, *columns, strict=True)
            sheets.append(Sheet(name if metrics is _RATES else "", heading, rows))
    ends = ("flipped", *(flipped(result.run) for result in results)), ("expect", *map(_expect, results))
    heading, *rows = zip(variants, *ends, strict=True)
    return [*sheets, Sheet("", heading, rows, frozenset({0, 1, 2}))]


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


def _column(results: Sequence[Result], metric: str) -> tuple[str, ...]:
    """Return the heading of a metric with its units, and its cells; nothing if no variant has it."""
    figures = [result.scorecard.get(metric) for result in results]
    units = dict.fromkeys(unit for figure in figures if figure for unit in figure.unit.split(" or "))
    if not units or (metric in _TIMES and not any(figure and figure.value for figure in figures)):
        return ()
    group, _, last = metric.replace("error_", "error\n_").partition(".")
    heading = "\nor ".join(unit for unit in units if unit != "1")
    cells = [number(float(figure.value)) if figure else UNDEFINED for figure in figures]
    return f"{group}\n{last}\n{heading}".strip(), *cells


def _label(label: str, result: Result) -> str:
    """Return the label, and below it the progress of an incomplete run."""
    if result.run.divergence:
        return f"{label}\ndiverged at {result.run.divergence.time:.3f} s"
    return label if result.run.is_complete else f"{label}\nunfinished"


def _expect(result: Result) -> str:
    missed = sum(not outcome.ok for outcome in result.outcomes)
    return (f"missed {missed}" if missed else "met") if result.outcomes else UNDEFINED
