"""The reference tracker's step in NumPy: the definition of the model, as the method's page has it.

predict → correct boxes → follow the picture → follow the camera → associate → update → hits and misses
→ births → compare sensors → posterior → learn → report → end.

Every stage has what it reads and writes in its name and in `ReferenceState`; the formulas are in the modules
of `filters` and `association` that it calls. Scans of one time are taken one after the other, the sensor with
the most exact boxes first, as sequential updates are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jeat_graph.association import likelihood_ratio
from jeat_graph.association.assignment import assign
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters import (
    box_sides,
    box_spread,
    camera_motion,
    evidence,
    gap_survival,
    noise_learning,
    picture_motion,
    score_calibration,
    sensor_offsets,
    singer,
    visibility,
)
from jeat_graph.filters.evidence import ScanClock
from jeat_graph.filters.gap_survival import GapCounts
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.picture_motion import PictureMotion
from jeat_graph.filters.visibility import VISIBLE
from jeat_graph.smoothers.state_rts import FilterRecord
from jeat_graph.tracking.reference_life import (
    begin_tracks,
    compare_overlaps,
    compare_sensors,
    count_false_boxes,
    end_tracks,
    is_stationary,
    judge,
    learn,
    own_p_detect,
    report,
)
from jeat_graph.tracking.reference_state import ReferenceState, ReferenceTracks, SensorScan

# Share of the running mean of a sensor's period that a scan keeps.
_PERIOD_MEMORY = 0.9
# Tracks that show the camera's motion: really there, with so many detections, the last so recent (s).
_CAMERA_DETECTIONS, _CAMERA_AGE_S = 2, 0.5
# A pair that is possible is so however low the similarity.
_LEAST_GAIN = 1e-9


class AssociatedPairs(NamedTuple):
    """What association found in one scan.

    Attributes:
        track, box: (K,) rows of tracks, and of boxes.
        ratio: (K,) ln L of each.
        p_detect: (N,) each track's own P_D.
        confirms: (K,) whether the box tells that the track is still there.
        innovation: of all boxes from all tracks.
        nis: (K,) squared distance of each centre in standard deviations, χ² of two degrees of freedom.
    """

    track: IntArray
    box: IntArray
    ratio: FloatArray
    p_detect: FloatArray
    confirms: BoolArray
    innovation: box_sides.SideInnovations
    nis: FloatArray


class Reported(NamedTuple):
    """What a step tells.

    Attributes:
        tracks: (N,) the tracks after it, before any ends.
        reported: (N,) which are reported.
        assigned: per scan (M,) identity of the track that took each box; every box has one.
        records: per scan, for the smoother.
        nis: per scan (M,) of `AssociatedPairs`, NaN where a box began a track.
        noise_scale: per scan (M,), mean variance of each box's sides, 1 before anything was learnt.
        gaps: counted before any track ends.
    """

    tracks: ReferenceTracks
    reported: BoolArray
    assigned: list[IntArray]
    records: list[FilterRecord]
    nis: list[FloatArray]
    noise_scale: list[FloatArray]
    gaps: GapCounts


def step(
    state: ReferenceState,
    t: float,
    scans: Sequence[SensorScan],
    c: ModelConstants,
    motion: PictureMotion | None = None,
) -> Reported:
    """Take in all scans of one time (s), at most one of each sensor.

    Args:
        state: changed.
        t: time (s).
        scans: of that time.
        c: constants.
        motion: of the camera since its picture before, where there is one of that time.
    """
    step_s = t if state.t is None else state.t
    state.tracks = replace(state.tracks, used=np.zeros_like(state.tracks.used))
    assigned, records = [np.zeros(0, dtype=np.int64) for _ in scans], []
    nis, noise_scale = [np.full(len(scan.boxes), np.nan) for scan in scans], [np.zeros(0) for _ in scans]
    for place in order_of_scans(state, scans, c):
        given = scans[place]
        clock = begin_scan(state, t, given, c)
        dt = 0.0 if state.t is None else t - state.t
        transition = predict(state, t, c)
        scan = correct_boxes(state, given, c)
        follow_picture(state, scan, motion, step_s, c)
        follow_camera(state, scan, dt, c)
        noise_scale[place] = state.noise_of(given, c) / c.side_std**2
        pairs = associate(state, scan, c)
        nis[place][pairs.box] = pairs.nis
        count_gaps(state, scan, pairs, c)
        learn_noise(state, scan, pairs, clock, c)
        before = update(state, pairs, c)
        await_more(state, scan, pairs)
        count_hits_and_misses(state, scan, pairs, clock, c)
        free = count_clutter(state, scan, pairs, c)
        begin_tracks(state, scan, free, clock, c)
        assigned[place] = assigned_tracks(state, pairs, free)
        compare_sensors(state, given, assigned[place], c)
        took = np.where(np.isin(state.tracks.track_id, assigned[place]), given.sensor, -1)
        records.append(record(before, state.tracks, transition, took))
    compare_overlaps(state)
    judge(state, c)
    for given, by_box in zip(scans, assigned, strict=True):
        count_false_boxes(state, given.sensor, by_box, c)
    learn(state, t, c)
    shown = report(state, c)
    out = Reported(state.tracks, shown, assigned, records, nis, noise_scale, state.gaps)
    end_tracks(state, t, c)
    return out


def order_of_scans(state: ReferenceState, scans: Sequence[SensorScan], c: ModelConstants) -> list[int]:
    """Return the places of scans: the most exact sensor first, equals by what they see."""
    noise = state.log_noise(c)
    content = [(noise[s.sensor], s.logits.tolist(), s.boxes.tolist()) for s in scans]
    return sorted(range(len(scans)), key=content.__getitem__)


def begin_scan(state: ReferenceState, t: float, scan: SensorScan, c: ModelConstants) -> ScanClock:
    """Take notice of a scan: the sensor's period, its decision threshold, the picture and its edges."""
    k = scan.sensor
    if not state.picture_known and len(scan.boxes):
        width, height = scan.boxes[:, 2:].max(axis=0)
        state.picture = max(state.picture[0], float(width)), max(state.picture[1], float(height))
    if state.picture_known:
        state.boxes_beyond[k] += box_sides.beyond_edge(scan.boxes, state.picture, c).sum()
        state.boxes_at_edge[k] += box_sides.at_edge(scan.boxes, state.picture, c).any(axis=(1, 2)).sum()
    since = t - state.last_scan_s[k]
    if not math.isnan(since):
        known = not math.isnan(state.period_s[k])
        mean = _PERIOD_MEMORY * state.period_s[k] + (1.0 - _PERIOD_MEMORY) * since
        state.period_s[k] = mean if known else since
    state.last_scan_s[k] = t
    counts = score_calibration.count_repetition(state.repetition[k], scan.boxes, scan.logits, c)
    state.repetition = (*state.repetition[:k], counts, *state.repetition[k + 1 :])
    even = state.even_logit[k]
    learnt = score_calibration.decision_threshold(counts, c)
    state.sensors.decision_threshold[k] = learnt if math.isnan(even) else even
    state.sensors.score_weight[k] = _score_weight(state, k, c)
    period = c.first_period_s if math.isnan(state.period_s[k]) else float(state.period_s[k])
    return ScanClock(t, period, min(1.0, period / c.correlation_time_s))


def _score_weight(state: ReferenceState, k: int, c: ModelConstants) -> float:
    """Return how much a sensor's scores count: as given, or as learnt where others can contradict them.

    With one sensor alone nothing else tells what is real: there its scores count in full.
    """
    if not math.isnan(state.given_weight[k]):
        return float(state.given_weight[k])
    alone = sum(counts.scans > 0 for counts in state.repetition) < 2
    return 1.0 if alone else score_calibration.meaning(state.repetition[k], c)


def predict(state: ReferenceState, t: float, c: ModelConstants) -> FloatArray:
    """Predict states and presence to a time; return the transitions (N, 1, 7, 7) of the tracks."""
    dt = 0.0 if state.t is None else t - state.t
    state.t = t
    model = singer.discretise(dt, c)
    tracks = state.tracks
    F = singer.in_perspective(model.F, tracks.mean, dt, c)
    if dt > 0.0:
        state.camera_path = state.camera_path.predicted(model.F, state.camera_velocity, state.picture, dt)
    if dt > 0.0 and len(tracks):
        noise = state.process_noise, state.log_scene_variance(c)
        own, moves = picture_motion.before_prediction(tracks.mean, state.camera_velocity)
        mean, covariance = singer.predict(own, tracks.covariance, model, F, *noise, c)
        mean = picture_motion.after_prediction(mean, moves, state.camera_velocity, dt)
        presence = visibility.predict(tracks.presence, dt, c)
        state.tracks = replace(tracks, mean=mean, covariance=covariance, presence=presence)
    return F


def correct_boxes(state: ReferenceState, scan: SensorScan, c: ModelConstants) -> SensorScan:
    """Return the scan with boxes as the sensors have them on the average, and which sides end at the edge.

    A detector whose boxes end at the edge more often than they reach beyond is taken to cut them there.
    """
    k = scan.sensor
    cuts = state.picture_known and bool(state.boxes_at_edge[k] >= state.boxes_beyond[k])
    edges = box_sides.at_edge(scan.boxes, state.picture, c) & cuts
    offset = sensor_offsets.offsets(state.offsets, state.log_noise(c), c)[k]
    return scan._replace(boxes=sensor_offsets.corrected(scan.boxes, offset), edges=edges)


def follow_picture(
    state: ReferenceState,
    scan: SensorScan,
    motion: PictureMotion | None,
    step_s: float,
    c: ModelConstants,
) -> None:
    """Compensate the tracks for the camera's motion as its newest picture shows it.

    Done with the first scan of a time; `step_s` is the time of the step before (s). A motion that contradicts
    the scan's boxes is ignored.
    """
    t, camera = state.time, state.camera_velocity.at(state.time)
    state.camera_velocity = camera
    if motion is None or t <= camera.picture_s:
        return
    tracks, sure = state.tracks, surely_there(state, c)
    mean, covariance, velocity = picture_motion.follow(
        tracks.mean, tracks.covariance, tracks.evidence.last_s, motion, camera, (step_s, t)
    )
    moved = (mean - tracks.mean)[sure, :, singer.POSITION]
    seen = tracks.mean[sure], tracks.covariance[sure], scan.boxes
    noise = float(state.log_noise(c)[scan.sensor])
    if not camera_motion.contradicted(*seen, noise, moved, state.camera, c):
        state.tracks, state.camera_velocity = replace(tracks, mean=mean, covariance=covariance), velocity
        state.camera_path = state.camera_path.with_picture(camera, velocity, state.picture, step_s)


def surely_there(state: ReferenceState, c: ModelConstants) -> BoolArray:
    """Return which tracks (N,) show the camera's motion."""
    tracks = state.tracks
    recent = state.time - tracks.evidence.last_s < _CAMERA_AGE_S
    return np.asarray((tracks.real > c.report) & (tracks.evidence.detections > _CAMERA_DETECTIONS) & recent)


def follow_camera(state: ReferenceState, scan: SensorScan, dt: float, c: ModelConstants) -> None:
    """Estimate what shift and scale all tracks have in common over `dt` seconds, and take them along."""
    dt = singer.whole_microseconds(dt)
    if dt <= 0.0:
        return
    tracks, noise = state.tracks, float(state.log_noise(c)[scan.sensor])
    sure = surely_there(state, c)
    seen = tracks.mean[sure], tracks.covariance[sure], scan.boxes
    motion, state.camera = camera_motion.estimate(*seen, noise, state.picture, dt, state.camera, c)
    if motion is not None:
        mean, covariance = camera_motion.compensate(
            tracks.mean, tracks.covariance, motion, state.picture, dt, c
        )
        state.tracks = replace(tracks, mean=mean, covariance=covariance)
        state.camera_path = state.camera_path.with_motion(motion, dt, c)


def associate(state: ReferenceState, scan: SensorScan, c: ModelConstants) -> AssociatedPairs:
    """Find the boxes of tracks: the assignment of greatest log likelihood ratio."""
    tracks, k = state.tracks, scan.sensor
    p_detect = own_p_detect(tracks, state.sensors.p_detect, c)[:, k]
    noise = float(state.log_noise(c)[k])
    size = singer.expected_size(tracks.mean)
    spread = state.spread_of(scan, size[:, None])
    seen = scan.boxes, scan.edges
    innovation = box_sides.innovations(tracks.mean, tracks.covariance, *seen, noise, c, spread)
    density = likelihood_ratio.sides_log_density(innovation, size, c)
    threshold = float(state.sensors.decision_threshold[k])
    score = likelihood_ratio.score_log_ratio(tracks.real, scan.logits - threshold, c)
    clutter = likelihood_ratio.clutter_log_density(size, float(state.leftovers[k]), state.picture, c)
    present = tracks.presence[:, VISIBLE] * p_detect
    ratio = likelihood_ratio.pair_log_ratio(density, present, score, clutter)
    ratio = by_owner(ratio, tracks.given, scan.owners)
    track, box = assign(by_appearance(ratio, scan.similarity), c.exact_assignment)
    y, S = innovation.y[track, box].reshape(-1, 2, 2), innovation.S[track, box]
    nis = (y.mean(axis=2) ** 2 / S.mean(axis=(2, 3))).sum(axis=1)
    by_itself = score_calibration.box_probability(scan.boxes, scan.logits, threshold)
    confirms = by_itself[box] >= c.confirming
    return AssociatedPairs(track, box, ratio[track, box], p_detect, confirms, innovation, nis)


def by_owner(ratio: FloatArray, owner: IntArray, owners: IntArray | None) -> FloatArray:
    """Return ln L (N, M) where who is who is given: tracks with an owner (N,) take its boxes (M,), no others.

    A box is taken however far off it lies: that is no reason to doubt that the track is real.
    """
    given = np.full(ratio.shape[1], -1) if owners is None else owners
    owned = (owner >= 0)[:, None] | (given >= 0)[None]
    same = owned & (owner[:, None] == given[None])
    return np.where(same, np.maximum(ratio, _LEAST_GAIN), np.where(owned, 0.0, ratio))


def by_appearance(ratio: FloatArray, similarity: FloatArray | None) -> FloatArray:
    """Return ln L (N, M) with what appearance says: who takes a box, and not whether there is an object."""
    if similarity is None:
        return ratio
    out = ratio.copy()
    known = out[: len(similarity)]
    known[:] = np.where(known > 0.0, np.maximum(known + similarity, _LEAST_GAIN), known)
    return out


def count_gaps(state: ReferenceState, scan: SensorScan, pairs: AssociatedPairs, c: ModelConstants) -> None:
    """Count the gaps that end now, and whether the object was where it had been predicted."""
    tracks = state.tracks
    gap = tracks.evidence.missed[pairs.track]
    ends = (tracks.real[pairs.track] > c.report) & (gap > 0.0) & pairs.confirms
    predicted = box_sides.expected_corners(tracks.mean[pairs.track[ends]])
    found = scan.boxes[pairs.box[ends]]
    overlap = np.diagonal(box_sides.intersection_over_union(predicted, found))
    state.gaps = gap_survival.count_ends(state.gaps, gap[ends], overlap >= c.gap_overlap)


def learn_noise(
    state: ReferenceState, scan: SensorScan, pairs: AssociatedPairs, clock: ScanClock, c: ModelConstants
) -> None:
    """Learn measurement noise of the sensor and process noise of the scene from innovations.

    Boxes at the edge of the picture teach nothing, and the next box of such a track has none before it.
    """
    tracks, i, seen = state.tracks, pairs.track, pairs.innovation
    size = singer.expected_size(tracks.mean[i])
    e = noise_learning.normalised_innovations(seen.y[i, pairs.box], seen.S[i, pairs.box], size, c)
    whole = ~scan.edges[pairs.box].any(axis=(1, 2))
    sure = whole & (tracks.evidence.detections[i] > c.noise_hits) & (tracks.real[i] > c.report)
    if sure.any():
        share = noise_learning.share_of_scan(int(sure.sum()), clock.period_s, c)
        k, known = scan.sensor, i[sure]
        log_variance, square = float(state.log_side_variance[k]), float(state.mean_spread[k])
        if scan.spread is not None:
            found = scan.boxes[pairs.box[sure]]
            ratio = box_spread.scale(found[:, 2:] - found[:, :2]) / box_spread.scale(size[sure])
            given = scan.spread[pairs.box[sure]] * (ratio**2)[..., None]
            log_variance, square = box_spread.learn_mean_square(log_variance, square, given, share, c)
        state.log_side_variance[k] = noise_learning.learn_measurement_noise(log_variance, e[sure], share, c)
        state.mean_spread[k] = square
        before = tracks.innovation[known], tracks.has_innovation[known]
        state.process_noise = noise_learning.learn_process_noise(
            state.process_noise, e[sure], *before, share, c
        )
    innovation, has_innovation = tracks.innovation.copy(), tracks.has_innovation.copy()
    innovation[i[whole]], has_innovation[i] = e[whole], whole
    state.tracks = replace(tracks, innovation=innovation, has_innovation=has_innovation)


def update(state: ReferenceState, pairs: AssociatedPairs, c: ModelConstants) -> ReferenceTracks:
    """Update the states of tracks by their boxes: heavy tails, and sides that are cut, have less weight.

    Returns the tracks before it, as the smoother has them: a side that shows again is part of the prediction,
    because the states before did not know of it.
    """
    tracks, i, seen = state.tracks, pairs.track, pairs.innovation
    y, S, unmeasured = seen.y[i, pairs.box], seen.S[i, pairs.box], seen.unmeasured[i, pairs.box]
    R = box_sides.measured_variance(
        y, S, seen.side_variance[i, pairs.box], singer.expected_size(tracks.mean[i]), unmeasured, c
    )
    mean, covariance = tracks.mean.copy(), tracks.covariance.copy()
    m, P, y = box_sides.uncover(mean[i], covariance[i], y, S, unmeasured, c)
    H = box_sides.measurement_matrix(singer.expected_size(m))
    mean[i], covariance[i] = m, P
    before = replace(tracks, mean=mean.copy(), covariance=covariance.copy())
    mean[i], covariance[i] = box_sides.update(m, P, y, H, R)
    state.tracks = replace(tracks, mean=mean, covariance=covariance)
    return before


def await_more(state: ReferenceState, scan: SensorScan, pairs: AssociatedPairs) -> None:
    """Write down of tracks whose boxes are given whether more are to come."""
    if scan.awaited is not None:
        awaited = state.tracks.awaited.copy()
        awaited[pairs.track] = scan.awaited[pairs.box]
        state.tracks = replace(state.tracks, awaited=awaited)


def count_hits_and_misses(
    state: ReferenceState, scan: SensorScan, pairs: AssociatedPairs, clock: ScanClock, c: ModelConstants
) -> None:
    """Write down what the sensor found and what it did not: evidence, the track's own P_D, presence."""
    tracks, k, hit = state.tracks, scan.sensor, pairs.track
    missed = np.setdiff1d(np.arange(len(tracks)), hit)
    stationary = is_stationary(tracks.mean, c)
    # What stands may be missed because the sensor does not see it then.
    p_detect = pairs.p_detect * np.where(stationary, 1.0 - state.sensors.stationary_unseen[k], 1.0)
    presence = tracks.presence.copy()
    visible = presence[missed, VISIBLE]
    presence[hit] = visibility.seen(len(hit))
    presence[missed] = visibility.miss(presence[missed], p_detect[missed])
    logits = scan.logits[pairs.box]
    found = evidence.Hits(hit, logits, pairs.ratio, stationary[hit], pairs.confirms)
    expected = evidence.expect_hits(tracks.evidence, pairs.p_detect, tracks.sees[:, k], clock, c)
    counted = evidence.count_hits(expected, found, k, clock, c)
    counted = evidence.count_misses(counted, missed, k, visible, stationary[missed], clock.weight)
    keep = math.exp(-clock.weight * c.correlation_time_s / c.track_p_detect_memory_s)
    recent_hits, recent_misses, used = (
        tracks.recent_hits.copy(),
        tracks.recent_misses.copy(),
        tracks.used.copy(),
    )
    recent_hits[:, k] *= keep
    recent_misses[:, k] *= keep
    recent_hits[hit, k] += clock.weight
    recent_misses[missed, k] += clock.weight * visible
    used[hit] |= np.int64(1) << k
    state.tracks = replace(
        tracks,
        presence=presence,
        evidence=counted,
        recent_hits=recent_hits,
        recent_misses=recent_misses,
        used=used,
    )


def count_clutter(
    state: ReferenceState, scan: SensorScan, pairs: AssociatedPairs, c: ModelConstants
) -> IntArray:
    """Return the boxes (F,) that no track took, and keep their mean number."""
    free = np.setdiff1d(np.arange(len(scan.boxes)), pairs.box)
    mean = c.clutter_memory * state.leftovers[scan.sensor] + (1.0 - c.clutter_memory) * len(free)
    state.leftovers[scan.sensor] = mean
    return free


def assigned_tracks(state: ReferenceState, pairs: AssociatedPairs, free: IntArray) -> IntArray:
    """Return the identity of the track (M,) that each box of a scan went to; births are the last tracks."""
    ids = state.tracks.track_id
    out = np.zeros(len(pairs.box) + len(free), dtype=np.int64)
    out[pairs.box], out[free] = ids[pairs.track], ids[len(ids) - len(free) :]
    return out


def record(before: ReferenceTracks, after: ReferenceTracks, F: FloatArray, sensor: IntArray) -> FilterRecord:
    """Return what the smoother needs of an update; of a track that begins, no prediction is ever asked."""
    n = len(before)
    born = np.broadcast_to(np.eye(singer.STATES), (len(after) - n, 1, singer.STATES, singer.STATES))
    F = np.concatenate([F, born])
    mean = np.concatenate([before.mean, after.mean[n:]])
    covariance = np.concatenate([before.covariance, after.covariance[n:]])
    return FilterRecord(after.track_id, F, mean, covariance, after.mean, after.covariance, sensor)
