"""The columns of a log with time, positions and commanded rates: by their names, or by a map."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rmrc.logs.columns import POSITION, Column, enumerated, joint_groups, mapped, time_columns
from rmrc.logs.tables import Numbers
from rmrc.logs.units import JOINT_RATES, JOINTS, SECONDS
from rmrc.support.errors import QuestionError
from rmrc.support.legible import listed, quoted

# Names of commanded rates in various programs, the most certain first, as `POSITION`.
COMMAND = (
    "qdot_cmd", "qdot_command", "qdot_commanded", "cmd_qdot", "q_dot_cmd", "qd_cmd", "dq_cmd", "cmd_qd",
    "cmd_dq", "target_qd", "qd_target", "qdot_d", "dq_d", "velocity_command", "velocity_cmd",
    "command_velocity", "commanded_velocity", "cmd_velocity", "vel_cmd", "cmd_vel", "speed_cmd", "cmd_speed",
)  # fmt: skip
UNITS = {"t": SECONDS, "q": JOINTS, "qdot_cmd": JOINT_RATES}


@dataclass(frozen=True)
class Columns:
    """The meaning of the columns.

    Attributes:
        time: Column of the time, or columns of its seconds and their fraction.
        joints: Names or numbers of the joints, in the order of the file.
        q: Columns of the positions, one per joint.
        qdot_cmd: Columns of the commanded rates, one per joint.
        unpaired: Names of the columns of joints that lack the other one.
    """

    time: tuple[Column, ...]
    joints: tuple[str, ...]
    q: tuple[Column, ...]
    qdot_cmd: tuple[Column, ...]
    unpaired: tuple[str, ...]


def choose(numbers: Numbers, mapping: Mapping[str, str]) -> Columns:
    """Return the meaning of the columns.

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
    if not time:
        raise QuestionError(_missing(names, "time", "t"))
    rates = columns.get("qdot_cmd") or next(joint_groups(names, COMMAND, JOINT_RATES), {})
    if not rates:
        more = [name for name in names if re.match(r"(q|pos\w*)_?(cmd|command|target)|target_q(_|\d)", name)]
        way = "; commanded positions are not enough: log the rates" if more else ""
        raise QuestionError(_missing(names, "commanded rates", "qdot_cmd") + way)
    others = [name for name in names if name not in {rate.name for rate in rates.values()}]
    groups = [columns["q"]] if "q" in columns else list(joint_groups(others, POSITION, JOINTS))
    if not groups:
        raise QuestionError(_missing(names, "positions", "q"))
    places = max(groups, key=lambda group: len(group.keys() & rates.keys()))
    if "," in mapping.get("q", "") + mapping.get("qdot_cmd", "") and len(places) == len(rates):
        rates = dict(zip(places, rates.values(), strict=True))  # lists are paired by their order
    joints = tuple(joint for joint in places if joint in rates)
    if not joints:
        raise QuestionError(
            f"positions are of joints {listed(places, 8)}, commands of {listed(rates, 8)}: name matching "
            "columns, as by --columns q=A,B --columns qdot_cmd=C,D"
        )
    unpaired = [group[joint].name for group in (places, rates) for joint in group if joint not in joints]
    q, qdot_cmd = (tuple(group[joint] for joint in joints) for group in (places, rates))
    return Columns(time, tuple(joint or "joint" for joint in joints), q, qdot_cmd, tuple(unpaired))


def _missing(names: Sequence[str], what: str, key: str) -> str:
    way = f"name it by --columns {key}=NAME, with * where a joint stands"
    return f"there is no column of {what}; {enumerated(names)}; {way}"
