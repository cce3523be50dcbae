"""A mean of what was seen of late, one of several side by side."""

from __future__ import annotations

from numba import njit

from jeat_graph.data.arrays import FloatArray


@njit(cache=True)
def take_into_mean(
    mean: FloatArray, seen: FloatArray, k: int, value: float, weight: float, memory: float
) -> None:
    """Take a value into one of some running means, in place: at first a plain mean, then one that forgets.

    Args:
        mean: (K,) the means.
        seen: (K,) what each rests on, in the unit of the weights.
        k: which of them.
        value: what is taken in.
        weight: what it counts for.
        memory: a mean rests on no more than this, and no less than one value.
    """
    seen[k] = min(seen[k] + weight, max(memory, weight))
    mean[k] += weight / seen[k] * (value - mean[k])
