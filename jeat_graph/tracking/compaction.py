"""Room for more tracks, and removal of ended ones, in the arrays that hold the state of all."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import IntArray
from jeat_graph.tracking.state import TrackArrays, allocate


def grow(tracks: TrackArrays, num_tracks: int, capacity: int) -> TrackArrays:
    """Return arrays of at least `capacity` rows that hold the first `num_tracks` rows of `tracks`.

    Capacity grows by doubling, so that n births cost O(n) copies in all.
    """
    old = len(tracks.existence)
    if capacity <= old:
        return tracks
    errors, densities = tracks.mean.shape[2] - 3, tracks.jerk_weight.shape[1]
    larger = allocate(max(capacity, 2 * old), tracks.scale.shape[1], errors, densities)
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
