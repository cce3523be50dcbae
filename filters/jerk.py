"""How strongly a track's motion in the picture may change: the density of its white jerk."""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.sides import mean_side

# Beyond this a growth is none that a picture shows for longer than a moment.
MOST_GROWTH = 4.0  # 1/s


@njit(cache=True)
def jerk_density(
    side: float, growth: float, jerk_px: float, jerk_per_size: float, jerk_per_growth: float
) -> float:
    """Root spectral density of the jerk (px/s^2.5).

    Drivers brake and steer in metres, so their share grows with the size of the box. The rest is
    perspective: of a vehicle that passes at constant speed, at a growth g = d ln(size) / dt, all distances in
    the picture go with 1 / (t₀ − t) and g = 1 / (t₀ − t), so its jerk is proportional to size · g³ and lasts
    for about 1 / g; as the density of a white process that is size · g^2.5. The constant-acceleration model
    has no other way to know that a vehicle about to pass below the camera will not go on as it did.

    Args:
        side: box size sqrt(w h) (px).
        growth: rate of growth of ln size (1/s), of either sign.
        jerk_px: part that depends on nothing (px/s^2.5).
        jerk_per_size: part of drivers, per px of size (1/s^2.5).
        jerk_per_growth: part of perspective, in units of size · |growth|^2.5.
    """
    g = min(abs(growth), MOST_GROWTH)
    drivers = jerk_px + jerk_per_size * side
    perspective = jerk_per_growth * side * g * g * math.sqrt(g)
    if perspective == 0.0:
        return float(drivers)
    return math.sqrt(drivers * drivers + perspective * perspective)


@njit(cache=True)
def common_growth(width: float, height: float) -> float:
    """Rate of growth that both sides of a box share (1/s): what comes nearer grows in both.

    A vehicle that turns, a walker's swinging arms or a box half hidden grow in one direction; that is not
    perspective, and says nothing of how the motion will go on.

    Args:
        width: rate of ln width (1/s).
        height: rate of ln height (1/s).
    """
    if width * height <= 0.0:
        return 0.0
    least = min(abs(width), abs(height))
    return least if width > 0.0 else -least


@njit(cache=True)
def track_jerk(
    size_mean: FloatArray, jerk_px: float, jerk_per_size: float, jerk_per_growth: float, factor: float
) -> float:
    """Root spectral density of a track's jerk (px/s^2.5), see `jerk_density`.

    Args:
        size_mean: (2, 2) ln width and ln height with their rates.
        jerk_px: as there.
        jerk_per_size: as there.
        jerk_per_growth: as there.
        factor: 1; less of a calm track, but perspective stays, and more of one that manoeuvres.
    """
    side = mean_side(size_mean)
    growth = common_growth(size_mean[0, 1], size_mean[1, 1])
    # What passes the camera jerks by perspective however calmly it goes.
    perspective = max(factor, 1.0) * jerk_per_growth
    return jerk_density(side, growth, factor * jerk_px, factor * jerk_per_size, perspective)
