"""The filter, the smoother at any lag, and the smoother of the whole track, all at the same given times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.backward import smooth_until
from jeat_graph.smoothers.passes import Filtered
from jeat_graph.smoothers.rts import observations, run_filter, smooth_rts, steps
from jeat_graph.smoothers.track_data import COINCIDENT_S, MOTION, TrackData


@dataclass(frozen=True, eq=False)
class States:
    """Motion of one track at T times, without the error states of its sensors.

    Attributes:
        mean: (T, 2, 3) per axis [p, v, a] (px, px/s, px/s²).
        cov: (T, 2, 3, 3) covariances.
    """

    mean: FloatArray
    cov: FloatArray


@dataclass(frozen=True, eq=False)
class Innovations:
    """What the measurements of one track said that its filter had not expected.

    Attributes:
        t: (M,) times (s); of coincident measurements the later ones are judged given the earlier.
        error: (M, 2) innovation (px).
        var: (M, 2) its variance S (px²).
    """

    t: FloatArray
    error: FloatArray
    var: FloatArray

    def normalised(self) -> FloatArray:
        """Innovations in units of their standard deviations (M, 2)."""
        return np.asarray(self.error / np.sqrt(self.var))

    def nis(self) -> FloatArray:
        """Normalised innovation squared (M,), χ² with two degrees of freedom if the filter is consistent."""
        return np.asarray((self.error**2 / self.var).sum(axis=1))


def with_times(track: TrackData, t: FloatArray) -> tuple[TrackData, IntArray]:
    """Give a track keys at further times, without measurements, which changes no estimate.

    White-jerk motion over an interval is the same whether it is made in one step or in two.

    Args:
        track: the data.
        t: (T,) times (s), not before the track's first.

    Returns:
        The data with more keys, and (T,) the key of each time.
    """
    times = np.asarray(t, dtype=np.float64)
    near = np.clip(np.searchsorted(track.t, times), 1, max(len(track) - 1, 1))
    near = np.minimum(near, len(track) - 1)
    near -= np.abs(times - track.t[near - 1]) < np.abs(times - track.t[near])
    here = np.abs(track.t[near] - times) <= COINCIDENT_S
    more = np.setdiff1d(times[~here], track.t)
    more = more[np.diff(more, prepend=-np.inf) > COINCIDENT_S]
    keys = np.sort(np.concatenate([track.t, more]))
    # An interval that is cut keeps its jerk on both sides; beyond the end the last one holds.
    jerk = track.jerk[np.minimum(np.searchsorted(track.t, keys), len(track) - 1)]
    jerk = np.where(jerk > 0.0, jerk, 1.0)
    old_to_new = np.searchsorted(keys, track.t)
    longer = replace(track, t=keys, jerk=jerk, key=old_to_new[track.key])
    at = np.searchsorted(keys, times - COINCIDENT_S)
    at = np.where(here, old_to_new[near], np.minimum(at, len(keys) - 1))
    return longer, at.astype(np.int64)


def states_at(
    track: TrackData, t: FloatArray, lags_s: Sequence[float]
) -> tuple[States, list[States], States, Innovations]:
    """Estimate a track's states at given times with more and more of the measurements that followed.

    Args:
        track: the data.
        t: (T,) times (s), not before the track's first.
        lags_s: how much later a measurement may be to be used (s); 0 is the filter.

    Returns:
        The filter's states, those at each lag, those of the whole track, and the filter's innovations.
    """
    longer, at = with_times(track, t)
    filtered, whole = run_filter(longer), smooth_rts(longer)
    lagged = []
    for lag in lags_s:
        until = np.searchsorted(longer.t, longer.t[at] + lag + COINCIDENT_S, side="right") - 1
        lagged.append(_motion(*_smoothed_until(longer, filtered, at, until)))
    return (
        _motion(filtered.mean[at], filtered.cov[at]),
        lagged,
        _motion(whole.mean[at], whole.cov[at]),
        _innovations(longer, filtered),
    )


def _motion(mean: FloatArray, cov: FloatArray) -> States:
    """Leave the error states (T, 2, 3 + B), (T, 2, 3 + B, 3 + B) out."""
    return States(mean[:, :, :MOTION], cov[:, :, :MOTION, :MOTION])


def _smoothed_until(
    track: TrackData, filtered: Filtered, at: IntArray, until: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Smooth the states `at` (T,) with all up to the keys `until` (T,)."""
    return smooth_until((0,) * track.size, steps(track), observations(track), filtered, at, until)


def _innovations(track: TrackData, filtered: Filtered) -> Innovations:
    """Innovations of all measurements after the prior's own time."""
    later = track.key > 0
    return Innovations(track.t[track.key[later]], filtered.innovation[later], filtered.variance[later])
