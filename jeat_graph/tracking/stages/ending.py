"""Confirmation and end of tracks."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.association.boxes import clip_boxes, track_boxes, visible_fraction
from jeat_graph.association.merging import find_duplicates, known_to_be_two, overlapping_pairs, stands_apart
from jeat_graph.config.kernel_form import Model, Settings
from jeat_graph.config.schema import ImageConfig
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.tracking.compaction import keep_rows
from jeat_graph.tracking.stages.gaps import learn_lost
from jeat_graph.tracking.stages.inner import inner
from jeat_graph.tracking.stages.learning import scan_weight
from jeat_graph.tracking.stages.worth import denied_by, learn_ended
from jeat_graph.tracking.state import SceneState, TrackArrays


@njit(cache=True)
def confirm(tracks: TrackArrays, n: int, t: float, settings: Settings) -> None:
    """Confirm the tracks that have earned it: by existence, or by age and hits (paper, track lifecycle)."""
    lifecycle = settings.lifecycle
    for i in range(n):
        if lifecycle.by_existence:
            believed = tracks.existence[i] >= lifecycle.confirm_existence
            # What does not move yet is held back from the table alone: it is no less followed.
            earned = believed and (tracks.worthy[i] or not lifecycle.judges_worth)
        else:
            old = t - tracks.t_birth[i] >= lifecycle.confirm_age_s
            earned = old and tracks.hits[i] >= lifecycle.confirm_hits
        # No branch, on purpose: with one, numba compiles a loop that clears flags (`test_confirm`).
        tracks.confirmed[i] = tracks.confirmed[i] or earned
        if not lifecycle.by_existence:
            tracks.existence[i] = 1.0 if tracks.confirmed[i] else 0.5


@inner
def has_left(x: float, y: float, box: FloatArray, image: ImageConfig) -> bool:
    """Whether a vehicle has left the picture: its centre has, or all of it where boxes may be cut.

    Args:
        x: of its centre (px).
        y: of its centre (px).
        box: (4,) left, top, width, height (px).
        image: the kernels' form of that section.
    """
    if image.edge_px > 0.0:
        # The centre may be outside while a part still shows.
        return bool(visible_fraction(box, image.width, image.height) <= 0.0)
    return bool(x < 0.0 or y < 0.0 or x > image.width or y > image.height)


@inner
def remove_ended(tracks: TrackArrays, n: int, t: float, scene: SceneState, model: Model) -> int:
    """Remove tracks that are over, out of the picture, or duplicates; return the number left, in order."""
    settings = model.settings
    boxes = track_boxes(tracks.mean[:n], tracks.size_mean[:n])
    image, lifecycle, merge = settings.image, settings.lifecycle, settings.merge
    remove = np.zeros(n, dtype=np.bool_)
    if merge.enabled and n > 1:
        pairs, iou = overlapping_pairs(
            clip_boxes(boxes, image.width, image.height) if image.edge_px > 0.0 else boxes
        )
        if merge.apart_overlap > 0.0:
            _note_apart(tracks, t, stands_apart(n, pairs, iou, merge.apart_overlap))
        displaced = _displaced(
            tracks, pairs, iou, denied_by(tracks, n, scene, model), settings.birth.max_overlap
        )
        pairs = pairs[np.flatnonzero(iou >= merge.min_overlap)]
        if len(pairs) > 0:
            two = known_to_be_two(pairs, tracks.t_birth[:n], tracks.seen_apart[:n])
            pairs = pairs[np.flatnonzero(~two)]
            velocity = np.empty((n, 2))
            velocity_var = np.empty((n, 2))
            for i in range(n):
                for axis in range(2):
                    velocity[i, axis] = tracks.mean[i, axis, 1]
                    velocity_var[i, axis] = tracks.cov[i, axis, 1, 1]
            remove = find_duplicates(pairs, velocity, velocity_var, tracks.confirmed[:n], merge.gate_bound)
        remove |= displaced
    rows = np.empty(n, dtype=np.int64)
    kept = 0
    for i in range(n):
        gap = t - tracks.t_update[i]
        most = lifecycle.max_gap_confirmed_s if tracks.confirmed[i] else lifecycle.max_gap_tentative_s
        if tracks.confirmed[i] and tracks.standing[i]:
            most = max(most, settings.standing.max_gap_s)
        x, y = tracks.mean[i, 0, 0], tracks.mean[i, 1, 0]
        outside = has_left(x, y, boxes[i], image)
        doubted = lifecycle.by_existence and tracks.existence[i] < lifecycle.delete_existence
        # A state that overflowed (a coasting track on wild input) must not survive as NaN.
        broken = not (math.isfinite(x) and math.isfinite(y))
        if remove[i] or gap > most or doubted or broken or (lifecycle.leave_picture and outside):
            if not (outside or broken):
                # Two tracks of one vehicle were one too many in the table, too.
                learn_lost(tracks.t_missed[i], tracks.t_update[i], scene, model)
            if not (remove[i] or outside or broken):
                learn_ended(tracks, i, scene, model)
            if not (tracks.confirmed[i] or remove[i] or outside or broken):
                _count_fruitless(tracks.hits[i], tracks.seen_by[i], scene, model)
            continue
        rows[kept] = i
        kept += 1
    keep_rows(tracks, rows[:kept])
    return kept


@inner
def _displaced(
    tracks: TrackArrays, pairs: IntArray, iou: FloatArray, denied: BoolArray, max_overlap: float
) -> BoolArray:
    """Say which of the N tracks (N,) give way to one that a sensor has seen which denies them (N, S)."""
    remove = np.zeros(len(denied), dtype=np.bool_)
    if not np.any(denied):
        return remove
    for p in np.flatnonzero(iou > max_overlap):
        for side in range(2):
            i, k = pairs[p, side], pairs[p, 1 - side]
            for s in range(denied.shape[1]):
                seen = tracks.confirmed[k] and tracks.seen_by[k] >> s & 1 > 0
                remove[i] = remove[i] or (denied[i, s] and seen)
    return remove


@inner
def _note_apart(tracks: TrackArrays, t: float, apart: BoolArray) -> None:
    """Note down which sensors have just seen which of the N tracks apart (N,) from all others, in place.

    Of what is not believed yet nothing is noted: a false box beside a vehicle is no second vehicle.
    """
    seen_apart, used = tracks.seen_apart, tracks.used
    for i in range(len(apart)):
        if apart[i] and tracks.confirmed[i] and tracks.worthy[i]:
            for s in range(seen_apart.shape[1]):
                if used[i] >> s & 1:
                    seen_apart[i, s] = t


@inner
def _count_fruitless(hits: int, seen_by: int, scene: SceneState, model: Model) -> None:
    """Put the detections of a track that came to nothing down to the one sensor that saw it, in place."""
    for s in range(len(scene.fruitless)):
        if seen_by == 1 << s:
            scene.fruitless[s] += scan_weight(s, model) * hits
