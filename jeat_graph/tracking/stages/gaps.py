"""What one instant teaches of tracks that nobody saw for a while: whether it was right to report them."""

from __future__ import annotations

import numpy as np

from jeat_graph.association.boxes import track_boxes, visible_fraction
from jeat_graph.association.overlap import overlap
from jeat_graph.config.kernel_form import Model
from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.fit import MEAN
from jeat_graph.filters.gaps import count_right, count_wrong
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.stages.associating import Association
from jeat_graph.tracking.stages.inner import inner
from jeat_graph.tracking.state import SceneState, TrackArrays

# By this intersection over union the tables are judged.
_FITS = 0.5


@inner
def learn_found(
    tracks: TrackArrays, n: int, batch: Batch, association: Association, scene: SceneState, model: Model
) -> None:
    """Learn from tracks that are found again whether they were where they had been expected, in place.

    Called before the detections are taken in.
    """
    memory = model.settings.output.gap_memory
    if memory <= 0.0:
        return
    for i in range(n):
        if tracks.t_shown[i] > tracks.t_update[i]:
            j = np.max(association.match[i])
            if j >= 0:
                gap = tracks.t_shown[i] - tracks.t_update[i]
                if overlap(_box(tracks, i), batch.boxes[j]) >= _FITS:
                    count_right(scene.gap_share, scene.gap_seen, gap, memory)
                else:
                    count_wrong(scene.gap_share, scene.gap_seen, gap, True, memory)


@inner
def learn_lost(tracks: TrackArrays, i: int, scene: SceneState, model: Model) -> None:
    """Learn from track `i`, which ends, that it was not to be found again, in place."""
    memory, gap = model.settings.output.gap_memory, tracks.t_shown[i] - tracks.t_update[i]
    if memory > 0.0 and gap > 0.0:
        count_wrong(scene.gap_share, scene.gap_seen, gap, False, memory)


@inner
def note_shown(tracks: TrackArrays, n: int, t: float, model: Model) -> None:
    """Note down, in place, which of the first `n` tracks that nobody sees could be reported at time `t` (s).

    They are reported if their gap is not too long, which is what is to be learnt.
    """
    image, output = model.settings.image, model.settings.output
    if output.gap_memory <= 0.0:
        return
    for i in range(n):
        if tracks.t_update[i] >= t or tracks.standing[i] or not (tracks.confirmed[i] and tracks.worthy[i]):
            continue
        if tracks.existence[i] < output.min_existence or tracks.fit[i, MEAN] < output.min_fit:
            continue
        visible = visible_fraction(_box(tracks, i), image.width, image.height) if output.clip else 1.0
        if visible >= output.min_visible:
            tracks.t_shown[i] = t


@inner
def _box(tracks: TrackArrays, i: int) -> FloatArray:
    return track_boxes(tracks.mean[i : i + 1], tracks.size_mean[i : i + 1])[0]
