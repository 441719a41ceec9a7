"""A second of bounded motion of an arm on every plant, compared with the ideal one."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from rmrc.analysis.scaling import Scales
from rmrc.analysis.trial import Trial, identity, tried
from rmrc.law.task import Array
from rmrc.results.scorecard import Figure
from rmrc.scenario import Scenario
from rmrc.scenario.choices import PLANTS
from rmrc.simulation.prepare import Cache, prepare

# Displacement of each joint from the start [rad, or of L], number of positions, and duration [s].
BOUND, PLACES, DURATION = 0.05, 2, 1.0
# A plant differs from the ideal one if its error is this many times as large, or a rate this share above its
# limit. Errors below the last, in m of the arm's size or rad, are rounding.
TIMES, ABOVE, ROUNDING = 100.0, 0.05, 1e-6


def motions(scales: Scales, start: Array) -> tuple[Trial, ...]:
    """Return the results of the motion on each plant, the ideal one first.

    The site visits its poses at random joint positions near the start, one after another, and returns, by
    the law and within the rate limits; the target motion is the same on all plants.

    Args:
        scales: Scales of the arm.
        start: Joint positions within the limits, (n,).
    """
    arm = scales.task.arm
    quiet = replace(arm, notes=())  # the findings contain them
    cache, written = Cache(*() if arm.stretch else (quiet,)), _scenario(scales, start)
    hurry = prepare(written, cache).reference.duration / DURATION
    powers = {"velocity": 1, "acceleration": 2, "jerk": 3}
    faster = {
        f"target.limits.{name}": value * hurry ** powers[name.removeprefix("angular_")]
        for name, value in written.target.limits.model_dump().items()
    }
    return tuple(tried(written.set(faster), plant, cache) for plant in PLANTS.names)


def difference(scales: Scales, card: Mapping[str, Figure], ideal: Mapping[str, Figure]) -> str:
    """Return how the metrics on a plant differ from those on the ideal one; "" if they hardly do."""
    texts = []
    for name, size in (("position_error.max", scales.size), ("orientation_error.max", 1.0)):
        if name in card:
            error = float(card[name].value)
            times = error / max(float(ideal[name].value), ROUNDING * size)
            if times >= TIMES:
                texts.append(
                    f"{name} {error:.3g} {card[name].unit} is {times:.0f} times that of the ideal plant"
                )
    for joint, limit in zip(scales.task.arm.joints, scales.rate, strict=True):
        rate, unit, *_ = card[f"joint_rate.{joint}.peak"]
        if float(rate) > (1.0 + ABOVE) * limit:
            texts.append(f"{joint} moves at {rate:.3g} {unit}, beyond its limit of {limit:.3g}")
    return "; ".join(texts)


def _scenario(scales: Scales, start: Array) -> Scenario:
    """Return the motion, timed by the defaults of a target."""
    task, arm = scales.task, scales.task.arm
    away = BOUND * task.joint_scale * np.random.default_rng(0).uniform(-1.0, 1.0, (PLACES, arm.n))
    places = [*np.clip(start + away, *arm.position_limit.T), start]
    return Scenario.model_validate({
        "name": "check",
        "arm": identity(arm, Path.resolve) | {"start": start.tolist()},
        "task": {"axes": list(task.axes), "length": task.length},
        "control": {"limits": {"rate": scales.rate.tolist()}},
        "target": {"path": [{"configurations": [q.tolist() for q in places]}]},
    })  # fmt: skip
