"""Taking detections in: filter, noise scale, size, standing, existence."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.config.kernel_form import SensorArrays, Settings
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.coloured_noise import update_centre
from jeat_graph.filters.existence import existence_after_hit
from jeat_graph.filters.kalman import update_block
from jeat_graph.filters.noise import adapt_scale
from jeat_graph.filters.standing import (
    moving_evidence,
    stand_still,
    still_evidence,
    update_anchor,
    update_odds,
)
from jeat_graph.tracking.batch import Measurements
from jeat_graph.tracking.stages.predicting import Expectation, expect_detections, jerk_of
from jeat_graph.tracking.state import TrackArrays
from jeat_graph.tracking.update_log import UpdateLog, log_surprise, log_update


@njit(cache=True, forceinline=True)
def judge_standing(
    tracks: TrackArrays, i: int, t: float, z: FloatArray, R: FloatArray, settings: Settings
) -> None:
    """Weigh a measurement z (2,), R (2,) of track `i` under "stands" and "moves", before it is taken in."""
    still = still_evidence(tracks.anchor[i], tracks.anchor_var[i], z, R)
    moving = moving_evidence(tracks.mean[i], tracks.cov[i], z, R)
    odds = update_odds(tracks.still_odds[i], still, moving, settings.standing_memory)
    tracks.still_odds[i] = odds
    if odds < settings.standing_leave:
        # It moves: look for a place to stand from here on.
        tracks.standing[i] = False
        tracks.still_odds[i] = settings.standing_leave
        tracks.anchor[i] = z
        tracks.anchor_var[i] = R
        tracks.anchor_t[i] = t
        return
    old = t - tracks.anchor_t[i] >= settings.standing_age_s
    tracks.standing[i] = tracks.standing[i] or (old and odds > settings.standing_enter)
    update_anchor(tracks.anchor[i], tracks.anchor_var[i], z, R)


@njit(cache=True, forceinline=True)
def take(
    tracks: TrackArrays,
    i: int,
    t: float,
    j: int,
    batch: Measurements,
    R: FloatArray,
    lever: FloatArray,
    sensors: SensorArrays,
    settings: Settings,
    log: UpdateLog,
) -> None:
    """Update track `i` with detection `j`: filter, size, noise scale, standing.

    Its noise has white variances R (2,) (px²) and the lever (2,) (px) on the sensor's error with memory.
    """
    s = batch.sensor[j]
    if len(log.rows) > 0:
        jerk = jerk_of(tracks, i, settings)
        log_update(
            log, tracks.track_id[i], s, batch.z[j], R, lever, jerk, batch.log_size[j], sensors.size_var[s]
        )
    if settings.standing:
        # Both models take the error with memory for white: neither may gain by knowing it.
        judge_standing(tracks, i, t, batch.z[j], R + lever * lever, settings)
    nis = update_centre(tracks.mean[i], tracks.cov[i], batch.z[j], R, lever, sensors.error[s])
    log_surprise(log, nis, tracks.scale[i, s])
    tracks.scale[i, s] = adapt_scale(
        tracks.scale[i, s], nis, settings.adaptation_rate, settings.scale_min, settings.scale_max
    )
    for side in range(2):
        update_block(
            tracks.size_mean[i, side],
            tracks.size_cov[i, side],
            batch.log_size[j, side],
            sensors.size_var[s, side],
        )
    if tracks.standing[i]:
        size = math.exp(0.5 * (tracks.size_mean[i, 0, 0] + tracks.size_mean[i, 1, 0]))
        stand_still(
            tracks.mean[i],
            tracks.cov[i],
            tracks.size_mean[i],
            tracks.size_cov[i],
            settings.standing_speed_std,
            size,
        )
    tracks.hits[i] += 1
    tracks.t_update[i] = t
    tracks.used[i] |= 1 << s


@njit(cache=True)
def update_matched(
    tracks: TrackArrays,
    n: int,
    t: float,
    batch: Measurements,
    expectation: Expectation,
    match: IntArray,
    evidence: FloatArray,
    taken: IntArray,
    sensors: SensorArrays,
    settings: Settings,
    log: UpdateLog,
) -> None:
    """Take the matched detections in, one sensor after another (equal to a stacked update); mark `taken`."""
    for i in range(n):
        for s in range(match.shape[1]):
            j = match[i, s]
            if j < 0:
                continue
            taken[j] = 1
            R = expectation.white[i, s] * batch.weight[j]
            take(tracks, i, t, j, batch, R, expectation.lever[i, s], sensors, settings, log)
            if settings.by_existence:
                tracks.existence[i] = existence_after_hit(
                    tracks.existence[i], evidence[i, s], sensors.tempering[s]
                )
            tracks.hidden[i, s] = 0.0
            p = tracks.p_detect[i, s] + settings.p_detect_weight * (1.0 - tracks.p_detect[i, s])
            tracks.p_detect[i, s] = min(p, settings.p_detect_max)


@njit(cache=True)
def take_second_views(
    tracks: TrackArrays,
    n: int,
    t: float,
    batch: Measurements,
    match: IntArray,
    taken: IntArray,
    sensors: SensorArrays,
    settings: Settings,
    log: UpdateLog,
) -> None:
    """Second pass of algorithm 1: each matched track takes the nearest gated leftover of another sensor.

    The distance is that to the track as the first detection has updated it. Entries of `match` are set.
    """
    leftover = np.flatnonzero(taken == 0)
    if not len(leftover):
        return
    expectation = expect_detections(tracks, n, sensors)
    for i in range(n):
        first = -1
        for s in range(match.shape[1]):
            if match[i, s] >= 0:
                first = s
        if first < 0:
            continue
        for s in range(match.shape[1]):
            if s == first:
                continue
            best = settings.gate
            chosen = -1
            for j in leftover:
                if taken[j] or batch.sensor[j] != s:
                    continue
                d2 = 0.0
                for axis in range(2):
                    y = batch.z[j, axis] - expectation.centre[i, s, axis]
                    R = expectation.white[i, s, axis] * batch.weight[j]
                    d2 += y * y / (expectation.var[i, s, axis] + R)
                if d2 <= best:
                    best = d2
                    chosen = int(j)
            if chosen >= 0:
                white = expectation.white[i, s] * batch.weight[chosen]
                take(tracks, i, t, chosen, batch, white, expectation.lever[i, s], sensors, settings, log)
                match[i, s] = chosen
                taken[chosen] = 1
