"""Segments of raw recordings with their truth, and what detectors find in them, each found once."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.detection.detecting import EVENTS_SENSOR, FRAMES_SENSOR, FUSED_SENSOR
from jeat_graph.detection.named import MOTION, network_file
from jeat_graph.detection.request import DetectRequest
from jeat_graph.detection.settings import DetectionSettings
from jeat_graph.io.files.hashing import sha256_of

_SEGMENTS, _TRUTH, _EVENTS, _MANIFEST = "segments", "gt.csv", "events.h5", "manifest.json"
SENSORS = (FRAMES_SENSOR, EVENTS_SENSOR)


@dataclass(frozen=True)
class RawSegment:
    """One segment of a data set that `simulate --sensors pictures` wrote.

    Attributes:
        source: name of the data set, such as a light.
        name: of the segment.
        folder: where it lies.
    """

    source: str
    name: str
    folder: Path

    def truth(self) -> GroundTruth:
        """Read the true boxes."""
        from jeat_graph.io.tables.truth_io import read_truth

        return read_truth(self.folder / _TRUTH)

    def size_px(self) -> tuple[int, int]:
        """Return the width and height of the pictures."""
        from jeat_graph.io.media.video import open_frames

        with open_frames(self.folder) as frames:
            return frames.size_px


@dataclass(frozen=True)
class Finding:
    """What one detector is to look for in one segment.

    Attributes:
        segment: where.
        sensor: `rgb`, `evt`, or `fused` for a network of both.
        detector: name or ONNX file.
        settings: of the detectors.
    """

    segment: RawSegment
    sensor: str
    detector: str
    settings: DetectionSettings = field(default_factory=DetectionSettings)


@dataclass(frozen=True, eq=False)
class RawFound:
    """What a detector has found.

    Attributes:
        finding: what was asked.
        detections: its scans.
        cpu_s: processor time that it took, reading and, before that, getting ready included (s).
    """

    finding: Finding
    detections: Detections
    cpu_s: float


def segments_in(folders: list[Path]) -> list[RawSegment]:
    """Return the segments of data sets; those of its `test.txt` alone where a set names some there.

    Raises:
        ConfigError: no data sets.
        DataError: no such folder, nothing in it, or two sets of one name.
    """
    if not folders:
        raise ConfigError("give DATA: folders that `simulate --sensors pictures` wrote")
    names = [folder.resolve().name for folder in folders]
    for name in names:
        if names.count(name) > 1:
            raise DataError(
                f"{names.count(name)} data sets are called {name}: they could not be distinguished"
            )
    found = []
    for folder, name in zip(folders, names, strict=True):
        inner = folder / _SEGMENTS
        paths = sorted(p for p in inner.iterdir() if (p / _TRUTH).is_file()) if inner.is_dir() else []
        listed = folder / "test.txt"
        tested = set(listed.read_text(encoding="utf-8").split()) if listed.is_file() else set()
        chosen = [p for p in paths if not tested or str(p.relative_to(folder)) in tested]
        if not chosen:
            raise DataError(
                "holds no segments with truth; give folders that `simulate --sensors pictures` wrote", folder
            )
        found += [RawSegment(name, p.name, p) for p in chosen]
    return found


def find_in(finding: Finding) -> RawFound:
    """Let a detector look at a segment.

    Raises:
        DataError: the segment lacks what the detector looks at.
    """
    from jeat_graph.detection.detecting import detect_files

    folder, sensor = finding.segment.folder, finding.sensor
    if sensor != FRAMES_SENSOR and not (folder / _EVENTS).is_file():
        raise DataError("has no events; make the data set with --sensors pictures", folder)
    request = DetectRequest(
        frames=None if sensor == EVENTS_SENSOR else folder,
        events=None if sensor == FRAMES_SENSOR else folder / _EVENTS,
        detector_frames=finding.detector if sensor == FRAMES_SENSOR else MOTION,
        detector_events=finding.detector if sensor == EVENTS_SENSOR else MOTION,
        detector_fused=finding.detector if sensor == FUSED_SENSOR else None,
        settings=finding.settings,
    )
    begun = time.process_time()
    detections = detect_files(request)
    return RawFound(finding, detections, time.process_time() - begun)


def described(folders: list[Path]) -> list[dict[str, Any]]:
    """Return names and checksums of data sets, and how the simulated ones were made, as JSON."""
    import yaml

    found = []
    for folder in folders:
        one: dict[str, Any] = {"name": folder.resolve().name}
        if (folder / _MANIFEST).is_file():
            one["sha256 of manifest.json"] = sha256_of(folder / _MANIFEST)
        settings = folder / "settings.yaml"
        if settings.is_file():
            try:
                one["settings"] = yaml.safe_load(settings.read_text(encoding="utf-8"))
            except (yaml.YAMLError, UnicodeDecodeError):
                raise DataError("cannot be read", settings) from None
        found.append(one)
    return found


def detector_named(detector: str, kind: str) -> dict[str, Any]:
    """Return a detector's name, and of a file its checksum.

    Raises:
        ConfigError: a name that is not known.
        DataError: no such file.
    """
    if detector == MOTION:
        return {"name": detector}
    path = network_file(detector, kind)
    if not path.is_file():
        raise DataError("no such file of a network", path)
    return {"name": path.name, "sha256": sha256_of(path)}
