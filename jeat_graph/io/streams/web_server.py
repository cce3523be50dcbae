"""The web server of those commands that answer requests: one thread a request, HEAD as GET, no traceback."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


class WebServer(ThreadingHTTPServer):
    """Answers requests; that a client goes before it has its answer is nothing to tell of.

    Args:
        host: name or number of the machine's interface.
        port: 0 takes any that is free.
        handler: answers a request.
        tell: takes a line for the user.
    """

    daemon_threads = True

    def __init__(
        self, host: str, port: int, handler: type[WebHandler], tell: Callable[[str], object]
    ) -> None:
        self._tell = tell
        super().__init__((host, port), handler)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Tell in one line of a request that could not be answered."""
        error = sys.exc_info()[1]
        if not isinstance(error, ConnectionError | TimeoutError):
            self._tell(f"warning: a request could not be answered: {type(error).__name__}: {error}")


class WebHandler(BaseHTTPRequestHandler):
    """Answers one request; says nothing of it."""

    server_version, sys_version = "jeat-graph", ""

    def do_HEAD(self) -> None:
        """Answer as GET does, without content."""
        self.get()

    def do_GET(self) -> None:
        """Answer."""
        self.get()

    def do_POST(self) -> None:
        """Take what is sent, where the server takes anything."""
        self.post()

    def post(self) -> None:
        """Refuse what is sent; a server that takes something has its own."""
        self.send_error(HTTPStatus.NOT_IMPLEMENTED)

    def get(self) -> None:
        """Answer GET or HEAD; each server in its own way."""
        raise NotImplementedError

    def answer(
        self, status: HTTPStatus, kind: str, content: bytes, headers: Mapping[str, str] | None = None
    ) -> None:
        """Send an answer.

        Args:
            status: the code.
            kind: of the content (`Content-Type`).
            content: left out in an answer to HEAD.
            headers: further ones.
        """
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        for name, value in (headers or {}).items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: `/health` is asked every few seconds."""
