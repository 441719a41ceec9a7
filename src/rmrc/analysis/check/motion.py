"""A second of seeded, bounded motion of an arm on every plant, compared with the ideal one."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rmrc.analysis.new.text import identity
from rmrc.analysis.scaling import Scales
from rmrc.arm.inventory import Contact, contacts
from rmrc.law.task import Array
from rmrc.results.scorecard import Scorecard
from rmrc.scenario import Scenario, inline, loads
from rmrc.scenario.choices import PLANTS
from rmrc.simulation.prepare import Cache, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError

# Displacement of each joint from the start [rad, or of L], number of positions, and duration [s].
BOUND, PLACES, DURATION = 0.05, 2, 1.0
# Number of configurations of a run that are checked for contacts.
LOOKS = 50
# A plant differs from the ideal one if its error is this many times as large, or a rate this share above its
# limit. Errors below the last, in m of the arm's size or rad, are rounding.
TIMES, ABOVE, ROUNDING = 100.0, 0.05, 1e-6


@dataclass(frozen=True, eq=False)
class Motion:
    """Result of the motion on one plant.

    Attributes:
        plant: Its kind.
        refused: Why it was not run, a line; "" if it was.
        scorecard: The metrics; none if it was refused.
        diverged: Where and why it diverged, a line; "" if it did not.
        differs: How it differs from the motion on the ideal plant, a line; "" if it hardly does.
        contacts: Pairs of parts that the arm's joints move relative to each other, without those at the
            start.
        warnings: Number of MuJoCo's warnings, by their names.
        springs: Springs that it does not compensate, a line; "" without.
    """

    plant: str
    refused: str = ""
    scorecard: Scorecard | None = None
    diverged: str = ""
    differs: str = ""
    contacts: tuple[Contact, ...] = ()
    warnings: Mapping[str, int] | None = None
    springs: str = ""

    @property
    def result(self) -> str:
        """`ok`, `refused` or `diverged`."""
        return "refused" if self.refused else "diverged" if self.diverged else "ok"


def motions(
    scales: Scales, start: Array, touching: frozenset[tuple[str, str]], seed: int
) -> tuple[Motion, ...]:
    """Return the results of the motion on each plant.

    The site visits its poses at seeded joint positions near the start, one after another, and returns, by
    the law and within the rate limits; the target motion is the same on all plants.

    Args:
        scales: Scales of the arm.
        start: Joint positions within the limits, (n,).
        touching: Geoms that touch at the start.
        seed: Seed of the positions.
    """
    arm = scales.task.arm
    quiet = replace(arm, notes=())  # the findings contain them
    cache, written = Cache(*() if arm.stretch else (quiet,)), _scenario(scales, start, seed)
    hurry = prepare(written, cache).reference.duration / DURATION
    powers = {"velocity": 1, "acceleration": 2, "jerk": 3}
    faster = {
        f"target.limits.{name}": value * hurry ** powers[name.removeprefix("angular_")]
        for name, value in written.target.limits.model_dump().items()
    }
    results: list[Motion] = []
    for plant in PLANTS.names:
        try:
            prepared = prepare(written.set({**faster, "plant.kind": plant}), cache)
            simulation = Simulation([prepared])
        except ScenarioError as error:
            results.append(Motion(plant, refused=error.problems[0].text))
            continue
        run, (warnings,) = simulation.run()[0], simulation.warnings()
        looked = run["qpos"][:: max(1, len(run) // LOOKS)]
        met = contacts(arm, looked[np.isfinite(looked).all(axis=1)])
        ideal = results[0].scorecard if results else None
        differs = "" if run.divergence or ideal is None else _difference(scales, run.scorecard, ideal)
        met = tuple(each for each in met if each.is_moved and each.geoms not in touching)
        diverged = str(run.divergence or "")
        results.append(Motion(plant, "", run.scorecard, diverged, differs, met, warnings, prepared.springs))
    return tuple(results)


def _difference(scales: Scales, card: Scorecard, ideal: Scorecard) -> str:
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


def _scenario(scales: Scales, start: Array, seed: int) -> Scenario:
    """Return the motion, timed by the defaults of a target."""
    task, arm = scales.task, scales.task.arm
    away = BOUND * task.joint_scale * np.random.default_rng(seed).uniform(-1.0, 1.0, (PLACES, arm.n))
    places = [*np.clip(start + away, *arm.position_limit.T), start]
    moves = np.ptp([arm.pose(q) for q in places], axis=0).any()
    visits = {"configurations": [q.tolist() for q in places]}
    return loads(inline({
        "name": "check",
        "arm": identity(arm, Path.resolve) | {"start": start.tolist()},
        "task": {"axes": list(task.axes), "length": task.length},
        "control": {"limits": {"rate": scales.rate.tolist()}},
        "target": {"path": [visits if moves else {"hold": {"for": DURATION}}]},
    }))  # fmt: skip
