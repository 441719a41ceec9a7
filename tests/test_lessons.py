"""Lessons: each asks three questions, and the number to find is what a run of its setting gives."""

import re

import pytest

import rmrc
from pages import page
from project import ROOT, mostly_long
from rmrc.scenario.lesson import SHIPPED, load_lesson
from rmrc.support.errors import QuestionError, ScenarioError
from wording import says


@pytest.mark.parametrize("name", mostly_long(sorted(SHIPPED), every=3))
def test_the_number_to_find_is_what_the_setting_gives(name):
    lesson, _ = load_lesson(name)
    number, written = lesson.number, rmrc.load(lesson.scenario)
    for scenario, is_met in ((written.set(number.given), True), (written, False)):
        value = rmrc.run(scenario).scorecard[number.figure].value / number.per
        assert number.is_met(f"{value:.4g}") is is_met
    assert len(lesson.questions) == 3


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_the_lecture_has_each_lesson_as_a_command(name):
    lesson, _ = load_lesson(name)
    settings = "".join(f" --set {key}={value}" for key, value in lesson.number.given.items())
    assert f"\nrmrc run {lesson.scenario}{settings}\n" in page("A lecture")


@pytest.mark.parametrize(
    ("text", "is_met"), [("1.41", True), (" 1,42 ", True), ("1.5", False), ("", None), ("a", None)]
)
def test_an_answer_is_right_wrong_or_no_number(text, is_met):
    assert load_lesson("wrist")[0].number.is_met(text) is is_met


def test_a_name_of_no_lesson_is_told_with_those_that_there_are():
    with pytest.raises(QuestionError) as caught:
        load_lesson("reech")
    assert str(caught.value) == says('… lesson … "reech"; … "reach"…')


def test_a_wrong_lesson_is_told_by_its_keys(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "title: x\nscenario: line_tracking\nabout: y\nquestion: []\nquestions: [{ask: a, do: b}]\n"
    )
    with pytest.raises(ScenarioError) as caught:
        load_lesson(str(file))
    told = str(caught.value)
    assert 'unknown key; did you mean "questions"?' in told
    assert "number: is required" in told
    assert f"{file}:5" in told


def test_the_rows_of_lessons_are_rows_of_the_textbook():
    text = (ROOT / "docs/textbook.md").read_text("utf-8")
    numbers = set(re.findall(r"^\| ([A-D]\d+) \|", text, re.MULTILINE))
    for name in SHIPPED:
        lesson, _ = load_lesson(name)
        assert lesson.rows and numbers.issuperset(lesson.rows)
