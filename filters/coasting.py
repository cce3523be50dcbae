"""What is held of a track's motion while no sensor sees it: what changes quickly is soon forgotten.

A constant acceleration, and a constant rate of growth, are good for the moments between two looks. Held for
a second behind another vehicle, they throw a track across the picture: what the filter takes for them is
half noise, and vehicles do not brake, nor people swing their arms, for that long. So while a track is not
seen, both die away, and the velocity stays. That an acceleration dies away is in the model of Singer,
"Estimating optimal tracking filter performance for manned maneuvering targets", IEEE T-AES 6(4), 1970; here
it is done apart, after a whole step at constant acceleration. With steps that are short beside the memory the
two are alike; with longer ones a track goes further than in his model, so it depends on the steps.
"""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray

_ACCELERATION, _RATE = 2, 1
# So many memories leave two billionths; a minute's gap would leave a variance that no float holds.
_MOST_MEMORIES = 20.0


@njit(cache=True)
def forget(
    mean: FloatArray,
    cov: FloatArray,
    size_mean: FloatArray,
    size_cov: FloatArray,
    unseen: BoolArray,
    dt: float,
    memory_s: float,
) -> None:
    """Let acceleration and growth of the unseen tracks die away over `dt`, in place: a ← a exp(−Δ / τ).

    The covariances are those of the scaled variables: what is smaller is also surer. After twenty τ it stays.

    Args:
        mean: (N, 2, 3 + B) per axis [p, v, a, …] (px, px/s, px/s²).
        cov: (N, 2, 3 + B, 3 + B) covariance per axis.
        size_mean: (N, 2, 2) ln width and ln height, each with its rate (1/s).
        size_cov: (N, 2, 2, 2) covariance of each.
        unseen: (N,) the tracks that this holds for.
        dt: time step (s), >= 0.
        memory_s: τ (s), > 0.
    """
    forget_acceleration(mean, cov, unseen, dt, memory_s)
    forget_growth(size_mean, size_cov, unseen, dt, memory_s)


@njit(cache=True)
def forget_acceleration(
    mean: FloatArray, cov: FloatArray, unseen: BoolArray, dt: float, memory_s: float
) -> None:
    """Let the acceleration alone die away, in place: `forget` for filters that know nothing of sizes.

    Args:
        mean: (N, 2, 3 + B) as there.
        cov: (N, 2, 3 + B, 3 + B) as there.
        unseen: (N,) as there.
        dt: time step (s), >= 0.
        memory_s: τ (s), > 0.
    """
    _fade(mean, cov, _ACCELERATION, unseen, dt, memory_s)


@njit(cache=True)
def forget_growth(mean: FloatArray, cov: FloatArray, unseen: BoolArray, dt: float, memory_s: float) -> None:
    """Let the growth alone die away, in place: `forget` for filters that know nothing of motion.

    Args:
        mean: (N, 2, 2) as there.
        cov: (N, 2, 2, 2) as there.
        unseen: (N,) as there.
        dt: time step (s), >= 0.
        memory_s: τ (s), > 0.
    """
    _fade(mean, cov, _RATE, unseen, dt, memory_s)


@njit(cache=True)
def _fade(
    mean: FloatArray, cov: FloatArray, component: int, unseen: BoolArray, dt: float, memory_s: float
) -> None:
    """Let one component of the unseen tracks' blocks (N, 2, D) die away, in place."""
    kept = math.exp(-min(dt / memory_s, _MOST_MEMORIES))
    for i in range(len(unseen)):
        if unseen[i]:
            for axis in range(2):
                _scale(mean[i, axis], cov[i, axis], component, kept)


@njit(cache=True, forceinline=True)
def _scale(mean: FloatArray, cov: FloatArray, k: int, factor: float) -> None:
    """Scale component `k` of a block by a factor, in place."""
    mean[k] *= factor
    for j in range(len(mean)):
        cov[k, j] *= factor
        cov[j, k] *= factor
