"""What the server of the viewer's page gives, and to whom. Whether browsers heed it is in test_browser.py."""

import base64
import hashlib
import http.client
import re
import socket
import threading
from contextlib import contextmanager

import pytest

from rmrc.recording.viewer import PageServer, policy, seek

SCRIPT = "alert('Hello, world.');"
# The digest of SCRIPT as the specification has it: https://www.w3.org/TR/CSP3/#framework-directive-source-list
DIGEST = "'sha256-qznLcsROx4GACP2dm0UCKCzCG+HiZ1guq6ZZDob/Tng='"
KEPT = f'<link rel="icon" href="favicon.ico"><a href="https://fonts.example">x</a><script>{SCRIPT}</script>'
FOREIGN = (
    '<link rel="preconnect" href="https://fonts.example" crossorigin />'
    '<link\n  href="https://fonts.example/css2?family=Inter:wght@100;500&display=swap"\n  rel="stylesheet"\n/>'
    "<LINK HREF='//fonts.example'><link rel=preconnect href=http://fonts.example>"
)
FILES = {
    "index.html": f"{FOREIGN}{KEPT}</body>".encode(),
    "re_viewer.js": b"js",
    "re_viewer_bg.wasm": b"\0asm" + bytes(5_000_000),
    "favicon.ico": b"icon",
    "apple-touch-icon.png": b"png",
}
RECORDED = b"RRF" + bytes(range(256)) * 20_000


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "some run.rrd"
    path.write_bytes(RECORDED)
    path.with_name("secret.txt").write_text("secret")
    return path


@contextmanager
def serving(recording, at=None):
    with PageServer(FILES, recording, 0, at) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def server(recording):
    with serving(recording) as server:
        yield server


def ask(server, path="/", method="GET", host=None):
    """Return (status, headers, body)."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    connection.putrequest(method, path, skip_host=host is not None, skip_accept_encoding=True)
    for name in [host] if isinstance(host, str) else host or ():
        connection.putheader("Host", name)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


def test_the_files_and_the_recording_come_whole_without_links_to_other_machines(server):
    page = f"{KEPT}</body>".encode()
    for path, content in {**FILES, "": page, "recording.rrd": RECORDED, "index.html": page}.items():
        status, headers, body = ask(server, f"/{path}")
        assert (status, int(headers["Content-Length"])) == (200, len(content))
        assert body == content
        assert ask(server, f"/{path}", "HEAD")[::2] == (200, b"")
    for path, kind in (("/", "text/html"), ("/re_viewer.js", "text/javascript")):
        assert ask(server, path)[1]["Content-Type"] == kind
    assert ask(server, "/re_viewer_bg.wasm")[1]["Content-Type"] == "application/wasm"


def test_the_policy_lets_the_page_talk_to_its_own_server_only():
    directives = dict(text.split(" ", 1) for text in policy(KEPT).split("; "))
    assert directives["default-src"] == "'none'"
    assert directives["connect-src"] == "'self'"
    assert directives["script-src"] == f"'self' 'wasm-unsafe-eval' {DIGEST}"
    allowed = {"'none'", "'self'", "'wasm-unsafe-eval'", "'unsafe-inline'", "data:", "blob:", DIGEST}
    assert {source for sources in directives.values() for source in sources.split()} <= allowed
    assert [name for name, sources in directives.items() if "unsafe-inline" in sources] == ["style-src"]


ANSWERS = {  # to (path, method, host)
    200: [
        ("/", "GET", None), ("/recording.rrd", "HEAD", None), ("/", "GET", "127.0.0.1:1234"), ("/", "GET", "LocalHost:80"),
        ("/", "GET", ()),  # no name at all: HTTP/1.0, which no browser speaks
    ],
    404: [
        (path, "GET", None)
        for path in (
            "/secret.txt", "/../secret.txt", "/%2e%2e/secret.txt", "//secret.txt", "/recording.rrd/../secret.txt",
            "/some%20run.rrd", "/recording.rrd/", "http://127.0.0.1/secret.txt", "file:///etc/passwd",
        )
    ],
    # A site whose name is made to lead to 127.0.0.1 must not read the recording (DNS rebinding).
    421: [
        ("/recording.rrd", "GET", host)
        for host in (
            "evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "127.0.0.1:80@evil.example",
            "127.0.0.1:", "0.0.0.0", "", ("127.0.0.1", "evil.example"),
        )
    ],
    501: [("/recording.rrd", method, None) for method in ("POST", "PUT", "DELETE", "OPTIONS", "CONNECT")],
}  # fmt: skip


@pytest.mark.parametrize("status", ANSWERS)
def test_every_answer_has_the_policy_and_only_what_is_asked_here_gets_a_file(server, status):
    for path, method, host in ANSWERS[status]:
        code, headers, body = ask(server, path, method, host)
        assert code == status, (path, method, host)
        assert b"secret\n" not in body and b"root:" not in body and (status == 200 or b"RRF" not in body)
        assert headers["Content-Security-Policy"] == policy(KEPT)
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert headers["Cache-Control"] == "no-store"
        assert headers["Access-Control-Allow-Origin"] is headers["Location"] is None


def test_a_browser_that_goes_away_in_the_middle_is_no_error(server, capfd):
    with socket.create_connection(("127.0.0.1", server.server_port), 10) as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        client.sendall(b"GET /re_viewer_bg.wasm HTTP/1.0\r\n\r\n")
        client.recv(10)
    assert ask(server)[0] == 200
    assert capfd.readouterr() == ("", "")


# Where the clock of the page stands -----------------------------------------------------------------


@pytest.mark.parametrize("at", [0.0, 0.127e-6, 0.128e-6, 2.5, 1e9])
def test_the_request_says_what_the_one_of_rerun_says(at):
    """`ViewerClient.set_time("sim_time", duration=2.5, play_state="paused")` of rerun 0.41, as it was on the wire.

    The time is a varint: seven bits a byte, the lowest first, and all but the last marked. Ours has all ten bytes.
    """
    wire = bytes.fromhex("3216120a0a0873696d5f74696d651a060880f28ba8092801")
    digits = bytes(seek(at)[17:27])
    assert sum((digit & 127) << 7 * i for i, digit in enumerate(digits)) == round(at * 1e9)
    assert all(digit & 128 for digit in digits[:-1]) and digits[-1] == 0
    assert sum((digit & 127) << 7 * i for i, digit in enumerate(wire[17:22])) == 2_500_000_000
    more = 5  # bytes
    ours = [seek(at)[0], seek(at)[1] - more, *seek(at)[2:15], seek(at)[15] - more, *seek(at)[16:17]]
    assert bytes([*ours, *wire[17:22], *seek(at)[27:]]) == wire


def test_the_script_that_seeks_is_one_that_the_policy_knows(recording):
    with serving(recording.with_name("gone.rrd"), 2.5) as seeking:
        page = ask(seeking)[2].decode()
        assert ask(seeking, "/recording.rrd")[0] == 404
    script = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)[1]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"'sha256-{digest}'" in seeking.policy
    assert str(seek(2.5)) in script
    assert page.endswith("</script></body>")
