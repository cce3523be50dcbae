"""The state that a new track starts with: what its first detection says, and nothing else is known.

The tracker begins its tracks with it, and the smoothers begin their trajectories with the same.
"""

from __future__ import annotations

from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.coloured_noise import MOTION


@njit(cache=True)
def write_prior(
    z: FloatArray,
    white: FloatArray,
    coloured_std: FloatArray,
    error: int,
    velocity_var: FloatArray,
    acceleration_var: FloatArray,
    mean: FloatArray,
    cov: FloatArray,
) -> None:
    """Write the prior of a track's motion and of its sensors' errors.

    Args:
        z: (2,) centre of the first detection (px).
        white: (2,) variances of its white noise (px²).
        coloured_std: (2,) standard deviations of the coloured error (px).
        error: the sensor's error state, counted from 0, or -1.
        velocity_var: (2,) variances of the velocity, which is zero on average (px²/s²).
        acceleration_var: (2,) variances of the acceleration, likewise (px²/s⁴).
        mean: (2, 3 + B) per axis [p, v, a, e_1, …], becomes the mean.
        cov: (2, 3 + B, 3 + B) becomes the covariance.
    """
    mean[:] = 0.0
    cov[:] = 0.0
    for axis in range(2):
        mean[axis, 0] = z[axis]
        cov[axis, 0, 0] = white[axis] + coloured_std[axis] * coloured_std[axis]
        cov[axis, 1, 1] = velocity_var[axis]
        cov[axis, 2, 2] = acceleration_var[axis]
        for e in range(MOTION, mean.shape[1]):
            cov[axis, e, e] = 1.0
        if error >= 0:
            # p = z − h e − w: what the detection is off by, the position is off by the other way.
            cov[axis, 0, MOTION + error] = cov[axis, MOTION + error, 0] = -coloured_std[axis]


@njit(cache=True)
def write_size_prior(
    log_size: FloatArray, var: FloatArray, rate_var: float, mean: FloatArray, cov: FloatArray
) -> None:
    """Write the prior of a track's size.

    Args:
        log_size: (2,) ln width and ln height of the first detection (ln px).
        var: (2,) their variances.
        rate_var: variance of their rates, which are zero on average (1/s²).
        mean: (2, 2) for width and height [ln size, rate], becomes the mean.
        cov: (2, 2, 2) becomes the covariance.
    """
    mean[:] = 0.0
    cov[:] = 0.0
    for side in range(2):
        mean[side, 0] = log_size[side]
        cov[side, 0, 0] = var[side]
        cov[side, 1, 1] = rate_var
