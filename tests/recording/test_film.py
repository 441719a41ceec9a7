"""Pictures and films: what is drawn is where it should be, files are as asked for, and mistakes are one line."""

import copy
import ctypes.util
import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import rmrc
from project import ROOT
from rmrc.recording import film, shot
from rmrc.recording import film as encode
from rmrc.recording.film import Cut, instants
from rmrc.recording.opengl import PictureError
from rmrc.recording.shot import Shot, fitted
from rmrc.scenario import loads
from rmrc.show.panels import panels
from rmrc.study.pictures import worlds_of
from wording import says

# A tip that goes out and back in a second, without physics.
SCENARIO = """
name: there
arm: {{model: {model}, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
control: {{period: 0.01, inverse: {{method: damped}}}}
target: {{path: [{{line: {{to: [1.4, 0.0]}}}}, {{line: {{to: [1.0, 0.0]}}}}], limits: {{velocity: 2, acceleration: 8, jerk: 100}}}}
plant: {{kind: ideal}}
"""
MODEL = ROOT / "models/planar_2link.xml"


@pytest.fixture(scope="module")
def worlds():
    """Return the world and the run of the scenario, by its name."""
    return worlds_of(loads(SCENARIO.format(model=MODEL)))


def seen_by_mujoco(camera, points, aspect):
    """Points in the picture of MuJoCo's own camera: from -1 to 1 within it, (p, 2); it needs no OpenGL."""
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    model.vis.global_.fovy, data = np.degrees(shot.ANGLE), mujoco.MjData(model)
    scene = mujoco.MjvScene(model, 10)
    every = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, every, scene)
    eye, other = scene.camera  # for each eye; the picture is from between them
    right, up = np.cross(eye.forward, eye.up), np.array(eye.up)
    x, y, depth = np.array([right, up, eye.forward]) @ (points - (eye.pos + other.pos) / 2).T
    high = eye.frustum_top / eye.frustum_near
    return np.stack([x / depth / high / aspect, y / depth / high], axis=1)


@given(st.integers(0, 2**32 - 1), st.sampled_from([None, 0, 1, 2]), st.floats(0.3, 3.0))
def test_the_camera_sees_all_points_and_is_no_farther_than_it_must(seed, normal, aspect):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(20, 3)) * rng.uniform(0.1, 3.0, 3) + rng.normal(size=3)
    seen = seen_by_mujoco(fitted(points, normal, aspect), points, aspect)
    # One direction binds, at both ends. MuJoCo's camera has single precision.
    np.testing.assert_allclose(np.abs(seen).max(), 1.0 / shot.ROOM, atol=1e-5)
    ends = np.stack([seen.min(axis=0), seen.max(axis=0)])
    assert (np.abs(ends).min(axis=0) > 1.0 / shot.ROOM - 1e-5).any()


def drawn(part, row):
    """What a shot adds to a scene at a tick: (color, radius, ends) of its rods, and its ellipsoids."""
    arm, model = part.arm, copy.copy(part.arm.model)
    data, scene = arm.data_at(part.run["qpos"][row]), mujoco.MjvScene(model, 2000)
    model.vis.global_.ipd = 0.0
    camera, every = fitted(part.points, part.scene.normal, 1.5), mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, every, scene)
    before, eye = scene.ngeom, np.array(scene.camera[0].pos)
    part.draw(scene, data, row)
    rods, balls = [], []
    for geom in scene.geoms[before : scene.ngeom]:
        center, size = eye + (geom.pos - eye) / shot.FRONT, geom.size / shot.FRONT
        color = [round(255 * channel) for channel in geom.rgba[:3]]
        if geom.type == mujoco.mjtGeom.mjGEOM_CAPSULE:
            half = size[2] * geom.mat[:, 2]
            rods.append((color, size[0], center - half, center + half))
        else:
            balls.append((color, size, center, geom.mat))
    return rods, balls


def test_marks_are_where_the_arm_and_its_tip_are(worlds):
    ((world, run),) = worlds.values()
    part = Shot("there", world, run)
    row = len(run) // 2
    first, second = run["q"][row]
    elbow = np.array([np.cos(first), np.sin(first), 0.0])
    tip = elbow + np.array([np.cos(first + second), np.sin(first + second), 0.0])
    np.testing.assert_allclose(tip[:2], run["pose"][row, :2], atol=1e-9)
    rods, balls = drawn(part, row)
    # The scene has single precision, three meters away.
    bones = [rod for rod in rods if np.isclose(rod[1], shot.BONE * part.scene.reach, rtol=1e-4)]
    np.testing.assert_allclose([rod[2:] for rod in bones], [[np.zeros(3), elbow], [elbow, tip]], atol=1e-5)
    colors = [curve.color >> 8 for curve in panels(run, ["rates"])[0].curves if curve.role == "measured"]
    assert [int.from_bytes(bytes(rod[0])) for rod in bones] == colors  # as their curves below
    trail = [rod for rod in rods if np.isclose(rod[1], shot.TRAIL * part.scene.reach, rtol=1e-4)]
    np.testing.assert_allclose(trail[0][2], run["pose"][0, :3], atol=1e-5)
    np.testing.assert_allclose(trail[-1][3], tip, atol=1e-5)
    np.testing.assert_allclose(balls[-1][2], tip, atol=1e-5)
    # The ellipsoid has the half axes 0.2 s · σ_i along u_i of J.
    J = np.array([[-tip[1], elbow[1] - tip[1]], [tip[0], tip[0] - elbow[0]]])
    u, sigma, _ = np.linalg.svd(J)
    _, size, center, mat = balls[0]
    np.testing.assert_allclose(center, tip, atol=1e-5)
    np.testing.assert_allclose(size[:2], 0.2 * sigma, atol=1e-5)
    np.testing.assert_allclose(np.abs(mat[:2, 0] @ u[:, 0]), 1.0, atol=1e-5)


# Instants, the rates below, and files ----------------------------------------------------------------


def test_instants_have_the_pace_asked_and_end_with_the_run(worlds):
    ((_, run),) = worlds.values()
    end = float(run["time"][-1])
    (at,) = instants([run], Cut(), ".png")
    assert run["sigma"][round(at / 0.01), -1] == run["sigma"][:, -1].min()
    times = instants([run], Cut(begin=0.1, fps=12.5, speed=4.0), ".gif")
    np.testing.assert_allclose(np.diff(times[:-1]), 0.32)
    assert (times[0], times[-1]) == (0.1, end)
    assert len(times) == int(np.ceil((end - 0.1) / 0.32 - 1e-9)) + 1


def gray(time):
    """A frame that is as bright as it is late, half of it white."""
    frame = np.full((40, 60, 3), 255, np.uint8)
    frame[:20] = round(200 * time)
    return frame


def test_a_gif_has_the_frames_in_order_and_stays_at_the_last(tmp_path):
    times = [0.0, 0.25, 0.5, 0.75, 1.0]
    encode.write_gif(tmp_path / "a.gif", gray, times, 12.5)
    with Image.open(tmp_path / "a.gif") as picture:
        durations, frames = [], []
        for i in range(picture.n_frames):
            picture.seek(i)
            durations.append(picture.info["duration"])
            frames.append(np.asarray(picture.convert("RGB")).astype(int))
    assert durations == [80, 80, 80, 80, 1500]
    assert np.abs(np.array(frames) - [gray(time) for time in times]).max() <= 2  # of the palette


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # its reader leaves pipes
def test_an_mp4_has_the_frames_too(tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    encode.write_mp4(tmp_path / "a.mp4", gray, [0.0, 0.5, 1.0], 10.0)
    reader = ffmpeg.read_frames(str(tmp_path / "a.mp4"))
    assert next(reader)["size"] == (60, 40)
    frames = [np.frombuffer(frame, np.uint8).reshape(40, 60, 3).astype(int) for frame in reader]
    assert [round(frame[5:15].mean()) for frame in frames] == pytest.approx([0, 100, 200], abs=4)


def test_without_ffmpeg_one_line_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(PictureError, match=r"rmrc\[film\]"):
        encode.write_mp4(tmp_path / "a.mp4", gray, [0.0, 1.0], 10.0)


# The command line -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """Return a folder with a model of its own, and what a run with it left."""
    folder = tmp_path_factory.mktemp("left")
    (folder / "common").mkdir()
    for name in ("planar_2link.xml", "common/world.xml"):
        (folder / name).write_text((ROOT / "models" / name).read_text("utf-8"), "utf-8")
    rmrc.run(loads(SCENARIO.format(model=folder / "planar_2link.xml")), out=folder, record=False)
    return folder


def rendered(way, *arguments):
    """Return (exit code, stderr) of `render` in a process of its own: MuJoCo looks for OpenGL once, on import."""
    command = [sys.executable, "-m", "rmrc", "render", "-q", *map(str, arguments)]
    environment = {**os.environ, "MUJOCO_GL": way}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


def test_without_opengl_one_line_names_the_way_out(left, tmp_path):
    code, err = rendered("nothing", left / "there.npz", "-o", tmp_path / "x.png")
    assert code == 2
    assert err == says("rmrc: error: … no OpenGL … MUJOCO_GL=egl … libegl1 … MUJOCO_GL=osmesa … libosmesa6\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(ctypes.util.find_library("EGL") is None, reason="there is no OpenGL here")
def test_a_picture_is_drawn(left, tmp_path):
    """The tip is orange where MuJoCo's camera sees it, on white paper, and moves."""
    width, height, tall = 480, 480, 480 - film.TITLE - round(480 * film.RATES)
    ((world, run),) = worlds_of(str(left / "there.json")).values()
    part, pictures = Shot("there", world, run), []
    camera = fitted(part.points, part.scene.normal, width / tall)
    for at in (0.0, 0.5):
        code, err = rendered("egl", left / "there.json", "-o", tmp_path / "x.png", "--at", at)
        if code == 2 and "no OpenGL" in err:
            pytest.skip(err)
        assert (code, err) == (0, "")
        with Image.open(tmp_path / "x.png") as picture:
            pictures.append(np.asarray(picture).astype(int))
        assert pictures[-1].shape == (height, width, 3)
        (place,) = seen_by_mujoco(camera, run["pose"][[part.row(at)], :3], width / tall)
        column, row = round(width * (1 + place[0]) / 2), film.TITLE + round(tall * (1 - place[1]) / 2)
        red, green, blue = pictures[-1][row, column]
        assert red > green > blue
        arm = pictures[-1][film.TITLE : film.TITLE + tall]
        assert (np.concatenate([arm[0], arm[-1], arm[:, 0], arm[:, -1]]) == 255).all()  # nothing is cut off
    assert np.abs(pictures[0] - pictures[1]).max() > 100


def test_a_model_that_changed_since_or_is_gone_is_one_line(rmrc, left):
    model, asked = left / "planar_2link.xml", ("render", str(left / "there.npz"), "-o", "x.png")
    written = model.read_text("utf-8")
    changed = written.replace('<site name="tip" pos="1 0 0"/>', '<site name="tip" pos="0.99 0 0"/>')
    assert changed != written
    try:
        model.write_text(changed, "utf-8")
        code, _, err = rmrc(*asked)
        assert (code, err) == (2, says("rmrc: error: there: … no longer the model … run it again\n"))
        model.unlink()
        code, _, err = rmrc(*asked)
        assert (code, err.count("\n")) == (2, 1)
        assert "planar_2link.xml" in err
    finally:
        model.write_text(written, "utf-8")


WRONG = {
    "kind of picture": (["there.npz", "-o", "x.jpg"], "--output x.jpg: … .gif … .png … .mp4"),
    "size": (["there.npz", "--size", "wide"], "--size … WIDTHxHEIGHT … wide…"),
    "too long": (["there.npz", "--speed", "0.0001"], "… frames … --fps … --speed …"),
    "no scenario": (["bare.npz"], "bare.json: no such file…"),
    "damaged": (["torn.npz"], "torn.json: … damaged …"),
    "another run": (["other.npz"], "other.json: … another run …"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_mistake_is_one_line(rmrc, left, monkeypatch, case):
    monkeypatch.chdir(left)
    columns, facts = (left / f"there{kind}" for kind in (".npz", ".json"))
    for name in ("bare", "torn", "other"):
        (left / f"{name}.npz").write_bytes(columns.read_bytes())
    (left / "torn.json").write_text("{", "utf-8")
    (left / "other.json").write_text(facts.read_text("utf-8").replace('"there"', '"elsewhere"'), "utf-8")
    arguments, message = WRONG[case]
    code, out, err = rmrc("render", *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err == says(f"rmrc: error: {message}\n")
