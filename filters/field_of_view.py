"""Which part of the picture a sensor looks at, learnt from where its boxes lie.

A second camera may see a part of the scene only: a half, or a narrow field in the middle. What it does not
find elsewhere it has not looked for. Its field is taken for a stretch from left to right: above and below the
road nothing is ever found, so that the height of the boxes says where vehicles are and not where a sensor
looks. Of a sensor whose boxes, n of them, reach over a width w, the probability that the field goes on for at
least d more is

    (w / (w + d))^(n + 1),

the posterior of the end of a uniform distribution, of which there is next to nothing known beforehand
(DeGroot, "Optimal statistical decisions", McGraw-Hill 1970, ch. 9.7: the Pareto distribution). Every box
counts, the false ones too: a detector that finds something at a place has looked there.
"""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray


@njit(cache=True)
def extend_field(box: FloatArray, field: FloatArray) -> None:
    """Let a field reach as far as a box does, in place.

    Args:
        box: (4,) left, top, width, height (px).
        field: (2,) how far the boxes reach to the left and to the right (px); (+inf, -inf) before the first.
    """
    field[0] = min(field[0], box[0])
    field[1] = max(field[1], box[0] + box[2])


@njit(cache=True)
def in_field(x: float, low: float, high: float, witnesses: float) -> float:
    """Probability that a sensor looks at a place; 1 for one that has found nothing at all so far.

    Args:
        x: of the place (px).
        low: how far its boxes reach to the left (px, `extend_field`).
        high: how far to the right (px).
        witnesses: how many independent boxes that rests on.
    """
    if witnesses <= 0.0:
        return 1.0
    beyond = max(low - x, x - high)
    if beyond <= 0.0:
        return 1.0
    return math.exp(-(witnesses + 1.0) * math.log1p(beyond / max(high - low, 1e-9)))
