"""A scenario for an arm, and what the arm does by it on a plant: what `check`, `new` and `statics` share."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from rmrc.arm import Arm
from rmrc.arm.inventory import Contact, contacts
from rmrc.law.task import Array
from rmrc.results.run import Run
from rmrc.results.scorecard import Figure
from rmrc.scenario import Scenario
from rmrc.simulation.prepare import Cache, prepare
from rmrc.simulation.simulation import Simulation
from rmrc.support.errors import ScenarioError
from rmrc.support.text import listed

# Number of configurations of a run that are checked for contacts.
LOOKS = 50

Seen: TypeAlias = Callable[[Path], Path | str]
"""Returns the path of a model as a scenario has it."""


@dataclass(frozen=True, eq=False)
class Trial:
    """What an arm did on a plant.

    Attributes:
        plant: Kind of the plant.
        refused: Why it was not run, a line; "" if it was.
        run: The run; None if it was refused.
        springs: Springs that the plant does not compensate, a line; "" without.
    """

    plant: str
    refused: str = ""
    run: Run | None = None
    springs: str = ""

    @property
    def scorecard(self) -> Mapping[str, Figure]:
        """The metrics; none if it was refused."""
        return self.run.scorecard if self.run else {}

    @property
    def diverged(self) -> str:
        """Where and why it diverged, a line; "" if it did not."""
        return str(self.run.divergence or "") if self.run else ""


def tried(scenario: Scenario, plant: str, cache: Cache) -> Trial:
    """Return what a scenario does on a plant of some kind.

    Args:
        scenario: The scenario.
        plant: Kind of the plant, instead of its own.
        cache: Its arm, if it is loaded.
    """
    try:
        prepared = prepare(scenario.set({"plant.kind": plant}), cache)
        (run,) = Simulation([prepared]).run()
    except ScenarioError as error:
        return Trial(plant, error.problems[0].text)
    return Trial(plant, "", run, prepared.springs)


def touching(arm: Arm, qpos: Array) -> tuple[Contact, ...]:
    """Return the contacts of parts that the arm's joints move relative to each other, the deepest first.

    Args:
        arm: The arm.
        qpos: Configurations of the model, (N, nq); about `LOOKS` of them are looked at.
    """
    qpos = qpos[:: max(1, len(qpos) // LOOKS)]
    return tuple(each for each in contacts(arm, qpos[np.isfinite(qpos).all(axis=1)]) if each.is_moved)


def overlaps(contacts: Sequence[Contact]) -> str:
    """Return some contacts in words, the deepest first."""
    pairs = listed(dict.fromkeys(" and ".join(contact.bodies) for contact in contacts))
    return f"{pairs} penetrate each other by up to {1e3 * contacts[0].depth:.2g} mm"


def identity(arm: Arm, seen: Seen) -> dict[str, Any]:
    """Return the keys of `arm` in a scenario that identify an arm, without its start.

    Args:
        arm: The arm.
        seen: Path of the model in the scenario.
    """
    keys: dict[str, Any] = {"model": str(seen(arm.path))}
    if arm.frame is not None:
        key, frame = arm.frame
        keys[key] = frame if isinstance(frame, str) else frame.model_dump(mode="json", exclude_defaults=True)
        if not isinstance(frame, str) and frame.model is not None:
            keys[key]["model"] = str(seen(frame.model))
    if arm.packages:
        keys["packages"] = {name: str(seen(folder)) for name, folder in arm.packages}
    keys["joints"] = list(arm.joints)
    return keys | ({"stretch": dict(arm.stretch)} if arm.stretch else {})
