"""Serves the page on this machine alone, to whoever knows its address, until it says that it is done."""

from __future__ import annotations

import html
import json
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import Any

from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.drawing.draw.drawn import Page, as_page, save_page
from jeat_graph.io.media.pictures import as_png
from jeat_graph.io.media.video import RgbImage
from jeat_graph.io.streams.web_server import WebHandler, WebServer

_HOME = "127.0.0.1"
_LARGEST = 1 << 20
_HERE = Path(__file__).parent
_JSON, _HTML, _PNG, _TEXT = (
    "application/json",
    "text/html; charset=utf-8",
    "image/png",
    "text/plain; charset=utf-8",
)


class DrawServer(WebServer):
    """A page over one picture.

    Its address holds a secret word, and other host names are refused, so that no other page in the browser
    can reach it.

    Args:
        picture: (H, W, 3).
        title: what it is of.
        marks: file of lines, zones and masks.
        lengths: file of lengths.
        port: of this machine; 0 takes a free one.
        tell: takes a line of what could not be answered.

    Attributes:
        address: of the page.
        done: whether the page said so.

    Raises:
        DataError: a file cannot be read, or the port is taken.
    """

    def __init__(
        self,
        picture: RgbImage,
        title: str,
        marks: Path,
        lengths: Path,
        port: int = 0,
        tell: Callable[[str], object] = lambda _: None,
    ) -> None:
        self.files = marks, lengths
        self.page: Page = as_page(marks, lengths)
        word = secrets.token_urlsafe(16)
        script = (_HERE / "page.js").read_text(encoding="utf-8")
        text = (_HERE / "page.html").read_text(encoding="utf-8")
        shown = text.replace("SCRIPT", script).replace("TITLE", html.escape(title))
        self.answers: dict[str, tuple[str, bytes]] = {
            f"/{word}/": (_HTML, shown.encode()),
            f"/{word}/picture.png": (_PNG, as_png(picture)),
        }
        self.prefix = f"/{word}/"
        self.done = False
        try:
            super().__init__(_HOME, port, _Handler, tell)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or "ports are 0 to 65535"
            raise DataError(f"port {port} cannot be opened: {reason}") from None
        self.hosts = {f"{name}:{self.server_port}" for name in (_HOME, "localhost")}
        self.address = f"http://{_HOME}:{self.server_port}{self.prefix}"

    @contextmanager
    def way_in(self) -> Iterator[str]:
        """Have a file there that leads a browser to the page: its own address, which may be shown.

        The address of the page does not go onto a command line, where every user of the machine would see
        its secret word; only the file's owner can read it.

        Raises:
            DataError: it cannot be written beside the marks.
        """
        path = self.files[0].resolve().parent / f"draw-{secrets.token_hex(4)}.html"
        text = f'<!doctype html><meta http-equiv="refresh" content="0; url={html.escape(self.address)}">\n'
        try:
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise DataError(f"cannot be written: {error.strerror}", path) from None
        try:
            yield path.as_uri()
        finally:
            path.unlink(missing_ok=True)

    def run(self) -> None:
        """Serve until the page says that it is done."""
        self.timeout = 0.5
        while not self.done:
            self.handle_request()


class _Handler(WebHandler):
    timeout = 10.0

    @property
    def _draw(self) -> DrawServer:
        assert isinstance(self.server, DrawServer)
        return self.server

    def get(self) -> None:
        """Give the page, its picture, or what is drawn already."""
        if not self._from_here():
            return
        if self.path == f"{self._draw.prefix}marks.json":
            self._answer(_JSON, json.dumps(self._draw.page).encode())
            return
        found = self._draw.answers.get(self.path)
        if found is None:
            self._answer(_TEXT, b"not here", HTTPStatus.NOT_FOUND)
        else:
            self._answer(*found)

    def post(self) -> None:
        """Save what was drawn; `done` ends the server too."""
        ends = {f"{self._draw.prefix}{name}": name == "done" for name in ("save", "done")}
        if not self._from_here():
            return
        if self.path not in ends or self.headers.get("Content-Type") != _JSON:
            self._answer(_TEXT, b"not here", HTTPStatus.NOT_FOUND)
            return
        try:
            page: Any = json.loads(self.rfile.read(self._length()))
            reply = save_page(page, *self._draw.files)
        except (JeatGraphError, ValueError, RecursionError, OSError) as error:
            self._answer(_TEXT, " ".join(str(error).split()).encode(), HTTPStatus.BAD_REQUEST)
            return
        self._draw.page = page
        try:
            self._answer(_TEXT, reply.encode())
        finally:  # it is saved, whether or not the browser waited for the answer
            self._draw.done = ends[self.path]

    def _length(self) -> int:
        length = int(self.headers.get("Content-Length", "0"))
        if not 0 <= length <= _LARGEST:
            raise DataError("more than a page draws")
        return length

    def _from_here(self) -> bool:
        if self.headers.get("Host") in self._draw.hosts:
            return True
        self._answer(_TEXT, b"not here", HTTPStatus.FORBIDDEN)
        return False

    def _answer(self, kind: str, content: bytes, status: HTTPStatus = HTTPStatus.OK) -> None:
        headers = {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"}
        self.answer(status, kind, content, headers)
