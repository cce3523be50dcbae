"""Where corrected tracks lie off what the model makes of their detections, and what is done about it.

Each row is compared with the track as the model smooths it along the detections that are the row's track's:
of x, y, width and height the greatest of |row - smoothed| / √(P + R) counts, with the variance P of the
smoothed track and R of a box of the sensor that errs least. What is beyond `MOST_SIGMA` is one of these:

- `identity`: the track has a detection there that the row lies on; so it is the identity that the model would
  not have given it. It stays.
- `moved`: the track has a detection there, but the row lies elsewhere. The row takes its place.
- `added`: the track has none there, or the model has no track there. The row becomes a detection.
- `absent`: the track has a detection, but the model takes it for no object then. Nothing can be done.
- `unseen`: no sensor looked then, so that the row cannot become a detection.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.box_std import join_std
from jeat_graph.data.corrected_tracks import CorrectedTracks, Disagreements
from jeat_graph.data.detections import Detections
from jeat_graph.data.scan import trusted_scan
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.identities.matching_rows import SAME_S, nearest, period_of

#: Standard deviations from which on the model disagrees.
MOST_SIGMA = 3.0
# What a box that a person drew has for a score.
_SCORE = 1.0


class Noise(NamedTuple):
    """How exact boxes are.

    Attributes:
        variance: of the sides of the boxes of the sensor that errs least, as a squared share of
            ½ √(w h) + ½ the side.
        pixel_std: what is added to it (px).
        picture: width and height where boxes end at the picture's edge, else None.
    """

    variance: float
    pixel_std: float
    picture: tuple[float, float] | None

    def of(self, boxes: FloatArray) -> FloatArray:
        """Return the variances (K, 4) of x, y, width and height of boxes of that sensor (px²)."""
        size = boxes[:, 2:]
        both = np.sqrt(size.prod(axis=1))[:, None]
        side = self.variance * (0.5 * both + 0.5 * size) ** 2 + self.pixel_std**2
        return np.concatenate([side / 2.0, side * 2.0], axis=1)

    def compared(self, boxes: FloatArray) -> FloatArray:
        """Return x, y, width, height (K, 4) of the parts of boxes that lie in the picture."""
        low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
        if self.picture is not None:
            low, high = (np.clip(side, 0.0, np.asarray(self.picture)) for side in (low, high))
        return np.concatenate([(low + high) / 2.0, high - low], axis=1)


class RowsCompared(NamedTuple):
    """What came of a comparison.

    Attributes:
        disagreements: the disagreements.
        moved, added: (K,) rows that are to be detections, in a detection's place and beside all.
    """

    disagreements: Disagreements
    moved: IntArray
    added: IntArray


def compare(
    rows: CorrectedTracks,
    code: IntArray,
    smoothed: Trajectories,
    detections: Detections,
    owner: IntArray,
    noise: Noise,
) -> RowsCompared:
    """Compare rows with the tracks that the model smoothed along their detections.

    Args:
        rows: (R,) corrected.
        code: (R,) number of each row's track, from 1.
        smoothed: the tracks, by these numbers.
        detections: all scans.
        owner: (N,) number of each detection's track, 0 for nobody's.
        noise: how exact boxes are.
    """
    sigma = _sigma(rows, code, smoothed, noise)
    off_by, has = _from_detections(rows, code, detections, owner, noise)
    # Of two rows that are as far from a scan neither is at it.
    scanned = np.abs(_instants(rows, detections) - rows.t) < _reach(rows) * (1.0 - 1e-9)
    none, beyond = np.isnan(sigma), sigma > MOST_SIGMA
    what = np.full(len(rows.t), "", dtype="U8")
    what[beyond & ~has] = "added"
    what[none & ~has & ~rows.coasts] = "added"
    what[(what == "added") & ~scanned] = "unseen"
    what[beyond & has] = np.where(off_by > MOST_SIGMA, "moved", "identity")[beyond & has]
    what[none & has] = "absent"
    order = np.lexsort((rows.track_id, rows.t))
    order = order[what[order] != ""]
    disagreements = Disagreements(rows.t[order], rows.track_id[order], sigma[order], what[order])
    return RowsCompared(disagreements, np.flatnonzero(what == "moved"), np.flatnonzero(what == "added"))


def edited(
    detections: Detections, owner: IntArray, rows: CorrectedTracks, code: IntArray, found: RowsCompared
) -> tuple[Detections, IntArray, IntArray]:
    """Return detections with the rows that are to be such, whose each is, and which (N,) it was, or -1.

    A row that was moved takes the place of its track's detections of that time: of the first sensor's; the
    others are nobody's. One that was added is a detection of a sensor that looked then.
    """
    boxes, owner, scores = detections.boxes.copy(), owner.copy(), detections.scores.copy()
    at = detections.box_t
    instant = _instants(rows, detections)
    for row in found.moved.tolist():
        own = np.flatnonzero((owner == code[row]) & (np.abs(at - instant[row]) <= SAME_S))
        boxes[own[0]], scores[own[0]], owner[own[1:]] = rows.boxes[row], _SCORE, 0
    more: dict[int, list[int]] = {}
    for row in found.added.tolist():
        more.setdefault(int(np.searchsorted(detections.scan_t, instant[row])), []).append(row)
    scans, owners, origins = [], [], []
    for k, scan in enumerate(detections.scans()):
        own = np.arange(detections.scan_start[k], detections.scan_start[k + 1])
        new = np.array(more.get(k, []), dtype=np.int64)
        blank = np.zeros(len(new))
        classes = None if scan.classes is None else np.append(scan.classes, np.full(len(new), ""))
        embeddings = scan.embeddings
        if embeddings is not None:
            embeddings = np.concatenate(
                [embeddings, np.full((len(new), embeddings.shape[1]), np.nan, embeddings.dtype)]
            )
        scans.append(
            trusted_scan(
                scan.t,
                scan.sensor,
                np.concatenate([boxes[own], rows.boxes[new]]),
                np.concatenate([scores[own], blank + _SCORE]),
                classes,
                embeddings,
                scan.camera_motion,
                join_std([scan.box_std, None], [len(own), len(new)]) if scan.box_std is not None else None,
            )
        )
        owners.append(np.concatenate([owner[own], code[new]]))
        origins.append(np.concatenate([own, np.full(len(new), -1)]))
    return Detections.from_scans(scans), np.concatenate(owners), np.concatenate(origins)


def _reach(rows: CorrectedTracks) -> float:
    return max(period_of(rows.t) / 2.0, SAME_S)


def _instants(rows: CorrectedTracks, detections: Detections) -> FloatArray:
    """Return the time (R,) of the scan nearest to each row (s)."""
    scanned = np.unique(detections.scan_t)
    return np.asarray(scanned[nearest(scanned, rows.t)])


def _sigma(rows: CorrectedTracks, code: IntArray, smoothed: Trajectories, noise: Noise) -> FloatArray:
    """Return how far each row (R,) lies from the smoothed track, in standard deviations; NaN without one."""
    out, reach = np.full(len(code), np.nan), _reach(rows)
    by_track = np.lexsort((smoothed.t, smoothed.track_id))
    of, order = smoothed.track_id[by_track], np.argsort(code, kind="stable")
    for own in np.split(order, np.flatnonzero(np.diff(code[order])) + 1):
        low, high = np.searchsorted(of, [code[own[0]], code[own[0]] + 1])
        track = by_track[low:high]
        if not len(track):
            continue
        t, at = smoothed.t[track], rows.t[own]
        spread = np.concatenate([smoothed.var[track, :2], smoothed.size_var[track]], axis=1)
        values = np.concatenate([smoothed.boxes[track], spread], axis=1)
        there = np.stack([np.interp(at, t, values[:, k]) for k in range(8)], axis=1)
        off = noise.compared(rows.boxes[own]) - noise.compared(there[:, :4])
        z = np.abs(off) / np.sqrt(there[:, 4:] + noise.of(there[:, :4]))
        inside = (at >= t[0] - SAME_S) & (at <= t[-1] + SAME_S)
        # Within a gap that the model does not fill there is no track.
        behind = np.clip(np.searchsorted(t, at), 1, max(len(t) - 1, 1))
        near = np.abs(t[nearest(t, at)] - at) <= reach
        if len(t) > 1:
            near |= inside & (t[behind] - t[behind - 1] <= 2.0 * reach)
        out[own] = np.where(near, z.max(axis=1), np.nan)
    return out


def _from_detections(
    rows: CorrectedTracks, code: IntArray, detections: Detections, owner: IntArray, noise: Noise
) -> tuple[FloatArray, BoolArray]:
    """Return how far each row (R,) lies from the detection of its track then, and whether it has one."""
    at = detections.box_t
    instant = _instants(rows, detections)
    off, has = np.full(len(code), np.inf), np.zeros(len(code), dtype=bool)
    scanned = np.unique(detections.scan_t)
    row_key = code * len(scanned) + np.searchsorted(scanned, instant)
    mine = np.flatnonzero(owner > 0)
    key = owner[mine] * len(scanned) + np.searchsorted(scanned, at[mine])
    order = np.argsort(key, kind="stable")
    low, high = (np.searchsorted(key[order], row_key, side=side) for side in ("left", "right"))
    for k in range(int((high - low).max(initial=0))):
        row = np.flatnonzero(high - low > k)
        box = detections.boxes[mine[order[low[row] + k]]]
        z = np.abs(noise.compared(rows.boxes[row]) - noise.compared(box)) / np.sqrt(noise.of(box))
        off[row], has[row] = np.minimum(off[row], z.max(axis=1)), True
    return off, has
