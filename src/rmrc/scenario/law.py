"""A control law without the rest of a scenario: a file or a mapping with a section `control`, or its keys."""

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeAlias

from rmrc.scenario.arm import ArmSection
from rmrc.scenario.control import ControlSection, TaskSection
from rmrc.scenario.draft import Scenario, load
from rmrc.scenario.messages import checked
from rmrc.scenario.reading import Document
from rmrc.scenario.values import Section
from rmrc.support import shipped
from rmrc.support.errors import QuestionError

ControlSource: TypeAlias = "ControlSection | Scenario | Mapping[str, Any] | str | os.PathLike[str] | None"
"""A section, a scenario, a mapping with the section `control` or with its keys, or a YAML file of these."""


class Controls(Section):
    """The part of a scenario that a loop outside a run needs.

    Attributes:
        control: The law.
        task: The controlled components of the site's motion; None if it is not given.
        arm: The controlled frame and the actuated joints; None if it is not given.
    """

    control: ControlSection = ControlSection()
    task: TaskSection | None = None
    arm: ArmSection | None = None


def read_controls(source: ControlSource, period: float | None = None) -> Controls:
    """Return a control law, checked.

    Args:
        source: The source; None: all defaults. A file is a scenario, a file with only `control:` (and
            `task:`), as `tune` prints it, or one with the keys of the section.
        period: Replaces `period` [s]; None: no change.

    Raises:
        ScenarioError: Lists all problems at once.
        QuestionError: The period is not a positive time.
    """
    controls = _controls(source)
    if period is None:
        return controls
    if not (isinstance(period, int | float) and 0.0 < period < math.inf):
        raise QuestionError(f"period must be > 0 and finite [s], got {period}")
    control = controls.control.model_copy(update={"period": float(period)})
    return controls.model_copy(update={"control": control})


def _controls(source: ControlSource) -> Controls:
    if isinstance(source, ControlSection | None):
        return Controls(control=source or ControlSection())
    if isinstance(source, Mapping):
        document = Document(dict(source))
    elif isinstance(source, Scenario):
        return Controls(control=source.control, task=source.task, arm=source.arm)
    elif isinstance(source, str | os.PathLike):
        name = os.fspath(shipped.found(source, "scenarios"))
        document = Document.read(name)
        if "arm" in document.value:
            return _controls(load(name))
    else:
        wanted = "a mapping, a file, a ControlSection or a Scenario"
        raise QuestionError(f"control must be {wanted}, got {type(source).__name__}")
    if not document.value.keys() & {"control", "task"}:  # the keys of the section control itself
        places = {("control", *key): place for key, place in document.places.items()}
        document = replace(document, value={"control": document.value}, places=places)
    return checked(Controls, document)


def read_task(source: TaskSection | Mapping[str, Any]) -> TaskSection:
    """Return a checked task from its keys.

    Raises:
        ScenarioError: Lists all problems at once.
    """
    if isinstance(source, TaskSection):
        return source
    return checked(Controls, Document({"task": dict(source)})).task or TaskSection()
