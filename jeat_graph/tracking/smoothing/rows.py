"""From smoothed states to rows of the smoothed table."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.smoothers.interpolation import interpolate
from jeat_graph.smoothers.size import SmoothedSize
from jeat_graph.smoothers.track_data import COINCIDENT_S, SmoothedTrack
from jeat_graph.tracking.smoothing.observation_times import ObservationTimes


def rows_of(
    track_id: int,
    path: SmoothedTrack,
    sizes: SmoothedSize,
    observed: ObservationTimes,
    existence: FloatArray,
    config: Config,
) -> Trajectories:
    """Make the rows of one track, one at each of `observed`.

    Between its states the track follows the motion model's own interpolation; after the last one it is held
    in place (only standing tracks have rows there). Boxes are clipped to the picture, and rows with too
    little of the box inside it left out, just as in the causal table.

    Args:
        track_id: identity.
        path: smoothed states, at least one, none later than those needed.
        sizes: smoothed sizes.
        observed: (K,) times of the rows and the sensors used.
        existence: (K,) probability that the track is a vehicle.
        config: picture, output and sensors.
    """
    t = np.minimum(observed.t, path.t[-1])
    mean, cov = interpolate(path, t)
    # Within a microsecond of the last state a detection shares it: the track is seen there, not held.
    held = observed.t - path.t[-1] > COINCIDENT_S
    mean[held, :, 1:] = 0.0
    size, log_var = sizes.at(np.minimum(t, sizes.t[-1]))
    boxes, visible = _boxes(mean, size, config.image.width, config.image.height, config.output.clip)
    keep: slice | BoolArray = slice(None)
    if config.output.clip:
        shown = observed.used != 0 if config.image.edge_px > 0.0 else np.zeros(len(t), dtype=bool)
        inside: BoolArray = (visible > 0.0) & ((visible >= config.output.min_visible) | shown)
        keep = slice(None) if inside.all() else inside
    var = np.diagonal(cov, axis1=2, axis2=3).transpose(0, 2, 1).reshape(-1, 6).copy()
    var[:, :2] = _scale(boxes, config) * var[:, :2] + (config.output.lasting_error * size[:, 1:]) ** 2
    return Trajectories(
        t=observed.t[keep],
        track_id=np.full(len(t), track_id, dtype=np.int64)[keep],
        boxes=boxes[keep],
        existence=existence[keep],
        mean=mean.transpose(0, 2, 1).reshape(-1, 6)[keep],
        var=var[keep],
        used=observed.used[keep],
        sensors=config.sensor_names,
        size_var=(size * size * log_var)[keep],
    )


def _scale(boxes: FloatArray, config: Config) -> FloatArray:
    """Factors (K, 2) on the position's variances of boxes (K, 4), as `reporting.written_scale` has them."""
    scale, edge = config.output.position_scale, config.image.edge_px
    if scale >= 1.0 or edge <= 0.0:
        return np.full((len(boxes), 2), scale)
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    far = np.array([config.image.width, config.image.height]) - edge
    return np.where((low <= edge) | (high >= far), 1.0, scale)


@njit(cache=True)
def _boxes(
    mean: FloatArray, size: FloatArray, width: float, height: float, clip: bool
) -> tuple[FloatArray, FloatArray]:
    """Boxes (K, 4) left, top, width, height of states (K, 2, 3) and sizes (K, 2), clipped or not (px).

    And (K,) the part of each that lies in the picture.
    """
    boxes, visible = np.empty((len(size), 4)), np.empty(len(size))
    for i in range(len(size)):
        area = inside = 1.0
        for axis, edge in ((0, width), (1, height)):
            low = mean[i, axis, 0] - 0.5 * size[i, axis]
            high = low + size[i, axis]
            inner_low, inner_high = max(low, 0.0), min(high, edge)
            area *= size[i, axis]
            inside *= max(inner_high - inner_low, 0.0)
            if clip:
                low, high = inner_low, inner_high
            boxes[i, axis], boxes[i, 2 + axis] = low, high - low
        visible[i] = inside / area if area > 0.0 else 0.0
    return boxes, visible
