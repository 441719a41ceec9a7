"""Who is asked for what while somebody looks at a recording: a real browser, and the system calls of the viewer.

The browser lets nothing out, whatever a page does: every name but 127.0.0.1 is unknown to it.
"""

import json
import re
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

from browsers import PATIENCE, chromium
from processes import descendants, started, wait_for
from project import ROOT

pytestmark = pytest.mark.browser

SCENARIO = str(ROOT / "scenarios" / "approach_singularity.yaml")
# Chromium itself asks Google for updates, accounts and the meaning of forms, whatever page it shows.
CHROMIUMS_OWN = re.compile(r"(?!fonts\.)([\w-]+\.)?(google|googleapis|gvt1)\.com")
# Small, because every frame is painted by the processor.
VIEWPORT = {"width": 640, "height": 448}


def looked_at(url, is_ready, netlog):
    """Look at an address until something holds of the page and of what was asked for, and a second longer.

    Returns what the page asked for, what the policy refused, the state of the viewer as bytes of its protocol, and
    the hosts that the network was to reach, but for those that Chromium asks by itself. The log of the network is
    written below everything that a page can do, and has no requests that a policy stopped.
    """
    sent = []
    with chromium(f"--log-net-log={netlog}") as browser:
        page = browser.new_context(viewport=VIEWPORT).new_page()
        page.set_default_timeout(PATIENCE)
        page.on("request", lambda request: sent.append(request.url))
        page.add_init_script(
            "addEventListener('securitypolicyviolation', e => (window.refused ??= []).push(e.blockedURI))"
        )
        page.goto(url, wait_until="commit")

        def state():
            page.wait_for_timeout(250)
            return bytes(page.evaluate("window._handle ? Array.from(_handle.viewer_state()) : []"))

        wait_for(lambda: is_ready(state(), sent), PATIENCE / 1000)
        page.wait_for_timeout(1000)
        last, refused = state(), page.evaluate("window.refused ?? []")
    hosts = set()
    for event in json.loads(netlog.read_text())["events"]:
        for name in ("url", "host", "group_id"):
            text = str(event.get("params", {}).get(name, ""))
            hosts |= {*re.findall(r"(?:https?|wss?)://([\w.-]+)", text)}
    return sent, refused, last, {host for host in hosts if not CHROMIUMS_OWN.fullmatch(host)}


def hosts_of(urls):
    return {urlsplit(url).hostname for url in urls} - {None}  # data: and blob: have none


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """The recording of a run, as the command line leaves it."""
    folder = tmp_path_factory.mktemp("browser")
    shorter = ["--set", "target.path=[{line: {to: [1.9, 0.0]}}]", "--set", "control.period=0.01"]
    verb = ["run", SCENARIO, "--out", str(folder), "--quiet", *shorter]
    with started([sys.executable, "-m", "rmrc", *verb]) as process:
        assert process.wait(600) == 0  # in a new clone it compiles the law
    return folder / "approach_singularity.rrd"


def test_the_page_shows_the_recording_at_the_time_told_and_asks_this_machine_only(recording, tmp_path):
    # The state of the viewer has the nanoseconds as a varint: seven bits a byte, the lowest first.
    time = bytes([0x80, 0xF9, 0x85, 0xD4, 0x04])
    assert sum((digit & 127) << 7 * i for i, digit in enumerate(time)) == 1_250_000_000
    command = [sys.executable, "-m", "rmrc", "replay", "--web", "--at", "1.25", str(recording)]
    with started(command, stdout=subprocess.PIPE, text=True) as process:
        url = process.stdout.readline().strip()
        sent, refused, state, hosts = looked_at(url, lambda state, _: time in state, tmp_path / "net.json")
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 143
    assert time in state  # it stays
    assert b"Recording:rmrc approach_singularity" in state
    assert any(url.endswith("/recording.rrd") for url in sent)
    assert hosts_of(sent) == hosts == {"127.0.0.1"}
    # It did try, and the policy refused: the test looked long enough.
    assert any("tel.rerun.io" in url for url in refused)


# The same of the programs, by their system calls -------------------------------------------------


@contextmanager
def traced(command, log, **options):
    """Run a command under strace, which writes down whom it connects to and what it sends."""
    if not shutil.which("strace") or subprocess.run(["strace", "-o", log, "true"], check=False).returncode:
        pytest.skip("there is no strace here, or it may not trace; `.ci/run browser` installs it")
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


def test_the_window_connects_to_this_machine_only(recording, tmp_path, monkeypatch):
    """The viewer asks GitHub for its latest release, and must not come through."""
    if not shutil.which("Xvfb"):
        pytest.skip("there is no Xvfb here; `.ci/run browser` installs it")
    log, told = tmp_path / "log", tmp_path / "told"
    screen = ["Xvfb", "-displayfd", "1", "-screen", "0", "1000x700x24", "-nolisten", "tcp"]
    command = [sys.executable, "-m", "rmrc", "replay", str(recording)]
    with started(screen, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        monkeypatch.setenv("DISPLAY", f":{server.stdout.readline().strip()}")
        with told.open("w") as err, traced(command, log, stderr=err) as strace:
            # Its own data, and the way out that leads nowhere.
            wait_for(lambda: strace.poll() is not None or len(addresses(log)) >= 2, 60)
            if strace.poll() == 2:
                pytest.skip(f"the viewer opens no window here: {told.read_text().splitlines()[-1]}")
            wait_for(lambda: re.search(r"ECONNREFUSED", log.read_text(errors="replace")))
            subprocess.run(["kill", "-TERM", str(min(descendants(strace.pid)))], check=True)
            assert strace.wait(30) == 143
    assert foreign(log) == set()
    assert "github" not in log.read_text(errors="replace")
