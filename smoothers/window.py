"""Our own arrays of a fixed-lag window: filtered states and measurements, from which all can be rebuilt.

A window is a sequence of *rows* in order of time. Most rows are keys, states that the smoother
estimates; a row that is none is a measurement that came late, between two keys. What lies before the
window is summed up in its *base*, the filtered state at the first row.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.smoothers.rts import backward, forward, motion_matrices
from jeat_graph.smoothers.track_data import COINCIDENT_S


class Window:
    """Rows of one track's window.

    Args:
        t: time of the prior (s), the first key.
        mean: (2, 3) prior mean per axis (px, px/s, px/s²).
        cov: (2, 3, 3) prior covariance.

    Attributes:
        base_mean: (2, 3) state at the first row given all before it, the row's own `info` not included.
        base_cov: (2, 3, 3) its covariance.
        t: (N,) times (s).
        q: (N,) root spectral density of the jerk over the interval that ends at the row (px/s^2.5).
        z: (N, 2) fused measurements (px).
        info: (N, 2) their information (1/px²), 0 where there is none.
        is_key: (N,) whether the row is a key; the first and the last row always are.
        mean: (N, 2, 3) filtered means.
        cov: (N, 2, 3, 3) filtered covariances.
        reference: (N, 2, 3) filtered means as they were when the row came: unlike `mean`, no late
            measurement changes them.
    """

    def __init__(self, t: float, mean: FloatArray, cov: FloatArray) -> None:
        self.base_mean, self.base_cov = mean, cov
        self.t = np.array([t])
        self.q = np.zeros(1)
        self.z = np.zeros((1, 2))
        self.info = np.zeros((1, 2))
        self.is_key = np.ones(1, dtype=np.bool_)
        self.mean, self.cov = mean[None].copy(), cov[None].copy()
        self.reference = self.mean

    def key_rows(self) -> IntArray:
        """Return the rows that are keys (K,)."""
        return np.flatnonzero(self.is_key)

    def append(self, t: FloatArray, q: FloatArray, z: FloatArray, info: FloatArray) -> None:
        """Append keys, all later than the last row, and filter them.

        Args:
            t: (n,) times (s), ascending.
            q: (n,) root spectral densities of the jerk since the row before (px/s^2.5).
            z: (n, 2) fused measurements (px).
            info: (n, 2) their information (1/px²).
        """
        old = len(self.t)
        self.t = np.concatenate([self.t, t])
        self.q = np.concatenate([self.q, q])
        self.z = np.concatenate([self.z, z])
        self.info = np.concatenate([self.info, info])
        self.is_key = np.concatenate([self.is_key, np.ones(len(t), dtype=np.bool_)])
        self._filter_from(old)
        self.reference = np.concatenate([self.reference, self.mean[old:]])

    def insert(self, t: float, z: FloatArray, info: FloatArray) -> int:
        """Take in a measurement that came late: into a row at its time, or into one of its own.

        Args:
            t: time (s), not before the first row and not after the last.
            z: (2,) measured centre (px).
            info: (2,) its information (1/px²).

        Returns:
            The row that holds it now.
        """
        row = int(np.argmin(np.abs(self.t - t)))
        # At large times a microsecond is a few roundings: what lies outside the rows belongs to the nearest.
        if abs(self.t[row] - t) <= COINCIDENT_S or not self.t[0] < t < self.t[-1]:
            total = self.info[row] + info
            self.z[row] = (self.info[row] * self.z[row] + info * z) / total
            self.info[row] = total
        else:
            row = int(np.searchsorted(self.t, t))
            self.t = np.insert(self.t, row, t)
            self.q = np.insert(self.q, row, self.q[row])
            self.z = np.insert(self.z, row, z, axis=0)
            self.info = np.insert(self.info, row, info, axis=0)
            self.is_key = np.insert(self.is_key, row, False)
            self.reference = np.insert(self.reference, row, np.nan, axis=0)
        self._filter_from(row)
        return row

    def drop_before(self, row: int) -> None:
        """Forget the rows before a key; its filtered state becomes the base."""
        self.base_mean, self.base_cov = self.mean[row].copy(), self.cov[row].copy()
        for name in ("t", "q", "z", "info", "is_key", "mean", "cov", "reference"):
            setattr(self, name, getattr(self, name)[row:].copy())
        self.info[0] = 0.0

    def smooth(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Smooth the window (Rauch-Tung-Striebel).

        Returns:
            (K, 2, 3) means, (K, 2, 3, 3) covariances, and (K, 2, 3, 3) gains from key to key, of the keys.
        """
        F, Q = motion_matrices(np.diff(self.t, prepend=self.t[0]), self.q)
        mean, cov, gain = backward(F, Q, np.array([0, len(self.t)]), self.mean, self.cov)
        if self.is_key.all():
            return mean, cov, gain
        rows = self.key_rows()
        # States are a Markov chain, so the gain over several steps is the product of theirs.
        for row in np.flatnonzero(~self.is_key)[::-1]:
            gain[row - 1] = gain[row - 1] @ gain[row]
        return mean[rows], cov[rows], gain[rows]

    def _filter_from(self, row: int) -> None:
        """Filter the rows from `row` on anew; those before it have not changed."""
        first = max(row - 1, 0)
        info = self.info[first:]
        if row > 0:
            info = info.copy()
            info[0] = 0.0  # the filtered state from which we go on has seen it
        dt = np.diff(self.t[first:], prepend=self.t[first])
        F, Q = motion_matrices(dt, self.q[first:])
        prior = (self.base_mean, self.base_cov) if row == 0 else (self.mean[first], self.cov[first])
        start = np.array([0, len(info)])
        mean, cov = forward(F, Q, self.z[first:], info, start, prior[0][None], prior[1][None])
        self.mean = np.concatenate([self.mean[:first], mean])
        self.cov = np.concatenate([self.cov[:first], cov])
