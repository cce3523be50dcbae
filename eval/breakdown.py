"""Where the scores come from: standing and moving objects, distance, and how long things take to be found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.eval.frames import Frames
from jeat_graph.eval.matching import matched_entries

BoolArray = npt.NDArray[np.bool_]
# Slower than this in the picture is standing: an event camera sees next to nothing of it.
STANDING_PX_S = 2.0
DISTANCE_BINS_M = (0.0, 30.0, 60.0, 90.0, 120.0, float("inf"))


@dataclass(frozen=True)
class GroupScores:
    """How well one group of objects is tracked. False tracks belong to no group and are not counted here.

    Attributes:
        group: its name.
        truth_boxes: boxes of the group.
        recall: share of them matched (per cent); NaN for an empty group.
        MOTP: mean IoU of the matches (per cent); NaN without matches.
        IDSW: matches whose track is not that of the object's last match before.
    """

    group: str
    truth_boxes: int
    recall: float
    MOTP: float
    IDSW: int

    def as_dict(self) -> dict[str, str | float | int]:
        """Return the values by name."""
        return asdict(self)


@dataclass(frozen=True)
class Delays:
    """A set of waiting times (s); NaN where there is none.

    Attributes:
        count: how many.
        mean_s: their mean.
        median_s: their median.
        p90_s: the time that nine in ten do not exceed.
        never: cases in which what was waited for did not come.
    """

    count: int
    mean_s: float
    median_s: float
    p90_s: float
    never: int

    def as_dict(self) -> dict[str, float | int]:
        """Return the values by name."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class ObjectFrames:
    """Truth entries of one sequence, ordered by object and then time.

    Attributes:
        object_id: (G,) identity.
        t: (G,) time (s).
        frame: (G,) frame number.
        row: (G,) row in the truth.
        iou: (G,) overlap with the matched track, 0 without one.
        track_id: (G,) the matched track, -1 without one.
        switched: (G,) matched to another track than at the object's last match.
    """

    object_id: npt.NDArray[np.int64]
    t: FloatArray
    frame: npt.NDArray[np.int64]
    row: npt.NDArray[np.int64]
    iou: FloatArray
    track_id: npt.NDArray[np.int64]
    switched: BoolArray

    @property
    def matched(self) -> BoolArray:
        """Whether each entry is matched (G,)."""
        return self.iou > 0.0


def object_frames(frames: Frames, *, iou: float = 0.5) -> ObjectFrames:
    """Order the truth of a sequence by object, and note the matches (one to one, largest total IoU)."""
    g, m = matched_entries(frames.iou, iou)
    frame = np.repeat(np.arange(len(frames)), np.diff(frames.truth_start))
    overlap, track = np.zeros(len(frame)), np.full(len(frame), -1, dtype=np.int64)
    column = m - frames.track_start[frame[g]]
    line = g - frames.truth_start[frame[g]]
    overlap[g] = [frames.iou[f][a, b] for f, a, b in zip(frame[g], line, column, strict=True)]
    track[g] = frames.tracks.track_id[m]
    order = np.lexsort((frame, frames.truth_id))
    ids, overlap, track = frames.truth_id[order], overlap[order], track[order]
    switched = np.zeros(len(ids), dtype=bool)
    hit = np.flatnonzero(overlap > 0.0)
    switched[hit[1:]] = (ids[hit[1:]] == ids[hit[:-1]]) & (track[hit[1:]] != track[hit[:-1]])
    return ObjectFrames(
        object_id=ids,
        t=frames.times[frame[order]],
        frame=frame[order],
        row=frames.truth_row[order],
        iou=overlap,
        track_id=track,
        switched=switched,
    )


def by_motion(
    sequences: Sequence[Frames], *, iou: float = 0.5, standing_px_s: float = STANDING_PX_S
) -> list[GroupScores]:
    """Scores of standing and moving objects; empty where the truth has no motion.

    Args:
        sequences: laid out frame by frame.
        iou: smallest IoU of a match.
        standing_px_s: speed in the picture below which an object stands (px/s).
    """
    moments, standing = [], []
    for frames in sequences:
        if frames.truth.motion is not None:
            one = object_frames(frames, iou=iou)
            moments.append(one)
            standing.append(np.hypot(*frames.truth.motion[one.row, 2:4].T) < standing_px_s)
    if not moments:
        return []
    return [
        _group("standing", moments, standing),
        _group("moving", moments, [~mask for mask in standing]),
    ]


def by_distance(
    sequences: Sequence[Frames], *, iou: float = 0.5, bins_m: Sequence[float] = DISTANCE_BINS_M
) -> list[GroupScores]:
    """Scores by distance from the camera; empty where the truth has no distances.

    Args:
        sequences: laid out frame by frame.
        iou: smallest IoU of a match.
        bins_m: (B + 1,) ascending edges (m).
    """
    known = [frames for frames in sequences if frames.truth.distance is not None]
    if not known:
        return []
    moments = [object_frames(frames, iou=iou) for frames in known]
    far = [np.asarray(f.truth.distance)[one.row] for f, one in zip(known, moments, strict=True)]
    return [
        _group(
            f"{low:g}-{high:g} m" if np.isfinite(high) else f"over {low:g} m",
            moments,
            [(d >= low) & (d < high) for d in far],
        )
        for low, high in pairwise(bins_m)
    ]


def _group(name: str, moments: Sequence[ObjectFrames], masks: Sequence[BoolArray]) -> GroupScores:
    iou = np.concatenate([one.iou[mask] for one, mask in zip(moments, masks, strict=True)])
    hits = iou[iou > 0.0]
    return GroupScores(
        group=name,
        truth_boxes=len(iou),
        recall=100.0 * len(hits) / len(iou) if len(iou) else float("nan"),
        MOTP=100.0 * float(hits.mean()) if len(hits) else float("nan"),
        IDSW=sum(int(one.switched[mask].sum()) for one, mask in zip(moments, masks, strict=True)),
    )


def confirmation_latency(sequences: Sequence[Frames], *, iou: float = 0.5) -> Delays:
    """Time from the first frame in which an object is to be found to the first in which a track is on it.

    `never` counts the objects that no track was ever on.
    """
    waits, never = [], 0
    for frames in sequences:
        one = object_frames(frames, iou=iou)
        _, first, owner = np.unique(one.object_id, return_index=True, return_inverse=True)
        found = np.full(len(first), np.inf)
        np.minimum.at(found, owner.reshape(-1)[one.matched], one.t[one.matched])
        wait = found - one.t[first]
        waits.append(wait[np.isfinite(wait)])
        never += int((~np.isfinite(wait)).sum())
    return _delays(waits, never)


def recovery_times(sequences: Sequence[Frames], *, iou: float = 0.5) -> dict[str, Delays]:
    """Time until a track is on an object again that had one before.

    Returns:
        `miss`: an object that stayed in the truth lost its track; the time from the first frame without it
        to the next with one. `occlusion`: an object was absent from the truth (or ignored) for one frame or
        more; the time from its return to the first frame with a track, 0 if there is one at once. `never`
        counts the cases in which the object went away again, or the sequence ended, before that.
    """
    waits: dict[str, list[FloatArray]] = {"miss": [], "occlusion": []}
    never = {"miss": 0, "occlusion": 0}
    for frames in sequences:
        one = object_frames(frames, iou=iou)
        if not len(one.t):
            continue
        new_object = np.append(True, np.diff(one.object_id) != 0)
        returned = np.append(False, np.diff(one.frame) > 1) & ~new_object
        segment = np.cumsum(new_object | returned)
        matched = one.matched
        # Was the object ever tracked before this entry? (Matches so far, less those of objects before.)
        total: npt.NDArray[np.int64] = np.cumsum(matched) - matched
        seen = total - np.maximum.accumulate(np.where(new_object, total, 0)) > 0
        lost = ~matched & np.append(False, matched[:-1]) & ~new_object & ~returned
        next_match = _next_match(matched)
        for kind, start in (("miss", lost), ("occlusion", returned & seen)):
            begin = np.flatnonzero(start)
            target = next_match[begin]
            safe = np.minimum(target, len(segment) - 1)
            there = (target < len(segment)) & (segment[safe] == segment[begin])
            waits[kind].append(one.t[safe[there]] - one.t[begin[there]])
            never[kind] += int((~there).sum())
    return {kind: _delays(waits[kind], never[kind]) for kind in waits}


def _next_match(matched: BoolArray) -> npt.NDArray[np.int64]:
    """Index of the first matched entry at or after each entry, or the length where there is none."""
    index = np.where(matched, np.arange(len(matched)), len(matched))
    nearest: npt.NDArray[np.int64] = np.minimum.accumulate(index[::-1])[::-1]
    return nearest


def _delays(parts: Sequence[FloatArray], never: int) -> Delays:
    values = np.concatenate([np.zeros(0), *parts])
    if not len(values):
        return Delays(0, float("nan"), float("nan"), float("nan"), never)
    return Delays(
        count=len(values),
        mean_s=float(values.mean()),
        median_s=float(np.median(values)),
        p90_s=float(np.quantile(values, 0.9)),
        never=never,
    )
