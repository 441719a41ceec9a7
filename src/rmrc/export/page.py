"""The page of a scenario: one HTML file with the law as WebAssembly, which runs the scenario as one changes it.

The page has the ideal plant, as there is no MuJoCo in it. The run that MuJoCo made of the scenario as written
is in the page beside it, thinned.
"""

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from rmrc.export.controls import Controls, written
from rmrc.export.drawing import drawing, packed, skeleton
from rmrc.export.image import CAPACITY, image, offset
from rmrc.law.record import METHODS
from rmrc.scenario import Scenario
from rmrc.scenario.choices import IN_RUNS, POLICIES
from rmrc.scenario.lesson import SHIPPED, Lesson
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

ROOM = Path(__file__).parent
ASSETS = ROOM / "assets"
# What the ideal plant has of a plant.
CARRIED = "delay", "jitter", "loss", "lag", "seed", "joint_offset", "stretch"
# Titles of the settings, by the beginning of their keys; and what they are in formulas.
SECTIONS = {
    "control.inverse": "Inverse", "control.feedback": "Inverse", "control.nullspace": "Null space",
    "control.limits": "Limits", "plant": "Plant", "target": "Path",
}  # fmt: skip
SYMBOLS = {
    "control.inverse.damping.maximum": "λ", "control.inverse.damping.below": "ε", "control.feedback": "K",
}  # fmt: skip
# Points of the run that MuJoCo made.
POINTS = 1500
# Its scripts, after that of the law; those before `view.js` need no page.
SCRIPTS = "settings.js", "course.js", "view.js", "explore.js"
# The largest page [bytes].
LARGEST = 600_000


def read_lesson(name: str) -> Lesson:
    """Return a shipped lesson.

    Raises:
        QuestionError: There is none with this name.
    """
    if name not in SHIPPED:
        known = f"choose from {', '.join(SHIPPED)}{did_you_mean(name, SHIPPED)}"
        raise QuestionError(f'--lesson: there is no lesson "{name}"; {known}')
    return checked(Lesson, Document.read(str(SHIPPED[name])))


def on_ideal_plant(scenario: Scenario) -> Scenario:
    """Return a scenario as the page runs it: with the ideal plant, and all numbers that its arm gives."""
    plant = {name: getattr(scenario.plant, name) for name in CARRIED} | {"kind": "ideal"}
    alone = {"expect": {}, "look": None, "baseline": {}, "sweep": {}, "tune": {}}
    fitted = prepare(scenario.set({"plant": plant, **alone})).scenario
    return fitted.model_copy(update={"name": scenario.name})  # its numbers are now its own


def write(path: Path, scenario: Scenario, lesson: Lesson | None = None) -> None:
    """Write the page of a scenario, atomically.

    Args:
        path: The file.
        scenario: The scenario as written.
        lesson: Questions about it.

    Raises:
        ScenarioError: The scenario cannot be prepared.
        QuestionError: The page cannot carry it, or it would be too large.
    """
    text = _html(contents(scenario, lesson))
    if (size := len(text.encode())) > LARGEST:
        most = f"at most {LARGEST // 1000} kB; shorten target.path"
        raise QuestionError(f"{scenario.name}: its page would have {size // 1000} kB, and may have {most}")
    write_text(path, text)


def _html(data: Mapping[str, Any]) -> str:
    show, modules = files("rmrc.show").joinpath("assets"), [ROOM / "law.mjs"]
    styles = [show / "uPlot.min.css", show / "page.css", ASSETS / "explore.css"]
    scripts = [show / "uPlot.iife.min.js", show / "page.js"]
    modules += [ASSETS / name for name in SCRIPTS]
    style, script, module = (
        "\n".join(file.read_text("utf-8") for file in some) for some in (styles, scripts, modules)
    )
    blocks = {"law": ROOM.joinpath("law.wasm").read_bytes(), "scenario": json.dumps(data).encode()}
    parts = {
        "title": escape(f"{data['name']}: the law in the browser"),
        "policy": POLICY.replace("script-src", "script-src 'wasm-unsafe-eval'"), "icon": ICON,
        "style": style, "script": script, "module": module,
        "form": _form(data["controls"]), "lesson": _questions(data["lesson"]),
        "beside": "" if data["written"] is None else " Beside: MuJoCo's run of the scenario as written.",
        "blocks": "\n".join(
            f'<script type="application/octet-stream" id="{name}">{_squeezed(block)}</script>'
            for name, block in blocks.items()
        ),
    }  # fmt: skip
    html = ASSETS.joinpath("explore.html").read_text("utf-8")
    for name, text in parts.items():
        html = html.replace(f"<!--{name}-->", text)
    return html


def _form(controls: Sequence[Mapping[str, Any]]) -> str:
    """Return menus and sliders, by sections."""
    sections = dict[str, list[str]]()
    for i, control in enumerate(controls):
        key, values, start = control["key"], control["values"], control["start"]
        title = next((title for begin, title in SECTIONS.items() if key.startswith(begin)), "Near a singularity")
        name = key.removeprefix("control.")
        for above in ("inverse.", "nullspace.", "limits."):
            name = name.removeprefix(above)
        label = f"{name} {SYMBOLS.get(key, '')}"
        if isinstance(values[start], str):
            options = "".join(f'<option value="{k}">{escape(value)}</option>' for k, value in enumerate(values))
            entry = f'<select id="control-{i}">{options}</select>'
        else:
            entry = f'<input id="control-{i}" type="range" min="0" max="{len(values) - 1}">'
        sections.setdefault(title, []).append(
            f'<div class="control" title="{escape(control["meaning"])}"><label for="control-{i}">{label}</label>'
            f"<output></output>{entry}</div>"
        )
    return "\n".join(
        f"<fieldset><legend>{title}</legend>{''.join(rows)}</fieldset>" for title, rows in sections.items()
    )


def _questions(lesson: Mapping[str, Any] | None) -> str:
    """Return the questions of a lesson, and an entry for its number."""
    if lesson is None:
        return ""
    asked = "".join(
        f"<details><summary>{escape(each['ask'])}</summary><p>{escape(each['do'])}</p></details>"
        for each in lesson["questions"]
    )
    number = f"{escape(lesson['number']['ask'])} [{escape(lesson['number']['unit'])}]"
    answer = f'<p><label>{number} <input id="answer" type="number" step="any"></label> <output id="verdict"></output></p>'
    return f"<h2>{escape(lesson['title'])}</h2><p>{escape(lesson['about'])}</p>{asked}{answer}"


def _squeezed(block: bytes) -> str:
    return base64.b64encode(zlib.compress(block, 9)).decode()


def contents(scenario: Scenario, lesson: Lesson | None = None) -> dict[str, Any]:
    """Return all of a page that is about its scenario, ready for strict JSON; arguments as of `write`."""
    ideal = prepare(on_ideal_plant(scenario))
    fitted, arm = ideal.scenario, ideal.arm
    controls = Controls(ideal, lesson.number.setting if lesson else {})
    slow = [policy.name for policy in POLICIES.options if policy.slows]
    return {
        "name": fitted.name, "scenario": _plain(fitted), "period": fitted.control.period,
        "image": _image(ideal),
        "policy": fitted.control.at_singularity, "slow": slow, "longest": fitted.control.slow.longest,
        "controls": [control._asdict() for control in controls.controls], "groups": controls.groups,
        "paths": [
            {
                "speed": speed, "changes": changes, "ticks": faster.reference.ticks,
                "pieces": base64.b64encode(faster.reference.numbers.astype("<f8").tobytes()).decode(),
            }
            for speed, changes, faster in controls.paths
        ],
        "joints": [
            {"name": name, "color": css(color)}
            for name, color in zip(arm.joints, distinct(arm.n), strict=True)
        ],
        "unit": " or ".join(f"{unit}/s" for unit in dict.fromkeys(arm.units)),
        "shows": lesson.shows if lesson else ("velocity", "lost"),
        "statuses": [{"bit": int(flag), "name": in_words(flag), "color": css(of_status(int(flag)))} for flag in IN_RUNS],
        "below": fitted.control.inverse.damping.below, "drawing": drawing(ideal), "places": arm.wiring.qpos.tolist(),
        "written": _written(prepare(scenario)), "lesson": _lesson(lesson, ideal),
    }  # fmt: skip


def _image(prepared: Prepared) -> dict[str, Any]:
    """Return the image of a world whose path, number of ticks and settings the page writes.

    Raises:
        QuestionError: It needs random numbers, or is none for a page.
    """
    plant, arm, made = prepared.scenario.plant, prepared.arm, image(prepared)
    if prepared.hardware.encoders.is_noisy or plant.jitter or plant.loss:
        keys = "arm.encoder.noise, plant.jitter and plant.loss"
        raise QuestionError(f"a page has no random numbers; leave out {keys}")
    chain, J = offset("chain", "frame") // 8, offset("state", "J") // 8
    more = {
        "frame": np.arange(chain, chain + 7 * len(arm.axis_names)),
        "J": (J + CAPACITY * np.arange(6)[:, None] + np.arange(arm.n)).ravel(),
        "limit": offset("limits", "rate") // 8 + np.arange(arm.n),
    }
    for name, words in more.items():
        made["columns"][name] = [made["width"], len(words)]
        made["width"] += len(words)
    arrays = made["arrays"]
    arrays.pop("positions", None)  # those of joints that are not the arm's
    sources = base64.b64decode(arrays["sources"][2]) + np.concatenate([*more.values()]).tobytes()
    arrays["sources"] = [arrays["sources"][0], len(sources), base64.b64encode(sources).decode()]
    record = np.frombuffer(base64.b64decode(made["record"]), np.int64).copy()
    record[[offset("engine", name) // 8 for name in ("path_ticks", "path_size")]] = 0
    made["record"] = base64.b64encode(record.tobytes()).decode()
    for name in ("reference", "chance", "path"):
        arrays[name] = [offset("engine", name), 0, ""]
    names = ("rows", "width", "path_ticks", "path_size", "past_rows", "chance", "qpos")
    made["words"] |= {name: offset("engine", name) for name in names}
    made["words"]["path_tick"] = offset("memory", "path_tick")
    made["fields"] = {field: offset("methods", field) for field in METHODS.split()}
    # the settings are differences from what `written` says
    made["methods"] += [[made["fields"][field], name] for field, name in written(prepared).methods.items()]
    return made


def _plain(scenario: Scenario) -> dict[str, Any]:
    """Return a scenario to paste, without defaults; a model that does not come with rmrc is a file beside it."""
    values = scenario.model_dump(mode="json", exclude_defaults=True)
    model = Path(values["arm"]["model"])
    is_shipped = model.resolve() == shipped.found(model.stem, "models").resolve()
    values["arm"]["model"] = model.stem if is_shipped else model.name
    return values


def _written(prepared: Prepared) -> dict[str, Any] | None:
    """Return the run that MuJoCo makes of a scenario as written, thinned; None where it has no physics."""
    if not prepared.plant.has_physics:
        return None
    (run,) = Simulation([prepared]).run()
    joint = int(np.abs(run["qdot"]).max(axis=0).argmax())
    moved, turned = (1e3 * np.linalg.norm(run["pose_error"][:, rows], axis=1) for rows in error_rows(run))
    curves = {"rates": run["qdot"][:, joint], "sigma": run["sigma"][:, -1], "error": moved, "turn": turned}
    spans = POINTS // (2 * len(curves)) - 2  # beside the ends of each
    rows = np.unique(np.concatenate([extremes(curve, spans) for curve in curves.values()]))
    thinned = {name: packed(curve[rows]) for name, curve in {"time": run["time"], **curves}.items()}
    return {**thinned, "joint": run.joints[joint], "skeleton": skeleton(prepared, run)}


def _lesson(lesson: Lesson | None, ideal: Prepared) -> dict[str, Any] | None:
    """Return a lesson, with the number to find as the ideal plant gives it."""
    if lesson is None:
        return None
    number = lesson.number
    (run,) = Simulation([prepare(ideal.scenario.set(number.setting))]).run()
    value = float(run.scorecard[number.figure].value) / number.per
    return {**lesson.model_dump(mode="json", by_alias=True), "value": value, "within": number.within}
