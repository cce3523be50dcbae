"""One step of algorithm 1: predict → associate → update → second views → end → begin."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jeat_graph.config.paper import PaperConfig
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.tracking.paper.association import gated_pairs, match, second_views
from jeat_graph.tracking.paper.kalman import born, noise_of, predict, update
from jeat_graph.tracking.paper.state import Found, PaperTracks

#: After so long without any scan all tracks are over: longer predictions outgrow a double's digits (s).
LONGEST_SILENCE_S = 300.0


class Stepped(NamedTuple):
    """The tracks after a step, and what they took in.

    Attributes:
        tracks: N tracks; those born in the step are the last ones.
        births: how many of them.
        taker: (M,) identity of the track that each detection went to.
        z: (N, 2) mean of the centres that the track took in the step, weighed by their information (px).
        information: (N,) of that mean along either axis, 0 where there was none, and at birth (1/px²).
    """

    tracks: PaperTracks
    births: int
    taker: IntArray
    z: FloatArray
    information: FloatArray


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
    taker = np.zeros(len(found), dtype=np.int64)
    weighed, information = np.zeros((len(tracks), 2)), np.zeros(len(tracks))

    def take(row: IntArray, detection: IntArray) -> PaperTracks:
        told = 1.0 / noise_of(tracks, row, found, detection)
        information[row] += told
        weighed[row] += told[:, None] * found.z[detection]
        taker[detection] = tracks.track_id[row]
        return update(tracks, row, found, detection, t, config)

    if len(tracks) and len(found):
        row, detection = match(gated_pairs(tracks, found, config.gate), config.gate)
        first = np.full(len(tracks), -1)
        first[row] = found.sensor[detection]
        tracks = take(row, detection)
        for sensor in np.unique(found.sensor[taker == 0]):
            pairs = gated_pairs(tracks, found, config.gate)
            free = (taker[pairs.detection] == 0) & (found.sensor[pairs.detection] == sensor)
            other = (first[pairs.row] >= 0) & (first[pairs.row] != sensor)
            tracks = take(*second_views(pairs.take(free & other)))
    z = weighed / np.where(information > 0.0, information, 1.0)[:, None]
    tracks = confirm(tracks, t, config)
    alive = lives(tracks, t, config)
    left = np.flatnonzero(taker == 0)
    # Numbered by sensor, whichever scan of this time came first.
    left = left[np.argsort(found.sensor[left], kind="stable")]
    new = confirm(born(found, left, t, first_id, tracks.scale.shape[1], config), t, config)
    taker[left] = new.track_id
    z = np.concatenate([z[alive], found.z[left]])
    information = np.concatenate([information[alive], np.zeros(len(left))])
    return Stepped(tracks.take(alive).join(new), len(left), taker, z, information)


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
