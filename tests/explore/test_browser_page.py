"""The page in a real browser: its plots are the columns to the bit, nothing leaves, tabs do not disturb each other."""

import json
import math
import subprocess
import time
from contextlib import contextmanager
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest

pytest.importorskip("viser")

import rmrc
from browsers import CHROMIUM, FLAGS, PATIENCE, chromium
from processes import started, wait_for
from rmrc.explore.server import Server

# A tab may close while it is told something; viser then warns, which `Server` ignores outside of tests.
pytestmark = [pytest.mark.browser, pytest.mark.filterwarnings("ignore:Queued a")]

LAMBDA = "control.inverse.damping.maximum"
# Time, then the curves of the rates, by their labels.
RATES = """() => {
  const chart = Object.values(window.__viserTestpoints.uplots)[0].chart;
  return chart.series.map((one, i) => [one.label, Array.from(chart.data[i])]);
}"""
# What a screen reader says of each slider.
NAMES = "[...document.querySelectorAll('[role=slider]')].map(one => one.getAttribute('aria-label'))"
# What the controls show: sliders, menus, boxes.
SHOWN = """() => [...document.querySelectorAll("[role=slider], input:not([type=hidden])")].map((one) =>
  one.getAttribute("aria-valuenow") ?? (one.type === "checkbox" ? one.checked : one.value))"""
# The largest canvas: where the arm is, not the plots.
CANVAS = """() => {
  const boxes = [...document.querySelectorAll("canvas")].map((one) => one.getBoundingClientRect());
  const box = boxes.reduce((a, b) => (a.width * a.height > b.width * b.height ? a : b));
  return [box.x, box.y, box.width, box.height];
}"""


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture
def served(scenario, tmp_path):
    failures = []
    with Server(
        scenario("target.path=[{line: {by: [0.3, 0.2]}}]"), tmp_path, failed=failures.append
    ) as found:
        found.out = tmp_path
        yield found
    assert failures == []


@contextmanager
def opened(browser, served, width=640, height=400):
    """Yield a page whose plots are there, and the addresses that it asked for."""
    context = browser.new_context(viewport={"width": width, "height": height})
    context.set_default_timeout(PATIENCE)
    asked = []
    context.on("request", lambda request: asked.append(request.url))
    page = context.new_page()
    page.on("websocket", lambda socket: asked.append(socket.url))
    page.goto(f"{served.url}?fixedDpr=0.5", wait_until="commit")
    page.wait_for_function("Object.values(window.__viserTestpoints?.uplots ?? {}).length === 3")
    yield page, asked
    context.close()


def aimed(page, session):
    """Return the position of the camera once the arm fills the room between the panels."""
    camera = session._client.camera

    def is_fitted():
        width, height = page.evaluate(CANVAS)[2:]
        seen = camera.image_width / max(camera.image_height, 1)
        return session.answer and session._is_fitted and math.isclose(seen, width / height, rel_tol=0.03)

    wait_for(is_fitted, 60.0)
    wait_for(lambda: not np.allclose(camera.position, 3.0))
    return np.array(camera.position)


def on_screen(page, camera, point):
    """Return the place of a point in space on the page, as a pinhole has it [px]."""
    x, y, width, height = page.evaluate(CANVAS)
    eye, up = np.array(camera.position), np.array(camera.up_direction)
    ahead = np.array(camera.look_at) - eye
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, up) / np.linalg.norm(np.cross(ahead, up))
    there = np.asarray(point) - eye
    scale = 0.5 * height / (np.tan(0.5 * camera.fov) * (there @ ahead))
    return (
        x + 0.5 * width + scale * (there @ right),
        y + 0.5 * height - scale * (there @ np.cross(right, ahead)),
    )


def test_the_plots_are_the_columns_to_the_bit_and_nothing_leaves(browser, served, scenario):
    with opened(browser, served) as (page, asked):
        slider = page.get_by_role("slider").nth(1)
        (session,) = served.sessions.values()
        seen = aimed(page, session)
        as_written = page.evaluate(SHOWN)
        alone_there = len(page.evaluate(RATES))
        slider.focus()
        page.keyboard.press("ArrowRight", delay=200)
        wait_for(lambda: session.answer is not None and LAMBDA in session.answer.values, 60.0)
        # the curves of the setting before come beside those of this one
        page.wait_for_function(f"count => ({RATES})().length > count", arg=alone_there)
        # the arrow keys of a slider turn no view
        assert np.allclose(session._client.camera.position, seen, atol=1e-3)
        assert all(page.evaluate(NAMES))
        value = session.answer.values[LAMBDA]
        assert float(slider.get_attribute("aria-valuenow")) == pytest.approx(value)
        alone = rmrc.run(scenario("target.path=[{line: {by: [0.3, 0.2]}}]", f"{LAMBDA}={value}"))
        curves = dict(page.evaluate(RATES))
        assert np.array_equal(curves["t [s]"], alone["time"])
        for j, name in enumerate(alone.joints):
            assert np.array_equal(curves[f"{name}, commanded"], alone["qdot_cmd"][:, j])
        # key B takes back every kind of control
        page.get_by_label("feedforward", exact=True).first.click()
        page.get_by_label("on_excess", exact=True).first.click()
        page.get_by_role("option", name="clamp", exact=True).click()
        wait_for(lambda: len(session.answer.values) == 3, 60.0)
        page.get_by_role("tab", name="Take along").click()
        page.get_by_role("button", name="Save as scenario").click()
        saved = served.out / "test.explore.yaml"
        wait_for(saved.is_file, 60.0)
        page.wait_for_selector("text=test.explore.npz")
        page.get_by_role("tab", name="Settings").click()
        assert page.evaluate(SHOWN) != as_written
        page.keyboard.press("b")
        wait_for(lambda: session.answer.values == {}, 60.0)
        page.wait_for_function(
            f"before => JSON.stringify(({SHOWN})()) === before",
            arg=json.dumps(as_written, separators=(",", ":")),
        )
        assert {urlsplit(url).hostname for url in asked} - {None} == {"127.0.0.1"}
        assert "share" not in page.inner_text("body").lower()


def test_the_mouse_pulls_the_arm_the_arrow_keys_nudge_it_and_nothing_leaves(browser, served):
    with opened(browser, served, 1280, 720) as (page, asked):
        (session,) = served.sessions.values()
        aimed(page, session)
        session._mode.value = "drag"
        session._choose_mode(SimpleNamespace(client=object()))
        wait_for(lambda: session.drag is not None or "ff2d2d" in session._said.content, 300.0)
        drag, gizmo, camera = session.drag, session._hand._gizmo, session._client.camera
        page.get_by_role("button", name="+x", exact=True).wait_for()
        # pull the arrow along x by a fifth of its length
        start = drag.goal.copy()
        along = np.array([gizmo.scale, 0.0, 0.0])
        wait_for(lambda: np.allclose(gizmo.position, start[:3]))
        from_, to = (on_screen(page, camera, start[:3] + part * along) for part in (0.7, 0.9))
        page.mouse.move(*from_)
        page.mouse.down()
        page.mouse.move(*to, steps=5)
        wait_for(lambda: drag.goal[0] > start[0] + 0.15 * gizmo.scale, 60.0)
        page.mouse.up()
        pulled = None  # a busy machine has moves of the mouse yet to come
        while pulled is None or (pulled != drag.goal).any():
            pulled = drag.goal.copy()
            time.sleep(0.5)
        assert drag.goal[0] < start[0] + 0.25 * gizmo.scale
        assert drag.goal[1:] == pytest.approx(start[1:], abs=1e-9)  # along the arrow alone
        wait_for(lambda: np.allclose(drag.pose[:2], drag.goal[:2], atol=1e-3), 60.0)
        # one press of a key is one nudge
        before = drag.goal.copy()
        page.keyboard.press("ArrowUp")
        wait_for(lambda: drag.goal[1] != before[1])
        page.keyboard.press("ArrowLeft")
        wait_for(lambda: drag.goal[0] != before[0])
        step = session._hand._unit
        assert drag.goal[:2] - before[:2] == pytest.approx([-step, step])
        wait_for(lambda: np.allclose(drag.pose[:2], drag.goal[:2], atol=1e-3), 60.0)
        run = drag.recent().run
        assert (np.abs(run["qdot_cmd"]) <= np.array(run.rate_limit) * (1.0 + 1e-12)).all()
        assert {urlsplit(url).hostname for url in asked} - {None} == {"127.0.0.1"}


@pytest.mark.long
def test_two_tabs_have_sessions_of_their_own_and_a_closed_one_frees_its(browser, served):
    with opened(browser, served):
        (first,) = served.sessions.values()
        with opened(browser, served) as (page, _):
            wait_for(lambda: len(served.sessions) == 2)
            (second,) = (one for one in served.sessions.values() if one is not first)
            page.get_by_role("slider").nth(1).focus()
            page.keyboard.press("ArrowRight")
            wait_for(lambda: second.answer is not None and second.answer.values, 60.0)
            assert first.answer.values == {}
        wait_for(lambda: list(served.sessions.values()) == [first])
        second._thread.join(30)
        assert not second._thread.is_alive()


@pytest.mark.parametrize("mode", ["run", pytest.param("drag", marks=pytest.mark.long)])
def test_a_killed_browser_ends_its_session_and_no_other(browser, served, tmp_path, mode, capfd):
    own = [CHROMIUM, "--headless", "--no-sandbox", f"--user-data-dir={tmp_path / 'own'}", *FLAGS]
    nowhere = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with opened(browser, served) as (page, _):
        (first,) = served.sessions.values()
        with started([*own, f"{served.url}?fixedDpr=0.5"], **nowhere):
            wait_for(lambda: len(served.sessions) == 2, 60.0)
            (second,) = (one for one in served.sessions.values() if one is not first)
            wait_for(lambda: second.answer is not None, 60.0)
            if mode == "drag":
                second._mode.value = "drag"
                second._choose_mode(SimpleNamespace(client=object()))
                wait_for(lambda: second.drag is not None, 300.0)
                second._hand._ask(lambda drag: drag.jog(0, 0.5))
            else:
                second._play(True)
        wait_for(lambda: list(served.sessions.values()) == [first])
        second._thread.join(30)
        assert not second._thread.is_alive()
        page.get_by_role("slider").nth(1).focus()
        page.keyboard.press("ArrowRight")
        wait_for(lambda: first.answer.values, 60.0)
    assert "".join(capfd.readouterr()) == ""


@pytest.mark.long
def test_the_page_has_names_and_contrast_for_everybody(browser, served):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    with opened(browser, served, 1280, 720) as (page, _):
        for theme in ("light", "dark"):
            for tab in ("Settings", "Take along", "Figures", "Show"):
                page.get_by_role("tab", name=tab).click()
                page.wait_for_timeout(700)
                found = axe.run(page).response["violations"]
                assert [(one["id"], one["nodes"][0]["html"]) for one in found] == [], (theme, tab)
            page.get_by_label("dark", exact=True).first.click()
