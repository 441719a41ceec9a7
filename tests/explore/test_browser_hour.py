"""A reader who moves sliders for long, in a real browser: the page answers, and neither it nor the server grows."""

import os
import random
import re
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip("viser")

from browsers import PATIENCE, chromium
from processes import started, wait_for
from rmrc.explore.server import TIDIED

pytestmark = [pytest.mark.browser, pytest.mark.long]

# A move every two seconds; MOVES=1800 are an hour. The first minute warms both modes.
MOVES, PAUSE, MINUTE, TURN = int(os.environ.get("MOVES", "90")), 2.0, 60.0, 10
# Growth of the server after the first minute, at most.
GROWTH = 1.05
READY = "Object.values(window.__viserTestpoints?.uplots ?? {}).length === 3"
# The data of the first plot now; later, whether others took their place.
NOW = "window.shown = Object.values(window.__viserTestpoints.uplots)[0].chart.data; true"
OTHERS = "Object.values(window.__viserTestpoints.uplots)[0].chart.data !== window.shown"
# The number of settings that the page has answered: the curves of another setting may be equal.
ANSWERS = "+(document.querySelector('[data-answers]')?.dataset.answers ?? 0)"
VALUES = "[...document.querySelectorAll('[role=slider]')].map((one) => one.getAttribute('aria-valuenow'))"
HEAP = "performance.memory.usedJSHeapSize / 1024"
KEYS = ("ArrowRight", "ArrowLeft", "PageUp", "PageDown") * 3 + ("Home", "End")


def resident(pid):
    """Return the resident memory of a process [kB]."""
    return int(re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{pid}/status").read_text()).group(1))


def chosen(page, mode):
    """Choose a mode."""
    page.locator("input[value=run], input[value=drag]").first.click()
    page.get_by_role("option", name=mode, exact=True).click()
    page.get_by_role("button", name="+x" if mode == "drag" else "Play", exact=True).wait_for()


def moved(page, chance, is_run):
    """Move a slider by a key; return how long its answer took [s], None: it asks for none."""
    sliders = [one for one in page.get_by_role("slider").all() if one.is_visible()]
    # time is first in run mode, two joints in drag mode; then come settings
    row, key = chance.randrange(int(is_run), len(sliders)), chance.choice(KEYS)
    one, is_joint = sliders[row], not is_run and row < 2
    before, answers = one.get_attribute("aria-valuenow"), page.evaluate(ANSWERS)
    page.evaluate(NOW)
    began = time.perf_counter()
    one.press(key)
    page.wait_for_timeout(100)
    if one.get_attribute("aria-valuenow") == before:
        return None
    if not is_joint:
        page.wait_for_function(f"{ANSWERS} > {answers}", polling=50)
    elif "diverged" in page.inner_text("[data-answers]"):
        page.get_by_role("button", name="arm to the start").click()
        return None
    else:
        page.wait_for_function(OTHERS, polling=50)
    return time.perf_counter() - began


@contextmanager
def served(folder):
    """Yield the process of `rmrc explore`, and its address; it must live to the end, without a trace."""
    told = folder / "said"
    command = [sys.executable, "-m", "rmrc", "explore", "approach_singularity", "--out", str(folder)]
    with told.open("w") as said, started(command, stdout=said, stderr=said) as server:
        yield server.pid, wait_for(lambda: re.search(r"http://\S+/", told.read_text()), 300.0).group(0)
        assert server.poll() is None
        assert "Traceback" not in told.read_text()


@contextmanager
def opened(browser, url):
    """Yield a page whose plots are there."""
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    page.set_default_timeout(PATIENCE)
    page.goto(f"{url}?fixedDpr=0.5", wait_until="commit")
    page.wait_for_function(READY)
    yield page
    page.close()


def test_random_moves_neither_leak_memory_nor_stop_the_answers(tmp_path):
    chance, sizes, answers = random.Random(0), [], []
    with (
        served(tmp_path) as (pid, url),
        chromium("--enable-precise-memory-info", "--js-flags=--expose-gc") as browser,
        opened(browser, url) as page,
    ):
        began = time.monotonic()
        for i in range(MOVES):
            is_run = i // TURN % 2 == 0
            if i and i % TURN == 0:
                chosen(page, "run" if is_run else "drag")
            answered = moved(page, chance, is_run)
            answers += [answered] if answered is not None else []
            page.wait_for_timeout(max(0.0, 1e3 * (began + PAUSE * (i + 1) - time.monotonic())))
            sizes.append((time.monotonic() - began, resident(pid)))
            if i % 30 == 29:
                page.evaluate("gc()")
                at, size = sizes[-1]
                print(f"{at:.0f} s: server {size} kB, page {page.evaluate(HEAP):.0f} kB, ", end="")
                print(f"{len(answers)} answers, the slowest {max(answers):.2f} s", flush=True)
            if sizes[-1][0] > MOVES * PAUSE:  # a slow machine makes fewer moves
                break
    warm = max(size for at, size in sizes if at <= MINUTE + 2.0 * PAUSE)
    assert max(size for _, size in sizes) <= GROWTH * warm, sizes[:: max(1, len(sizes) // 60)]
    assert len(answers) > len(sizes) // 8


def test_tabs_come_and_go_beside_one_that_works_and_leave_no_memory(tmp_path):
    chance, sizes = random.Random(1), []
    with served(tmp_path) as (pid, url), chromium() as browser, opened(browser, url) as first:
        for _ in range(max(4, MOVES // 20)):
            with opened(browser, url) as second:
                chosen(second, "drag")
                for _ in range(TURN):
                    before = second.evaluate(VALUES)
                    moved(first, chance, True)
                    own = first.evaluate(VALUES)
                    assert second.evaluate(VALUES)[2:] == before[2:]  # settings; the joints follow the arm
                    moved(second, chance, False)
                    assert first.evaluate(VALUES) == own
            first.wait_for_timeout(1200 * TIDIED)
            sizes.append(resident(pid))
        print(f"server after each closed tab [kB]: {sizes}")
    assert max(sizes) <= GROWTH * max(sizes[:2])
