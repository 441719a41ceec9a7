"""The page of a scenario: one HTML file that runs the law in a browser, at every change of a setting.

It has menus, sliders and the questions of a lesson; and of its scenario the image of the world, controls,
path and picture. It has the ideal plant, as there is no MuJoCo in it. The run that MuJoCo made of the
scenario as written is beside it, thinned.
"""

import base64
import json
import re
import zlib
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.export.controls import Control, Controls
from rmrc.export.drawing import drawing, floats, skeletons
from rmrc.export.image import image, packed
from rmrc.scenario import Scenario
from rmrc.scenario.choices import IN_RUNS, POLICIES
from rmrc.scenario.draft import LESSONS, Lesson
from rmrc.scenario.messages import checked
from rmrc.scenario.reading import Document
from rmrc.show.page import ICON, POLICY
from rmrc.show.palette import css, distinct, of_status
from rmrc.show.panels import error_rows, extremes, in_words
from rmrc.simulation.prepare import Prepared, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support import shipped
from rmrc.support.errors import QuestionError, did_you_mean
from rmrc.support.files import write_text

# What the ideal plant has of a plant; and what is of no use in a page.
CARRIED = "delay", "jitter", "loss", "lag", "seed", "joint_offset", "stretch"
UNUSED: dict[str, Any] = {"expect": {}, "look": None, "baseline": {}, "sweep": {}, "tune": {}}
# Points of the run that MuJoCo made.
POINTS = 1500


def contents(scenario: Scenario, lesson: Lesson | None = None) -> tuple[Controls, dict[str, Any]]:
    """Return the controls of a page, and what its scripts need, ready for strict JSON.

    Args:
        scenario: The scenario as written.
        lesson: Questions about it.

    Raises:
        ScenarioError: The scenario cannot be prepared.
        QuestionError: A page cannot run it.
    """
    ideal = prepare(on_ideal_plant(scenario))
    arm, control, world = ideal.arm, ideal.scenario.control, image(ideal)
    if any(array["values"] for array in world["arrays"] if array["name"] == "chance"):
        keys = "arm.encoder.noise, plant.jitter and plant.loss"
        raise QuestionError(f"{scenario.name}: a page has no random numbers; leave out {keys}")
    controls = Controls(ideal, lesson.number.setting if lesson else {})
    return controls, {
        "scenario": to_paste(ideal.scenario), "period": control.period, "image": world,
        "policy": control.at_singularity, "longest": control.slow.longest,
        "slow": [policy.name for policy in POLICIES.options if policy.slows],
        "controls": [each._asdict() for each in controls.controls], "groups": controls.groups,
        "paths": [
            {"speed": speed, "changes": limits, **path_of(faster)} for speed, limits, faster in controls.paths
        ],
        "joints": [
            {"name": name, "color": css(color)}
            for name, color in zip(arm.joints, distinct(arm.n), strict=True)
        ],
        "unit": " or ".join(f"{unit}/s" for unit in dict.fromkeys(arm.units)),
        "below": control.inverse.damping.below,
        "statuses": [
            {"bit": int(flag), "name": in_words(flag), "color": css(of_status(int(flag)))} for flag in IN_RUNS
        ],
        "drawing": drawing(ideal), "shows": lesson.shows if lesson else ("velocity", "lost"),
        "written": _mujoco(prepare(scenario)), "lesson": lesson and _number(lesson, ideal),
    }  # fmt: skip


def path_of(prepared: Prepared) -> dict[str, Any]:
    """Return the path of a scenario: its ticks, and its pieces as the compiled function reads them."""
    return {"ticks": prepared.reference.ticks, "pieces": packed(prepared.reference.numbers)}


def on_ideal_plant(scenario: Scenario) -> Scenario:
    """Return a scenario as the page runs it: with the ideal plant, and all numbers that its arm gives."""
    plant = {name: getattr(scenario.plant, name) for name in CARRIED} | {"kind": "ideal"}
    fitted = prepare(scenario.set({"plant": plant, **UNUSED})).scenario
    return fitted.model_copy(update={"name": scenario.name})  # its numbers are now its own


def to_paste(scenario: Scenario) -> dict[str, Any]:
    """Return a scenario without defaults; a model that does not come with rmrc is a file beside it."""
    values = scenario.model_dump(mode="json", exclude_defaults=True)
    model = Path(values["arm"]["model"])
    is_shipped = shipped.shipped("models").get(model.stem) == model
    values["arm"]["model"] = model.stem if is_shipped else model.name
    return values


def _mujoco(prepared: Prepared) -> dict[str, Any] | None:
    """Return the run that MuJoCo makes of a scenario as written, thinned; None where it has no physics."""
    if not prepared.plant.has_physics:
        return None
    (run,) = Simulation([prepared]).run()
    joint = int(np.abs(run["qdot"]).max(axis=0).argmax())
    moved, turned = (1e3 * np.linalg.norm(run["pose_error"][:, rows], axis=1) for rows in error_rows(run))
    curves = {
        "rates": run["qdot"][:, joint], "sigma": run["sigma"][:, -1],
        "position_error": moved, "orientation_error": turned,
    }  # fmt: skip
    spans = POINTS // (2 * len(curves)) - 2  # beside the ends of each
    rows = np.unique(np.concatenate([extremes(curve, spans) for curve in curves.values()]))
    thinned = {name: floats(curve[rows]) for name, curve in {"time": run["time"], **curves}.items()}
    return {
        **thinned, "joint": run.joints[joint], "end": float(run["time"][-1]),
        "skeletons": skeletons(prepared, run),
    }  # fmt: skip


def _number(lesson: Lesson, ideal: Prepared) -> dict[str, float]:
    """Return the number to find, as the ideal plant gives it."""
    number = lesson.number
    (run,) = Simulation([prepare(ideal.scenario.set(number.setting))]).run()
    return {"value": float(run.scorecard[number.figure].value) / number.per, "within": number.within}


# The form -----------------------------------------------------------------------------------------

SYMBOLS = {"damping.maximum": "λ", "damping.below": "ε", "feedback": "K"}


def form(controls: Sequence[Control]) -> str:
    """Return menus and sliders, by sections; the value of each is the number of what is chosen."""
    sections = dict[str, list[str]]()
    for number, control in enumerate(controls):
        title, _, name = control.key.removeprefix("control.").partition(".")
        title, name = (title, name) if name else ("control", title)
        sections.setdefault(title, []).append(_row(number, name, control))
    return "\n".join(
        f"<fieldset><legend>{title}</legend>{''.join(rows)}</fieldset>" for title, rows in sections.items()
    )


def _row(number: int, name: str, control: Control) -> str:
    """Return a label, what is chosen, and a menu or a slider."""
    if isinstance(control.values[control.start], str):
        options = (f'<option value="{k}">{escape(value)}</option>' for k, value in enumerate(control.values))
        entry = f'<select id="control-{number}">{"".join(options)}</select>'
    else:
        entry = f'<input id="control-{number}" type="range" min="0" max="{len(control.values) - 1}">'
    label = f'<label for="control-{number}">{name} {SYMBOLS.get(name, "")}</label><output></output>'
    return f'<div class="control" title="{escape(control.meaning)}">{label}{entry}</div>'


def questions(lesson: Lesson | None) -> str:
    """Return the questions of a lesson, and an entry for its number; "" without one."""
    if lesson is None:
        return ""
    asked = "".join(
        f"<details><summary>{_text(each.ask)}</summary><p>{_text(each.do)}</p></details>"
        for each in lesson.questions
    )
    number = f"{_text(lesson.number.ask)} [{_text(lesson.number.unit)}]"
    return (
        f"<h2>{_text(lesson.title)}</h2><p>{_text(lesson.about)}</p>{asked}<p><label>{number} "
        '<input id="answer" type="number" step="any"></label> <output id="verdict"></output></p>'
    )


def _text(text: str) -> str:
    """Return a text with its `code` and *names*."""
    return re.sub(r"\*(.+?)\*", r"<em>\1</em>", re.sub(r"`(.+?)`", r"<code>\1</code>", escape(text)))


# The page -----------------------------------------------------------------------------------------

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
    if name not in LESSONS:
        known = f"choose from {', '.join(LESSONS)}{did_you_mean(name, LESSONS)}"
        raise QuestionError(f'--lesson: there is no lesson "{name}"; {known}')
    return checked(Lesson, Document.read(str(LESSONS[name])))


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
