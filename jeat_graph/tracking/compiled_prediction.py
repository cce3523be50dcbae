"""Where the tracks of the compiled tracker will be at a later time."""

from __future__ import annotations

import numpy as np

from jeat_graph.association.boxes import track_boxes
from jeat_graph.config.kernel_form import Model
from jeat_graph.tracking.prediction import Prediction
from jeat_graph.tracking.reporting import (
    as_table,
    columns_of,
    longest_gaps_s,
    remain,
    reported_rows,
    written_scale,
)
from jeat_graph.tracking.snapshot import Snapshot
from jeat_graph.tracking.stages.predicting import predict_all

_MOTION = 3  # the errors with memory stand behind position, velocity and acceleration


def predict_reported(now: Snapshot, t: float, model: Model, sensors: tuple[str, ...]) -> Prediction:
    """Predict the tracks that are reported now to time `t`, but those that will have left the picture.

    Args:
        now: the state; it is used up.
        t: time (s), finite and not before that of the state.
        model: sensors and settings.
        sensors: names of the sensors.
    """
    here = 0.0 if now.t is None else now.t
    settings, tracks = model.settings, now.tracks
    sections = (settings.image, settings.output)
    gaps = longest_gaps_s(now.scene, model, here)
    # Who is reported is decided now: what has just been detected is no less there for looking ahead.
    boxes = track_boxes(tracks.mean[: now.num_tracks], tracks.size_mean[: now.num_tracks])
    rows = reported_rows(tracks, boxes, here, gaps, *sections, settings.lifecycle.by_existence)
    predict_all(tracks, now.num_tracks, max(t - here, 0.0), now.scene, model)
    boxes = track_boxes(tracks.mean[rows], tracks.size_mean[rows])
    left = remain(boxes, *sections)
    rows, boxes = rows[left], boxes[left]
    table = as_table(columns_of(tracks, rows, boxes, t, *sections), sensors, now.classes)
    cov = np.zeros((len(table), 6, 6))
    for axis in range(2):
        # D P D with a diagonal D stays positive definite, and so does what errors that last are added to.
        D = np.ones((len(table), _MOTION))
        D[:, 0] = np.sqrt([written_scale(cut, settings.output) for cut in tracks.cut[rows, axis]])
        cov[:, axis::2, axis::2] = D[:, :, None] * tracks.cov[rows, axis, :_MOTION, :_MOTION] * D[:, None]
        cov[:, axis, axis] = table.var[:, axis]
    return Prediction(**vars(table), cov=cov)
