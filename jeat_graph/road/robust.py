"""Finds points that do not belong to a vehicle: those off a motion with which most agree (RANSAC)."""

from __future__ import annotations

import functools

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray

_DRAWS = 80
_LEAST_APART = 0.15  # of the track's time, between the three points of a draw
_BELIEVED = 0.25  # weight of a point that is as far off as the kernel is wide


def kernel(distance: FloatArray, soft: float) -> FloatArray:
    """Weights of residuals of length `distance` (..., M): Geman and McClure's, a quarter at `soft`."""
    return np.asarray(1.0 / (1.0 + (distance / soft) ** 2) ** 2, dtype=np.float64)


@functools.cache
def _draws(num: int) -> IntArray:
    """Draws of three of `num` points (D, 3), ascending in each: the same ones every time."""
    return np.sort(np.random.default_rng(0).integers(0, num, (4 * _DRAWS, 3)), axis=1)


def agreed_weights(s: FloatArray, xy: FloatArray, whiten: FloatArray, soft: float) -> FloatArray:
    """Find, per track, the constant-acceleration motion through three points that most points agree with.

    A track whose end stays behind on the picture's edge, or jumps to another vehicle, has more leverage than
    reweighting from a least-squares fit gets over, so the search is over draws (random sample consensus).

    Args:
        s: (K, M) times (s), ascending in each track.
        xy: (K, M, 2) places on the road (m).
        whiten: (K, M, 2, 2) residuals in m to standard deviations.
        soft: residual at which a point's weight is a quarter.

    Returns:
        (K, M) weights by the best draw's residuals; 1 where a track is too short for a draw.
    """
    num = s.shape[1]
    weight = np.ones(s.shape)
    span = s[:, -1] - s[:, 0] if num else np.zeros(len(s))
    triple = _draws(num) if num >= 4 else np.empty((0, 3), dtype=np.int64)
    apart = np.diff(s[:, triple], axis=2).min(axis=2, initial=np.inf) > _LEAST_APART * span[:, None]
    tried = np.flatnonzero(apart.any(axis=1) & (span > 0))
    if not len(tried):
        return weight
    # The first draws of each track whose points lie apart; where there are fewer, the first of them again.
    order = np.argsort(~apart[tried], axis=1, kind="stable")[:, :_DRAWS]
    few = np.arange(order.shape[1]) >= apart[tried].sum(axis=1)[:, None]
    chosen = triple[np.where(few, order[:, :1], order)]
    s, xy, whiten, span = s[tried], xy[tried], whiten[tried], span[tried]
    u = (s - s.mean(axis=1, keepdims=True)) / span[:, None]
    powers = np.stack([np.ones_like(u), u, u**2], axis=-1)
    track = np.arange(len(tried))[:, None, None]
    through = np.linalg.solve(powers[track, chosen], xy[track, chosen])
    miss = xy[:, None] - powers[:, None] @ through
    # Written out: a product of matrices as small as these costs more to begin than to compute.
    size = [whiten[:, None, :, k, 0] * miss[..., 0] + whiten[:, None, :, k, 1] * miss[..., 1] for k in (0, 1)]
    distance = np.sqrt(size[0] ** 2 + size[1] ** 2)
    cost = (1.0 - kernel(distance, soft)).sum(axis=-1)
    best = distance[np.arange(len(tried)), np.argmin(cost, axis=1)]
    weight[tried] = kernel(best, 2.0 * soft)
    return weight


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
