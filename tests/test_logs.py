"""Files of other programs: the same motion in their names, units and orientations is the same path."""

import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from project import ROOT
from rmrc.arm import load
from rmrc.scenario import TargetSection
from rmrc.simulation.trajectory import Places, make_reference
from rmrc.support.errors import TargetError
from wording import says

LOOSE = {"velocity": 5, "acceleration": 50, "jerk": 1e4, "angular_velocity": 5, "angular_acceleration": 50,
         "angular_jerk": 1e4}  # fmt: skip
START = np.array(
    [0.45, 0.2, 0.35, *Rotation.from_euler("xyz", [170, 10, 20], degrees=True).as_quat(scalar_first=True)]
)
ARM = load(ROOT / "models/puma560.xml")
PUMA = Places(ARM.base_pose, ARM.joints, lambda q: ARM.pose(np.asarray(q)))

# A circle with a turn about it, from rest to rest; the tool points down.
TIME = np.round(0.02 * np.arange(101), 9)
SHARE = (1 - np.cos(np.pi * TIME / 2)) / 2
PLACE = np.column_stack(
    [0.45 + 0.1 * np.sin(2 * np.pi * SHARE), 0.3 - 0.1 * np.cos(2 * np.pi * SHARE), 0.35 + 0 * SHARE]
)
TURN = Rotation.from_euler("xyz", np.column_stack([180 + 20 * SHARE, 10 * SHARE, 60 * SHARE]), degrees=True)
W, X, Y, Z = TURN.as_quat(scalar_first=True).T
RX, RY, RZ = TURN.as_rotvec().T
ROLL, PITCH, YAW = TURN.as_euler("xyz").T
VX, VY, VZ = np.diff(PLACE, axis=0, append=PLACE[-1:]).T / 0.02
VX[0] = VY[0] = 0
PLAIN = {"t": TIME, **dict(zip("xyz", PLACE.T, strict=True)), "qw": W, "qx": X, "qy": Y, "qz": Z}
BEND = SHARE * (1 - SHARE)
TWIST = {"t": TIME, "vx": VX, "vy": VY, "vz": VZ, "wx": 0.1 * BEND, "wy": 0 * TIME, "wz": 0.2 * BEND}
Q = ARM.configuration("home")[ARM.wiring.qpos] + 0.1 * SHARE[:, None] * np.array([1, -1, 1, 0.5, 1, -1])
JOINTS = {"t": TIME, **dict(zip(ARM.joints, Q.T, strict=True))}
# A Franka logs the pose as a matrix, column by column.
MATRIX = np.zeros((len(TIME), 4, 4))
MATRIX[:, :3, :3], MATRIX[:, :3, 3], MATRIX[:, 3, 3] = TURN.as_matrix(), PLACE, 1.0


def followed(path, table, axes=("x", "y", "z", "rx", "ry", "rz"), **keys):
    """Return the reference of a file with these columns, and the notes about it."""
    if path.suffix == ".parquet":
        pq.write_table(pa.table(table), path)
    else:
        text = lambda cell: cell if isinstance(cell, str) else "" if math.isnan(cell) else repr(cell)  # noqa: E731
        cells = [map(text, np.asarray(column).tolist()) for column in table.values()]
        lines = [",".join(table), *(",".join(row) for row in zip(*cells, strict=True))]
        path.write_text("\n".join(lines) + "\n", "utf-8")
    section = TargetSection.model_validate({"path": [{"file": {"path": str(path), **keys}}], "limits": LOOSE})
    made = make_reference(section, START, 0.01, PUMA._replace(axes=axes))
    return made, made.notes


def renamed(columns, **names):
    return {names.get(name, name): values for name, values in columns.items()}


def ros(place, turn, stamp="header.stamp"):
    """Return the pose as ROS names its parts, the quaternion in its order."""
    return {stamp: 1.7e9 + TIME, **{f"{place}.{a}": c for a, c in zip("xyz", PLACE.T, strict=True)},
            **{f"{turn}.{a}": c for a, c in zip("xyzw", (X, Y, Z, W), strict=True)}}  # fmt: skip


def place(*names, size=1.0):
    return {"t": TIME} | {name: size * column for name, column in zip(names or "xyz", PLACE.T, strict=True)}


DEGREES = dict(zip(("roll", "pitch", "yaw"), np.degrees([ROLL, PITCH, YAW]), strict=True))
STAMP = {"header.stamp.sec": 1_700_000_000 + (TIME // 1).astype(int),
         "header.stamp.nanosec": np.round((TIME % 1) * 1e9).astype(int)}  # fmt: skip
LOGGED = {f"q_{name}_deg": np.degrees(values) for name, values in JOINTS.items() if name != "t"}
STATES = {"t": TIME} | {f"name[{i}]": [ARM.joints[j]] * len(TIME) for i, j in enumerate((2, 1, 0, 3, 4, 5))} | {
    f"position[{i}]": Q[:, j] for i, j in enumerate((2, 1, 0, 3, 4, 5))
}  # fmt: skip

# The same motion with other names: the plain columns, and the file as somebody has it with its keys.
SAME = {
    "ros pose": (PLAIN, ros("pose.position", "pose.orientation", "timestamp"), {}),

    "ros transform": (PLAIN, STAMP | {n: c for n, c in ros("transform.translation", "transform.rotation").items()
                                      if n != "header.stamp"}, {}),
    "units in names": (PLAIN, renamed(PLAIN | place(size=1e3) | {"t": 1e3 * TIME}, t="t_ms", x="x_mm", y="y (mm)", z="Z [mm]"), {}),

    "ns unsaid": (PLAIN, PLAIN | {"t": 1_700_000_000_000_000_000 + np.round(1e9 * TIME).astype(int)}, {}),

    "roll in deg unsaid": (PLAIN, place() | DEGREES, {}),

    "ur": (PLAIN, {"timestamp": TIME, **{f"actual_TCP_pose_{i}": c for i, c in enumerate((*PLACE.T, RX, RY, RZ))},
                   **{f"target_TCP_pose_{i}": 0 * TIME for i in range(6)}}, {}),
    "franka": (PLAIN, {"time": TIME, **{f"O_T_EE[{i}]": MATRIX[:, i % 4, i // 4] for i in range(16)}}, {}),
    "mapped": (PLAIN, {"when": 1e3 * TIME, **{f"tcp {a} mm": 1e3 * c for a, c in zip("abc", PLACE.T, strict=True)}, **DEGREES},
               {"columns": {"t": "when ms", "x": "tcp a mm", "y": "tcp b mm mm", "z": "tcp c mm mm"}}),
    "a name that begins as another": (
        PLAIN, PLAIN | {"x m": 9 + PLAIN["x"], "x tool": PLAIN["x"]}, {"columns": {"x": "x tool"}},
    ),
    "a step": (PLAIN, {n: c for n, c in PLAIN.items() if n != "t"}, {"columns": {"t": "20 ms"}}),
    "twist in mm": (TWIST, {"t": TIME, **{f"v{a}_mm_s": 1e3 * TWIST[f"v{a}"] for a in "xyz"},
                            **{f"w{a} [deg/s]": np.degrees(TWIST[f"w{a}"]) for a in "xyz"}}, {}),
    "joints in deg": (JOINTS, {"t": TIME} | LOGGED, {}),
    "joint states": (JOINTS, STATES, {}),
}  # fmt: skip


@pytest.mark.parametrize("case", SAME)
def test_a_motion_in_other_names_and_units_is_the_same_motion(case, tmp_path):
    plain, columns, keys = SAME[case]
    want, none = followed(tmp_path / "plain.csv", plain)
    got, notes = followed(tmp_path / "other.csv", columns, **keys)
    assert none == () and len(notes) == 1 and notes[0].startswith("other.csv: ")
    # stamps of the epoch in s have steps of 2.4e-7 s, and the fastest part moves at 0.5 m/s or rad/s
    in_s = any(
        np.max(c) > 1e9 and np.asarray(c).dtype.kind == "f"
        for c in columns.values()
        if not isinstance(c, list)
    )
    assert_allclose(got.pose, want.pose, rtol=0, atol=5e-7 if in_s else 1e-9)
    assert not np.allclose(got.pose[50], got.pose[0], atol=1e-3)  # it moves


ROWS = np.sort(np.append(np.arange(len(TIME)), [7, 30, 30, 31]))
# The same motion with rows as loggers leave them, and what is told about it.
CHANGED = {
    "rows twice": ({name: values[ROWS] for name, values in PLAIN.items()}, "4 duplicates …"),
    "no number": ({n: [*c, "ERR" if n == "x" else c[-1]] for n, c in PLAIN.items()}, "… x has 'ERR' in row 102; 1 rows …"),
    "coarse clock": ({n: c[:100] for n, c in (PLAIN | {"t": np.floor(TIME / 0.04 + 1e-9) * 0.04}).items()}, "50 … spread …"),
}  # fmt: skip


@pytest.mark.parametrize("case", CHANGED)
def test_rows_as_loggers_leave_them_are_told_and_give_the_same_motion(case, tmp_path):
    table, told = CHANGED[case]
    plain = {n: c[:100] for n, c in PLAIN.items()} if case == "coarse clock" else PLAIN
    want, _ = followed(tmp_path / "plain.csv", plain)
    got, notes = followed(tmp_path / "rows.csv", table)
    assert_allclose(got.pose, want.pose, rtol=0, atol=1e-9)
    assert [*notes] == [says(f"rows.csv: {told}")]


def test_what_the_task_does_not_need_stays_as_at_the_start(tmp_path):
    got, _ = followed(tmp_path / "places.csv", place(), axes=("x", "y", "z"))
    assert_allclose(got.pose[-1], [*PLACE[-1], *START[3:]], rtol=0, atol=1e-9)
    flat = {"t": TIME, "x": PLACE[:, 0], "y": PLACE[:, 1], "theta": 0.5 * SHARE}
    got, _ = followed(tmp_path / "flat.csv", flat, axes=("x", "y", "rz"))
    assert_allclose(got.pose[-1, :3], [*PLACE[-1, :2], START[2]], rtol=0, atol=1e-9)
    roll, pitch, yaw = Rotation.from_quat(got.pose[-1, 3:], scalar_first=True).as_euler("xyz", degrees=True)
    assert_allclose([roll, pitch, np.radians(yaw)], [170, 10, 0.5], rtol=0, atol=1e-9)


NO_MOTION = {
    "positions alone": (place(), {}, 'has no column "qw" … roll pitch yaw … task.axes … columns: {qw: NAME}'),
    "no time": ({n: c for n, c in PLAIN.items() if n != "t"}, {}, 'has no column "t" … columns: {t: NAME}'),
    "no such column": (PLAIN, {"columns": {"x": "xx mm"}}, "columns x=xx mm: … 'xx'…; the columns are t, …"),
    "no such unit": (PLAIN, {"columns": {"x": "x furlong"}}, "columns x=x furlong: … unit 'furlong' … mm, …"),
    "names alone": ({n: [] for n in PLAIN}, {}, "… names of columns, and no rows"),
}  # fmt: skip


@pytest.mark.parametrize("case", NO_MOTION)
def test_what_is_no_motion_is_refused_with_the_way_out(case, tmp_path):
    table, keys, words = NO_MOTION[case]
    with pytest.raises(TargetError) as caught:
        followed(tmp_path / "none.csv", table, **keys)
    assert str(caught.value) == says(f"target.path[0].file: … {words}") and "\n" not in str(caught.value)


def test_a_file_in_utf_16_is_read(tmp_path):
    want, _ = followed(tmp_path / "plain.csv", PLAIN)
    text = (tmp_path / "plain.csv").read_text("utf-8")
    (tmp_path / "wide.csv").write_text(text, "utf-16")
    path = [{"file": {"path": str(tmp_path / "wide.csv")}}]
    section = TargetSection.model_validate({"path": path, "limits": LOOSE})
    assert_allclose(make_reference(section, START, 0.01, PUMA).pose, want.pose, rtol=0, atol=0)
