"""A control law without the rest of a scenario: a file or a mapping with a section `control`, or its keys."""

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from pydantic import ValidationError

from rmrc.scenario.draft import Scenario, document_of, load
from rmrc.scenario.keys import SourceMap, in_order
from rmrc.scenario.messages import translate
from rmrc.scenario.reading import Document, TextError, read
from rmrc.scenario.sections import ArmSection, ControlSection, TaskSection
from rmrc.scenario.values import Section
from rmrc.scenario.wording import show
from rmrc.support import shipped
from rmrc.support.errors import QuestionError, ScenarioError

ControlSource: TypeAlias = "ControlSection | Scenario | Mapping[str, Any] | str | os.PathLike[str] | None"
"""A section, a scenario, a mapping with the section `control` or with its keys, or a YAML file of these."""


class Controls(NamedTuple):
    """The part of a scenario that a loop outside a run needs.

    Attributes:
        control: The law.
        task: The controlled components of the site's motion; None if it is not given.
        arm: The controlled frame and the actuated joints; None if it is not given.
    """

    control: ControlSection
    task: TaskSection | None = None
    arm: ArmSection | None = None


class _Given(Section):
    control: ControlSection = ControlSection()
    task: TaskSection | None = None


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
    found = _read(source)
    if period is None:
        return found
    if not (isinstance(period, int | float) and 0.0 < period < math.inf):
        raise QuestionError(f"period must be > 0 and finite [s], got {period}")
    return found._replace(control=found.control.model_copy(update={"period": float(period)}))


def read_task(source: TaskSection | Mapping[str, Any]) -> TaskSection:
    """Return a checked task from its keys.

    Raises:
        ScenarioError: Lists all problems at once.
    """
    if isinstance(source, TaskSection):
        return source
    found = _checked(Document({"task": dict(source)}, SourceMap()))
    assert found.task is not None
    return found.task


def _read(source: ControlSource) -> Controls:
    if source is None:
        return Controls(ControlSection())
    if isinstance(source, ControlSection):
        return Controls(source)
    if isinstance(source, Scenario):
        return Controls(source.control, source.task, source.arm)
    if isinstance(source, Mapping):
        return _controls(Document(dict(source), SourceMap()))
    if not isinstance(source, str | os.PathLike):
        raise QuestionError(
            f"control must be a mapping, a file, a ControlSection or a Scenario, got {type(source).__name__}"
        )
    name = os.fspath(shipped.found(source, "scenarios"))
    try:
        text = read(name)
    except TextError as error:
        raise ScenarioError([error.problem(name)]) from None
    document = document_of(text, name)
    if "arm" in document.value:
        scenario = load(Path(name))
        return Controls(scenario.control, scenario.task, scenario.arm)
    return _controls(document)


def _controls(document: Document) -> Controls:
    """Return the sections of a mapping that is no scenario: sections, or the keys of one."""
    if not document.value.keys() & {"control", "task"}:
        document = Document({"control": document.value}, document.sources.below("control"))
    found = _checked(document)
    return Controls(found.control, found.task)


def _checked(document: Document) -> _Given:
    problems = document.problems
    try:
        if not isinstance(document.value, dict):
            raise ScenarioError.about(
                document.sources.source, f"must be a mapping, got {show(document.value)}"
            )
        found = _Given.model_validate(document.value, by_alias=True, by_name=False)
    except ValidationError as error:
        problems = problems + translate(error, document.sources, _Given)
    if problems:
        raise ScenarioError(in_order(problems))
    return found
