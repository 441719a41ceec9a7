"""Opens a recording in the rerun viewer: on this machine only, and without telemetry."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from rmrc.errors import RmrcError, did_you_mean

LOOPBACK = "127.0.0.1"

# The launcher of this environment's viewer, wherever its scripts are.
RERUN = (sys.executable, "-m", "rerun_cli")

# How a .rrd file begins.
MAGIC = b"RRF"

# The viewer ends within a tenth of a second when asked to; after this it is made to.
GRACE = 5.0


class ViewerError(RmrcError, OSError):
    """A recording cannot be shown."""


def replay(path: Path, web: bool = False) -> int:
    """Show a recording until the viewer is closed or Ctrl-C is pressed.

    The viewer and its servers listen on 127.0.0.1 alone; telemetry is off for this viewer, and the
    user's own settings stay as they are.

    Args:
        path: A `.rrd`, or the `.rrd.part` of a run that was killed.
        web: Serve the viewer to a browser instead of opening a window, and print its address.

    Returns:
        Exit code of the viewer; 0 after a window was closed, 130 after Ctrl-C.

    Raises:
        ViewerError: No such recording, not a recording, or no display.
    """
    _check(path)
    if not web and not _has_display():
        raise ViewerError(f"there is no display to open the viewer on; use: rmrc replay --web {path}")
    with tempfile.TemporaryDirectory(prefix="rmrc-") as folder:
        shown = path
        if path.suffix == ".part":  # the viewer knows a recording by its suffix, and waits for a torn end
            shown = Path(folder) / path.stem
            repair(path, shown)
        data, page = _free_ports(2)
        options = ["--bind", LOOPBACK, "--port", str(data), "--hide-welcome-screen"]
        if web:
            options += ["--serve-web", "--web-viewer-port", str(page)]
            proxy = f"rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{data}%2Fproxy"
            print(f"http://{LOOPBACK}:{page}?url={proxy}\nCtrl-C ends it", flush=True)
        return _run([*RERUN, *options, str(shown.absolute())])


def repair(part: Path, whole: Path) -> None:
    """Write all that is good in the recording of a killed run, whose end may be torn, to a new file.

    Raises:
        ViewerError: Nothing of it can be read.
    """
    command = [*RERUN, "rrd", "merge", "--continue-on-error", str(part.absolute()), "-o", str(whole)]
    done = subprocess.run(command, env=_environment(), capture_output=True, text=True, check=False)
    if done.returncode or not whole.is_file():
        reason = " ".join(done.stderr.split()) or "nothing in it"
        raise ViewerError(f"{part}: cannot be repaired: {reason}")


def _check(path: Path) -> None:
    if not path.is_file():
        beside = [p.name for pattern in ("*.rrd", "*.rrd.part") for p in path.parent.glob(pattern)]
        raise ViewerError(f"{path}: no such recording{did_you_mean(path.name, beside)}")
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise ViewerError(f"{path}: is not a recording; `rmrc run` writes them, ending in .rrd")


def _has_display() -> bool:
    if not sys.platform.startswith("linux"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _free_ports(count: int) -> list[int]:
    """Return ports that nobody listens on, so that a viewer that already runs is left alone."""
    probes = [socket.socket() for _ in range(count)]
    try:
        for probe in probes:
            probe.bind((LOOPBACK, 0))
        return [int(probe.getsockname()[1]) for probe in probes]
    finally:
        for probe in probes:
            probe.close()


def _run(command: list[str]) -> int:
    """Run a command until it ends, or this process is asked to; nothing it started stays behind."""
    with _stop_on_terminate():
        # A group of its own, because the viewer is a child of rerun's launcher and both must end.
        process = subprocess.Popen(command, env=_environment(), start_new_session=True)
        try:
            return process.wait()
        except KeyboardInterrupt:
            return 130
        finally:
            _end_group(process)


def _environment() -> dict[str, str]:
    """CI=1 turns telemetry off, whatever the user's settings for his own viewer say."""
    return {"RUST_LOG": "warn", **os.environ, "CI": "1"}


def _end_group(process: "subprocess.Popen[bytes]") -> None:
    for kind in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, kind)
            process.wait(GRACE)
        except (ProcessLookupError, PermissionError):
            return  # nobody is left in the group
        except subprocess.TimeoutExpired:
            continue


@contextmanager
def _stop_on_terminate() -> Iterator[None]:
    """Let a polite kill take the way of Ctrl-C, past all the cleaning up."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
