"""Recordings that trackers are judged on, and the sets in which their scores are pooled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth


@dataclass(frozen=True, eq=False)
class JudgedRecording:
    """Detections with their truth.

    Attributes:
        name: say `day/0` or `MOT17-02`.
        detections: scans of all sensors.
        truth: boxes.
        image: width and height of the picture (px), None where not known.
    """

    name: str
    detections: Detections
    truth: GroundTruth
    image: tuple[float, float] | None = None

    def instants(self, sensors: Sequence[str] | None = None) -> FloatArray:
        """Times (T,) at which a tracker that is given `sensors` (all by default) reports."""
        return np.unique(self.only(sensors).scan_t)

    def only(self, sensors: Sequence[str] | None) -> Detections:
        """Detections of some sensors, all by default."""
        return self.detections if sensors is None else self.detections.select(sensors)


@dataclass(frozen=True, eq=False)
class RecordingSet:
    """Recordings of one kind, whose scores are pooled.

    Attributes:
        name: in the tables.
        recordings: in the order of their names.
    """

    name: str
    recordings: tuple[JudgedRecording, ...]

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the detectors; of several, the slowest comes first: it sets the frames of the peers."""
        first = self.recordings[0].detections
        return tuple(sorted(first.sensors, key=lambda name: (len(first.sensor_times(name)), name != "rgb")))

    @property
    def streams(self) -> list[tuple[str, ...]]:
        """What a tracker is given in turn: all detectors, then each alone."""
        alone: list[tuple[str, ...]] = [(name,) for name in self.sensors]
        return alone if len(alone) == 1 else [self.sensors, *alone]
