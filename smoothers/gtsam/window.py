"""GTSAM's incremental fixed-lag smoother over the states of one track's window.

States are numbered upwards as they come. Which of them leave is told from outside: to GTSAM every state
has the timestamp 0 until it is to leave, so that a state is only marginalised after it was read, with
all that the last chunk of measurements said about it, also where a gap is longer than the lag.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.gtsam.linear_graph import LinearGraph, zero_values
from jeat_graph.smoothers.gtsam.scaling import unscale_mean

#: Timestamps as GTSAM sees them: with a lag of one, a state at -2 is out of the window.
_STAYS, _LEAVES, _LAG = 0.0, -2.0, 1.0

# What GTSAM's C++ exceptions become in Python.
_GTSAM_ERRORS = (RuntimeError, IndexError, ValueError)


class GtsamError(Exception):
    """GTSAM could not do what it was asked for; its window is not to be used again."""


class GtsamWindow:
    """The window of one track inside GTSAM, in px and s at its interface.

    Every method may raise `GtsamError`; after that the object is not to be used again.

    Args:
        size: components of a state per axis, n.
    """

    def __init__(self, size: int) -> None:
        import gtsam

        self._size = size

        gauss_newton = gtsam.ISAM2GaussNewtonParams()
        # At the default, changes below 1e-3 px are not propagated back through the window.
        gauss_newton.setWildfireThreshold(0.0)
        params = gtsam.ISAM2Params()
        params.setOptimizationParams(gauss_newton)
        params.setFactorization("QR")
        params.findUnusedFactorSlots = True
        params.relinearizeSkip = 2**30  # the problem is linear
        params.enableRelinearization = False
        self._leaving: list[int] = []
        self._smoother: Any = gtsam.IncrementalFixedLagSmoother(_LAG, params)

    def leaving(self, states: Iterable[int]) -> None:
        """Have states marginalised with the next update."""
        self._leaving.extend(states)

    def update(self, graph: LinearGraph, first: int, count: int) -> None:
        """Add factors and the states `first`, …, `first` + `count` - 1, and marginalise those leaving."""
        stamps = dict.fromkeys(range(first, first + count), _STAYS)
        stamps.update(dict.fromkeys(self._leaving, _LEAVES))
        self._leaving = []
        values = zero_values(range(first, first + count), self._size)
        factors = graph.as_nonlinear()
        try:
            self._smoother.update(factors, values, stamps)
        except _GTSAM_ERRORS as error:
            raise GtsamError(str(error)) from error

    def means(self, keys: Sequence[int], reference: FloatArray) -> FloatArray:
        """Return the means (N, 2, n) of states of the window, given their references (N, 2, n).

        Raises:
            GtsamError: also if a mean is not finite.
        """
        wanted = list(keys)
        try:
            vectors = self._smoother.getDelta().vector(wanted)
        except _GTSAM_ERRORS as error:
            raise GtsamError(str(error)) from error
        if not np.isfinite(vectors).all():
            raise GtsamError("GTSAM gave a mean that is not finite")
        return unscale_mean(vectors, reference)
