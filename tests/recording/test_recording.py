"""A recording has the columns bit for bit, draws what they say, and opens with its own layout."""

import errno
import os
import re
import resource
import signal
import subprocess
import sys
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader

import rrd
from project import ROOT
from rmrc.recording.picture import PALE, Shape, geometry, ramp, shapes_of
from rmrc.recording.plots import EDGE
from rmrc.recording.recorder import VIEW_ANGLE, VIEW_ASPECT, write
from rmrc.recording.scene import THICKNESS, VELOCITY_SECONDS, Scene
from rmrc.results.columns import Divergence
from rmrc.results.run import Run
from rmrc.scenario import loads
from rmrc.scenario.choices import Status
from rmrc.simulation.prepare import prepare
from rmrc.simulation.simulation import Simulation

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
SLOW = "control: {period: 0.01}\n"


def simulated(text):
    prepared = prepare(loads(text))
    return prepared, Simulation([prepared]).run()[0]


def part(run, first, last):
    return replace(run, columns={name: values[first:last].copy() for name, values in run.columns.items()})


@pytest.fixture(scope="module")
def planar():
    """World and run."""
    return simulated(PLANAR)


@pytest.fixture(scope="module")
def stanford():
    """World and run."""
    return simulated(STANFORD)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of the recordings of both arms."""
    return tmp_path_factory.mktemp("recordings")


@pytest.fixture(scope="module", params=["planar", "stanford"])
def recorded(request, folder):
    """World, run, and path of the recording."""
    prepared, run = request.getfixturevalue(request.param)
    write(folder / "made" / f"{request.param}.rrd", {"any": (prepared, run)}, None, {"Scorecard": "| a |"})
    return prepared, run, folder / "made" / f"{request.param}.rrd"


def recorded_alone(tmp_path, world, name="run"):
    write(tmp_path / f"{name}.rrd", {name: world}, None, {})
    return tmp_path / f"{name}.rrd"


def assert_same_bits(values_read, run):
    assert list(values_read) == list(run.columns)
    for name, values in run.columns.items():
        assert (values_read[name].dtype, values_read[name].shape) == (values.dtype, values.shape), name
        assert values_read[name].tobytes() == values.tobytes(), name


# Columns ----------------------------------------------------------------------------------------------


def test_the_columns_are_those_of_the_run_and_of_its_npz_bit_for_bit(recorded, tmp_path):
    _, run, path = recorded
    run.save(tmp_path / "run.npz")
    assert_same_bits(rrd.table(path), run)
    assert_same_bits(rrd.table(path), Run.read(tmp_path / "run.npz"))
    changed = replace(run, columns=run.columns | {"q": np.nextafter(run["q"], np.inf)})
    with pytest.raises(AssertionError, match=r"^q\n"):
        assert_same_bits(rrd.table(path), changed)


def test_odd_bits_of_more_than_one_piece_stay(planar, tmp_path):
    prepared, run = planar[0], part(planar[1], 0, 1001)
    run.columns["condition"][[3, 1000]] = np.inf, -0.0
    # a NaN with a payload
    run.columns["tau"][4, 1] = np.frombuffer(np.uint64(0x7FF800000000BEEF).tobytes(), np.float64)[0]
    run.columns["time"][:] = np.nextafter(run["time"], np.inf)  # not whole nanoseconds
    assert_same_bits(rrd.table(recorded_alone(tmp_path, (prepared, run))), run)


def test_a_baseline_and_variants_have_their_own_columns(planar, tmp_path):
    prepared, run = planar
    baseline = part(run, 0, 300)
    baseline.columns["qdot_cmd"][77, 0] = 12440.0
    write(tmp_path / "a.rrd", {"a": (prepared, replace(run, baseline=baseline))}, (prepared, baseline), {})
    assert_same_bits(rrd.table(tmp_path / "a.rrd"), run)
    assert_same_bits(rrd.table(tmp_path / "a.rrd", "baseline/"), baseline)
    title = next(title for title in rrd.plots(tmp_path / "a.rrd") if title.startswith("Joint rates"))
    assert title.endswith("baseline, shoulder: peak 12,440 ↑")
    drawn = rrd.table(tmp_path / "a.rrd", "baseline/", "curves")["rates"]
    np.testing.assert_array_equal(drawn[:, -1], baseline["qdot_cmd"][:, 0].astype(np.float32))
    short = part(run, 0, 57)
    write(tmp_path / "b.rrd", {"damped, 0.3/2": (prepared, run), "b": (prepared, short)}, None, {})
    for label, expected in (("damped, 0.3/2", run), ("b", short)):
        assert_same_bits(rrd.table(tmp_path / "b.rrd", rrd.prefix_of(label)), expected)
        tips = rrd.rows(tmp_path / "b.rrd", f"{rrd.prefix_of(label)}tip/now")[0]["Points3D:positions"]
        np.testing.assert_allclose(tips[-1][0], expected["pose"][-1, :3], atol=1e-6)  # its last tick


# The file ---------------------------------------------------------------------------------------------


def test_the_file_is_whole_alone_and_begins_with_its_layout(recorded):
    """A page that reads it as it comes shows nothing before it has the layout."""
    path = recorded[2]
    assert not [name for name in os.listdir(path.parent) if not re.fullmatch(r"\w+\.rrd", name)]
    command = [sys.executable, "-m", "rerun_cli", "rrd", "verify", path]
    done = subprocess.run(command, env={**os.environ, "CI": "1"}, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "1 file verified without error." in done.stderr
    content = path.read_bytes()
    assert 0 < content.find(b"TimeSeries") < content.find(b"TextDocument:text")
    (entry,) = RrdReader(path).recordings()
    assert entry.application_id == f"rmrc {path.stem}"  # the viewer refuses two widths of `q` in one


def test_a_full_disk_is_an_error_and_leaves_the_last_recording(planar, tmp_path):
    """The limit of a process stands for the disk; rerun would wait forever for its writer."""
    (tmp_path / "run.rrd").write_bytes(b"of the run before")
    before, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, before[1]))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            recorded_alone(tmp_path, planar)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert (caught.value.errno, caught.value.filename) == (errno.EFBIG, str(tmp_path / "run.rrd"))
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"of the run before"]


# The picture ------------------------------------------------------------------------------------------


def shown(run):
    return sorted({*range(0, len(run), 16), len(run) - 1})


def test_bodies_are_where_mujoco_has_them_sixty_times_a_second_and_at_the_end(recorded):
    prepared, run, path = recorded
    model = prepared.arm.model
    data, body = mujoco.MjData(model), model.site(prepared.arm.site).bodyid[0]
    values_read, ticks = rrd.rows(path, f"arm/{model.body(body).name}")
    assert ticks["Transform3D:translation"].tolist() == shown(run)
    for i, tick in enumerate(shown(run)):
        data.qpos[:] = run["q"][tick]
        mujoco.mj_kinematics(model, data)
        # float32, as the viewer draws
        np.testing.assert_allclose(values_read["Transform3D:translation"][i][0], data.xpos[body], atol=1e-6)
        x, y, z, w = values_read["Transform3D:quaternion"][i][0]
        np.testing.assert_allclose([w, x, y, z], data.xquat[body], atol=1e-6)


def test_capsules_end_where_mujoco_ends_them(recorded):
    """Local z of MuJoCo's geom frame, ± the half length, in the frame of the body."""
    prepared, _, path = recorded
    model, checked = prepared.arm.model, 0
    for shape in (shape for shape in shapes_of(prepared.arm) if shape.kind == "capsule"):
        body, geom = model.body(shape.body).name, model.geom(shape.name)
        values_read = {name: value[0] for name, value in rrd.static(path, f"arm/{body}/{shape.name}").items()}
        quat, turn = values_read["Capsules3D:quaternions"], np.empty(9)
        mujoco.mju_quat2Mat(turn, np.array([quat[3], *quat[:3]]))
        start = np.array(values_read["Capsules3D:translations"])
        end = start + turn.reshape(3, 3)[:, 2] * values_read["Capsules3D:lengths"]
        mujoco.mju_quat2Mat(turn, geom.quat)
        half = turn.reshape(3, 3)[:, 2] * geom.size[1]
        np.testing.assert_allclose([start, end], [geom.pos - half, geom.pos + half], atol=1e-6)
        assert values_read["Capsules3D:radii"] == np.float32(geom.size[0])
        checked += 1
    assert checked > 0


def drawn_as(kind):
    """Return what is recorded of a geom that is a quarter turn about z away from its body."""
    pose = np.array([1.0, 2.0, 3.0, np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    faces, size = np.array([[0, 1, 2]], np.int32), np.array([0.1, 0.2, 0.3])
    batches = geometry(Shape("g", 1, kind, size, pose, np.ones(4), np.eye(3), faces)).as_component_batches()
    return {str(each.component_descriptor().component): each.as_arrow_array().to_pylist() for each in batches}


def test_boxes_and_meshes_keep_their_size_and_place():
    box, corners = drawn_as("box"), drawn_as("mesh")["Mesh3D:vertex_positions"]
    np.testing.assert_allclose(box["Boxes3D:half_sizes"], [[0.1, 0.2, 0.3]], atol=1e-6)
    np.testing.assert_allclose(box["Boxes3D:centers"], [[1, 2, 3]], atol=1e-6)
    np.testing.assert_allclose(
        corners, [[1, 3, 3], [0, 2, 3], [1, 2, 4]], atol=1e-6
    )  # x becomes y, y becomes -x


def ellipsoid(path, name):
    """Half axes (F, 3) and directions as columns (F, 3, 3) of an ellipsoid."""
    drawn, _ = rrd.rows(path, f"tip/{name}_ellipsoid")
    turns = np.empty((len(drawn["Ellipsoids3D:quaternions"]), 9))
    for turn, ((x, y, z, w),) in zip(turns, drawn["Ellipsoids3D:quaternions"], strict=True):
        mujoco.mju_quat2Mat(turn, np.array([w, x, y, z]))
    return np.array([row[0] for row in drawn["Ellipsoids3D:half_sizes"]]), turns.reshape(-1, 3, 3)


def matrix(half, turn, power):
    """The ellipsoid as a matrix: turn diag(half^power) turnᵀ."""
    return turn @ (half[:, :, None] ** power * np.swapaxes(turn, 1, 2))


def test_velocity_ellipsoid_of_the_planar_arm_is_j_jt_and_the_force_ellipsoid_its_inverse(planar, tmp_path):
    """(J Jᵀ) from the textbook's J of two links: another route than MuJoCo and than an SVD."""
    prepared, run = planar[0], part(planar[1], 0, 500)
    path = recorded_alone(tmp_path, (prepared, run))
    (velocity, turn), (force, force_turn) = ellipsoid(path, "velocity"), ellipsoid(path, "force")
    a, b = run["q"][shown(run), 0], run["q"][shown(run)].sum(axis=1)
    J = np.array([[-np.sin(a) - np.sin(b), -np.sin(b)], [np.cos(a) + np.cos(b), np.cos(b)]])
    expected = J.transpose(2, 0, 1) @ J.transpose(2, 1, 0)
    # float32 half axes, squared
    flat = matrix(velocity / VELOCITY_SECONDS, turn, 2.0)[:, :2, :2]
    np.testing.assert_allclose(flat, expected, atol=2e-6)
    c = force[0, 0] * velocity[0, 0] / VELOCITY_SECONDS
    flat = matrix(force / c, force_turn, 2.0)[:, :2, :2]
    np.testing.assert_allclose(flat, np.linalg.inv(expected), rtol=1e-5, atol=1e-5)
    # the fault of a peer: radii 1/σ for velocities
    assert np.abs(matrix(c / velocity, turn, 2.0)[:, :2, :2] - expected).max() > 0.1
    # out of the plane both are flat
    np.testing.assert_allclose(velocity[:, 2], THICKNESS * Scene(prepared).reach, rtol=1e-6)
    np.testing.assert_allclose(np.abs(turn[:, 2, 2]), 1.0, atol=1e-6)


def test_velocity_ellipsoid_of_a_task_with_rotations_is_the_section_where_they_are_held(stanford, tmp_path):
    """The section of {A η : |η| <= 1} with ω = 0 is (Σ_vv - Σ_vω Σ_ωω⁻¹ Σ_ωv)⁻¹ for Σ = A Aᵀ: a Schur complement."""
    prepared, run = stanford[0], part(stanford[1], 0, 500)
    velocity, turn = ellipsoid(recorded_alone(tmp_path, (prepared, run)), "velocity")
    for i, tick in enumerate(shown(run)):
        J = prepared.arm.jacobian(run["q"][tick])  # length is 1, so S_q = 1
        S = J @ J.T
        section = S[:3, :3] - S[:3, 3:] @ np.linalg.solve(S[3:, 3:], S[3:, :3])
        values_read = matrix(velocity[i : i + 1] / VELOCITY_SECONDS, turn[i : i + 1], 2.0)[0]
        np.testing.assert_allclose(values_read, section, atol=2e-6)
        assert np.abs(S[:3, :3] - section).max() > 0.1  # not the shadow, which stays round


def test_the_arrow_lies_along_u_min_both_ways_and_reddens_with_sigma_min(recorded):
    prepared, run, path = recorded
    drawn, _ = rrd.rows(path, "tip/dying_move")
    vectors = np.array(drawn["Arrows3D:vectors"])
    np.testing.assert_array_equal(vectors[:, 0], -vectors[:, 1])
    np.testing.assert_allclose(np.cross(vectors[:, 0], run["u_min"][shown(run), :3]), 0.0, atol=1e-6)
    green = np.array(drawn["Arrows3D:colors"])[:, 0] >> 16 & 255  # yellow to red: only green goes
    order = np.argsort(run["sigma"][shown(run), -1])
    assert (np.diff(green[order]) >= 0).all() and green.min() < green.max()
    turns = np.array(rrd.rows(path, "tip/dying_turn")[0]["Arrows3D:vectors"])
    assert turns.any() == ("rx" in prepared.scenario.task.axes)
    assert ramp(np.array([0.0, 1.0]), 0xFFD60AFF).tolist() == [0xFFD60AFF, 0xFF2D2DFF]


def test_a_pale_arm_is_where_the_law_takes_it_to_be(tmp_path, planar):
    prepared, run = simulated(PLANAR + SLOW + "plant: {stretch: {link_1: 1.1}, joint_offset: 0.05}\n")
    path, known, q = recorded_alone(tmp_path, (prepared, run)), planar[0].arm, run["q"] - 0.05
    elbow = known.model.body("link_2").id
    ticks = rrd.rows(path, "arm/link_2")[1]["Transform3D:translation"]
    for entity, arm, at in (("arm", prepared.true_arm, run["q"]), ("believed", known, q)):
        places = rrd.rows(path, f"{entity}/link_2")[0]["Transform3D:translation"]
        want = arm.frames(at[ticks])[0][:, elbow, :3]
        np.testing.assert_allclose([place[0] for place in places], want, atol=1e-6)  # float32
    assert np.abs(known.frames(q)[0] - prepared.true_arm.frames(run["q"])[0]).max() > 0.1
    np.testing.assert_allclose(rrd.table(path, component="curves")["belief"], -50.0, rtol=1e-6)  # mrad
    for shape in (shape for shape in shapes_of(known) if shape.kind == "capsule"):
        name = f"{known.body_names[shape.body]}/{shape.name}"
        assert rrd.static(path, f"believed/{name}")["Capsules3D:colors"][0] & 255 == round(255 * PALE)
        assert rrd.static(path, f"arm/{name}")["Capsules3D:colors"][0] & 255 == 255


def test_the_camera_sees_the_whole_arm_all_the_time(recorded):
    """Both ends of every capsule at every tenth tick, in the frustum of the eye that is in the file."""
    prepared, run, path = recorded
    (eye,) = [table for table in rrd.layout(path).values() if "EyeControls3D:position" in table]
    position, target = (np.array(eye[f"EyeControls3D:{name}"][0]) for name in ("position", "look_target"))
    back = (position - target) / np.linalg.norm(position - target)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    axes, checked = np.array([right, np.cross(back, right), back]), 0
    bodies, turn = prepared.true_arm.frames(run["qpos"][::10])[0], np.empty(9)
    for shape in (shape for shape in shapes_of(prepared.true_arm) if shape.kind == "capsule"):
        mujoco.mju_quat2Mat(turn, shape.pose[3:])
        half = turn.reshape(3, 3)[:, 2] * shape.size[1]
        for end in (shape.pose[:3] - half, shape.pose[:3] + half):
            for pose in bodies[:, shape.body]:
                place = np.empty(3)
                mujoco.mju_rotVecQuat(place, end, pose[3:])
                x, y, z = axes @ (pose[:3] + place - position)
                assert z < 0 and abs(y) <= -np.tan(VIEW_ANGLE / 2) * z
                assert abs(x) <= -np.tan(VIEW_ANGLE / 2) * VIEW_ASPECT * z
                checked += 1
    assert checked


# The plots --------------------------------------------------------------------------------------------


def plot_of(path, start):
    """Range, curves and entity of the plot whose title starts so."""
    ((title, (entity, range_, curves)),) = [
        item for item in rrd.plots(path).items() if item[0].startswith(start)
    ]
    return title, entity, range_, curves


def test_rates_and_torques_are_drawn_from_the_columns_and_the_rest_is_what_they_say(recorded):
    _, run, path = recorded
    _, _, (low, high), curves = plot_of(path, "Joint rates")
    assert {
        ("columns", "columns", ".qdot[]", run.joints),
        ("columns", "columns", ".qdot_cmd[]", run.joints),
    } < {*curves}
    assert -low == high >= np.abs(run["qdot"]).max()
    title, _, (low, high), _ = plot_of(path, "Singular value")
    assert "log₁₀" in title
    drawn = rrd.table(path, component="curves")
    np.testing.assert_allclose(
        drawn["sigma"][:, 0], np.maximum(np.log10(run["sigma"].min(axis=1)), low), rtol=1e-6, atol=1e-6
    )
    damped = run["damping"] > 0.0
    assert (np.isfinite(drawn["sigma"][:, 1]) == damped).all()
    np.testing.assert_allclose(
        drawn["sigma"][damped, 1], np.maximum(np.log10(run["damping"][damped]), low), rtol=1e-6, atol=1e-6
    )
    if "rx" in run.axes:
        angle = 1e3 * np.sqrt((run["pose_error"][:, 3:] ** 2).sum(axis=1))
        np.testing.assert_allclose(drawn["turn_error"][:, 0], angle, rtol=1e-6, atol=1e-30)
    else:  # along and across, of a straight path along x
        size = np.sqrt((drawn["error"].astype(float) ** 2).sum(axis=1))
        position = 1e3 * np.sqrt((run["pose_error"][:, :2] ** 2).sum(axis=1))
        np.testing.assert_allclose(size, position, rtol=1e-6, atol=1e-9)


def test_a_peak_beyond_the_axis_is_in_the_title_and_marked_at_the_edge(planar, tmp_path):
    prepared, run = planar[0], part(planar[1], 0, 200)
    run.columns["qdot_cmd"][150, 1] = -12658.02
    path = recorded_alone(tmp_path, (prepared, run))
    title, _, (low, _), _ = plot_of(path, "Joint rates")
    assert title.endswith("elbow, cmd: peak 12,658 ↓")
    marks, ticks = rrd.rows(path, "peaks/rates/0")
    assert marks["Scalars:scalars"] == [[pytest.approx(EDGE * low)]]
    assert ticks["Scalars:scalars"].tolist() == [150]
    calm = recorded_alone(tmp_path, (prepared, part(planar[1], 0, 200)), "calm")  # negative control
    assert "peak" not in plot_of(calm, "Joint rates")[0] and "/peaks/rates/0" not in rrd.entities(calm)


def test_every_view_shows_what_is_recorded(recorded):
    path = recorded[2]
    tables, known = rrd.layout(path), rrd.entities(path)
    queries = [query for table in tables.values() for query in table.get("ViewContents:query", ())]
    paths = [query.lstrip("+ ") for query in queries if "$origin" not in query]
    assert "/columns" in paths and "/arm/**" in paths
    missing = [
        path for path in paths if not any(entity.startswith(path.removesuffix("/**")) for entity in known)
    ]
    assert missing in ([], ["/believed/**"])  # which only a law has that is misled
    origins = {table.get("ViewBlueprint:space_origin", ["/"])[0] for table in tables.values()}
    assert origins == {"/", "/now", "/text/legend", "/text/scorecard", "/text/scenario"}
    text = rrd.static(path, "text/scenario")["TextDocument:text"][0]
    assert loads(re.fullmatch(r"```yaml\n(.*)```\n", text, re.DOTALL)[1]) == recorded[0].scenario
    assert rrd.static(path, "text/scorecard")["TextDocument:text"] == ["| a |"]


# The instant to look at -------------------------------------------------------------------------------

LOOKS = {  # title of the plot, what is marked at each tick, and how remarkable it is
    "torque": ("Actuator torque", lambda run: run["tau"], lambda run: np.abs(run["tau"]).max(axis=1)),
    "sigma": ("Singular", lambda run: np.log10(run["sigma"][:, -1:]), lambda run: -run["sigma"][:, -1]),
}


@pytest.mark.parametrize(("quantity", "at"), [("torque", 0.3), ("sigma", None)])
def test_what_the_scenario_asks_to_look_at_is_in_the_open_tab_and_marked(quantity, at, tmp_path):
    look = f"{{quantity: {quantity}{'' if at is None else f', at: {at}'}}}"
    prepared, run = simulated(f"{PLANAR}{SLOW}look: {look}\n")
    path, (start, values, worth) = recorded_alone(tmp_path, (prepared, run)), LOOKS[quantity]
    row = int(worth(run).argmax()) if at is None else round(at / 0.01)
    _, entity, _, curves = plot_of(path, start)
    (mark,) = [place for place, *_ in curves if place.startswith("look/")]
    marks, ticks = rrd.rows(path, mark)
    assert ticks["Scalars:scalars"].tolist() == [row]
    marked, wanted = marks["Scalars:scalars"][0], values(run)[row]
    size = min(
        len(marked), len(wanted)
    )  # of torques the curves' own, of σ and the damping beside it the first
    np.testing.assert_allclose(marked[:size], wanted[:size], rtol=1e-6, atol=1e-9)
    ball = rrd.static(path, "tip/look")
    np.testing.assert_allclose(ball["Points3D:positions"][0], run["pose"][row, :3], atol=1e-6)
    if quantity != "sigma":  # which is always in sight
        active = [str(table.get("ContainerBlueprint:active_tab")) for table in rrd.layout(path).values()]
        assert any(entity.strip("/") in tab for tab in active)


# Words ------------------------------------------------------------------------------------------------


def test_the_strip_says_the_statuses_in_words_exactly_where_they_change_and_a_divergence(planar, tmp_path):
    prepared, run = planar[0], part(planar[1], 0, 60)
    run.columns["status"][:] = 0
    run.columns["status"][10:30] = Status.DAMPED
    run.columns["status"][20:55] |= Status.RATE_LIMITED
    run = replace(run, divergence=Divergence(60, 0.06, "elbow", "not finite"))
    states, ticks = rrd.rows(recorded_alone(tmp_path, (prepared, run)), "status")
    words = [state for (state,) in states["StateChange:state"]]
    assert ticks["StateChange:state"].tolist() == [0, 10, 20, 30, 55, 60]
    assert words == ["OK", "damped", "damped, rate limited", "rate limited", "OK", str(run.divergence)]


def test_the_line_of_numbers_says_what_the_columns_say(planar, tmp_path):
    prepared, run = planar[0], part(planar[1], 0, 1101)
    run.columns["status"][1000:] = Status.DAMPED | Status.RATE_LIMITED
    texts, ticks = rrd.rows(recorded_alone(tmp_path, (prepared, run)), "now")
    text, tick = texts["TextDocument:text"][-1][0], ticks["TextDocument:text"][-1]
    assert len(ticks["TextDocument:text"]) == 24 and tick == 1100  # twenty a second, and the last one
    assert f"σ_min **{run['sigma'][tick, 1]:.3g}**" in text and "**damped, rate limited**" in text
    # by another route: the textbook's J of two links at that tick, and what it asks along its lost direction
    a, b = run["q"][tick, 0], run["q"][tick].sum()
    J = np.array([[-np.sin(a) - np.sin(b), -np.sin(b)], [np.cos(a) + np.cos(b), np.cos(b)]])
    u, s, _ = np.linalg.svd(J)
    wanted = run["twist_ref"][tick] + prepared.scenario.control.feedback * run["pose_error"][tick]
    needed = abs(u[:, 1] @ wanted[:2]) / s[1]
    assert float(text.rpartition("= ")[2]) == pytest.approx(needed, rel=0.06)  # two digits
