"""Hostile inputs end as documented; and every fault that a judge must see is seen."""

import pytest

from . import inputs, worker

COUNT = 16


def test_inputs_and_those_that_once_failed_end_as_documented():
    names = [("file", str(path)) for path in inputs.REGRESSIONS]
    names += [(name, index) for name in inputs.CLASSES for index in range(COUNT)]
    answers = worker.answers(names)
    assert [(answer.name, answer.index, answer.faults) for answer in answers if answer.faults] == []
    assert len(answers) == len(names)
    for name in inputs.CLASSES:  # what is refused at its first line, always, tries nothing else
        codes = {answer.code for answer in answers if answer.name == name}
        assert "2" in codes and {"0", "1"} & codes


@pytest.mark.parametrize(
    ("fault", "changed"),
    [
        ([], {}),
        (["traceback"], {"error": "ValueError: a bug"}),
        (["traceback"], {"code": 1, "err": "Traceback (most recent call last)\n"}),
        (["exit code"], {"code": 9, "err": "x"}),
        (["silence"], {"code": 1, "out": ""}),
        (["control"], {"out": "\x1b[31m"}),
        (["nan"], {"out": "error nan m"}),
        (["warning"], {"warned": ["UserWarning: x"]}),
        (["file"], {"files": {"models/stray"}}),
        (["memory"], {"code": 1, "err": "rmrc: not enough memory for x"}),
    ],
)
def test_every_kind_of_fault_is_seen_and_nothing_else(fault, changed):
    outcome = worker.Outcome(0, "", "a table of nano and inf", "", [], {"here/recordings"})._replace(
        **changed
    )
    assert [word for word, _ in worker.judge(inputs.Case(("run", "x.yaml")), outcome)] == fault


@pytest.mark.parametrize("name", inputs.CLASSES)
def test_class_and_index_alone_decide_an_input_which_can_be_written_down(name):
    cases = [inputs.case(name, index) for index in range(50)]
    assert [inputs.read(inputs.case(name, index).text(origin="x")) for index in range(50)] == cases
    assert len({case.text() for case in cases}) > 45


def test_a_worker_that_does_not_answer_is_seen(monkeypatch):
    monkeypatch.setattr(worker, "SECONDS", 0.01)
    monkeypatch.setattr(worker, "GRACE", 0.01)
    (answer,) = worker.answers([("models", 0)])
    assert [word for word, _ in answer.faults] in (["hang"], ["death"])  # of Ctrl-C before it was ready
