"""Random sequences along the life of each object: correlated noise, and choices that last for a while."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray


def object_order(object_id: IntArray, t: FloatArray) -> tuple[IntArray, FloatArray]:
    """Sort rows by object, then by time.

    Returns:
        (N,) the order, and (N,) the time since the object's row before (s), infinite at its first row.
    """
    order = np.lexsort((t, object_id))
    gap = np.diff(t[order], prepend=-np.inf)
    new = np.diff(object_id[order], prepend=-1) != 0
    return order, np.where(new, np.inf, gap)


def correlated(
    rng: np.random.Generator, object_id: IntArray, t: FloatArray, memory_s: float, width: int
) -> FloatArray:
    """Unit-variance Gauss-Markov noise per object: correlation exp(-Δt / memory_s).

    Args:
        rng: random stream.
        object_id: (N,) identity of each row.
        t: (N,) time of each row (s).
        memory_s: correlation time (s).
        width: independent components.

    Returns:
        (N, width).
    """
    order, gap = object_order(object_id, t)
    out = np.empty((len(t), width))
    out[order] = _gauss_markov(np.exp(-gap / memory_s), rng.normal(size=(len(t), width)))
    return out


def sticky_uniform(
    rng: np.random.Generator, object_id: IntArray, t: FloatArray, memory_s: float
) -> FloatArray:
    """Uniform numbers in [0, 1) that an object keeps with probability exp(-Δt / memory_s).

    Compared with a constant probability p they give a two-state Markov chain: hits and misses come in
    bursts of mean length of the order of `memory_s`, and still the share of hits is exactly p.

    Args:
        rng: random stream.
        object_id: (N,) identity of each row.
        t: (N,) time of each row (s).
        memory_s: mean time between redraws (s).

    Returns:
        (N,).
    """
    order, gap = object_order(object_id, t)
    fresh = rng.random(len(t)) >= np.exp(-gap / memory_s)
    value = rng.random(len(t))
    last = np.maximum.accumulate(np.where(fresh, np.arange(len(t)), 0))
    out = np.empty(len(t))
    out[order] = value[last]
    return out


@njit(cache=True, error_model="numpy")
def _gauss_markov(phi: FloatArray, shock: FloatArray) -> FloatArray:
    out = np.empty_like(shock)
    for i in range(len(shock)):
        for k in range(shock.shape[1]):
            if phi[i] == 0.0:
                out[i, k] = shock[i, k]
            else:
                out[i, k] = phi[i] * out[i - 1, k] + np.sqrt(1.0 - phi[i] ** 2) * shock[i, k]
    return out
