"""A small run and a reader of its page."""

from __future__ import annotations

import json
import shutil
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import pytest

from jeat_graph.cli.main import main

_VOID = {"meta", "img", "br", "input", "link", "hr"}
_OPTIONAL = {"path", "rect", "circle", "line"}


class Page(HTMLParser):
    """What is in a page: tags with their attributes, tables as texts, and the script's data.

    Raises:
        AssertionError: a tag is closed that was not the last one opened.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.text = text
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.tables: dict[str, list[dict[str, str]]] = {}
        self.words: list[str] = []
        self._open: list[str] = []
        self._caption, self._cells, self._head = "", [], []
        self._cell: str | None = None
        self._script = ""
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in _VOID:
            self._open.append(tag)
        if tag == "table":
            self._caption, self._head = "", []
        if tag == "tr":
            self._cells = []
        if tag in ("td", "th", "caption"):
            self._cell = ""

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self._open.pop() == tag
        if tag == "caption":
            self._caption = self._cell
            self.tables[self._caption] = []
        elif tag in ("td", "th"):
            self._cells.append(self._cell)
        elif tag == "tr":
            if not self._head:
                self._head = self._cells
            else:
                self.tables.setdefault(self._caption, []).append(
                    dict(zip(self._head, self._cells, strict=True))
                )
        if tag in ("td", "th", "caption"):
            self._cell = None

    def handle_data(self, data):
        if self._open and self._open[-1] == "script":
            self._script += data
            return
        if self._open and self._open[-1] != "style":
            self.words.append(data)
        if self._cell is not None:
            self._cell += data

    @property
    def said(self) -> str:
        """All that a reader sees, in one line."""
        return " ".join(" ".join(self.words).split())

    @property
    def data(self):
        """The values that the script draws."""
        start = self.text.index('id="data">') + len('id="data">')
        return json.loads(self.text[start : self.text.index("</script>", start)])

    def attributes(self, tag: str) -> list[dict[str, str | None]]:
        """Attributes of every such tag."""
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="session")
def recording(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    assert main(["simulate", "night", "--out", str(folder), "--duration", "1.2", "--seed", "5"]) == 0
    return folder


@pytest.fixture(scope="session")
def full_run(recording, tmp_path_factory, small_plots) -> SimpleNamespace:
    """A run with all its tables, its truth, and its page."""
    out = tmp_path_factory.mktemp("run") / "run"
    assert main(["track", str(recording / "detections.csv"), "--out", str(out), "--diagnostics"]) == 0
    page = out.parent / "page.html"
    truth = recording / "gt.csv"
    with small_plots():
        assert main(["report", str(out), "--gt", str(truth), "--out", str(page)]) == 0
    return SimpleNamespace(run=out, truth=truth, page=page, html=Page(page.read_text(encoding="utf-8")))


@pytest.fixture
def report(tmp_path):
    """Write the page of a run without comparing, and read it."""

    def make(run, *arguments: str) -> Page:
        out = tmp_path / "page.html"
        assert main(["report", str(run), "--out", str(out), "--no-compare", *arguments]) == 0
        return Page(out.read_text(encoding="utf-8"))

    return make


@pytest.fixture
def copy_of(full_run, tmp_path):
    """Copy the run, but for some of its files."""

    def make(*without: str) -> Path:
        target = tmp_path / "copy"
        shutil.copytree(full_run.run, target)
        for name in without:
            (target / name).unlink()
        return target

    return make
