"""Update of tracks by the detections they take: motion, noise scale, size, standing, existence."""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.config.kernel_form import Model, Settings
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.coloured_noise import update_centre
from jeat_graph.filters.cut_boxes import WHOLE, bound_unmeasured, floor_of_centre
from jeat_graph.filters.existence import existence_after_hit
from jeat_graph.filters.fit import exactness, take
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
from jeat_graph.tracking.stages.inner import inner
from jeat_graph.tracking.stages.manoeuvring import weigh_jerk
from jeat_graph.tracking.stages.measuring import measure
from jeat_graph.tracking.stages.predicting import Expectation, expect_detections, jerk_of, occlusion
from jeat_graph.tracking.stages.resizing import follow_cut, size_density_of, weigh_sizes
from jeat_graph.tracking.state import SceneState, TrackArrays
from jeat_graph.tracking.update_log import UpdateLog, log_innovations, log_updates

# Loops stand inside: a function that takes the state of all tracks for each of them counts references to some
# hundred arrays each time, which takes longer than an update.


@inner
def judge_standing(tracks: TrackArrays, measured: Measured, t: float, settings: Settings) -> None:
    """Weigh measurements under "stands" and "moves", before they are taken in."""
    standing, mean, cov = settings.standing, tracks.mean, tracks.cov
    stands, log_odds, since = tracks.standing, tracks.standing_log_odds, tracks.rest_since
    point, var, track, z = tracks.rest_point, tracks.rest_var, measured.track, measured.z
    # Both models take the coloured noise for white, so that they are compared on equal terms.
    R = measured.white + measured.coloured_std * measured.coloured_std
    for k in range(len(track)):
        i = track[k]
        still = still_evidence(point[i], var[i], z[k], R[k])
        odds = update_odds(log_odds[i], still, moving_evidence(mean[i], cov[i], z[k], R[k]), standing.memory)
        log_odds[i] = odds
        if odds < standing.leave_odds:
            # It moves: look for a place to stand from here on.
            stands[i], log_odds[i], since[i] = False, standing.leave_odds, t
            for axis in range(2):
                point[i, axis], var[i, axis] = z[k, axis], R[k, axis]
            continue
        old = t - since[i] >= standing.min_age_s
        stands[i] = stands[i] or (old and odds > standing.enter_odds)
        update_rest_point(point[i], var[i], z[k], R[k])


@inner
def take_centres(tracks: TrackArrays, measured: Measured, error: int) -> FloatArray:
    """Take measured centres in; returns their normalised innovations squared (K,)."""
    mean, cov, track, z = tracks.mean, tracks.cov, measured.track, measured.z
    white, coloured_std, nis = measured.white, measured.coloured_std, np.empty(len(measured.track))
    for k in range(len(track)):
        nis[k] = update_centre(mean[track[k]], cov[track[k]], z[k], white[k], coloured_std[k], error)
    return nis


@inner
def take_sizes(tracks: TrackArrays, measured: Measured, batch: Batch) -> None:
    """Take measured sizes in, and what a cut leaves open of size and centre."""
    track, detection = measured.track, measured.detection
    log_size, log_size_var = measured.log_size, measured.log_size_var
    mean, var, cov, cuts = tracks.size_mean, tracks.size_cov, tracks.cov, tracks.cut
    for k in range(len(track)):
        i, j = track[k], detection[k]
        for side in range(2):
            cut = batch.cut[j, side]
            update_block(mean[i, side], var[i, side], log_size[k, side], log_size_var[k, side])
            cuts[i, side] = cut
            if cut != WHOLE:
                bound_unmeasured(var[i, side])
                if batch.log_size[j, side] > mean[i, side, 0]:
                    # The whole is no smaller than the part, and does not shrink either: between one sensor's
                    # bound and another's slightly shorter boxes the rate would run away.
                    mean[i, side, 0] = batch.log_size[j, side]
                    mean[i, side, 1] = max(mean[i, side, 1], 0.0)
                floor_of_centre(cut, mean[i, side, 0], var[i, side, 0, 0], cov[i, side])


@inner
def hold_still(tracks: TrackArrays, track: IntArray, std_per_size: float) -> None:
    """Take in that of the tracks in rows `track` (K,) those which stand neither move nor grow."""
    standing, mean, cov = tracks.standing, tracks.mean, tracks.cov
    size_mean, size_cov = tracks.size_mean, tracks.size_cov
    for i in track:
        if standing[i]:
            size = math.exp(0.5 * (size_mean[i, 0, 0] + size_mean[i, 1, 0]))
            stand_still(mean[i], cov[i], size_mean[i], size_cov[i], std_per_size, size)


@inner
def take_in(
    tracks: TrackArrays,
    measured: Measured,
    s: int,
    batch: Batch,
    scene: SceneState,
    model: Model,
    log: UpdateLog,
) -> None:
    """Update tracks with the detections of sensor `s` that they take: filter, size, noise scale, standing."""
    settings, error, track = model.settings, model.sensors.error[s], measured.track
    logs = len(log.rows) > 0
    if logs:
        jerk = jerk_of(tracks, track, settings)
        size_density = size_density_of(tracks, track, settings)
        log_updates(log, tracks.track_id, jerk, size_density, batch, measured, model.sensors)
    if settings.standing.enabled:
        judge_standing(tracks, measured, batch.t, settings)
    nis = take_centres(tracks, measured, error)
    if logs:
        log_innovations(log, nis, tracks.scale[track, s])
    if tracks.jerk_weight.shape[1]:
        # A lag behind what turns is no noise of the boxes.
        weigh_jerk(tracks, measured, s, batch.cut, nis, scene, model.sensors)
    resizing = tracks.size_weight.shape[1] > 0
    if resizing:
        weigh_sizes(tracks, measured, s, batch.cut, scene, model.sensors)
    take_sizes(tracks, measured, batch)
    if resizing:
        follow_cut(tracks, measured, batch.cut)
    hold_still(tracks, track, settings.standing.speed_std_per_size)
    noise, scale, hits, score_odds = settings.noise, tracks.scale, tracks.hits, tracks.score_odds
    t_update, used, seen_by, fit = tracks.t_update, tracks.used, tracks.seen_by, tracks.fit
    for k in range(len(track)):
        i, j = track[k], measured.detection[k]
        scale[i, s] = adapt_scale(
            scale[i, s], nis[k], noise.adaptation_rate, noise.scale_min, noise.scale_max
        )
        hits[i] += 1
        score_odds[i] += (batch.score_odds[j] - score_odds[i]) / hits[i]
        noise_of = measured.noise[k], measured.coloured_std[k], batch.spread[j]
        take(fit[i], batch.fit[j], exactness(measured.log_size[k], *noise_of))
        t_update[i] = batch.t
        used[i] |= 1 << s
        seen_by[i] |= 1 << s


@inner
def take_pairs(
    tracks: TrackArrays,
    measured: Measured,
    s: int,
    batch: Batch,
    evidence: FloatArray,
    scene: SceneState,
    model: Model,
    log: UpdateLog,
) -> None:
    """Let tracks take detections of sensor `s`, and update state and existence.

    Args:
        tracks: state of all tracks.
        measured: what these detections measure, for no track twice.
        s: the sensor.
        batch: all detections of the step.
        evidence: (K,) tempered ln Λ of each pair.
        scene: what is learnt of the sensors.
        model: sensors and settings.
        log: takes down what the tracks take in.
    """
    take_in(tracks, measured, s, batch, scene, model, log)
    if model.settings.lifecycle.by_existence:
        existence, track = tracks.existence, measured.track
        for k in range(len(track)):
            existence[track[k]] = existence_after_hit(existence[track[k]], evidence[k])


@inner
def update_matched(
    tracks: TrackArrays,
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
    for s in range(match.shape[1]):
        track = np.flatnonzero(match[:, s] >= 0)
        if len(track) == 0:
            continue
        pairs, evidence = np.empty((2, len(track)), dtype=np.int64), np.empty(len(track))
        believed = model.sensors.tempering[s] * scene.trust[s]
        for k in range(len(track)):
            i = track[k]
            pairs[0, k], pairs[1, k] = i, match[i, s]
            evidence[k] = believed * association.evidence[i, s]
        measured = measure(tracks, pairs, batch, expectation, s, model.sensors)
        take_pairs(tracks, measured, s, batch, evidence, scene, model, log)


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
    listed, evidence = judge_pairs(tracks, n, batch, expectation, p_detect, scene, model)
    first_pair, sensor = np.searchsorted(listed.rows, np.arange(n + 1)), batch.sensor
    first = np.full(n, -1)
    for i in range(n):
        for s in range(match.shape[1]):
            if match[i, s] >= 0:
                first[i] = s
    for s in range(match.shape[1]):
        pairs, tempered, count = np.empty((2, n), dtype=np.int64), np.empty(n), 0
        believed = model.sensors.tempering[s] * scene.trust[s]
        for i in range(n):
            if first[i] < 0 or first[i] == s:
                continue
            # Not the literal -1, for which all that follows would be compiled a second time.
            best, chosen = np.inf, np.int64(-1)
            for p in range(first_pair[i], first_pair[i + 1]):
                j = listed.cols[p]
                if not taken[j] and sensor[j] == s and listed.d2[p] <= best:
                    best, chosen = listed.d2[p], np.int64(p)
            if chosen >= 0:
                j = listed.cols[chosen]
                match[i, s], association.evidence[i, s], taken[j] = j, evidence[chosen], 1
                pairs[0, count], pairs[1, count] = i, j
                tempered[count] = believed * evidence[chosen]
                count += 1
        if count:
            chosen_pairs = pairs[:, :count].copy()
            measured = measure(tracks, chosen_pairs, batch, expectation, s, model.sensors)
            take_pairs(tracks, measured, s, batch, tempered, scene, model, log)
