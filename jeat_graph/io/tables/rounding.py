"""Rounding of tables, so that a file holds the digits that mean something."""

from __future__ import annotations

import numpy as np

from jeat_graph.core import io as core
from jeat_graph.data.arrays import FloatArray


def round_decimals(values: FloatArray, decimals: int) -> FloatArray:
    """Round to a number of decimals; minus zero becomes zero."""
    return np.asarray(np.round(values, decimals) + 0.0, dtype=np.float64)


def round_significant(values: FloatArray, digits: int) -> FloatArray:
    """Round to a number of significant decimal digits; zero, NaN and infinity stay.

    No more than 22 decimals are kept, so what is much smaller becomes zero.
    """
    out = np.array(values, dtype=np.float64, order="C")
    # In the core, for live tables have few rows and come a hundred times a second.
    core.round_significant(out.reshape(-1), digits)
    return out
