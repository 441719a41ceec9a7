"""Who is asked for what while somebody looks at a recording: a real browser, and the system calls of the viewer.

The browser lets nothing out, whatever a page does: every name but 127.0.0.1 is unknown to it.
"""

import json
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from urllib.parse import urlsplit

import matplotlib.image
import numpy as np
import pytest

from browsers import PATIENCE, chromium
from processes import descendants, started, wait_for
from project import ROOT
from rmrc.recording.viewer import _free_port, _page_files
from rmrc.recording.viewer_page import PAGE, PageServer

pytestmark = pytest.mark.browser

SCENARIO = str(ROOT / "scenarios" / "approach_singularity.yaml")
# Chromium itself asks Google for updates, accounts and the meaning of forms, whatever page it shows.
CHROMIUMS_OWN = re.compile(r"(?!fonts\.)([\w-]+\.)?(google|googleapis|gvt1)\.com")

# Small, because every frame is painted by the processor.
VIEWPORT = {"width": 640, "height": 448}

# Pixels. While nothing is loaded there is no green, and a warning of 250 in orange; arm, ellipsoids, curves and
# status of a run give more of each. Blue is no sign: the bar of what is being loaded has 4300.
GREEN, ORANGE = 500, 400


@dataclass
class Look:
    """What a browser asked for, and showed, while it was at an address."""

    sent: list[str] = field(default_factory=list)  # addresses, also those that nobody answered
    refused: list[str] = field(default_factory=list)  # by the policy, before anything was sent
    picture: np.ndarray | None = None

    @property
    def hosts(self):
        return {urlsplit(url).hostname for url in self.sent} - {None}  # data: and blob: have none

    @property
    def colors(self):
        """How many pixels are green, and how many orange."""
        r, g, b = np.moveaxis(self.picture[:, :, :3], 2, 0)
        orange = (r - b > 0.5) & (g > 0.4 * r) & (g < 0.85 * r)
        return [int(those.sum()) for those in (g - np.maximum(r, b) > 0.15, orange)]

    @property
    def shows_a_recording(self):
        if self.picture is None:
            return False
        return all(np.greater(self.colors, (GREEN, ORANGE)))


def look(browser, url, ready, seconds=1.0, act=lambda _page: None):
    """Look at an address until something holds of the picture, and some seconds longer."""
    seen = Look()
    context = browser.new_context(viewport=VIEWPORT)
    context.on("request", lambda request: seen.sent.append(request.url))
    context.set_default_timeout(PATIENCE)
    page = context.new_page()
    page.add_init_script(
        "addEventListener('securitypolicyviolation', e => (window.refused ??= []).push(e.blockedURI))"
    )
    page.goto(url, wait_until="commit")
    until = time.monotonic() + PATIENCE / 1000
    while time.monotonic() < until and not ready(seen):
        page.wait_for_timeout(250)
        seen.picture = matplotlib.image.imread(BytesIO(page.screenshot()))
    act(page)
    page.wait_for_timeout(1000 * seconds)
    seen.picture = matplotlib.image.imread(BytesIO(page.screenshot()))
    seen.refused = page.evaluate("window.refused ?? []")
    context.close()
    return seen


def hosts_of_network(netlog):
    """Return the hosts that the network of a browser was to reach, but for those that it asks by itself.

    The log is written below everything that a page can do, and has no requests that a policy stopped.
    """
    log = json.loads(netlog.read_text())
    found = set()
    for event in log["events"]:
        parameters = event.get("params", {})
        for name in ("url", "host", "group_id"):
            for url in re.findall(r"(?:https?|wss?)://([\w.-]+)", str(parameters.get(name, ""))):
                found.add(url)
    return {host for host in found if not CHROMIUMS_OWN.fullmatch(host)}


@contextmanager
def replayed(path, *options):
    """Yield the address that `replay --web` of a recording prints."""
    command = [sys.executable, "-m", "rmrc", "replay", "--web", *options, str(path)]
    with started(command, stdout=subprocess.PIPE, text=True) as process:
        yield process.stdout.readline().strip()
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 143


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """The recording of a run, as the command line leaves it."""
    folder = tmp_path_factory.mktemp("browser")
    shorter = ["--set", "target.path=[{line: {to: [1.9, 0.0]}}]", "--set", "control.period=0.01"]
    verb = ["run", SCENARIO, "--out", str(folder), "--quiet", *shorter]
    with started([sys.executable, "-m", "rmrc", *verb]) as process:
        assert process.wait(600) == 0  # in a new clone it compiles the law
    return folder / "approach_singularity.rrd"


@pytest.fixture(scope="module")
def without_policy(tmp_path_factory):
    """The viewer's page without a recording, as rerun serves it: what the other tests would see if we did nothing."""
    netlog = tmp_path_factory.mktemp("without") / "net.json"
    with PageServer(files := _page_files(), ROOT / "none.rrd", 0, None) as server:
        Path(server.folder, PAGE).write_bytes(files[PAGE])
        server.policy = "default-src * data: blob: 'unsafe-inline' 'unsafe-eval'"
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        with chromium(f"--log-net-log={netlog}") as browser:
            seen = look(
                browser,
                f"http://127.0.0.1:{server.server_port}/?hide_welcome_screen",
                lambda look: "https://tel.rerun.io/api/pog" in look.sent,
            )
        server.shutdown()
        thread.join()
    return seen, hosts_of_network(netlog)


@pytest.mark.long
def test_without_our_policy_the_page_asks_others(without_policy):
    """So the tests below can fail."""
    seen, hosts = without_policy
    foreign = {"tel.rerun.io", "api.github.com", "fonts.googleapis.com"}
    assert foreign <= seen.hosts
    assert foreign <= hosts
    assert np.ptp(seen.picture) > 0.5  # the viewer is there, with letters
    assert all(np.less(seen.colors, (GREEN / 2, ORANGE)))


def test_the_page_shows_the_recording_and_asks_this_machine_only(recording, tmp_path):
    netlog = tmp_path / "net.json"
    with chromium(f"--log-net-log={netlog}") as browser, replayed(recording) as url:
        seen = look(browser, url, lambda look: look.shows_a_recording)
    assert seen.shows_a_recording
    assert seen.hosts == {"127.0.0.1"}
    assert hosts_of_network(netlog) == {"127.0.0.1"}
    assert any(url.endswith("/recording.rrd") for url in seen.sent)
    # It did try, and the policy refused: the test looked long enough.
    assert any("tel.rerun.io" in url for url in seen.refused)


def test_a_page_stands_still_at_the_time_that_it_is_told(recording):
    """The state of the viewer, of its protocol, has the nanoseconds as a varint, and so it stays."""
    states = []

    def read(page):
        for _ in range(2):
            page.wait_for_timeout(3000)
            states.append(bytes(page.evaluate("Array.from(_handle.viewer_state())")))

    with chromium() as browser, replayed(recording, "--at", "1.25") as url:
        look(browser, url, lambda look: look.shows_a_recording, 0.0, read)
    digits = bytes([0x80, 0xF9, 0x85, 0xD4, 0x04])
    assert sum((digit & 127) << 7 * i for i, digit in enumerate(digits)) == 1_250_000_000
    assert all(digits in state for state in states)


# The same of the programs, by their system calls -------------------------------------------------


@contextmanager
def traced(command, log, **options):
    """Run a command under strace, which writes down whom it connects to and what it sends."""
    if not shutil.which("strace"):
        pytest.skip("there is no strace here; `.ci/run browser` installs it")
    if subprocess.run(["strace", "-o", log, "true"], capture_output=True, check=False).returncode:
        pytest.skip("strace may not trace here")
    calls = "trace=connect,sendto,sendmsg,sendmmsg"
    tracing = ["strace", "-I2", "-f", "-s", "200", "-e", calls, "-o", str(log)]
    with started([*tracing, *command], text=True, **options) as strace:
        yield strace


def addresses(log):
    """Return (address, port) of every internet address that a system call of a log names."""
    text = log.read_text(errors="replace")
    four = re.findall(r'AF_INET, sin_port=htons\((\d+)\), sin_addr=inet_addr\("([^"]+)"\)', text)
    six = re.findall(r'AF_INET6, sin6_port=htons\((\d+)\).*?inet_pton\(AF_INET6, "([^"]+)"', text)
    return {(address, int(port)) for port, address in four + six}


def foreign(log):
    """Return those that are not of this machine, and those that are asked for names, wherever they are."""
    local = re.compile(r"127\.\d+\.\d+\.\d+|::1|::ffff:127\.\d+\.\d+\.\d+")
    return {(address, port) for address, port in addresses(log) if port == 53 or not local.fullmatch(address)}


def test_a_trace_shows_whom_a_program_connects_to(tmp_path):
    """So the tests below can fail. Connecting a datagram socket sends nothing; the addresses are for documents."""
    code = """
import socket
for kind, address in ((socket.AF_INET, "192.0.2.1"), (socket.AF_INET6, "2001:db8::1"), (socket.AF_INET, "127.0.0.1")):
    try:
        socket.socket(kind, socket.SOCK_DGRAM).connect((address, 9))
    except OSError:
        pass  # no route; it was tried all the same
"""
    with traced([sys.executable, "-c", code], tmp_path / "log") as process:
        assert process.wait(60) == 0
    assert foreign(tmp_path / "log") >= {("192.0.2.1", 9)}
    assert ("127.0.0.1", 9) in addresses(tmp_path / "log") - foreign(tmp_path / "log")


def end(strace):
    """End what strace runs by SIGTERM, and return its exit code."""
    child = min(one for one in descendants(strace.pid))
    subprocess.run(["kill", "-TERM", str(child)], check=True)
    return strace.wait(30)


def test_what_serves_a_recording_connects_to_this_machine_only(recording, tmp_path):
    command = [sys.executable, "-m", "rmrc", "replay", "--web", str(recording)]
    with traced(command, tmp_path / "log", stdout=subprocess.PIPE) as strace:
        assert strace.stdout.readline().startswith("http://127.0.0.1:")
        assert end(strace) == 143
    assert addresses(tmp_path / "log") != set()  # the files of the page come over the loopback
    assert foreign(tmp_path / "log") == set()


@pytest.fixture
def display():
    """A screen that nobody sees."""
    if not shutil.which("Xvfb"):
        pytest.skip("there is no Xvfb here; `.ci/run browser` installs it")
    command = ["Xvfb", "-displayfd", "1", "-screen", "0", "1000x700x24", "-nolisten", "tcp"]
    with started(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        yield f":{server.stdout.readline().strip()}"


@pytest.mark.long  # a page stands for it
def test_a_window_stands_still_at_the_time_that_it_is_told(recording, display, tmp_path, monkeypatch):
    from rerun.experimental import ViewerClient

    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    port, states = str(_free_port()), []

    def has_come():
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            states.extend((one.current_timeline, one.current_time) for one in client.get_state().recordings)
        except (OSError, RuntimeError):  # it does not listen yet
            return process.poll() is not None
        return states[-1:] == [("sim_time", 1_250_000_000)]

    command = [sys.executable, "-m", "rmrc", "replay", "--at", "1.25", "--port", port, str(recording)]
    with started(command, stderr=subprocess.PIPE, text=True) as process:
        wait_for(has_come, 60)
        if process.poll() == 2:
            pytest.skip(f"the viewer opens no window here: {process.stderr.read().splitlines()[-1]}")
        time.sleep(1.0)
        assert has_come()  # it does not play on
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 143


def test_the_window_connects_to_this_machine_only(recording, display, tmp_path, monkeypatch):
    """The viewer asks GitHub for its latest release, and must not come through."""
    monkeypatch.setenv("DISPLAY", display)
    log, said = tmp_path / "log", tmp_path / "said"
    command = [sys.executable, "-m", "rmrc", "replay", str(recording)]
    with said.open("w") as err, traced(command, log, stderr=err) as strace:
        # Its own data, and the way out that leads nowhere.
        wait_for(lambda: strace.poll() is not None or len(addresses(log)) >= 2, 60)
        if strace.poll() == 2:
            pytest.skip(f"the viewer opens no window here: {said.read_text().splitlines()[-1]}")
        wait_for(lambda: re.search(r"ECONNREFUSED", log.read_text(errors="replace")))
        assert strace.poll() is None
        assert end(strace) == 143
    assert foreign(log) == set()
    assert "github" not in log.read_text(errors="replace")
