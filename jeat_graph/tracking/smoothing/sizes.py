"""Smoothing of a living track's box size with a lag."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray, RecordArray
from jeat_graph.smoothers.size import SmoothedSize, smooth_size
from jeat_graph.smoothers.track_data import COINCIDENT_S, Prior


class SizeWindow:
    """Measured sizes of one track that are not final yet, and the filtered size before them.

    Args:
        prior: ln width and ln height with their rates at the birth (2, 2), (2, 2, 2) (ln px, 1/s).
        density: root spectral density of the rates (1/s^1.5).
    """

    def __init__(self, prior: Prior, density: float) -> None:
        self._base = prior
        self._density = density
        self._parts: list[tuple[FloatArray, ...]] = []

    def append(self, measured: RecordArray) -> None:
        """Take in the sizes of measurements (M,)."""
        # Fields of records as arrays of their own, for one compiled form of what comes next.
        self._parts.append(
            tuple(measured[name].copy() for name in ("t", "log_size", "size_var", "size_density"))
        )

    def smooth(self) -> SmoothedSize:
        """Smooth all since the base, given all measurements so far."""
        return self._solve(*self._waiting())

    def advance(self, t: float) -> None:
        """Make the sizes up to time `t` final: the base moves there, and what came before is forgotten."""
        waiting = self._waiting()
        count = int(np.searchsorted(waiting[0], t + COINCIDENT_S, side="right"))
        # With nothing after it, the last smoothed size is the filtered one.
        past, later = ([column[part] for column in waiting] for part in (slice(count), slice(count, None)))
        filtered = self._solve(*past)
        self._base = Prior(float(filtered.t[-1]), filtered.mean[-1], filtered.cov[-1])
        self._parts = [tuple(later)]

    def _waiting(self) -> tuple[FloatArray, ...]:
        """All measurements since the base: times (M,), sizes (M, 2), variances (M, 2), densities (M,)."""
        if not self._parts:
            return np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
        if len(self._parts) > 1:
            self._parts = [tuple(np.concatenate(column) for column in zip(*self._parts, strict=True))]
        return self._parts[0]

    def _solve(
        self, t: FloatArray, log_size: FloatArray, var: FloatArray, density: FloatArray
    ) -> SmoothedSize:
        return smooth_size(*self._base, t, log_size, var, density, self._density)
