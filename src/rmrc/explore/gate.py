"""Access to the server of the page: for this machine, or with a token; and limits of the page's requests."""

import re
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from http import HTTPStatus
from typing import Any

import websockets.asyncio.server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from rmrc.explore import rows
from rmrc.recording import viewer_page

# A header of every answer. With it, the browser lets the page talk only to its own server, at any address.
POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:",
        "worker-src 'self' blob: data:",
        "connect-src 'self' blob: data:",
        "img-src 'self' data: blob:",
        "font-src 'self' data:",
        "style-src 'self' 'unsafe-inline'",
        "media-src 'self' data: blob:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
HEADERS = {"Content-Security-Policy": POLICY, **viewer_page.HEADERS}

_Answer = Callable[[Any, Request], Response | None]
_serving = threading.Lock()


class Gate:
    """Lets requests through to viser's server, or refuses them.

    On 127.0.0.1 a request must name this machine, which prevents DNS rebinding. On another address its path
    must begin with the token. Only the page itself can open a socket.

    Args:
        is_local: Whether only this machine can reach the server.

    Attributes:
        token: The first part of the path; "": no token.
        is_used: Whether the server uses the gate.
    """

    def __init__(self, is_local: bool) -> None:
        """Draw a token, unless the gate is local."""
        self.token = "" if is_local else secrets.token_urlsafe(24)
        self.is_used = False
        self._is_local = is_local

    @property
    def path(self) -> str:
        """The path of the page."""
        return f"/{self.token}/" if self.token else "/"

    def admitted(self, request: Request) -> Request | None:
        """Return a request as viser's server expects it; None: refused.

        Args:
            request: The request as received.
        """
        hosts = request.headers.get_all("Host")
        if len(hosts) != 1 or (self._is_local and not viewer_page.OUR_NAMES.fullmatch(hosts[0].strip())):
            return None
        is_socket = request.headers.get("Upgrade", "").lower() == "websocket"
        if is_socket and request.headers.get_all("Origin") != [f"http://{hosts[0].strip()}"]:
            return None
        path = request.path
        if self.token:
            first, slash, rest = path.partition("?")[0].removeprefix("/").partition("/")
            if not secrets.compare_digest(first.encode(), self.token.encode()) or not (slash or is_socket):
                return None
            path = f"/{rest}"
        return replace(request, path=path)

    def guarding(self, answer: _Answer) -> _Answer:
        """Return a function that answers admitted requests, and refuses others.

        Args:
            answer: The function of viser.
        """
        self.is_used = True

        def guarded(connection: Any, request: Request) -> Response | None:
            admitted = self.admitted(request)
            if admitted is None:
                found: Response | None = Response(
                    HTTPStatus.FORBIDDEN, "Forbidden", Headers({"Content-Length": "10"}), b"Forbidden\n"
                )
            elif admitted.path == f"/{rows.PLACE}":
                found = _whole(rows.page())
            else:
                found = answer(connection, admitted)
            if found is not None:
                for name, value in HEADERS.items():
                    found.headers[name] = value
            return found

        return guarded


@contextmanager
def guarded_by(gate: Gate) -> Iterator[None]:
    """Guard each server that viser starts in the block: viser has no option for this.

    Args:
        gate: The gate. Its `is_used` says afterwards whether a server uses it.
    """
    module = websockets.asyncio.server
    original = module.serve

    def serve(*given: Any, process_request: _Answer, **options: Any) -> Any:
        return original(*given, process_request=gate.guarding(process_request), **options)

    with _serving:
        module.serve = serve  # type: ignore[misc, assignment]
        try:
            yield
        finally:
            module.serve = original  # type: ignore[misc]


def _whole(page: bytes) -> Response:
    """Return an answer with a page of this package."""
    told = {
        "Content-Type": "text/html; charset=utf-8",
        "Content-Length": str(len(page)),
        "Connection": "close",
    }
    return Response(HTTPStatus.OK, "OK", Headers(told), page)


def host_of(text: str) -> str:
    """Return a host in the form of an address: IPv6 in brackets.

    >>> host_of("127.0.0.1"), host_of("::1")
    ('127.0.0.1', '[::1]')
    """
    return f"[{text}]" if re.search(":", text) else text
