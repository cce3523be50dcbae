"""Measurement and process noise learnt from innovations, while tracking.

Innovations of a filter whose noise is right are white with covariance S: the normalised squares have mean 1
(NIS), and the product of two successive ones has mean 0 (Mehra, *On the identification of variances and
adaptive Kalman filtering*, IEEE Trans. Automatic Control 15, 1970). Squares too large: more measurement
noise, per sensor. Successive ones of one sign: the filter lags, more process noise, of the scene. Each is a
step of stochastic approximation of a log variance. This is the paper's NIS adaptation (algorithm 1) with the
two causes distinguished.
"""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.singer import ProcessNoise


def normalised_innovations(y: FloatArray, S: FloatArray, size: FloatArray, c: ModelConstants) -> FloatArray:
    """Return the innovations (N, 4) of centre x, y, ln width, ln height in standard deviations, clipped.

    Args:
        y: (N, 2, 2) innovations of the sides by axis and side (px).
        S: (N, 2, 2, 2) their covariances.
        size: (N, 2) predicted width and height (px).
        c: constants.
    """
    centre = y.mean(axis=2) / np.sqrt(S.mean(axis=(2, 3)))
    variance = (S[..., 0, 0] + S[..., 1, 1] - 2.0 * S[..., 0, 1]) / size**2
    extent = (y[..., 1] - y[..., 0]) / size / np.sqrt(variance)
    both: FloatArray = np.concatenate([centre, extent], axis=1)
    clipped: FloatArray = np.clip(both, -c.innovation_clip, c.innovation_clip)
    return clipped


def share_of_scan(teachers: int, period_s: float, c: ModelConstants) -> float:
    """Return the weight of a scan: few tracks teach little, and a fast sensor's scans repeat its errors."""
    return min(1.0, teachers / c.noise_tracks) * min(1.0, period_s / c.noise_period_s)


def learn_measurement_noise(log_variance: float, e: FloatArray, share: float, c: ModelConstants) -> float:
    """Return ln ρ² of a sensor after a scan: ln ρ² + η (mean of min(e², cap) − target), within its bounds.

    Args:
        log_variance: ln ρ² before.
        e: (K, 4) normalised innovations of tracks that are known well, K >= 1.
        share: weight of the scan.
        c: constants.
    """
    excess = float(np.minimum(e**2, c.nis_cap).mean()) - c.nis_target
    return _bounded(log_variance + c.noise_rate * share * excess, c.side_std_bounds)


def learn_process_noise(
    q: ProcessNoise, e: FloatArray, before: FloatArray, known: BoolArray, share: float, c: ModelConstants
) -> ProcessNoise:
    """Return the scene's process noise after a scan: ln q + η · (mean of e_k e_{k−1}), within its bounds.

    Args:
        q: logarithms of the densities before.
        e: (K, 4) normalised innovations of centre and ln size, K >= 1.
        before: (K, 4) those of the same tracks' last detections.
        known: (K,) whether there was one.
        share: weight of the scan.
        c: constants.
    """
    lag = e * before * known[:, None]
    centre, extent = share * float(lag[:, :2].mean()), share * float(lag[:, 2:].mean())
    return ProcessNoise(
        jerk=_bounded(q.jerk + c.process_rate * centre, c.jerk_bounds),
        growth=_bounded(q.growth + c.process_rate * extent, c.growth_bounds),
        position=_bounded(q.position + c.walk_rate * centre, c.walk_bounds),
        size=_bounded(q.size + c.walk_rate * extent, c.walk_bounds),
    )


def _bounded(log_variance: float, bounds: tuple[float, float]) -> float:
    """Return a log variance whose standard deviation is within bounds."""
    return min(max(log_variance, 2.0 * math.log(bounds[0])), 2.0 * math.log(bounds[1]))
