"""Smoothing of a living track's box size with a lag."""

from __future__ import annotations

import numpy as np

from jeat_graph.arrays import FloatArray
from jeat_graph.smoothers.size import SmoothedSize, smooth_size
from jeat_graph.smoothers.track_data import COINCIDENT_S


class SizeWindow:
    """Measured sizes of one track that are not final yet, and the filtered size before them.

    Args:
        t: time of the track's birth (s).
        mean: (2, 2) prior of ln width and ln height with their rates (ln px, 1/s).
        cov: (2, 2, 2) its covariance.
        density: root spectral density of the rates (1/s^1.5).
    """

    def __init__(self, t: float, mean: FloatArray, cov: FloatArray, density: float) -> None:
        self._base = (t, mean, cov)
        self._density = density
        self._t = np.zeros(0)
        self._log_size = np.zeros((0, 2))
        self._var = np.zeros((0, 2))

    def append(self, t: FloatArray, log_size: FloatArray, var: FloatArray) -> None:
        """Take in measured sizes: times (M,) s, ln width and height (M, 2), variances (M, 2)."""
        self._t = np.concatenate([self._t, t])
        self._log_size = np.concatenate([self._log_size, log_size])
        self._var = np.concatenate([self._var, var])

    def smooth(self) -> SmoothedSize:
        """Smooth all since the base, given all measurements so far."""
        return self._solve(len(self._t))

    def advance(self, t: float) -> None:
        """Make the sizes up to time `t` final: the base moves there, and what came before is forgotten."""
        count = int(np.searchsorted(self._t, t + COINCIDENT_S, side="right"))
        # With nothing after it, the last smoothed size is the filtered one.
        filtered = self._solve(count)
        self._base = (float(filtered.t[-1]), filtered.mean[-1], filtered.cov[-1])
        self._t, self._log_size, self._var = self._t[count:], self._log_size[count:], self._var[count:]

    def _solve(self, count: int) -> SmoothedSize:
        density = np.full(count, self._density)
        return smooth_size(*self._base, self._t[:count], self._log_size[:count], self._var[:count], density)
