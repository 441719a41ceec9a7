"""Starts the program of rerun, and ends it with all its children, whatever signal comes."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from types import FrameType
from typing import IO

LOOPBACK = "127.0.0.1"

# The launcher of this environment's viewer, independent of the folder of its scripts.
RERUN = (sys.executable, "-m", "rerun_cli")

# The viewer ends within a tenth of a second of a request; after this time it is killed [s].
GRACE = 5.0

# Ctrl-C, a polite kill, and a terminal that is closed.
STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Stopped(Exception):  # noqa: N818 -- no error, as KeyboardInterrupt is none
    """A signal asked to stop.

    Attributes:
        code: Exit code by the convention of shells: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP.
    """

    def __init__(self, number: int) -> None:
        """Take the number of the signal."""
        super().__init__(f"stopped by {signal.Signals(number).name}")
        self.code = 128 + number


class Events:
    """Events while a program runs: it ends, or signals ask to stop.

    A signal is noted here and raised at the next check, so that none interrupts a cleanup.

    Attributes:
        signals: The signals that came, in order.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self._woken: SimpleQueue[None] = SimpleQueue()  # a handler may put into it at any line
        self.signals: list[int] = []

    def note_signal(self, number: int, _frame: FrameType | None = None) -> None:
        """Note a signal; the first one decides the exit code."""
        self.signals.append(number)
        self._woken.put(None)

    def note_end(self) -> None:
        """Note that a program has ended."""
        self._woken.put(None)

    def wait(self, seconds: float | None = None) -> None:
        """Wait for an event, perhaps an earlier one, or for the end of the time."""
        with suppress(Empty):
            self._woken.get(timeout=seconds)

    def raise_if_stopped(self) -> None:
        """Raise the exception that the first signal demands.

        Raises:
            Stopped: There was a signal.
        """
        if self.signals:
            raise Stopped(self.signals[0])

    def wait_for_signal(self) -> None:
        """Wait until a signal asks to stop.

        Raises:
            Stopped: In the end, always.
        """
        while True:
            self.raise_if_stopped()
            self.wait()


@contextmanager
def listening_to_signals() -> Iterator[Events]:
    """Yield events that receive signals; an ignored signal, such as SIGHUP under `nohup`, stays ignored."""
    events = Events()
    if threading.current_thread() is not threading.main_thread():  # only the main thread may handle signals
        yield events
        return
    handlers = {one: signal.getsignal(one) for one in STOPS}
    ours = {one: handler for one, handler in handlers.items() if handler not in (signal.SIG_IGN, None)}
    try:
        for one in ours:
            signal.signal(one, events.note_signal)
        yield events
    finally:
        for one, handler in ours.items():
            signal.signal(one, handler)


class Program:
    """The program of rerun, which runs until the end of the `with` block at the latest.

    Args:
        arguments: Arguments of its command line.
        events: Events that receive its end, and signals.
        stderr: A file for its messages, instead of the terminal.
    """

    def __init__(self, arguments: list[str], events: Events, stderr: IO[bytes] | None = None) -> None:
        """Start it."""
        self._events = events
        # A port that is taken and unanswered as long as the program runs.
        self._dead_end = socket.socket()
        self._dead_end.bind((LOOPBACK, 0))
        # A group of its own, because the viewer is a child of rerun's launcher and both must end.
        self._process = subprocess.Popen(
            [*RERUN, *arguments],
            env=_environment(self._dead_end.getsockname()[1]),
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            stderr=stderr,
        )
        self._watch = threading.Thread(target=self._note_end, daemon=True)
        self._watch.start()

    def _note_end(self) -> None:
        self._process.wait()
        self._events.note_end()

    @property
    def has_ended(self) -> bool:
        """Whether it has ended by itself."""
        return self._process.returncode is not None

    def wait(self) -> int:
        """Wait until it ends, and return its exit code.

        Raises:
            Stopped: A signal came first.
        """
        while not self.has_ended:
            self._events.raise_if_stopped()
            self._events.wait()
        return self._process.wait()

    def __enter__(self) -> "Program":
        """Return the running program."""
        return self

    def __exit__(self, *_: object) -> None:
        """End all its processes: by a request first, and at once after one more signal."""
        before = len(self._events.signals)
        until = time.monotonic() + GRACE
        with suppress(ProcessLookupError, PermissionError):  # nobody is left in the group
            os.killpg(self._process.pid, signal.SIGTERM)
            while not self.has_ended and len(self._events.signals) == before:
                left = until - time.monotonic()
                if left <= 0:
                    break
                self._events.wait(left)
            os.killpg(self._process.pid, signal.SIGKILL)
        self._watch.join()
        self._dead_end.close()


def _environment(dead_end: int) -> dict[str, str]:
    """Return the user's environment without telemetry and without access to other machines.

    CI=1 turns telemetry off, whatever the user's settings for another viewer say. The viewer also asks GitHub
    for the latest release. No setting prevents this, but a proxy that refuses does.
    """
    proxy = dict.fromkeys(("ALL_PROXY", "HTTP_PROXY", "HTTPS_PROXY"), f"http://{LOOPBACK}:{dead_end}")
    users = {name: value for name, value in os.environ.items() if not name.lower().endswith("_proxy")}
    return {"RUST_LOG": "warn", **users, **proxy, "CI": "1"}
