"""What a detector's boxes are off as long as they show one object, by boxes matched with the truth.

The formula is that of `filters.sensor_accuracy` with the truth as the other sensor, which is off by nothing.
"""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.calibration.matches import SensorMatches
from jeat_graph.filters import sensor_accuracy
from jeat_graph.filters.model_constants import ModelConstants


def lasting_error(matched: SensorMatches, c: ModelConstants) -> float | None:
    """Return the standard deviation of what lasts of a detector's errors (sizes); None where pairs are few.

    Args:
        matched: its boxes and the true ones.
        c: how far apart two errors of one object have in common what lasts, and how many pairs are enough.
    """
    order = np.lexsort((matched.t, *matched.key.T))
    t, key = matched.t[order], matched.key[order]
    if not len(t):
        return None
    mean = np.asarray(np.median(matched.residual, axis=0))
    error = sensor_accuracy.clipped(matched.residual[order], mean, c)
    begins = np.append(True, (np.diff(key, axis=0) != 0).any(axis=1))
    number = np.cumsum(begins) - 1
    # Of each box the first one of its object that is late enough; objects lie apart in one row of times.
    span = float(np.ptp(t)) + 2.0 * c.lasting_within_s
    line = t - t.min() + number * span
    later = np.searchsorted(line, line + c.lasting_after_s)
    pairs = np.flatnonzero(later < len(line))
    pairs = pairs[line[later[pairs]] - line[pairs] <= c.lasting_within_s]
    if len(pairs) < c.lasting_count:
        return None
    products = sensor_accuracy.products(error[later[pairs]], error[pairs])
    return math.sqrt(max(float(products.mean()), 0.0))
