"""Update of tracks by the detections they take: motion, noise scale, size, standing, existence."""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.config.kernel_form import Model, SensorArrays, Settings
from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.coloured_noise import update_centre
from jeat_graph.filters.cut_boxes import (
    BOTH_CUT,
    UNKNOWN,
    WHOLE,
    bound_unmeasured,
    centre_from_part,
    floor_of_centre,
)
from jeat_graph.filters.existence import existence_after_hit
from jeat_graph.filters.kalman import update_block
from jeat_graph.filters.noise import adapt_scale
from jeat_graph.filters.standing import (
    moving_evidence,
    stand_still,
    still_evidence,
    update_odds,
    update_rest_point,
)
from jeat_graph.tracking.batch import Batch, Measured
from jeat_graph.tracking.stages.associating import Association, judge_pairs
from jeat_graph.tracking.stages.inner import inlined, inner
from jeat_graph.tracking.stages.manoeuvring import weigh_jerk
from jeat_graph.tracking.stages.predicting import Expectation, expect_detections, jerk_of, occlusion
from jeat_graph.tracking.state import SceneState, TrackArrays
from jeat_graph.tracking.update_log import UpdateLog, log_innovation, log_update


@inner
def measured_by(
    tracks: TrackArrays, i: int, batch: Batch, j: int, expectation: Expectation, sensors: SensorArrays
) -> Measured:
    """Say what detection `j` measures of track `i`; a box that is cut only what its visible sides tell."""
    s = batch.sensor[j]
    noise = expectation.white[i, s] * batch.weight[j]
    coloured_std, log_size_var = expectation.coloured_std[i, s], sensors.size_var[s]
    if batch.cut[j, 0] == WHOLE and batch.cut[j, 1] == WHOLE:
        return Measured(batch.z[j], batch.log_size[j], noise, coloured_std, log_size_var, noise)
    white = noise.copy()
    z, log_size, log_size_var = batch.z[j].copy(), batch.log_size[j].copy(), log_size_var.copy()
    for axis in range(2):
        cut = batch.cut[j, axis]
        if cut == WHOLE:
            continue
        known, known_var = tracks.size_mean[i, axis, 0], tracks.size_cov[i, axis, 0, 0]
        if cut == BOTH_CUT:
            z[axis], white[axis] = tracks.mean[i, axis, 0], UNKNOWN
        else:
            z[axis], var = centre_from_part(cut, batch.side[j, axis], log_size[axis], known, known_var)
            white[axis] += var
        log_size[axis], log_size_var[axis] = max(known, log_size[axis]), UNKNOWN
    return Measured(z, log_size, white, coloured_std, log_size_var, noise)


@inlined
def judge_standing(
    tracks: TrackArrays, i: int, t: float, z: FloatArray, R: FloatArray, settings: Settings
) -> None:
    """Weigh a measurement z (2,), R (2,) of track `i` under "stands" and "moves", before it is taken in."""
    standing = settings.standing
    still = still_evidence(tracks.rest_point[i], tracks.rest_var[i], z, R)
    moving = moving_evidence(tracks.mean[i], tracks.cov[i], z, R)
    odds = update_odds(tracks.standing_log_odds[i], still, moving, standing.memory)
    tracks.standing_log_odds[i] = odds
    if odds < standing.leave_odds:
        # It moves: look for a place to stand from here on.
        tracks.standing[i] = False
        tracks.standing_log_odds[i] = standing.leave_odds
        tracks.rest_point[i] = z
        tracks.rest_var[i] = R
        tracks.rest_since[i] = t
        return
    old = t - tracks.rest_since[i] >= standing.min_age_s
    tracks.standing[i] = tracks.standing[i] or (old and odds > standing.enter_odds)
    update_rest_point(tracks.rest_point[i], tracks.rest_var[i], z, R)


@inlined
def update_track(
    tracks: TrackArrays,
    i: int,
    batch: Batch,
    j: int,
    measured: Measured,
    model: Model,
    log: UpdateLog,
) -> None:
    """Update track `i` with detection `j`: filter, size, noise scale, standing."""
    sensors, settings = model.sensors, model.settings
    z, R, coloured_std = measured.z, measured.white, measured.coloured_std
    s = batch.sensor[j]
    if len(log.rows) > 0:
        jerk = jerk_of(tracks, i, settings)
        log_update(log, tracks.track_id[i], j, batch, measured, jerk, sensors)
    if settings.standing.enabled:
        # Both models take the coloured noise for white, so that they are compared on equal terms.
        judge_standing(tracks, i, batch.t, z, R + coloured_std * coloured_std, settings)
    nis = update_centre(tracks.mean[i], tracks.cov[i], z, R, coloured_std, sensors.error[s])
    log_innovation(log, nis, tracks.scale[i, s])
    if tracks.jerk_weight.shape[1]:
        # A lag behind what turns is no noise of the boxes.
        nis = min(nis, weigh_jerk(tracks, i, batch, j, measured, sensors.error[s]))
    tracks.scale[i, s] = adapt_scale(
        tracks.scale[i, s],
        nis,
        settings.noise.adaptation_rate,
        settings.noise.scale_min,
        settings.noise.scale_max,
    )
    for side in range(2):
        update_block(
            tracks.size_mean[i, side],
            tracks.size_cov[i, side],
            measured.log_size[side],
            measured.log_size_var[side],
        )
        tracks.cut[i, side] = batch.cut[j, side]
        if batch.cut[j, side] != WHOLE:
            bound_unmeasured(tracks.size_cov[i, side])
            if batch.log_size[j, side] > tracks.size_mean[i, side, 0]:
                # The whole is no smaller than the part, and does not shrink either: between one sensor's
                # bound and another's slightly shorter boxes the rate would run away.
                tracks.size_mean[i, side, 0] = batch.log_size[j, side]
                tracks.size_mean[i, side, 1] = max(tracks.size_mean[i, side, 1], 0.0)
        floor_of_centre(
            batch.cut[j, side],
            tracks.size_mean[i, side, 0],
            tracks.size_cov[i, side, 0, 0],
            tracks.cov[i, side],
        )
    if tracks.standing[i]:
        size = math.exp(0.5 * (tracks.size_mean[i, 0, 0] + tracks.size_mean[i, 1, 0]))
        stand_still(
            tracks.mean[i],
            tracks.cov[i],
            tracks.size_mean[i],
            tracks.size_cov[i],
            settings.standing.speed_std_per_size,
            size,
        )
    tracks.hits[i] += 1
    tracks.score_odds[i] += (batch.score_odds[j] - tracks.score_odds[i]) / tracks.hits[i]
    tracks.t_update[i] = batch.t
    tracks.used[i] |= 1 << s
    tracks.seen_by[i] |= 1 << s


@inner
def take_detection(
    tracks: TrackArrays,
    i: int,
    batch: Batch,
    j: int,
    measured: Measured,
    evidence: float,
    model: Model,
    log: UpdateLog,
) -> None:
    """Let track `i` take detection `j`, of tempered `evidence`: update its state and its existence."""
    update_track(tracks, i, batch, j, measured, model, log)
    if model.settings.lifecycle.by_existence:
        tracks.existence[i] = existence_after_hit(tracks.existence[i], evidence)


@inner
def tempered(association: Association, i: int, s: int, scene: SceneState, model: Model) -> float:
    """Return the evidence of sensor `s` for track `i` as far as it is believed."""
    return float(model.sensors.tempering[s] * scene.trust[s] * association.evidence[i, s])


@inner
def update_matched(
    tracks: TrackArrays,
    n: int,
    batch: Batch,
    expectation: Expectation,
    association: Association,
    scene: SceneState,
    model: Model,
    log: UpdateLog,
) -> None:
    """Take the matched detections in, one sensor after another.

    That is a stacked update where all is linear: where no box is cut, the track does not stand, and the
    sensors have no error states, which are measured in the order of the sensors.
    """
    match = association.match
    for i in range(n):
        for s in range(match.shape[1]):
            j = match[i, s]
            if j < 0:
                continue
            association.taken[j] = 1
            measured = measured_by(tracks, i, batch, j, expectation, model.sensors)
            evidence = tempered(association, i, s, scene, model)
            take_detection(tracks, i, batch, j, measured, evidence, model, log)


@inner
def take_second_views(
    tracks: TrackArrays,
    n: int,
    batch: Batch,
    association: Association,
    p_detect: FloatArray,
    scene: SceneState,
    model: Model,
    log: UpdateLog,
) -> None:
    """Second pass of algorithm 1: each matched track takes the nearest gated leftover of another sensor.

    The distance is that to the track as the first detection has updated it, and so is the evidence. Entries
    of `match` and `evidence` are set.
    """
    match, taken = association.match, association.taken
    if np.all(taken != 0):
        return
    expectation = expect_detections(tracks, n, occlusion(tracks, n), model)
    pairs, evidence = judge_pairs(tracks, n, batch, expectation, p_detect, scene, model)
    first_pair = np.searchsorted(pairs.rows, np.arange(n + 1))
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
            best = np.inf
            # Not the literal -1, for which all that follows would be compiled a second time.
            chosen = np.int64(-1)
            for p in range(first_pair[i], first_pair[i + 1]):
                j = pairs.cols[p]
                if not taken[j] and batch.sensor[j] == s and pairs.d2[p] <= best:
                    best, chosen = pairs.d2[p], np.int64(p)
            if chosen >= 0:
                j = pairs.cols[chosen]
                match[i, s], association.evidence[i, s], taken[j] = j, evidence[chosen], 1
                measured = measured_by(tracks, i, batch, j, expectation, model.sensors)
                believed = tempered(association, i, s, scene, model)
                take_detection(tracks, i, batch, j, measured, believed, model, log)
