"""A second of seeded, bounded motion of an arm on every plant: contacts, warnings, divergence."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias

import numpy as np

from rmrc.analysis.new.scaling import Scales
from rmrc.analysis.new.text import identity
from rmrc.arm import Arm
from rmrc.arm.inventory import Contact, contacts
from rmrc.law.task import Array
from rmrc.results.run import Run
from rmrc.results.scorecard import Scorecard, scorecard
from rmrc.scenario import Scenario, inline, loads
from rmrc.scenario.choices import PLANTS
from rmrc.simulation.prepare import Cache, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError
from rmrc.support.spatial import log_rotation, quat_conjugate, quat_multiply

# Displacement of each joint from the start [rad, or of L], number of positions, and duration [s].
BOUND, PLACES, DURATION = 0.05, 2, 1.0
# Number of configurations of a run that are checked for contacts.
LOOKS = 50

# Names of pairs of geoms.
Touching: TypeAlias = frozenset[tuple[str, str]]


@dataclass(frozen=True, eq=False)
class Motion:
    """Result of the motion on one plant.

    Attributes:
        plant: Its kind.
        refused: Why it was not run, a line; "" if it was.
        scorecard: The metrics; none if it was refused.
        diverged: Where and why it diverged, a line; "" if it did not.
        contacts: Pairs of parts that the arm's joints move relative to each other, without those at the
            start.
        warnings: Number of MuJoCo's warnings, by their names.
        springs: Springs that it does not compensate, a line; "" without.
    """

    plant: str
    refused: str = ""
    scorecard: Scorecard | None = None
    diverged: str = ""
    contacts: tuple[Contact, ...] = ()
    warnings: Mapping[str, int] | None = None
    springs: str = ""


def motions(
    scales: Scales, start: Array, touching: frozenset[tuple[str, str]], seed: int
) -> tuple[Motion, ...]:
    """Return the results of the motion on each plant.

    The site visits its positions at seeded joint positions near the start, one after another, and returns, by
    the law and within the rate limits; the target motion is the same on all plants.

    Args:
        scales: Scales of the arm.
        start: Joint positions within the limits, (n,).
        touching: Geoms that touch at the start.
        seed: Seed of the positions.
    """
    arm = scales.task.arm
    told = replace(arm, notes=())  # the findings contain them
    cache, written = Cache(*() if arm.stretch else (told,)), _scenario(scales, start, seed)
    reference = prepare(written, cache).reference
    hurry = reference.duration / DURATION
    limits = written.target.limits.model_dump()
    powers = {
        name: 1 if name.endswith("velocity") else 2 if name.endswith("acceleration") else 3 for name in limits
    }
    faster = {f"target.limits.{name}": value * hurry ** powers[name] for name, value in limits.items()}
    one = written.set(faster)
    return tuple(_motion(one, name, arm, touching, cache) for name in PLANTS.names)


def _motion(
    one: Scenario, plant: str, arm: Arm, touching: frozenset[tuple[str, str]], cache: Cache
) -> Motion:
    try:
        prepared = prepare(one.set({"plant.kind": plant}), cache)
        simulation = Simulation([prepared])
    except ScenarioError as error:
        return Motion(plant, refused=error.problems[0].text)
    run = simulation.run()[0]
    looked = run["qpos"][:: max(1, len(run) // LOOKS)]
    met = contacts(arm, looked[np.isfinite(looked).all(axis=1)])
    new = tuple(contact for contact in met if contact.is_moved and contact.geoms not in touching)
    (warnings,) = simulation.warnings()
    return Motion(plant, "", scorecard(run), _divergence(run), new, warnings, prepared.springs)


def _divergence(run: Run) -> str:
    found = run.divergence
    if found is None:
        return ""
    return f"at {found.time:.3g} s{f', joint {found.joint}' if found.joint else ''}: {found.reason}"


def _scenario(scales: Scales, start: Array, seed: int) -> Scenario:
    """Return the motion, timed by the defaults of a target."""
    task, arm = scales.task, scales.task.arm
    rng = np.random.default_rng(seed)
    away = BOUND * task.joint_scale * rng.uniform(-1.0, 1.0, (PLACES, arm.n))
    places = [start, *np.clip(start + away, *_limits(arm, start)), start]
    poses = [arm.pose(q) for q in places]
    path = []
    for before, after in pairwise(poses):
        turn = log_rotation(quat_multiply(after[3:], quat_conjugate(before[3:])))
        angle, by = float(np.linalg.norm(turn)), (after[:3] - before[:3]).tolist()
        about = {"axis": (turn / angle).tolist(), "angle": angle} if angle > 1e-9 else None
        if np.linalg.norm(by) > 1e-9:
            path.append({"line": {"by": by} | ({"turn": about} if about else {})})
        elif about:
            path.append({"turn": about})
    values = {
        "name": "check",
        "arm": identity(arm, Path.resolve) | {"start": start.tolist()},
        "task": {"axes": list(task.axes)},
        "control": {"limits": {"rate": scales.rate.tolist()}},
        "target": {"path": path or [{"hold": {"for": DURATION}}]},
    }  # fmt: skip
    return loads(inline(values))


def _limits(arm: Arm, start: Array) -> tuple[Array, Array]:
    lower, upper = arm.position_limit.T
    return np.minimum(lower, start), np.maximum(upper, start)
