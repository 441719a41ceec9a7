"""Opens a recording in the rerun viewer: on this machine only, and without telemetry."""

import base64
import hashlib
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rmrc.recording import unlogged
from rmrc.support.errors import RmrcError, did_you_mean
from rmrc.support.text import command

# The page of the viewer ---------------------------------------------------------------------------
#
# Serves the page of rerun's viewer with a recording: a page that can only talk to its own server.
#
# The page as rerun serves it sends analytics and requests fonts, releases and examples from others,
# whatever the environment says. The server here gives the same files with a policy that the browser
# enforces, and the recording from the same address, so that the page needs no other server.

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


# The viewer ---------------------------------------------------------------------------------------

# The beginning of a recording with that of its format, and its end without the last four bytes.
FORMAT, END = b"RRF2", b"RRF2FOOT"

# Rerun's launcher in this environment, independent of the folder of its scripts.
RERUN = (sys.executable, "-m", "rerun_cli")

# Time for rerun to start, which takes it a tenth of a second, and time between two checks [s].
PATIENCE, LOOK = 30.0, 0.05


class ViewerError(RmrcError, OSError):
    """A recording cannot be shown."""


def replay(path: Path, web: bool = False, at: float | None = None, port: int | None = None) -> None:
    """Show a recording until its window is closed, or until KeyboardInterrupt.

    The viewer and its servers listen on 127.0.0.1 alone; telemetry is off for this viewer, and the user's own
    settings stay as they are. The page in a browser can talk to this process only.

    Args:
        path: A recording, or what `recording_of` takes.
        web: Serve the viewer to a browser instead of opening a window, and print its address.
        at: Time at which the cursor rests [s]; None: it plays from the start.
        port: Port of 127.0.0.1 on which the page is served, or the window listens; None: a free one.

    Raises:
        ViewerError: No such recording, not a recording, no display, or the viewer does not run.
    """
    path = recording_of(path)
    port = _free_port(port)
    if web:
        with PageServer(_page_files(), path, port, at) as server:
            print(f"{server.url}\nCtrl-C ends it", flush=True)
            server.serve_forever(LOOK)
        return
    way = f"use: {command('replay', '--web', path)}"
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ViewerError(f"no display is available for the viewer; {way}")
    code = _open_window(path, port, at)
    if code:
        raise ViewerError(f"the viewer ended with exit code {code}; {way}")


def recording_of(path: Path) -> Path:
    """Return the recording that a path stands for: the newest of a folder, or the one beside a NAME.npz.

    Raises:
        ViewerError: There is none, or it is not one of this version of rerun.
    """
    if path.is_dir():
        path = max(path.glob("*.rrd"), key=lambda file: file.stat().st_mtime_ns, default=path / "NAME.rrd")
    elif path.suffix == ".npz":
        path = path.with_suffix(".rrd")
    if not path.is_file():
        near = did_you_mean(path.name, [file.name for file in path.parent.glob("*.rrd")])
        raise ViewerError(f"{path}: no such recording{near}; `{command('run', 'SCENARIO')}` writes them")
    with path.open("rb") as file:
        head = file.read(len(FORMAT))
    if head[:3] != FORMAT[:3]:
        raise ViewerError(f"{path}: is not a recording; `rmrc run` writes them, ending in .rrd")
    if head != FORMAT or is_torn(path):
        raise ViewerError(f"{path}: is damaged, or of another version of rerun; run its scenario again")
    return path


def is_torn(path: Path) -> bool:
    """Return whether a recording lacks its end, for which the viewer would wait forever."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - len(END) - 4))
        return not file.read().startswith(END)


@contextmanager
def program(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Yield the running program of rerun; after the block it has ended, with all its children.

    CI=1 turns telemetry off, whatever the user's settings for another viewer say. The viewer also asks GitHub
    for the latest release. No setting prevents this, but a proxy does: on port 9 nobody listens, and only an
    administrator could.

    Args:
        arguments: Arguments of its command line, beside the address to listen on.
    """
    proxies = dict.fromkeys(("ALL_PROXY", "HTTP_PROXY", "HTTPS_PROXY"), f"http://{LOOPBACK}:9")
    users = {name: value for name, value in os.environ.items() if not name.lower().endswith("_proxy")}
    process = subprocess.Popen(
        [*RERUN, "--bind", LOOPBACK, *arguments],
        env={"RUST_LOG": "warn", **users, **proxies, "CI": "1"},
        start_new_session=True,  # a group, because the viewer is a child of rerun's launcher
        stdin=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError, PermissionError):  # nobody is left in the group
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _open_window(path: Path, port: int, at: float | None) -> int:
    """Show a recording in a window until it is closed, and return the exit code of the viewer.

    The clock stops at a time when the window has the recording; without that, the recording plays.
    """
    if at is not None:
        with unlogged():  # before the window opens: an interrupt of an import would leave it open
            from rerun.experimental import ViewerClient
    until = time.monotonic() + PATIENCE
    with program("--port", str(port), "--hide-welcome-screen", str(path.absolute())) as process:
        while at is not None and process.poll() is None and time.monotonic() < until:
            with suppress(OSError, RuntimeError, ValueError):  # it is not listening yet
                client = ViewerClient.connect(f"rerun+http://{LOOPBACK}:{port}/proxy")
                state = client.get_state()
                if state.recordings and state.recordings[0].timelines and not state.loading:
                    client.set_time("sim_time", duration=at, play_state="paused")
                    break
            time.sleep(LOOK)
        return process.wait()


def _page_files() -> dict[str, bytes]:
    """Return the files of the viewer's page, which rerun's program contains and serves.

    Rerun's own server ends here, so that no server without our policy is open while somebody looks at a
    recording.

    Raises:
        ViewerError: It does not serve them.
    """
    port, direct = _free_port(None), urllib.request.build_opener(urllib.request.ProxyHandler({}))
    address, until = f"http://{LOOPBACK}:{port}", time.monotonic() + PATIENCE
    # With an address for its page to load, which it does not ask for, rerun opens no port for data.
    with program("--serve-web", "--web-viewer-port", str(port), address + RECORDING) as process:
        while process.poll() is None and time.monotonic() < until:
            with suppress(OSError):  # it is not listening yet
                return {name: direct.open(f"{address}/{name}", timeout=PATIENCE).read() for name in FILES}
            time.sleep(LOOK)
    raise ViewerError(
        "rerun does not serve the page of its viewer; it runs by `python -m rerun_cli --serve-web`"
    )


def _free_port(port: int | None) -> int:
    """Return a port, or one that nobody listens on, so that a viewer that already runs is left alone.

    Raises:
        ViewerError: Somebody listens on it already, or nobody may.
    """
    try:
        with socket.create_server((LOOPBACK, port or 0)) as probe:
            return int(probe.getsockname()[1])
    except OSError as error:
        reason = os.strerror(error.errno or 0).lower()
        raise ViewerError(f"--port {port}: {reason}; give another, or none for a free one") from None
