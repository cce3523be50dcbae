"""What detections measure: of tracks, of a track that begins, and of one that another sensor has begun."""

from __future__ import annotations

import math

from jeat_graph.config.kernel_form import SensorArrays
from jeat_graph.data.arrays import IntArray
from jeat_graph.filters.cut_boxes import (
    BOTH_CUT,
    FIRST_LOG_GROWTH,
    FIRST_LOG_GROWTH_STD,
    HIGH_CUT,
    UNKNOWN,
    WHOLE,
    centre_from_part,
    centre_from_side,
)
from jeat_graph.filters.noise import base_variance, scored_noise
from jeat_graph.tracking.batch import Batch, Measured, no_measurements
from jeat_graph.tracking.stages.inner import inner
from jeat_graph.tracking.stages.predicting import Expectation, split_noise
from jeat_graph.tracking.state import TrackArrays


@inner
def measure(
    tracks: TrackArrays,
    pairs: IntArray,
    batch: Batch,
    expectation: Expectation,
    s: int,
    sensors: SensorArrays,
) -> Measured:
    """Say what detections of sensor `s` measure of tracks; one that is cut, only what its visible sides tell.

    Args:
        tracks: state of all tracks.
        pairs: (2, K) rows of the tracks, and the detection of each.
        batch: all detections of the step.
        expectation: of the same tracks.
        s: the sensor.
        sensors: parameters of the sensors.
    """
    out = no_measurements(pairs.shape[1])
    size_var = sensors.size_var
    mean, size_mean, size_cov = tracks.mean, tracks.size_mean, tracks.size_cov
    for k in range(pairs.shape[1]):
        i, j = pairs[0, k], pairs[1, k]
        out.track[k], out.detection[k] = i, j
        spread = batch.spread[j]
        for axis in range(2):
            usual, lasting = expectation.white[i, s, axis], expectation.coloured_std[i, s, axis]
            noise, h = scored_noise(usual, lasting, spread)
            cut, noise = batch.cut[j, axis], noise * batch.weight[j]
            z, white, log_size = batch.z[j, axis], noise, batch.log_size[j, axis]
            log_size_var = spread * spread * size_var[s, axis]
            if cut != WHOLE:
                known, known_var = size_mean[i, axis, 0], size_cov[i, axis, 0, 0]
                if cut == BOTH_CUT:
                    z, white = mean[i, axis, 0], UNKNOWN
                else:
                    z, var = centre_from_part(cut, batch.side[j, axis], log_size, known, known_var)
                    white += var
                log_size, log_size_var = max(known, log_size), UNKNOWN
            out.z[k, axis], out.log_size[k, axis] = z, log_size
            out.white[k, axis], out.noise[k, axis] = white, noise
            out.coloured_std[k, axis] = h
            out.log_size_var[k, axis] = log_size_var
    return out


@inner
def first_view(batch: Batch, i: int, j: int, sensors: SensorArrays) -> Measured:
    """Say what detection `j` measures for row `i`, of unknown size; one that is cut may be much larger."""
    s, own = batch.sensor[j], no_measurements(1)
    own.track[0], own.detection[0] = i, j
    size, spread = math.sqrt(batch.boxes[j, 2] * batch.boxes[j, 3]), batch.spread[j]
    for axis in range(2):
        side = batch.boxes[j, 2 + axis]
        base = base_variance(sensors.sigma_px[s], sensors.rho[s, axis], side, sensors.rho_size[s], size)
        r, h = scored_noise(*split_noise(base, s, sensors), spread)
        noise = r * batch.weight[j]
        z, white, log_size, log_size_var = (
            batch.z[j, axis],
            noise,
            batch.log_size[j, axis],
            spread * spread * sensors.size_var[s, axis],
        )
        cut = batch.cut[j, axis]
        if cut != WHOLE:
            log_size += FIRST_LOG_GROWTH
            log_size_var += FIRST_LOG_GROWTH_STD * FIRST_LOG_GROWTH_STD
            half_var = centre_from_side(HIGH_CUT, 0.0, log_size, log_size_var)[1]
            if cut != BOTH_CUT:
                z, _ = centre_from_side(cut, batch.side[j, axis], log_size, 0.0)
            white += half_var
        own.z[0, axis], own.log_size[0, axis], own.log_size_var[0, axis] = z, log_size, log_size_var
        own.white[0, axis], own.coloured_std[0, axis], own.noise[0, axis] = white, h, noise
    return own


@inner
def second_view(tracks: TrackArrays, i: int, batch: Batch, j: int, sensors: SensorArrays) -> Measured:
    """Say what detection `j` measures of track `i`, which another sensor's detection has just begun."""
    own = first_view(batch, i, j, sensors)
    for axis in range(2):
        cut = batch.cut[j, axis]
        if cut == WHOLE:
            continue
        known = tracks.size_mean[i, axis, 0]
        if cut == BOTH_CUT:
            own.z[0, axis] = tracks.mean[i, axis, 0]
        else:
            shown = batch.log_size[j, axis]
            own.z[0, axis], _ = centre_from_part(cut, batch.side[j, axis], shown, known, 0.0)
        # Both views guess the part that does not show in the same way.
        own.log_size[0, axis], own.log_size_var[0, axis] = known, UNKNOWN
    return own
