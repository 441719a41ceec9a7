"""A log of commands and positions: its columns, its clock, and the rows that it lacks."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from rmrc.analysis.identify.fit import LEAST_ROWS, Samples
from rmrc.analysis.identify.response import Array, Commands
from rmrc.logs.clock import in_order, seconds
from rmrc.logs.columns import POSITION, Column, enumerated, joint_groups, mapped, scaled, time_columns
from rmrc.logs.tables import Numbers, Table, columns_of, read_table
from rmrc.logs.units import JOINT_RATES, JOINTS, SECONDS
from rmrc.results.run import Run
from rmrc.support.errors import QuestionError
from rmrc.support.legible import listed, quoted

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
# Columns with fewer commands than this share of the rows have rows of their own.
DENSE = 0.5
# If positions are read less often than logged, this share of them is repeated while the arm moves.
STALE = 0.3
# A longer log is thinned to about this many positions.
MOST_ROWS = 20_000
# A larger position is hardly in rad; larger numbers are no positions or rates in any unit.
LARGEST_TURN, FARTHEST = 15.0, 1e9
# A hinge whose position changes by a turn, to within this, from row to row was wrapped [rad].
WRAPPED = 1.0


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

    @property
    def period(self) -> float:
        """Typical step of the commands [s]."""
        return self.clock.period

    @property
    def duration(self) -> float:
        """From the first row to the last [s]."""
        return float(self.time[-1] - self.time[0])

    def samples(self, joint: int, is_regular: bool = False) -> Samples | None:
        """Return the positions and commands of a joint, by its index; None where there are too few.

        Args:
            joint: Index of the joint.
            is_regular: Whether the stamps jitter, and the loop does not.
        """
        time = self.time if self.clock.regular is None or not is_regular else self.clock.regular
        sent, read = np.isfinite(self.rates[:, joint]), np.isfinite(self.q[:, joint])
        if min(sent.sum(), read.sum()) < LEAST_ROWS:
            return None
        at, rows = time[sent], np.flatnonzero(read)
        rows = rows[:: -(-len(rows) // MOST_ROWS)]
        step, clock = np.diff(at), clock_of(at)
        longest = (
            LONG * clock.period
            if clock.missing and sent.mean() >= DENSE
            else max(GAP * clock.period, GAP_TIME)
        )
        until = np.append(np.where(step > longest, at[:-1] + clock.period, at[1:]), at[-1] + clock.period)
        return Samples(Commands(at, self.rates[sent, joint], until), time[rows], self.q[rows, joint])


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
    times, positions, commands, left_out = choose(numbers, mapping)
    chosen = (*times, *positions.values(), *commands.values())
    sizes = {len(numbers[column.name]) for column in chosen if column.name in numbers}
    if len(sizes) > 1:
        raise QuestionError(f"its columns must have equally many rows, got {sorted(sizes)}")
    time, clock = seconds(numbers, times, STEPS)
    facts["time"] = " and ".join(map(str, clock))
    if clock != times:
        facts["time"] += f": the unit is taken from the steps of {1e3 * np.diff(time).mean():.4g} ms"
    q, facts["positions"] = _in_si(table, tuple(positions.values()), degrees, "rad")
    rates, facts["commands"] = _in_si(table, tuple(commands.values()), degrees, "rad/s")
    if left_out:
        facts["left out"] = f"{listed(left_out, 8)}: position or command is missing"
    beliefs = [name for name in numbers if name.startswith("q_believed[")]
    if any((numbers[name] != numbers[name.replace("q_believed", "q")]).any() for name in beliefs):
        way = 'select the encoder readings by --columns "q=q_believed[*]"'
        facts["truth"] = f"q of a simulation has neither noise nor resolution: {way}"
    time, values, changed = in_order(time, np.hstack([q, rates]))
    q, rates = values[:, : q.shape[1]], values[:, q.shape[1] :]
    if len(time) < LEAST_ROWS:
        raise QuestionError(f"it must have {LEAST_ROWS} rows or more, got {len(time)}; log 10 s or more")
    notes = [f"{table.skipped:,} with too few cells or too many ignored" if table.skipped else "", changed]
    notes += [_unwrap(q), _forget_repeats(q, rates)]
    known = clock_of(time)
    lacking = int((~np.isfinite(rates)).sum()) if np.isfinite(rates).mean() >= DENSE else 0
    if known.missing or lacking:
        total = len(time) + known.missing
        empty = f" and {lacking:,} commands" if lacking else ""
        notes.append(
            f"{known.missing:,} of {total:,} ({100.0 * known.missing / total:.2g} %){empty} are missing: "
            "positions that depend on these are left out"
        )
    if any(notes):
        facts["rows"] = "; ".join(filter(None, notes))
    return Log(name, tuple(joint or "joint" for joint in positions), time, q, rates, known, facts)


Joints: TypeAlias = dict[str, Column]


def choose(
    numbers: Numbers, mapping: Mapping[str, str]
) -> tuple[tuple[Column, ...], Joints, Joints, list[str]]:
    """Return the columns of the time, of positions and commands by their joints, and names of unpaired ones.

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
        ("commanded rates", "qdot_cmd", rates),
        ("positions", "q", groups),
    ):
        if not hits:
            targets = [
                name for name in names if re.match(r"(q|pos\w*)_?(cmd|command|target)|target_q(_|\d)", name)
            ]
            way = (
                "; commanded positions are not enough: log the rates" if key == "qdot_cmd" and targets else ""
            )
            raise QuestionError(
                f"there is no column of {what}; {enumerated(names)}; name it by --columns {key}=NAME, with * "
                f"where a joint stands{way}"
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
    unpaired = [group[joint].name for group in (places, rates) for joint in group if joint not in joints]
    return (
        time,
        {joint: places[joint] for joint in joints},
        {joint: rates[joint] for joint in joints},
        unpaired,
    )


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


def _forget_repeats(q: Array, rates: Array) -> str:
    """Make repeated readings NaN, where positions are read less often than logged; return a note, or ""."""
    top = np.nanmax(np.abs(rates), axis=0, initial=0.0)
    driven = np.nanmax(np.abs(rates) / np.where(top > 0.0, top, 1.0), axis=1, initial=0.0)[1:] > 0.5
    steps = np.abs(np.diff(q, axis=0))
    repeats = ((steps == 0.0) | np.isnan(steps)).all(axis=1)
    # Coarse encoders repeat as well, but they move by single steps of their resolution.
    moved = [column[column > 0.0] for column in steps.T]
    coarse = all(np.median(column) <= 2.5 * column.min() for column in moved if len(column))
    if coarse or not driven.any() or not STALE < float(repeats[driven].mean()) < 1.0:
        return ""
    q[1:][repeats] = np.nan
    return f"{repeats.sum():,} positions that repeat the row before left out, as read less often than logged"
