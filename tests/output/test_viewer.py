import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
import rerun as rr

from rmrc.output.viewer import ViewerError, repair, replay


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("viewer") / "run.rrd"
    stream = rr.RecordingStream("test")
    stream.save(path)
    stream.log("text", rr.TextDocument("hello"), static=True)
    stream.disconnect()
    return path


@pytest.fixture
def no_display(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)


def message(path, web=False):
    with pytest.raises(ViewerError) as caught:
        replay(path, web)
    return str(caught.value)


def test_a_missing_recording_is_one_line_that_names_what_is_near(recording):
    wrong = recording.with_name("runn.rrd")
    assert message(wrong) == f'{wrong}: no such recording; did you mean "run.rrd"?'
    nowhere = recording.parent / "nowhere" / "x.rrd"
    assert message(nowhere) == f"{nowhere}: no such recording"


def test_another_file_is_refused(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("notes")
    assert message(path) == f"{path}: is not a recording; `rmrc run` writes them, ending in .rrd"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have a display")
@pytest.mark.usefixtures("no_display")
def test_without_a_display_the_message_names_web(recording):
    expected = f"there is no display to open the viewer on; use: rmrc replay --web {recording}"
    assert message(recording) == expected


def test_what_cannot_be_repaired_is_one_line(recording, tmp_path):
    with pytest.raises(ViewerError) as caught:
        repair(recording, tmp_path / "no such folder" / "run.rrd")
    text = str(caught.value)
    assert text.startswith(f"{recording}: cannot be repaired: ")
    assert "\n" not in text


def descendants(pid):
    """Processes that a process started, and what those started; zombies left out."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # ended in the meantime
            state, parent = stat.read_text().rpartition(")")[2].split()[:2]
            if state != "Z":
                parents[int(stat.parent.name)] = int(parent)
    found = [pid]
    for one in found:
        found += [child for child, parent in parents.items() if parent == one]
    return found[1:]


def listening(pid):
    """(address, port) of every socket on which a descendant of a process listens."""
    inodes = set()
    for one in descendants(pid):
        for link in Path(f"/proc/{one}/fd").glob("*"):
            with contextlib.suppress(OSError):
                inodes.add(os.readlink(link).removeprefix("socket:[").removesuffix("]"))
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in inodes:  # listening
                address, port = fields[1].split(":")
                known = {"0100007F": "127.0.0.1"}  # in the byte order of the machine
                found.add((known.get(address, address), int(port, 16)))
    return found


def wait_for(condition):
    for _ in range(300):
        found = condition()
        if found:
            return found
        time.sleep(0.1)
    raise AssertionError("not within 30 s")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("suffix", ["", ".part"])
def test_web_listens_on_the_loopback_alone_and_leaves_no_process(recording, tmp_path, number, suffix):
    path = Path(f"{tmp_path}/run.rrd{suffix}")
    path.write_bytes(recording.read_bytes())
    code = f"from rmrc.output.viewer import *; raise SystemExit(replay(Path({str(path)!r}), web=True))"
    # A home of its own shows that the user's settings are left alone.
    home = tmp_path / "home"
    home.mkdir()
    environment = {**os.environ, "HOME": str(home), "TMPDIR": str(tmp_path)}
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=environment
    )
    try:
        url = process.stdout.readline().strip()
        page = int(url.removeprefix("http://127.0.0.1:").partition("?")[0])
        wait_for(lambda: len(listening(process.pid)) >= 2)
        found = listening(process.pid)
        assert {address for address, _ in found} == {"127.0.0.1"}
        assert page in {port for _, port in found}
        data = next(port for _, port in found if port != page)
        assert url == f"http://127.0.0.1:{page}?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A{data}%2Fproxy"
        with socket.create_connection(("127.0.0.1", page), 5) as client:
            client.sendall(b"GET / HTTP/1.0\r\n\r\n")
            assert client.recv(15) == b"HTTP/1.0 200 OK"
        family = descendants(process.pid)
        assert len(family) >= 2  # the launcher and the viewer
        process.send_signal(number)
        assert process.wait(20) == 130
        wait_for(lambda: not any(Path(f"/proc/{one}/fd/0").exists() for one in family))
        assert list(home.rglob("analytics*")) == []
        assert list(tmp_path.glob("rmrc-*")) == []
    finally:
        for one in [*descendants(process.pid), process.pid]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(one, signal.SIGKILL)
        process.wait()
        process.stdout.close()
