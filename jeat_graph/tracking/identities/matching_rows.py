"""Which detections the rows of corrected tracks lie on, so that these are theirs."""

from __future__ import annotations

import numpy as np

from jeat_graph.association.assignment import assign
from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.corrected_tracks import CorrectedTracks
from jeat_graph.data.detections import Detections

#: A row and a detection that overlap less are not of one object (IoU).
LEAST_IOU = 0.3
#: A track is there between two of its rows that are at most so many periods of the file apart.
_BRIDGED = 1.5
#: Times that differ by less are one (s): files of frames round them.
SAME_S = 1e-4


def period_of(t: FloatArray) -> float:
    """Return the period of a file (s): half of its time lies in steps between its times that are no longer.

    Args:
        t: (R,) times of its rows.
    """
    steps = np.sort(np.diff(np.unique(t)))
    steps = steps[steps > SAME_S]
    return float(steps[np.searchsorted(np.cumsum(steps), steps.sum() / 2.0)]) if len(steps) else 2.0 * SAME_S


def owners_of(detections: Detections, rows: CorrectedTracks, code: IntArray) -> IntArray:
    """Return whose each detection (N,) is, 0 for nobody's.

    At each scan a track is where its row is, or between two rows where the file has none of that time. Of
    each scan the assignment with the greatest sum of IoU counts, of pairs with `LEAST_IOU` at least.

    Args:
        detections: all scans.
        rows: of the tracks.
        code: (R,) number of each row's track, from 1.
    """
    out = np.zeros(len(detections), dtype=np.int64)
    scan, track, boxes = _at_scans(detections.scan_t, rows, code)
    order = np.argsort(scan, kind="stable")
    bounds = np.searchsorted(scan[order], np.arange(detections.num_scans + 1))
    for k in range(detections.num_scans):
        there = order[bounds[k] : bounds[k + 1]]
        own = slice(int(detections.scan_start[k]), int(detections.scan_start[k + 1]))
        if len(there) and own.stop > own.start:
            iou = pairwise_iou(boxes[there], detections.boxes[own])
            row, column = assign(np.where(iou >= LEAST_IOU, iou, 0.0))
            out[own.start + column] = track[there[row]]
    return out


def _at_scans(
    scan_t: FloatArray, rows: CorrectedTracks, code: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return where the tracks are at the scans: scan (L,), number of the track (L,) and box (L, 4)."""
    period = period_of(rows.t)
    file_t = np.unique(rows.t)
    present = np.abs(file_t[nearest(file_t, scan_t)] - scan_t) <= SAME_S
    found: list[tuple[IntArray, IntArray, FloatArray]] = []
    order = np.lexsort((rows.t, code))
    for own in np.split(order, np.flatnonzero(np.diff(code[order])) + 1):
        t, boxes = rows.t[own], rows.boxes[own]
        first, last = np.searchsorted(scan_t, [t[0] - period / 2, t[-1] + period / 2 + SAME_S])
        scans = np.arange(first, last)
        at = scan_t[scans]
        gap = np.abs(t[nearest(t, at)] - at)
        behind = np.clip(np.searchsorted(t, at), 1, max(len(t) - 1, 1))
        between = np.zeros(len(at), dtype=bool)
        if len(t) > 1:
            between = (at >= t[0]) & (at <= t[-1]) & (t[behind] - t[behind - 1] <= _BRIDGED * period)
        there = np.where(present[scans], gap <= SAME_S, between | (gap <= period / 2))
        at, scans = at[there], scans[there]
        box = np.where(
            between[there, None],
            np.stack([np.interp(at, t, boxes[:, k]) for k in range(4)], axis=1),
            boxes[nearest(t, at)],
        )
        found.append((scans, np.full(len(scans), code[own[0]]), box))
    scan, track, boxes = (np.concatenate(column) for column in zip(*found, strict=True))
    return scan, track, boxes


def nearest(among: FloatArray, t: FloatArray) -> IntArray:
    """Return which of ascending times (T,) is nearest to each of others (K,)."""
    behind = np.clip(np.searchsorted(among, t), 1, max(len(among) - 1, 1))
    if len(among) < 2:
        return np.zeros(len(t), dtype=np.int64)
    return np.asarray(behind - (t - among[behind - 1] <= among[behind] - t), dtype=np.int64)
