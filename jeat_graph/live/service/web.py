"""Answers `/health` and `/metrics` from a thread of its own."""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Self

from jeat_graph.data.errors import ConfigError
from jeat_graph.live.service.metrics import Metrics
from jeat_graph.live.service.status import Status

_OK, _UNKNOWN, _NOT_READY = 200, 404, 503
#: A client that says nothing is not waited for longer than this (s).
_PATIENCE_S = 5


class Web:
    """Serves the status of a service; a context manager.

    Args:
        host: name or number of the machine's interface.
        port: 0 takes any that is free.
        status: of the service.

    Attributes:
        port: the port that is listened at.

    Raises:
        ConfigError: nothing can listen there, or a package is missing.
    """

    def __init__(self, host: str, port: int, status: Status) -> None:
        metrics = Metrics(status)

        class Handler(BaseHTTPRequestHandler):
            timeout = _PATIENCE_S
            server_version, sys_version = "jeat-graph", ""

            def do_GET(self) -> None:
                path = self.path.partition("?")[0]
                if path == "/health":
                    health = status.health()
                    code = _OK if health["ready"] else _NOT_READY
                    self._answer(code, "application/json", json.dumps(health, indent=1).encode() + b"\n")
                elif path == "/metrics":
                    self._answer(_OK, metrics.content_type, metrics.text())
                else:
                    self._answer(_UNKNOWN, "text/plain", b"there are /health and /metrics\n")

            def _answer(self, code: int, kind: str, content: bytes) -> None:
                self.send_response(code)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, *_: object) -> None:
                """Say nothing: it is asked every few seconds."""

        try:
            self._server = ThreadingHTTPServer((host, port), Handler)
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or error
            raise ConfigError(f"web: cannot listen at {host}:{port}: {why}") from None
        self._server.daemon_threads = True
        self.port = int(self._server.server_address[1])

    def __enter__(self) -> Self:
        threading.Thread(target=self._server.serve_forever, name="web", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()
