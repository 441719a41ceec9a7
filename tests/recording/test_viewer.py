"""How `replay` opens a recording: on this machine alone, in one line where it cannot, and without a trace."""

import contextlib
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
import rerun as rr

from processes import descendants, started, wait_for
from rmrc.recording import viewer
from rmrc.recording.viewer import ViewerError, recording_of, replay
from rmrc.support.text import command
from wording import says

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("viewer") / "run.rrd"
    stream = rr.RecordingStream("test")
    stream.save(path)
    stream.log("text", rr.TextDocument("hello"), static=True)
    stream.disconnect()
    return path


@pytest.fixture
def rerun(monkeypatch):
    """Return a function that has a text of Python stand in for rerun, where there is a display."""
    monkeypatch.setenv("DISPLAY", ":0")
    return lambda code: monkeypatch.setattr(viewer, "RERUN", (sys.executable, "-c", code))


def message(path, **options):
    with pytest.raises(ViewerError) as caught:
        replay(path, **options)
    return str(caught.value)


# What is a recording ----------------------------------------------------------------------------


def test_a_folder_stands_for_its_newest_recording_and_columns_for_the_one_beside_them(recording, tmp_path):
    for age, name in enumerate(("new.rrd", "old.rrd")):
        (tmp_path / name).write_bytes(recording.read_bytes())
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    assert recording_of(tmp_path) == tmp_path / "new.rrd"
    assert recording_of(tmp_path / "old.npz") == tmp_path / "old.rrd"
    assert recording_of(tmp_path / "old.rrd") == tmp_path / "old.rrd"


def test_what_is_no_recording_is_one_line(recording, tmp_path):
    wrong, content = recording.with_name("runn.rrd"), recording.read_bytes()
    assert message(wrong) == says(f'{wrong}: … no such recording; … "run.rrd"…')
    assert message(tmp_path) == says(f"{tmp_path}/…: … no such recording; … writes them")
    assert message(tmp_path / "x.npz") == says(f"{tmp_path}/x.rrd: … no such recording; … writes them")
    path = tmp_path / "other.rrd"
    for text, told in (
        (b"notes", "is not a recording; …"),
        (b"", "is not a recording; …"),
        (b"RRF9" + content[4:], "is damaged, or of another version …; run its scenario again"),
        (content[:-40], "is damaged, or of another version …; run its scenario again"),
        (content[:5], "is damaged, or of another version …; run its scenario again"),
    ):
        path.write_bytes(text)
        assert message(path, web=True) == says(f"{path}: {told}")


# What cannot be shown ---------------------------------------------------------------------------


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have a display")
def test_without_a_display_the_message_names_web(recording, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    expected = f"no display is available for the viewer; use: rmrc replay --web {recording}"
    assert message(recording) == expected


def test_a_viewer_that_fails_is_one_line(recording, rerun):
    """Its exit code 1 must not be taken for a missed expectation."""
    rerun("raise SystemExit(1)")
    way = command("replay", "--web", recording)
    assert message(recording) == f"the viewer ended with exit code 1; use: {way}"
    assert message(recording, web=True) == says("rerun does not serve the page …")
    rerun("raise SystemExit(0)")
    assert replay(recording, at=1.0) is None  # closed before it had the recording


def test_a_port_that_is_taken_is_one_line(recording):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        told = message(recording, web=True, port=port)
    assert told == says(f"--port {port}: address already in use; give another, or none …")


# The program of rerun ---------------------------------------------------------------------------

# Starts a process of its own, as rerun's launcher does. Neither ends when it is asked politely.
STUBBORN = """
import os, signal, subprocess, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
open(os.environ["TOLD"], "w").write(f"{child.pid}\\n")
time.sleep(600)
"""

# Does what the viewer does: asks another machine, in the way of its environment.
ASKS = """
import json, os, sys, urllib.request
try:
    urllib.request.urlopen("https://api.github.example/", timeout=20)
    answer = "answered"
except OSError as error:
    answer = str(error)
json.dump([answer, sys.argv[1:], dict(os.environ)], open(os.environ["TOLD"], "w"))
"""


def is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_it_listens_here_alone_and_its_way_out_is_a_dead_end(rerun, monkeypatch, tmp_path):
    for name in ("https_proxy", "ALL_PROXY", "no_proxy", "NO_PROXY"):
        monkeypatch.setenv(name, "github.example")
    path = tmp_path / "told.json"
    monkeypatch.setenv("TOLD", str(path))
    rerun(ASKS)
    with viewer.program("--port", "1") as process:
        assert process.wait() == 0
    answer, arguments, environment = json.loads(path.read_text())
    assert "refused" in answer.lower()
    proxies = {name.lower(): value for name, value in environment.items() if name.lower().endswith("_proxy")}
    assert set(proxies) == {"all_proxy", "http_proxy", "https_proxy"}
    assert {value.rpartition(":")[0] for value in proxies.values()} == {"http://127.0.0.1"}
    assert environment["CI"] == "1"
    assert arguments == ["--bind", "127.0.0.1", "--port", "1"]


@linux
@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGTERM, 143), (signal.SIGINT, 130)],
)
def test_a_window_ends_with_all_its_processes_whatever_signal_comes(recording, tmp_path, number, code):
    program = f"""
import sys
from rmrc import cli
from rmrc.recording import viewer
viewer.RERUN = (sys.executable, "-c", {STUBBORN!r})
sys.argv = ["rmrc", "replay", {str(recording)!r}]
cli.main()
"""
    path = tmp_path / "told"
    environment = {**os.environ, "DISPLAY": ":0", "TOLD": str(path)}
    with started(
        [sys.executable, "-c", program], env=environment, stderr=subprocess.PIPE, text=True
    ) as process:
        wait_for(lambda: path.is_file() and path.read_text().endswith("\n"))
        children = descendants(process.pid)
        assert int(path.read_text()) in children
        process.send_signal(number)
        assert process.wait(20) == code
        assert process.stderr.read() == "rmrc: interrupted\n"
    wait_for(lambda: not any(map(is_alive, children)))


# The page ---------------------------------------------------------------------------------------


def listening(pid):
    """(address, port) of every socket on which a process or a descendant of it listens."""
    inodes = set()
    for some in [pid, *descendants(pid)]:
        for link in Path(f"/proc/{some}/fd").glob("*"):
            with contextlib.suppress(OSError):
                inodes.add(os.readlink(link).removeprefix("socket:[").removesuffix("]"))
    pairs = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in inodes:  # listening
                address, port = fields[1].split(":")
                known = {"0100007F": "127.0.0.1"}  # in the byte order of the machine
                pairs.add((known.get(address, address), int(port, 16)))
    return pairs


def get(port, path):
    """Return (status, headers, body) of a file of a server on the loopback."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    connection.request("GET", path)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


@linux
def test_web_listens_on_the_loopback_alone_and_leaves_nothing(recording, tmp_path):
    """A home of its own shows that the user's settings are left alone."""
    home = tmp_path / "home"
    home.mkdir()
    environment = {**os.environ, "HOME": str(home), "TMPDIR": str(tmp_path)}
    arguments = [sys.executable, "-m", "rmrc", "replay", "--web", str(recording)]
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as under `nohup`: the process inherits it
    try:
        with started(arguments, stdout=subprocess.PIPE, text=True, env=environment) as process:
            port = int(re.match(r"http://127\.0\.0\.1:(\d+)\?url=", process.stdout.readline())[1])
            # One server, ours: that of rerun, which has no policy, has ended before the address is told.
            assert listening(process.pid) == {("127.0.0.1", port)}
            assert descendants(process.pid) == []
            status, headers, page = get(port, "/")
            assert status == 200
            assert "connect-src 'self';" in headers["Content-Security-Policy"]
            assert b"the_canvas_id" in page
            assert not re.search(rb"<link[^>]*https?:", page)
            assert get(port, "/re_viewer_bg.wasm")[2].startswith(b"\0asm")
            assert get(port, "/recording.rrd")[2] == recording.read_bytes()
            process.send_signal(signal.SIGHUP)
            assert get(port, "/favicon.ico")[0] == 200
            process.send_signal(signal.SIGTERM)
            assert process.wait(20) == 143
    finally:
        signal.signal(signal.SIGHUP, before)
    assert list(home.rglob("analytics*")) == []
    assert list(tmp_path.glob("rmrc-*")) == []
