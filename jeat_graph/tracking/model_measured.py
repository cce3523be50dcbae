"""What the boxes of a step say of their tracks: diagnostics, and records for other smoothers."""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.data.diagnostics import Diagnostics
from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.tracking.by_track import places
from jeat_graph.tracking.engine import StepBoxes

#: No error of a sensor that lasts.
_NO_ERROR = -1


def diagnostics_of(
    measured: StepBoxes,
    assigned: IntArray,
    living: IntArray,
    fit: tuple[FloatArray, FloatArray, FloatArray],
    sensors: tuple[str, ...],
) -> Diagnostics:
    """Return how well each box of a step fitted its track.

    Args:
        measured: the boxes.
        assigned: (M,) tracks that took them.
        living: (N,) tracks after the step, ascending.
        fit: of `TrackEngine.fit`.
        sensors: names of the sensors.
    """
    nis, scale, real = fit
    row, there = places(assigned, living)
    return Diagnostics(
        t=np.full(len(assigned), measured.t),
        track_id=assigned,
        sensor=measured.sensor,
        nis=nis,
        noise_scale=scale,
        existence=np.where(there, real[row], np.nan) if len(living) else np.full(len(assigned), np.nan),
        sensors=sensors,
    )


def records_of(
    measured: StepBoxes,
    assigned: IntArray,
    fit: tuple[FloatArray, FloatArray, FloatArray],
    q: singer.ProcessNoise,
    c: ModelConstants,
) -> RecordArray:
    """Return the boxes of a step as `MEASUREMENT` (M,), as the filter weighed them.

    Args:
        measured: the boxes; sensors as the caller counts them.
        assigned: (M,) tracks that took them.
        fit: of `TrackEngine.fit`.
        q: process noise of the scene.
        c: constants.
    """
    nis, scale, _ = fit
    rows = np.zeros(len(assigned), dtype=MEASUREMENT)
    size = measured.boxes[:, 2:]
    # What is in proportion to ρ² is the sensor's own, and of that a part lasts (`singer.lasting_error`).
    of_size = box_sides.side_variance(size, 0.0, c) - c.pixel_std**2
    own = (c.side_std**2 * scale)[:, None] * of_size
    side, lasting = own + c.pixel_std**2, c.error_share * own
    whole, born = np.sqrt(size.prod(axis=1)), np.isnan(nis)
    rows["t"], rows["track_id"], rows["sensor"], rows["birth"] = measured.t, assigned, measured.sensor, born
    rows["z"] = measured.boxes[:, :2] + size / 2.0
    # The centre is the mean of two sides, the size their difference.
    rows["r"] = rows["noise"] = side / 2.0
    rows["coloured_std"] = np.sqrt(lasting / 2.0)
    rows["error"] = _NO_ERROR
    rows["jerk"] = np.exp(q.jerk / 2.0) * whole
    rows["size_density"] = math.exp(q.growth / 2.0)
    rows["log_size"], rows["size_var"] = np.log(size), 2.0 * (side + lasting) / size**2
    if born.any():
        corners = np.concatenate([measured.boxes[:, :2], measured.boxes[:, :2] + size], axis=1)
        whole = np.zeros((int(born.sum()), 2, 2), dtype=np.bool_)
        _, first = box_sides.initial_state(corners[born], whole, 0.0, 0.0, c)
        rows["velocity_var"][born] = first[:, :, singer.VELOCITY, singer.VELOCITY]
        rows["acceleration_var"][born] = first[:, :, singer.ACCELERATION, singer.ACCELERATION]
        rows["rate_var"][born] = first[:, :, singer.GROWTH, singer.GROWTH].mean(axis=1)
    rows["nis"], rows["scale"] = nis, scale
    return rows
