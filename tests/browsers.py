"""A real browser for the tests that look with one. It lets nothing out: every name but 127.0.0.1 is unknown to it."""

import shutil
from contextlib import contextmanager

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

# Pictures without a graphics card, and no name of another machine is found, so that a test that fails leaks nothing.
FLAGS = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)

# Milliseconds. A page takes about ten seconds of processor time, and other tests may run beside it.
PATIENCE = 150_000


@contextmanager
def chromium(*flags):
    """Yield Chromium, which playwright drives; skip the test where there is none."""
    if CHROMIUM is None:
        pytest.skip("there is no Chromium here; `.ci/run browser` installs one")
    sync = pytest.importorskip("playwright.sync_api")
    with sync.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=[*FLAGS, *flags], timeout=PATIENCE
        )
        yield browser
        browser.close()


def widths(shown):
    """Return the widths of each plot of a page and of its place, after a frame, because plots follow at the next one."""
    return shown.evaluate(
        "new Promise(requestAnimationFrame).then(() => [...document.querySelectorAll('.u-wrap')].map("
        "plot => [plot.offsetWidth, plot.closest('.uplot').parentElement.clientWidth]))"
    )
