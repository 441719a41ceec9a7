"""The times of rows: their unit, their order, and stamps that repeat."""

import numpy as np
from numpy.typing import NDArray

from rmrc.logs.columns import SECONDS, SIZES, STEP, Column
from rmrc.logs.tables import Numbers
from rmrc.support.errors import QuestionError

Array = NDArray[np.float64]

# A clock that repeats this share of its stamps for other values is coarser than the rows.
COARSE = 0.05
# Time may jump back by this much, as rows of two threads do [s]; a larger jump is another log.
SWAPPED = 0.1


def seconds(
    numbers: Numbers, columns: tuple[Column, ...], steps: tuple[float, float]
) -> tuple[Array, tuple[Column, ...]]:
    """Return times in s from about 0, (R,), and their columns with their unit.

    Args:
        numbers: All columns.
        columns: That of the time; or that of whole seconds and that of their fraction. Its name may be a step
            between rows, such as `20 ms`, where no column has it.
        steps: Least and largest step of which the unit of a column without one can be guessed [s].

    Raises:
        QuestionError: The column has one value, or its steps fit no unit.
    """
    (name, unit), rows = columns[0], len(next(iter(numbers.values())))
    if name not in numbers and (match := STEP.fullmatch(name)):
        return np.arange(float(rows)) * (float(match[1]) * SECONDS[match[2]]), columns
    known = np.isfinite(numbers[name])
    stamps = numbers[name][known]
    if not any(np.ptp(numbers[column.name][known]) for column in columns if len(stamps)):
        value = f"one value, {stamps[0]:.12g}" if len(stamps) else "none"
        raise QuestionError(
            f'column "{name}" must have rising times, got {len(stamps):,} of {value}: log more digits, or '
            'map t to the step between rows, "t=20 ms" as an option or {t: 20 ms} in a scenario'
        )
    if not unit:
        change = np.abs(np.diff(stamps))
        # for repeated stamps of a coarse clock, the mean step is better than the median
        step = min(float(np.median(change[change > 0])), float(np.ptp(stamps)) / max(len(stamps) - 1, 1))
        unit = next((u for u in ("s", "ms", "us", "ns") if steps[0] <= step * SECONDS[u] <= steps[1]), "")
        if not unit:
            bounds = f"{1e3 * steps[0]:g} to {1e3 * steps[1]:g} ms"
            raise QuestionError(
                f'column "{name}" has steps of {step:g}, which in no unit are {bounds}; map t to the column '
                f'and its unit, "t={name} s" as an option or {{t: {name} s}} in a scenario'
            )
        columns = (Column(name, unit),)
    time: Array = np.zeros(rows)
    for column in columns:  # integers keep their digits until their first one is subtracted
        values = numbers[column.name]
        time += (values - values[known][0]) * SIZES[column.unit]
    return time, columns


def in_order(time: Array, values: Array) -> tuple[Array, Array, str]:
    """Return rows with increasing times, (R,) and (R, n), and a note on what was changed, or "".

    Rows that repeat the row before are left out. Equal times of different rows come from a coarse clock: they
    are spread evenly up to the next, together with what repeats the row before, which is an arm at rest.

    Args:
        time: Times of the rows, not finite where one has none, (R,) [s].
        values: Their values, (R, n).

    Raises:
        QuestionError: Time jumps back.
    """
    notes, rows = [], np.column_stack([time, values])
    lacking = ~np.isfinite(time)
    if lacking.any():
        notes.append(f"{lacking.sum():,} without a time ignored")
        rows = rows[~lacking]
    back = np.diff(rows[:, 0])
    if (back < -SWAPPED).any():
        row = int(np.argmin(back))
        raise QuestionError(
            f"time falls by {-back[row]:.4g} s behind row {row + 1:,}: give one log at a time, in order"
        )
    if (back < 0.0).any():
        notes.append(f"{(back < 0.0).sum():,} out of order sorted")
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
    again = np.concatenate([[False], (np.diff(rows[:, 0]) == 0.0)])
    twice = again & np.concatenate([[False], ((rows[1:] == rows[:-1]) | np.isnan(rows[1:])).all(axis=1)])
    is_coarse = np.mean(again & ~twice) > COARSE  # then equal rows are an arm at rest
    if twice.any() and not is_coarse:
        notes.append(f"{twice.sum():,} duplicates ignored")
        rows, again = rows[~twice], again[~twice]
    if again.any():
        notes.append(f"{again.sum():,} with the time of the row before spread up to the next")
        rows[:, 0] = _spread_out(rows[:, 0], is_coarse)
    return rows[:, 0], rows[:, 1:], "; ".join(notes)


def _spread_out(time: Array, is_coarse: bool) -> Array:
    """Return times with equal ones spread evenly up to the next.

    Where that leaves uneven steps of a coarse clock, rows at equal steps are the truth, if they all are
    within a tick of that clock.
    """
    first = np.flatnonzero(np.diff(time, prepend=time[0] - 1.0) > 0.0)
    ends = np.append(first[1:], len(time))
    last = (time[-1] - time[0]) / max(len(time) - (ends[-1] - first[-1]), 1) * (ends[-1] - first[-1])
    knots = np.append(time[first], time[-1] + last)
    rows = np.arange(len(time))
    spread = np.asarray(np.interp(rows, np.append(first, len(time)), knots))
    even = time[0] + np.polyval(np.polyfit(rows, time - time[0], 1), rows)
    is_uneven = np.ptp(np.diff(spread)) > 0.1 * (even[1] - even[0])
    is_even = np.abs(time - even).max() <= np.diff(time[first]).min(initial=np.inf)
    return even if is_coarse and is_uneven and is_even else spread
