"""Recordings cut to what a calibration is judged on: shortened, and in two halves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jeat_graph.calibration.supervised import Recording
from jeat_graph.data.arrays import IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth, Trajectories

_BEFORE_S = 0.5


def shorten(recordings: Sequence[Recording], max_scans: int) -> list[Recording]:
    """Keep of each recording where most true boxes are: the same share of all, `max_scans` in all or so."""
    total = sum(detections.num_scans for detections, _ in recordings)
    share = max_scans / max(total, 1)
    if share >= 1.0:
        return list(recordings)
    return [_fullest(*one, max(int(share * one[0].num_scans), 1)) for one in recordings]


def folds(recordings: Sequence[Recording]) -> list[list[Recording]]:
    """Split recordings into two halves: every other one, or a single one in the middle of its time."""
    if len(recordings) > 1:
        return [list(recordings[0::2]), list(recordings[1::2])]
    detections, truth = recordings[0]
    instants = instant_starts(detections)
    if len(instants) < 3:
        return [list(recordings)]
    middle = int(instants[np.argmin(np.abs(instants - detections.num_scans // 2))])
    t = float(detections.scan_t[middle - 1])
    first = (cut_scans(detections, 0, middle), cut_truth(truth, -np.inf, t))
    second = (cut_scans(detections, middle, detections.num_scans), cut_truth(truth, t, np.inf))
    return [[first], [second]] if len(first[1].t) and len(second[1].t) else [list(recordings)]


def instant_starts(detections: Detections) -> IntArray:
    """First scan of each instant, and the number of scans: scans of one time are taken in together."""
    return np.searchsorted(detections.scan_t, np.append(np.unique(detections.scan_t), np.inf))


def _fullest(detections: Detections, truth: GroundTruth, scans: int) -> Recording:
    """Cut a recording to about so many scans, where it has most true boxes that are to be found."""
    instants = instant_starts(detections)
    first = instants[: max(int(np.searchsorted(instants, detections.num_scans - scans, side="right")), 1)]
    end = instants[np.searchsorted(instants, first + scans)]
    there = np.sort(truth.t[~truth.ignore])
    since = np.searchsorted(there, detections.scan_t[first])
    until = np.searchsorted(there, detections.scan_t[end - 1], side="right")
    k = int(np.argmax(until - since))
    low, high = int(first[k]), int(end[k])
    before = float(detections.scan_t[low - 1]) if low else -np.inf
    return cut_scans(detections, low, high), cut_truth(truth, before, float(detections.scan_t[high - 1]))


def cut_scans(detections: Detections, first: int, end: int) -> Detections:
    """Keep the scans from `first` up to, but without, `end`."""
    low, high = int(detections.scan_start[first]), int(detections.scan_start[end])
    return replace(
        detections,
        scan_t=detections.scan_t[first:end],
        scan_sensor=detections.scan_sensor[first:end],
        scan_start=detections.scan_start[first : end + 1] - low,
        boxes=detections.boxes[low:high],
        scores=detections.scores[low:high],
        classes=None if detections.classes is None else detections.classes[low:high],
        embeddings=None if detections.embeddings is None else detections.embeddings[low:high],
    )


def cut_truth(truth: GroundTruth, start: float, end: float) -> GroundTruth:
    """Keep the truth after the time `start` and up to the time `end` (s)."""
    keep = (truth.t > start) & (truth.t <= end)
    frames = truth.frames
    return GroundTruth(
        t=truth.t[keep],
        object_id=truth.object_id[keep],
        boxes=truth.boxes[keep],
        motion=None if truth.motion is None else truth.motion[keep],
        ignore=truth.ignore[keep],
        classes=None if truth.classes is None else truth.classes[keep],
        distance=None if truth.distance is None else truth.distance[keep],
        frames=None if frames is None else frames[(frames > start) & (frames <= end)],
    )


def in_parts(
    truth: GroundTruth, tables: Sequence[Trajectories], count: int
) -> list[tuple[GroundTruth, list[Trajectories]]]:
    """Cut a truth and its tables into parts of its time with about as many true boxes in each.

    A part takes a table's rows from half a second before it to half a second after it, so that what is
    predicted or interpolated into its frames is there.

    Args:
        truth: of one recording.
        tables: of the same.
        count: how many parts; fewer come back where there are fewer frames with something to find.
    """
    there = np.sort(truth.t[~truth.ignore])
    if not len(there):
        return []
    ends = np.unique(there[(np.arange(1, count + 1) * len(there)) // count - 1])
    starts = np.concatenate(([-np.inf], ends[:-1]))
    ends = np.append(ends[:-1], np.inf)
    out = []
    for start, end in zip(starts, ends, strict=True):
        part = cut_truth(truth, float(start), float(end))
        frames = part.frame_times()
        kept = []
        for one in tables:
            near = (one.t > start - _BEFORE_S) & (one.t <= end + _BEFORE_S)
            # Rows before or after all of its frames say nothing in this part.
            kept.append(one.take(near & np.any((one.t >= frames[0]) & (one.t <= frames[-1]))))
        out.append((part, kept))
    return out
