"""Bends the straight road into an arc of a circle: places, velocities and accelerations, exactly."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray


def bend_points(x: FloatArray, y: FloatArray, curvature: float) -> tuple[FloatArray, FloatArray]:
    """Take places across (x) and along (y) the road (m) to the world's axes.

    Args:
        x: (...) right of the road's middle.
        y: (...) along it, from the camera's gantry.
        curvature: 1/m, positive for a bend to the right; 0 changes nothing.
    """
    if curvature == 0.0:
        return x, y
    angle = curvature * y
    return (1.0 - np.cos(angle)) / curvature + x * np.cos(angle), (1.0 / curvature - x) * np.sin(angle)


def bend_motion(
    pose: FloatArray, velocity: FloatArray, acceleration: FloatArray, curvature: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Take poses and their derivatives (N, 3), each x, y and heading, from the straight road to the arc.

    With T along and N to the right of the road, T' = κ s' N and N' = -κ s' T give the derivatives.
    """
    if curvature == 0.0:
        return pose, velocity, acceleration
    k = curvature
    x, s = pose[:, 0], pose[:, 1]
    xd, sd = velocity[:, 0], velocity[:, 1]
    xdd, sdd = acceleration[:, 0], acceleration[:, 1]
    sin, cos = np.sin(k * s), np.cos(k * s)
    left = 1.0 - k * x
    px, py = bend_points(x, s, k)
    ahead, right = left * sd, xd
    push, pull = left * sdd - 2.0 * k * xd * sd, xdd + k * left * sd**2
    return (
        np.column_stack([px, py, pose[:, 2] + k * s]),
        np.column_stack([ahead * sin + right * cos, ahead * cos - right * sin, velocity[:, 2] + k * sd]),
        np.column_stack([push * sin + pull * cos, push * cos - pull * sin, acceleration[:, 2] + k * sdd]),
    )
