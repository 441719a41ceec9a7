"""The columns of a log with time, positions and commanded rates: by their names, or by a map."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.legible import listed, quoted

# Names in various programs, the most certain first; the joint's number or name is before or behind.
TIME = ("t", "time", "timestamp", "stamp", "clock", "host_time", "robot_time")
POSITION = (
    "q_measured", "q_meas", "q_actual", "actual_q", "measured_q", "measured_position", "actual_position",
    "joint_positions", "joint_position", "positions", "position", "joint_angle", "angle", "pos", "q", "qpos",
)  # fmt: skip
COMMAND = (
    "qdot_cmd", "qdot_command", "qdot_commanded", "cmd_qdot", "q_dot_cmd", "qd_cmd", "dq_cmd", "cmd_qd",
    "cmd_dq",
    "target_qd", "qd_target", "qdot_d", "dq_d", "velocity_command", "velocity_cmd", "command_velocity",
    "commanded_velocity", "cmd_velocity", "vel_cmd", "cmd_vel", "speed_cmd", "cmd_speed",
)  # fmt: skip
# Words in the rest of a name that exclude a measured position.
NOT_MEASURED = {
    *("cmd", "command", "commanded", "d", "des", "desired", "target", "ref", "reference", "goal"),
    *("set", "setpoint", "dot", "err", "error", "init"),
}
SECONDS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
ANGLES = {"rad": 1.0, "deg": math.pi / 180.0, "degrees": math.pi / 180.0, "m": 1.0, "mm": 1e-3}
RATES = {
    **{f"{unit}{per}": size for unit, size in ANGLES.items() for per in ("/s", "_s", "ps", "_per_s")},
    **ANGLES,
}
UNITS = {"t": SECONDS, "q": ANGLES, "qdot_cmd": RATES}


class Named(NamedTuple):
    """A column.

    Attributes:
        name: Name in the file.
        size: Size of its unit in SI; None if the name gives no unit.
    """

    name: str
    size: float | None = None


@dataclass(frozen=True)
class Columns:
    """The meaning of the columns.

    Attributes:
        time: Column of the time.
        joints: Names or numbers of the joints, in the order of the file.
        q: Columns of the positions, one per joint.
        qdot_cmd: Columns of the commanded rates, one per joint.
        unpaired: Columns of joints that lack the other one.
    """

    time: Named
    joints: tuple[str, ...]
    q: tuple[Named, ...]
    qdot_cmd: tuple[Named, ...]
    unpaired: tuple[str, ...]


def choose(names: Sequence[str], given: Mapping[str, str]) -> Columns:
    """Return the meaning of the columns.

    Args:
        names: Names of all numeric columns.
        given: Columns by t, q and qdot_cmd: a name; names with commas between them; or a name with * in place
            of the joint; a unit may follow, separated by a blank.

    Raises:
            QuestionError: There are no such columns, or positions and commands are of different joints.
    """
    if unknown := set(given) - set(UNITS):
        raise QuestionError(f"--columns must map {', '.join(UNITS)}, got {quoted(sorted(unknown)[0])}")
    found = {kind: _mapped(names, kind, given[kind]) for kind in given}
    if "t" not in found:
        times = (name for stem in TIME for name in names if _parts(name, SECONDS)[0] == stem)
        time = next(times, None)
        if time is None:
            raise QuestionError(_missing(names, "time", "t"))
        found["t"] = {"": Named(time, _parts(time, SECONDS)[1])}
    rates = found.get("qdot_cmd") or next(iter(_groups(names, COMMAND, RATES)), {})
    if not rates:
        more = [name for name in names if re.match(r"(q|pos\w*)_?(cmd|command|target)|target_q(_|\d)", name)]
        way = "; commanded positions are not enough: log the rates" if more else ""
        raise QuestionError(_missing(names, "commanded rates", "qdot_cmd") + way)
    taken = {one.name for one in rates.values()}
    groups = (
        [found["q"]]
        if "q" in found
        else list(_groups([n for n in names if n not in taken], POSITION, ANGLES))
    )
    if not groups:
        raise QuestionError(_missing(names, "positions", "q"))
    places = max(groups, key=lambda group: len(set(group) & set(rates)))
    if "," in given.get("q", "") + given.get("qdot_cmd", "") and len(places) == len(rates):
        rates = dict(zip(places, rates.values(), strict=True))  # lists are paired by their order
    joints = tuple(joint for joint in places if joint in rates)
    if not joints:
        raise QuestionError(
            f"positions are of joints {listed(places, 8)}, commands of {listed(rates, 8)}: name matching "
            "columns, as by --columns q=A,B --columns qdot_cmd=C,D"
        )
    lone = [one.name for group in (places, rates) for joint, one in group.items() if joint not in joints]
    time_ = next(iter(found["t"].values()))
    paired = tuple(places[joint] for joint in joints), tuple(rates[joint] for joint in joints)
    return Columns(time_, tuple(joint or "joint" for joint in joints), *paired, tuple(lone))


def _mapped(names: Sequence[str], kind: str, text: str) -> dict[str, Named]:
    """Return the columns of a map by their joints."""
    size = None
    words = text.split()
    if text not in names and len(words) > 1 and words[-1] in UNITS[kind]:
        text, size = text.removesuffix(words[-1]).strip(), UNITS[kind][words[-1]]
    if "*" in text and text not in names:
        pattern = re.compile(re.escape(text).replace(r"\*", "(.+)", 1))
        found = {match[1]: Named(match[0], size) for name in names if (match := pattern.fullmatch(name))}
    else:
        wanted = [text] if text in names else [one.strip() for one in text.split(",")]
        found = {name: Named(name, size) for name in wanted if name in names}
        if lacking := [name for name in wanted if name not in names]:
            near = did_you_mean(lacking[0], names)
            raise QuestionError(
                f"--columns {kind}={text}: there is no column {quoted(lacking[0])}{near}; {_has(names)}"
            )
        if kind == "t" or len(found) == 1:
            found = {"": next(iter(found.values()))}
    if not found:
        raise QuestionError(f"--columns {kind}={text}: no column has this name; {_has(names)}")
    return {
        joint: one if one.size else Named(one.name, _parts(one.name, UNITS[kind])[1])
        for joint, one in found.items()
    }


def _groups(
    names: Sequence[str], stems: Sequence[str], units: Mapping[str, float]
) -> Iterable[dict[str, Named]]:
    """Yield the columns whose names consist of a stem and a joint, by their joints, the surest stem first."""
    for stem in stems:
        pattern = re.compile(rf"(?:(.+)_)?{stem}(?:_?(\d+)|_(.+))?")
        found = dict[str, Named]()
        for name in names:
            plain, size = _parts(name, units)
            match = pattern.fullmatch(plain)
            joint = "_".join(filter(None, match.groups())) if match else ""
            if match and not NOT_MEASURED & set(joint.split("_")):
                found[joint] = Named(name, size)
        if found:
            yield _without_common(found)


def _without_common(found: dict[str, Named]) -> dict[str, Named]:
    """Return joints without their common first words, such as the name of a topic."""
    words = [joint.split("_") for joint in found]
    while len(words) > 1 and all(len(one) > 1 and one[0] == words[0][0] for one in words):
        words = [one[1:] for one in words]
    return dict(zip(map("_".join, words), found.values(), strict=True))


def _parts(name: str, units: Mapping[str, float]) -> tuple[str, float | None]:
    """Return a name in lowercase with _ between its words, without its unit, and the unit's size."""
    text, size = name.strip().lower(), None
    match = re.fullmatch(r"(.*?)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]", text)
    if match and match[2] in units:
        text, size = match[1], units[match[2]]
    text = re.sub(r"[^a-z0-9µ/]+", "_", text.replace("/", "_")).strip("_")
    for unit in sorted(units, key=len, reverse=True):
        word = f"_{unit.replace('/', '_')}"
        if size is None and text.endswith(word) and unit != "m":
            return text.removesuffix(word), units[unit]
    return text, size


def _missing(names: Sequence[str], what: str, kind: str) -> str:
    if all(re.fullmatch(r"\s*[-+.\d][-+.\deE]*\s*", name) for name in names):
        return f"the first line must name the columns, such as t, q_elbow, qdot_cmd_elbow; {_has(names)}"
    way = f"name it by --columns {kind}=NAME, with * where a joint stands"
    return f"there is no column of {what}; {_has(names)}; {way}"


def _has(names: Sequence[str]) -> str:
    return f"the columns are {listed(names, 12) or 'none'}"
