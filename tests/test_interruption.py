"""Signals: the first stops what goes on and keeps it, the second ends the process, ignored ones stay ignored."""

import signal
import subprocess
import sys
import time

import pytest

from processes import TELLS_OF_TICKS
from project import ROOT
from rmrc.support.process import interruptible, signal_that_came, stops_like_ctrl_c

ALL = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]

# One tick is 100 000 steps, half a second and more; all of it would take half an hour.
HARD = f"""
name: hard
arm: {{model: {ROOT}/models/planar_2link.xml, site: tip, start: [60 deg, -120 deg]}}
task: {{axes: [x, y]}}
target: {{path: [{{hold: {{for: 300}}}}]}}
control: {{period: 1.0}}
plant: {{timestep: 1.0e-5}}
"""

# 0.2 to 0.5 s are measured on a quiet machine; ours may be slow, and busy with other tests.
PATIENCE = 10.0


@pytest.fixture
def hard(tmp_path):
    (tmp_path / "hard.yaml").write_text(HARD)
    return tmp_path


def start(folder, *arguments, code="from rmrc.cli import main; main()", **options):
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments], cwd=folder,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options,
    )  # fmt: skip


def wait_for_ticks(process):
    """Wait until the first piece of ticks is done, and a long tick is under way."""
    assert process.stdout.readline() == "moves\n", process.communicate()
    time.sleep(0.2)


def ended(process, number):
    """Send a signal; return how the process ended, what it said on stderr, and how long it took [s]."""
    sent = time.monotonic()
    process.send_signal(number)
    _, err = process.communicate(timeout=240)
    return process.returncode, err, time.monotonic() - sent


@pytest.mark.parametrize("number", ALL)
def test_each_signal_sets_the_event_and_only_in_a_process_that_it_ends(number):
    before = {one: signal.getsignal(one) for one in ALL}
    with stops_like_ctrl_c(), interruptible() as stop:
        assert not stop.is_set() and signal_that_came() is None
        signal.raise_signal(number)
        assert stop.is_set() and signal_that_came() == number
        # the next one is the system's, which ends the process
        assert {signal.getsignal(one) for one in ALL} == {signal.SIG_DFL}
    assert {one: signal.getsignal(one) for one in ALL} == before
    with interruptible() as stop:  # of a library: only Ctrl-C is its own to handle, and only once
        assert [signal.getsignal(one) == before[one] for one in ALL] == [False, True, True]
        signal.raise_signal(signal.SIGINT)
        assert stop.is_set()
        assert {one: signal.getsignal(one) for one in ALL} == before
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert {one: signal.getsignal(one) for one in ALL} == before


@pytest.mark.parametrize("number", ALL)
def test_outside_of_a_run_each_signal_is_a_keyboard_interrupt(number):
    with pytest.raises(KeyboardInterrupt), stops_like_ctrl_c():
        signal.raise_signal(number)
    assert signal_that_came() == number


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129)])
@pytest.mark.usefixtures("hard")
def test_what_a_verb_that_is_interrupted_elsewhere_exits_with(rmrc, monkeypatch, number, code):
    def interrupted(*_):
        signal.raise_signal(number)

    monkeypatch.setattr("rmrc.study.run.Job.compile", interrupted)
    *ended, err = rmrc("run", "hard.yaml")
    # its period of a second is warned of before
    assert (*ended, err.splitlines()[-1]) == (code, "", "rmrc: interrupted")
    monkeypatch.setattr("rmrc.study.run.draft_of", interrupted)
    assert rmrc("run", "hard.yaml") == (code, "", "rmrc: interrupted\n")


def test_nohup_stays_deaf_and_the_second_signal_does_not_wait(hard):
    saves = "lambda *_: print('saves', flush=True) or time.sleep(60)"
    process = start(
        hard, "run", "hard.yaml", "-q",
        "--set", "control.period=0.004", "--set", "plant.timestep=1.0e-4",  # 15 s
        code=f"import rmrc.results.run, time; rmrc.results.run.Run.save = {saves}\n{TELLS_OF_TICKS}",
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN),
    )  # fmt: skip
    wait_for_ticks(process)
    process.send_signal(signal.SIGHUP)
    process.send_signal(signal.SIGINT)
    # It saves for a minute. If it had heard the first signal, the second would have ended it.
    assert process.stdout.readline() == "saves\n"
    assert process.poll() is None
    returned, err, took = ended(process, signal.SIGTERM)
    said = [line for line in err.splitlines() if "compiling" not in line]
    assert (returned, said) == (-signal.SIGTERM, []) and took < PATIENCE
