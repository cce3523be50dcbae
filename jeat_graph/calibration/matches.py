"""Detections matched with the truth: the pairs from which all else is estimated."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from jeat_graph.association.overlap import pairwise_covered, pairwise_iou
from jeat_graph.config.schema import ImageConfig
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.matching import IGNORE_COVERED, match

# A detection is of a vehicle if it overlaps its true box by at least this IoU.
MATCH_IOU = 0.5
# A side so near to the edge of the picture is where the picture ends (px).
_EDGE_PX = 3.0


@dataclass(frozen=True, eq=False)
class SensorMatches:
    """All judged detections and all truth that one sensor could have seen, over all sequences.

    Attributes:
        scans: number of scans judged.
        score: (D,) score of each judged detection.
        correct: (D,) whether it is of a vehicle.
        residual: (C, 4) of the correct ones: centre errors over the true width and height, ln of the ratios
            of width and height.
        side: (C, 2) true width and height (px).
        key: (C, 2) sequence and object of each correct one.
        t: (C,) time (s).
        box: (C, 4) the detected box (px).
        hit_score: (C,) its score.
        seen: (G,) for each true box in view of a scan, whether it was detected.
        speed: (G,) its image speed (px/s), NaN where not known.
    """

    scans: int
    score: FloatArray
    correct: BoolArray
    residual: FloatArray
    side: FloatArray
    key: IntArray
    t: FloatArray
    box: FloatArray
    hit_score: FloatArray
    seen: BoolArray
    speed: FloatArray

    @staticmethod
    def pool(parts: list[SensorMatches]) -> SensorMatches:
        """Pool several sequences."""
        columns = {
            f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(SensorMatches)[1:]
        }
        return SensorMatches(scans=sum(p.scans for p in parts), **columns)

    def only_whole(self, image: ImageConfig) -> SensorMatches:
        """Leave out of the correct detections those that the picture's edge cuts: they have no centre.

        Args:
            image: its size.
        """
        low, far = self.box[:, :2], self.box[:, :2] + self.box[:, 2:]
        inside = (low > _EDGE_PX) & (far < np.array([image.width, image.height]) - _EDGE_PX)
        whole = inside.all(axis=1)
        columns = ("residual", "side", "key", "t", "box", "hit_score")
        rows = {name: getattr(self, name)[whole] for name in columns}
        return replace(self, **rows)


def match_sensor(detections: Detections, truth: GroundTruth, sensor: str, sequence: int = 0) -> SensorMatches:
    """Match the scans of one sensor with the truth at their own times.

    Truth between two of its frames is interpolated linearly; scans outside its span, or further than half a
    second into a gap of it, are not judged. What is to be ignored is left out (as `eval.frames` does).

    Args:
        detections: a recording.
        truth: its truth.
        sensor: name of the sensor.
        sequence: number of the recording, to keep its objects apart from others'.

    Raises:
        DataError: no scan of the sensor lies within the truth's time span.
    """
    frames = truth.frame_times()
    order = np.lexsort((truth.object_id, truth.t))
    start = np.searchsorted(truth.t[order], frames - 1e-6)
    stop = np.searchsorted(truth.t[order], frames + 1e-6)
    code = detections.sensors.index(sensor) if sensor in detections.sensors else -1
    chosen = np.flatnonzero(detections.scan_sensor == code)
    columns: dict[str, list[Any]] = {f.name: [] for f in fields(SensorMatches)[1:]}
    scans = 0
    for k in chosen:
        scan = detections.scan(int(k))
        right = int(np.searchsorted(frames, scan.t - 1e-6))
        if right >= len(frames) or (right == 0 and frames[0] > scan.t + 1e-6):
            continue
        left = right if abs(frames[right] - scan.t) <= 1e-6 else right - 1
        if frames[right] - frames[left] > 0.5:
            continue
        scans += 1
        boxes, ids, ignored, speed = _truth_between(truth, order, start, stop, frames, left, right, scan.t)
        iou = pairwise_iou(boxes, scan.boxes)
        truth_of = match(iou, MATCH_IOU)
        hit = truth_of >= 0
        covered = pairwise_covered(scan.boxes, boxes[ignored]).max(axis=1, initial=0.0) >= IGNORE_COVERED
        judged = np.where(hit, ~ignored[truth_of], ~covered) if len(boxes) else np.ones(len(scan), dtype=bool)
        good = hit & judged
        g = truth_of[good]
        found, true = scan.boxes[good], boxes[g]
        seen = np.zeros(len(boxes), dtype=bool)
        seen[g] = True
        columns["score"].append(scan.scores[judged])
        columns["correct"].append(hit[judged])
        centre = found[:, :2] + 0.5 * found[:, 2:] - true[:, :2] - 0.5 * true[:, 2:]
        columns["residual"].append(np.hstack([centre / true[:, 2:], np.log(found[:, 2:] / true[:, 2:])]))
        columns["side"].append(true[:, 2:])
        columns["key"].append(np.column_stack([np.full(len(g), sequence), ids[g]]))
        columns["t"].append(np.full(len(g), scan.t))
        columns["box"].append(found)
        columns["hit_score"].append(scan.scores[good])
        columns["seen"].append(seen[~ignored])
        columns["speed"].append(speed[~ignored])
    if not scans:
        raise DataError(f"no scan of sensor {sensor!r} lies within the time span of the truth")
    pooled: dict[str, Any] = {name: np.concatenate(parts) for name, parts in columns.items()}
    return SensorMatches(scans=scans, **pooled)


def _truth_between(
    truth: GroundTruth,
    order: IntArray,
    start: IntArray,
    stop: IntArray,
    frames: FloatArray,
    left: int,
    right: int,
    t: float,
) -> tuple[FloatArray, IntArray, BoolArray, FloatArray]:
    """Truth at `t` between two frames: boxes (G, 4), ids (G,), ignored (G,) and image speed (G,)."""
    a = order[start[left] : stop[left]]
    b = order[start[right] : stop[right]]
    if left == right:
        return truth.boxes[a], truth.object_id[a], truth.ignore[a], _speed(truth, a)
    # Ids of ignored regions need not be unique in a frame; those without a partner are held still.
    ids, ia, ib = np.intersect1d(truth.object_id[a], truth.object_id[b], return_indices=True)
    span = frames[right] - frames[left]
    f = (t - frames[left]) / span
    boxes = (1.0 - f) * truth.boxes[a[ia]] + f * truth.boxes[b[ib]]
    ignored = truth.ignore[a[ia]] | truth.ignore[b[ib]]
    move = truth.boxes[b[ib]] - truth.boxes[a[ia]]
    speed = np.hypot(*(move[:, :2] + 0.5 * move[:, 2:]).T) / span
    # Present in one frame only, it enters or leaves between them: it may be there at `t`, so it is ignored.
    leaving, entering = np.delete(a, ia), np.delete(b, ib)
    extra = np.concatenate([leaving, entering])
    before = order[start[left - 1] : stop[left - 1]] if left else order[:0]
    after = order[start[right + 1] : stop[right + 1]] if right + 1 < len(frames) else order[:0]
    moved = [_moved_on(truth, leaving, before, t), _moved_on(truth, entering, after, t)]
    boxes = np.vstack([boxes, *moved])
    ids = np.concatenate([ids, truth.object_id[extra]])
    ignored = np.concatenate([ignored, np.ones(len(extra), dtype=bool)])
    speed = np.concatenate([speed, np.full(len(extra), np.nan)])
    return boxes, ids, ignored, speed


def _moved_on(truth: GroundTruth, rows: IntArray, beyond: IntArray, t: float) -> FloatArray:
    """Boxes (R, 4) of a frame at `t`, as they move between it and the frame beyond it; else held still."""
    boxes = truth.boxes[rows]
    # Ids of ignored regions need not be unique.
    own = np.flatnonzero(~truth.ignore[rows])
    _, mine, theirs = np.intersect1d(truth.object_id[rows[own]], truth.object_id[beyond], return_indices=True)
    mine, theirs = own[mine], beyond[theirs]
    share = (t - truth.t[rows[mine]]) / (truth.t[rows[mine]] - truth.t[theirs])
    boxes[mine, :2] += share[:, None] * (boxes[mine, :2] - truth.boxes[theirs, :2])
    return boxes


def _speed(truth: GroundTruth, rows: IntArray) -> FloatArray:
    if truth.motion is None:
        return np.full(len(rows), np.nan)
    return np.asarray(np.hypot(truth.motion[rows, 2], truth.motion[rows, 3]))
