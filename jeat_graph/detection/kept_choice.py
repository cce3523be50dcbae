"""Which detector was chosen for a camera, kept over restarts: started at night it goes on as by day.

`chosen.json` in the folder of the networks has an entry for each camera, by its address without logins. It
holds while the same networks are on this machine and the same classes are looked for; else the choice is made
again. A choice by an empty road is not kept, for nothing spoke for it.
"""

from __future__ import annotations

import json
import os
from typing import Any

from jeat_graph.data.errors import DataError
from jeat_graph.data.notes import note
from jeat_graph.data.private_folder import is_private
from jeat_graph.detection.automatic import names_here
from jeat_graph.detection.network_cache import cache_folder
from jeat_graph.detection.settings import DetectionSettings
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.files.locking import hold_file

_FILE = "chosen.json"
# A file that is larger was not written here.
_MOST_BYTES = 1 << 20


def kept_choice(camera: str, settings: DetectionSettings) -> str | None:
    """Return the detector that was chosen for a camera, None where none was or other networks are here now.

    Args:
        camera: its address, without logins.
        settings: of the detectors.
    """
    entry = _read().get(camera)
    if not isinstance(entry, dict) or entry.get("of") != _of(settings):
        return None
    chosen = entry.get("detector")
    return chosen if chosen in _of(settings)["networks"] else None


def keep_choice(camera: str, settings: DetectionSettings, detector: str) -> None:
    """Keep a choice; where it cannot be kept, a note says so. Args as of `kept_choice`, and the detector."""
    path = cache_folder() / _FILE
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not is_private(path.parent):
            raise DataError("others can write this folder", path.parent)
        with hold_file(path):
            known = _read() | {camera: {"detector": detector, "of": _of(settings)}}
            with open_atomic(path) as file:
                json.dump(known, file, indent=1, sort_keys=True)
    except (OSError, DataError) as error:
        note(f"the choice of {detector} for {camera} is not kept for the next start: {error}")


def _of(settings: DetectionSettings) -> dict[str, Any]:
    """Return what a choice depends on beside the pictures."""
    return {"networks": names_here(), "classes": list(settings.model_frames.classes)}


def _read() -> dict[str, Any]:
    """Return what is kept; nothing where the file is missing, damaged, or may be others'."""
    path = cache_folder() / _FILE
    try:
        if not is_private(path.parent) or os.stat(path).st_size > _MOST_BYTES:
            return {}
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}
