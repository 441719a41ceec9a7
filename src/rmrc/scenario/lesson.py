"""Lessons: a scenario with questions, hints, and a number to find, as YAML."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator

from rmrc.scenario.keys import split
from rmrc.scenario.profile import SUFFIXES, read_section
from rmrc.scenario.values import Number, Positive, Section, Text, count, key, rule
from rmrc.scenario.wording import show
from rmrc.support.errors import QuestionError, did_you_mean

Mark = Literal["velocity", "force", "lost"]
SHIPPED = {file.stem: file for file in sorted(Path(__file__).with_name("lessons").glob("*.yaml"))}


def _keys(values: dict[str, Any]) -> dict[str, Any]:
    """Refuse a name that is no key."""
    for name in values:
        try:
            split(name)
        except ValueError:
            raise rule("is no key such as control.feedback", ("with", name)) from None
    return values


class Question(Section):
    """A question to answer on the page."""

    ask: Text = key("the question")
    do: Text = key("what to try on the page")


class Sought(Section):
    """The number to find: a metric of the scorecard for a setting."""

    ask: Text = key("what to set, and which number to read")
    given: Annotated[dict[str, Any], AfterValidator(_keys)] = key(
        "the setting that has it: a value for each key that is changed", alias="with"
    )
    figure: Text = key("its name in the scorecard")
    unit: Text = key("in which it is told")
    per: Positive = key("how many SI units are one of that", 1.0)
    value: Number = key("the right answer")
    within: Positive = key("how far from it an answer may be")

    def is_met(self, text: str) -> bool | None:
        """Return whether a text is the sought number; None: it is no number."""
        try:
            return abs(float(text.strip().replace(",", ".")) - self.value) <= self.within
        except ValueError:
            return None


class Lesson(Section):
    """A scenario with questions and a number to find."""

    title: Text = key("above the lesson")
    scenario: Text = key("a shipped scenario by its name, or a file beside the lesson")
    about: Text = key("the scene, in a sentence")
    shows: tuple[Mark, ...] = key("of the marks in the picture, those that are shown", ("velocity", "lost"))
    questions: Annotated[tuple[Question, ...], count(3, 3)] = key("three of them")
    number: Sought = key("the number to find")
    rows: tuple[Text, ...] = key("rows of docs/textbook.md beside those of the scenario, such as A39", ())


def load_lesson(name: str) -> tuple[Lesson, Path]:
    """Return a lesson and its file.

    Args:
        name: Name of a shipped one, such as `reach`, or the path of a YAML file.

    Raises:
        QuestionError: There is none with that name.
        ScenarioError: The file cannot be read, or is no lesson; all problems.
    """
    path = SHIPPED.get(name, Path(name))
    if name not in SHIPPED and path.suffix not in SUFFIXES:
        near = did_you_mean(name, SHIPPED) or f"; the lessons are {', '.join(SHIPPED)}"
        raise QuestionError(f"a lesson is a shipped one or a .yaml file, got {show(name)}{near}")
    return read_section(Lesson, path), path
