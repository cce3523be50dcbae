"""From smoothed states to rows of the smoothed table."""

from __future__ import annotations

import numpy as np

from jeat_graph.arrays import FloatArray
from jeat_graph.config import Config
from jeat_graph.smoothers.interpolation import interpolate
from jeat_graph.smoothers.size import SmoothedSize
from jeat_graph.smoothers.track_data import SmoothedTrack
from jeat_graph.smoothing.looks import Looks
from jeat_graph.trajectories import Trajectories


def rows_of(
    track_id: int,
    path: SmoothedTrack,
    sizes: SmoothedSize,
    looks: Looks,
    existence: FloatArray,
    config: Config,
) -> Trajectories:
    """Make the rows of one track, one at each of `looks`.

    Between its states the track follows the motion model's own interpolation; after the last one it is held
    in place (only standing tracks have rows there). Boxes are clipped to the picture, and rows with too
    little of the box inside it left out, just as in the causal table.

    Args:
        track_id: identity.
        path: smoothed states, at least one, none later than those needed.
        sizes: smoothed sizes.
        looks: (K,) times of the rows and the sensors used.
        existence: (K,) probability that the track is a vehicle.
        config: picture, output and sensors.
    """
    t = np.minimum(looks.t, path.t[-1])
    mean, cov = interpolate(path, t)
    held = looks.t > path.t[-1]
    mean[held, :, 1:] = 0.0
    size = sizes.at(np.minimum(t, sizes.t[-1]))
    low = mean[:, :, 0] - 0.5 * size
    high = low + size
    keep = np.ones(len(t), dtype=np.bool_)
    if config.output.clip:
        picture = np.array([config.image.width, config.image.height])
        inner_low, inner_high = np.maximum(low, 0.0), np.minimum(high, picture)
        inside = np.maximum(inner_high - inner_low, 0.0).prod(axis=1) / size.prod(axis=1)
        keep = (inside > 0.0) & (inside >= config.output.min_visible)
        low, high = inner_low, inner_high
    var = np.diagonal(cov, axis1=2, axis2=3)
    return Trajectories(
        t=looks.t[keep],
        track_id=np.full(np.count_nonzero(keep), track_id, dtype=np.int64),
        boxes=np.concatenate([low, high - low], axis=1)[keep],
        existence=existence[keep],
        mean=mean.transpose(0, 2, 1).reshape(-1, 6)[keep],
        var=var.transpose(0, 2, 1).reshape(-1, 6)[keep],
        used=looks.used[keep],
        sensors=config.sensor_names,
    )
