"""The verb `margins`: tables, JSON, exit codes, and what is refused in a line."""

import os
import signal

import pytest

from project import ROOT
from rmrc.study.study import Study
from rmrc.textbook.stability import edge_delay
from wording import says

TEXT = f"""
name: quick
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [30 deg, 60 deg]}}
task: {{axes: [x, y]}}
control: {{period: 0.02, feedback: 5, inverse: {{method: inverse}}}}
target: {{path: [{{line: {{by: [0.05, 0.0]}}}}]}}
plant: {{kind: ideal}}
"""
COARSE = ("--accuracy", "0.2")


@pytest.fixture(autouse=True)
def quick(tmp_path):
    (tmp_path / "quick.yaml").write_text(TEXT)


def lines_of(text):
    return [" ".join(line.split()) for line in text.splitlines() if line.strip()]


def test_it_prints_what_the_loop_bears_beside_the_rule_and_the_ideal_plant(rmrc):
    code, out, err = rmrc("margins", "quick.yaml", *COARSE)
    assert (code, err) == (0, "")
    lines = lines_of(out)
    assert lines[0] == says("quick: stability margins, … runs")
    assert "as written stable" in lines
    assert "rule: K up to 1/(delay + T/2 + lag) 100 1/s" in lines
    assert "limit of the ideal plant, K 100 1/s" in lines
    rows = {line.split(",")[0]: line for line in lines}
    assert rows["gain"].endswith(" 20.00 20.00 1")
    assert float(rows["delay"].split()[2]) == pytest.approx(edge_delay(5.0, 0.02), rel=0.1)
    assert rows["delay"].endswith(" 0.1900 s")
    assert rows["lag"].startswith("lag, more > ") and " any " in rows["lag"]
    assert lines[-1] == says('">": stable in all runs; … lag …')


def test_a_loop_that_is_unstable_as_written_gives_exit_code_1(rmrc):
    late = ("--set", "plant.delay=0.1", "--set", "control.feedback=40")
    code, out, err = rmrc("margins", "quick.yaml", *late, *COARSE)
    assert code == 1
    assert err == says("rmrc: the loop is unstable as written: it … stable with control.feedback up to …\n")
    lines = lines_of(out)
    assert any(line.startswith("as written keeps ringing") for line in lines)
    assert not any(line.startswith(("delay, more", "lag, more")) for line in lines)
    assert rmrc("margins", "quick.yaml", *late, *COARSE, "--quiet") == (1, "", err)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--accuracy", "nan"], "--accuracy: must be between 0.005 and 0.5, got nan"),
        (["--set", "control.feedback=0"], "--set control.feedback: must be > 0, got 0: …"),
        (["--set", "plant.delay=-1"], "--set plant.delay: … -1"),
    ],
)
def test_bad_input_is_a_line(rmrc, options, line):
    code, out, err = rmrc("margins", "quick.yaml", *options)
    assert (code, out, err) == (2, "", says(f"rmrc: error: {line}\n"))


def test_interrupted_it_shows_what_was_found(rmrc, monkeypatch):
    prepare, worlds = Study.prepare, []

    def stopped(study, changes=()):
        worlds.append(prepare(study, changes))
        if len(worlds) == last:
            os.kill(os.getpid(), signal.SIGINT)
        return worlds[-1]

    monkeypatch.setattr(Study, "prepare", stopped)
    last = 6
    code, out, err = rmrc("margins", "quick.yaml", "--accuracy", "0.005")
    assert (code, err) == (130, says("rmrc: interrupted after … runs\n"))
    assert "Interrupted: the limits have the precision reached until then." in " ".join(out.split())
    assert any(line.startswith("gain, times") for line in lines_of(out))
