"""What a frame-by-frame tracker gets to see of one sensor, or of several merged into one.

Such trackers know one stream of frames. Of one sensor they get its scans, the empty ones included. Of
several they get early fusion: the frames are those of the first sensor named; each takes in the latest scan
of every other sensor since the frame before, and non-maximum suppression merges the boxes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.baselines.frames import BaselineFrame
from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError, UnknownSensorError
from jeat_graph.data.rates import ANY_RATE_HZ, median_rate_hz
from jeat_graph.eval.resampling import TIME_TOLERANCE_S


def suppress_overlapping(boxes: FloatArray, scores: FloatArray, iou: float) -> IntArray:
    """Greedy non-maximum suppression: indices of the boxes kept, best score first.

    Args:
        boxes: (M, 4) left, top, width, height (px).
        scores: (M,) confidence; of equal ones the earlier row wins.
        iou: boxes that overlap a better one by more than this are dropped.
    """
    order = np.argsort(-scores, kind="stable")
    overlap = pairwise_iou(boxes[order], boxes[order]) > iou
    keep = np.ones(len(order), dtype=bool)
    for k in range(len(order)):
        if keep[k]:
            keep[k + 1 :] &= ~overlap[k, k + 1 :]
    return order[keep].astype(np.int64)


def sensor_rate(detections: Detections, sensor: str) -> float:
    """Rate of a sensor (Hz), from the median interval of its scans; `ANY_RATE_HZ` where there are too few."""
    _index(detections, sensor)
    times = detections.sensor_times(sensor)
    return median_rate_hz(times) or ANY_RATE_HZ


def baseline_frames(
    detections: Detections, sensors: Sequence[str], *, min_score: float = 0.0, merge_iou: float = 0.5
) -> list[BaselineFrame]:
    """Build the frames that a single-stream tracker sees.

    Args:
        detections: scans of all sensors.
        sensors: the sensors to use; the first one sets the frames.
        min_score: boxes with less are left out.
        merge_iou: for several sensors, boxes that overlap a better one by more than this are merged.

    Raises:
        DataError: no sensor named.
        UnknownSensorError: a sensor without scans.
    """
    if not sensors:
        raise DataError("name at least one sensor for a baseline")
    scans = [np.flatnonzero(detections.scan_sensor == _index(detections, name)) for name in sensors]
    frame_t = detections.scan_t[scans[0]]
    picked = [scans[0]]
    for other in scans[1:]:
        t = detections.scan_t[other]
        latest = np.searchsorted(t, frame_t + TIME_TOLERANCE_S, side="right") - 1
        before = np.concatenate(([-np.inf], frame_t[:-1]))
        fresh = (latest >= 0) & (t[np.maximum(latest, 0)] > before + TIME_TOLERANCE_S)
        picked.append(np.where(fresh, other[np.maximum(latest, 0)], -1))
    return [
        _frame(detections, float(t), [int(column[k]) for column in picked], min_score, merge_iou)
        for k, t in enumerate(frame_t)
    ]


def _index(detections: Detections, sensor: str) -> int:
    if sensor not in detections.sensors:
        there = ", ".join(detections.sensors) or "none"
        raise UnknownSensorError(f"there are no scans of a sensor {sensor!r}; the detections have: {there}")
    return detections.sensors.index(sensor)


def _frame(
    detections: Detections, t: float, scans: list[int], min_score: float, merge_iou: float
) -> BaselineFrame:
    rows = [
        np.arange(detections.scan_start[k], detections.scan_start[k + 1]) if k >= 0 else np.zeros(0, np.int64)
        for k in scans
    ]
    sensor = np.repeat(np.arange(len(scans), dtype=np.int64), [len(r) for r in rows])
    row = np.concatenate(rows)
    good = detections.scores[row] >= min_score
    row, sensor = row[good], sensor[good]
    boxes, scores = detections.boxes[row], detections.scores[row]
    if len(scans) > 1:
        keep = suppress_overlapping(boxes, scores, merge_iou)
        boxes, scores, sensor = boxes[keep], scores[keep], sensor[keep]
    return BaselineFrame(t=t, boxes=boxes, scores=scores, sensor=sensor)
