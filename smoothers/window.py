"""Our own arrays of a fixed-lag window: filtered states and measurements, from which all can be rebuilt.

A window is a sequence of *rows* in order of time. Most rows are keys, states that the smoother
estimates; a row that is none is a measurement that came late, between two keys. What lies before the
window is summed up in its *base*, the filtered state at the first row.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.smoothers.measurements import COINCIDENT_S, Measurements
from jeat_graph.smoothers.passes import backward, forward

_ROWS = ("t", "q", "is_key", "anchor", "mean", "cov", "reference")
_TAKEN = ("row", "z", "info", "lever", "error", "gain", "innovation", "variance")


class Window:
    """Rows of one track's window.

    Args:
        t: time of the prior (s), the first key.
        mean: (2, n) prior mean per axis (px, px/s, px/s², 1).
        cov: (2, n, n) prior covariance.
        memory: (n - 3,) memory of the error states (s).

    Attributes:
        base_mean: (2, n) state at the first row given all before it, and given the row's own measurements
            only once they are no longer kept.
        base_cov: (2, n, n) its covariance.
        memory: (n - 3,) memory of the error states (s).
        t: (N,) times (s).
        q: (N,) root spectral density of the jerk over the interval that ends at the row (px/s^2.5).
        is_key: (N,) whether the row is a key; the first and the last row always are.
        anchor: (N,) number of the row's state inside GTSAM, or -1.
        mean: (N, 2, n) filtered means.
        cov: (N, 2, n, n) filtered covariances.
        reference: (N, 2, n) filtered means as they were when the row came: unlike `mean`, no late
            measurement changes them.
        row: (M,) row of each measurement, ascending.
        z: (M, 2) measurements (px).
        info: (M, 2) information of their white parts (1/px²).
        lever: (M, 2) factor of their error states (px).
        error: (M,) index of these, or -1.
        gain: (M, 2, n), innovation: (M, 2) and variance: (M, 2): what the filter made of them.
    """

    def __init__(self, t: float, mean: FloatArray, cov: FloatArray, memory: FloatArray) -> None:
        size = mean.shape[1]
        self.base_mean, self.base_cov, self.memory = mean, cov, memory
        self.t = np.array([t])
        self.q = np.zeros(1)
        self.is_key = np.ones(1, dtype=np.bool_)
        self.anchor = np.full(1, -1, dtype=np.int64)
        self.mean, self.cov = mean[None].copy(), cov[None].copy()
        self.reference = self.mean
        self.row, self.error = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        self.z, self.info, self.lever = np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2))
        self.gain, self.innovation, self.variance = np.zeros((0, 2, size)), np.zeros((0, 2)), np.zeros((0, 2))

    @property
    def size(self) -> int:
        """Components of a state per axis, n."""
        return int(self.base_mean.shape[1])

    def key_rows(self) -> IntArray:
        """Return the rows that are keys (K,)."""
        return np.flatnonzero(self.is_key)

    def append(self, t: FloatArray, key: IntArray, taken: Measurements) -> None:
        """Append keys, all later than the last row, and filter them.

        Args:
            t: (J,) times of the keys (s), ascending.
            key: (M,) key of each measurement, counted from 0, ascending.
            taken: the measurements.
        """
        old, seen, new = len(self.t), len(self.row), len(t)
        first = np.searchsorted(key, np.arange(new))
        self.t = np.concatenate([self.t, t])
        self.q = np.concatenate([self.q, taken.q[first]])
        self.is_key = np.concatenate([self.is_key, np.ones(new, dtype=np.bool_)])
        self.anchor = np.concatenate([self.anchor, np.full(new, -1, dtype=np.int64)])
        self.row = np.concatenate([self.row, key + old])
        self.z = np.concatenate([self.z, taken.z])
        self.info = np.concatenate([self.info, 1.0 / taken.r])
        self.lever = np.concatenate([self.lever, taken.lever])
        self.error = np.concatenate([self.error, taken.error])
        self._filter_after(old - 1, seen)
        self.reference = np.concatenate([self.reference, self.mean[old:]])

    def insert(self, t: float, z: FloatArray, r: FloatArray, lever: FloatArray, error: int) -> int:
        """Take in a measurement that came late: into a row at its time, or into one of its own.

        Args:
            t: time (s), not before the first row and not after the last.
            z: (2,) measured centre (px).
            r: (2,) variance of its white part (px²).
            lever: (2,) factor of its error state (px).
            error: index of that, or -1.

        Returns:
            The row that holds it now.
        """
        row = int(np.argmin(np.abs(self.t - t)))
        # At large times a microsecond is a few roundings: what lies outside the rows belongs to the nearest.
        if abs(self.t[row] - t) > COINCIDENT_S and self.t[0] < t < self.t[-1]:
            row = int(np.searchsorted(self.t, t))
            self.t = np.insert(self.t, row, t)
            self.q = np.insert(self.q, row, self.q[row])
            self.is_key = np.insert(self.is_key, row, False)
            self.anchor = np.insert(self.anchor, row, -1)
            self.reference = np.insert(self.reference, row, np.nan, axis=0)
            self.mean = np.insert(self.mean, row, 0.0, axis=0)
            self.cov = np.insert(self.cov, row, 0.0, axis=0)
            self.row = np.where(self.row >= row, self.row + 1, self.row)
        place = int(np.searchsorted(self.row, row, side="right"))
        self.row = np.insert(self.row, place, row)
        self.z = np.insert(self.z, place, z, axis=0)
        self.info = np.insert(self.info, place, 1.0 / r, axis=0)
        self.lever = np.insert(self.lever, place, lever, axis=0)
        self.error = np.insert(self.error, place, error)
        first = int(np.searchsorted(self.row, row))
        self._filter_after(row - 1, first)
        if np.isnan(self.reference[row, 0, 0]):
            self.reference[row] = self.mean[row]
        return row

    def drop_before(self, row: int) -> None:
        """Forget the rows before a key; its filtered state becomes the base."""
        self.base_mean, self.base_cov = self.mean[row].copy(), self.cov[row].copy()
        first = int(np.searchsorted(self.row, row, side="right"))
        for name in _ROWS:
            setattr(self, name, getattr(self, name)[row:].copy())
        for name in _TAKEN:
            setattr(self, name, getattr(self, name)[first:].copy())
        self.row -= row

    def smooth(self, wanted: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Smooth the first rows, given all measurements of the window.

        Returns:
            (wanted, 2, n) means, (wanted, 2, n, n) covariances, and (wanted, 2, n, n) gains to the next row.
        """
        mean, cov, gain = backward(
            (0,) * self.size,
            self.steps(),
            self.q,
            self.memory,
            self.row,
            self.lever,
            self.error,
            np.array([0, len(self.t)]),
            np.array([wanted]),
            self.mean,
            self.cov,
            self.gain,
            self.innovation,
            self.variance,
        )
        return mean[:wanted], cov[:wanted], gain[:wanted]

    def steps(self) -> FloatArray:
        """Return the steps between the rows (N,) (s), 0 for the first."""
        return np.diff(self.t, prepend=self.t[0])

    def _filter_after(self, row: int, seen: int) -> None:
        """Filter all after the state at `row`, which is that of `seen` measurements; row -1 is the base."""
        first = max(row, 0)
        prior = (self.base_mean, self.base_cov) if row < 0 else (self.mean[row], self.cov[row])
        taken = slice(seen, None)
        mean, cov, *of_measurements = forward(
            (0,) * self.size,
            np.diff(self.t[first:], prepend=self.t[first]),
            self.q[first:],
            self.memory,
            self.row[taken] - first,
            self.z[taken],
            self.info[taken],
            self.lever[taken],
            self.error[taken],
            np.array([0, len(self.t) - first]),
            prior[0][None],
            prior[1][None],
        )
        self.mean = np.concatenate([self.mean[:first], mean])
        self.cov = np.concatenate([self.cov[:first], cov])
        for name, new in zip(("gain", "innovation", "variance"), of_measurements, strict=True):
            setattr(self, name, np.concatenate([getattr(self, name)[:seen], new]))
