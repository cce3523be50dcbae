"""Detections with the confirmed tracks that took them: what calibration goes by where there is no truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.association.boxes import occluded_fraction
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import portion, told
from jeat_graph.tracking.whole import track

_MIN_ROWS = 50
# Tracks are followed through gaps as long as this, so that the misses in them are counted.
_REPORT_GAP_S = 1.0


@dataclass(frozen=True, eq=False)
class TrackedDetections:
    """Detections of one or more recordings with the confirmed tracks that took them.

    Attributes:
        t: (K,) time of each taken detection (s), ascending within a track.
        track: (K,) number of its track, ascending.
        sensor: (K,) index into the configuration's sensor names.
        box: (K, 4) the detection (px).
        detected: per sensor (L,), for each confirmed track at each scan in its life, whether it was detected.
        speed: per sensor (L,), the track's image speed then (px/s).
        visible: per sensor (L,), the part of the track's box that no nearer track hides.
        score: per sensor (D,), scores of all detections.
        taken: per sensor (D,), whether a confirmed track took it.
        scans: per sensor, the number of scans.
    """

    t: FloatArray
    track: IntArray
    sensor: IntArray
    box: FloatArray
    detected: tuple[BoolArray, ...]
    speed: tuple[FloatArray, ...]
    visible: tuple[FloatArray, ...]
    score: tuple[FloatArray, ...]
    taken: tuple[BoolArray, ...]
    scans: tuple[int, ...]


def follow(recordings: Sequence[Detections], config: Config) -> TrackedDetections:
    """Track recordings and find out which detection each track took.

    Args:
        recordings: detections.
        config: declares all their sensors.
    """
    # Reported from birth on; afterwards those are kept that were confirmed at some time.
    eager = replace(
        config,
        lifecycle=replace(config.lifecycle, confirm_existence=0.0),
        output=replace(config.output, min_existence=0.0, max_gap_s=_REPORT_GAP_S, max_gap_scans=0.0),
    )
    names = config.sensor_names
    cols: dict[str, list[FloatArray]] = {name: [] for name in ("t", "track", "sensor", "box")}
    detected: list[list[BoolArray]] = [[] for _ in names]
    speed: list[list[FloatArray]] = [[] for _ in names]
    visible: list[list[FloatArray]] = [[] for _ in names]
    score: list[list[FloatArray]] = [[] for _ in names]
    taken: list[list[BoolArray]] = [[] for _ in names]
    scans = [0] * len(names)
    first_track = 0
    for detections in told(recordings):
        with portion(0.0, 0.6):
            table = track(eager, detections)
        sure = table.existence >= config.lifecycle.confirm_existence
        kept = np.isin(table.track_id, np.unique(table.track_id[sure]))
        table = table.take(kept)
        _, number = np.unique(table.track_id, return_inverse=True)
        for s, name in enumerate(names):
            if name not in detections.sensors:
                continue
            own = np.flatnonzero(detections.scan_sensor == detections.sensors.index(name))
            scans[s] += len(own)
            first = np.searchsorted(table.t, detections.scan_t[own])
            last = np.searchsorted(table.t, detections.scan_t[own], side="right")
            bit = (table.used >> s & 1).astype(bool)
            for k, lo, hi in zip(own, first, last, strict=True):
                scan = detections.scan(int(k))
                got = np.zeros(len(scan), dtype=bool)
                rows = np.arange(lo, hi)
                detected[s].append(bit[rows])
                speed[s].append(np.hypot(table.mean[rows, 2], table.mean[rows, 3]))
                visible[s].append(1.0 - occluded_fraction(table.boxes[rows], table.existence[rows]))
                rows = rows[bit[rows]]
                if len(rows) and len(scan):
                    j = _nearest(table.mean[rows, :2], table.boxes[rows, 2:], scan.boxes)
                    got[j] = True
                    cols["t"].append(np.full(len(rows), scan.t))
                    cols["track"].append(first_track + number[rows])
                    cols["sensor"].append(np.full(len(rows), s))
                    cols["box"].append(scan.boxes[j])
                score[s].append(scan.scores)
                taken[s].append(got)
        first_track += int(number.max(initial=-1)) + 1
    if sum(len(c) for c in cols["t"]) < _MIN_ROWS:
        raise DataError(
            "the tracker could follow almost nothing; calibrate with --gt, or from a better --config"
        )
    flat = {name: np.concatenate(parts) for name, parts in cols.items()}
    order = np.lexsort((flat["sensor"], flat["t"], flat["track"]))
    return TrackedDetections(
        t=flat["t"][order],
        track=flat["track"][order].astype(np.int64),
        sensor=flat["sensor"][order].astype(np.int64),
        box=flat["box"][order],
        detected=tuple(np.concatenate(x) if x else np.zeros(0, dtype=bool) for x in detected),
        speed=tuple(np.concatenate(x) if x else np.zeros(0) for x in speed),
        visible=tuple(np.concatenate(x) if x else np.zeros(0) for x in visible),
        score=tuple(np.concatenate(x) if x else np.zeros(0) for x in score),
        taken=tuple(np.concatenate(x) if x else np.zeros(0, dtype=bool) for x in taken),
        scans=tuple(scans),
    )


def _nearest(centre: FloatArray, side: FloatArray, boxes: FloatArray) -> IntArray:
    """Detection (R,) nearest, in centre and size, to each track that was updated with one of them."""
    found = boxes[:, :2] + 0.5 * boxes[:, 2:]
    scale = np.sqrt(side.prod(axis=1))[:, None]
    away = np.sum((found[None] - centre[:, None]) ** 2, axis=2) / scale**2
    size = np.sum((np.log(boxes[None, :, 2:]) - np.log(side[:, None])) ** 2, axis=2)
    return np.asarray(np.argmin(away + size, axis=1), dtype=np.int64)
