"""Hostile inputs end as documented; and every kind of fault that is planted is seen."""

import subprocess
import sys

import pytest

from . import inputs, planted, supervisor
from .__main__ import main


@pytest.mark.parametrize("count", [8, pytest.param(60, marks=pytest.mark.long)])
def test_inputs_end_as_documented(count):
    names = [("file", str(path)) for path in inputs.REGRESSIONS]
    names += [(name, index) for name in inputs.CLASSES for index in range(count)]
    answers = supervisor.answers(names)
    assert [(answer.name, answer.index, answer.faults) for answer in answers if answer.faults] == []
    assert len(answers) == len(names)
    for name in inputs.CLASSES:  # what is refused at its first line, always, tries nothing else
        codes = {answer.code for answer in answers if answer.name == name}
        assert "2" in codes and {"0", "1"} & codes


def test_every_planted_fault_is_seen_and_nothing_else(monkeypatch):
    monkeypatch.setattr(supervisor, "GRACE", 0.3)
    names = [("planted", fault) for fault in planted.FAULTS]
    answers = supervisor.answers(names, seconds=3.0, module="fuzz.planted")
    seen = {answer.index: [fault for fault, _ in answer.faults] for answer in answers}
    assert seen == {fault: [fault] if fault else [] for fault in planted.FAULTS}


@pytest.mark.parametrize("name", inputs.CLASSES)
def test_class_and_index_alone_decide_an_input_which_can_be_written_down(name):
    cases = [inputs.case(name, index) for index in range(50)]
    assert [inputs.read(case.text(origin="x")) for case in cases] == cases
    assert len({case.text() for case in cases}) > 45
    code = f"import sys; sys.path.insert(0, 'tests'); from fuzz import inputs; print(ascii(inputs.case({name!r}, 49)))"
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=inputs.ROOT, capture_output=True, text=True, check=True
    )
    assert ended.stdout.strip() == ascii(cases[49])


def test_replay_prints_an_input_and_what_came_of_it(capsys):
    assert main(["replay", "file", str(inputs.ROOT / "tests/fuzz/regressions/c1_in_joint.json")]) == 0
    printed = capsys.readouterr().out
    assert '"inspect"' in printed and "exit code" in printed
