"""The real recordings by set: cars and pedestrians seen by two detectors, pedestrians seen by one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from benchmarks.recordings import JudgedRecording
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth

TUD_RATE_HZ = 25.0


@dataclass(frozen=True)
class RealSet:
    """Recordings of one kind of scene, whose scores are pooled.

    Attributes:
        name: in the tables.
        sensors: names of the detectors; of several, the first sets the frames of trackers that know only one.
        recordings: in order of their names.
    """

    name: str
    sensors: tuple[str, ...]
    recordings: tuple[JudgedRecording, ...]

    @property
    def streams(self) -> list[tuple[str, ...]]:
        """What a tracker may be given: each detector alone, and all of them."""
        alone: list[tuple[str, ...]] = [(name,) for name in self.sensors]
        return alone if len(alone) == 1 else [*alone, self.sensors]


@lru_cache(maxsize=4)
def real_sets(data: Path, most: int | None = None) -> tuple[RealSet, ...]:
    """Read the sets that are there.

    Args:
        data: folder that holds `kitti`, `kitti-pedestrian` and `tud`; any of them may be missing.
        most: recordings of each set, the first ones; all by default.
    """
    found = []
    for name, folder in (("KITTI cars", "kitti"), ("KITTI pedestrians", "kitti-pedestrian")):
        paths = sorted(p for p in (data / folder).glob("*") if (p / "detections.csv").is_file())[:most]
        if paths:
            found.append(RealSet(name, ("rgb", "lidar"), tuple(_columns(path) for path in paths)))
    paths = sorted(p for p in (data / "tud").glob("*") if (p / "det.txt").is_file())[:most]
    if paths:
        found.append(RealSet("TUD pedestrians", ("rgb",), tuple(_motchallenge(path) for path in paths)))
    return tuple(found)


def real_set(data: Path, most: int | None, name: str) -> RealSet:
    """The set of that name; arguments otherwise as in `real_sets`."""
    return next(one for one in real_sets(data, most) if one.name == name)


def _columns(path: Path) -> JudgedRecording:
    from jeat_graph.io.detections_io import read_detections
    from jeat_graph.io.truth_io import read_truth

    return _recording(path.name, read_detections(path / "detections.csv"), read_truth(path / "gt.csv"))


def _motchallenge(path: Path) -> JudgedRecording:
    from jeat_graph.io.detections_io import read_detections
    from jeat_graph.io.truth_io import read_truth

    detections = read_detections(path / "det.txt", rate_hz=TUD_RATE_HZ)
    return _recording(path.name, detections, read_truth(path / "gt.txt", rate_hz=TUD_RATE_HZ))


def _recording(name: str, detections: Detections, truth: GroundTruth) -> JudgedRecording:
    # Frames without any object are frames too: a track there is false.
    frames = np.unique(np.concatenate([truth.frame_times(), detections.scan_t]))
    return JudgedRecording(name, detections, replace(truth, frames=frames))
