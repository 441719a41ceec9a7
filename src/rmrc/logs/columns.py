"""Columns by their names in many programs, or by a map: of the time, of joints, of poses and twists."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rmrc.logs.tables import POSE, Numbers
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.text import listed, quoted

# Units --------------------------------------------------------------------------------------------
#
# Units in the names of columns.

SECONDS = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6,
    "usec": 1e-6, "ns": 1e-9, "nsec": 1e-9, "nsecs": 1e-9, "nanosec": 1e-9, "nanoseconds": 1e-9,
}  # fmt: skip
# A step between the rows of a table without a column of time.
STEP = re.compile(rf"(\d+\.?\d*(?:e-?\d+)?)\s*({'|'.join(SECONDS)})")
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}
ANGLES = {"rad": 1.0, "mrad": 1e-3} | dict.fromkeys(("deg", "degrees", "°"), math.pi / 180.0)


def rates(units: Mapping[str, float]) -> dict[str, float]:
    """Return the units of rates, as programs write them, of units of lengths or angles."""
    return {f"{unit}{per}": size for unit, size in units.items() for per in ("/s", "_s", "ps", "_per_s")}


JOINTS = ANGLES | LENGTHS
JOINT_RATES = rates(JOINTS) | JOINTS
SIZES = SECONDS | JOINT_RATES
# Joint positions without a unit that are larger are in degrees [rad].
LARGEST_OF_JOINT = 15.0
"""The size of each unit in SI."""


def parts(name: str, units: Mapping[str, float]) -> tuple[str, str]:
    """Return a name in lowercase with _ between its words, without its unit, and the unit or "".

    Args:
        name: Name of a column.
        units: Units that the column may be in.

    >>> parts("Pose.X (mm)", LENGTHS), parts("q1_deg", JOINTS)
    (('pose_x', 'mm'), ('q1', 'deg'))
    """
    text, unit = name.strip().lower(), ""
    match = re.fullmatch(r"(.*?)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]", text)
    if match and match[2] in units:
        text, unit = match[1], match[2]
    text = re.sub(r"[^a-z0-9µ]+", "_", text).strip("_")
    for word in sorted(units, key=len, reverse=True):
        end = f"_{word.replace('/', '_')}"
        is_measured = word == "m" and "rad" in units  # q_m is a measured position, not one in meters
        if not unit and f"_{text}".endswith(end) and not is_measured:
            return f"_{text}".removesuffix(end).removeprefix("_"), word
    return text, unit


# Columns by their names ---------------------------------------------------------------------------

# Names in various programs, the most certain first, as patterns; the joint's number or name is before or
# behind.
TIME = (
    "t", "time", "timestamp", "time_stamp", "stamp", "clock", "host_time", "robot_time", ".+_timestamp",
    ".+_stamp", ".+_time", "",
)  # fmt: skip
POSITION = (
    "q_measured", "q_meas", "q_actual", "actual_q", "measured_q", "measured_position", "actual_position",
    "joint_positions", "joint_position", "positions", "position", "joint_angle", "angle", "pos", "q", "qpos",
    "joint", "j",
)  # fmt: skip
# Words in the rest of a name that exclude a measured position.
NOT_MEASURED = {
    *("cmd", "command", "commanded", "d", "des", "desired", "target", "ref", "reference", "goal"),
    *("set", "setpoint", "dot", "err", "error", "init"),
}

# The parts of an orientation, and of a twist.
ORIENTATIONS = QUATERNION, ROLL_PITCH_YAW, VECTOR = POSE[3:], ("roll", "pitch", "yaw"), ("rx", "ry", "rz")
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
# The numbers of a homogeneous matrix, column by column.
MATRIX = tuple(f"T{i}" for i in range(16))
_PARTS: tuple[tuple[dict[str, float], tuple[str, ...]], ...] = (
    (LENGTHS, POSE[:3]), (ANGLES, ROLL_PITCH_YAW + VECTOR),
    (rates(LENGTHS), TWIST[:3]), (rates(ANGLES), TWIST[3:]), ({}, QUATERNION + MATRIX),
)  # fmt: skip
PARTS = {part: units for units, parts in _PARTS for part in parts}
"""The units of each part."""
# Words before x, y, z or w, by the letter of the part; the last words may be missing.
_WORDS = {
    "q": "q|quat|quaternion|orientation|ori|rotation|rot",
    "w": "w|omega|angular|ang_vel|angular_velocity|rotation_rate",
    "v": "v|vel|velocity|linear|lin_vel|linear_velocity",
    "r": "r|rotvec|rotation_vector|axis_angle",
    "": "(?:p|pos|position|translation|xyz)?",
}
# Words before x, y and z that mean no position.
_OTHERS = {
    "force", "torque", "wrench", "effort", "acceleration", "acc", "accel", "magnetic", "euler", "offset",
}  # fmt: skip


# Other names of roll, pitch and yaw; single letters are those of the controllers of KUKA and Fanuc.
_YAW = {
    "theta": "yaw", "heading": "yaw", "a": "yaw", "b": "pitch", "c": "roll", "w": "roll", "p": "pitch",
    "r": "yaw",
}  # fmt: skip


class Column(NamedTuple):
    """A column.

    Attributes:
        name: Name in the file.
        unit: Its unit; "" if the name gives none.
    """

    name: str
    unit: str = ""

    def __str__(self) -> str:
        """Return the name in quotes and the unit."""
        return f'"{self.name}"' + (f" in {self.unit}" if self.unit else "")


def scaled(numbers: Numbers, columns: Sequence[Column], default: float = 1.0) -> NDArray[np.float64]:
    """Return columns in SI units, (R, n), those without a unit times a default."""
    return np.column_stack([numbers[c.name] * (SIZES[c.unit] if c.unit else default) for c in columns])


def mapped(names: Sequence[str], key: str, text: str, units: Mapping[str, float]) -> dict[str, Column]:
    """Return the columns that a map gives for a key, by their joints.

    Args:
        names: Names of all numeric columns.
        key: Key of the map.
        text: A name; for joints also names with commas between them, or a name with * in place of the joint;
            a unit may follow, separated by a blank. For the time also a step between rows, such as `20 ms`.
        units: Possible units.

    Raises:
        QuestionError: There is no such column.
    """
    if text not in names and units is SECONDS and STEP.fullmatch(text):
        return {"": Column(text)}
    pattern, _, unit = text.rpartition(" ")
    if text not in names and unit not in units and pattern.strip() in names:
        raise QuestionError(
            f"columns {key}={text}: the unit {quoted(unit)} is unknown; choose from {listed(units)}"
        )
    if text in names or unit not in units or not pattern.strip():
        pattern, unit = text, ""
    pattern = pattern.strip() if pattern not in names else pattern
    is_list = key in ("q", "qdot_cmd") and pattern not in names
    if is_list and "*" in pattern:
        match = re.compile(re.escape(pattern).replace(r"\*", "(.+)", 1)).fullmatch
        columns = {hit[1]: name for name in names if (hit := match(name))}
        lacking = [] if columns else [pattern]
    else:
        wanted = [name.strip() for name in pattern.split(",")] if is_list else [pattern]
        columns = dict(zip(wanted, wanted, strict=True)) if len(wanted) > 1 else {"": wanted[0]}
        lacking = [name for name in wanted if name not in names]
    if lacking:
        near = did_you_mean(lacking[0], names)
        raise QuestionError(
            f"columns {key}={text}: there is no column {quoted(lacking[0])}{near}; {enumerated(names)}"
        )
    return {joint: Column(name, unit or parts(name, units)[1]) for joint, name in columns.items()}


def time_columns(numbers: Numbers) -> tuple[Column, ...]:
    """Return the column of the time, or those of whole seconds and of their fraction in ns; () if none is."""
    for stem in TIME:
        columns = [
            Column(name, unit)
            for name, (text, unit) in ((name, parts(name, SECONDS)) for name in numbers)
            if re.fullmatch(stem, text) and (stem or unit)
        ]
        for whole in (c for c in columns if SECONDS.get(c.unit) == 1.0):
            for rest in (c for c in columns if SECONDS.get(c.unit) == 1e-9):
                if not np.any(numbers[whole.name] % 1) and np.max(numbers[rest.name], initial=0) < 1e9:
                    return whole, rest
        if columns:
            return (columns[0],)
    return ()


def joint_groups(
    names: Sequence[str], stems: Sequence[str], units: Mapping[str, float]
) -> Iterator[dict[str, Column]]:
    """Yield the columns whose names consist of a stem and a joint, by their joints, the surest stem first."""
    for stem in stems:
        pattern = re.compile(rf"(?:(.+)_)?{stem}(?:_?(\d+)|_(.+))?")
        columns = dict[str, Column]()
        for name in names:
            text, unit = parts(name, units)
            match = pattern.fullmatch(text)
            joint = "_".join(filter(None, match.groups())) if match else ""
            if match and not NOT_MEASURED & set(joint.split("_")):
                columns[joint] = Column(name, unit)
        if columns:
            yield _without_common(columns)


def joint_columns(
    names: Sequence[str], joints: Sequence[str], texts: Mapping[str, str], columns: Mapping[str, Column]
) -> dict[str, Column]:
    """Return the positions of all joints by their names, or {} if some are missing.

    Args:
        names: Names of all numeric columns.
        joints: Names of the joints.
        texts: As in a table: `name[0]` may hold the joint that `position[0]` is of.
        columns: Columns of a map, in place of those with the joints' names.
    """
    by_name = {text: Column(name, unit) for name in names for text, unit in [parts(name, JOINTS)]}
    cells = ((re.fullmatch(r".*name\D*(\d+)\D*", name), text) for name, text in texts.items())
    labels = {match[1]: text for match, text in cells if match}
    for group in [columns] if columns else [by_name, *joint_groups(names, POSITION, JOINTS)]:
        labeled = {parts(labels.get(label, label), {})[0]: column for label, column in group.items()}
        numbered = [group[label] for label in sorted(filter(str.isdigit, group), key=int)]
        ordered = [labeled[label] for joint in joints if (label := parts(joint, {})[0]) in labeled]
        for choice in (ordered, list(columns.values()), numbered):
            if len(choice) == len(joints):
                return dict(zip(joints, choice, strict=True))
    return {}


def frame_groups(names: Sequence[str]) -> dict[str, dict[str, Column]]:
    """Return the parts of poses and twists, by their names here, for each frame or message of a log.

    Its keys are the words before the parts. The last one, `*`, has the first of each part.

    Args:
        names: Names of all numeric columns.
    """
    groups = dict[str, dict[str, Column]]()
    for name in sorted(names, key=lambda name: name not in POSE + ROLL_PITCH_YAW + VECTOR + TWIST):
        for units, possible in _PARTS:
            text, unit = parts(name, units)
            prefix, part = _part(text)
            if part in possible and not (part in POSE[:3] and _OTHERS & {*prefix.split("_")[-2:]}):
                groups.setdefault(prefix, {}).setdefault(part, Column(name, unit))
    ordered = dict(sorted(groups.items(), key=lambda item: bool(NOT_MEASURED & {*item[0].split("_")})))
    whole = dict[str, Column]()
    for group in reversed(ordered.values()):
        whole |= group
    return ordered | {"*": whole}


def _part(text: str) -> tuple[str, str]:
    """Return the words before a part of a pose or a twist, and the part; "" if it is none."""
    if text.endswith("_ref"):
        prefix, part = _part(text.removesuffix("_ref"))
        return f"{prefix}_ref", part
    text = re.sub(r"_pos(ition)?$", "", text)
    if match := re.fullmatch(r"(?:(.*)_)?(roll|pitch|yaw|theta|heading)|[abcwpr]", text):
        return match[1] or "", _YAW.get(match[2] or text, match[2])
    if match := re.fullmatch(r"(?:(.*)_)?tcp_(pose|speed)_?([0-5])", text):  # of a UR: a rotation vector
        return match[1] or "", (POSE[:3] + VECTOR if match[2] == "pose" else TWIST)[int(match[3])]
    if match := re.fullmatch(r"(?:(.*)_)?o_t_ee_?(\d+)", text):  # of a Franka
        return match[1] or "", f"T{match[2]}"
    for letter, words in _WORDS.items():
        if match := re.fullmatch(rf"(?:(.*)_)?(?:{words})_?([xyzw])", text):
            return match[1] or "", f"{letter}{match[2]}"
    return "", ""


def enumerated(names: Sequence[str]) -> str:
    """Return the names of the columns, or what is wrong if they are numbers."""
    if names and all(re.fullmatch(r"\s*[-+.\d][-+.\deE]*\s*", name) for name in names):
        return f"the first line must name the columns, such as t, x, y; they are {listed(names, 12)}"
    return f"the columns are {listed(names, 12) or 'none'}"


def _without_common(columns: dict[str, Column]) -> dict[str, Column]:
    """Return joints without their common first words, such as the name of a topic."""
    words = [joint.split("_") for joint in columns]
    while len(words) > 1 and all(len(word) > 1 and word[0] == words[0][0] for word in words):
        words = [word[1:] for word in words]
    return dict(zip(map("_".join, words), columns.values(), strict=True))
