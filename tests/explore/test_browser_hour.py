"""A reader who moves sliders for long, in a real browser: the page answers, and neither it nor the server grows."""

import os
import random
import re
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("viser")

from browsers import PATIENCE, chromium
from processes import started, wait_for

pytestmark = [pytest.mark.browser, pytest.mark.long]

# A move every two seconds; MOVES=1800 are an hour. The first minute warms both modes.
MOVES, PAUSE, MINUTE, TURN = int(os.environ.get("MOVES", "90")), 2.0, 60.0, 10
# Growth of the server after the first minute, at most.
GROWTH = 1.05
READY = "Object.values(window.__viserTestpoints?.uplots ?? {}).length === 3"
# The data of the first plot now; later, whether others took their place.
NOW = "window.shown = Object.values(window.__viserTestpoints.uplots)[0].chart.data; true"
OTHERS = "Object.values(window.__viserTestpoints.uplots)[0].chart.data !== window.shown"
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
    """Move a slider by a key; return how long its curves took [s], None: its value is at the end."""
    sliders = [one for one in page.get_by_role("slider").all() if one.is_visible()]
    one, key = chance.choice(sliders[is_run:]), chance.choice(KEYS)  # the first one of run mode is the time
    before = one.get_attribute("aria-valuenow")
    page.evaluate(NOW)
    began = time.perf_counter()
    one.press(key)
    page.wait_for_timeout(100)
    if one.get_attribute("aria-valuenow") == before:
        return None
    page.wait_for_function(OTHERS, polling=50)
    return time.perf_counter() - began


def test_random_moves_neither_leak_memory_nor_stop_the_answers(tmp_path):
    chance, sizes, answers = random.Random(0), [], []
    command = [sys.executable, "-m", "rmrc", "explore", "approach_singularity", "--out", str(tmp_path)]
    with (tmp_path / "said").open("w") as said, started(command, stdout=said, stderr=said) as server:
        told = tmp_path / "said"
        url = wait_for(lambda: re.search(r"http://\S+/", told.read_text()), 300.0).group(0)
        with chromium("--enable-precise-memory-info", "--js-flags=--expose-gc") as browser:
            page = browser.new_page(viewport={"width": 1280, "height": 720})
            page.set_default_timeout(PATIENCE)
            page.goto(f"{url}?fixedDpr=0.5", wait_until="commit")
            page.wait_for_function(READY)
            began = time.monotonic()
            for i in range(MOVES):
                is_run = i // TURN % 2 == 0
                if i and i % TURN == 0:
                    chosen(page, "run" if is_run else "drag")
                answered = moved(page, chance, is_run)
                answers += [answered] if answered is not None else []
                page.wait_for_timeout(max(0.0, 1e3 * (began + PAUSE * (i + 1) - time.monotonic())))
                sizes.append((time.monotonic() - began, resident(server.pid)))
                if i % 30 == 29:
                    page.evaluate("gc()")
                    print(f"{sizes[-1][0]:.0f} s: server {sizes[-1][1]} kB, page {page.evaluate(HEAP):.0f} kB, "
                          f"{len(answers)} answers, the slowest {max(answers):.2f} s", flush=True)
        assert server.poll() is None
        assert "Traceback" not in told.read_text()
    warm = max(size for at, size in sizes if at <= MINUTE + 2.0 * PAUSE)
    assert max(size for _, size in sizes) <= GROWTH * warm, sizes[:: max(1, len(sizes) // 60)]
    assert len(answers) > MOVES // 4
