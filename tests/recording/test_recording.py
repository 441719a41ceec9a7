import inspect
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import rerun as rr
from layouts import last_layout, layouts
from rerun.chunk import RrdReader

from project import mostly_long
from rmrc.recording import stream
from rmrc.recording.layout import VIEW_ANGLE, VIEW_ASPECT, geometries, ramp
from rmrc.recording.scene import FORCE_LONGEST, THICKNESS, VELOCITY_SECONDS, Scene, half_axes
from rmrc.recording.shapes import Shape, shapes_of
from rmrc.recording.single import Recorder, RecordingError, read_columns
from rmrc.results.columns import COLUMNS, Divergence
from rmrc.results.run import Run
from rmrc.scenario import load, loads
from rmrc.scenario.choices import Status
from rmrc.show.palette import mix
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.spatial import quat_to_matrix

ROOT = Path(__file__).parents[2]
PLANAR = f"""
name: planar
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{line: {{to: [1.99, 0.0]}}}}], limits: {{velocity: 1.0, acceleration: 4.0, jerk: 80.0}}}}
"""
STANFORD = f"""
name: stanford
arm: {{model: {ROOT}/models/stanford.xml, site: tool, start: [0, 60 deg, 0.7, 5 deg, 40 deg, 0]}}
task: {{length: 1}}
control: {{inverse: {{damping: {{maximum: 0.1, below: 0.3}}}}}}
target: {{path: [{{turn: {{axis: y, angle: -30 deg}}}}]}}
plant: {{kind: ideal}}
"""


def simulated(text):
    prepared = prepare(loads(text))
    return prepared, Simulation([prepared]).run()[0]


@pytest.fixture(scope="module")
def planar():
    """(prepared, run)."""
    return simulated(PLANAR)


@pytest.fixture(scope="module")
def stanford():
    """(prepared, run)."""
    return simulated(STANFORD)


@pytest.fixture(scope="module", params=mostly_long(["stanford", "planar"], 2))
def ran(request):
    """(prepared, run), of a planar and of a spatial arm."""
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="module")
def recorded(ran, tmp_path_factory):
    """(prepared, run, path of its recording)."""
    prepared, run = ran
    path = tmp_path_factory.mktemp("recorded") / "run.rrd"
    record(path, prepared, run)
    return prepared, run, path


def record(path, prepared, run, size=500):
    with Recorder(path, prepared) as recorder:
        for part in blocks(run, size):
            recorder.write(part)
        recorder.finish("| figure | value |")


def blocks(run, size):
    return [rows(run, first, first + size) for first in range(0, len(run), size)]


def rows(run, first, last):
    return replace(run, columns={name: values[first:last].copy() for name, values in run.columns.items()})


def assert_same_bits(columns, expected):
    assert list(columns) == list(expected) == list(COLUMNS)
    for name, values in expected.items():
        assert columns[name].dtype == values.dtype
        assert columns[name].shape == values.shape
        assert columns[name].tobytes() == values.tobytes(), name


def stored(path, entity):
    """All values that an entity got, by component: arrays or lists, in the order of time."""
    found, ticks = {}, {}
    for chunk in RrdReader(path).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        tick = batch.column("tick").to_pylist() if "tick" in batch.schema.names else [0] * len(batch)
        for field, values in zip(batch.schema, batch.columns, strict=True):
            if str(field.type).startswith("list"):
                found.setdefault(field.name, []).extend(values.to_pylist())
                ticks.setdefault(field.name, []).extend(tick)
    return {
        name: [values[i] for i in np.argsort(ticks[name], kind="stable")] for name, values in found.items()
    }


def drawn(path, entity="/columns"):
    """What is only drawn at every tick, by name: (T, width)."""
    found = stored(path, entity)["columns"]
    return {name: np.array([row[0][name] for row in found]) for name in found[0][0]}


def entities(path, is_static=None):
    chunks = RrdReader(path).stream()
    return {one.entity_path for one in chunks if is_static is None or one.is_static is is_static}


# Columns ------------------------------------------------------------------------------------------


def test_columns_read_back_equal_the_run_and_its_npz_bit_for_bit(recorded, tmp_path):
    _, run, path = recorded
    run.save(tmp_path / "run.npz")
    assert_same_bits(read_columns(path), run.columns)
    assert_same_bits(read_columns(path), Run.read(tmp_path / "run.npz").columns)


@pytest.mark.parametrize("size", [1, 7, 10_000])
def test_columns_do_not_depend_on_the_size_of_blocks_and_keep_nan_and_infinity(planar, tmp_path, size):
    prepared, run = planar[0], rows(planar[1], 0, 40)
    run.columns["condition"][[3, 5]] = np.inf, -0.0
    # A NaN with a payload: equal bits, not just "also a NaN".
    run.columns["tau"][4, 1] = np.frombuffer(np.uint64(0x7FF800000000BEEF).tobytes(), np.float64)[0]
    run.columns["time"][:] = np.nextafter(np.arange(40) * 0.001, np.inf)  # not whole nanoseconds
    run.columns["path_time"][:] = run.columns["time"]  # as of every path that is not slowed
    record(tmp_path / "run.rrd", prepared, run, size)
    assert_same_bits(read_columns(tmp_path / "run.rrd"), run.columns)


@pytest.mark.parametrize("name", mostly_long(["gain", "condition", "manipulability", "pose_error"], 3))
def test_a_column_is_left_out_only_of_blocks_in_which_it_follows_to_the_bit(recorded, tmp_path, name):
    prepared, run, path = recorded
    found = stored(path, "/columns")
    assert name not in found  # which is half of what there is to save
    fields = found["columns"][0][0].keys()
    odd = rows(run, 0, 60)
    values = odd.columns[name]
    values.flat[values.size // 2] = np.nextafter(values.flat[values.size // 2], np.inf)
    record(tmp_path / "odd.rrd", prepared, odd, 20)
    found = stored(tmp_path / "odd.rrd", "/columns")
    assert len(found[name]) == 20
    # The viewer warns of a component whose type changes.
    assert all(row[0].keys() == fields for row in found["columns"])
    assert_same_bits(read_columns(tmp_path / "odd.rrd"), odd.columns)


def test_a_changed_last_bit_is_seen(recorded):
    _, run, path = recorded
    expected = {name: values.copy() for name, values in run.columns.items()}
    expected["q"][7, 1] = np.nextafter(expected["q"][7, 1], np.inf)
    with pytest.raises(AssertionError, match=r"^q\n"):
        assert_same_bits(read_columns(path), expected)


def test_sim_time_is_time_rounded_to_nanoseconds(recorded):
    _, run, path = recorded
    found = {}
    for chunk in RrdReader(path).stream().filter(content="/columns", is_static=False):
        batch = chunk.to_record_batch()
        nanoseconds = batch.column("sim_time").to_numpy(zero_copy_only=False).astype(np.int64)
        found.update(zip(batch.column("tick").to_pylist(), nanoseconds, strict=True))
    assert found == {tick: round(time * 1e9) for tick, time in enumerate(run["time"])}


# Files --------------------------------------------------------------------------------------------


def test_the_recording_appears_whole_and_only_when_finished(ran, tmp_path):
    prepared, run = ran
    path = tmp_path / "made" / "run.rrd"
    with Recorder(path, prepared) as recorder:
        recorder.write(rows(run, 0, 50))
        assert not path.exists()
        assert recorder.part_path == tmp_path / "made" / "run.rrd.part"
        assert recorder.part_path.exists()
        recorder.finish("")
    assert path.exists()
    assert list(path.parent.iterdir()) == [path]


def test_a_tick_takes_no_more_than_its_budget_on_disk(recorded, tmp_path):
    """Beyond layouts, geometries and texts: 450 bytes of two joints, 850 of six; `benchmarks/recording.py`."""
    prepared, run, path = recorded
    half = len(run) // 2
    record(tmp_path / "half.rrd", prepared, rows(run, 0, half))
    a_tick = (path.stat().st_size - (tmp_path / "half.rrd").stat().st_size) / (len(run) - half)
    assert 200.0 < a_tick <= {2: 450.0, 6: 850.0}[len(run.joints)]


# Another process reads the run from an npz: it need not wait for the law to be compiled.
PRELUDE = f"""
import os, resource, signal, sys, time
from dataclasses import replace
from pathlib import Path
from rmrc.recording.single import Recorder, RecordingError
from rmrc.results.run import Run
from rmrc.scenario import loads
from rmrc.simulation.prepare import prepare
{"".join(map(inspect.getsource, (record, blocks, rows)))}
folder = Path(sys.argv[1])
prepared, run = prepare(loads({PLANAR!r})), Run.read(folder / "run.npz")
"""

FULL = """
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))
try:
    record(folder / "run.rrd", prepared, run)
except RecordingError as error:
    print(error)
"""


def in_another_process(code, folder, *more):
    command = [sys.executable, "-c", PRELUDE + code, folder, *more]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.long  # rerun may first have to be waited for
def test_a_full_disk_is_an_error_and_not_a_shorter_recording(planar, tmp_path):
    planar[1].save(tmp_path / "run.npz")
    done = in_another_process(FULL, tmp_path)
    part = tmp_path / "run.rrd.part"
    start = f"{part}: cannot write the recording: "
    # which of the two is a race within rerun
    reasons = ["File-writer thread shut down prematurely", "Flush timed out - not all log messages were sent"]
    assert done.stdout in [f"{start}{reason}; is the disk full?\n" for reason in reasons]
    assert done.returncode == 0
    assert not (tmp_path / "run.rrd").exists()


def test_rerun_verifies_the_recording(recorded):
    command = [sys.executable, "-m", "rerun_cli", "rrd", "verify", recorded[2]]
    done = subprocess.run(command, env={**os.environ, "CI": "1"}, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "1 file verified without error." in done.stderr


def test_a_viewer_that_is_open_takes_arms_of_different_joints(recorded):
    """It merges the columns of all recordings of one application, and refuses a second width of `q`."""
    path = recorded[2]
    (entry,) = RrdReader(path).recordings()
    assert entry.application_id == f"rmrc {path.stem}"


def test_a_folder_in_the_way_is_one_clear_line(planar, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError) as caught:
        Recorder(tmp_path / "file" / "run.rrd", planar[0])
    part = tmp_path / "file" / "run.rrd.part"
    folder = tmp_path / "file"
    assert str(caught.value) == f"{part}: cannot write the recording: [Errno 17] File exists: '{folder}'"


def test_what_is_no_recording_is_one_clear_line(tmp_path):
    with pytest.raises(RecordingError) as caught:
        read_columns(tmp_path / "none.rrd")
    assert str(caught.value) == f"{tmp_path}/none.rrd: no such recording"
    (tmp_path / "text.rrd").write_text("hello, this is text")
    with pytest.raises(RecordingError) as caught:
        read_columns(tmp_path / "text.rrd")
    text = str(caught.value)
    assert text.startswith(f"{tmp_path}/text.rrd: is damaged, or not a recording: ")
    assert "\n" not in text
    other = rr.RecordingStream("other")
    other.save(tmp_path / "other.rrd")
    other.log("x", rr.TextDocument("nothing of ours"))
    other.disconnect()
    with pytest.raises(RecordingError) as caught:
        read_columns(tmp_path / "other.rrd")
    assert str(caught.value) == f"{tmp_path}/other.rrd: has no columns of a run of rmrc"


# The picture --------------------------------------------------------------------------------------


def test_every_column_has_the_arrow_type_that_rerun_itself_writes():
    """The viewer draws nothing, and the file verifies, when a list may hold nulls."""
    points, quats, colors = np.ones((4, 3)), np.ones((4, 4)), np.ones(4, np.uint32)
    theirs = [
        *rr.Transform3D.columns(translation=points, quaternion=quats),
        *rr.Points3D.columns(positions=points),
        *rr.LineStrips3D.columns(strips=np.ones((4, 2, 3)), colors=colors),
        *rr.Ellipsoids3D.columns(centers=points, half_sizes=points, quaternions=quats),
        *rr.Arrows3D.columns(vectors=points, origins=points, colors=colors),
    ]
    expected = {str(column.component_descriptor()): column.as_arrow_array().type for column in theirs}
    ours = {str(c.descriptor): c for c in vars(stream).values() if isinstance(c, stream.Component)}
    assert len(ours) == 11
    for name, component in ours.items():
        values = np.ones((4, 2, 3) if component.is_strip else (4, component.size))
        assert stream.Values(component, values).as_arrow_array().type == expected[name], name


def test_bodies_are_where_mujoco_has_them_sixty_times_a_second_and_at_the_end(recorded):
    prepared, run, path = recorded
    model = prepared.arm.model
    shown = sorted({*range(0, len(run), 16), len(run) - 1})
    data = mujoco.MjData(model)
    body = model.site(prepared.arm.site).bodyid[0]
    found = stored(path, f"/arm/{model.body(body).name}")
    assert len(found["Transform3D:translation"]) == len(shown)
    for i, tick in enumerate(shown):
        data.qpos[:] = run["q"][tick]
        mujoco.mj_kinematics(model, data)
        # float32, as the viewer draws
        np.testing.assert_allclose(found["Transform3D:translation"][i][0], data.xpos[body], atol=1e-6)
        x, y, z, w = found["Transform3D:quaternion"][i][0]
        np.testing.assert_allclose([w, x, y, z], data.xquat[body], atol=1e-6)


def test_a_run_cut_short_shows_its_last_tick(ran, tmp_path):
    prepared, run = ran
    path = tmp_path / "run.rrd"
    record(path, prepared, rows(run, 0, 57), 25)
    found = stored(path, "/tip/now")["Points3D:positions"]
    assert len(found) == 5  # ticks 0, 16, 32, 48, and 56
    np.testing.assert_allclose(found[-1][0], run["pose"][56, :3], atol=1e-6)


def test_capsules_end_where_mujoco_ends_them(recorded):
    """Local z of MuJoCo's geom frame, ± the half length, in the frame of the body."""
    prepared, _, path = recorded
    model, checked = prepared.arm.model, 0
    for shape in shapes_of(prepared.arm):
        if shape.kind != "capsule":
            continue
        body, geom = model.body(shape.body).name, model.geom(shape.name)
        alike = [
            one.name for one in shapes_of(prepared.arm) if (one.body, one.kind) == (shape.body, "capsule")
        ]
        drawn, i = stored(path, f"/arm/{body}"), alike.index(shape.name)
        found = {name: row[0][i : i + 1] for name, row in drawn.items() if name.startswith("Capsules3D")}
        quat, turn = found["Capsules3D:quaternions"][0], np.empty(9)
        mujoco.mju_quat2Mat(turn, np.array([quat[3], *quat[:3]]))
        start = np.array(found["Capsules3D:translations"][0])
        end = start + turn.reshape(3, 3)[:, 2] * found["Capsules3D:lengths"][0]
        mujoco.mju_quat2Mat(turn, geom.quat)
        half = turn.reshape(3, 3)[:, 2] * geom.size[1]
        np.testing.assert_allclose([start, end], [geom.pos - half, geom.pos + half], atol=1e-6)
        assert found["Capsules3D:radii"][0] == np.float32(geom.size[0])
        checked += 1
    assert checked > 0


@pytest.mark.parametrize(
    ("kind", "component", "expected"),
    [
        ("box", "Boxes3D:half_sizes", [[0.1, 0.2, 0.3]]),
        ("ellipsoid", "Ellipsoids3D:half_sizes", [[0.1, 0.2, 0.3]]),
        ("sphere", "Ellipsoids3D:half_sizes", [[0.1, 0.1, 0.1]]),
        ("cylinder", "Cylinders3D:lengths", [0.4]),
        ("mesh", "Mesh3D:vertex_positions", [[1.0, 2.0, 3.0], [1.0, 3.0, 3.0], [0.0, 2.0, 3.0]]),
    ],
)
@pytest.mark.parametrize("count", [1, 2])  # of a kind: in one batch
def test_a_geometry_keeps_its_size_and_place(count, kind, component, expected):
    quarter = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])  # about z: x becomes y, y becomes -x
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    shape = Shape(
        "g", 1, kind, np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0, *quarter]), np.array([1.0, 0, 0, 1]),
        vertices, np.array([[0, 1, 2]], np.int32),
    )  # fmt: skip
    found = geometries([replace(shape, name=f"g{i}") for i in range(count)])
    assert list(found) == [f"/g{i}" for i in range(count)] if kind == "mesh" else [""]
    drawn = {
        str(batch.component_descriptor().component): batch.as_arrow_array().to_pylist()
        for (one,) in found.values()
        for batch in one.as_component_batches()
    }
    count = 1 if kind == "mesh" else count
    np.testing.assert_allclose(drawn[component], expected * count, atol=1e-6)
    if kind != "mesh":
        (centers,) = [values for name, values in drawn.items() if name.endswith(":centers")]
        assert centers == [[1.0, 2.0, 3.0]] * count
        (quats,) = [values for name, values in drawn.items() if name.endswith(":quaternions")]
        np.testing.assert_allclose(quats, [[0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]] * count, atol=1e-7)


def test_a_ball_and_an_ellipsoid_of_a_body_are_one_batch_of_their_own_sizes():
    here, size = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.2, 0.3])
    none = np.empty((0, 3)), np.empty((0, 3), np.int32)
    both = [Shape(kind, 1, kind, size, here, np.ones(4), *none) for kind in ("sphere", "ellipsoid")]
    ((drawn,),) = geometries(both).values()
    (sizes,) = [
        batch.as_arrow_array().to_pylist()
        for batch in drawn.as_component_batches()
        if str(batch.component_descriptor().component) == "Ellipsoids3D:half_sizes"
    ]
    np.testing.assert_allclose(sizes, [[0.1] * 3, [0.1, 0.2, 0.3]], rtol=1e-6)


def ellipsoids(path):
    """Half axes (F, 3) and directions as columns (F, 3, 3) of the velocity, then of the force ellipsoid."""
    found = []
    for name in ("velocity", "force"):
        drawn = stored(path, f"/tip/{name}_ellipsoid")
        half = np.array([row[0] for row in drawn["Ellipsoids3D:half_sizes"]])
        quats = [row[0] for row in drawn["Ellipsoids3D:quaternions"]]
        turns = np.empty((len(quats), 9))
        for turn, (x, y, z, w) in zip(turns, quats, strict=True):
            mujoco.mju_quat2Mat(turn, np.array([w, x, y, z]))
        found += [half, turns.reshape(-1, 3, 3)]
    return found


def matrix(half, turn, power):
    """The ellipsoid as a matrix: turn diag(half^power) turnᵀ."""
    return turn @ (half[:, :, None] ** power * np.swapaxes(turn, 1, 2))


def test_velocity_ellipsoid_of_the_planar_arm_is_j_jt_and_the_force_ellipsoid_its_inverse(planar, tmp_path):
    """(J Jᵀ) from the textbook's J of two links: another route than MuJoCo and than an SVD."""
    prepared, run = planar[0], rows(planar[1], 0, 500)
    record(tmp_path / "run.rrd", prepared, run)
    velocity, turn, force, force_turn = ellipsoids(tmp_path / "run.rrd")
    shown = [*range(0, 500, 16), 499]
    a, b = run["q"][shown, 0], run["q"][shown].sum(axis=1)
    J = np.array(
        [[-np.sin(a) - np.sin(b), -np.sin(b)], [np.cos(a) + np.cos(b), np.cos(b)]]
    ).transpose(2, 0, 1)  # fmt: skip
    expected = J @ np.swapaxes(J, 1, 2)
    # float32 half axes, squared
    flat = matrix(velocity / VELOCITY_SECONDS, turn, 2.0)[:, :2, :2]
    np.testing.assert_allclose(flat, expected, atol=2e-6)
    c = force[0, 0] * velocity[0, 0] / VELOCITY_SECONDS
    flat = matrix(force / c, force_turn, 2.0)[:, :2, :2]
    np.testing.assert_allclose(flat, np.linalg.inv(expected), rtol=1e-5, atol=1e-5)
    # the fault of a peer: radii 1/σ for velocities
    swapped = matrix(c / velocity, turn, 2.0)[:, :2, :2]
    assert np.abs(swapped - expected).max() > 0.1
    # out of the plane both are flat
    reach = Scene(prepared).reach
    np.testing.assert_allclose(velocity[:, 2], THICKNESS * reach, rtol=1e-6)
    np.testing.assert_allclose(np.abs(turn[:, 2, 2]), 1.0, atol=1e-6)


def test_velocity_ellipsoid_of_a_task_with_rotations_is_the_section_where_they_are_held(stanford, tmp_path):
    """The section of {A η : |η| <= 1} with ω = 0 is (Σ_vv - Σ_vω Σ_ωω⁻¹ Σ_ωv)⁻¹ for Σ = A Aᵀ: a Schur complement."""
    prepared, run = stanford[0], rows(stanford[1], 0, 500)
    record(tmp_path / "run.rrd", prepared, run)
    velocity, turn, *_ = ellipsoids(tmp_path / "run.rrd")
    for i, tick in enumerate([*range(0, 500, 16), 499]):
        J = prepared.arm.jacobian(run["q"][tick])  # length is 1, so S_q = 1
        S = J @ J.T
        section = S[:3, :3] - S[:3, 3:] @ np.linalg.solve(S[3:, 3:], S[3:, :3])
        found = matrix(velocity[i : i + 1] / VELOCITY_SECONDS, turn[i : i + 1], 2.0)[0]
        np.testing.assert_allclose(found, section, atol=2e-6)
        assert np.abs(S[:3, :3] - section).max() > 0.1  # not the shadow, which stays round


def test_a_wrist_that_turns_about_its_own_site_is_drawn_as_large_as_its_hand(tmp_path):
    prepared = prepare(load(ROOT / "scenarios/spherical_wrist_pole.yaml"))
    scene = Scene(prepared)
    assert np.ptp(scene.path, axis=0).max() == 0.0  # the site stays, at the center of the wrist
    # finger and drives of the model are at most 0.2 m from there
    assert 0.15 < scene.reach < 0.25
    record(tmp_path / "run.rrd", prepared, rows(Simulation([prepared]).run()[0], 0, 100))
    velocity, _, force, _ = ellipsoids(tmp_path / "run.rrd")
    assert np.isfinite(velocity).all() and np.isfinite(force).all()


def test_half_axes_are_bounded_at_a_singularity():
    velocity, force = half_axes(np.array([[2.0, 0.0, 0.0]]), rows=2, reach=2.0)
    np.testing.assert_allclose(velocity, [[2.0 * VELOCITY_SECONDS, 2 * THICKNESS, 2 * THICKNESS]])
    assert force[0, 1] == pytest.approx(2.0 * FORCE_LONGEST, rel=1e-12)
    assert force[0, 2] == 2 * THICKNESS


def test_the_arrow_lies_along_u_min_both_ways_and_reddens_with_sigma_min(recorded):
    prepared, run, path = recorded
    drawn = stored(path, "/tip/dying")
    shown = sorted({*range(0, len(run), 16), len(run) - 1})
    vectors = np.array(drawn["Arrows3D:vectors"])
    np.testing.assert_array_equal(vectors[:, 0], -vectors[:, 1])
    u_min = run["u_min"][shown, :3]
    np.testing.assert_allclose(np.cross(vectors[:, 0], u_min), 0.0, atol=1e-6)
    colors = np.array(drawn["Arrows3D:colors"])[:, 0]
    green = colors >> 16 & 255  # yellow to red: only green goes
    order = np.argsort(run["sigma"][shown, -1])
    assert (np.diff(green[order]) >= 0).all()
    assert green.min() < green.max()
    assert vectors.shape[1] == (4 if "rx" in prepared.scenario.task.axes else 2)  # and of the rotation


def test_the_ramp_goes_from_calm_to_red():
    assert ramp(np.array([0.0, 1.0]), 0xFFD60AFF).tolist() == [0xFFD60AFF, 0xFF2D2DFF]
    assert mix(0x000000FF, 0xFFFFFFFF, 0.5) == 0x808080FF


def test_the_trail_joins_the_positions_of_the_tip(recorded):
    _, run, path = recorded
    strips = np.array([row[0] for row in stored(path, "/tip/trail")["LineStrips3D:strips"]])
    np.testing.assert_array_equal(strips[1:, 0], strips[:-1, 1])
    shown = sorted({*range(0, len(run), 16), len(run) - 1})
    np.testing.assert_allclose(strips[:, 1], run["pose"][shown, :3], atol=1e-6)


def states(path, entity):
    """(tick, text) of every state of a lane."""
    found = []
    for chunk in RrdReader(path).stream().filter(content=entity, is_static=False):
        batch = chunk.to_record_batch()
        texts = [state[0] for state in batch.column("StateChange:state").to_pylist()]
        found += zip(batch.column("tick").to_pylist(), texts, strict=True)
    return sorted(found)


@pytest.fixture
def patience(monkeypatch):
    """The layout of a run that lasts is written with the first block."""
    monkeypatch.setattr(stream, "PATIENT", 1)
    monkeypatch.setattr(stream, "LONG", -1.0)


@pytest.mark.usefixtures("patience")
def test_the_status_is_one_lane_of_words_that_change_exactly_where_it_does(planar, tmp_path):
    prepared, run = planar[0], rows(planar[1], 0, 60)
    status = run.columns["status"]
    status[:] = 0
    status[10:30] = Status.DAMPED
    status[20:55] |= Status.RATE_LIMITED
    path = tmp_path / "run.rrd"
    record(path, prepared, run, 15)
    expected = [(0, "free"), (10, "damped"), (20, "damped, rate limited"), (30, "rate limited"), (55, "free")]
    assert states(path, "/status") == expected
    # both at once are too short for their words: the label of the state after it has them, with an arrow
    events = states(path, "/events")
    assert [tick for tick, _ in events] == [0, 10, 20, 30, 55]
    assert [text for _, text in events[:2]] == ["free", "damped"] and events[2][1].startswith("short")
    assert re.fullmatch(r"← damped, rate limited · rate limited", events[3][1])


@pytest.mark.usefixtures("patience")
def test_a_divergence_is_shown_in_its_lane(planar, tmp_path):
    prepared, run = planar
    divergence = Divergence(60, 0.06, "elbow", "not finite")
    path = tmp_path / "run.rrd"
    with Recorder(path, prepared) as recorder:
        recorder.write(rows(run, 0, 60))
        recorder.write(replace(rows(run, 0, 0), divergence=divergence))
        recorder.finish("")
    assert states(path, "/status")[-1] == states(path, "/events")[-1] == (60, str(divergence))
    assert len(read_columns(path)["time"]) == 60


def test_a_pale_arm_is_where_the_law_takes_it_to_be(tmp_path, planar):
    text = PLANAR + "plant: {stretch: {link_1: 1.1}, joint_offset: 0.05}\ncontrol: {period: 0.01}\n"
    prepared, run = simulated(text)
    record(tmp_path / "run.rrd", prepared, run)
    known, q = planar[0].arm, run["q"] - 0.05
    elbow = known.model.body("link_2").id
    for entity, arm, at in (("arm", prepared.true_arm, run["q"]), ("believed", known, q)):
        places = stored(tmp_path / "run.rrd", f"/{entity}/link_2")["Transform3D:translation"]
        want = arm.frames(at)[0][:, elbow, :3]
        np.testing.assert_allclose([place[0] for place in places], want, atol=1e-6)  # float32
    assert np.abs(np.subtract(known.frames(q)[0], prepared.true_arm.frames(run["q"])[0])).max() > 0.1
    off = drawn(tmp_path / "run.rrd")["belief"]
    np.testing.assert_allclose(off, np.full((len(run), 2), -50.0), rtol=1e-6)  # float32
    colors = stored(tmp_path / "run.rrd", "/believed/link_2")["Capsules3D:colors"][0]
    assert [color & 255 for color in colors] == [round(0.3 * 255)]
    assert "pale arm" in stored(tmp_path / "run.rrd", "/text/legend")["TextDocument:text"][0][0]
    assert_same_bits(read_columns(tmp_path / "run.rrd"), run.columns)


def test_scenario_scorecard_and_legend_are_inside(recorded):
    prepared, _, path = recorded
    text = stored(path, "/text/scenario")["TextDocument:text"][0][0]
    assert loads(re.fullmatch(r"```yaml\n(.*)```\n", text, re.DOTALL)[1]) == prepared.scenario
    assert stored(path, "/text/scorecard")["TextDocument:text"] == [["| figure | value |"]]
    assert "green ellipsoid" in stored(path, "/text/legend")["TextDocument:text"][0][0]


def test_the_layout_is_in_the_file_and_looks_only_at_what_is_recorded(recorded):
    _, _, path = recorded
    assert_looks_at_what_is_recorded(path)


def test_so_does_the_layout_of_a_law_that_is_misled(tmp_path):
    prepared, run = simulated(PLANAR + "control: {period: 0.01, state: integrated}\n")
    record(tmp_path / "run.rrd", prepared, run)
    assert_looks_at_what_is_recorded(tmp_path / "run.rrd")
    assert "Joints as believed, less true [mrad]" in final_views(tmp_path / "run.rrd")


def test_rates_that_arrive_are_drawn_beside_those_commanded_where_they_are_others(tmp_path, planar):
    prepared, run = simulated(PLANAR + "control: {period: 0.01}\nplant: {delay: 0.02, lag: 0.01}\n")
    record(tmp_path / "late.rrd", prepared, run)
    record(tmp_path / "direct.rrd", *planar)
    assert (run["qdot_arrived"] != run["qdot_cmd"]).any()
    for name, (_, done), is_late in (("late", (prepared, run), True), ("direct", planar, False)):
        path = tmp_path / f"{name}.rrd"
        rates = next(view for title, view in final_views(path).items() if title.startswith("Joint rates"))
        assert ("columns.qdot_arrived[]" in [source for source, _ in rates]) is is_late
        assert_same_bits(read_columns(path), done.columns)
        assert_looks_at_what_is_recorded(path)
        text = stored(path, "/text/legend")["TextDocument:text"][0][0]
        assert ("received by the plant" in text) is is_late
        assert "{" not in text


def final_views(path):
    """Of the last layout, by title of each plot: its sources, each with the aggregation of its lines."""
    last = last_layout(path)
    found = {}
    for entity, table in last.items():
        if table.get("ViewBlueprint:class_identifier") != ["TimeSeries"]:
            continue
        (title,) = table["ViewBlueprint:display_name"]
        curves = []
        for below, other in last.items():
            if below.startswith(f"{entity}/") and "VisualizerInstruction:component_map" in other:
                (one,) = other["VisualizerInstruction:component_map"]
                source = f"{one['source_component']}{one['selector'] or ''}"
                curves.append((source, other.get("SeriesLines:aggregation_policy")))
        found[title] = curves
    return found


def assert_looks_at_what_is_recorded(path, found=None):
    """Hold the views of the layouts against what is in the file."""
    known = entities(path)
    for tables in layouts(path) if found is None else found:
        named = {
            row[0] for table in tables.values() for row in [table.get("ViewBlueprint:display_name")] if row
        }
        assert {"Events", "Legend", "Scorecard", "Scenario", "Now"} < named
        origins = {table.get("ViewBlueprint:space_origin", [""])[0].strip("/") for table in tables.values()}
        assert origins == {"", "now", "text/legend", "text/scorecard", "text/scenario"}
        queries = [query for table in tables.values() for query in table.get("ViewContents:query", ())]
        paths = [query.lstrip("+ ").removesuffix("/**") for query in queries if "$origin" not in query]
        assert "/columns" in paths
        missing = [one for one in paths if not any(entity.startswith(one) for entity in known)]
        assert missing in ([], ["/events"], ["/text/scorecard"])  # a run that is killed has neither


# The plots ----------------------------------------------------------------------------------------


def test_every_line_keeps_its_peaks_and_the_one_drawn_is_that_of_the_scorecard(recorded):
    """Each pixel keeps its least and largest value, so that what is highest is the largest in the data."""
    _, run, path = recorded
    views = final_views(path)
    # a mark is no line
    policies = [policy for view in views.values() for source, policy in view if source != "rate"]
    assert policies
    assert all(policy == [rr.components.AggregationPolicy.MinMax.value] for policy in policies)
    (title,) = [title for title in views if title.startswith("Joint rates")]
    assert {"columns.qdot[]", "columns.qdot_cmd[]"} < {source for source, _ in views[title]}
    found = stored(path, "/columns")["columns"]
    peak = max(abs(rate) for row in found for rate in row[0]["qdot"])
    assert peak == run.scorecard["joint_rate.peak"].value


def test_what_is_only_drawn_is_that_of_the_columns(recorded):
    prepared, run, path = recorded
    curves, sigma = drawn(path), run["sigma"]
    logs, damped = curves["logs"], run["damping"] > 0.0
    np.testing.assert_allclose(10.0 ** logs[:, 0], sigma[:, -1], rtol=1e-5)
    np.testing.assert_allclose(10.0 ** logs[:, 1:-1], sigma[:, :-1], rtol=1e-5)
    assert (np.isnan(logs[:, -1]) == ~damped).all()
    np.testing.assert_allclose(10.0 ** logs[damped, -1], run["damping"][damped], rtol=1e-4)
    position = 1e3 * np.sqrt((run["pose_error"][:, : 2 if prepared.arm.n == 2 else 3] ** 2).sum(axis=1))
    np.testing.assert_allclose(curves["error"][:, 0], position, rtol=1e-6)


def test_the_plain_inverse_is_dashed_and_its_peak_is_told(planar, tmp_path):
    prepared, run = planar
    record(tmp_path / "run.rrd", prepared, run)
    (title,) = [title for title in final_views(tmp_path / "run.rrd") if title.startswith("Joint rates")]
    plain = drawn(tmp_path / "run.rrd")["plain"]
    gaps = np.isnan(plain).all(axis=1)
    assert 0.3 < gaps.mean() < 0.6
    np.testing.assert_allclose(plain[~gaps], run["qdot_plain"][~gaps], rtol=1e-6, atol=1e-30)  # float32
    assert not gaps[np.abs(run["qdot_plain"]).max(axis=1).argmax()]  # no gap swallows a peak
    assert "plain J⁻¹ dashed" in title


def test_a_baseline_is_a_ghost_with_dashed_rates_and_its_columns_are_kept(planar, tmp_path):
    prepared, run = planar
    other = replace(run, columns=run.columns | {"qdot_cmd": run["qdot_cmd"].copy()})
    other.columns["qdot_cmd"][77, 0] = 12440.0
    path = tmp_path / "run.rrd"
    with Recorder(path, prepared, prepared) as recorder:
        for part, beside in zip(blocks(run, 500), blocks(other, 500), strict=True):
            recorder.write(part)
            recorder.write_baseline(beside)
        recorder.finish("")
    assert_same_bits(read_columns(path), run.columns)
    (title,) = [title for title in final_views(path) if title.startswith("Joint rates")]
    assert title.endswith("baseline peak 12,440 ↑")
    assert np.nanmax(drawn(path, "/baseline/columns")["dashed"]) == pytest.approx(12440.0)
    for entity in ("arm/link_2", "tip/trail"):
        assert len(stored(path, f"/baseline/{entity}")) > 0
    colors = stored(path, "/baseline/arm/link_2")["Capsules3D:colors"][0]
    assert colors[0] & 255 < 128  # a ghost
    assert "gray ghost" in stored(path, "/text/legend")["TextDocument:text"][0][0]


def test_a_rate_far_beyond_its_limit_leaves_the_plot_and_is_told(planar, tmp_path):
    prepared, run = planar[0], rows(planar[1], 0, 200)
    run.columns["qdot_cmd"][150, 1] = -12658.02
    record(tmp_path / "run.rrd", prepared, run)
    (title,) = [title for title in final_views(tmp_path / "run.rrd") if title.startswith("Joint rates")]
    assert title.endswith("peak 12,658 ↓")
    (mark,) = stored(tmp_path / "run.rrd", "/peak/own")["rate"]
    limit = prepared.law.rate_limit.max()
    assert -20.0 * limit < mark[0] < -2.0 * limit
    assert states(tmp_path / "run.rrd", "/events")  # the strip is there as well
    record(tmp_path / "small.rrd", planar[0], rows(planar[1], 0, 200))
    assert not any("peak" in title for title in final_views(tmp_path / "small.rrd"))
    assert "/peak/own" not in entities(tmp_path / "small.rrd")


LOOKS = {  # the plot that is in sight, and what it has at each tick
    "torque": ("Torque", lambda run: run["tau"]),
    "joints": ("Joint positions [deg]", lambda run: np.degrees(run["q"])),
    "rotation": ("Hand turned since the start [deg]", lambda run: np.degrees(
        np.column_stack([np.zeros(len(run)), np.abs(run["q"].sum(axis=1) - run["q"][0].sum())]))),
    "sigma": ("Singular values", lambda run: np.log10(run["sigma"][:, -1:])),
}  # fmt: skip


@pytest.mark.parametrize(
    ("at", "quantity"), [*((None, one) for one in LOOKS), *mostly_long([(0.3, one) for one in LOOKS], 4)]
)
def test_what_the_scenario_asks_to_look_at_is_in_sight_and_marked(quantity, at, tmp_path):
    """The marks are the run's own values at that tick: float32, and angles of cosines near 1."""
    asked = f"look: {{quantity: {quantity}{'' if at is None else f', at: {at}'}}}\n"
    text = PLANAR.replace("[x, y]", "[x, y, rz]").replace(
        "{line: {to: [1.99, 0.0]}}", "{line: {by: [0.1, 0]}}"
    )
    prepared, run = simulated(text + "control: {period: 0.01, inverse: {method: damped}}\n" + asked)
    path = tmp_path / "run.rrd"
    record(path, prepared, run, size=17)
    title, of = LOOKS[quantity]
    values = of(run)
    worth = -values[:, 0] if quantity == "sigma" else np.abs(values).max(axis=1)
    if at is not None:
        worth = -np.abs(run["time"] - at)
    (mark,) = stored(path, "/look")["look"]
    np.testing.assert_allclose(
        mark, values[worth.argmax()], rtol=1e-5, atol=2e-6 * max(1, np.abs(values).max())
    )
    (ball,) = stored(path, "/tip/look")["Points3D:positions"]
    assert np.linalg.norm(run["pose"][:, :3] - ball[0], axis=1).argmin() == worth.argmax()
    last = last_layout(path)
    (view,) = [
        name
        for name, table in last.items()
        if table.get("ViewBlueprint:display_name", [""])[0].startswith(title)
    ]
    assert ("look", None) in [
        (source, None) for source, _ in final_views(path)[last[view]["ViewBlueprint:display_name"][0]]
    ]
    tabs = [
        table for table in last.values() if view.lstrip("/") in str(table.get("ContainerBlueprint:contents"))
    ]
    active = [table.get("ContainerBlueprint:active_tab") for table in tabs]
    assert active[0] is None or view.lstrip("/") in str(active[0])
    assert_looks_at_what_is_recorded(path)
    assert_same_bits(read_columns(path), run.columns)


def test_a_run_that_lacks_what_to_look_at_says_so_and_is_recorded_as_without(planar, tmp_path):
    for asked, why in (
        ("{quantity: torque}", "the run has no torque"),
        ("{quantity: rates, at: 99}", "ends before"),
    ):
        prepared, run = simulated(
            PLANAR + f"control: {{period: 0.01}}\nplant: {{kind: ideal}}\nlook: {asked}\n"
        )
        assert any(why in one.text for one in prepared.assumed)
        record(tmp_path / "run.rrd", prepared, run)
        assert not {"/look", "/tip/look"} & entities(tmp_path / "run.rrd")
    assert not any("look at" in one.text for one in planar[0].assumed)  # negative control


def test_sigma_that_leaves_its_plot_is_told_and_marked_where_it_is_least(planar, tmp_path):
    prepared, run = planar[0], rows(planar[1], 0, 200)
    run.columns["sigma"][150, 1] = 3e-9
    record(tmp_path / "run.rrd", prepared, run)
    (title,) = [title for title in final_views(tmp_path / "run.rrd") if title.startswith("Singular values")]
    assert title.endswith("; least σ_min 3e-09 ↓")
    (mark,) = stored(tmp_path / "run.rrd", "/peak/sigma")["rate"]
    assert -5.2 < mark[0] < -4.0  # at the lower end of an axis that ends above 1
    record(tmp_path / "small.rrd", prepared, rows(planar[1], 0, 200))  # negative control
    assert not any("least" in title for title in final_views(tmp_path / "small.rrd"))
    assert "/peak/sigma" not in entities(tmp_path / "small.rrd")


def test_the_camera_sees_the_whole_arm_all_the_time(recorded):
    """Every corner of every capsule at every tenth tick, in the frustum of the eye that is in the file."""
    prepared, run, path = recorded
    last = last_layout(path)
    (eye,) = [table for table in last.values() if "EyeControls3D:position" in table]
    position, target = (np.array(eye[f"EyeControls3D:{name}"][0]) for name in ("position", "look_target"))
    back = (position - target) / np.linalg.norm(position - target)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(back, right), back])
    arm, tangent = prepared.true_arm, np.tan(VIEW_ANGLE / 2)
    bodies = arm.frames(run["qpos"][::10])[0]
    checked = 0
    for shape in shapes_of(arm):
        if shape.kind != "capsule":
            continue
        turns = quat_to_matrix(bodies[:, shape.body, 3:])
        half = quat_to_matrix(shape.pose[3:])[:, 2] * shape.size[1]
        for end in (shape.pose[:3] - half, shape.pose[:3] + half):
            across = (bodies[:, shape.body, :3] + turns @ end - position) @ axes.T
            assert (across[:, 2] < 0).all()
            assert (np.abs(across[:, 1]) <= -tangent * across[:, 2]).all()
            assert (np.abs(across[:, 0]) <= -tangent * VIEW_ASPECT * across[:, 2]).all()
            checked += 1
    assert checked


def test_the_line_of_numbers_says_what_the_columns_say(planar, tmp_path):
    prepared, run = planar[0], rows(planar[1], 0, 1101)
    run.columns["status"][1000:] = Status.DAMPED | Status.RATE_LIMITED
    record(tmp_path / "run.rrd", prepared, run)
    texts = [row[0] for row in stored(tmp_path / "run.rrd", "/now")["TextDocument:text"]]
    assert len(texts) == 23  # twenty a second
    assert f"σ_min **{run['sigma'][1056, 1]:.3g}**" in texts[-1]  # at each third of the frames
    assert "**damped, rate limited**" in texts[-1]
    # by another route: the textbook's J of two links at that tick, and what it asks along its lost direction
    a, b = run["q"][1056, 0], run["q"][1056].sum()
    J = np.array([[-np.sin(a) - np.sin(b), -np.sin(b)], [np.cos(a) + np.cos(b), np.cos(b)]])
    u, s, _ = np.linalg.svd(J)
    asked = abs(u[:, 1] @ run["twist_ref"][1056, :2]) / s[1]
    assert float(texts[-1].rpartition("= ")[2]) == pytest.approx(asked, rel=0.06)  # two digits


# What all plots have in common ------------------------------------------------------------------------


def seen_from(eye, points):
    """Where points (p, 3) are in a picture of the recorded eye: from its middle, in heights of the picture."""
    position, target = (np.array(eye[f"EyeControls3D:{name}"][0]) for name in ("position", "look_target"))
    ahead = (target - position) / np.linalg.norm(target - position)
    right = np.cross(ahead, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(ahead, [0.0, 0.0, 1.0]))
    along = np.array([right, np.cross(right, ahead), ahead]) @ (points - position).T
    return (along[:2] / along[2] / (2.0 * np.tan(VIEW_ANGLE / 2))).T


@pytest.mark.parametrize("start", ["60 deg, -120 deg", "-60 deg, 120 deg"])
def test_the_label_of_the_instant_lies_aside_of_the_arm_at_every_tick(start, tmp_path):
    """In a window of 1280 × 720 a letter takes 7 points, a line 16, and the picture is 430 high.

    The label hangs below its point. Links are straight from joint to joint. Straight below the tip, it
    would lie over the second link of the arm that is folded to the other side.
    """
    text = PLANAR.replace("60 deg, -120 deg", start).replace("[1.99, 0.0]", "[1.2, 0.0]")
    prepared, run = simulated(text + "look: {quantity: joints, at: 0}\ncontrol: {period: 0.01}\n")
    record(tmp_path / "run.rrd", prepared, run)
    (eye,) = [one for one in last_layout(tmp_path / "run.rrd").values() if "EyeControls3D:position" in one]
    label = stored(tmp_path / "run.rrd", "/tip/look/text")
    (line,) = label["LineStrips3D:strips"][0]
    (point,) = label["Points3D:positions"][0]
    np.testing.assert_allclose(line[0], run["pose"][0, :3], atol=1e-6)
    sums = np.cumsum(run["q"], axis=1)
    steps = np.stack([np.cos(sums), np.sin(sums), 0.0 * sums], axis=2)
    along = np.linspace(0.0, 1.0, 50)[:, None, None]
    arm = np.concatenate([along * steps[:, 0], steps[:, 0] + along * steps[:, 1]]).reshape(-1, 3)
    half = np.array([7.0 * len(label["Points3D:labels"][0][0]) / 2, 8.0]) / 430.0

    def is_over_the_arm(point):
        middle = seen_from(eye, np.array([point])) - [0.0, 12.0 / 430.0]
        return bool((np.abs(seen_from(eye, arm) - middle) < half).all(axis=1).any())

    assert not is_over_the_arm(point)
    at, end = seen_from(eye, np.array([point, line[1]]))
    assert (np.abs(at) + half < [VIEW_ASPECT / 2, 0.5]).all()  # in the picture
    gap = np.abs(end - at + [0.0, 12.0 / 430.0]) - half  # the line ends at the edge of the label
    assert -0.01 < gap.max() < 0.03
    below = run["pose"][0, :3] - [0.0, 0.25 * 1.2, 0.0]
    assert is_over_the_arm(below) is (start[0] == "-")


@pytest.mark.parametrize("quantity", ["error", "rates", "joints"])
def test_a_second_picture_has_what_there_is_to_look_at_in_its_frame(quantity, tmp_path):
    """The tip at that instant, from nearer than the picture of the whole run, with room around it."""
    prepared, run = simulated(PLANAR + f"control: {{period: 0.01}}\nlook: {{quantity: {quantity}}}\n")
    record(tmp_path / "run.rrd", prepared, run)
    last = last_layout(tmp_path / "run.rrd")
    eyes = [table for table in last.values() if "EyeControls3D:position" in table]
    assert len(eyes) == (1 if quantity == "joints" else 2)  # of the whole arm, which the first one has
    (tip,) = stored(tmp_path / "run.rrd", "/tip/look")["Points3D:positions"][0]
    far = sorted(
        np.linalg.norm(np.subtract(eye["EyeControls3D:position"][0], eye["EyeControls3D:look_target"][0]))
        for eye in eyes
    )
    assert len(far) == 1 or far[0] < 0.6 * far[1]
    for eye in eyes:
        position, target = (np.array(eye[f"EyeControls3D:{name}"][0]) for name in ("position", "look_target"))
        back = (position - target) / np.linalg.norm(position - target)
        toward = (tip - position) / np.linalg.norm(tip - position)
        assert -toward @ back >= np.cos(VIEW_ANGLE / 2)
