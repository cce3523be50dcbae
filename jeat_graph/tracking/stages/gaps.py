"""What one instant teaches of tracks that nobody saw for a while: whether it was right to report them."""

from __future__ import annotations

import numpy as np

from jeat_graph.association.boxes import track_boxes
from jeat_graph.association.overlap import overlap
from jeat_graph.config.kernel_form import Model
from jeat_graph.filters.fit import MEAN
from jeat_graph.filters.gaps import count_right, count_wrong
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.reporting import is_believed, is_whole, waited_for
from jeat_graph.tracking.stages.associating import Association
from jeat_graph.tracking.stages.inner import inlined, inner
from jeat_graph.tracking.state import SceneState, TrackArrays

# By this intersection over union the tables are judged.
_FITS = 0.5


@inlined
def learn_found(
    tracks: TrackArrays, n: int, batch: Batch, association: Association, scene: SceneState, model: Model
) -> None:
    """Learn from tracks that are found again whether they were where they had been expected, in place.

    Called before the detections are taken in. Of several sensors' boxes the one that fits best counts.
    """
    memory = model.settings.output.gap_memory
    if memory <= 0.0:
        return
    match, t_missed, t_update = association.match, tracks.t_missed, tracks.t_update
    for i in range(n):
        # What another sensor missed at this very time is no gap.
        if not t_update[i] < t_missed[i] < batch.t or np.max(match[i]) < 0:
            continue
        box, best = track_boxes(tracks.mean[i : i + 1], tracks.size_mean[i : i + 1])[0], 0.0
        for s in range(match.shape[1]):
            if match[i, s] >= 0:
                best = max(best, overlap(box, batch.boxes[match[i, s]]))
        gap = t_missed[i] - t_update[i]
        if best >= _FITS:
            count_right(scene.gap_share, scene.gap_seen, gap, memory)
        else:
            count_wrong(scene.gap_share, scene.gap_seen, gap, True, memory)


@inner
def learn_lost(t_missed: float, t_update: float, scene: SceneState, model: Model) -> None:
    """Learn from a track, which ends, that it was not to be found again, in place.

    Args:
        t_missed: when it was missed last (s).
        t_update: when it was seen last (s).
        scene: what is learnt.
        model: sensors and settings.
    """
    memory = model.settings.output.gap_memory
    if memory > 0.0 and t_missed > t_update:
        count_wrong(scene.gap_share, scene.gap_seen, t_missed - t_update, False, memory)


@inlined
def note_missed(tracks: TrackArrays, n: int, batch: Batch, scene: SceneState, model: Model) -> None:
    """Note down, in place, which of the first `n` tracks are missed now that would else be reported.

    Where only sensors look that nobody waits for, nothing is missed: what is found after so short a gap says
    nothing of gaps in which it could have been found. What the picture's edge cuts may have left, and is not
    judged by what becomes of the others.
    """
    settings = model.settings
    image, output, by_existence = settings.image, settings.output, settings.lifecycle.by_existence
    if output.gap_memory <= 0.0 or not np.any(batch.present & waited_for(scene.trust, scene.blind)):
        return
    confirmed, worthy, existence, fit = tracks.confirmed, tracks.worthy, tracks.existence, tracks.fit
    for i in range(n):
        if tracks.t_update[i] >= batch.t or tracks.standing[i]:
            continue
        if not is_believed(confirmed[i], worthy[i], existence[i], fit[i, MEAN], output, by_existence):
            continue
        box = track_boxes(tracks.mean[i : i + 1], tracks.size_mean[i : i + 1])[0]
        if is_whole(box, image):
            tracks.t_missed[i] = batch.t
