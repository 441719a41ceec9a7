"""Lessons: each asks three questions, and the number to find is what a run of its setting gives."""

import re

import pytest

import rmrc
from pages import page
from project import ROOT
from rmrc.scenario.draft import LESSONS, Lesson
from rmrc.scenario.messages import checked
from rmrc.scenario.reading import Document
from rmrc.support.errors import ScenarioError


@pytest.mark.parametrize("name", sorted(LESSONS))
def test_the_number_to_find_is_what_the_setting_gives(name):
    lesson = checked(Lesson, Document.read(str(LESSONS[name])))
    number, written = lesson.number, rmrc.load(lesson.scenario)
    for scenario, is_met in ((written.set(number.setting), True), (written, False)):
        value = rmrc.run(scenario).scorecard[number.figure].value / number.per
        assert (abs(value - number.value) <= number.within) == is_met
    assert len(lesson.questions) == 3


@pytest.mark.parametrize("name", sorted(LESSONS))
def test_the_lecture_has_each_lesson_as_a_command_and_its_rows_are_of_the_textbook(name):
    lesson = checked(Lesson, Document.read(str(LESSONS[name])))
    settings = "".join(f" --set {key}={value}" for key, value in lesson.number.setting.items())
    assert f"\nrmrc run {lesson.scenario}{settings}\n" in page("A lecture")
    numbers = re.findall(r"^\| ([A-D]\d+) \|", (ROOT / "docs/textbook.md").read_text("utf-8"), re.MULTILINE)
    assert lesson.rows and set(numbers).issuperset(lesson.rows)


def test_a_wrong_lesson_is_told_by_its_keys(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("title: x\nscenario: y\nabout: z\nquestion: []\nquestions: [{ask: a, do: b}]\n")
    with pytest.raises(ScenarioError, match=rf"{file}:5.*questions") as caught:
        checked(Lesson, Document.read(str(file)))
    assert 'unknown key; did you mean "questions"?' in str(caught.value)
