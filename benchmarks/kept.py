"""What detectors found, kept in a folder from one run of a benchmark to the next.

A file is named by a digest of all that its content follows from: the network, the settings, every file of the
segment, and the code that detects. So whoever changes the tracker alone need not detect again, and nothing
that is old is ever taken.
"""

from __future__ import annotations

import hashlib
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from benchmarks.raw_segments import Finding, RawFound, detector_named, find_in
from benchmarks.sources import ROOT, sources_of
from jeat_graph.data.detections import Detections
from jeat_graph.detection.detecting import EVENTS_SENSOR, FRAMES_SENSOR, FUSED_SENSOR
from jeat_graph.detection.named import EVENTS, FRAMES, FUSED
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.files.hashing import sha256_of

_DETECTING = "benchmarks.raw_segments"
_KINDS = {FRAMES_SENSOR: FRAMES, EVENTS_SENSOR: EVENTS, FUSED_SENSOR: FUSED}


def kept_or_found(job: tuple[Finding, str | None]) -> RawFound:
    """Take what a detector found earlier, or let it look.

    Args:
        job: what is asked, and the folder in which it is kept; None: it is not.

    Returns:
        What was found; where it was kept, without its time (`cpu_s` is 0).

    Raises:
        DataError: the segment lacks what the detector looks at.
    """
    finding, folder = job
    if folder is None:
        return find_in(finding)
    path = Path(folder) / f"{digest(finding)}.npz"
    detections = read_kept(path)
    if detections is not None:
        return RawFound(finding, detections, 0.0)
    found = find_in(finding)
    write_kept(found.detections, path)
    return found


def digest(finding: Finding) -> str:
    """Return a digest of all that a finding's result follows from."""
    sha = hashlib.sha256(_code().encode())
    sha.update(repr((finding.sensor, finding.settings)).encode())
    sha.update(repr(detector_named(finding.detector, _KINDS[finding.sensor])).encode())
    for path in sorted(p for p in finding.segment.folder.rglob("*") if p.is_file()):
        sha.update(f"{path.relative_to(finding.segment.folder)} {sha256_of(path)}\n".encode())
    return sha.hexdigest()


@cache
def _code() -> str:
    sha = hashlib.sha256()
    for name in sorted(sources_of(_DETECTING)):
        sha.update(f"{name} {sha256_of(ROOT / name)}\n".encode())
    return sha.hexdigest()


def write_kept(detections: Detections, path: Path) -> None:
    """Write detections as they are, without rounding."""
    values = {one.name: getattr(detections, one.name) for one in fields(detections)}
    arrays: dict[str, Any] = {name: np.array(value) for name, value in values.items() if value is not None}
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)


def read_kept(path: Path) -> Detections | None:
    """Read detections that were kept; None where there are none, or the file is damaged."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError, BadZipFile):
        return None
    sensors, dropped = tuple(arrays.pop("sensors").tolist()), int(arrays.pop("dropped"))
    return Detections(sensors=sensors, dropped=dropped, **arrays)
