"""What it says that two tracks look similar: learnt from pairs that are decided by all but their appearance.

The feature of a pair is the cosine x of the two embeddings, each less the mean of its camera's, so that what
a camera does to all vehicles counts for nothing. Of one vehicle x has mean μ₁ and variance v₁, of two μ₀ and
v₀. Where a pair is one vehicle with probability p, by everything but x,

    E[x] = μ₀ + p (μ₁ − μ₀),   Var[x] = v₀ + p (v₁ − v₀) + p (1 − p) (μ₁ − μ₀)²,

so regressions on p give all four without bias, however unsure the pairs are. p must not contain x: what is
similar by chance would confirm itself. The log ratio is that of two normal densities with the variance
v = (v₀ + v₁)/2 (Fisher 1936); d′ = (μ₁ − μ₀)/√v, shrunk by its own error (James and Stein 1961), so that
embeddings that tell nothing count for nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray

#: The least variance of a cosine.
_LEAST_VARIANCE = 1e-6
#: ln of the greatest ratio that appearance gives a pair: as the tracker has it.
MOST_RATIO = 6.0


class AppearanceModel(NamedTuple):
    """How similar one vehicle looks twice, at two cameras or at one, and how similar two vehicles look.

    Attributes:
        same, other: mean cosine of one vehicle and of two.
        sigma: standard deviation of both.
    """

    same: float
    other: float
    sigma: float

    @property
    def d_prime(self) -> float:
        """How many standard deviations lie between the two."""
        return (self.same - self.other) / self.sigma

    def log_ratio(self, cosine: FloatArray) -> FloatArray:
        """Return ln of the likelihood ratio (E,) of "one vehicle" to "two", 0 where the cosine is NaN."""
        slope = (self.same - self.other) / self.sigma**2
        found = slope * (cosine - 0.5 * (self.same + self.other))
        return np.where(np.isfinite(cosine), np.clip(found, -MOST_RATIO, MOST_RATIO), 0.0)


def learn_appearance(cosine: FloatArray, probability: FloatArray) -> AppearanceModel | None:
    """Learn the similarity of one vehicle's appearances, and of two vehicles'.

    Args:
        cosine: (E,) of each pair, NaN where one has no embedding.
        probability: (E,) that it is one vehicle, by all but its appearance.

    Returns:
        The model; None where nothing can be learnt, or the embeddings tell nothing.
    """
    known = np.isfinite(cosine)
    x, p = cosine[known], probability[known]
    off = p - p.mean() if len(p) else p
    weight = float((off * off).sum())
    if weight < 1.0:  # not even a vehicle's worth of difference
        return None
    step = float((off * x).sum()) / weight
    other = float(x.mean() - step * p.mean())
    squares = (x - other - p * step) ** 2 - p * (1.0 - p) * step**2
    change = float((off * squares).sum()) / weight
    v_other = max(float(squares.mean()) - change * float(p.mean()), _LEAST_VARIANCE)
    v_same = max(v_other + change, _LEAST_VARIANCE)
    variance = 0.5 * (v_other + v_same)
    kept = max(0.0, 1.0 - variance / weight / step**2) if step > 0.0 else 0.0
    if not kept:
        return None
    middle = other + 0.5 * step
    return AppearanceModel(middle + 0.5 * kept * step, middle - 0.5 * kept * step, math.sqrt(variance))


def centred(appearance: FloatArray) -> FloatArray:
    """Return embeddings (N, E) less their mean, of unit length; NaN where there are none."""
    known = np.isfinite(appearance).all(axis=1)
    out = np.full(appearance.shape, np.nan)
    if known.any():
        rest = appearance[known] - appearance[known].mean(axis=0)
        length = np.linalg.norm(rest, axis=1, keepdims=True)
        out[known] = np.where(length > 1e-9, rest / np.maximum(length, 1e-9), np.nan)
    return out
