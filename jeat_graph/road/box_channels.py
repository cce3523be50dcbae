"""What is measured of a vehicle's box: centre and size, or one side where the other is cut off."""

from __future__ import annotations

import numpy as np

from jeat_graph.core import road as core
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray

#: What of an axis of a box is measured: centre and size, one side alone (the other is cut off), or nothing.
WHOLE, LOW, HIGH, NEITHER = 0, 1, 2, 3
#: Channels of a box: centre x, centre y (px), ln width, ln height; a side that is alone in a centre's place.
CHANNELS = 4
#: Unknowns that a channel depends on: x, y of the footprint's middle, length, width, height (m).
UNKNOWNS = 5


def measured(mode: IntArray) -> BoolArray:
    """Which channels of boxes count (N, 4), by what of each axis is measured (N, 2)."""
    return np.concatenate([mode != NEITHER, mode == WHOLE], axis=1)


def directions(velocity: FloatArray, along: float, least_speed: float) -> FloatArray:
    """Sine and cosine (N, 2) of headings, taken from y towards x.

    Args:
        velocity: (N, 2) across and along the road (m/s).
        along: heading of a vehicle that hardly moves (rad).
        least_speed: a slower one hardly moves (m/s).
    """
    speed = np.sqrt((velocity**2).sum(axis=1, keepdims=True))
    moves = speed > least_speed
    way = np.divide(velocity, speed, out=np.zeros_like(velocity), where=moves)
    return np.where(moves, way, [np.sin(along), np.cos(along)])


def linearise(
    camera: core.Camera, place: FloatArray, way: FloatArray, size: FloatArray, z: FloatArray, mode: IntArray
) -> tuple[FloatArray, FloatArray] | None:
    """Linearise the channels of one vehicle's boxes about a motion and a size.

    Args:
        camera: the camera.
        place: (N, 2) middles of the footprint (m).
        way: (N, 2) directions of the long axis, as `directions` has them.
        size: (3,) length, width, height (m).
        z: (N, 4) what was measured.
        mode: (N, 2) what of each axis is measured.

    Returns:
        Derivatives (N, 4, 5) of the channels with respect to the unknowns and residuals (N, 4); None where
        the vehicle is not in front of the camera at all times.
    """
    slopes, residual = np.empty((len(z), CHANNELS, UNKNOWNS)), np.empty((len(z), CHANNELS))
    in_front = core.linearise(
        camera, np.ascontiguousarray(place), way, np.ascontiguousarray(size), z, mode, slopes, residual
    )
    return (slopes, residual) if in_front else None
