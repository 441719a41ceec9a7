"""A log of commands and positions: read, converted to SI units, sorted, and split at missing rows."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias
from zipfile import BadZipFile, is_zipfile

import numpy as np
from numpy.typing import ArrayLike

from rmrc.analysis.identify.columns import SECONDS, Columns, Named, choose
from rmrc.analysis.identify.fit import LEAST_ROWS, Samples
from rmrc.analysis.identify.response import Array, Commands
from rmrc.results.run import BASELINE, Run
from rmrc.simulation.tables import read_table
from rmrc.support.errors import QuestionError
from rmrc.support.files import reading
from rmrc.support.legible import listed, quoted

Source: TypeAlias = str | os.PathLike[str] | Run | Mapping[str, ArrayLike]
"""A file, a run, or arrays by the names of columns."""

# Steps of a control loop are between these [s]; otherwise the assumed unit of time is wrong.
STEPS = 2e-4, 0.2
# Where rows are missing for this many periods, and this long [s], a new part begins, because the commands
# there are unknown. In shorter gaps, commands of a regular log are interpolated linearly.
GAP, GAP_TIME = 10, 0.05
# Steps this near to their median are regular.
REGULAR = 0.2
# A log is regular, and complete in its commands, if this share of steps and cells is.
MOST = 0.8
# If positions are read less often than logged, this share of them is repeated while the arm moves.
STALE = 0.3
# A longer log is thinned to about this many positions.
MOST_ROWS = 20_000
# Time may jump back by this much, as rows of two threads do [s]; a larger jump is another log.
SWAPPED = 0.1
# A larger position is hardly in rad.
LARGEST_TURN = 15.0
# Larger numbers are no positions or rates in any unit.
FARTHEST = 1e9


@dataclass(frozen=True, eq=False)
class Log:
    """The contents of a log, in SI units.

    Attributes:
        name: Name of the log.
        joints: Names or numbers.
        samples: Samples of each joint; None where it has too few rows.
        period: Median step of the commands' time [s].
        duration: [s].
        facts: Properties and assumptions, by their subject.
    """

    name: str
    joints: tuple[str, ...]
    samples: tuple[Samples | None, ...]
    period: float
    duration: float
    facts: Mapping[str, str]


def read_log(source: Source, columns: Mapping[str, str], degrees: bool) -> Log:
    """Read a log.

    Args:
        source: CSV, Parquet or npz file; a run; or arrays by name.
        columns: As in `choose`.
        degrees: Whether angles whose columns name no unit are in degrees.

    Raises:
        QuestionError: It cannot be read, or lacks something.
    """
    name, numbers, facts = _numbers(source)
    try:
        return _log(name, numbers, choose(list(numbers), columns), facts, degrees)
    except QuestionError as error:
        raise QuestionError(f"{name}: {error}") from None


def _log(
    name: str, numbers: Mapping[str, Array], chosen: Columns, facts: dict[str, str], degrees: bool
) -> Log:
    time, facts["time"] = _seconds(numbers[chosen.time.name], chosen.time)
    sizes = {len(numbers[one.name]) for one in (*chosen.q, *chosen.qdot_cmd)} | {len(time)}
    if len(sizes) > 1:
        raise QuestionError(f"its columns must have equally many rows, got {sorted(sizes)}")
    q, facts["positions"] = _in_si(numbers, chosen.q, degrees, "rad")
    rates, facts["commands"] = _in_si(numbers, chosen.qdot_cmd, degrees, "rad/s")
    if chosen.unpaired:
        facts["left out"] = f"{listed(chosen.unpaired, 8)}: position or command is missing"
    rows, notes = _in_order(time, np.hstack([q, rates]))
    time, q, rates = rows[:, 0], rows[:, 1 : q.shape[1] + 1], rows[:, q.shape[1] + 1 :]
    if len(time) < LEAST_ROWS:
        raise QuestionError(f"it must have {LEAST_ROWS} rows or more, got {len(time)}; log 10 s or more")
    q, stale = _fresh(q, rates)
    period = float(np.median(np.diff(time)))
    begins = np.concatenate([time[:1], time[1:][np.diff(time) > max(GAP * period, GAP_TIME)]])
    sent_at, rates, filled = _filled(time, rates, period)
    samples = tuple(_samples(time, q[:, j], sent_at, rates[:, j], begins) for j in range(q.shape[1]))
    notes += [*stale, *filled] + [f"{len(begins) - 1} gaps, each starting a new stretch"] * (len(begins) > 1)
    if notes:
        facts["rows"] = "; ".join(notes)
    return Log(name, chosen.joints, samples, period, float(time[-1] - time[0]), facts)


def _numbers(source: Source) -> tuple[str, Mapping[str, Array], dict[str, str]]:
    """Return a name, columns by name, and notes on the file."""
    if isinstance(source, Run):
        return source.name, *_of_run(source.columns, source.joints)
    if isinstance(source, Mapping):
        return "log", *_of_run(source, ())
    path = Path(source)
    with reading(path, "a log as CSV, Parquet or npz"):
        if path.suffix == ".npz":
            if not is_zipfile(path):  # otherwise numpy would take it for a pickle
                raise BadZipFile("it is not a zip file")
            with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
                facts = json.loads(str(file["facts"])) if "facts" in file else {}
                own = {name: file[name] for name in file.files if not name.startswith(BASELINE)}
                return path.name, *_of_run(own, facts.get("joints", ()))
        table = read_table(path, is_log=True)
    texts = listed((f"{name} ({quoted(text)})" for name, text in table.texts.items()), 8)
    if not table.numbers:
        raise QuestionError(f"{path}: has no numeric column; its columns are {texts or 'none'}")
    facts = {"texts": f"ignored: {texts}"} if texts else {}
    if table.skipped:
        facts["skipped"] = f"{table.skipped:,} rows with too few cells or too many"
    return path.name, table.numbers, facts


def _of_run(
    arrays: Mapping[str, ArrayLike], joints: tuple[str, ...]
) -> tuple[Mapping[str, Array], dict[str, str]]:
    """Return columns of one value per row, and notes; joints or numbers name the columns of (T, n)."""
    found = dict[str, Array]()
    for name in arrays:
        values = np.asarray(arrays[name])
        if values.dtype.kind not in "iufb" or values.ndim not in (1, 2):
            continue
        values = values.astype(np.float64)
        if values.ndim == 1:
            found[name] = values
        else:
            width = values.shape[1]
            labels = joints if len(joints) == width else range(width)
            found |= {f"{name}[{label}]": values[:, i] for i, label in enumerate(labels)}
    if "q_believed" not in arrays or np.array_equal(arrays["q_believed"], arrays["q"], equal_nan=True):
        return found, {}
    way = 'select the encoder readings by --columns "q=q_believed[*]"'
    return found, {"truth": f"q of a simulation has neither noise nor resolution: {way}"}


def _seconds(values: Array, column: Named) -> tuple[Array, str]:
    """Return times in s from about 0, and a note on their unit."""
    known = values[np.isfinite(values)]
    steps = np.abs(np.diff(known))
    steps = steps[steps > 0.0]
    if not len(steps):
        raise QuestionError(f'column "{column.name}" must have rising times, got {len(known):,} of one value')
    if column.size:
        return (values - known[0]) * column.size, f'"{column.name}", in {_unit(column.size)} as it says'
    # for repeated stamps of a coarse clock, the mean step is better than the median
    step = min(float(np.median(steps)), float(np.ptp(known)) / max(len(known) - 1, 1))
    for unit, size in SECONDS.items():
        if STEPS[0] <= step * size <= STEPS[1]:
            told = f'"{column.name}", taken to be in {unit}: a step is {step * size * 1e3:.4g} ms'
            return (values - known[0]) * size, told
    raise QuestionError(
        f'column "{column.name}" has steps of {step:g}, which in no unit are {1e3 * STEPS[0]:g} to '
        f'{1e3 * STEPS[1]:g} ms; give it by --columns "t={column.name} s"'
    )


def _unit(size: float) -> str:
    return next(unit for unit, one in SECONDS.items() if one == size)


def _in_si(
    numbers: Mapping[str, Array], chosen: tuple[Named, ...], degrees: bool, unit: str
) -> tuple[Array, str]:
    """Return columns in rad or m, (R, n), and a note on their unit."""
    turn = np.pi / 180.0 if degrees else 1.0
    sizes = [one.size or turn for one in chosen]
    values = np.column_stack([numbers[one.name] * size for one, size in zip(chosen, sizes, strict=True)])
    wrong = np.abs(values) > FARTHEST
    values[wrong | ~np.isfinite(values)] = np.nan
    if all(one.size for one in chosen):
        said = "in their named units"
    elif degrees:
        said = f"in {unit.replace('rad', 'deg')}, as requested"
    else:
        said = f"taken to be in {unit}, or {unit.replace('rad', 'm')} of slides"
        if unit == "rad" and np.nanmax(np.abs(values), initial=0.0) > LARGEST_TURN:
            said += f"; they go to {np.nanmax(np.abs(values)):.4g}: if these are degrees, give --degrees"
    if wrong.any():
        said += f"; {wrong.sum():,} beyond {FARTHEST:g} are left out"
    return values, f"{listed((one.name for one in chosen), 8)}, {said}"


def _in_order(time: Array, values: Array) -> tuple[Array, list[str]]:
    """Return rows with increasing times, (R, 1 + columns), and notes on the changes."""
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
    if twice.any():
        notes.append(f"{twice.sum():,} duplicates ignored")
        rows, again = rows[~twice], again[~twice]
    if again.any():
        notes.append(f"{again.sum():,} with the time of the row before spread up to the next")
        rows[:, 0] = _spread_out(rows[:, 0])
    return rows, notes


def _spread_out(time: Array) -> Array:
    """Return times with equal ones spread evenly up to the next: they come from a coarse clock."""
    first = np.flatnonzero(np.diff(time, prepend=time[0] - 1.0) > 0.0)
    ends = np.append(first[1:], len(time))
    last = (time[-1] - time[0]) / max(len(time) - (ends[-1] - first[-1]), 1) * (ends[-1] - first[-1])
    knots = np.append(time[first], time[-1] + last)
    return np.asarray(np.interp(np.arange(len(time)), np.append(first, len(time)), knots))


def _fresh(q: Array, rates: Array) -> tuple[Array, list[str]]:
    """Return positions without repeated readings, and notes on the changes."""
    top = np.nanmax(np.abs(rates), axis=0, initial=0.0)
    driven = np.nanmax(np.abs(rates) / np.where(top > 0.0, top, 1.0), axis=1, initial=0.0)[1:] > 0.5
    same = (np.diff(q, axis=0) == 0.0) | np.isnan(q[1:])
    repeats = same.all(axis=1)
    # Coarse encoders repeat as well, but not for all joints at once for long while they move.
    if not driven.any() or not STALE < float(repeats[driven].mean()) < 1.0 or _is_coarse(q):
        return q, []
    q = q.copy()
    q[1:][repeats] = np.nan
    return q, [
        f"{repeats.sum():,} positions that repeat the row before left out, as read less often than logged"
    ]


def _is_coarse(q: Array) -> bool:
    """Return whether positions move by single steps of their resolution, so that repeats may be real."""
    for column in q.T:
        steps = np.abs(np.diff(column[np.isfinite(column)]))
        steps = steps[steps > 0.0]
        if len(steps) and np.median(steps) > 2.5 * steps.min():
            return False
    return True


def _filled(time: Array, rates: Array, period: float) -> tuple[Array, Array, list[str]]:
    """Return commands with the missing ones of a regular log interpolated linearly.

    This applies where most commands exist: commands at another rate than the rows hold until the next.
    """
    steps = np.diff(time)
    missing = np.round(steps / period).astype(int) - 1
    short = (missing > 0) & (missing < GAP)
    if np.mean(np.abs(steps - period) <= REGULAR * period) < MOST:
        return time, rates, []
    more = [
        time[i] + steps[i] * np.arange(1, n + 1) / (n + 1)
        for i, n in zip(np.flatnonzero(short), missing[short], strict=True)
    ]
    whole, columns, lacking = np.sort(np.concatenate([time, *more])), [], 0
    for column in rates.T:
        known = np.isfinite(column)
        if known.mean() < MOST:
            columns.append(np.interp(whole, time, column))  # a missing cell stays NaN, and is left out
            continue
        filled = np.interp(whole, time[known], column[known])
        before = np.interp(whole, time[known], np.arange(known.sum()))
        gap = np.diff(time[known], append=np.inf)[before.astype(int)] >= GAP * period
        filled[gap & (before % 1.0 > 0.0)] = np.nan
        columns.append(filled)
        lacking += int((~known).sum())
    count = sum(map(len, more))
    told = [f"{count:,} that are missing"] * bool(count) + [f"{lacking:,} cells of commands that are"] * bool(
        lacking
    )
    notes = [f"{' and '.join(told)}: commands in between are interpolated linearly"] if told else []
    return whole, np.column_stack(columns), notes


def _samples(time: Array, q: Array, sent_at: Array, rate: Array, begins: Array) -> Samples | None:
    """Return the positions of a joint and its commands; None where there are too few."""
    sent, read = np.isfinite(rate), np.isfinite(q)
    if sent.sum() < LEAST_ROWS or read.sum() < LEAST_ROWS:
        return None
    commands = Commands.of(sent_at[sent], rate[sent])
    rows = np.flatnonzero(read & (time >= commands.time[0]))
    rows = rows[:: -(-len(rows) // MOST_ROWS)]
    parts = np.searchsorted(begins, time[rows], "right") - 1
    return Samples(commands, time[rows], q[rows], parts, begins) if len(rows) >= LEAST_ROWS else None
