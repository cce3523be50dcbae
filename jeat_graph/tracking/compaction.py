"""Room for tracks, more room, and removal of ended ones, in the arrays that hold the state of all."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import IntArray
from jeat_graph.tracking.state import TrackArrays


def allocate(
    capacity: int, num_sensors: int, num_errors: int = 0, densities: int = 0, size_densities: int = 0
) -> TrackArrays:
    """Allocate zeroed arrays for `capacity` tracks, S sensors, B error states, K and J densities."""
    dim = 3 + num_errors
    return TrackArrays(
        mean=np.zeros((capacity, 2, dim)),
        cov=np.zeros((capacity, 2, dim, dim)),
        size_mean=np.zeros((capacity, 2, 2)),
        size_cov=np.zeros((capacity, 2, 2, 2)),
        cut=np.zeros((capacity, 2), dtype=np.int64),
        rest_point=np.zeros((capacity, 2)),
        rest_var=np.zeros((capacity, 2)),
        rest_since=np.zeros(capacity),
        standing_log_odds=np.zeros(capacity),
        standing=np.zeros(capacity, dtype=np.bool_),
        scale=np.zeros((capacity, num_sensors)),
        p_detect=np.zeros((capacity, num_sensors)),
        hidden=np.zeros((capacity, num_sensors)),
        existence=np.zeros(capacity),
        confirmed=np.zeros(capacity, dtype=np.bool_),
        track_id=np.zeros(capacity, dtype=np.int64),
        hits=np.zeros(capacity, dtype=np.int64),
        t_birth=np.zeros(capacity),
        born_at=np.zeros((capacity, 2)),
        t_update=np.zeros(capacity),
        used=np.zeros(capacity, dtype=np.int64),
        seen_by=np.zeros(capacity, dtype=np.int64),
        witness=np.zeros((capacity, num_sensors)),
        score_odds=np.zeros(capacity),
        jerk_mean=np.zeros((capacity, densities, 2, dim)),
        jerk_cov=np.zeros((capacity, densities, 2, dim, dim)),
        jerk_weight=np.zeros((capacity, densities)),
        jerk_factor=np.ones(capacity),
        size_trial_mean=np.zeros((capacity, size_densities, 2, 2)),
        size_trial_cov=np.zeros((capacity, size_densities, 2, 2, 2)),
        size_weight=np.zeros((capacity, size_densities)),
        size_factor=np.ones(capacity),
        lasting=np.zeros(capacity, dtype=np.bool_),
        last_box=np.full((capacity, num_sensors, 5), -np.inf),
        seen_apart=np.full((capacity, num_sensors), -np.inf),
        worth=np.ones(capacity),
        worthy=np.ones(capacity, dtype=np.bool_),
        fit=np.zeros((capacity, 2)),
        t_missed=np.full(capacity, -np.inf),
    )


def grow(tracks: TrackArrays, num_tracks: int, capacity: int) -> TrackArrays:
    """Return arrays of at least `capacity` rows that hold the first `num_tracks` rows of `tracks`.

    Capacity grows by doubling, so that n births cost O(n) copies in all.
    """
    old = len(tracks.existence)
    if capacity <= old:
        return tracks
    errors, densities = tracks.mean.shape[2] - 3, tracks.jerk_weight.shape[1]
    sizes = tracks.size_weight.shape[1]
    larger = allocate(max(capacity, 2 * old), tracks.scale.shape[1], errors, densities, sizes)
    for source, target in zip(tracks, larger, strict=True):
        target[:num_tracks] = source[:num_tracks]
    return larger


@njit(cache=True)
def keep_rows(tracks: TrackArrays, rows: IntArray) -> None:
    """Move the rows that stay to the front of all arrays, in place.

    One array after the other, so that a step which drops one old track of a thousand does not copy a thousand
    tracks field by field.

    Args:
        tracks: state.
        rows: (K,) rows that stay, ascending.
    """
    first = 0
    while first < len(rows) and rows[first] == first:
        first += 1
    if first == len(rows):
        return
    _shift(tracks.mean, rows, first)
    _shift(tracks.cov, rows, first)
    _shift(tracks.size_mean, rows, first)
    _shift(tracks.size_cov, rows, first)
    _shift(tracks.cut, rows, first)
    _shift(tracks.rest_point, rows, first)
    _shift(tracks.rest_var, rows, first)
    _shift(tracks.rest_since, rows, first)
    _shift(tracks.standing_log_odds, rows, first)
    _shift(tracks.standing, rows, first)
    _shift(tracks.scale, rows, first)
    _shift(tracks.p_detect, rows, first)
    _shift(tracks.hidden, rows, first)
    _shift(tracks.existence, rows, first)
    _shift(tracks.confirmed, rows, first)
    _shift(tracks.track_id, rows, first)
    _shift(tracks.hits, rows, first)
    _shift(tracks.t_birth, rows, first)
    _shift(tracks.born_at, rows, first)
    _shift(tracks.t_missed, rows, first)
    _shift(tracks.t_update, rows, first)
    _shift(tracks.used, rows, first)
    _shift(tracks.seen_by, rows, first)
    _shift(tracks.witness, rows, first)
    _shift(tracks.score_odds, rows, first)
    if tracks.jerk_weight.shape[1]:
        _shift(tracks.jerk_mean, rows, first)
        _shift(tracks.jerk_cov, rows, first)
        _shift(tracks.jerk_weight, rows, first)
        _shift(tracks.jerk_factor, rows, first)
    if tracks.size_weight.shape[1]:
        _shift(tracks.size_trial_mean, rows, first)
        _shift(tracks.size_trial_cov, rows, first)
        _shift(tracks.size_weight, rows, first)
        _shift(tracks.size_factor, rows, first)
    _shift(tracks.lasting, rows, first)
    _shift(tracks.last_box, rows, first)
    _shift(tracks.seen_apart, rows, first)
    _shift(tracks.worth, rows, first)
    _shift(tracks.worthy, rows, first)
    _shift(tracks.fit, rows, first)


@njit(cache=True)
def _shift(array: npt.NDArray[Any], rows: IntArray, first: int) -> None:
    flat = array.reshape(array.shape[0], -1)
    for k in range(first, len(rows)):
        source = rows[k]
        for c in range(flat.shape[1]):
            flat[k, c] = flat[source, c]
