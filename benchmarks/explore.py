"""How long the page of `rmrc explore` takes from a key on a slider to new curves, in Chromium.

    python benchmarks/explore.py [SCENARIO] [--changes 20] [--port 0] [--json]

λ is moved by a step with the arrow key, again and again, each time once the page stands still. The time runs
in the page, from the key to the data of the first plot: minimum, median and maximum, in milliseconds, beside
that of the last run. It needs the extra `dev`, and Chromium.
"""

import argparse
import json
import shutil
import statistics
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from rmrc.explore.server import Server
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
        run, ticks = 1e3 * session.answer.run.wall_time, len(session.answer.run)
        browser.close()
    told = {"min": min(times), "median": statistics.median(times), "max": max(times)}
    if asked.json:
        print(json.dumps({"scenario": scenario.name, "ticks": ticks, "run": run, "slider_to_plot": told}))
        return
    words = ", ".join(f"{name} {value:.0f} ms" for name, value in told.items())
    print(f"{scenario.name}: {ticks} ticks, the last run {run:.0f} ms; from slider to plot: {words}")


if __name__ == "__main__":
    main()
