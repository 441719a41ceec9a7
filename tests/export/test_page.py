"""The page of a scenario: what it computes is what `rmrc run` computes, with any settings.

The scripts of the page run in Node, without a page around them. The oracle is `rmrc.run` of the scenario that the
page gives to copy, with MuJoCo's kinematics in place of the chain's.
"""

import base64
import json
import random
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import rmrc
from browsers import chromium, widths
from rmrc.export import page
from rmrc.export.drawing import BOX, CAPSULE, CYLINDER, ELLIPSOID, SPHERE, hull
from rmrc.export.page import contents
from rmrc.support.errors import QuestionError

NODE = shutil.which("node")
# Scenarios with 2, 3, 6 and 7 joints.
SOME = "approach_singularity", "null_space", "ur5e_wrist", "fr3_elbow"
COLUMNS = "time", "q", "qdot_cmd", "pose", "pose_ref", "pose_error", "sigma", "damping", "path_rate"
# What the scripts of the page make of settings: the scenario to copy, its columns and statuses.
COURSES = """
function coursesOf({data, law, addresses}) {
  const bytes = Uint8Array.from(atob(law), (letter) => letter.charCodeAt(0));
  const world = new World(new WebAssembly.Module(bytes), data.image), settings = new Settings(data);
  const text = (values) => btoa(Array.from(new Uint8Array(Float64Array.from(values).buffer),
    (code) => String.fromCharCode(code)).join(""));
  return addresses.map((address) => {
    settings.read(address);
    const run = world.run(settings.path, settings.effects, settings.ticks), ticks = Array.from({length: run.count}, (_, k) => k);
    const columns = NAMES.map((name) => [name, text(ticks.flatMap((k) => [...run.row(name, k)]))]);
    return {address, yaml: settings.yaml, columns: Object.fromEntries(columns), status: ticks.map(run.status)};
  });
}
"""
IN_NODE = """
import {readFileSync} from "node:fs";
console.log(JSON.stringify(coursesOf(JSON.parse(readFileSync(0, "utf8")))));
"""


def scripts():
    """Return the scripts of the page that need no page, and the function above."""
    names = f"const NAMES = {json.dumps(COLUMNS)};\n"
    return "\n".join([names, *(file.read_text() for file in page.SCRIPTS[:2]), COURSES])


def question(data, addresses):
    law = base64.b64encode(page.ROOM.joinpath("law.wasm").read_bytes()).decode()
    return {"data": data, "law": law, "addresses": addresses}


def courses(data, addresses, folder):
    """Return what the scripts of the page make of settings, in Node."""
    if NODE is None:
        pytest.skip("there is no Node here")
    program = folder / "run.mjs"
    program.write_text(scripts() + IN_NODE)
    asked = json.dumps(question(data, addresses))
    done = subprocess.run(
        [NODE, program], input=asked, capture_output=True, text=True, timeout=300, check=False
    )
    assert not done.stderr, done.stderr
    return json.loads(done.stdout)


def largest(run, columns, status):
    """Return the largest differences of columns from those of a run, over max(1, |value|); infinite of other lengths."""
    if len(status) != len(run):
        return dict.fromkeys(COLUMNS, np.inf)
    differences = {"status": float((run["status"] != status).sum())}
    for name in COLUMNS:
        values, wanted = columns[name].reshape(run[name].shape).copy(), run[name]
        if name == "pose":  # a rotation has two quaternions
            values[:, 3:] *= np.sign((values[:, 3:] * wanted[:, 3:]).sum(axis=1, keepdims=True))
        differences[name] = float((np.abs(values - wanted) / np.maximum(1.0, np.abs(wanted))).max())
    return differences


def check(course):
    """Check a course against `rmrc.run`: within 1e-9, or what 1e-13 at the start makes of the run."""
    scenario = rmrc.scenario.loads(course["yaml"])
    run = rmrc.run(scenario)
    start = run["q"][0].tolist()
    columns = {name: np.frombuffer(base64.b64decode(text)) for name, text in course["columns"].items()}
    differences = largest(run, columns, course["status"])
    if max(differences.values()) < 1e-9:
        return True
    nearby = rmrc.run(scenario.set({"arm.start": [start[0] + 1e-13, *start[1:]]}))
    moved = largest(run, nearby.columns, nearby["status"])
    assert max(moved.values()) > 1e-9, (course["address"], differences)
    return False


@pytest.mark.parametrize("name", SOME)
def test_any_settings_run_in_the_page_as_the_scenario_that_it_gives_to_copy(name, tmp_path):
    data = contents(rmrc.load(name))[1]
    rng, controls = random.Random(name), data["controls"]
    addresses = [""]
    for _ in range(6):
        chosen = {each["key"]: rng.choice(each["values"]) for each in controls if rng.random() < 0.3}
        chosen["target.speed"] = rng.choice(data["paths"])["speed"]
        addresses.append("&".join(f"{key}={value}" for key, value in chosen.items() if value is not None))
    assert (
        sum(check(course) for course in courses(data, addresses, tmp_path)) > len(addresses) / 2
    )  # the others are chaotic


def test_a_constant_that_differs_in_the_law_of_the_page_is_noticed(tmp_path):
    _, data = contents(rmrc.load("approach_singularity"))
    (members,) = [
        members for members, _ in data["groups"] if data["controls"][members[0]]["key"] == "control.feedback"
    ]
    faulty = json.loads(json.dumps(data))
    faulty["groups"] = [group for group in faulty["groups"] if group[0] != members]
    address = "control.feedback=40"
    (course,) = courses(data, [address], tmp_path)
    (wrong,) = courses(faulty, [address], tmp_path)
    assert check(course)
    with pytest.raises(AssertionError):
        check(wrong)


def test_a_picture_of_a_shape_is_as_large_as_the_shape():
    half = {BOX: [0.1, 0.2, 0.3], CYLINDER: [0.1, 0.2, 0.0], CAPSULE: [0.1, 0.2, 0.0], SPHERE: [0.1, 0.0, 0.0],
            ELLIPSOID: [0.1, 0.2, 0.3]}  # fmt: skip
    wanted = {BOX: [0.1, 0.2, 0.3], CYLINDER: [0.1, 0.1, 0.2], CAPSULE: [0.1, 0.1, 0.3], SPHERE: [0.1] * 3,
              ELLIPSOID: [0.1, 0.2, 0.3]}  # fmt: skip
    for kind, size in half.items():
        points = hull(kind, np.array(size))
        assert np.abs(points).max(axis=0) == pytest.approx(wanted[kind], rel=0.03)  # sixty points on a sphere


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"arm.encoder.noise": 1e-4}, "no random numbers"),
        ({"plant.jitter": 0.001}, "no random numbers"),
        ({"plant.stretch": {"link_2": 1.01}}, "plant.stretch"),
    ],
)
def test_what_a_page_cannot_run_is_refused_in_a_line(changes, text):
    with pytest.raises(QuestionError, match=text) as caught:
        contents(rmrc.load("line_tracking").set(changes))
    assert "\n" not in str(caught.value)


def test_the_verb_writes_a_page_and_refuses_both_or_neither(rmrc, tmp_path):
    file = tmp_path / "page.html"
    code, out, err = rmrc("explore", "--lesson", "reach", "-o", str(file))
    assert (code, out, err) == (0, f"wrote {file}\n", "")
    text = file.read_text("utf-8")
    assert len(text.encode()) < 600_000 and "Which motion of the tip is lost" in text and "<!--" not in text
    for arguments in ([], ["full_reach", "--lesson", "reach"], ["--lesson", "reech"]):
        code, _, err = rmrc("explore", *arguments)
        assert code == 2 and len(err.splitlines()) == 1


@pytest.mark.browser
@pytest.mark.parametrize("name", SOME)
def test_a_browser_computes_the_columns_of_a_run(name):
    _, data = contents(rmrc.load(name))
    script = scripts().replace("export class", "class")
    with chromium() as browser:
        shown = browser.new_page()
        asked = question(data, ["", "control.inverse.method=pseudoinverse&target.speed=0.75"])
        found = shown.evaluate(f"(asked) => {{ {script}; return coursesOf(asked); }}", asked)
    assert all(map(check, found))


def read(shown):
    """Return the figures of a page."""
    figures = shown.locator("#figures").inner_text().split(", ")
    return {name: float(value) for name, value, *_ in map(str.split, figures)}


@pytest.mark.browser
def test_a_browser_runs_the_page_from_disk_without_a_request(tmp_path):
    import axe_playwright_python

    axe = (Path(axe_playwright_python.__path__[0]) / "axe.min.js").read_text("utf-8")
    file, complaints, asked = tmp_path / "page.html", [], []
    lesson = page.read_lesson("reach")
    page.write(file, rmrc.load(lesson.scenario), lesson)
    with chromium() as browser:
        shown = browser.new_page(viewport={"width": 1280, "height": 720})
        shown.on("console", lambda message: complaints.append(message.text))
        shown.on("pageerror", lambda error: complaints.append(str(error)))
        shown.on("request", lambda request: asked.append(request.url))
        shown.goto(f"{file.as_uri()}#control.inverse.method=pseudoinverse")
        shown.wait_for_selector("body[data-redrawn]", state="attached")
        for scheme in ("light", "dark"):
            shown.emulate_media(color_scheme=scheme)
            shown.evaluate(axe)
            wrong = shown.evaluate("axe.run()")["violations"]
            assert [(each["id"], each["nodes"][0]["html"]) for each in wrong] == []
        # by the keyboard alone
        menu = shown.get_by_label("method", exact=True)
        menu.focus()
        for _ in range(3):  # pseudoinverse, truncated, transpose, damped
            shown.keyboard.press("ArrowDown")
        slider = shown.get_by_label("damping.maximum λ", exact=True)
        slider.wait_for()
        slider.focus()
        for _ in range(3):  # 0.1, 0.12, 0.15, 0.2
            slider.press("ArrowRight")
        shown.wait_for_timeout(1000)
        assert shown.url.endswith("#control.inverse.damping.maximum=0.2")
        ideal = rmrc.load(lesson.scenario).set({"plant": {"kind": "ideal"}, **lesson.number.setting})
        card = rmrc.run(ideal).scorecard
        figures = read(shown)
        assert figures["position_error.max"] == pytest.approx(
            1e3 * card["position_error.max"].value, rel=1e-3
        )
        assert figures["joint_rate_cmd.peak"] == pytest.approx(card["joint_rate_cmd.peak"].value, rel=1e-3)
        shown.get_by_role("spinbutton").fill(str(round(1e3 * card["position_error.max"].value, 1)))
        shown.keyboard.press("Enter")
        assert shown.locator("#verdict").inner_text() == "Right."
        # a goal beyond the reach: the rates stay within their limit
        shown.get_by_role("button", name="Drag the goal").press("Enter")
        shown.locator("#arm").focus()
        for _ in range(30):
            shown.keyboard.press("ArrowRight")
        shown.wait_for_timeout(2000)
        assert read(shown)["position_error.max"] > 100.0
        assert read(shown)["joint_rate_cmd.peak"] <= 3.0
        for width in (1920, 390):
            shown.set_viewport_size({"width": width, "height": 1080})
            assert shown.evaluate("document.documentElement.scrollWidth") <= width
            assert all(0 < drawn == room < width for drawn, room in widths(shown))
    assert set(asked) == {f"{file.as_uri()}"} and complaints == []
