"""Scores of other trackers, kept in a file: they change only with version, parameters and recordings."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from benchmarks.recordings import JudgedRecording
from jeat_graph.data.errors import DataError
from jeat_graph.io.atomic import open_atomic

_PACKAGES = ("trackers", "norfair")


class PeerCache:
    """Results by what they depend on; written to its file after each new one.

    Args:
        path: JSON file; None keeps everything in memory.

    Raises:
        DataError: the file is there and holds something else.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._known: dict[str, dict[str, Any]] = {}
        if path is not None and path.is_file():
            try:
                self._known = json.loads(path.read_text(encoding="utf-8"))
            except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
                raise DataError(f"cannot be read: {error}", path) from None
            if not isinstance(self._known, dict):
                raise DataError("is no file of cached results", path)

    def get(self, key: str, compute: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Return what is known under a key, or compute it and keep it."""
        if key not in self._known:
            self._known[key] = compute()
            if self._path is not None:
                with open_atomic(self._path) as file:
                    file.write(json.dumps(self._known, indent=1, sort_keys=True))
        return self._known[key]


def cache_key(
    what: str, sensors: Sequence[str], parameters: Mapping[str, Any], recordings: Sequence[JudgedRecording]
) -> str:
    """Key of one tracker with one set of parameters on some recordings.

    Args:
        what: the tracker, and what is done with it.
        sensors: what it is given.
        parameters: what differs from its defaults.
        recordings: judged on these; their numbers go into the key, not their names.
    """
    digest = hashlib.sha256()
    for one in recordings:
        for array in (one.detections.scan_t, one.detections.boxes, one.detections.scores):
            digest.update(array.tobytes())
        truth = one.truth
        for part in (truth.t.tobytes(), truth.boxes.tobytes(), truth.object_id.tobytes()):
            digest.update(part)
        digest.update(truth.ignore.tobytes())
    versions = {name: _version(name) for name in _PACKAGES}
    told = json.dumps([what, list(sensors), dict(parameters), versions], sort_keys=True)
    digest.update(told.encode())
    return f"{what} {'+'.join(sensors)} {digest.hexdigest()[:24]}"


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
