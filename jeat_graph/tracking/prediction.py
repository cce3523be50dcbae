"""Where the tracks will be: the state now, predicted to a later time, which nobody has seen yet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.kernel_form import Model
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.reporting import as_table, longest_gap_s, report
from jeat_graph.tracking.snapshot import Snapshot
from jeat_graph.tracking.stages.predicting import predict_all

_MOTION = 3  # the errors with memory stand behind position, velocity and acceleration


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(Trajectories):
    """A table of predicted tracks, with the whole covariance of their motion.

    Attributes:
        cov: (N, 6, 6) covariance of `mean`, whose diagonal is `var`.
    """

    cov: FloatArray = ()  # type: ignore[assignment]


def predict_reported(now: Snapshot, t: float, model: Model, sensors: tuple[str, ...]) -> Prediction:
    """Predict the tracks that are reported now to time `t`.

    Args:
        now: the state; it is used up.
        t: time (s), not before that of the state.
        model: sensors and settings.
        sensors: names of the sensors.
    """
    here = 0.0 if now.t is None else now.t
    n = now.num_tracks
    settings = model.settings
    gap = longest_gap_s(now.scene, model)
    how = (gap, settings.image, settings.output, settings.lifecycle.by_existence)
    reported = report(now.tracks, n, here, *how)[1]
    predict_all(now.tracks, n, max(t - here, 0.0), now.scene, model)
    # Nobody has looked in between, so nobody can have missed a track either: what counts is the gap now.
    now.tracks.t_update[:] += t - here
    columns = as_table(report(now.tracks, n, t, *how), sensors, now.classes)
    table = columns.take(np.isin(columns.track_id, reported))
    rows = np.searchsorted(now.tracks.track_id, table.track_id)
    cov = np.zeros((len(table), 6, 6))
    for axis in range(2):
        cov[:, axis::2, axis::2] = now.tracks.cov[rows, axis, :_MOTION, :_MOTION]
    return Prediction(**vars(table), cov=cov)
