"""Pictures and films: what is drawn is where it should be, files are as asked for, and mistakes are one line."""

import ctypes.util
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import rmrc
from project import ROOT
from rmrc.film import camera, opengl
from rmrc.film.film import Cut, Film, render
from rmrc.film.opengl import PictureError
from rmrc.scenario import loads
from rmrc.study.pictures import worlds_of
from rmrc.support.errors import QuestionError
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
def opened():
    """Skip, visibly, where this machine has no OpenGL."""
    try:
        opengl.refuse_missing()
        opengl.opened(8, 8).free()
    except PictureError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def worlds():
    """Return the world and the run of the scenario, by its name."""
    return worlds_of(loads(SCENARIO.format(model=MODEL)))


def projected(renderer, point):
    """Return the pixel of a point as MuJoCo's camera has it."""
    eye, other = renderer._scene.camera  # for each eye; the picture is from between them
    right = np.cross(eye.forward, eye.up)
    x, y, depth = np.array([right, eye.up, eye.forward]) @ (point - (eye.pos + other.pos) / 2)
    scale = 0.5 * renderer.height * eye.frustum_near / eye.frustum_top
    return np.array([renderer.width / 2 + scale * x / depth, renderer.height / 2 - scale * y / depth])


@pytest.mark.usefixtures("opened")
def test_marks_are_in_the_pixels_where_the_camera_of_mujoco_sees_them(worlds):
    film = Film(worlds, None)
    (shot,) = film._shots
    with film:
        (renderer,), (eye,) = film._renderers, film._cameras
        at = float(shot.run["time"][shot.run["pose"][:, 0].argmax()])  # outermost
        picture = shot.picture(at, renderer, eye).astype(int)
        early = shot.picture(0.0, renderer, eye).astype(int)
        tip, passed = shot.run["pose"][shot.row(at), :3], np.array([1.2, 0.0, 0.0])
        for point in (tip, passed):
            np.testing.assert_allclose(
                eye.pixels(point, renderer.width, renderer.height)[0], projected(renderer, point), atol=0.01
            )  # MuJoCo's camera has single precision
        column, row = projected(renderer, tip).astype(int)
        red, green, blue = picture[row, column]
        assert red > green > blue + 60  # the ball at the tip is orange
        column, row = projected(renderer, passed).astype(int)
        trail, before = picture[row - 2 : row + 3, column], early[row - 2 : row + 3, column]
        assert (trail[:, 2] > trail[:, 0] + 60).any()  # the trail is blue
        assert not (before[:, 2] > before[:, 0] + 60).any()  # and was not there before the tip
        assert (early[row - 3 : row + 4, column - 12 : column + 13].sum(axis=-1) < 300).any()  # dashes, dark
        assert (picture[0, 0] == 255).all()  # paper


@pytest.mark.usefixtures("opened")
def test_nothing_of_the_arm_is_cut_off(worlds):
    film = Film(worlds, (320, 320))
    with film:
        for time in np.linspace(0.0, film.end, 5):
            picture = film._shots[0].picture(time, film._renderers[0], film._cameras[0])
            edge = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
            assert (edge == 255).all()
            assert (picture < 128).any(axis=-1).mean() > 0.01


@given(st.integers(0, 2**32 - 1), st.sampled_from([None, 0, 1, 2]), st.floats(0.3, 3.0))
def test_the_camera_sees_all_points_and_is_no_farther_than_it_must(seed, normal, aspect):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(20, 3)) * rng.uniform(0.1, 3.0, 3) + rng.normal(size=3)
    width, height = 1000.0 * aspect, 1000.0
    seen = camera.fitted(points, normal, aspect).pixels(points, width, height)
    inside = np.stack([seen[:, 0] / width, seen[:, 1] / height], axis=1)
    margins = np.minimum(inside, 1.0 - inside).min(axis=0)
    np.testing.assert_allclose(margins.min(), camera.MARGIN / 2, atol=1e-9)  # one direction binds


@pytest.mark.usefixtures("opened")
def test_a_film_has_the_frames_and_the_pace_asked(worlds, tmp_path):
    end = float(next(iter(worlds.values()))[1]["time"][-1])
    render(worlds, tmp_path / "a.gif", Cut(fps=12.5, speed=4.0), (200, 200))
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == int(np.ceil(end / 0.32 - 1e-9)) + 1
        durations = [film.seek(i) or film.info["duration"] for i in range(film.n_frames)]
    assert durations == [80] * (len(durations) - 1) + [1500]


@pytest.mark.usefixtures("opened")
def test_variants_stand_side_by_side_on_one_scale(worlds):
    ((world, run),) = worlds.values()
    film = Film({"one": (world, run), "two": (world, run)}, (400, 200))
    with film:
        frame = film.frame(0.3)
    assert frame.shape == (200, 400, 3)
    title = 44
    assert (frame[title:, :200] == frame[title:, 200:]).all()  # all but their labels
    assert (frame[:title, :200] != frame[:title, 200:]).any()


def test_without_ffmpeg_one_line_names_the_extra(worlds, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(QuestionError, match=r"rmrc\[film\]"):
        render(worlds, tmp_path / "a.mp4")


def test_without_opengl_one_line_names_the_packages(worlds, tmp_path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr(ctypes.util, "find_library", lambda _: None)
    with pytest.raises(PictureError, match=r"^[^\n]*libegl1 and libgl1-mesa-dri[^\n]*libosmesa6[^\n]*$"):
        opengl.refuse_missing()

    def opens(*_):
        raise AttributeError("'NoneType' object has no attribute 'eglQueryString'\nmore")

    monkeypatch.setattr(opengl, "import_module", lambda _: SimpleNamespace(GLContext=opens))
    with pytest.raises(PictureError, match=r"eglQueryString.*libegl1"):
        render(worlds, tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """Return a folder with a model of its own, and what a run with it left."""
    folder = tmp_path_factory.mktemp("left")
    (folder / "common").mkdir()
    for name in ("planar_2link.xml", "common/world.xml"):
        (folder / name).write_text((ROOT / "models" / name).read_text("utf-8"), "utf-8")
    rmrc.run(loads(SCENARIO.format(model=folder / "planar_2link.xml")), out=folder, record=False)
    return folder


@pytest.mark.usefixtures("opened")
def test_what_a_run_left_is_drawn_with_the_model_that_it_names(rmrc, left, tmp_path):
    out = tmp_path / "x.png"
    asked = ("render", str(left / "there.json"), "-o", str(out), "--size", "200x220", "--at")
    pictures = []
    for at in ("0.1", "0.5"):
        assert rmrc(*asked, at) == (0, f"wrote {out}\n", "")
        with Image.open(out) as picture:
            assert picture.size == (200, 220)
            pictures.append(np.asarray(picture).astype(int))
    assert np.abs(pictures[0] - pictures[1]).max() > 100


def test_a_model_that_changed_since_or_is_gone_is_one_line(rmrc, left):
    model, asked = left / "planar_2link.xml", ("render", str(left / "there.npz"), "-o", "x.png")
    written = model.read_text("utf-8")
    changed = written.replace('<site name="tip" pos="1 0 0"/>', '<site name="tip" pos="0.99 0 0"/>')
    assert changed != written
    try:
        model.write_text(changed, "utf-8")
        code, _, err = rmrc(*asked)
        assert (code, err) == (2, says("rmrc: error: there: … no longer the model … 10 mm away; …\n"))
        model.unlink()
        code, _, err = rmrc(*asked)
        assert (code, err.count("\n")) == (2, 1)
        assert "planar_2link.xml" in err
    finally:
        model.write_text(written, "utf-8")


WRONG = {
    "kind of picture": (["there.npz", "-o", "x.jpg"], "--output x.jpg: … .gif … .png … .mp4"),
    "instant of a film": (["there.npz", "--at", "1"], "--at … --from … --to …"),
    "size": (["there.npz", "--size", "wide"], "--size … WIDTHxHEIGHT … wide…"),
    "small": (["there.npz", "--size", "20x20"], "--size … 200x200 … 4096x4096 … 20x20"),
    "odd": (["there.npz", "-o", "x.mp4", "--size", "301x300"], "--size … even … 301x300"),
    "late": (["there.npz", "-o", "x.png", "--at", "9"], "--at … 0 … 9"),
    "order": (["there.npz", "--from", "0.3", "--to", "0.2"], "--from and --to … 0.3 and 0.2"),
    "too long": (["there.npz", "--speed", "0.0001"], "… frames … --fps … --speed …"),
    "changed": (["there.npz", "--set", "control.feedback=1"], "… finished run … scenario"),
    "no scenario": (["bare.npz"], "bare.json: no such file…"),
    "damaged": (["torn.npz"], "torn.json: … damaged …"),
    "another run": (["other.npz"], "other.json: … another run …"),
    "a model": (["planar_2link.xml"], "… a model; …"),
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
