"""Average precision of raw detections, COCO style: AP at IoU 0.50 and mean AP over 0.50, 0.55 … 0.95.

Precision is interpolated at 101 recalls. Truth exists at its own times only: each frame of the truth is
compared with the nearest scan of the sensor, if there is one within a tolerance; a faster sensor's other
scans are left out. Where the truth has motion its boxes are moved to the time of the scan.

A detection that matches no object, but matches an ignored box or has half of its area on one, counts
neither way. Source: Lin et al. 2014 and the rules of the COCO detection challenge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from jeat_graph.association.overlap import pairwise_covered, pairwise_iou
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.matching import IGNORE_COVERED

THRESHOLDS: FloatArray = np.linspace(0.5, 0.95, 10)
RECALLS: FloatArray = np.linspace(0.0, 1.0, 101)
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class AveragePrecision:
    """Detection quality of one sensor, in per cent.

    Attributes:
        AP: mean over the IoU thresholds 0.50 … 0.95.
        AP50: at IoU 0.50.
        AP75: at IoU 0.75.
        recall50: share of the objects found at IoU 0.50, whatever the score.
        frames: frames of the truth that had a scan.
        truth_boxes: objects to be found in them.
        detections: detections in those scans.
    """

    AP: float
    AP50: float
    AP75: float
    recall50: float
    frames: int
    truth_boxes: int
    detections: int

    def as_dict(self) -> dict[str, float | int]:
        """Return the values by name."""
        return asdict(self)


def detection_ap(
    pairs: Sequence[tuple[GroundTruth, Detections]],
    *,
    tolerance_s: float = 0.01,
    sides_px: tuple[float, float] = (0.0, np.inf),
) -> dict[str, AveragePrecision]:
    """Average precision of every sensor, pooled over sequences.

    Args:
        pairs: truth and detections of each sequence.
        tolerance_s: largest distance in time of a scan to its frame (s).
        sides_px: only objects with the root of their area from the first to below the second are asked for;
            others are ignored, and so are detections of other sizes that find nothing.

    Returns:
        By sensor, in alphabetical order; NaN where there is no object to be found.

    Raises:
        DataError: no scan of a sensor lies at a frame of the truth.
    """
    names = sorted({name for _, detections in pairs for name in detections.sensors})
    return {name: _sensor_ap(pairs, name, tolerance_s, sides_px) for name in names}


def nearest_scans(frames: FloatArray, scans: FloatArray, tolerance_s: float) -> tuple[IntArray, IntArray]:
    """Pair frames with scans, each used at most once.

    Args:
        frames: (T,) ascending times (s).
        scans: (K,) ascending times (s).
        tolerance_s: largest distance in time of a pair.

    Returns:
        Indices of frames (P,) and of their scans (P,).
    """
    if not len(frames) or not len(scans):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    scan = _nearest(scans, frames)
    # Of several frames at one scan the nearest keeps it: both must be each other's nearest.
    mutual = _nearest(frames, scans)[scan] == np.arange(len(frames))
    good = mutual & (np.abs(scans[scan] - frames) <= tolerance_s + 1e-9)
    return np.flatnonzero(good), scan[good]


def _nearest(values: FloatArray, wanted: FloatArray) -> IntArray:
    after = np.clip(np.searchsorted(values, wanted), 1, max(len(values) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(values) - 1)
    closer: IntArray = np.where(wanted - values[before] <= values[after] - wanted, before, after)
    return closer


def _sensor_ap(
    pairs: Sequence[tuple[GroundTruth, Detections]],
    sensor: str,
    tolerance_s: float,
    sides_px: tuple[float, float],
) -> AveragePrecision:
    scores: list[FloatArray] = []
    hits: list[BoolArray] = []
    outs: list[BoolArray] = []
    frames = truth_boxes = 0
    for truth, detections in pairs:
        if sensor not in detections.sensors:
            continue
        scans = np.flatnonzero(detections.scan_sensor == detections.sensors.index(sensor))
        times = truth.frame_times()
        frame, scan = nearest_scans(times, detections.scan_t[scans], tolerance_s)
        order = np.argsort(truth.t, kind="stable")
        begin = np.searchsorted(truth.t[order], times[frame] - 1e-6)
        end = np.searchsorted(truth.t[order], times[frame] + 1e-6)
        for k, s in enumerate(scans[scan]):
            rows = order[begin[k] : end[k]]
            boxes = _moved(truth, rows, float(detections.scan_t[s] - times[frame[k]]))
            own = slice(int(detections.scan_start[s]), int(detections.scan_start[s + 1]))
            rank = np.argsort(-detections.scores[own], kind="stable")
            ignored = truth.ignore[rows] | ~_of_size(boxes, sides_px)
            hit, out = match_greedily(detections.boxes[own][rank], boxes, ignored)
            out |= ~hit & ~_of_size(detections.boxes[own][rank], sides_px)
            scores.append(detections.scores[own][rank])
            hits.append(hit)
            outs.append(out)
            truth_boxes += int((~ignored).sum())
        frames += len(frame)
    if not frames:
        raise DataError(f"no scan of sensor {sensor} lies within {tolerance_s:g} s of a frame of the truth")
    score, hit, out = np.concatenate(scores), np.concatenate(hits, axis=1), np.concatenate(outs, axis=1)
    ap, recall = average_precision(score, hit, out, truth_boxes)
    return AveragePrecision(
        AP=100.0 * float(ap.mean()),
        AP50=100.0 * float(ap[0]),
        AP75=100.0 * float(ap[5]),
        recall50=100.0 * float(recall[0]),
        frames=frames,
        truth_boxes=truth_boxes,
        detections=len(score),
    )


def _of_size(boxes: FloatArray, sides_px: tuple[float, float]) -> BoolArray:
    """Tell which boxes (M, 4) have the root of their area within the limits (px)."""
    side = np.sqrt(boxes[:, 2] * boxes[:, 3])
    return np.asarray((side >= sides_px[0]) & (side < sides_px[1]))


def _moved(truth: GroundTruth, rows: IntArray, dt: float) -> FloatArray:
    boxes = truth.boxes[rows].copy()
    if truth.motion is not None:
        motion = np.nan_to_num(truth.motion[rows])
        boxes[:, :2] += motion[:, 2:4] * dt + motion[:, 4:6] * (0.5 * dt * dt)
    return boxes


def match_greedily(boxes: FloatArray, truth: FloatArray, ignore: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Give each detection, best score first, the free object it overlaps most.

    Args:
        boxes: (M, 4) detections by falling score.
        truth: (G, 4) true boxes.
        ignore: (G,) true boxes to be ignored.

    Returns:
        For each of the 10 thresholds and each detection: whether it found an object (10, M), and whether it
        is to be left out (10, M).
    """
    iou = pairwise_iou(boxes, truth[~ignore])
    on_ignored = pairwise_iou(boxes, truth[ignore]).max(axis=1, initial=0.0)
    covered = pairwise_covered(boxes, truth[ignore]).max(axis=1, initial=0.0) >= IGNORE_COVERED
    hit = np.zeros((len(THRESHOLDS), len(boxes)), dtype=bool)
    if iou.size:
        free = np.ones((len(THRESHOLDS), iou.shape[1]), dtype=bool)
        level = np.arange(len(THRESHOLDS))
        for k in np.flatnonzero(iou.max(axis=1) >= THRESHOLDS[0]):
            value = np.where(free, iou[k], -1.0)
            best = value.argmax(axis=1)
            hit[:, k] = value[level, best] >= THRESHOLDS
            free[level[hit[:, k]], best[hit[:, k]]] = False
    out = ~hit & (covered[None, :] | (on_ignored[None, :] >= THRESHOLDS[:, None]))
    return hit, out


def average_precision(
    score: FloatArray, hit: BoolArray, out: BoolArray, truth_boxes: int
) -> tuple[FloatArray, FloatArray]:
    """Area under the interpolated precision-recall curve, by threshold.

    Args:
        score: (M,) scores of all detections.
        hit: (L, M) whether each found an object, by threshold.
        out: (L, M) whether it is left out.
        truth_boxes: number of objects.

    Returns:
        AP (L,) and the largest recall (L,) as shares; NaN where there are no objects.
    """
    if not truth_boxes:
        return np.full(len(hit), np.nan), np.full(len(hit), np.nan)
    order = np.argsort(-score, kind="stable")
    ap, recalls = np.zeros(len(hit)), np.zeros(len(hit))
    for level in range(len(hit)):
        counted = order[~out[level, order]]
        true = np.cumsum(hit[level, counted])
        if not len(true):
            continue
        recall = true / truth_boxes
        precision = true / np.arange(1, len(true) + 1)
        # The best precision at this recall or any higher one.
        envelope = np.append(np.maximum.accumulate(precision[::-1])[::-1], 0.0)
        ap[level] = envelope[np.searchsorted(recall, RECALLS, side="left")].mean()
        recalls[level] = recall[-1]
    return ap, recalls
