"""The rows of a recorded motion in a file: poses or twists of the site or joint positions, in any writing."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from rmrc.logs.clock import in_order, seconds
from rmrc.logs.columns import (
    JOINTS,
    LARGEST_OF_JOINT,
    MATRIX,
    ORIENTATIONS,
    PARTS,
    SECONDS,
    SIZES,
    TWIST,
    Column,
    enumerated,
    frame_groups,
    joint_columns,
    mapped,
    scaled,
    time_columns,
)
from rmrc.logs.tables import POSE, Numbers, Table, read_table
from rmrc.scenario.target import Motion
from rmrc.support.errors import QuestionError, TargetError, did_you_mean
from rmrc.support.spatial import AXES, Array, exp_rotation, matrix_to_quat, quat_from_rpy, quat_to_matrix
from rmrc.support.text import listed, quoted

# What may stand in place of a quaternion.
WAYS = " (or roll pitch yaw, or rx ry rz; where task.axes has no rotation, x y z alone)"
POSE_REF = tuple(f"{name}_ref" for name in POSE)
# Times without a unit are in s if their steps are below this; in a column `t`, which is documented to be in
# s, and in a file of a few poses, below these [s].
STEP, STEP_OF_T, FEW, STEP_OF_FEW = 0.99, 4.9, 30, 200.0
# Larger angles of an orientation without a unit are in degrees [rad].
LARGEST = 2.0 * np.pi


def read_rows(
    file: Motion, joints: Sequence[str], axes: Sequence[str], pose: Array
) -> tuple[str, Array, Array, tuple[str, ...]]:
    """Return what the rows hold (pose, q or twist), their times, their values, and notes.

    Args:
        file: The file, and which of its columns count.
        joints: Names of the joints.
        axes: Axes of the task: what a file lacks of the others stays as in the pose.
        pose: Pose at the start, in the frame of the file, (7,).

    Returns:
        Times rise from 0 on, (r,) [s]. Values are poses, (r, 7), twists, (r, 6), or joint positions, (r, n).

    Raises:
        TargetError: The file cannot be read, lacks columns, or holds no motion.
    """
    try:
        table = read_table(file.path, "a motion")
    except (OSError, QuestionError) as error:
        raise TargetError(f"cannot be read: {error}") from None
    try:
        clock, form, columns = _chosen(table, file.columns, joints, axes)
        used = [column.name for column in (*clock, *columns.values()) if column.name in table.numbers]
        whole = np.all([np.isfinite(table.numbers[name]) for name in used], axis=0)
        numbers = {name: table.numbers[name][whole] for name in used}
        rows = np.count_nonzero(whole)
        if rows < 2:
            raise TargetError(f"must have 2 rows or more, got {rows}")
        longest = STEP_OF_FEW if rows < FEW else STEP_OF_T if clock[0].name == "t" else STEP
        time, clock = seconds(numbers, clock, (0.0, longest))
        meanings = [_meaning(part, column) for part, column in [("t", clock[0]), *columns.items()]]
        columns, turned = _in_degrees(numbers, columns, LARGEST_OF_JOINT if form == "q" else LARGEST)
        time, values, moved = in_order(time, scaled(numbers, list(columns.values())))
    except QuestionError as error:
        raise TargetError(str(error)) from None
    parts = dict(zip(columns, values.T, strict=True))
    if form == "twist":
        values = np.column_stack([parts.get(part, np.zeros(len(time))) for part in TWIST])
    elif form == "pose":
        values = _poses(parts, pose, len(time))
    lacking = table.skipped + len(whole) - rows
    lacks = f"{lacking:,} rows without all cells left out" if lacking else ""
    note = "; ".join(filter(None, [listed(filter(None, meanings), 8), turned, table.strays, lacks, moved]))
    return form, time - time[0], values, (note,) if note else ()


def _meaning(part: str, column: Column) -> str:
    """Return the column that a part is taken from, or "" if it is plain from its name."""
    is_plain = re.fullmatch(rf"{re.escape(part)}(_ref)?|.*\[{re.escape(part)}\]", column.name)
    if (is_plain or (part, column.name) == ("t", "time")) and SIZES.get(column.unit, 1.0) == 1.0:
        return ""
    return f"{part} is {column}"


def _chosen(
    table: Table, choice: str | Mapping[str, str] | None, joints: Sequence[str], axes: Sequence[str]
) -> tuple[tuple[Column, ...], str, dict[str, Column]]:
    """Return the columns of the time, what the others are (pose, q or twist), and these by their parts."""
    names = list(table.numbers)
    mapping = choice if isinstance(choice, Mapping) else {}
    units = {"t": SECONDS, "q": JOINTS} | PARTS
    if unknown := sorted(mapping.keys() - units):
        hint = did_you_mean(unknown[0], units)
        raise QuestionError(f"columns must map {' '.join(units)}, got {quoted(unknown[0])}{hint}")
    named = {key: mapped(names, key, text, units[key]) for key, text in mapping.items()}
    parts = {key: columns[""] for key, columns in named.items() if key in PARTS}
    forms = [choice] if isinstance(choice, str) else ["pose", "q", "twist"]
    if keys := mapping.keys() - {"t"}:
        forms = ["q" if "q" in keys else "twist" if keys & {*TWIST} else "pose"]
    clock = tuple(named["t"].values()) if "t" in named else time_columns(table.numbers)
    plain = {"pose": POSE, "q": tuple(joints), "twist": TWIST, "pose_ref": POSE_REF}
    for form in () if mapping else forms:  # plain names come first
        if plain[form] and {"t", *plain[form]} <= {*names}:
            places = POSE if form == "pose_ref" else plain[form]
            columns = dict(zip(places, map(Column, plain[form]), strict=True))
            return (Column("t"),), form.removesuffix("_ref"), columns
    groups = frame_groups(names)
    if forms == ["pose_ref"]:
        groups = {prefix: group for prefix, group in groups.items() if prefix.endswith("ref")}
    for form in forms if clock else ():
        if form == "q":
            columns = joint_columns(names, joints, table.texts, named.get("q", {}))
        else:
            columns = _complete(form, [group | parts for group in groups.values()] or [parts], axes)
        if columns:
            return clock, form.removesuffix("_ref"), columns
    name = next((name for name in plain[forms[0]] if name not in names), "t") if clock else "t"
    needs = f"{forms[0]} needs t and {' '.join(plain[forms[0]])}" + WAYS * (forms[0] == "pose")
    hint = did_you_mean(name, {*names} - {*plain[forms[0]]})
    way = f"{enumerated(names)}; or map them, as in columns: {{{name}: NAME}}"
    raise QuestionError(f'has no column "{name}"{hint}; {needs}; {way}')


def _complete(form: str, groups: Sequence[dict[str, Column]], axes: Sequence[str]) -> dict[str, Column]:
    """Return the parts of the first group with all that a task with these axes needs; {} if none has."""
    parts = TWIST if form == "twist" else (*POSE[:3], *ORIENTATIONS[1])
    options = [tuple(part for part, axis in zip(parts, AXES, strict=True) if axis in axes)]
    if form != "twist":
        place = tuple(part for part in options[0] if part in POSE)
        options = [*((*place, *turn) for turn in ORIENTATIONS), MATRIX, *options]
    for option in options:
        for group in groups:
            if option and group.keys() >= {*option}:
                others = () if option == MATRIX else TWIST if form == "twist" else POSE[:3]
                return {part: group[part] for part in dict.fromkeys((*others, *option)) if part in group}
    return {}


def _in_degrees(
    numbers: Numbers, columns: dict[str, Column], largest: float
) -> tuple[dict[str, Column], str]:
    """Return columns with angles without a unit in degrees if they are too large for rad, and a note."""
    parts = [part for part in columns if not columns[part].unit and part not in (*POSE, *TWIST, *MATRIX)]
    most = max((float(np.abs(numbers[columns[part].name]).max()) for part in parts), default=0.0)
    unit = "deg" if most > largest else "rad"
    note = f"angles go to {most:.4g}, and are taken to be in {unit}"
    is_told = unit == "deg" or any(part in PARTS for part in parts)
    return columns | {part: Column(columns[part].name, unit) for part in parts}, note if is_told else ""


def _poses(parts: Mapping[str, Array], pose: Array, rows: int) -> Array:
    """Return poses, (r, 7), with what the parts lack as in one pose, (7,)."""
    poses = np.tile(pose, (rows, 1))
    if "T0" in parts:
        matrix = np.reshape([parts[part] for part in MATRIX], (4, 4, rows)).transpose(2, 1, 0)
        return np.hstack([matrix[:, :3, 3], matrix_to_quat(matrix[:, :3, :3])])
    for i, part in enumerate(POSE):
        poses[:, i] = parts.get(part, poses[:, i])
    if "rx" in parts:
        poses[:, 3:] = exp_rotation(np.column_stack([parts[part] for part in ORIENTATIONS[2]]))
    elif parts.keys() & {*ORIENTATIONS[1]}:
        R = quat_to_matrix(pose[3:])
        angles = np.tile(
            np.arctan2([R[2, 1], -R[2, 0], R[1, 0]], [R[2, 2], np.hypot(R[0, 0], R[1, 0]), R[0, 0]]),
            (rows, 1),
        )
        for i, part in enumerate(ORIENTATIONS[1]):
            angles[:, i] = parts.get(part, angles[:, i])
        poses[:, 3:] = quat_from_rpy(angles)
    return poses
