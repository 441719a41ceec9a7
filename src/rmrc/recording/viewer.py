"""Opens a recording in the rerun viewer: on this machine only, and without telemetry."""

import http.client
import os
import socket
import sys
import tempfile
import threading
import time
from pathlib import Path

from rmrc.recording import unlogged
from rmrc.recording.viewer_page import RECORDING, TYPES, PageServer
from rmrc.recording.viewer_process import LOOPBACK, Events, Program, Stopped, listening_to_signals
from rmrc.support.errors import RmrcError, did_you_mean
from rmrc.support.invocation import command
from rmrc.support.legible import visible

# The beginning of a .rrd file, that of its format, and its end without the last four bytes.
MAGIC, FORMAT, FOOT = b"RRF", b"RRF2", b"RRF2FOOT"
# Size of an empty recording [B].
EMPTY = 64

# Time for rerun to serve its page, which takes it a tenth of a second, and time between two checks [s].
PATIENCE, LOOK = 30.0, 0.05


class ViewerError(RmrcError, OSError):
    """A recording cannot be shown."""


def recording_of(path: Path) -> Path:
    """Return the recording that a path stands for: the newest of a folder, or the one beside a NAME.npz.

    Raises:
        ViewerError: A folder has none.
    """
    if path.is_dir():
        found = [one for pattern in ("*.rrd", "*.rrd.part") for one in path.glob(pattern)]
        if not found:
            raise ViewerError(f"{path}: has no recordings; `{command('run', 'SCENARIO')}` writes them")
        return max(found, key=lambda one: one.stat().st_mtime_ns)
    beside = path.with_suffix(".rrd")
    return beside if path.suffix == ".npz" and beside.is_file() else path


def replay(
    path: Path,
    web: bool = False,
    at: float | None = None,
    port: int | None = None,
    named: Path | None = None,
) -> int:
    """Show a recording until the viewer is closed, or a signal asks to stop.

    The viewer and its servers listen on 127.0.0.1 alone; telemetry is off for this viewer, and the
    user's own settings stay as they are. The page in a browser can talk to this process only.

    Args:
        path: A `.rrd`, the `.rrd.part` of a run that was killed, or what `recording_of` takes.
        web: Serve the viewer to a browser instead of opening a window, and print its address.
        at: Time at which the cursor rests [s]; None: it plays from the start.
        port: Port of 127.0.0.1, on which the page is served, or the window listens; None: a free one.
        named: Its name in messages; None: its path.

    Returns:
        Exit code: 0 after a window was closed, 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP.

    Raises:
        ViewerError: No such recording, not a recording, no display, or the viewer does not run.
    """
    path = recording_of(path)
    _check(path)
    if port is not None:
        _check_port(port)
    if not web and not _has_display():
        way = command("replay", "--web", named or path)
        raise ViewerError(f"no display is available for the viewer; use: {way}")
    try:
        with listening_to_signals() as events, tempfile.TemporaryDirectory(prefix="rmrc-") as folder:
            shown = path
            # The viewer knows a recording by its suffix, and waits forever for a torn end.
            if path.suffix == ".part" or is_torn(path):
                shown = Path(folder) / path.name.removesuffix(".part")
                repair(path, shown, events)
            if web:
                _serve(shown, events, at, port or 0)
            else:
                _open_window(shown, named or path, events, at, port or _free_port())
    except Stopped as stopped:
        return stopped.code
    return 0


def repair(part: Path, whole: Path, events: Events | None = None) -> None:
    """Write the intact part of a recording, such as that of a killed run, to a new file.

    Args:
        part: The `.rrd.part`, or a torn `.rrd`.
        whole: The new file.
        events: The source of signals, if there is one.

    Raises:
        ViewerError: Nothing of it can be read.
        Stopped: A signal came first.
    """
    merge = ["rrd", "merge", "--continue-on-error", str(part.absolute()), "-o", str(whole)]
    with tempfile.TemporaryFile() as said:
        with Program(merge, events or Events(), stderr=said) as program:
            code = program.wait()
        if not code and whole.is_file() and whole.stat().st_size <= EMPTY:
            raise ViewerError(f"{part}: cannot be repaired: it is unreadable; run its scenario again")
        if code or not whole.is_file():
            said.seek(0)
            reason = " ".join(said.read().decode(errors="replace").split()) or "nothing in it"
            raise ViewerError(f"{part}: cannot be repaired: {reason}")


def _open_window(shown: Path, path: Path, events: Events, at: float | None, port: int) -> None:
    options = ["--bind", LOOPBACK, "--port", str(port), "--hide-welcome-screen"]
    with Program([*options, str(shown.absolute())], events) as program:
        if at is not None:
            _go_to(at, port, program, events)
        code = program.wait()
    if code:
        way = command("replay", "--web", path)
        raise ViewerError(f"the viewer ended with exit code {code}; use: {way}")


def _go_to(at: float, port: int, program: Program, events: Events) -> None:
    """Move the cursor of a window when it has the recording; without that, the recording plays."""
    with unlogged():
        from rerun.experimental import ViewerClient  # with rerun, a third of a second

    until = time.monotonic() + PATIENCE
    while not program.has_ended and time.monotonic() < until:
        events.raise_if_stopped()
        try:
            client = ViewerClient.connect(f"rerun+http://{LOOPBACK}:{port}/proxy")
            state = client.get_state()
            if state.recordings and state.recordings[0].timelines and not state.loading:
                client.set_time("sim_time", duration=at, play_state="paused")
                return
        except (OSError, RuntimeError, ValueError):  # it is not listening yet
            pass
        events.wait(LOOK)


def _serve(shown: Path, events: Events, at: float | None, port: int) -> None:
    """Serve the page and the recording until a signal asks to stop."""
    with PageServer(_page_files(events), shown, port, at) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": LOOK}, daemon=True)
        thread.start()
        try:
            print(f"{server.url}\nCtrl-C ends it", flush=True)
            events.wait_for_signal()
        finally:
            server.shutdown()
            thread.join()


def _page_files(events: Events) -> dict[str, bytes]:
    """Return the files of the viewer's page, which rerun's program contains and serves.

    Rerun's own server ends here, so that no server without our policy is open while somebody looks at a
    recording.

    Raises:
        ViewerError: It does not serve them.
        Stopped: A signal came first.
    """
    port = _free_port()
    # An address that its page would load; rerun itself does not ask for it, and opens no port for data.
    recording = f"http://{LOOPBACK}:{port}{RECORDING}"
    options = ["--bind", LOOPBACK, "--serve-web", "--web-viewer-port", str(port), recording]
    until = time.monotonic() + PATIENCE
    with tempfile.TemporaryFile() as said, Program(options, events, stderr=said) as program:
        while not program.has_ended and time.monotonic() < until:
            events.raise_if_stopped()
            try:
                files = {path: _get(port, path) for path in TYPES}
            except ConnectionRefusedError:
                events.wait(LOOK)
                continue
            if not program.has_ended:  # otherwise another program has taken the port
                return files
        said.seek(0)
        reason = " ".join(said.read().decode(errors="replace").split()) or "without giving a reason"
        raise ViewerError(f"rerun does not serve its viewer: {reason}")


def _get(port: int, path: str) -> bytes:
    """Return a file that rerun serves, from the loopback address, without proxies or redirections."""
    connection = http.client.HTTPConnection(LOOPBACK, port, timeout=PATIENCE)
    try:
        connection.request("GET", path)
        answer = connection.getresponse()
        content = answer.read()
    except ConnectionRefusedError:
        raise
    except (OSError, http.client.HTTPException) as error:
        raise ViewerError(f"rerun does not serve {path} of its viewer: {error}") from None
    finally:
        connection.close()
    if answer.status != http.client.OK:
        raise ViewerError(f"rerun does not serve {path} of its viewer: {answer.status} {answer.reason}")
    return content


def is_torn(path: Path) -> bool:
    """Return whether a recording has the right beginning but not the right end, as after a full disk."""
    with path.open("rb") as file:
        begins = file.read(len(MAGIC)) == MAGIC
        file.seek(-min(len(FOOT) + 4, file.seek(0, os.SEEK_END)), os.SEEK_END)
        return begins and not file.read().startswith(FOOT)


def _check_port(port: int) -> None:
    """Refuse a port on which somebody listens already, or may not."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise ViewerError(
                f"--port {port}: {reason}; give another, or none for one that is free"
            ) from None


def _check(path: Path) -> None:
    if not path.is_file():
        beside = [p.name for pattern in ("*.rrd", "*.rrd.part") for p in path.parent.glob(pattern)]
        raise ViewerError(f"{path}: no such recording{did_you_mean(path.name, beside)}")
    with path.open("rb") as file:
        head = file.read(len(FORMAT))
    if not head.startswith(MAGIC):
        raise ViewerError(f"{path}: is not a recording; `rmrc run` writes them, ending in .rrd")
    if head != FORMAT:
        found = head.decode(errors="replace")
        raise ViewerError(
            f'{path}: begins with "{visible(found)}", not "{FORMAT.decode()}": it is damaged, or of another '
            "version of rerun; run its scenario again"
        )


def _has_display() -> bool:
    if not sys.platform.startswith("linux"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _free_port() -> int:
    """Return a port that nobody listens on, so that a viewer that already runs is left alone."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])
