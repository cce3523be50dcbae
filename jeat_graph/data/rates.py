"""The rate of a clock, from the times that it gave."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray

#: Where frames are only counted and no rate is known, any rate is as good as another; 25 Hz is a usual one.
ANY_RATE_HZ = 25.0


def median_rate_hz(*clocks: FloatArray) -> float | None:
    """One over the median step of a clock (Hz), or None where it cannot be known.

    Args:
        clocks: (N,) ascending (s), of each recording of it: the steps of all are pooled. Of fewer than two
            times, or where most are equal, nothing is known.
    """
    steps = np.concatenate([np.diff(times) for times in clocks])
    step = float(np.median(steps)) if len(steps) else 0.0
    return 1.0 / step if step > 0.0 else None
