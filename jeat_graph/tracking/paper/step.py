"""One step of algorithm 1: predict → associate → update → second views → end → begin."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jeat_graph.config.paper import PaperConfig
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.smoothers.state_rts import FilterRecord
from jeat_graph.tracking.engine import LONGEST_SILENCE_S
from jeat_graph.tracking.paper.association import gated_pairs, match, second_views
from jeat_graph.tracking.paper.kalman import born, predict, transition, update
from jeat_graph.tracking.paper.state import Found, PaperTracks, together


class Stepped(NamedTuple):
    """The tracks after a step, and how the filter went through it.

    Attributes:
        every: N tracks, those that end included; those born in the step are the last ones.
        births: how many of them.
        kept: (N,) which live on.
        assigned: (M,) identity of the track that each detection went to.
        records: for the smoother, one for each round of updates.
    """

    every: PaperTracks
    births: int
    kept: BoolArray
    assigned: IntArray
    records: list[FilterRecord]


def step(
    tracks: PaperTracks, t: float, dt: float, found: Found, first_id: int, config: PaperConfig
) -> Stepped:
    """Advance all tracks to the time of some detections and take these in (paper algorithm 1).

    Args:
        tracks: state before it.
        t: time of the detections (s).
        dt: time since the step before (s), >= 0.
        found: the detections of all sensors.
        first_id: identity of the first track that is born.
        config: settings.
    """
    if dt >= LONGEST_SILENCE_S:
        tracks = tracks.take(np.zeros(0, dtype=np.int64))
    tracks = predict(tracks, dt, config)
    assigned = np.zeros(len(found), dtype=np.int64)
    rounds = [_Round(tracks, tracks, np.full(len(tracks), -1))]

    def take(row: IntArray, detection: IntArray) -> PaperTracks:
        assigned[detection] = tracks.track_id[row]
        sensor = np.full(len(tracks), -1)
        sensor[row] = found.sensor[detection]
        after = update(tracks, row, found, detection, t, config)
        if len(rounds) == 1 and (rounds[0].sensor < 0).all():
            rounds.clear()
        rounds.append(_Round(tracks, after, sensor))
        return after

    if len(tracks) and len(found):
        row, detection = match(gated_pairs(tracks, found, config.gate), config.gate)
        first = np.full(len(tracks), -1)
        first[row] = found.sensor[detection]
        tracks = take(row, detection)
        for sensor in np.unique(found.sensor[assigned == 0]):
            pairs = gated_pairs(tracks, found, config.gate)
            free = (assigned[pairs.detection] == 0) & (found.sensor[pairs.detection] == sensor)
            other = (first[pairs.row] >= 0) & (first[pairs.row] != sensor)
            again = second_views(pairs.take(free & other))
            if len(again[0]):
                tracks = take(*again)
    tracks = confirm(tracks, t, config)
    alive = lives(tracks, t, config)
    left = np.flatnonzero(assigned == 0)
    # Numbered by sensor, whichever scan of this time came first.
    left = left[np.argsort(found.place[left], kind="stable")]
    new = confirm(born(found, left, t, first_id, tracks.scale.shape[1], config), t, config)
    assigned[left] = new.track_id
    kept = np.concatenate([np.isin(np.arange(len(tracks)), alive), np.ones(len(left), dtype=np.bool_)])
    every = tracks.join(new)
    F = transition(dt)
    records = [_record(one, F if k == 0 else np.eye(len(F))) for k, one in enumerate(rounds)]
    records[-1] = _with_births(records[-1], new, found.sensor[left])
    return Stepped(every, len(left), kept, assigned, records)


class _Round(NamedTuple):
    """One round of updates: tracks before and after it, and the sensors (N,) whose boxes they took, or −1."""

    before: PaperTracks
    after: PaperTracks
    sensor: IntArray


def _record(one: _Round, F: FloatArray) -> FilterRecord:
    """Return what the smoother needs of a round."""
    n = len(one.before)
    F = np.broadcast_to(F, (n, 1, *F.shape))
    return FilterRecord(one.before.track_id, F, *together(one.before), *together(one.after), one.sensor)


def _with_births(record: FilterRecord, new: PaperTracks, sensor: IntArray) -> FilterRecord:
    """Return a record with tracks that begin at boxes; of these no prediction is ever asked."""
    mean, covariance = together(new)
    still = np.broadcast_to(np.eye(mean.shape[2]), (len(new), 1, mean.shape[2], mean.shape[2]))
    more = (new.track_id, still, mean, covariance, mean, covariance, sensor)
    return FilterRecord._make(np.concatenate(pair) for pair in zip(record, more, strict=True))


def confirm(tracks: PaperTracks, t: float, config: PaperConfig) -> PaperTracks:
    """Confirm the tracks that are old enough and have hits enough (paper eq. 7)."""
    earned = (t - tracks.t_birth >= config.confirm_age_s) & (tracks.hits >= config.confirm_hits)
    return replace(tracks, confirmed=tracks.confirmed | earned)


def lives(tracks: PaperTracks, t: float, config: PaperConfig) -> IntArray:
    """Return the rows of the tracks that go on: t − t_last_update ≤ τ_max (paper eq. 8).

    A state that overflowed, as of a track that coasts on wild input, is over as well.
    """
    most = np.where(tracks.confirmed, config.max_gap_confirmed_s, config.max_gap_tentative_s)
    whole = np.isfinite(tracks.mean).all(axis=(1, 2)) & np.isfinite(tracks.size_mean).all(axis=(1, 2))
    return np.flatnonzero((t - tracks.t_update <= most) & whole)
