"""The server of the page: by default for this machine alone, and without viser's public tunnel."""

import ctypes
import gc
import io
import os
import socket
import threading
import warnings
import webbrowser
from collections.abc import Callable
from contextlib import redirect_stdout, suppress
from functools import partial
from pathlib import Path
from typing import Any

from rmrc.explore.answer import Explored
from rmrc.explore.session import Session
from rmrc.recording.viewer_process import LOOPBACK
from rmrc.scenario import Scenario
from rmrc.scenario.lesson import Lesson
from rmrc.support.errors import RmrcError
from rmrc.support.interruption import interruptible

# Addresses without a token: only this machine reaches them, and requests must name them.
LOCAL = (LOOPBACK, "localhost")
# The variable with which viser would replace the given port.
OVERRIDE = "_VISER_PORT_OVERRIDE"
TITLE = "rmrc explore"
# Time between two returns of free memory to the system [s].
TIDIED = 10.0
# glibc's name of the largest number of heaps, and the number: more of them keep more free memory.
ARENA_MAX, HEAPS = -8, 2
# The warning of viser when a tab closes during a message.
GONE = r"Queued a \w+ on a closed connection"


class ExploreError(RmrcError, OSError):
    """The page cannot be served."""


def refuse_missing() -> None:
    """Check that viser is installed.

    Raises:
        ExploreError: Viser is not installed.
    """
    try:
        import viser  # noqa: F401
    except ImportError as error:
        raise ExploreError(f"the page is made with viser: pip install 'rmrc[explore]' ({error})") from None


def refuse_taken(host: str, port: int) -> None:
    """Check that an address is free; otherwise viser would take the next port, or never answer.

    Raises:
        ExploreError: Nothing can listen on the address; says why.
    """
    try:
        kind, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(kind) as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            one.bind(address)
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        way = "; give another --port, or none" if port else "; --host must be an address of this machine"
        raise ExploreError(f"{host}:{port} cannot be listened on: {why}{way}") from None


class Server:
    """A page and its sessions; a context manager.

    Args:
        scenario: The scenario to explore.
        out: The folder for saved files.
        host: The address to listen on.
        port: The port; 0: a free one.
        lesson: The lesson for the reader, if there is one.
        failed: Called with the error that ended a session.
        drags: Whether sessions begin in drag mode.

    Attributes:
        sessions: The open sessions, by the number of their browser.
    """

    def __init__(
        self,
        scenario: Scenario,
        out: Path,
        host: str = LOOPBACK,
        port: int = 0,
        lesson: Lesson | None = None,
        failed: Callable[[Exception], None] = lambda _: None,
        drags: bool = False,
    ) -> None:
        """Listen.

        Raises:
            ExploreError: Viser is not installed, or the address cannot be listened on.
        """
        refuse_missing()
        refuse_taken(host, port)
        from rmrc.explore.gate import Gate, guarded_by, host_of

        self.sessions: dict[int, Session] = {}
        self._lock, self._closed = threading.Lock(), threading.Event()
        self._make = partial(Session, scenario, out, lesson, drags)
        self._failed = failed
        self._gate = Gate(is_local=host in LOCAL)
        warnings.filterwarnings("ignore", GONE, UserWarning)
        override = os.environ.pop(OVERRIDE, None)
        try:
            # viser prints a table of addresses, and "Server stopped" at the end
            with guarded_by(self._gate), redirect_stdout(io.StringIO()):
                self._server = _without_tunnel(host, port)
        finally:
            if override is not None:
                os.environ[OVERRIDE] = override
        port_taken = self._server.get_port()
        if not self._gate.is_used or (port and port_taken != port):
            self.close()
            raise ExploreError(
                f"{host}:{port} was taken meanwhile, or this viser serves in another way than 1.1"
            )
        self.url = f"http://{host_of(host)}:{port_taken}{self._gate.path}"
        self._server.on_client_connect(self._open)
        self._server.on_client_disconnect(self._leave)
        threading.Thread(target=self._tidy, name="rmrc explore, memory", daemon=True).start()

    def _open(self, client: Any) -> None:
        """Give a browser a session."""

        def failed(error: Exception) -> None:
            self._failed(error)
            self._leave(client)

        session = self._make(client, failed)
        with self._lock:
            if not self._closed.is_set():
                self.sessions[client.client_id] = session
                session.start()

    def _leave(self, client: Any) -> None:
        """End the session of a browser."""
        with self._lock:
            session = self.sessions.pop(client.client_id, None)
        if session is not None:
            session.close()

    def _tidy(self) -> None:
        """Return the memory of closed tabs and old answers to the system, now and then."""
        while not self._closed.wait(TIDIED):
            gc.collect()  # controls of a tab and viser's refer to each other: only the collector frees them
            _of_glibc("malloc_trim", 0)

    def close(self) -> None:
        """End all sessions, and stop listening."""
        with self._lock:
            self._closed.set()
            ended = list(self.sessions.values())
            self.sessions.clear()
        for session in ended:
            session.close()
        with redirect_stdout(io.StringIO()):
            self._server.stop()

    def __enter__(self) -> "Server":
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()


def _of_glibc(name: str, *numbers: int) -> None:
    """Call a function of glibc about memory; other systems have none."""
    with suppress(OSError, TypeError, AttributeError):
        getattr(ctypes.CDLL(None), name)(*numbers)


def _without_tunnel(host: str, port: int) -> Any:
    """Return viser's server without requests for a public address."""
    import viser
    from viser import _messages

    class Quiet(viser.ViserServer):
        def request_share_url(self, verbose: bool = True) -> None:
            """Open nothing."""

    server = Quiet(host=host, port=port, label=TITLE, verbose=False)
    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._connection.unregister_handler(message)
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    return server


def serve(
    scenario: Scenario,
    out: Path,
    host: str,
    port: int,
    lesson: Lesson | None,
    say: Callable[[str], None],
    failed: Callable[[Exception], None],
    opens: bool = False,
    drags: bool = False,
) -> None:
    """Serve the page until a signal comes.

    Args:
        scenario: The scenario to explore.
        out: The folder for saved files.
        host: The address to listen on.
        port: The port; 0: a free one.
        lesson: The lesson for the reader, if there is one.
        say: Called with the address of the page.
        failed: Called with the error that ended a session.
        opens: Whether to open the page in a browser.
        drags: Whether the page begins in drag mode.

    Raises:
        ScenarioError: The scenario is invalid; lists all faults.
        ExploreError: Viser is not installed, or the address cannot be listened on.
        KeyboardInterrupt: The signal that ended it.
    """
    refuse_taken(host, port)
    Explored(scenario)  # finds the faults of the scenario before a browser connects
    _of_glibc("mallopt", ARENA_MAX, HEAPS)
    # the collector skips all objects that exist now, so that it interrupts an arm only for a moment
    gc.collect()
    gc.freeze()
    with interruptible() as stop, Server(scenario, out, host, port, lesson, failed, drags) as server:
        say(server.url)
        if opens:
            webbrowser.open(server.url)
        stop.wait()
    raise KeyboardInterrupt
