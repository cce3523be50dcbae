"""The factor graph of tracks, for whoever wants to see it, add to it and solve it: GTSAM's own objects.

Each measurement time of a track is a key, x0, x1, … of track 0, x1000000, … of track 1. Its value is a vector
of both axes' blocks [p, τ v, τ² a, e_1, …], one after the other: the place (px), velocity and acceleration in
units of τ = `TAU_S`, and the error states of the sensors whose errors have memory. Factors are

- a prior on the first state of each track,
- constant acceleration with white jerk, and errors that fade, between neighbouring states,
- measurements: centre = p + (standard deviation of the lasting part) · e + white noise, per detection.

All are linear, so one step of Gauss-Newton solves them; elimination must be by QR, as steps of milliseconds
weigh much more than measurements.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.motion import process_noise, transition
from jeat_graph.smoothers.gtsam.scaling import TAU_S, scale
from jeat_graph.smoothers.track_data import MOTION, TrackData

__all__ = ["TAU_S", "TrackGraph", "track_graph"]

STATE = "x"
#: The states of one track have numbers from `MOST_STATES` · track on.
MOST_STATES = 1_000_000


@dataclass(frozen=True, eq=False)
class TrackGraph:
    """GTSAM's graph and values of tracks.

    Attributes:
        graph: `gtsam.NonlinearFactorGraph`, to be added to.
        values: `gtsam.Values`: where the measurements lie.
        times_s: of each track's states, (K,), by its number.
        size: components of a state per axis, 3 and one for each error state, by track.
    """

    graph: Any
    values: Any
    times_s: Mapping[int, FloatArray]
    size: Mapping[int, int]

    def key(self, track: int, state: int) -> int:
        """Return GTSAM's key of a state.

        Raises:
            KeyError: there is no such state.
        """
        if track not in self.times_s or not 0 <= state < len(self.times_s[track]):
            raise KeyError(f"track {track} has no state {state}")
        return _key(track, state)

    def nearest(self, track: int, t: float) -> int:
        """Return the key of the state of a track that is nearest to a time (s)."""
        return self.key(track, int(np.abs(self.times_s[track] - t).argmin()))

    def name(self, key: int) -> str:
        """Say what a key is: track, number and time of the state."""
        import gtsam

        track, state = divmod(gtsam.Symbol(key).index(), MOST_STATES)
        return f"track {track}, state {state}, t = {self.times_s[track][state]:.3f} s"

    def solve(self) -> Any:
        """Return the `gtsam.Values` that fit best, by Gauss-Newton and QR.

        Raises:
            RuntimeError: GTSAM's, if the system is indeterminate.
        """
        import gtsam

        params = gtsam.GaussNewtonParams()
        params.setLinearSolverType("MULTIFRONTAL_QR")
        return gtsam.GaussNewtonOptimizer(self.graph, self.values, params).optimize()

    def motion(self, values: Any, track: int) -> FloatArray:
        """Return a track's motion (K, 2, 3) in some values: place, velocity, acceleration per axis."""
        n = self.size[track]
        states = np.stack([values.atVector(_key(track, k)) for k in range(len(self.times_s[track]))])
        return np.asarray(states.reshape(-1, 2, n)[:, :, :MOTION] / scale(n)[:MOTION])


def track_graph(tracks: Mapping[int, TrackData]) -> TrackGraph:
    """Build the graph of tracks.

    Args:
        tracks: data by number of the track.
    """
    import gtsam

    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for number, track in tracks.items():
        _add(graph, values, number, track)
    return TrackGraph(
        graph,
        values,
        {number: track.t for number, track in tracks.items()},
        {number: track.size for number, track in tracks.items()},
    )


def _key(track: int, state: int) -> int:
    import gtsam

    return int(gtsam.symbol(STATE, MOST_STATES * track + state))


def _add(graph: Any, values: Any, number: int, track: TrackData) -> None:
    import gtsam

    n, D = track.size, scale(track.size)
    keys = [_key(number, k) for k in range(len(track))]
    linear = gtsam.GaussianFactorGraph()
    W = [np.linalg.inv(np.linalg.cholesky(cov * (D[:, None] * D))) for cov in track.prior_cov]
    mean = track.prior_mean * D
    linear.add(
        keys[0], _both(*W), np.concatenate([w @ m for w, m in zip(W, mean, strict=True)]), _unit(2 * n)
    )
    for k in range(1, len(track)):
        A0, A1 = _step(float(track.t[k] - track.t[k - 1]), float(track.jerk[k]), track.correlation_time, D)
        linear.add(keys[k - 1], _both(A0, A0), keys[k], _both(A1, A1), np.zeros(2 * n), _unit(2 * n))
    for row, k in enumerate(track.key.tolist()):
        A, b = np.zeros((2, 2 * n)), np.zeros(2)
        for axis in range(2):
            std = float(np.sqrt(track.r[row, axis]))
            A[axis, axis * n] = 1.0 / std
            if track.error[row] >= 0:
                A[axis, axis * n + MOTION + int(track.error[row])] = track.coloured_std[row, axis] / std
            b[axis] = track.z[row, axis] / std
        linear.add(keys[k], A, b, _unit(2))
    for k, key in enumerate(keys):
        start = np.zeros((2, n))
        seen = np.flatnonzero(track.key == k)
        start[:, 0] = track.z[seen].mean(axis=0) if len(seen) else track.prior_mean[:, 0]
        values.insert(key, start.ravel())
    zeros = gtsam.Values()
    for key in keys:
        zeros.insert(key, np.zeros(2 * n))
    # Without the point of linearisation the result is silently wrong.
    graph.push_back(gtsam.LinearContainerFactor.ConvertLinearGraph(linear, zeros))


def _step(dt: float, jerk: float, memory_s: FloatArray, D: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Whitened rows of one axis, −W F on the state before and W on the one after, scaled."""
    n = MOTION + len(memory_s)
    F, Q = np.zeros((n, n)), np.zeros((n, n))
    F[:MOTION, :MOTION], Q[:MOTION, :MOTION] = transition(dt), process_noise(dt, jerk)
    kept = np.exp(-dt / memory_s)
    rest = np.arange(MOTION, n)
    F[rest, rest], Q[rest, rest] = kept, -np.expm1(-2.0 * dt / memory_s)
    W = np.linalg.inv(np.linalg.cholesky(Q * (D[:, None] * D)))
    return -W @ (D[:, None] * F / D), W


def _both(x: FloatArray, y: FloatArray) -> FloatArray:
    n = len(x)
    out = np.zeros((2 * n, 2 * n))
    out[:n, :n], out[n:, n:] = x, y
    return out


def _unit(rows: int) -> Any:
    import gtsam

    return gtsam.noiseModel.Unit.Create(rows)
