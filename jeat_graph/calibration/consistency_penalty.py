"""What it costs a configuration, in tuning, that the covariances it makes are not true.

Scores do not see covariances: a tracker that believes its detectors too much may even score a little more.
Whoever uses the tables' variances would then be misled, so a mean squared error that is far from what the
table says is charged like lost accuracy.
"""

from __future__ import annotations

import math

#: Mean squared errors between these multiples of the variance cost nothing.
CONSISTENT = (0.7, 1.5)
# Points of (MOTA + IDF1 + HOTA) / 3 for each factor of e outside.
_PER_FACTOR_OF_E = 5.0


def consistency_penalty(anees: float) -> float:
    """What variances that are wrong by this factor cost (per cent); nothing where nothing matched."""
    if not math.isfinite(anees) or anees <= 0.0:
        return 0.0
    low, high = CONSISTENT
    return _PER_FACTOR_OF_E * max(math.log(low / anees), math.log(anees / high), 0.0)
