"""The filter, the smoother at any lag, and the smoother of the whole track, all at the same given times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.motion import transition
from jeat_graph.smoothers.filtered_track import FilteredTrack

# Times closer together than this are one (s).
_COINCIDENT_S = 1e-6


@dataclass(frozen=True, eq=False)
class States:
    """Motion of one track at T times.

    Attributes:
        mean: (T, 2, 3) per axis [p, v, a] (px, px/s, px/s²).
        cov: (T, 2, 3, 3) covariances.
    """

    mean: FloatArray
    cov: FloatArray


def states_at(
    track: FilteredTrack, t: FloatArray, lags_s: Sequence[float]
) -> tuple[States, list[States], States]:
    """Estimate a track's states at given times with more and more of the measurements that followed.

    A time between two records is reached from the one before by constant acceleration; its process noise is
    left out, so it should be much shorter than the motion takes to change.

    Args:
        track: the filter's records.
        t: (T,) times (s), not before the track's first.
        lags_s: how much later a measurement may be to be used (s); 0 is the filter.

    Returns:
        The filter's states, those at each lag, and those of the whole track.
    """
    at = last_record(track, t)
    ahead = np.asarray(t) - track.t[at]
    last = np.full(len(at), len(track) - 1, dtype=np.int64)
    lagged = [_moved(track, track.smoothed_until(at, last_record(track, t + lag)), ahead) for lag in lags_s]
    return (
        _moved(track, (track.mean[at], track.covariance[at]), ahead),
        lagged,
        _moved(track, track.smoothed_until(at, last), ahead),
    )


def states_by(track: FilteredTrack, t: FloatArray, smoothed: tuple[FloatArray, FloatArray]) -> States:
    """Return a track's states at given times (T,) from smoothed ones at its records.

    Args:
        track: the filter's records.
        t: (T,) times (s), not before the track's first.
        smoothed: means (K, 2, D) and covariances (K, 2, D, D) at the records.
    """
    at = last_record(track, t)
    return _moved(track, (smoothed[0][at], smoothed[1][at]), np.asarray(t) - track.t[at])


def last_record(track: FilteredTrack, t: FloatArray) -> IntArray:
    """Return the last record (T,) of a track that is not after each time (s)."""
    return np.asarray(np.searchsorted(track.t, np.asarray(t) + _COINCIDENT_S, side="right") - 1)


def _moved(track: FilteredTrack, states: tuple[FloatArray, FloatArray], ahead: FloatArray) -> States:
    """Move states (T, 2, D) ahead by some time (T,), and leave all but the motion out."""
    mean, cov = track.motion(states[0]), track.motion_covariance(*states)
    F = np.stack([transition(float(dt)) for dt in ahead])[:, None] if len(ahead) else np.zeros((0, 1, 3, 3))
    return States((F @ mean[..., None])[..., 0], F @ cov @ np.swapaxes(F, -1, -2))
