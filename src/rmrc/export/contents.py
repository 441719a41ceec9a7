"""What a page has of its scenario: the image of its world, controls, path, picture, and MuJoCo's run.

The page has the ideal plant, as there is no MuJoCo in it. The run that MuJoCo made of the scenario as written
is beside it, thinned.
"""

from pathlib import Path
from typing import Any

import numpy as np

from rmrc.export.controls import Controls
from rmrc.export.drawing import drawing, floats, skeletons
from rmrc.export.image import image, packed
from rmrc.scenario import Scenario
from rmrc.scenario.choices import IN_RUNS, POLICIES
from rmrc.scenario.lesson import Lesson
from rmrc.show.palette import css, distinct, of_status
from rmrc.show.panels import error_rows, extremes, in_words
from rmrc.simulation.prepare import Prepared, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support import shipped
from rmrc.support.errors import QuestionError

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
