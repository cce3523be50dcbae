"""Smoothed tracks as labels: boxes, how much each counts, and what is neither asked for nor wrong.

A label counts with the probability that its track is a vehicle. A box is masked, which means that a network
is neither asked for it nor wrong to find it, where the model itself is unsure of it:

- its existence is in the middle;
- its place or size is vague, or nobody detected it for a while before and after;
- a nearer vehicle hides a part of it;
- its track has just begun or is about to end: when a vehicle came into view is not known exactly.

What a detector believed to see and no track took is masked, too. All else is background.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.association.overlap import pairwise_covered, pairwise_iou
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth, Trajectories

#: Existence from which on a box is asked for, and below which there is only background.
SURE, ABSENT = 0.8, 0.2
#: Standard deviation of a side's place that is vague, as a share of the box's length along it. A box that is
#: wrong by a tenth of its width and of its height still overlaps the true one by IoU 0.68.
VAGUE_SHARE = 0.1
#: A box that no detector saw for so long (s), before and after, is only predicted.
UNSEEN_S = 0.25
#: Share that nearer boxes may hide of one that is asked for.
HIDDEN_SHARE = 0.3
#: At both ends of a track so much is masked (s).
END_S = 0.3
#: Score from which on a detection is more likely real than not, where nothing is known of its sensor.
BELIEVED_SCORE = 0.5
#: Where no track took such a detection, its place is masked for so long before and after (s): until the same
#: detector looks again, which says more.
MASKED_S = 0.1
#: Overlap (IoU) with a track's box at which a detection is of it, and share of a detection on one.
TAKEN_IOU, TAKEN_SHARE = 0.3, 0.7
#: Labels are this far apart at least (s): between two of them vehicles move evenly.
APART_S = 0.04
#: Tracks have ids from 0 on; masks without a track have ids from here downwards.
FIRST_MASK = -2


@dataclass(frozen=True, eq=False)
class TrackLabels:
    """What a recording's tracks say is to be seen.

    Attributes:
        truth: boxes; `ignore` where masked; `frames` are the times at which anything is said.
        weight: (N,) how much each box counts, 0 to 1: the probability that it is a vehicle.
    """

    truth: GroundTruth
    weight: FloatArray

    def __len__(self) -> int:
        return len(self.truth)

    def take(self, rows: BoolArray, frames: FloatArray | None = None) -> TrackLabels:
        """Return some boxes (N,), and all times, or those given (T,)."""
        truth = self.truth
        chosen = replace(
            truth,
            t=truth.t[rows],
            object_id=truth.object_id[rows],
            boxes=truth.boxes[rows],
            ignore=truth.ignore[rows],
            frames=truth.frame_times() if frames is None else frames,
        )
        return TrackLabels(chosen, self.weight[rows])

    def between(self, begin_s: float, end_s: float) -> TrackLabels:
        """Return what lies in a span of time, both ends included."""
        times = self.truth.frame_times()
        inside = (self.truth.t >= begin_s) & (self.truth.t <= end_s)
        return self.take(inside, times[(times >= begin_s) & (times <= end_s)])

    def masking(self, rows: BoolArray) -> TrackLabels:
        """Return the same with more boxes masked."""
        return replace(self, truth=replace(self.truth, ignore=self.truth.ignore | rows))

    def digest(self) -> str:
        """Return a checksum (SHA-256) of all that is said."""
        truth, found = self.truth, hashlib.sha256()
        for part in (truth.t, truth.object_id, truth.boxes, truth.ignore, truth.frame_times(), self.weight):
            found.update(np.ascontiguousarray(part).tobytes())
        return found.hexdigest()

    def asked_objects(self) -> IntArray:
        """Return the ids of the vehicles that are asked for at any time, ascending."""
        return np.unique(self.truth.object_id[~self.truth.ignore])


def labels_of(
    tracks: Trajectories, detections: Detections, believed: Mapping[str, float] | None = None
) -> TrackLabels:
    """Make labels of smoothed tracks.

    Args:
        tracks: smoothed, over the whole recording.
        detections: that they were made of, in the same picture and on the same clock.
        believed: score by sensor from which on a detection is more likely real than not.
    """
    times = np.unique(detections.scan_t)
    frames = times[spread(times, APART_S)]
    rows = np.isin(tracks.t, frames) & (tracks.existence >= ABSENT)
    masked = masked_rows(tracks)[rows]
    chosen = tracks.take(rows)
    t, boxes, ids = unexplained(detections, tracks, frames, believed or {})
    truth = GroundTruth(
        t=np.concatenate([chosen.t, t]),
        object_id=np.concatenate([chosen.track_id, ids]),
        boxes=np.concatenate([chosen.boxes, boxes]),
        motion=None,
        ignore=np.concatenate([masked, np.ones(len(t), dtype=bool)]),
        frames=frames,
    )
    return TrackLabels(truth, np.concatenate([chosen.existence, np.zeros(len(t))]))


def spread(times: FloatArray, apart_s: float) -> list[int]:
    """Return which times (N,), ascending, to take so that each is at least `apart_s` after the one before."""
    kept: list[int] = []
    for k, t in enumerate(times.tolist()):
        if not kept or t - times[kept[-1]] >= apart_s:
            kept.append(k)
    return kept


def masked_rows(tracks: Trajectories) -> BoolArray:
    """Whether the model is unsure of each row (N,) of smoothed tracks."""
    return np.asarray(
        (tracks.existence < SURE)
        | vague(tracks.var[:, :2], tracks.size_var, tracks.boxes[:, 2:])
        | _unseen_or_at_ends(tracks)
        | hidden(tracks.t, tracks.boxes)
    )


def vague(place_var: FloatArray, size_var: FloatArray, sizes: FloatArray) -> BoolArray:
    """Whether boxes (N,) are not known well enough in place or size.

    The variance of a side is that of the centre and a quarter of that of the size.

    Args:
        place_var: (N, 2) variances of the centre (px²).
        size_var: (N, 2) of width and height (px²); NaN where unknown, which counts as 0.
        sizes: (N, 2) width and height (px).
    """
    side = np.sqrt(place_var + np.nan_to_num(size_var) / 4.0)
    return np.asarray((side > VAGUE_SHARE * sizes).any(axis=1))


def hidden(t: FloatArray, boxes: FloatArray) -> BoolArray:
    """Whether a nearer box hides more than a bit of each (N,): that with the lower lower edge is nearer.

    Args:
        t: (N,) times (s); boxes of one time hide each other.
        boxes: (N, 4) left, top, width, height (px).
    """
    found = np.zeros(len(t), dtype=bool)
    order = np.argsort(t, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(t[order]) > 0.0) + 1):
        if len(rows) > 1:
            bottom = boxes[rows, 1] + boxes[rows, 3]
            nearer = bottom[None, :] > bottom[:, None]
            covered = np.where(nearer, pairwise_covered(boxes[rows], boxes[rows]), 0.0)
            found[rows] = covered.max(axis=1) > HIDDEN_SHARE
    return found


def _unseen_or_at_ends(tracks: Trajectories) -> BoolArray:
    """Whether rows (N,) are far in time from any detection of theirs, or at an end of their track."""
    found = np.zeros(len(tracks), dtype=bool)
    order = np.lexsort((tracks.t, tracks.track_id))
    breaks = np.flatnonzero(np.diff(tracks.track_id[order])) + 1
    for rows in np.split(order, breaks):
        t = tracks.t[rows]
        seen = t[tracks.used[rows] > 0]
        if not len(seen):
            found[rows] = True
            continue
        after = np.clip(np.searchsorted(seen, t), 0, len(seen) - 1)
        before = np.maximum(after - 1, 0)
        away = np.minimum(np.abs(seen[after] - t), np.abs(t - seen[before]))
        found[rows] = (away > UNSEEN_S) | (t < t[0] + END_S) | (t > t[-1] - END_S)
    return found


def unexplained(
    detections: Detections, tracks: Trajectories, frames: FloatArray, believed: Mapping[str, float]
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return detections that their detectors believed and no track took: where they are, nobody knows.

    Args:
        detections: all.
        tracks: of them.
        frames: (T,) times at which labels are wanted (s), ascending.
        believed: as of `labels_of`.

    Returns:
        Times (K,) out of `frames`, those near to a detection, boxes (K, 4), and an id (K,) of each detection.
    """
    order = np.argsort(tracks.t, kind="stable")
    times = tracks.t[order]
    found_t, found, ids = [np.zeros(0)], [np.zeros((0, 4))], [np.zeros(0, dtype=np.int64)]
    count = 0
    for scan in detections.scans():
        boxes = scan.boxes[scan.scores >= believed.get(scan.sensor, BELIEVED_SCORE)]
        if not len(boxes):
            continue
        rows = order[np.searchsorted(times, scan.t, "left") : np.searchsorted(times, scan.t, "right")]
        there = tracks.boxes[rows]
        taken = (pairwise_iou(boxes, there) >= TAKEN_IOU) | (pairwise_covered(boxes, there) >= TAKEN_SHARE)
        boxes = boxes[~taken.any(axis=1)]
        near = frames[np.abs(frames - scan.t) <= MASKED_S]
        found_t.append(np.repeat(near, len(boxes)))
        found.append(np.tile(boxes, (len(near), 1)))
        ids.append(np.tile(FIRST_MASK - count - np.arange(len(boxes)), len(near)))
        count += len(boxes)
    return np.concatenate(found_t), np.concatenate(found), np.concatenate(ids)
