"""Average precision of raw detections, to see how hard a scenario is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth


def iou_matrix(a: FloatArray, b: FloatArray) -> FloatArray:
    """Intersection over union (M, K) of boxes (M, 4) and (K, 4), left, top, width, height."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, :2] + a[:, None, 2:], b[None, :, :2] + b[None, :, 2:])
    inter = np.prod(np.maximum(high - low, 0.0), axis=2)
    union = np.prod(a[:, 2:], axis=1)[:, None] + np.prod(b[:, 2:], axis=1) - inter
    out: FloatArray = inter / union
    return out


def average_precision(pairs: Sequence[tuple[Detections, GroundTruth]], iou: float = 0.5) -> float:
    """Average precision of one class, pooled over recordings, as COCO defines it.

    In each scan, detections take, from the highest score down, the free true box that they overlap most, if
    by at least `iou`; one that finds none but overlaps an ignored box that much is left out. Precision is
    made non-increasing from the right and averaged at 101 levels of recall.

    Args:
        pairs: detections of one sensor each, and the truth at the times of its scans.
        iou: least overlap.

    Returns:
        Average precision in [0, 1]; NaN where there is no true box.
    """
    scores: list[FloatArray] = []
    hits: list[BoolArray] = []
    total = 0
    for detections, truth in pairs:
        total += int((~truth.ignore).sum())
        order = np.argsort(truth.t, kind="stable")
        t, boxes, ignore = truth.t[order], truth.boxes[order], truth.ignore[order]
        first = np.searchsorted(t, detections.scan_t, "left")
        last = np.searchsorted(t, detections.scan_t, "right")
        for k in range(detections.num_scans):
            scan, rows = detections.scan(k), slice(int(first[k]), int(last[k]))
            hit, counted = _match(scan.boxes, scan.scores, boxes[rows], ignore[rows], iou)
            scores.append(scan.scores[counted])
            hits.append(hit[counted])
    if total == 0:
        return float("nan")
    score = np.concatenate(scores) if scores else np.zeros(0)
    hit = np.concatenate(hits) if hits else np.zeros(0, dtype=bool)
    hit = hit[np.argsort(-score, kind="stable")]
    found = np.cumsum(hit)
    recall, precision = found / total, found / np.arange(1, len(hit) + 1)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    at = np.searchsorted(recall, np.linspace(0.0, 1.0, 101), "left")
    return float(np.append(envelope, 0.0)[at].mean())


def _match(
    boxes: FloatArray, scores: FloatArray, true: FloatArray, ignore: BoolArray, least: float
) -> tuple[BoolArray, BoolArray]:
    """Match one scan: which detections are hits (M,), and which count at all (M,)."""
    hit, counted = np.zeros(len(boxes), dtype=bool), np.ones(len(boxes), dtype=bool)
    if not len(boxes) or not len(true):
        return hit, counted
    overlap = iou_matrix(boxes, true)
    good = np.where(ignore, 0.0, overlap)
    spared = np.where(ignore, overlap, 0.0).max(axis=1) >= least
    for row in np.argsort(-scores, kind="stable"):
        best = int(np.argmax(good[row]))
        if good[row, best] >= least:
            hit[row] = True
            good[:, best] = 0.0
        else:
            counted[row] = not spared[row]
    return hit, counted
