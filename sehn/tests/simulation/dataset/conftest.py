"""The tiny source, importable by the processes that tests start, and a way to make a data set of it."""

from __future__ import annotations

import hashlib
import importlib
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from jeat_graph_sehn.simulation.dataset.protocol import Protocol
from jeat_graph_sehn.simulation.dataset.recording import record_dataset


@pytest.fixture
def rectangles(monkeypatch):
    """The class `MovingRectangles`, from a module of a name that child processes find too."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    return importlib.import_module("moving_rectangles").MovingRectangles


@pytest.fixture
def make(rectangles):
    """Make a data set; keywords of the protocol and of the source."""

    def run(out: Path, segments: int = 3, workers: int = 1, **options: Any) -> dict[str, Any]:
        stored = {key: options.pop(key) for key in ("video", "compression", "shares") if key in options}
        protocol = Protocol(segments, **{"video": "png", **stored})
        return record_dataset(partial(rectangles, **options), out, protocol, workers=workers)

    return run


@pytest.fixture
def fingerprints():
    """Return the SHA-256 of every file below a folder, by its name."""

    def of(folder: Path) -> dict[str, str]:
        return {
            path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in folder.rglob("*")
            if path.is_file()
        }

    return of
