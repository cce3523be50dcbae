"""The causal table of the engine `paper`, and its prediction."""

from __future__ import annotations

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.classes import ClassTally
from jeat_graph.tracking.paper.state import PaperTracks
from jeat_graph.tracking.prediction import Prediction


def table_of(
    tracks: PaperTracks, t: float, config: Config, sensors: tuple[str, ...], classes: ClassTally | None
) -> Trajectories:
    """Write tracks as a table: what is confirmed is taken for a vehicle, existence 1."""
    size = tracks.sizes()
    boxes, shown = boxes_at(tracks.mean[:, :, 0], size, config)
    names, share = (None, None) if classes is None else classes.columns(tracks.track_id)
    variance = np.repeat(np.diagonal(tracks.cov, axis1=1, axis2=2), 2, axis=1)
    table = Trajectories(
        t=np.full(len(tracks), t),
        track_id=tracks.track_id.copy(),
        boxes=boxes,
        existence=np.ones(len(tracks)),
        mean=tracks.mean.transpose(0, 2, 1).reshape(-1, 6).copy(),
        var=variance,
        used=tracks.used.copy(),
        sensors=sensors,
        classes=names,
        class_probability=share,
        size_var=size * size * tracks.size_cov[:, :1, 0],
    )
    return table if shown.all() else table.take(shown)


def boxes_at(centre: FloatArray, size: FloatArray, config: Config) -> tuple[FloatArray, BoolArray]:
    """Return boxes (N, 4), clipped to the picture where `output.clip` says so, and whether any is left (N,).

    Args:
        centre: (N, 2) px.
        size: (N, 2) width and height (px).
        config: size of the picture, and whether boxes are clipped to it.
    """
    low, high = centre - 0.5 * size, centre + 0.5 * size
    if config.output.clip:
        picture = np.array([config.image.width, config.image.height])
        low, high = np.maximum(low, 0.0), np.minimum(high, picture)
        return np.concatenate([low, high - low], axis=1), (high > low).all(axis=1)
    return np.concatenate([low, size], axis=1), np.ones(len(size), dtype=np.bool_)


def predicted(
    tracks: PaperTracks, t: float, config: Config, sensors: tuple[str, ...], classes: ClassTally | None
) -> Prediction:
    """Write predicted tracks as a table with covariances; those that have left the picture are left out."""
    table = table_of(tracks, t, config, sensors, classes)
    kept = tracks.take(np.isin(tracks.track_id, table.track_id))
    cov = np.zeros((len(kept), 6, 6))
    cov[:, ::2, ::2] = cov[:, 1::2, 1::2] = kept.cov
    return Prediction(**vars(table), cov=cov)
