"""How the program of rerun is started and ended; other programs stand in for it."""

import json
import os
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from processes import wait_for
from rmrc.recording import viewer_process
from rmrc.recording.viewer_process import Events, Program, Stopped, listening_to_signals

# Starts a process of its own, as rerun's launcher does. Neither ends when it is asked politely.
STUBBORN = """
import signal, subprocess, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
open(sys.argv[1], "w").write(f"{child.pid}\\n")
time.sleep(600)
"""

# Does what the viewer does: asks another machine, in the way of its environment.
ASKS = """
import json, os, sys, urllib.request
try:
    urllib.request.urlopen("https://api.github.example/", timeout=20)
    said = "answered"
except OSError as error:
    said = str(error)
json.dump([said, dict(os.environ)], open(sys.argv[1], "w"))
"""


@pytest.fixture
def rerun(monkeypatch):
    """Return a function that has a text of Python stand in for rerun."""
    return lambda code: monkeypatch.setattr(viewer_process, "RERUN", (sys.executable, "-c", code))


def is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def grandchild(path):
    """Return the process that STUBBORN started, once it runs."""
    wait_for(lambda: path.is_file() and path.read_text().endswith("\n"))
    return int(path.read_text())


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("second", [True, False], ids=["a second signal", "no second signal"])
def test_who_does_not_end_is_ended(rerun, monkeypatch, tmp_path, second):
    monkeypatch.setattr(viewer_process, "GRACE", 60 if second else 0.1)
    rerun(STUBBORN)
    events, begin = Events(), time.monotonic()
    with Program([str(tmp_path / "pid")], events) as program:
        child = grandchild(tmp_path / "pid")
        events.note_signal(signal.SIGTERM)
        with pytest.raises(Stopped) as caught:
            program.wait()
        if second:
            threading.Timer(0.1, events.note_signal, [signal.SIGINT]).start()
    assert caught.value.code == 143  # that of the first signal
    assert program.has_ended
    wait_for(lambda: not is_alive(child))
    assert time.monotonic() - begin < 30  # half of the time that the second one cuts short


def test_the_way_out_is_a_dead_end(rerun, monkeypatch, tmp_path):
    for name in ("https_proxy", "ALL_PROXY", "no_proxy", "NO_PROXY"):
        monkeypatch.setenv(name, "github.example")
    rerun(ASKS)
    path = tmp_path / "said.json"
    with Program([str(path)], Events()) as program:
        assert program.wait() == 0
    said, environment = json.loads(path.read_text())
    assert "refused" in said.lower()
    found = {name.lower(): value for name, value in environment.items() if name.lower().endswith("_proxy")}
    assert set(found) == {"all_proxy", "http_proxy", "https_proxy"}
    assert {value.rpartition(":")[0] for value in found.values()} == {"http://127.0.0.1"}
    assert environment["CI"] == "1"


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_a_signal_waits_to_be_looked_at(number, code):
    before = [signal.getsignal(one) for one in viewer_process.STOPS]
    with listening_to_signals() as events:
        events.raise_if_stopped()
        os.kill(os.getpid(), number)  # raises nothing here
        with pytest.raises(Stopped) as caught:
            events.wait_for_signal()
        assert caught.value.code == code
    assert [signal.getsignal(one) for one in viewer_process.STOPS] == before


def test_a_program_that_ends_tells_its_code(rerun):
    rerun("raise SystemExit(7)")
    with Program([], Events()) as program:
        assert program.wait() == 7
        assert program.wait() == 7  # as often as it is asked
