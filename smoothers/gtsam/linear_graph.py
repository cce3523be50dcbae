"""GTSAM's linear factor graphs, filled from arrays of whitened rows (`whitened.py`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.gtsam.scaling import axis_blocks


def load_gtsam() -> None:
    """Import GTSAM now; otherwise it is imported when the first graph is made."""
    import gtsam  # noqa: F401


class LinearGraph:
    """A GTSAM linear factor graph on numbered states, filled from arrays of rows.

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
        """Add the rows of `prior_rows` on state `key`, after all segments: its rows are light."""
        self.graph.add(key, A, b, self._noise(len(b)))

    def add_segments(
        self, first: int, A0: FloatArray, A1: FloatArray, b: FloatArray, counts: IntArray
    ) -> None:
        """Add the rows of `segment_rows` on the states `first`, `first` + 1 and so on."""
        add = self.graph.add
        for i, count in enumerate(counts.tolist()):
            add(first + i, A0[i, :count], first + i + 1, A1[i, :count], b[i, :count], self._noise(count))

    def as_nonlinear(self) -> Any:
        """Convert for GTSAM's smoothers, which take nonlinear factors only.

        The linearisation point (zeros) is essential: without it the result is silently wrong.
        """
        return self._gtsam.LinearContainerFactor.ConvertLinearGraph(
            self.graph, zero_values(self.graph.keyVector(), self._size)
        )

    def solve(self, keys: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Solve for the states 0 to `keys` - 1 by QR elimination in order of time.

        Returns:
            vectors (K, 2 n), conditional covariances (K, 2, n, n) of each state given its successor, and
            gains (K, 2, n, n), the last zero, all scaled: y_k = G_k y_{k+1} + constant + noise.

        Raises:
            RuntimeError: GTSAM's, if the system is indeterminate.
        """
        ordering = self._gtsam.Ordering()
        for k in range(keys):
            ordering.push_back(k)
        net = self.graph.eliminateSequential(ordering, self._gtsam.EliminateQR)
        width = 2 * self._size
        vectors = net.optimize().vector().reshape(keys, width)
        R, S = np.empty((keys, width, width)), np.zeros((keys, width, width))
        for k in range(keys):
            conditional = net.at(k)
            R[k] = conditional.R()
            if k < keys - 1:
                S[k] = conditional.S()
        root = np.linalg.inv(R)
        gain = -(root @ S)
        cov = root @ root.transpose(0, 2, 1)
        return vectors, axis_blocks(cov), axis_blocks(gain)


def zero_values(keys: Any, size: int) -> Any:
    """Return GTSAM values with a zero state of `size` components per axis for each of `keys`."""
    import gtsam

    values, zero = gtsam.Values(), np.zeros(2 * size)
    for key in keys:
        values.insert(key, zero)
    return values
