"""A recording of a batch that begins with pictures or events: looked at once, unless something changes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from jeat_graph.detection.before_tracking import DETECTIONS, DetectedFile, detect_before
from jeat_graph.detection.request import DetectRequest
from jeat_graph.runs.track_files import TrackRequest
from jeat_graph.version import __version__

#: Beside the detections: what they were made from, and what is declared to the tracker; written last.
SOURCE = "detected.json"


def with_detections(request: TrackRequest, raw: DetectRequest) -> TrackRequest:
    """Return a request of which the detections are there.

    Args:
        request: what to track, without detections.
        raw: where they come from.

    Raises:
        JeatGraphError: a file cannot be read, or a detector is not known.
    """
    from jeat_graph.io.files.atomic import open_atomic

    out = Path(request.out)
    origin = _origin(raw)
    found = _known(out, origin)
    if found is None:
        (out / SOURCE).unlink(missing_ok=True)
        found = detect_before(raw, out)
        with open_atomic(out / SOURCE) as file:
            known = {"image": found.image, "detectors": found.detectors}
            json.dump(origin | known, file)
    picture: tuple[str, ...] = ()
    if found.image is not None:
        picture = (f"image.width={found.image[0]}", f"image.height={found.image[1]}")
    frames = None if raw.frames is None else str(raw.frames)
    overrides = (*picture, *request.overrides)
    return replace(
        request,
        detections=(found.path,),
        frames=frames,
        overrides=overrides,
        detectors=found.detectors,
    )


def _origin(raw: DetectRequest) -> dict[str, Any]:
    """Return what detections depend on: the files by their content, and all settings."""
    from jeat_graph.io.files.hashing import sha256_of

    # Files count by their content, wherever they lie.
    settings = replace(raw, frames=raw.frames and "frames", events=raw.events and "events")
    networks = [
        sha256_of(name)
        for name in (raw.detector_frames, raw.detector_events, raw.detector_fused or "", raw.embedder or "")
        if Path(name).is_file()
    ]
    return {
        "version": __version__,
        "inputs": [sha256_of(path) for path in raw.files],
        "networks": networks,
        "settings": repr(settings),
    }


def _known(out: Path, origin: dict[str, Any]) -> DetectedFile | None:
    """Return what an earlier batch left, if it is the same."""
    source, file = out / SOURCE, out / DETECTIONS
    if not source.is_file() or not file.is_file():
        return None
    try:
        known = json.loads(source.read_text(encoding="utf-8"))
        if known | origin != known:
            return None
        image = known["image"]
        size = None if image is None else (int(image[0]), int(image[1]))
        return DetectedFile(str(file), size, tuple(map(str, known["detectors"])))
    except (ValueError, KeyError, TypeError, RecursionError):
        return None  # damaged: it is made again
