"""Serves the page of rerun's viewer with a recording: a page that can only talk to its own server.

The page as rerun serves it sends analytics and requests fonts, releases and examples from others, whatever
the environment says. The server here gives the same files with a policy that the browser enforces, and the
recording from the same address, so that the page needs no other server.
"""

import base64
import hashlib
import re
import shutil
from collections.abc import Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote

from rmrc.recording.viewer_process import LOOPBACK

# The files of the viewer's page. Nothing else is served but the recording.
TYPES = {
    "/": "text/html; charset=utf-8",
    "/re_viewer.js": "text/javascript; charset=utf-8",
    "/re_viewer_bg.wasm": "application/wasm",
    "/favicon.ico": "image/x-icon",
    "/apple-touch-icon.png": "image/png",
}
RECORDING = "/recording.rrd"

# Headers of every answer. CORP keeps other pages from reading it, and the browser caches no recording.
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-DNS-Prefetch-Control": "off",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}

# A request names the host that the browser was given. A foreign page whose name leads to this machine (DNS
# rebinding) gives that name. Any port is accepted: ssh may forward it.
OUR_NAMES = re.compile(r"(?:127\.0\.0\.1|localhost)(?::\d{1,5})?", re.IGNORECASE)

# <link href="https://...">: fonts, and connections opened in advance, which no policy forbids.
FOREIGN_LINK = re.compile(r"<link\b[^>]*\bhref\s*=\s*[\"']?(?:https?:)?//[^>]*>", re.IGNORECASE)
INLINE_SCRIPT = re.compile(r"<script\s*>(.*?)</script\s*>", re.IGNORECASE | re.DOTALL)


# Stops the viewer's clock at a time, until that lasts for ten seconds or the user takes over: each layout of
# the recording starts the clock again.
SEEK = """
(async () => {
  const request = new Uint8Array(%s), time = "%s", taken = {by: null};
  for (const kind of ["pointerdown", "keydown", "wheel"])
    addEventListener(kind, (event) => { taken.by = event; }, {capture: true});
  for (let calm = 0; calm < 40 && !taken.by; ) {
    await new Promise((done) => setTimeout(done, 250));
    if (!window._handle) continue;
    try {
      const is_there = Array.from(window._handle.viewer_state()).join().includes(time);
      calm = is_there ? calm + 1 : 0;
      if (!is_there) await window._handle.viewer_control(request);
    } catch (error) { /* nothing is loaded yet */ }
  }
})();
"""


def seek(at: float) -> bytes:
    """Return the request to rerun's viewer to stand still at a time [s] of `sim_time`.

    It is a `ViewerControlRequest` of its protocol, as `rerun.experimental.ViewerClient.set_time` sends it:
    6: {2: {1: timeline}, 3: {1: nanoseconds}, 5: 1 for paused}.
    """
    left, digits = round(at * 1e9), bytearray()
    while left > 127:
        digits.append(left & 127 | 128)
        left >>= 7
    digits.append(left)
    name, time = b"\x0a\x08sim_time", bytes([8, *digits])
    body = bytes([0x12, len(name), *name, 0x1A, len(time), *time, 0x28, 1])
    return bytes([0x32, len(body), *body])


def without_foreign_links(page: str) -> str:
    """Return a page without the links that a browser follows by itself to other machines."""
    return FOREIGN_LINK.sub("", page)


def policy(page: str) -> str:
    """Return the Content-Security-Policy of a page: it may only load from its own server.

    Only its own inline scripts run, identified by their digests. WebAssembly may be compiled, but no text may
    be evaluated.
    """
    digests = (hashlib.sha256(script.encode()).digest() for script in INLINE_SCRIPT.findall(page))
    scripts = " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src 'self' 'wasm-unsafe-eval' {scripts}",
            "connect-src 'self'",
            "img-src 'self' data: blob:",
            "font-src 'self' data:",
            "style-src 'self' 'unsafe-inline'",
            "worker-src 'self' blob:",
            "base-uri 'none'",
            "form-action 'none'",
            "frame-ancestors 'none'",
        )
    )


class PageServer(ThreadingHTTPServer):
    """Serves the viewer's page and one recording on a free port of 127.0.0.1.

    Args:
        files: The files that `TYPES` names, as rerun serves them.
        recording: The recording, read anew for each request.
        port: The port; 0: a free one.
        at: Time at which the page's clock stops when the page has the recording [s]; None: it runs.
    """

    daemon_threads = True  # a browser that reads slowly does not delay the end

    def __init__(
        self, files: Mapping[str, bytes], recording: Path, port: int = 0, at: float | None = None
    ) -> None:
        """Take a port; `serve_forever` answers."""
        super().__init__((LOOPBACK, port), _Answer)
        page = without_foreign_links(files["/"].decode())
        if at is not None:
            request = seek(at)
            script = SEEK % (list(request), ",".join(map(str, request[16:-2])))
            page = page.replace("</body>", f"<script>{script}</script></body>")
        self.files = {**files, "/": page.encode()}
        self.policy = policy(page)
        self.recording = recording

    @property
    def origin(self) -> str:
        """Return its address: http://127.0.0.1:PORT."""
        return f"http://{LOOPBACK}:{self.server_port}"

    @property
    def url(self) -> str:
        """Return the address of the page that shows the recording."""
        return f"{self.origin}?url={quote(self.origin + RECORDING, safe='')}&hide_welcome_screen"


class _Answer(BaseHTTPRequestHandler):
    """Answers one request, by HTTP/1.0: one connection per request."""

    server: PageServer
    server_version, sys_version = "rmrc", ""
    timeout = 60  # seconds that a client may be silent

    def do_GET(self) -> None:
        """Answer with a file or the recording."""
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        """Answer as to GET, without the body."""
        self._answer(with_body=False)

    def _refuse(self) -> None:
        self.send_response(HTTPStatus.METHOD_NOT_ALLOWED)
        self.send_header("Allow", "GET, HEAD")
        self.send_header("Content-Length", "0")
        self.end_headers()

    do_POST = do_PUT = do_PATCH = do_DELETE = do_OPTIONS = do_TRACE = do_CONNECT = _refuse

    def _answer(self, with_body: bool) -> None:
        hosts = self.headers.get_all("Host", [])
        if len(hosts) > 1 or not all(OUR_NAMES.fullmatch(host.strip()) for host in hosts):
            self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
            return
        path = self.path.partition("?")[0]
        if path == RECORDING:
            self._send_recording(with_body)
        elif path in self.server.files:
            content = self.server.files[path]
            self._begin(TYPES[path], len(content))
            if with_body:
                self.wfile.write(content)
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def _send_recording(self, with_body: bool) -> None:
        try:
            file = self.server.recording.open("rb")
        except OSError:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        with file:
            self._begin("application/octet-stream", file.seek(0, 2))
            if with_body:
                file.seek(0)
                shutil.copyfileobj(file, self.wfile, 1 << 20)

    def _begin(self, kind: str, length: int) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(length))
        self.send_header("rerun-final-length", str(length))  # the page shows how much is loaded by this
        self.end_headers()

    def end_headers(self) -> None:
        """End the headers of any answer, errors included, with those that confine the page to this server."""
        self.send_header("Content-Security-Policy", self.server.policy)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        super().end_headers()

    def handle(self) -> None:
        """Answer; a browser that disconnects in the middle is no error."""
        try:
            super().handle()
        except OSError:
            self.close_connection = True

    def log_message(self, *_: object) -> None:
        """Print nothing: the terminal shows only the address."""
