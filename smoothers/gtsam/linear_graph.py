"""GTSAM's linear factor graphs, filled from whitened rows (`elimination.py`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.gtsam.elimination import SegmentRows


def load_gtsam() -> None:
    """Import GTSAM now; otherwise it is imported when the first graph is made."""
    import gtsam  # noqa: F401


class LinearGraph:
    """A GTSAM linear factor graph on numbered states.

    Args:
        size: components of a state per axis, n.
    """

    def __init__(self, size: int) -> None:
        import gtsam

        self._gtsam: Any = gtsam
        self._size = size
        self.graph: Any = gtsam.GaussianFactorGraph()
        self._unit: dict[int, Any] = {}

    def _noise(self, rows: int) -> Any:
        """Unit noise of so many rows."""
        if rows not in self._unit:
            self._unit[rows] = self._gtsam.noiseModel.Unit.Create(rows)
        return self._unit[rows]

    def add_prior(self, key: int, A: FloatArray, b: FloatArray) -> None:
        """Add the rows of `prior_rows` on state `key`."""
        self.graph.add(key, A, b, self._noise(len(b)))

    def add_segment(self, key: int, rows: SegmentRows) -> None:
        """Add the rows of a segment from the state `key` to the one after it."""
        self.graph.add(key, rows.A0, key + 1, rows.A1, rows.b, self._noise(len(rows.b)))

    def as_nonlinear(self) -> Any:
        """Convert for GTSAM's smoothers, which take nonlinear factors only.

        The linearisation point (zeros) is essential: without it the result is silently wrong.
        """
        return self._gtsam.LinearContainerFactor.ConvertLinearGraph(
            self.graph, zero_values(self.graph.keyVector(), self._size)
        )

    def solve(self, keys: int) -> FloatArray:
        """Solve for the states 0 to `keys` - 1 by QR elimination in order of time.

        Returns:
            (K, 2 n) the scaled states.

        Raises:
            RuntimeError: GTSAM's, if the system is indeterminate.
        """
        ordering = self._gtsam.Ordering()
        for k in range(keys):
            ordering.push_back(k)
        net = self.graph.eliminateSequential(ordering, self._gtsam.EliminateQR)
        return np.asarray(net.optimize().vector().reshape(keys, 2 * self._size))


def zero_values(keys: Any, size: int) -> Any:
    """Return GTSAM values with a zero state of `size` components per axis for each of `keys`."""
    import gtsam

    values, zero = gtsam.Values(), np.zeros(2 * size)
    for key in keys:
        values.insert(key, zero)
    return values
