"""Lessons: a scenario with questions, hints, and a number to find, as YAML."""

from pathlib import Path
from typing import Annotated, Any, Literal

from rmrc.scenario.values import Number, Positive, Section, Text, count, key

SHIPPED = {file.stem: file for file in sorted(Path(__file__).with_name("lessons").glob("*.yaml"))}


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
