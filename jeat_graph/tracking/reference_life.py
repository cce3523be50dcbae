"""The reference tracker's life of tracks: births, sensors compared, what each is, what it teaches, ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters import box_sides, gap_survival, object_probability, sensor_accuracy, sensor_offsets
from jeat_graph.filters.camera_path import CameraPath
from jeat_graph.filters.evidence import Evidence, ScanClock
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.picture_motion import CameraVelocity, with_velocity
from jeat_graph.filters.singer import LOG_SIZE, VELOCITY
from jeat_graph.filters.visibility import GONE
from jeat_graph.tracking.reference_state import ReferenceState, ReferenceTracks, SensorScan

# Two times that differ by less are one (s).
_SAME_TIME_S = 1e-6
_LEAST_AREA = 1e-9
# Longer ago than this is no longer distinguished (s).
_LONGEST_AGO_S = 1e9


def begin_tracks(
    state: ReferenceState, scan: SensorScan, free: IntArray, clock: ScanClock, c: ModelConstants
) -> None:
    """Begin a track at every box that is left: what it is, the posterior tells."""
    boxes, logits, tracks = scan.boxes[free], scan.logits[free], state.tracks
    overlap = np.zeros(len(free))
    rivals = (tracks.real > c.rival) & (clock.t - tracks.evidence.last_s < c.rival_age_s)
    if rivals.any():
        overlap = box_sides.intersection_over_union(boxes, box_sides.corners(tracks.mean[rivals])).max(axis=1)
    if len(free) > 1:
        among = box_sides.intersection_over_union(boxes, boxes)
        among[logits[None] <= logits[:, None]] = 0.0
        overlap = np.maximum(overlap, among.max(axis=1))
    evidence = Evidence.of_births(clock.t, scan.sensor, state.num_sensors, logits, overlap, clock.weight)
    noise = float(state.log_noise(c)[scan.sensor]), state.log_scene_variance(c)
    ids = np.arange(state.next_id, state.next_id + len(free), dtype=np.int64)
    spread = state.spread_of(scan, scan.boxes[:, 2:] - scan.boxes[:, :2])
    own = None if spread is None else spread[free]
    mean, covariance = box_sides.initial_state(boxes, scan.edges[free], *noise, c, own)
    mean = with_velocity(mean, state.camera_velocity)
    new = ReferenceTracks.begun(ids, mean, covariance, evidence)
    if scan.owners is not None and scan.awaited is not None:
        new = replace(new, given=scan.owners[free], awaited=scan.awaited[free])
    state.tracks, state.next_id = tracks.append(new), state.next_id + len(free)


def compare_sensors(state: ReferenceState, given: SensorScan, assigned: IntArray, c: ModelConstants) -> None:
    """Count what a sensor's boxes differ by from the others' last ones on the same real tracks; keep them."""
    tracks, k = state.tracks, given.sensor
    row = np.searchsorted(tracks.track_id, assigned)
    for other in range(state.num_sensors):
        age = state.time - tracks.last_box_s[row, other]
        before = tracks.last_box[row, other]
        usable = (before[:, 2] > before[:, 0]) & (age <= c.offset_age_s) & (tracks.real[row] > c.report)
        if other != k and usable.any():
            moved = tracks.mean[row[usable], :, VELOCITY] * age[usable, None]
            d = sensor_offsets.differences(given.boxes[usable], before[usable], moved)
            mean = sensor_offsets.mean_difference(state.offsets, k, other, c)
            state.offsets = sensor_offsets.count(state.offsets, k, other, d, c)
            u = sensor_accuracy.aspect_sum(given.boxes[usable], before[usable], c)
            compared = np.column_stack([sensor_accuracy.clipped(d, mean, c), u])
            compare_errors(state, row[usable], k, other, compared, c)
    tracks = state.tracks
    last_box, last_box_s = tracks.last_box.copy(), tracks.last_box_s.copy()
    last_box[row, k], last_box_s[row, k] = given.boxes, state.time
    state.tracks = replace(tracks, last_box=last_box, last_box_s=last_box_s)


def compare_errors(
    state: ReferenceState, row: IntArray, k: int, other: int, compared: FloatArray, c: ModelConstants
) -> None:
    """Count what lasts of how two sensors compare on tracks (K, 5); keep it where the last is old."""
    tracks = state.tracks
    age = np.where(tracks.has_apart[row, k, other], state.time - tracks.apart_s[row, k, other], np.inf)
    old = age >= c.lasting_after_s
    pairs = old & (age <= c.lasting_within_s)
    before = tracks.apart[row[pairs], k, other]
    state.accuracy = sensor_accuracy.count(state.accuracy, k, other, compared[pairs], before)
    apart, apart_s, has_apart = tracks.apart.copy(), tracks.apart_s.copy(), tracks.has_apart.copy()
    apart[row[old], k, other], apart_s[row[old], k, other], has_apart[row[old], k, other] = (
        compared[old],
        state.time,
        True,
    )
    state.tracks = replace(tracks, apart=apart, apart_s=apart_s, has_apart=has_apart)


def compare_overlaps(state: ReferenceState) -> None:
    """Keep of each track that was found now the least overlap ever with a better one."""
    tracks, evidence = state.tracks, state.tracks.evidence
    boxes = box_sides.corners(tracks.mean)
    better = tracks.log_odds[None] > tracks.log_odds[:, None]
    better &= evidence.detections[None] >= evidence.detections[:, None]
    overlap = np.where(better, box_sides.intersection_over_union(boxes, boxes), 0.0).max(axis=1, initial=0.0)
    least = np.where(
        unseen_for(state) < _SAME_TIME_S, np.minimum(evidence.overlap, overlap), evidence.overlap
    )
    state.tracks = replace(tracks, evidence=replace(evidence, overlap=least))


def is_stationary(mean: FloatArray, c: ModelConstants) -> BoolArray:
    """Return which objects (N,) of states (N, 2, 7) stand, as far as is known."""
    speed2 = (mean[:, :, VELOCITY] ** 2).sum(axis=1)
    area = np.exp(mean[:, :, LOG_SIZE].sum(axis=1))
    return np.asarray(speed2 < c.stationary_speed**2 * area)


def judge(state: ReferenceState, c: ModelConstants) -> None:
    """Compute the posterior of every track."""
    belief = object_probability.posterior(state.tracks.evidence, state.sensors, c)
    stationary = is_stationary(state.tracks.mean, c)[:, None]
    sees = (1.0 - belief.unseen) * np.where(stationary, 1.0 - belief.stationary_unseen, 1.0)
    state.tracks = replace(state.tracks, real=belief.real, log_odds=belief.log_odds, sees=sees)


def count_false_boxes(state: ReferenceState, sensor: int, assigned: IntArray, c: ModelConstants) -> None:
    """Keep the mean number of a sensor's boxes a scan that are of nothing real, by their tracks (M,)."""
    real = state.tracks.real[np.searchsorted(state.tracks.track_id, assigned)]
    mean = c.clutter_memory * state.false_boxes[sensor] + (1.0 - c.clutter_memory) * (1.0 - real).sum()
    state.false_boxes[sensor] = mean


def learn(state: ReferenceState, t: float, c: ModelConstants) -> None:
    """Learn what the sensors are worth from tracks that live and from those that ended."""
    if t - state.learnt_s >= c.learn_period_s:
        state.learnt_s = t
        p_detect = state.sensors.p_detect
        sums, given = state.accuracy, state.given_lasting
        lasting = sensor_accuracy.solve(sums, state.log_side_variance, p_detect, given, c)
        state.accuracy = sums._replace(lasting=lasting)
        evidence = state.ended.append(state.tracks.evidence)
        state.sensors = object_probability.learn_sensors(evidence, state.sensors, c)


def report(state: ReferenceState, c: ModelConstants) -> BoolArray:
    """Return which tracks (N,) are reported: real, and their gap, if any, likely to end well.

    A gap begins with the last detection that confirmed the track, and counts what was to be expected since.
    """
    evidence = state.tracks.evidence
    here = state.time - evidence.confirmed_s < _SAME_TIME_S
    inside = (share_inside(state) > c.inside_share) | here
    alive = state.tracks.real * gap_survival.survival(state.gaps, np.where(here, 0.0, evidence.missed), c)
    return np.asarray((alive > c.report) & inside)


def own_p_detect(tracks: ReferenceTracks, p_detect: FloatArray, c: ModelConstants) -> FloatArray:
    """Return each track's own P_D (N, S) by each sensor, whose means are `p_detect` (S,)."""
    hits, scans = tracks.recent_hits, tracks.recent_hits + tracks.recent_misses
    own = (p_detect * c.p_detect_strength + hits) / (c.p_detect_strength + scans)
    return np.asarray(np.clip(own, *c.track_p_detect_bounds))


def end_tracks(state: ReferenceState, t: float, c: ModelConstants) -> None:
    """End the tracks that are false, gone, outside, or unseen for too long; their evidence stays."""
    gap, real = unseen_for(state), state.tracks.real
    ends = (gap > c.longest_gap_s) | ((real < c.report) & (gap > c.doubtful_gap_s))
    ends |= (real < c.false_posterior) & (gap > c.false_gap_s)
    ends |= 1.0 - state.tracks.presence[:, GONE] < c.least_presence
    ends |= (share_inside(state) < c.outside_share) & (gap > c.outside_gap_s)
    ends &= ~state.tracks.awaited
    if ends.any():
        state.gaps = gap_survival.count_losses(state.gaps, int((real[ends] > c.report).sum()))
        ended = state.ended.append(state.tracks.evidence.take(ends))
        state.ended = ended.take(slice(-c.remembered_tracks, None))
        state.tracks = state.tracks.take(~ends)


def reset(state: ReferenceState, t: float, c: ModelConstants) -> None:
    """End all tracks and go on from another time (s), as if none had passed; what was learnt stays."""
    ended = state.ended.append(state.tracks.evidence)
    state.ended = ended.take(slice(-c.remembered_tracks, None))
    state.tracks = state.tracks.take(slice(0, 0))
    now = state.reset_s if state.t is None else state.t
    if now is None:
        return
    # A sensor has not looked again since: not for less than the time between two of its scans.
    period = np.where(np.isnan(state.period_s), c.first_period_s, state.period_s)
    state.last_scan_s = t - np.clip(now - state.last_scan_s, period, _LONGEST_AGO_S)
    state.learnt_s = t - min(max(now - state.learnt_s, 0.0), _LONGEST_AGO_S)
    state.camera_velocity = CameraVelocity.none()
    state.camera_path = CameraPath.none()
    state.t, state.reset_s = None, t


def unseen_for(state: ReferenceState) -> FloatArray:
    """Return for how long (N,) no sensor has found each track (s)."""
    return np.asarray(state.time - state.tracks.evidence.last_s)


def share_inside(state: ReferenceState) -> FloatArray:
    """Return the share (N,) of each predicted box that lies within the picture."""
    boxes = box_sides.corners(state.tracks.mean)
    common = np.minimum(boxes[:, 2:], state.picture) - np.maximum(boxes[:, :2], 0.0)
    area = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    return np.asarray(np.clip(common, 0.0, None).prod(axis=1) / np.maximum(area, _LEAST_AREA))
