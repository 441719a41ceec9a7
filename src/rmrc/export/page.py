"""The page of a scenario: one HTML file that runs the law in a browser, at every change of a setting."""

import base64
import json
import zlib
from html import escape
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from rmrc.export.contents import contents
from rmrc.export.form import form, questions
from rmrc.scenario import Scenario
from rmrc.scenario.lesson import SHIPPED, Lesson
from rmrc.scenario.messages import checked
from rmrc.scenario.reading import Document
from rmrc.show.page import ICON, POLICY
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.files import write_text

# The largest page [bytes].
LARGEST = 600_000
ROOM = Path(__file__).parent
# Scripts of the page; the first two need no page.
SCRIPTS = tuple(ROOM / name for name in ("law.mjs", "settings.js", "view.js", "explore.js"))


def read_lesson(name: str) -> Lesson:
    """Return a shipped lesson.

    Raises:
        QuestionError: There is none with this name.
    """
    if name not in SHIPPED:
        known = f"choose from {', '.join(SHIPPED)}{did_you_mean(name, SHIPPED)}"
        raise QuestionError(f'--lesson: there is no lesson "{name}"; {known}')
    return checked(Lesson, Document.read(str(SHIPPED[name])))


def write(path: Path, scenario: Scenario, lesson: Lesson | None = None) -> None:
    """Write the page of a scenario, atomically.

    Args:
        path: The file.
        scenario: The scenario as written.
        lesson: Questions about it.

    Raises:
        ScenarioError: The scenario cannot be prepared.
        QuestionError: A page cannot run it, or would be too large.
        OSError: The file cannot be written.
    """
    controls, data = contents(scenario, lesson)
    law, facts = ROOM.joinpath("law.wasm").read_bytes(), json.dumps(data, allow_nan=False).encode()
    show = files("rmrc.show").joinpath("assets")
    parts = {
        "title": escape(f"{scenario.name}: the law in the browser"),
        "policy": POLICY.replace("script-src", "script-src 'wasm-unsafe-eval'"),
        "icon": ICON,
        "style": _texts(show / "uPlot.min.css", show / "page.css", ROOM / "explore.css"),
        "form": form(controls.controls),
        "lesson": questions(lesson),
        "blocks": _block("law", law) + _block("scenario", facts),
        "script": _texts(show / "uPlot.iife.min.js", show / "page.js"),
        "module": _texts(*SCRIPTS),
    }
    html = _texts(ROOM / "explore.html")
    for name, text in parts.items():
        html = html.replace(f"<!--{name}-->", text)
    if (size := len(html.encode())) > LARGEST:
        most = f"at most {LARGEST // 1000} kB; shorten target.path"
        raise QuestionError(f"{scenario.name}: its page would have {size // 1000} kB, and may have {most}")
    write_text(path, html)


def _texts(*paths: Traversable) -> str:
    return "\n".join(path.read_text("utf-8") for path in paths)


def _block(name: str, block: bytes) -> str:
    """Return bytes as a block of the page, compressed."""
    text = base64.b64encode(zlib.compress(block, 9)).decode()
    return f'<script type="application/octet-stream" id="{name}">{text}</script>'
