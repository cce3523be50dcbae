"""Detections with the confirmed tracks that took them: what clocks are compared by without truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import progress_span, with_progress
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.runs.declaring import own_picture
from jeat_graph.tracking.whole import track

_MIN_ROWS = 50


@dataclass(frozen=True, eq=False)
class TrackedDetections:
    """Detections of one or more recordings with the confirmed tracks that took them.

    Attributes:
        t: (K,) time of each taken detection (s), ascending within a track.
        track: (K,) number of its track, ascending.
        sensor: (K,) index into the configuration's sensor names.
        box: (K, 4) the detection (px).
    """

    t: FloatArray
    track: IntArray
    sensor: IntArray
    box: FloatArray


def follow(recordings: Sequence[Detections], config: Config) -> TrackedDetections:
    """Track recordings and find out which detection each track took.

    Args:
        recordings: detections.
        config: declares all their sensors.
    """
    names = config.sensor_names
    cols: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in ("t", "track", "sensor", "box")}
    first_track = 0
    for detections in with_progress(recordings):
        with progress_span(0.0, 0.6):
            table = track(own_picture(config, detections), detections)
        _, number = np.unique(table.track_id, return_inverse=True)
        for s, name in enumerate(names):
            for rows, scan, j in taken_in_scan(table, detections, name, s):
                cols["t"].append(np.full(len(rows), scan.t))
                cols["track"].append(first_track + number[rows])
                cols["sensor"].append(np.full(len(rows), s))
                cols["box"].append(scan.boxes[j])
        first_track += int(number.max(initial=-1)) + 1
    if sum(len(c) for c in cols["t"]) < _MIN_ROWS:
        raise DataError("the tracker could follow almost nothing")
    flat = {name: np.concatenate(parts) for name, parts in cols.items()}
    order = np.lexsort((flat["sensor"], flat["t"], flat["track"]))
    return TrackedDetections(
        t=flat["t"][order],
        track=flat["track"][order].astype(np.int64),
        sensor=flat["sensor"][order].astype(np.int64),
        box=flat["box"][order],
    )


def taken_in_scan(
    table: Trajectories, detections: Detections, name: str, s: int
) -> Iterator[tuple[IntArray, Scan, IntArray]]:
    """Yield of each scan of a sensor what tracks took of it.

    Args:
        table: causal tracks, with rows at the times of the scans.
        detections: of the recording.
        name: of the sensor.
        s: its bit in the table's `used`.

    Yields:
        Rows (R,) of the table whose tracks took a detection, the scan, and which (R,) each took.
    """
    if name not in detections.sensors:
        return
    own = np.flatnonzero(detections.scan_sensor == detections.sensors.index(name))
    first = np.searchsorted(table.t, detections.scan_t[own])
    last = np.searchsorted(table.t, detections.scan_t[own], side="right")
    bit = (table.used >> s & 1).astype(bool)
    for k, lo, hi in zip(own, first, last, strict=True):
        scan = detections.scan(int(k))
        rows = np.arange(lo, hi)
        rows = rows[bit[rows]]
        if len(rows) and len(scan):
            yield rows, scan, _nearest(table.mean[rows, :2], table.boxes[rows, 2:], scan.boxes)


def _nearest(centre: FloatArray, side: FloatArray, boxes: FloatArray) -> IntArray:
    """Detection (R,) nearest, in centre and size, to each track that was updated with one of them."""
    found = boxes[:, :2] + 0.5 * boxes[:, 2:]
    scale = np.sqrt(side.prod(axis=1))[:, None]
    away = np.sum((found[None] - centre[:, None]) ** 2, axis=2) / scale**2
    size = np.sum((np.log(boxes[None, :, 2:]) - np.log(side[:, None])) ** 2, axis=2)
    return np.asarray(np.argmin(away + size, axis=1), dtype=np.int64)
