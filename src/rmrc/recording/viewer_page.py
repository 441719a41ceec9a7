"""Serves the page of rerun's viewer with a recording: a page that can only talk to its own server.

The page as rerun serves it sends analytics and requests fonts, releases and examples from others, whatever
the environment says. The server here gives the same files with a policy that the browser enforces, and the
recording from the same address, so that the page needs no other server.
"""

import base64
import hashlib
import re
import tempfile
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import quote

LOOPBACK = "127.0.0.1"

# The files of the viewer's page. Nothing else is served but the recording.
PAGE = "index.html"
FILES = (PAGE, "re_viewer.js", "re_viewer_bg.wasm", "favicon.ico", "apple-touch-icon.png")
RECORDING = "/recording.rrd"

# Headers of every answer. CORP keeps other pages from reading it, and the browser caches no recording.
HEADERS = {
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
# The page may only load from its own server, run its own scripts, and compile WebAssembly.
POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval' {scripts}; connect-src 'self'; "
    "img-src 'self' data: blob:; font-src 'self' data:; style-src 'self' 'unsafe-inline'; "
    "worker-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

# A request names the host that the browser was given. A foreign page whose name leads to this machine (DNS
# rebinding) gives that name. Any port is accepted: ssh may forward it.
OUR_NAMES = re.compile(r"(?:127\.0\.0\.1|localhost)(?::\d{1,5})?", re.IGNORECASE)

# <link href="https://...">: fonts, and connections opened in advance, which no policy forbids.
FOREIGN_LINK = re.compile(r"<link\b[^>]*\bhref\s*=\s*[\"']?(?:https?:)?//[^>]*>", re.IGNORECASE)
INLINE_SCRIPT = re.compile(r"<script\s*>(.*?)</script\s*>", re.IGNORECASE | re.DOTALL)

# Stops the viewer's clock at a time for ten seconds after the recording has come, or until the user takes
# over: a layout of the recording starts the clock again.
SEEK = """<script>
(async () => {
  let taken = false;
  for (const kind of ["pointerdown", "keydown", "wheel"])
    addEventListener(kind, () => { taken = true; }, {capture: true});
  for (let sent = 0; sent < 40 && !taken; ) {
    await new Promise((done) => setTimeout(done, 250));
    try { await window._handle.viewer_control(new Uint8Array(%s)); sent++; } catch (error) { /* not yet */ }
  }
})();
</script></body>"""


def seek(at: float) -> list[int]:
    """Return the bytes that tell rerun's viewer to stand still at a time [s] of `sim_time`.

    They are a `ViewerControlRequest` of its protocol, as `rerun.experimental.ViewerClient.set_time` sends it:
    6: {2: {1: timeline}, 3: {1: nanoseconds}, 5: 1 for paused}. The number has all ten bytes of its kind.
    """
    digits = [round(at * 1e9) >> 7 * i & 127 | 128 for i in range(9)]
    return [0x32, 27, 0x12, 10, 0x0A, 8, *b"sim_time", 0x1A, 11, 8, *digits, 0, 0x28, 1]


def policy(page: str) -> str:
    """Return the Content-Security-Policy of a page, which knows its own inline scripts by their digests."""
    digests = (hashlib.sha256(script.encode()).digest() for script in INLINE_SCRIPT.findall(page))
    return POLICY.format(scripts=" ".join(f"'sha256-{base64.b64encode(d).decode()}'" for d in digests))


class PageServer(ThreadingHTTPServer):
    """Serves the viewer's page and one recording on a port of 127.0.0.1, until its block ends.

    Args:
        files: The files that `FILES` names, as rerun serves them.
        recording: The recording, read anew for each request.
        port: The port; 0: a free one.
        at: Time at which the page's clock stops when the page has the recording [s]; None: it runs.
    """

    daemon_threads = True  # a browser that reads slowly does not delay the end

    def __init__(self, files: dict[str, bytes], recording: Path, port: int, at: float | None) -> None:
        """Take the port; `serve_forever` answers."""
        super().__init__((LOOPBACK, port), _Answer)
        page = FOREIGN_LINK.sub("", files[PAGE].decode())
        if at is not None:
            page = page.replace("</body>", SEEK % seek(at))
        self.policy, self.recording = policy(page), recording
        self._folder = tempfile.TemporaryDirectory(prefix="rmrc-")
        self.folder = self._folder.name
        for name, content in {**files, PAGE: page.encode()}.items():
            Path(self.folder, name).write_bytes(content)

    @property
    def url(self) -> str:
        """Return the address of the page that shows the recording."""
        origin = f"http://{LOOPBACK}:{self.server_port}"
        return f"{origin}?url={quote(origin + RECORDING, safe='')}&hide_welcome_screen"

    def server_close(self) -> None:
        """Leave the port, and remove the files."""
        super().server_close()
        self._folder.cleanup()

    def handle_error(self, *_: object) -> None:
        """Do nothing: a browser that disconnects in the middle is no error."""


class _Answer(SimpleHTTPRequestHandler):
    """Answers one request with a file of the page, or the recording."""

    server: PageServer

    def __init__(self, request: Any, client: Any, server: PageServer) -> None:
        super().__init__(request, client, server, directory=server.folder)

    def translate_path(self, path: str) -> str:
        """Return the file that a path names."""
        return str(self.server.recording) if path == RECORDING else super().translate_path(path)

    def send_head(self) -> Any:
        """Answer, unless the request names another host."""
        if all(OUR_NAMES.fullmatch(host.strip()) for host in self.headers.get_all("Host", [])):
            return super().send_head()
        self.send_error(HTTPStatus.MISDIRECTED_REQUEST)
        return None

    def end_headers(self) -> None:
        """End the headers of any answer, errors included, with those that confine the page to this server."""
        for name, value in {"Content-Security-Policy": self.server.policy, **HEADERS}.items():
            self.send_header(name, value)
        super().end_headers()

    def log_message(self, *_: object) -> None:
        """Print nothing: the terminal shows only the address."""
