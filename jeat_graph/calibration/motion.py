"""Motion model from data: jerk density and the prior of a new track, by the innovation likelihood."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy.optimize import minimize

from jeat_graph.calibration.measured import MeasuredTracks
from jeat_graph.config.schema import MotionConfig, SizeConfig
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.filters.coloured_noise import MOTION, expected, predict_errors, update_with_error
from jeat_graph.filters.jerk import common_growth, jerk_density
from jeat_graph.filters.kalman import predict, predict_size, update_block
from jeat_graph.filters.motion import size_process_noise, size_transition

# Innovations beyond this many standard deviations are outliers and count as if they were this large.
_HUBER = 3.0
_MAX_GAP_S = 1.0
# A prior of the velocity that is too narrow loses the fast vehicle on its second scan; one that is too wide
# costs little. Speeds have heavier tails than the normal prior that is fitted, hence the reserve.
VELOCITY_RESERVE = 2.0
# The measured growth lags behind the true one where it matters most, just before a vehicle passes. With this
# reserve the covariances of velocity and acceleration hold there too; positions lose nothing by it.
PERSPECTIVE_RESERVE = 1.7
# Drivers brake and steer at about 1 m/s³ for about a second, in vehicles of about 2 m: a recording in which
# nobody does is no reason to lose the one who will.
LEAST_JERK_PER_SIZE = 0.3


class CentreSeries(NamedTuple):
    """Measured centres of many tracks, with all that their innovations depend on but the motion model.

    Attributes:
        t: (K,) times (s), ascending within a track.
        z: (K, 2) measured centres (px).
        R: (K, 2) variances of their white noise (px²).
        coloured_std: (K, 2) standard deviations of their coloured noise (px).
        error: (K,) the sensor's error state, counted from 0, or -1.
        correlation_time: (B,) correlation times of the errors (s).
        side: (K,) box size sqrt(w h) (px).
        growth: (K,) rate of growth of ln size (1/s), from `growth_rates`.
        start: (T + 1,) track i owns the rows start[i]:start[i + 1].
    """

    t: FloatArray
    z: FloatArray
    R: FloatArray
    coloured_std: FloatArray
    error: IntArray
    correlation_time: FloatArray
    side: FloatArray
    growth: FloatArray
    start: IntArray


@njit(cache=True)
def innovation_loss(
    series: CentreSeries,
    jerk_per_size: float,
    jerk_per_growth: float,
    velocity_std_per_size: float,
    acceleration_std_per_size: float,
) -> float:
    """Robust negative log likelihood of the innovations of many tracks, both axes.

    Args:
        series: measured centres of the tracks.
        jerk_per_size: root spectral density of jerk per px of size (1/s^2.5).
        jerk_per_growth: the same by perspective, in units of size · growth^2.5.
        velocity_std_per_size: std of a new track's velocity per px of size (1/s).
        acceleration_std_per_size: the same of its acceleration (1/s²).
    """
    t, z, R, coloured_std, error, correlation_time, side, growth, start = series
    D = MOTION + len(correlation_time)
    loss = 0.0
    mean, cov, u, jerk = np.zeros((1, 2, D)), np.zeros((1, 2, D, D)), np.empty(D), np.empty(1)
    for i in range(len(start) - 1):
        for k in range(start[i], start[i + 1]):
            dt = t[k] - t[k - 1] if k > start[i] else 0.0
            if k == start[i] or dt > _MAX_GAP_S:
                mean[:] = 0.0
                cov[:] = 0.0
                for axis in range(2):
                    P = cov[0, axis]
                    mean[0, axis, 0] = z[k, axis]
                    P[0, 0] = R[k, axis] + coloured_std[k, axis] ** 2
                    P[1, 1] = (velocity_std_per_size * side[k]) ** 2
                    P[2, 2] = (acceleration_std_per_size * side[k]) ** 2
                    for b in range(MOTION, D):
                        P[b, b] = 1.0
                    if error[k] >= 0:
                        P[0, MOTION + error[k]] = P[MOTION + error[k], 0] = -coloured_std[k, axis]
                continue
            jerk[0] = jerk_density(side[k], growth[k], 0.0, jerk_per_size, jerk_per_growth)
            predict(mean, cov, jerk, dt)
            predict_errors(mean, cov, correlation_time, dt)
            for axis in range(2):
                m, P, r = mean[0, axis], cov[0, axis], R[k, axis]
                centre, var = expected(m, P, coloured_std[k, axis], error[k])
                S = var + r
                e = abs(z[k, axis] - centre) / np.sqrt(S)
                loss += 0.5 * np.log(S) + (0.5 * e * e if e < _HUBER else _HUBER * e - 0.5 * _HUBER**2)
                r = r if e < _HUBER else r * (e / _HUBER) ** 2
                update_with_error(m, P, z[k, axis], r, coloured_std[k, axis], error[k], u)
    return loss


@njit(cache=True)
def size_loss(
    t: FloatArray, z: FloatArray, R: FloatArray, start: IntArray, rate_density: float, rate_std: float
) -> float:
    """Robust negative log likelihood of the innovations of ln width or ln height.

    Arguments as above, of one side.
    """
    loss = 0.0
    for i in range(len(start) - 1):
        m = np.zeros(2)
        P = np.zeros((2, 2))
        for k in range(start[i], start[i + 1]):
            dt = t[k] - t[k - 1] if k > start[i] else 0.0
            if k == start[i] or dt > _MAX_GAP_S:
                m[0] = z[k]
                m[1] = 0.0
                P[:] = 0.0
                P[0, 0] = R[k]
                P[1, 1] = rate_std**2
                continue
            F = size_transition(dt)
            m = F @ m
            P = F @ P @ F.T + size_process_noise(dt, rate_density)
            S = P[0, 0] + R[k]
            e = abs(z[k] - m[0]) / np.sqrt(S)
            loss += 0.5 * np.log(S) + (0.5 * e * e if e < _HUBER else _HUBER * e - 0.5 * _HUBER**2)
            update_block(m, P, z[k], R[k] if e < _HUBER else R[k] * (e / _HUBER) ** 2)
    return loss


@njit(cache=True)
def growth_rates(
    t: FloatArray,
    log_size: FloatArray,
    var: FloatArray,
    start: IntArray,
    rate_density: float,
    rate_std: float,
) -> FloatArray:
    """Rate of growth of ln size (K,) (1/s) as the size filter predicts it for each row.

    Args:
        t: (K,) times (s), ascending within a track.
        log_size: (K, 2) measured ln width, ln height.
        var: (K, 2) variances.
        start: (T + 1,) track i owns the rows start[i]:start[i + 1].
        rate_density: of the size filter (1/s^1.5).
        rate_std: of the size filter (1/s).
    """
    out = np.zeros(len(t))
    mean, cov = np.zeros((1, 2, 2)), np.zeros((1, 2, 2, 2))
    for i in range(len(start) - 1):
        for k in range(start[i], start[i + 1]):
            dt = t[k] - t[k - 1] if k > start[i] else 0.0
            if k == start[i] or dt > _MAX_GAP_S:
                mean[:] = 0.0
                cov[:] = 0.0
                for side in range(2):
                    mean[0, side, 0] = log_size[k, side]
                    cov[0, side, 0, 0] = var[k, side]
                    cov[0, side, 1, 1] = rate_std**2
                continue
            predict_size(mean, cov, np.full(len(mean), rate_density), dt)
            out[k] = common_growth(mean[0, 0, 1], mean[0, 1, 1])
            for side in range(2):
                update_block(mean[0, side], cov[0, side], log_size[k, side], var[k, side])
    return out


def _minimise(loss: Callable[[FloatArray], float], first: FloatArray) -> FloatArray:
    """Minimise by Nelder-Mead from a simplex of a factor of e a side: parameters are logarithms."""
    simplex = np.vstack([first, first + np.eye(len(first))])
    options: Any = {"xatol": 1e-2, "fatol": 1e-2, "initial_simplex": simplex}
    return np.asarray(minimize(loss, first, method="Nelder-Mead", options=options).x)


def fit_motion(tracks: MeasuredTracks, size: SizeConfig, base: MotionConfig | None = None) -> MotionConfig:
    """Fit the usual motion to measured tracks: one density of jerk, and the prior of a new track.

    Args:
        tracks: correct detections of all sensors, object by object.
        size: the size filter, which tells how fast a vehicle grows.
        base: says what is not fitted, how far calm and manoeuvring are from the usual, and what holds while
            nothing is seen; the defaults if not given.

    Raises:
        DataError: no track has three measurements.
    """
    if len(tracks.start) < 2 or np.diff(tracks.start).max(initial=0) < 3:
        raise DataError("no object was detected three times; motion cannot be estimated")

    growth = growth_rates(
        tracks.t, tracks.log_size, tracks.log_size_var, tracks.start, size.rate_density, size.rate_std
    )
    series = CentreSeries(
        tracks.t,
        tracks.z,
        tracks.R,
        tracks.coloured_std,
        tracks.error,
        tracks.correlation_time,
        tracks.side,
        growth,
        tracks.start,
    )

    def loss(log_parameters: FloatArray) -> float:
        jerk, perspective, velocity, acceleration = np.exp(np.clip(log_parameters, -8.0, 8.0))
        total = innovation_loss(series, jerk, perspective, velocity, acceleration)
        # A weak pull to one keeps a parameter that the data say nothing of from running away.
        return total + 0.02 * float(np.sum(np.asarray(log_parameters) ** 2))

    first = np.log([2.0, 2.0, 1.0, 1.0])
    jerk, perspective, velocity, acceleration = np.exp(np.clip(_minimise(loss, first), -8.0, 8.0))
    return replace(
        base or MotionConfig(),
        jerk_px=0.0,
        jerk_per_size=max(float(jerk), LEAST_JERK_PER_SIZE),
        jerk_per_growth=float(PERSPECTIVE_RESERVE * perspective),
        velocity_std_px=0.0,
        velocity_std_per_size=float(VELOCITY_RESERVE * velocity),
        acceleration_std_px=1e-3,
        acceleration_std_per_size=float(acceleration),
    )


def fit_size(t: FloatArray, z: FloatArray, R: FloatArray, start: IntArray) -> SizeConfig:
    """Fit the size filter to measured tracks.

    Args:
        t: (K,) times (s), ascending within a track.
        z: (K, 2) measured ln width, ln height, bias removed.
        R: (K, 2) variances.
        start: (T + 1,) track i owns the rows start[i]:start[i + 1].
    """

    def loss(log_parameters: FloatArray) -> float:
        density, rate = np.exp(np.clip(log_parameters, -8.0, 4.0))
        total = sum(size_loss(t, z[:, side], R[:, side], start, density, rate) for side in range(2))
        return float(total + 0.02 * np.sum(np.asarray(log_parameters) ** 2))

    density, rate = np.exp(np.clip(_minimise(loss, np.log([0.3, 0.3])), -8.0, 4.0))
    return SizeConfig(rate_density=float(density), rate_std=float(rate))
