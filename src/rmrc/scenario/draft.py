"""A scenario and its source: plain values from a file, options or Python, validated as a whole.

Two relatives are read here: a control law without the rest of a scenario, and a lesson, which is a scenario
with questions, hints, and a number to find.
"""

import copy
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import PrivateAttr

from rmrc.scenario.changes import Change, applied, changes_of, deeper_last, plain, read_change, read_setting
from rmrc.scenario.control import ControlSection, TaskSection
from rmrc.scenario.messages import checked
from rmrc.scenario.profile import SHIPPED
from rmrc.scenario.reading import Document, block, split
from rmrc.scenario.sections import PROFILE, ArmSection, Sections, parse_key
from rmrc.scenario.values import Number, Positive, Section, Text, count, key
from rmrc.support import shipped
from rmrc.support.errors import Origin, Problem, QuestionError, ScenarioError, join
from rmrc.support.text import cut

# Keys of files and folders, at the end of dotted keys, which may begin with `sweep.vary` or `baseline`.
_FILES = re.compile(r"\.(arm\.model|tool\.model|packages\.[^.]+|file\.path|profile)$")


class Scenario(Sections):
    """All inputs of a run: frozen, validated, in SI units and radians.

    >>> scenario = load("scenarios/line_tracking.yaml")
    >>> [scenario.set({"plant.payload": mass}).plant.payload for mass in (0.5, 2)]
    [0.5, 2.0]
    """

    _draft: "Draft | None" = PrivateAttr(None)

    def __repr__(self) -> str:
        """Return its keys and values, as many as fit on a screen."""
        return cut(super().__repr__())

    def __eq__(self, other: object) -> bool:
        """Return whether the values are equal; their source is no part of them."""
        return isinstance(other, Scenario) and vars(self) == vars(other)

    __hash__ = None  # type: ignore[assignment]

    @property
    def draft(self) -> "Draft":
        """Its source; for one made in Python, its own values."""
        return self._draft or Draft(self.model_dump(mode="json"))

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy as pydantic makes it; a copy with other values counts as made in Python."""
        copied = super().model_copy(update=update, deep=deep)
        copied._draft = None if update else self._draft
        return copied

    def locate(self, key: str) -> str:
        """Return where a key was given, as the start of a message.

        Args:
            key: A dotted key, such as `control.inverse.damping.maximum`, `arm.start[1]` or
                `expect.joint_rate.peak`.

        Returns:
            Where its value starts, counted from 1, or its nearest parent if it is absent, as
            `scenarios/x.yaml:7:13: control.inverse.damping.maximum`; `--set KEY` if it was set
            so; the key alone if the scenario was made in Python.
        """
        return self.draft.origin(parse_key(key)).of(join(parse_key(key)))

    def problem(self, key: str, text: str) -> Problem:
        """Return the problem of a value, with the place where it was given.

        Args:
            key: Of the value, dotted.
            text: The problem in words.
        """
        return self.draft.problem(parse_key(key), text)

    def changed(self, *changes: Change) -> "Scenario":
        """Return the scenario with other values; later changes win.

        Raises:
            ScenarioError: Lists all problems at once.
        """
        return self.draft.changed(*changes).scenario()

    def fitted(self, length: float, control: ControlSection) -> "Scenario":
        """Return the scenario with the numbers that come from its arm; its source stays as it is written."""
        task = self.task.model_copy(update={"length": length})
        fitted = self.model_copy(update={"task": task, "control": control})
        fitted._draft = self._draft
        return fitted

    def set(self, values: Mapping[str, object]) -> "Scenario":
        """Return the scenario with other values: `scenario.set({"control.feedback": 40})`.

        Args:
            values: By dotted key, such as `arm.start[1]`, each as a file would have it.

        Raises:
            ScenarioError: Lists all problems at once.
            ValueError: A key is not valid.
        """
        return self.changed(*changes_of(values))

    @property
    def baseline_changes(self) -> tuple[Change, ...]:
        """Changes that make its baseline; empty without one. It shares only the profile of `expect`."""
        if not self.baseline:
            return ()
        origins = {name: Origin(self.locate(f"baseline.{name}"), key=name) for name in self.baseline}
        changes = [Change(split(name), value, origins[name]) for name, value in self.baseline.items()]
        accepted = {name: check for name, check in self.expect.items() if name == PROFILE}
        return (*deeper_last(changes), Change(("expect",), accepted), Change(("baseline",), {}))

    def to_yaml(self) -> str:
        """Return the complete scenario as it runs: all defaults, SI numbers, an absolute path.

        `rmrc.scenario.loads` reads it back to an equal scenario.
        """
        return block(self.model_dump(mode="json"), width=80)


class Draft(Document):
    """Values of a scenario and their origins; they may be invalid, and changes may correct them."""

    def files(self) -> tuple[Path, ...]:
        """Return the models, packages, recorded motions and profiles that it and its sweep name."""
        texts = _texts("", self.value)
        known = {*SHIPPED, *shipped.shipped("models")}
        named = (text for key, text in texts if _FILES.search(key) and text not in known)
        return tuple(map(Path, dict.fromkeys(os.path.abspath(self.folder / name) for name in named)))

    def moved(self, root: Path) -> "Draft":
        """Return the draft for a machine where all its files are below a folder, by their absolute paths."""
        return replace(self, folder=self.folder.absolute(), root=root)

    def changed(self, *changes: Change) -> "Draft":
        """Return the draft with other values; later changes win.

        Raises:
            ScenarioError: There is no place for a value.
        """
        return applied(self, changes)

    def overridden(self, texts: Iterable[str]) -> "Draft":
        """Return the draft with `KEY=VALUE` texts of `--set`.

        Raises:
            ScenarioError: A text cannot be read, or there is no place for its value.
        """
        return self.changed(*map(read_setting, texts))

    def given(self, key: str, text: str, option: str) -> "Draft":
        """Return the draft with the value of an option that has a key of its own.

        Args:
            key: The key that the option changes, such as `sweep.vary.control.feedback`.
            text: The value as YAML.
            option: Name of the key in messages, such as `--vary control.feedback`.

        Raises:
            ScenarioError: The text cannot be read.
        """
        return self.changed(read_change(parse_key(key), text, option))

    def values(self) -> dict[str, Any]:
        """Return a copy of the values: plain data, unchecked."""
        return dict(copy.deepcopy(self.value))

    def scenario(self) -> Scenario:
        """Return the scenario.

        Raises:
            ScenarioError: Lists all problems at once.
        """
        scenario = checked(Scenario, self)
        scenario._draft = self
        return scenario


def _texts(key: str, value: object) -> Iterator[tuple[str, str]]:
    """Yield every text of plain values, with its dotted key, without places in lists."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _texts(f"{key}.{name}", inner)
    elif isinstance(value, list):
        for item in value:
            yield from _texts(key, item)
    elif isinstance(value, str):
        yield key, value


class Problems:
    """Problems of a scenario, collected so that one error reports all of them."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin with none."""
        self._scenario, self._problems = scenario, list[Problem]()

    def add(self, key: str, text: str) -> None:
        """Add the problem of a value; the key is dotted."""
        self._problems.append(self._scenario.problem(key, text))

    def extend(self, problems: Iterable[tuple[str, str]]) -> None:
        """Add problems of several values: a dotted key and a text each."""
        for place, text in problems:
            self.add(place, text)

    def raise_any(self) -> None:
        """Raise the collected problems, if any.

        Raises:
            ScenarioError: With all of them.
        """
        if self._problems:
            raise ScenarioError(self._problems)


Source: TypeAlias = Scenario | Draft | str | os.PathLike[str]
"""A scenario, its file, or the name of a shipped one."""


def draft_of(source: Source, overrides: Iterable[str] = ()) -> Draft:
    """Return a draft: of a file, of a scenario, or a draft itself.

    Args:
        source: The YAML file, which messages show as given; or a scenario or a draft.
        overrides: `KEY=VALUE` texts that replace values, such as `control.inverse.method=inverse` or
            `arm.start[1]=10 deg`; VALUE is YAML.

    Raises:
        ScenarioError: There is no such file, or its text or an override cannot be used.
    """
    if isinstance(source, Draft):
        return source.overridden(overrides)
    if isinstance(source, Scenario):
        return source.draft.overridden(overrides)
    return Draft.read(os.fspath(shipped.found(source, "scenarios"))).overridden(overrides)


def load(path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> Scenario:
    """Read a scenario from a file.

    Args:
        path: The YAML file; messages show it as it is given.
        overrides: As in `draft_of`.

    Returns:
        The checked scenario; `arm.model` is absolute.

    Raises:
        ScenarioError: With all mistakes at once.
    """
    return draft_of(path, overrides).scenario()


def loads(text: str, source: str = "<text>", overrides: Iterable[str] = ()) -> Scenario:
    """Read a scenario from a text; relative paths start at the working directory.

    Args:
        text: The YAML text.
        source: Its name in messages.
        overrides: As in `draft_of`.

    Returns:
        The checked scenario.

    Raises:
        ScenarioError: With all mistakes at once.
    """
    return Draft.read(source, text).overridden(overrides).scenario()


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
    if not (isinstance(period, Real) and 0.0 < period < math.inf):
        raise QuestionError(f"period must be > 0 and finite [s], got {period}")
    control = controls.control.model_copy(update={"period": float(period)})
    return controls.model_copy(update={"control": control})


def _controls(source: ControlSource) -> Controls:
    if isinstance(source, ControlSection | None):
        return Controls(control=source or ControlSection())
    if isinstance(source, Mapping):
        document = Document(plain(source))
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


# Lessons ------------------------------------------------------------------------------------------

LESSONS = {file.stem: file for file in sorted(Path(__file__).with_name("lessons").glob("*.yaml"))}


class Question(Section):
    """A question to answer on the page.

    Attributes:
        ask: The question.
        do: What to try on the page.
    """

    ask: Text
    do: Text


class Sought(Section):
    """The number to find: a metric of the scorecard for a setting.

    Attributes:
        ask: What to set, and which number to read.
        setting: The setting that has it: a value for each key that is changed.
        figure: Its name in the scorecard.
        unit: Unit in which it is told.
        per: How many SI units are one of that.
        value: The right answer.
        within: How far from it an answer may be.
    """

    ask: Text
    setting: dict[str, Any] = key(alias="with")
    figure: Text
    unit: Text
    per: Positive = 1.0
    value: Number
    within: Positive


class Lesson(Section):
    """A scenario with questions and a number to find.

    Attributes:
        title: Above the lesson.
        scenario: A shipped scenario by its name, or a file beside the lesson.
        about: The scene, in a sentence.
        shows: Of the marks in the picture, those that are shown.
        questions: Three of them.
        number: The number to find.
        rows: Rows of docs/textbook.md beside those of the scenario, such as A39.
    """

    title: Text
    scenario: Text
    about: Text
    shows: tuple[Literal["velocity", "force", "lost"], ...] = ("velocity", "lost")
    questions: Annotated[tuple[Question, ...], count(3, 3)]
    number: Sought
    rows: tuple[Text, ...] = ()
