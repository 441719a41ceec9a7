import contextlib
import http.client
import os
import re
import resource
import signal
import socket
import subprocess
import sys
from pathlib import Path
from urllib.parse import quote

import pytest
import rerun as rr
from rerun.chunk import RrdReader

from processes import descendants, started
from project import mostly_long
from rmrc.recording import viewer_process
from rmrc.recording.viewer import ViewerError, is_torn, recording_of, repair, replay
from rmrc.support.invocation import command
from wording import says


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
    assert message(wrong) == says(f'{wrong}: … recording; … "run.rrd"…')
    nowhere = recording.parent / "nowhere" / "x.rrd"
    assert message(nowhere) == says(f"{nowhere}: … recording")


def test_another_file_is_refused(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("notes")
    assert message(path) == f"{path}: is not a recording; `rmrc run` writes them, ending in .rrd"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have a display")
@pytest.mark.usefixtures("no_display")
def test_without_a_display_the_message_names_web(recording):
    expected = f"no display is available for the viewer; use: rmrc replay --web {recording}"
    assert message(recording) == expected


def test_what_cannot_be_repaired_is_one_line(recording, tmp_path):
    with pytest.raises(ViewerError) as caught:
        repair(recording, tmp_path / "no such folder" / "run.rrd")
    text = str(caught.value)
    assert text.startswith(f"{recording}: cannot be repaired: ")
    assert "\n" not in text


def listening(pid):
    """(address, port) of every socket on which a process or a descendant of it listens."""
    inodes = set()
    for one in [pid, *descendants(pid)]:
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


def get(port, path):
    """Return (status, headers, body) of a file of a server on the loopback."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    connection.request("GET", path)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


@contextlib.contextmanager
def served(path, folder):
    """Serve a recording in a process of its own, which has a home and a folder for temporary files."""
    code = f"from rmrc.recording.viewer import *; raise SystemExit(replay(Path({str(path)!r}), web=True))"
    home = folder / "home"
    home.mkdir()
    environment = {**os.environ, "HOME": str(home), "TMPDIR": str(folder)}
    with started([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=environment) as process:
        url = process.stdout.readline().strip()
        yield process, url, int(url.removeprefix("http://127.0.0.1:").partition("?")[0])


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize(
    ("suffix", "number", "code"),
    mostly_long([("", signal.SIGINT, 130), (".part", signal.SIGTERM, 143), ("", signal.SIGHUP, 129)], 3),
)
def test_web_listens_on_the_loopback_alone_and_leaves_no_process(recording, tmp_path, suffix, number, code):
    path = Path(f"{tmp_path}/run.rrd{suffix}")
    path.write_bytes(recording.read_bytes())
    with served(path, tmp_path) as (process, url, port):
        shown = quote(f"http://127.0.0.1:{port}/recording.rrd", safe="")
        assert url == f"http://127.0.0.1:{port}?url={shown}&hide_welcome_screen"
        # One server, ours: that of rerun, which has no policy, has ended before the address is told.
        assert listening(process.pid) == {("127.0.0.1", port)}
        assert descendants(process.pid) == []
        status, headers, page = get(port, "/")
        assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
        assert "connect-src 'self';" in headers["Content-Security-Policy"]
        assert b"the_canvas_id" in page
        assert not re.search(rb"<link[^>]*https?:", page)
        assert get(port, "/re_viewer_bg.wasm")[2].startswith(b"\0asm")
        if not suffix:  # the repaired one has other bytes
            assert get(port, "/recording.rrd")[2] == recording.read_bytes()
        assert get(port, "/recording.rrd")[2].startswith(b"RRF")
        process.send_signal(number)
        assert process.wait(20) == code
        # A home of its own shows that the user's settings are left alone.
        assert list((tmp_path / "home").rglob("analytics*")) == []
        assert list(tmp_path.glob("rmrc-*")) == []


@pytest.mark.long  # tests/test_interruption.py says the same of a run
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_an_ignored_hangup_stays_ignored(recording, tmp_path):
    """As under `nohup`."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the process that is started inherits it
    try:
        with served(recording, tmp_path) as (process, _, port):
            process.send_signal(signal.SIGHUP)
            assert get(port, "/favicon.ico")[0] == 200
            process.send_signal(signal.SIGTERM)
            assert process.wait(20) == 143
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_viewer_that_fails_is_one_line(recording, monkeypatch):
    """Its exit code 1 must not be taken for a missed expectation."""
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(viewer_process, "RERUN", (sys.executable, "-c", "raise SystemExit(1)"))
    expected = f"the viewer ended with exit code 1; use: {command('replay', '--web', recording)}"
    assert message(recording) == expected


def test_a_page_that_is_not_served_is_one_line(recording, monkeypatch):
    fails = "import sys; print('no\\nport', file=sys.stderr)"
    monkeypatch.setattr(viewer_process, "RERUN", (sys.executable, "-c", fails))
    assert message(recording, web=True) == "rerun does not serve its viewer: no port"


# What stands for a recording, and what is damaged -----------------------------------------------------


def test_a_folder_stands_for_its_newest_recording_and_columns_for_the_one_beside_them(recording, tmp_path):
    for age, name in enumerate(("new.rrd", "old.rrd.part", "older.rrd")):
        (tmp_path / name).write_bytes(recording.read_bytes())
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    assert recording_of(tmp_path) == tmp_path / "new.rrd"
    (tmp_path / "new.npz").touch()
    assert recording_of(tmp_path / "new.npz") == tmp_path / "new.rrd"
    assert recording_of(tmp_path / "none.rrd") == tmp_path / "none.rrd"
    (tmp_path / "alone.npz").touch()  # its recording is made anew, which is the verb's
    assert recording_of(tmp_path / "alone.npz") == tmp_path / "alone.npz"
    (tmp_path / "empty").mkdir()
    assert message(tmp_path / "empty") == says(f"{tmp_path}/empty: has no recordings; …")


def test_a_torn_recording_is_known_and_what_is_good_of_it_is_kept(recording, tmp_path):
    torn, whole = tmp_path / "torn.rrd", tmp_path / "whole.rrd"
    torn.write_bytes(recording.read_bytes()[:-40])
    assert is_torn(torn)
    assert not is_torn(recording)
    repair(torn, whole)
    assert not is_torn(whole)
    assert {chunk.entity_path for chunk in RrdReader(whole).stream()} >= {"/text"}


def test_a_wrong_head_and_a_file_with_nothing_good_are_one_line_each(recording, tmp_path):
    wrong = tmp_path / "wrong.rrd"
    wrong.write_bytes(b"RRF9" + recording.read_bytes()[4:])
    assert message(wrong) == says(f'{wrong}: begins with "RRF9", not "RRF2": …; run its scenario again')
    wrong.write_bytes(recording.read_bytes()[:4] + bytes(range(256)) * 40)
    assert message(wrong, web=True) == says(f"{wrong}: cannot be repaired: …")


def test_a_port_that_is_taken_is_one_line(recording):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ViewerError) as caught:
            replay(recording, web=True, port=port)
    assert str(caught.value) == says(f"--port {port}: …; give another, or none …")


@pytest.mark.parametrize("share", [0.001, 0.02, 0.3, 0.9, 0.9999])
def test_a_recording_cut_anywhere_is_repaired_or_told_in_a_line_within_five_seconds(
    recording, tmp_path, share
):
    """Of processor time, which other programs do not lengthen."""
    torn, whole = tmp_path / "torn.rrd", tmp_path / "whole.rrd"
    content = recording.read_bytes()
    torn.write_bytes(content[: max(4, int(share * len(content)))])
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert is_torn(torn)
    try:
        repair(torn, whole)
        assert whole.stat().st_size > 0
    except ViewerError as error:
        assert str(error) == says(f"{torn}: cannot be repaired: …")  # noqa: PT017 - either is right
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 5.0
