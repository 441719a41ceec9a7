"""The page in a real browser: its plots are the columns to the bit, nothing leaves, and tabs do not disturb each other."""

from contextlib import contextmanager
from urllib.parse import urlsplit

import numpy as np
import pytest

pytest.importorskip("viser")

import rmrc
from browsers import PATIENCE, chromium
from processes import wait_for
from rmrc.explore.server import Server

# A tab may close while it is told something; viser then warns, which `Server` ignores outside of tests.
pytestmark = [pytest.mark.browser, pytest.mark.filterwarnings("ignore:Queued a")]

LAMBDA = "control.inverse.damping.maximum"
# Time, then the curves of the rates, by their labels.
RATES = """() => {
  const chart = Object.values(window.__viserTestpoints.uplots)[0].chart;
  return chart.series.map((one, i) => [one.label, Array.from(chart.data[i])]);
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
def opened(browser, served):
    """Yield a page whose plots are there, and the addresses that it asked for."""
    context = browser.new_context(viewport={"width": 640, "height": 400})
    context.set_default_timeout(PATIENCE)
    asked = []
    context.on("request", lambda request: asked.append(request.url))
    page = context.new_page()
    page.on("websocket", lambda socket: asked.append(socket.url))
    page.goto(f"{served.url}?fixedDpr=0.5", wait_until="commit")
    page.wait_for_function("Object.values(window.__viserTestpoints?.uplots ?? {}).length === 3")
    yield page, asked
    context.close()


def test_the_plots_are_the_columns_to_the_bit_and_nothing_leaves(browser, served, scenario):
    with opened(browser, served) as (page, asked):
        slider = page.get_by_role("slider").nth(1)
        (session,) = served.sessions.values()
        page.wait_for_timeout(1000)
        seen = np.array(session._client.camera.position)
        slider.focus()
        page.keyboard.press("ArrowRight", delay=200)
        wait_for(lambda: session.answer is not None and LAMBDA in session.answer.values, 60.0)
        page.wait_for_timeout(1000)
        assert np.allclose(
            session._client.camera.position, seen, atol=1e-6
        )  # the arrow keys of a slider turn no view
        value = session.answer.values[LAMBDA]
        assert float(slider.get_attribute("aria-valuenow")) == pytest.approx(value)
        alone = rmrc.run(scenario("target.path=[{line: {by: [0.3, 0.2]}}]", f"{LAMBDA}={value}"))
        page.wait_for_function(
            f"count => ({RATES})().length > count", arg=7
        )  # the setting before came beside it
        curves = dict(page.evaluate(RATES))
        assert np.array_equal(curves["t [s]"], alone["time"])
        for j, name in enumerate(alone.joints):
            assert np.array_equal(curves[f"{name}, commanded"], alone["qdot_cmd"][:, j])
        page.get_by_role("tab", name="Take along").click()
        page.get_by_role("button", name="Save as scenario").click()
        saved = served.out / "test.explore.yaml"
        wait_for(saved.is_file, 60.0)
        page.wait_for_selector("text=test.explore.npz")
        assert {urlsplit(url).hostname for url in asked} - {None} == {"127.0.0.1"}
        assert "share" not in page.inner_text("body").lower()


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
