"""Finds points that do not belong to a vehicle: those off a motion with which most agree (RANSAC)."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray

_DRAWS = 80
_LEAST_APART = 0.15  # of the track's time, between the three points of a draw
_BELIEVED = 0.25  # weight of a point that is as far off as the kernel is wide


def kernel(distance: FloatArray, soft: float) -> FloatArray:
    """Weights of residuals of length `distance` (..., M): Geman and McClure's, a quarter at `soft`."""
    return np.asarray(1.0 / (1.0 + (distance / soft) ** 2) ** 2, dtype=np.float64)


def agreed_weights(s: FloatArray, xy: FloatArray, whiten: FloatArray, soft: float) -> FloatArray:
    """Find the constant-acceleration motion through three points that most points agree with.

    A track whose end stays behind on the picture's edge, or jumps to another vehicle, has more leverage than
    reweighting from a least-squares fit gets over, so the search is over draws (the same ones every time).

    Args:
        s: (M,) times (s).
        xy: (M, 2) places on the road (m).
        whiten: (M, 2, 2) residuals in m to standard deviations.
        soft: residual at which a point's weight is a quarter.

    Returns:
        (M,) weights by the best draw's residuals.
    """
    span = s[-1] - s[0]
    if len(s) < 4 or span <= 0:
        return np.ones(len(s))
    rng = np.random.default_rng(0)
    triple = np.sort(rng.integers(0, len(s), (_DRAWS * 4, 3)), axis=1)
    apart = np.diff(s[triple], axis=1).min(axis=1) > _LEAST_APART * span
    triple = triple[apart][:_DRAWS]
    if not len(triple):
        return np.ones(len(s))
    u = (s - s.mean()) / span
    powers = np.stack([np.ones_like(u), u, u**2], axis=1)
    through = np.linalg.solve(powers[triple], xy[triple])
    miss = xy - powers @ through
    distance = np.linalg.norm(np.einsum("mij,dmj->dmi", whiten, miss), axis=-1)
    cost = (1.0 - kernel(distance, soft)).sum(axis=1)
    return kernel(distance[int(np.argmin(cost))], 2.0 * soft)


def believed_span(t: FloatArray, weight: FloatArray) -> tuple[float, float]:
    """First and last time (s) that a fit believes: ends of a track that wander off do not count.

    Args:
        t: (N,) times of what was fitted, ascending (s).
        weight: (N,) robust weights.
    """
    good = np.flatnonzero(weight > _BELIEVED)
    if len(good) < 2:
        return float(t[0]), float(t[-1])
    return float(t[good[0]]), float(t[good[-1]])
