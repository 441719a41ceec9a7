"""How long the page of `rmrc explore` takes from a key on a slider to new curves, and its frames a second.

    python benchmarks/explore.py [SCENARIO] [--changes 20] [--port 0] [--json]

λ is moved by a step with the arrow key, again and again, each time once the page stands still. The time runs
in the page, from the key to the data of the first plot: minimum, median and maximum, in milliseconds, beside
that of the last run. Then drag mode: its goal moves sixty times a second, beyond the reach of the arm and
back. The page counts its frames for some seconds, at 640 × 400 and without a graphics card. Chromium draws
them on the cores that the arm needs: `factor` is the least part of real time that the arm reached. It needs
the extra `dev`, and Chromium.
"""

import argparse
import json
import math
import shutil
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from playwright.sync_api import Page, sync_playwright

from rmrc.explore.server import Server
from rmrc.explore.session import DRAG
from rmrc.scenario import load

FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
# The slider of λ, by its place on the page; milliseconds.
SLIDER, PATIENCE = 1, 120_000
READY = "Object.values(window.__viserTestpoints?.uplots ?? {}).length === 3"
# From the next key to new data in the first plot [ms].
WATCH = """() => {
  const data = () => Object.values(window.__viserTestpoints.uplots)[0].chart.data;
  const before = data();
  window.answered = new Promise((done) => addEventListener("keydown", () => {
    const begin = performance.now();
    const look = setInterval(() => {
      if (data() === before) return;
      clearInterval(look);
      done(performance.now() - begin);
    }, 1);
  }, {once: true, capture: true}));
}"""
# Frames a second, counted for so many seconds.
SECONDS = 10.0
COUNT = """(seconds) => new Promise((done) => {
  const begin = performance.now();
  let count = 0;
  const frame = (now) => {
    count += 1;
    if (now - begin < 1e3 * seconds) requestAnimationFrame(frame);
    else done(1e3 * count / (now - begin));
  };
  requestAnimationFrame(frame);
})"""


def measured(page: Page, changes: int) -> list[float]:
    """Return how long each change took [ms]."""
    found = []
    page.get_by_role("slider").nth(SLIDER).focus()
    for _ in range(changes):
        page.evaluate(WATCH)
        page.keyboard.press("ArrowRight")
        found.append(float(page.evaluate("window.answered")))
        page.wait_for_timeout(500)
    return found


def frames(page: Page, session: Any) -> tuple[float, float]:
    """Return the frames a second of the page while the arm is led, and its least part of real time."""
    session._mode.value = DRAG
    session._choose_mode(SimpleNamespace(client=session._client))
    while session.drag is None:
        page.wait_for_timeout(100)
    page.wait_for_timeout(3000)
    drag, done, factors = session.drag, threading.Event(), list[float]()
    start, reach = drag.goal.copy(), session.answer.scene.reach

    def lead() -> None:
        began = time.perf_counter()
        while not done.wait(1.0 / 60.0):
            goal, part = start.copy(), 0.5 - 0.5 * math.cos(1.5 * (time.perf_counter() - began))
            goal[:3] *= 1.0 + part * (1.1 * reach / np.linalg.norm(goal[:3]) - 1.0)
            session._hand._ask(lambda arm, goal=goal: arm.lead(goal))
            factors.append(drag.factor)

    thread = threading.Thread(target=lead)
    thread.start()
    found = float(page.evaluate(COUNT, SECONDS))
    done.set()
    thread.join()
    return found, min(factors)


def main() -> None:
    """Serve the page, move the slider, and print."""
    parser = argparse.ArgumentParser(description="From a slider to its curves, in a browser.")
    parser.add_argument("scenario", nargs="?", default="approach_singularity")
    parser.add_argument("--changes", type=int, default=20)
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        sys.exit("there is no Chromium here")
    shown = Path("scenarios") / f"{asked.scenario}.yaml"
    scenario = load(shown if shown.is_file() else Path(asked.scenario))
    with (
        tempfile.TemporaryDirectory() as folder,
        Server(scenario, Path(folder), port=asked.port) as server,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=chromium, args=[*FLAGS, "--no-sandbox"])
        page = browser.new_page(viewport={"width": 640, "height": 400})
        page.set_default_timeout(PATIENCE)
        page.goto(f"{server.url}?fixedDpr=0.5", wait_until="commit")
        page.wait_for_function(READY)
        page.wait_for_timeout(3000)
        times = measured(page, asked.changes)
        (session,) = server.sessions.values()
        assert session.answer is not None
        rate, factor = frames(page, session)
        run, ticks = 1e3 * session.answer.run.wall_time, len(session.answer.run)
        browser.close()
    told = {"min": min(times), "median": statistics.median(times), "max": max(times)}
    if asked.json:
        print(
            json.dumps(
                {
                    "scenario": scenario.name,
                    "ticks": ticks,
                    "run": run,
                    "slider_to_plot": told,
                    "frames_per_second": rate,
                    "factor": factor,
                }
            )
        )
        return
    words = ", ".join(f"{name} {value:.0f} ms" for name, value in told.items())
    print(f"{scenario.name}: {ticks} ticks, the last run {run:.0f} ms; from slider to plot: {words}")
    print(f"drag mode: {rate:.1f} frames a second; the arm at {factor:.2f} of real time, at least")


if __name__ == "__main__":
    main()
