"""Lessons: each can be explored, asks three questions, and the number to find is what its setting gives."""

import pytest

from project import mostly_long
from rmrc.cli.explore import LESSONS
from rmrc.explore import rows
from rmrc.explore.controls import controls, read_of
from rmrc.scenario.changes import changes_of
from rmrc.scenario.lesson import SHIPPED, load_lesson
from rmrc.study.study import Study
from rmrc.support.errors import QuestionError, ScenarioError
from wording import says


@pytest.mark.parametrize("name", mostly_long(sorted(SHIPPED), every=3))
def test_the_number_to_find_is_what_the_setting_gives_on_controls_of_the_page(name):
    lesson, _ = load_lesson(name)
    study, sought = Study(lesson.scenario), lesson.number
    written = study.prepare()
    (ran,) = study.step([written])
    found = {one.key: one for one in controls(written, ran.run)}
    shown = read_of({key: one.written for key, one in found.items()}, sought.given)
    assert set(sought.given) <= shown
    for key, value in sought.given.items():
        one = found[key]
        assert value in one.options if one.options else one.low <= value <= one.high
    (asked,) = study.step([study.prepare(changes_of(sought.given))])
    value, before = (one.scorecard[sought.figure].value / sought.per for one in (asked, ran))
    assert sought.is_met(f"{value:.4g}")
    assert not sought.is_met(f"{before:.4g}")  # to leave the page as it is finds nothing
    assert len(lesson.questions) == 3


def test_the_help_has_each_lesson():
    assert sorted(LESSONS) == sorted(SHIPPED)


@pytest.mark.parametrize(
    ("text", "is_met"), [("1.41", True), (" 1,42 ", True), ("1.5", False), ("", None), ("a", None)]
)
def test_an_answer_is_right_wrong_or_no_number(text, is_met):
    assert load_lesson("wrist")[0].number.is_met(text) is is_met


def test_a_name_of_no_lesson_is_told_with_those_that_there_are():
    with pytest.raises(QuestionError) as caught:
        load_lesson("reech")
    assert str(caught.value) == says('--lesson … "reech"; … "reach"…')


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


def test_a_lesson_or_something_to_explore_but_not_both(rmrc):
    pytest.importorskip("viser")
    for arguments in ([], ["line_tracking", "--lesson", "reach"]):
        assert rmrc("explore", *arguments) == (2, "", says("rmrc: error: … --lesson …\n"))


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_the_rows_of_a_lesson_are_rows_of_the_textbook(name):
    lesson, _ = load_lesson(name)
    assert lesson.rows
    assert set(lesson.rows) <= rows.rows().keys()
    assert all(f"[{key}]" in rows.links(lesson.scenario, lesson.rows) for key in lesson.rows)
