"""What a service tells, as lines of JSON: one event a line, in the order of time, without secrets."""

from __future__ import annotations

import json
import logging
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from jeat_graph.data.notes import listening
from jeat_graph.data.secrets import without_logins

INFO, WARNING, ERROR = "info", "warning", "error"
_WARNS = "warning: "
_MS = 1e3


class _LibraryHandler(logging.Handler):
    """Takes what libraries log."""

    def __init__(self, log: Log) -> None:
        super().__init__(logging.WARNING)
        self._log = log

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record."""
        level = ERROR if record.levelno >= logging.ERROR else WARNING
        self._log.write(level, record.getMessage(), library=record.name)


class Log:
    """Writes lines to stderr; from any thread.

    Args:
        service: name of the service, which every line has.
        stream: where to; by default stderr.
    """

    def __init__(self, service: str, stream: TextIO | None = None) -> None:
        self._service, self._stream = service, stream or sys.stderr
        self._lock = threading.Lock()
        self._always: dict[str, Any] = {}

    def of(self, **always: Any) -> Log:
        """Return a log that writes to the same place, with these values in every line."""
        made = Log(self._service, self._stream)
        made._lock, made._always = self._lock, self._always | always
        return made

    @contextmanager
    def of_libraries(self) -> Iterator[None]:
        """Write what libraries log, warnings and notes, too, as lines like the others."""

        def show(message: Any, *_: Any, **__: Any) -> None:
            self.write(WARNING, str(message))

        handler, root = _LibraryHandler(self), logging.getLogger()
        root.addHandler(handler)
        try:
            with warnings.catch_warnings(), listening(self.say):
                warnings.showwarning = show
                yield
        finally:
            root.removeHandler(handler)

    def say(self, text: str) -> None:
        """Write a line of what came from elsewhere; one that begins with `warning: ` is a warning."""
        warns = text.startswith(_WARNS)
        self.write(WARNING if warns else INFO, text.removeprefix(_WARNS))

    def write(self, level: str, text: str, **more: Any) -> None:
        """Write a line.

        Args:
            level: `info`, `warning` or `error`.
            text: what happened.
            more: further values of the line.
        """
        now = time.time()
        stamp = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(now)) + f".{int(now % 1.0 * _MS):03d}Z"
        line = {"time": stamp, "level": level, "service": self._service, "text": without_logins(text)}
        line |= self._always | more
        with self._lock:
            self._stream.write(json.dumps(line, ensure_ascii=False) + "\n")
            self._stream.flush()
