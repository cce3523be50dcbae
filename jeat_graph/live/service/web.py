"""Answers `/health` and `/metrics` from a thread of its own."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from http import HTTPStatus
from typing import Any, Protocol, Self

from jeat_graph.data.errors import ConfigError
from jeat_graph.io.streams.web_server import WebHandler, WebServer
from jeat_graph.live.service.metrics import Metrics, MetricsText
from jeat_graph.live.service.status import Status

#: A client that says nothing is not waited for longer than this (s).
_PATIENCE_S = 5


class HasHealth(Protocol):
    """What can say how it is doing."""

    def health(self) -> dict[str, Any]:
        """Return what `/health` says, with `ready`."""
        ...


def metrics_of(status: Status | HasHealth) -> MetricsText:
    """Return the metrics of a service of one rig."""
    assert isinstance(status, Status)
    return Metrics(status)


class Web:
    """Serves the status of a service; a context manager.

    Args:
        host: name or number of the machine's interface.
        port: 0 takes any that is free.
        status: of the service.
        tell: takes a line of what could not be answered.
        metrics: makes the text of `/metrics`; by default of a service of one rig.

    Attributes:
        port: the port that is listened at.

    Raises:
        ConfigError: nothing can listen there, or a package is missing.
    """

    def __init__(
        self,
        host: str,
        port: int,
        status: Status | HasHealth,
        tell: Callable[[str], object],
        metrics: MetricsText | None = None,
    ) -> None:
        shown = metrics_of(status) if metrics is None else metrics

        class Handler(WebHandler):
            timeout = _PATIENCE_S

            def get(self) -> None:
                path = self.path.partition("?")[0]
                if path == "/health":
                    health = status.health()
                    code = HTTPStatus.OK if health["ready"] else HTTPStatus.SERVICE_UNAVAILABLE
                    self.answer(code, "application/json", json.dumps(health, indent=1).encode() + b"\n")
                elif path == "/metrics":
                    self.answer(HTTPStatus.OK, shown.content_type, shown.text())
                else:
                    self.answer(HTTPStatus.NOT_FOUND, "text/plain", b"there are /health and /metrics\n")

        try:
            self._server = WebServer(host, port, Handler, tell)
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or error
            raise ConfigError(f"web: cannot listen at {host}:{port}: {why}") from None
        self.port = int(self._server.server_address[1])

    def __enter__(self) -> Self:
        threading.Thread(target=self._server.serve_forever, name="web", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()
