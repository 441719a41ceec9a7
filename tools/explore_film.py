"""The film of drag mode in docs/explore.md: the gizmo pulls an arm through full reach, in Chromium.

    python tools/explore_film.py [-o docs/figures/explore_drag.gif]

The goal goes beyond the reach of the arm and back, at 60 Hz, like the events of a mouse. The
arm runs in the time of the film, since a screenshot takes longer than its share of that time. It needs the
extra `dev`, and Chromium.
"""

import argparse
import io
import math
import queue
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from rmrc.explore.server import Server
from rmrc.scenario import load

SCENARIO = Path("scenarios/approach_singularity.yaml")
FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox")
READY = "Object.values(window.__viserTestpoints?.uplots ?? {}).length === 3"
SIZE, SHOWN = {"width": 1280, "height": 720}, (840, 473)
# Pictures, and those of them in which the goal moves; time of each [s]; goals in a second.
PICTURES, MOVING, EACH, HERTZ = 56, 48, 0.15, 60.0
# End of the way of the goal along x, beyond the reach of 2 m, and its way to either side [m].
FAR, ASIDE = 2.15, 0.4
# The page has drawn the plots after this time; patience [ms].
SETTLED, PATIENCE = 400.0, 120_000.0
COLORS = 160


def film(page: Page, session: Any) -> list[Image.Image]:
    """Return the pictures of the arm on its way out and back."""
    drag, start = session.drag, session.drag.goal.copy()
    goals = queue.SimpleQueue[Any]()

    def advance(_: float) -> None:
        """Run the arm in the time of the film, which is slower than the clock."""
        while not goals.empty():
            goal = goals.get()
            session._hand._follow(goal)
            drag.lead(goal)
            for _ in range(round(1.0 / HERTZ / drag.period)):
                drag._tick()

    drag.advance, drag.factor = advance, 1.0  # the film is the real time
    found, each = [], round(EACH * HERTZ)
    for i in range(PICTURES):
        for j in range(each):
            turn = 2.0 * math.pi * min(1.0, (i + j / each) / MOVING)
            goal = start.copy()
            goal[0] += 0.5 * (FAR - start[0]) * (1.0 - math.cos(turn))
            goal[1] += ASIDE * math.sin(turn)
            goals.put(goal)
        session._hand._ask(lambda _: None)
        page.wait_for_timeout(SETTLED)
        picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        found.append(picture.resize(SHOWN, Image.Resampling.LANCZOS))
    return found


def main() -> None:
    """Make the film."""
    parser = argparse.ArgumentParser(description="The film of drag mode.")
    parser.add_argument("-o", "--out", type=Path, default=Path("docs/figures/explore_drag.gif"))
    out = parser.parse_args().out
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        sys.exit("there is no Chromium here")
    with (
        tempfile.TemporaryDirectory() as folder,
        Server(load(SCENARIO), Path(folder), drags=True) as server,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        page = browser.new_page(viewport=SIZE)
        page.set_default_timeout(PATIENCE)
        page.goto(server.url, wait_until="commit")
        page.wait_for_function(READY)
        page.get_by_role("button", name="+x", exact=True).wait_for()
        page.locator("[role=alert] button").first.click()  # that there is no graphics card
        page.wait_for_timeout(3000)
        (session,) = server.sessions.values()
        pictures = film(page, session)
        browser.close()
    palette = Image.new("RGB", (SHOWN[0], 3 * SHOWN[1]))
    for i in range(3):
        palette.paste(pictures[i * PICTURES // 4], (0, i * SHOWN[1]))
    palette = palette.quantize(COLORS, Image.Quantize.MAXCOVERAGE)
    drawn = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures]
    out.parent.mkdir(parents=True, exist_ok=True)
    drawn[0].save(
        out, save_all=True, append_images=drawn[1:], duration=round(1e3 * EACH), loop=0, optimize=True
    )
    print(f"{out}: {len(drawn)} pictures, {out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
