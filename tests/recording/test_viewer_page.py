"""What the server of the viewer's page gives, and to whom. Whether browsers heed it is in test_browser.py."""

import base64
import hashlib
import http.client
import re
import socket
import threading

import pytest

from rmrc.recording.viewer_page import PageServer, policy, seek, without_foreign_links

SCRIPT = "alert('Hello, world.');"
# The digest of SCRIPT as the specification has it: https://www.w3.org/TR/CSP3/#framework-directive-source-list
DIGEST = "'sha256-qznLcsROx4GACP2dm0UCKCzCG+HiZ1guq6ZZDob/Tng='"
PAGE = (
    f'<link href="https://fonts.example/x.css"><link rel="icon" href="favicon.ico"><script>{SCRIPT}</script>'
)
FILES = {
    "/": PAGE.encode(),
    "/re_viewer.js": b"js",
    "/re_viewer_bg.wasm": b"\0asm" + bytes(5_000_000),
    "/favicon.ico": b"icon",
    "/apple-touch-icon.png": b"png",
}
RECORDED = b"RRF" + bytes(range(256)) * 20_000


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "some run.rrd"
    path.write_bytes(RECORDED)
    path.with_name("secret.txt").write_text("secret")
    return path


@pytest.fixture(scope="module")
def server(recording):
    with PageServer(FILES, recording) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


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


def send(server, request):
    """Return the first line of the answer to some bytes."""
    with socket.create_connection(("127.0.0.1", server.server_port), 10) as client:
        client.sendall(request)
        return client.makefile("rb").readline()


def test_the_files_and_the_recording_come_whole(server):
    page = PAGE.replace('<link href="https://fonts.example/x.css">', "").encode()
    expected = {**FILES, "/": page, "/recording.rrd": RECORDED}
    for path, content in expected.items():
        status, headers, body = ask(server, path)
        assert (status, int(headers["Content-Length"])) == (200, len(content))
        assert body == content
        status, told, nothing = ask(server, path, "HEAD")
        assert (status, nothing) == (200, b"")
        assert {k: v for k, v in told.items() if k != "Date"} == {
            k: v for k, v in headers.items() if k != "Date"
        }
    assert ask(server, "/re_viewer_bg.wasm")[1]["Content-Type"] == "application/wasm"


def test_the_address_is_of_this_server_alone(server):
    port = server.server_port
    assert server.server_address[0] == "127.0.0.1"
    assert server.url == (
        f"http://127.0.0.1:{port}?url=http%3A%2F%2F127.0.0.1%3A{port}%2Frecording.rrd&hide_welcome_screen"
    )
    assert ask(server, server.url.replace(f"http://127.0.0.1:{port}", "/"))[0] == 200  # as browsers send it


def test_the_policy_lets_the_page_talk_to_its_own_server_only():
    directives = dict(one.split(" ", 1) for one in policy(PAGE).split("; "))
    assert directives["default-src"] == "'none'"
    assert directives["connect-src"] == "'self'"
    assert directives["script-src"] == f"'self' 'wasm-unsafe-eval' {DIGEST}"
    allowed = {"'none'", "'self'", "'wasm-unsafe-eval'", "'unsafe-inline'", "data:", "blob:", DIGEST}
    assert {source for sources in directives.values() for source in sources.split()} <= allowed
    assert [name for name, sources in directives.items() if "unsafe-inline" in sources] == ["style-src"]


@pytest.mark.parametrize(
    ("path", "method", "host"),
    [
        ("/", "GET", None),
        ("/recording.rrd", "HEAD", None),
        ("/no", "GET", None),
        ("/", "POST", None),
        ("/", "GET", "a.b"),
    ],
)
def test_every_answer_has_the_policy(server, path, method, host):
    _, headers, _ = ask(server, path, method, host)
    assert headers["Content-Security-Policy"] == policy(PAGE)
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert headers["Cache-Control"] == "no-store"
    assert headers["Access-Control-Allow-Origin"] is None
    assert headers["Location"] is None


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.1:1234", "localhost", "LocalHost:80", ()])
def test_names_of_this_machine_are_answered(server, host):
    assert ask(server, host=host)[0] == 200  # none at all: HTTP/1.0, which no browser speaks


@pytest.mark.parametrize(
    "host",
    [
        "evil.example", "evil.example:80", "127.0.0.1.evil.example", "localhost.evil.example", "evil.example#127.0.0.1",
        "127.0.0.1:80@evil.example", "127.0.0.1:", "10.0.0.1", "0.0.0.0", "",
        ("127.0.0.1", "evil.example"),
    ],
)  # fmt: skip
def test_another_name_is_refused(server, host):
    """A site whose name is made to lead to 127.0.0.1 must not read the recording (DNS rebinding)."""
    for path in ("/", "/recording.rrd"):
        status, _, body = ask(server, path, host=host)
        assert (status, b"RRF" in body) == (421, False)


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT"])
def test_only_get_and_head_are_answered(server, method):
    status, headers, body = ask(server, "/recording.rrd", method)
    assert (status, headers["Allow"], body) == (405, "GET, HEAD", b"")


@pytest.mark.parametrize(
    "path",
    [
        "/secret.txt", "/../secret.txt", "/%2e%2e/secret.txt", "/..%2fsecret.txt", "/./secret.txt", "//secret.txt",
        "/recording.rrd/../secret.txt", "/some%20run.rrd", "/sw.js", "/signed-in", "/recording.rrd/", "/favicon.ico%00",
        "http://127.0.0.1/secret.txt", "file:///etc/passwd", "/\\..\\secret.txt",
    ],
)  # fmt: skip
def test_there_is_nothing_else(server, path):
    status, _, body = ask(server, path)
    assert (status, b"secret\n" in body, b"root:" in body) == (404, False, False)


def test_what_is_no_request_is_refused_in_silence(server, capfd):
    assert (
        send(server, b"GET / nonsense HTTP/1.0\n\n")
        == b"HTTP/1.0 400 Bad request syntax ('GET / nonsense HTTP/1.0')\r\n"
    )
    for nonsense in (
        b"GET\n\n",
        b"GET / HTTP/9.9\n\n",
        b"GET http://[ HTTP/1.0\n\n",
        b"A" * 70_000 + b"\n\n",
    ):
        send(server, nonsense)
    # A browser that goes away in the middle.
    with socket.create_connection(("127.0.0.1", server.server_port), 10) as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        client.sendall(b"GET /re_viewer_bg.wasm HTTP/1.0\r\n\r\n")
        client.recv(10)
    assert ask(server)[0] == 200
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


def test_a_recording_that_is_gone_is_not_found(recording):
    with PageServer(FILES, recording.with_name("gone.rrd")) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        assert ask(server, "/recording.rrd")[0] == 404
        server.shutdown()
        thread.join()


@pytest.mark.parametrize(
    "link",
    [
        '<link rel="preconnect" href="https://fonts.example" />',
        '<link rel="preconnect" href="https://fonts.example" crossorigin />',
        '<link\n  href="https://fonts.example/css2?family=Inter:wght@100;500&display=swap"\n  rel="stylesheet"\n/>',
        "<LINK HREF='//fonts.example'>",
        "<link rel=preconnect href=http://fonts.example>",
    ],
)
def test_links_to_other_machines_are_taken_out(link):
    assert without_foreign_links(f"<p>{link}</p>") == "<p></p>"


def test_other_links_stay():
    page = '<link rel="icon" href="favicon.ico"><a href="https://fonts.example">x</a><link href="/a.css">'
    assert without_foreign_links(page) == page
    assert not re.search("https", without_foreign_links(PAGE))


# Where the clock of the page stands -----------------------------------------------------------------


def test_the_request_is_the_one_that_rerun_sends():
    """Bytes of `ViewerClient.set_time("sim_time", duration=2.5, play_state="paused")` of rerun 0.41, on the wire."""
    assert seek(2.5).hex() == "3216120a0a0873696d5f74696d651a060880f28ba8092801"


@pytest.mark.parametrize("at", [0.0, 1e-9, 0.127e-6, 0.128e-6, 3.07, 1e9])
def test_its_time_reads_back(at):
    """A varint: seven bits a byte, the lowest first, and all but the last marked."""
    assert seek(at)[14] == 0x1A  # behind the timeline
    digits = seek(at)[17 : 16 + seek(at)[15]]
    assert sum((digit & 127) << 7 * i for i, digit in enumerate(digits)) == round(at * 1e9)
    assert all(digit & 128 for digit in digits[:-1]) and not digits[-1] & 128
    assert len(seek(at)) == 2 + seek(at)[1]


def test_the_script_that_seeks_is_one_that_the_policy_knows(recording):
    page = b"<html><body><canvas id=the_canvas_id></canvas></body></html>"
    with (
        PageServer({**FILES, "/": page}, recording, at=2.5) as seeking,
        PageServer(FILES, recording) as plain,
    ):
        (script,) = re.findall(r"<script>(.*)</script>", seeking.files["/"].decode(), re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in seeking.policy
        assert str(list(seek(2.5))) in script
        assert b"viewer_control" not in plain.files["/"]  # negative control
