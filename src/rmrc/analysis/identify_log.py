"""A log of commands and positions: its columns, its clock, and the rows that it lacks."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from rmrc.analysis.identify_fit import LEAST_ROWS
from rmrc.analysis.identify_response import Array, Commands, Samples
from rmrc.logs.clock import in_order, seconds
from rmrc.logs.columns import (
    JOINT_RATES,
    JOINTS,
    LARGEST_OF_JOINT,
    POSITION,
    SECONDS,
    Column,
    enumerated,
    joint_groups,
    mapped,
    scaled,
    time_columns,
)
from rmrc.logs.tables import Numbers, Table, columns_of, read_table
from rmrc.results.run import Run
from rmrc.support.errors import QuestionError
from rmrc.support.text import listed, quoted

Source: TypeAlias = str | os.PathLike[str] | Run | Mapping[str, ArrayLike]
"""A file, a run, or arrays by the names of columns."""

# Names of commanded rates in various programs, the most certain first, as `POSITION`.
COMMAND = (
    "qdot_cmd", "qdot_command", "qdot_commanded", "cmd_qdot", "q_dot_cmd", "qd_cmd", "dq_cmd", "cmd_qd",
    "cmd_dq", "target_qd", "qd_target", "qdot_d", "dq_d", "velocity_command", "velocity_cmd",
    "command_velocity", "commanded_velocity", "cmd_velocity", "vel_cmd", "cmd_vel", "speed_cmd", "cmd_speed",
)  # fmt: skip
UNITS = {"t": SECONDS, "q": JOINTS, "qdot_cmd": JOINT_RATES}
# Steps of a control loop are between these [s]; otherwise the assumed unit of time is wrong.
STEPS = 2e-4, 0.2
# Steps above this many periods lack rows, if this share of them are multiples of it, to a quarter of it.
LONG, MULTIPLE = 1.5, 0.8
# Commands of a log without a period hold until the next, but not for this many steps, and this long [s].
GAP, GAP_TIME = 10, 0.05
# If positions are read less often than logged, this share of them is repeated while the arm moves.
STALE = 0.3
# A longer log is thinned to about this many positions.
MOST_ROWS = 20_000
# Larger numbers are no positions or rates in any unit.
FARTHEST = 1e9
# A hinge whose position changes by a turn, to within this, from row to row was wrapped [rad].
WRAPPED = 1.0
# A position this many standard deviations off its neighbors, and this share of the motion, is an error of
# the log: smaller ones do no harm.
OUTLIER, HARM = 8.0, 5e-4
# Errors of the log are fewer than this share of its rows: more large positions are in degrees.
ERRORS = 0.01


class Clock(NamedTuple):
    """The period of a log.

    Attributes:
        period: [s].
        missing: Number of rows that are missing.
        regular: Times at multiples of the period; None if the stamps have other ones, (R,) [s].
    """

    period: float
    missing: int
    regular: Array | None


@dataclass(frozen=True, eq=False)
class Log:
    """The contents of a log, in SI units.

    Attributes:
        name: Name of the log.
        joints: Names or numbers.
        time: (R,) [s].
        q: Positions; NaN where there is none, (R, n).
        rates: Commanded rates; NaN where there is none, (R, n).
        clock: Its period.
        facts: Properties and assumptions, by their subject.
    """

    name: str
    joints: tuple[str, ...]
    time: Array
    q: Array
    rates: Array
    clock: Clock
    facts: Mapping[str, str]

    def samples(self, joint: int, time: Array) -> Samples | None:
        """Return the positions and commands of a joint; None where there are too few.

        Args:
            joint: Index of the joint.
            time: Times of the rows, (R,) [s].
        """
        sent, read = np.isfinite(self.rates[:, joint]), np.flatnonzero(np.isfinite(self.q[:, joint]))
        if min(sent.sum(), len(read)) < LEAST_ROWS:
            return None
        at, read = time[sent], read[:: -(-len(read) // MOST_ROWS)]
        clock = clock_of(at)
        longest = LONG * clock.period if clock.missing else max(GAP * clock.period, GAP_TIME)
        until = np.append(
            np.where(np.diff(at) > longest, at[:-1] + clock.period, at[1:]), at[-1] + clock.period
        )
        return Samples(Commands(at, self.rates[sent, joint], until), time[read], self.q[read, joint])


def clock_of(time: Array) -> Clock:
    """Return the period of some times, (R,) [s]."""
    step = np.diff(time)
    least = float(np.median(step[step <= LONG * np.quantile(step, 0.1)]))
    period = float(np.median(step))
    if period > LONG * least and np.mean(np.abs(step - least) < 0.1 * least) > 0.25:
        period = least  # most rows are missing
    units, long = np.maximum(np.round(step / period), 1.0), step > LONG * period
    is_lossy = bool(long.any() and np.mean(np.abs(step / period - units)[long] < 0.25) > MULTIPLE)
    rows = np.concatenate([[0.0], np.cumsum(units if is_lossy else np.ones(len(step)))])
    regular = np.polyval(np.polyfit(rows, time, 1), rows)
    is_regular = np.abs(time - regular).max() < 0.6 * period
    return Clock(period, int(np.sum(units - 1.0)) if is_lossy else 0, regular if is_regular else None)


def read_log(source: Source, columns: Mapping[str, str], degrees: bool) -> Log:
    """Read a log.

    Args:
        source: CSV, Parquet or npz file; a run; or arrays by name.
        columns: As in `choose`.
        degrees: Whether angles whose columns name no unit are in degrees.

    Raises:
        QuestionError: It cannot be read, or lacks something.
    """
    if isinstance(source, Run):
        name, table = source.name, Table(columns_of(source.columns, source.joints), {})
    elif isinstance(source, Mapping):
        name, table = "log", Table(columns_of(source), {})
    else:
        name, table = Path(source).name, read_table(Path(source), "a log")
    try:
        return _log(name, table, columns, degrees)
    except QuestionError as error:
        raise QuestionError(f"{name}: {error}") from None


def _log(name: str, table: Table, mapping: Mapping[str, str], degrees: bool) -> Log:
    numbers, facts = table.numbers, dict[str, str]()
    times, positions, commands, alone = choose(numbers, mapping)
    columns = (*times, *positions.values(), *commands.values())
    if len(sizes := {len(numbers[column.name]) for column in columns if column.name in numbers}) > 1:
        raise QuestionError(f"its columns must have equally many rows, got {sorted(sizes)}")
    time, clock = seconds(numbers, times, STEPS)
    facts["time"] = " and ".join(map(str, clock))
    if clock != times:
        facts["time"] += f": the unit is taken from the steps of {1e3 * np.nanmean(np.diff(time)):.4g} ms"
    plain = [np.abs(numbers[column.name]) for column in positions.values() if not column.unit]
    is_far = any(np.mean(column > LARGEST_OF_JOINT) > ERRORS for column in plain)
    why = "as requested" if degrees else f"as positions exceed {LARGEST_OF_JOINT:g}" if is_far else ""
    q, facts["positions"] = _in_si(table, positions, why)
    rates, facts["commands"] = _in_si(table, commands, why)
    if alone:
        facts["joints"] = f"left out, as they lack positions or commands: {listed(alone, 8)}"
    time, values, changed = in_order(time, np.hstack([q, rates]))
    q, rates = np.hsplit(values, 2)
    if len(time) < LEAST_ROWS:
        raise QuestionError(f"it must have {LEAST_ROWS} rows or more, got {len(time)}; log 10 s or more")
    few = f"{table.skipped:,} with too few cells or too many ignored" if table.skipped else ""
    unread = int(np.isnan(q).any(axis=1).sum())  # unless most rows are: positions have rows of their own
    notes = [few, table.strays, changed]
    notes.append(f"{unread:,} without all positions" if 0 < unread < 0.5 * len(time) else "")
    notes += [_unwrap(q), _forget_spikes(q), _forget_repeats(q, rates)]
    known = clock_of(time)
    unsent = int(np.isnan(rates).any(axis=1).sum())  # unless most rows are: commands have rows of their own
    if missing := known.missing + (unsent if unsent < 0.5 * len(time) else 0):
        total = len(time) + known.missing
        notes.append(
            f"{missing:,} of {total:,} ({100.0 * missing / total:.2g} %) are missing: positions that depend "
            "on their commands are left out"
        )
    if any(notes):
        facts["rows"] = "; ".join(filter(None, notes))
    return Log(name, tuple(joint or "joint" for joint in positions), time, q, rates, known, facts)


Joints: TypeAlias = dict[str, Column]


def choose(
    numbers: Numbers, mapping: Mapping[str, str]
) -> tuple[tuple[Column, ...], Joints, Joints, tuple[str, ...]]:
    """Return the columns of the time, of positions and commands by their joints, and joints without both.

    Args:
        numbers: All numeric columns.
        mapping: Columns by t, q and qdot_cmd, as in `mapped`.

    Raises:
        QuestionError: There are no such columns, or positions and commands are of different joints.
    """
    if unknown := set(mapping) - set(UNITS):
        raise QuestionError(f"columns must map {', '.join(UNITS)}, got {quoted(sorted(unknown)[0])}")
    names = list(numbers)
    columns = {key: mapped(names, key, text, UNITS[key]) for key, text in mapping.items()}
    time = tuple(columns["t"].values()) if "t" in columns else time_columns(numbers)
    rates = columns.get("qdot_cmd") or next(joint_groups(names, COMMAND, JOINT_RATES), {})
    others = [name for name in names if name not in {rate.name for rate in rates.values()}]
    groups = [columns["q"]] if "q" in columns else list(joint_groups(others, POSITION, JOINTS))
    for what, key, hits in (
        ("time", "t", time),
        ("commanded rates (commanded positions are not enough)", "qdot_cmd", rates),
        ("positions", "q", groups),
    ):
        if not hits:
            raise QuestionError(
                f"there is no column of {what}; {enumerated(names)}; name it by --columns {key}=NAME, with * "
                "where a joint stands"
            )
    places = max(groups, key=lambda group: len(group.keys() & rates.keys()))
    if "," in mapping.get("q", "") + mapping.get("qdot_cmd", "") and len(places) == len(rates):
        rates = dict(zip(places, rates.values(), strict=True))  # lists are paired by their order
    joints = [joint for joint in places if joint in rates]
    if not joints:
        raise QuestionError(
            f"positions are of joints {listed(places, 8)}, commands of {listed(rates, 8)}: name matching "
            "columns, as by --columns q=A,B --columns qdot_cmd=C,D"
        )
    alone = tuple(sorted(places.keys() ^ rates.keys()))
    return time, {joint: places[joint] for joint in joints}, {joint: rates[joint] for joint in joints}, alone


def _in_si(table: Table, columns: Joints, degrees: str) -> tuple[Array, str]:
    """Return columns in rad or m, or these per second, (R, n), and a note on their unit.

    Args:
        table: The file.
        columns: The columns.
        degrees: Why angles whose columns name no unit are in degrees; "": they are in rad.
    """
    values = scaled(table.numbers, tuple(columns.values()), np.pi / 180.0 if degrees else 1.0)
    values[~(np.abs(values) < FARTHEST)] = np.nan
    note = f"in degrees, {degrees}" if degrees else "taken to be of rad, or m of slides; --degrees if not"
    if all(column.unit for column in columns.values()):
        note = "in their named units"
    return values, f"{listed((column.name for column in columns.values()), 8)}, {note}"


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


def _forget_spikes(q: Array) -> str:
    """Make positions, (R, n), NaN that differ from their four neighbors as no arm can move; return a note."""
    count = 0
    for column in q.T:
        known = np.flatnonzero(np.isfinite(column))
        if len(known) < LEAST_ROWS:
            continue
        near = sliding_window_view(np.pad(column[known], 2, mode="edge"), 5)
        off = np.abs(column[known] - np.median(near, axis=1))
        least = max(1.4826 * OUTLIER * float(np.median(off)), HARM * float(np.ptp(column[known])))
        wrong = known[(off > least) & (off > 2.0 * np.ptp(near[:, [0, 1, 3, 4]], axis=1))]
        column[wrong] = np.nan
        count += len(wrong)
    return f"{count:,} isolated outliers of positions left out" if count else ""


def _forget_repeats(q: Array, rates: Array) -> str:
    """Make repeated readings NaN, where positions are read less often than logged; return a note."""
    driven = (np.abs(rates[1:]) > 0.5 * np.nanmax(np.abs(rates), axis=0, initial=0.0)).any(axis=1)
    steps = np.abs(np.diff(q, axis=0))
    repeats = ((steps == 0.0) | np.isnan(steps)).all(axis=1)
    # Coarse encoders repeat as well, but they move by single steps of their resolution.
    moved = [column[column > 0.0] for column in steps.T]
    coarse = all(np.median(column) <= 2.5 * column.min() for column in moved if len(column))
    if coarse or not driven.any() or not STALE < float(repeats[driven].mean()) < 1.0:
        return ""
    q[1:][repeats] = np.nan
    return f"{repeats.sum():,} positions that repeat the row before left out, as read less often than logged"
