"""Opens a recording in the rerun viewer: on this machine only, and without telemetry."""

import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rmrc.recording import unlogged
from rmrc.recording.viewer_page import FILES, LOOPBACK, RECORDING, PageServer
from rmrc.support.errors import RmrcError, did_you_mean
from rmrc.support.invocation import command

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
