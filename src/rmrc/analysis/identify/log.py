"""A log of commands and positions: read, converted to SI units, sorted, and split at missing rows."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from rmrc.analysis.identify.columns import Columns, choose
from rmrc.analysis.identify.fit import LEAST_ROWS, Samples
from rmrc.analysis.identify.response import Array, Commands
from rmrc.logs.clock import in_order, seconds
from rmrc.logs.columns import Column, scaled
from rmrc.logs.tables import Table, columns_of, read_table
from rmrc.results.run import Run
from rmrc.support.errors import QuestionError
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
# A larger position is hardly in rad.
LARGEST_TURN = 15.0
# Larger numbers are no positions or rates in any unit.
FARTHEST = 1e9
# A hinge whose position changes by a turn, to within this, from row to row was wrapped [rad].
WRAPPED = 1.0


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
    name, table = _table(source)
    try:
        return _log(name, table, choose(table.numbers, columns), degrees)
    except QuestionError as error:
        raise QuestionError(f"{name}: {error}") from None


def _log(name: str, table: Table, columns: Columns, degrees: bool) -> Log:
    numbers, facts = table.numbers, _facts(table)
    sizes = {
        len(numbers[c.name]) for c in (*columns.q, *columns.qdot_cmd, *columns.time) if c.name in numbers
    }
    if len(sizes) > 1:
        raise QuestionError(f"its columns must have equally many rows, got {sorted(sizes)}")
    time, clock = seconds(numbers, columns.time, STEPS)
    facts["time"] = " and ".join(map(str, clock))
    if clock != columns.time:
        facts["time"] += f": the unit is taken from the steps of {1e3 * np.diff(time).mean():.4g} ms"
    q, facts["positions"] = _in_si(table, columns.q, degrees, "rad")
    rates, facts["commands"] = _in_si(table, columns.qdot_cmd, degrees, "rad/s")
    if columns.unpaired:
        facts["left out"] = f"{listed(columns.unpaired, 8)}: position or command is missing"
    time, values, changed = in_order(time, np.hstack([q, rates]))
    q, rates = values[:, : q.shape[1]], values[:, q.shape[1] :]
    if len(time) < LEAST_ROWS:
        raise QuestionError(f"it must have {LEAST_ROWS} rows or more, got {len(time)}; log 10 s or more")
    wrapped = _unwrap(q)
    q, stale = _fresh(q, rates)
    period = float(np.median(np.diff(time)))
    begins = np.concatenate([time[:1], time[1:][np.diff(time) > max(GAP * period, GAP_TIME)]])
    sent_at, rates, filled = _filled(time, rates, period)
    samples = tuple(_samples(time, q[:, j], sent_at, rates[:, j], begins) for j in range(q.shape[1]))
    gaps = f"{len(begins) - 1} gaps, each starting a new stretch" if len(begins) > 1 else ""
    if notes := [note for note in (changed, wrapped, stale, filled, gaps) if note]:
        facts["rows"] = "; ".join(notes)
    return Log(name, columns.joints, samples, period, float(time[-1] - time[0]), facts)


def _table(source: Source) -> tuple[str, Table]:
    """Return the name and the columns of a log."""
    if isinstance(source, Run):
        return source.name, Table(columns_of(source.columns, source.joints), {})
    if isinstance(source, Mapping):
        return "log", Table(columns_of(source), {})
    return Path(source).name, read_table(Path(source), "a log")


def _facts(table: Table) -> dict[str, str]:
    """Return notes on a table."""
    numbers, facts = table.numbers, {}
    if table.texts:
        texts = (f"{name} ({quoted(text)})" for name, text in table.texts.items())
        facts["texts"] = f"ignored: {listed(texts, 8)}"
    if table.skipped:
        facts["skipped"] = f"{table.skipped:,} rows with too few cells or too many"
    beliefs = [name for name in numbers if name.startswith("q_believed[")]
    if any((numbers[name] != numbers[name.replace("q_believed", "q")]).any() for name in beliefs):
        way = 'select the encoder readings by --columns "q=q_believed[*]"'
        facts["truth"] = f"q of a simulation has neither noise nor resolution: {way}"
    return facts


def _in_si(table: Table, columns: tuple[Column, ...], degrees: bool, unit: str) -> tuple[Array, str]:
    """Return columns in rad or m, (R, n), and a note on their unit."""
    values = scaled(table.numbers, columns, np.pi / 180.0 if degrees else 1.0)
    wrong = np.abs(values) > FARTHEST
    values[wrong | ~np.isfinite(values)] = np.nan
    if all(column.unit for column in columns):
        note = "in their named units"
    elif degrees:
        note = f"in {unit.replace('rad', 'deg')}, as requested"
    else:
        note = f"taken to be in {unit}, or {unit.replace('rad', 'm')} of slides"
        if unit == "rad" and np.nanmax(np.abs(values), initial=0.0) > LARGEST_TURN:
            note += f"; they go to {np.nanmax(np.abs(values)):.4g}: if these are degrees, give --degrees"
    if wrong.any():
        note += f"; {wrong.sum():,} beyond {FARTHEST:g} are left out"
    return values, f"{listed((column.name for column in columns), 8)}, {note}"


def _unwrap(q: Array) -> str:
    """Remove the turns by which positions of hinges, (R, n), jump where they are wrapped; return a note."""
    count = 0
    for column in q.T:
        known = np.isfinite(column)
        turns = np.diff(column[known], prepend=column[known][:1]) / (2.0 * np.pi)
        jumps = np.where(np.abs(np.abs(turns) - 1.0) < WRAPPED / (2.0 * np.pi), np.sign(turns), 0.0)
        column[known] -= 2.0 * np.pi * np.cumsum(jumps)
        count += int(np.count_nonzero(jumps))
    return f"{count:,} jumps of a turn unwrapped" if count else ""


def _fresh(q: Array, rates: Array) -> tuple[Array, str]:
    """Return positions without repeated readings, and a note on the changes, or ""."""
    top = np.nanmax(np.abs(rates), axis=0, initial=0.0)
    driven = np.nanmax(np.abs(rates) / np.where(top > 0.0, top, 1.0), axis=1, initial=0.0)[1:] > 0.5
    same = (np.diff(q, axis=0) == 0.0) | np.isnan(q[1:])
    repeats = same.all(axis=1)
    # Coarse encoders repeat as well, but not for all joints at once for long while they move.
    if not driven.any() or not STALE < float(repeats[driven].mean()) < 1.0 or _is_coarse(q):
        return q, ""
    q = q.copy()
    q[1:][repeats] = np.nan
    note = f"{repeats.sum():,} positions that repeat the row before left out, as read less often than logged"
    return q, note


def _is_coarse(q: Array) -> bool:
    """Return whether positions move by single steps of their resolution, so that repeats may be real."""
    for column in q.T:
        steps = np.abs(np.diff(column[np.isfinite(column)]))
        steps = steps[steps > 0.0]
        if len(steps) and np.median(steps) > 2.5 * steps.min():
            return False
    return True


def _filled(time: Array, rates: Array, period: float) -> tuple[Array, Array, str]:
    """Return commands with the missing ones of a regular log interpolated linearly.

    This applies where most commands exist: commands at another rate than the rows hold until the next.
    """
    steps = np.diff(time)
    missing = np.round(steps / period).astype(int) - 1
    short = (missing > 0) & (missing < GAP)
    if np.mean(np.abs(steps - period) <= REGULAR * period) < MOST:
        return time, rates, ""
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
    note = (
        f"{count:,} that are missing and {lacking:,} cells of commands: commands in between are interpolated "
        "linearly"
    )
    return whole, np.column_stack(columns), note if count or lacking else ""


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
