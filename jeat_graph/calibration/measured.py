"""Joins the correct detections of all sensors into one track for each object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.calibration.matches import SensorMatches
from jeat_graph.calibration.score_noise import factors
from jeat_graph.config.kernel_form import error_states
from jeat_graph.config.schema import SensorConfig
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.noise import base_variance

# Motion shows in samples this far apart. The errors of a size, which the filter takes for white, persist over
# neighbouring scans: taken at every scan of a fast sensor they would pass for growth.
_PERIOD_S = 0.1


@dataclass(frozen=True, eq=False)
class MeasuredTracks:
    """Correct detections of all sensors, object by object.

    Attributes:
        t: (K,) time (s), ascending within a track.
        z: (K, 2) centre without the sensor's bias (px).
        R: (K, 2) variances of its white noise (px²).
        coloured_std: (K, 2) standard deviations of its coloured noise (px).
        error: (K,) the sensor's error state, counted from 0, or -1.
        correlation_time: (B,) correlation times of the errors (s).
        side: (K,) sqrt(w h) (px).
        start: (T + 1,) track i owns the rows start[i]:start[i + 1].
        log_size: (K, 2) ln width and ln height without bias.
        log_size_var: (K, 2) their variances.
    """

    t: FloatArray
    z: FloatArray
    R: FloatArray
    coloured_std: FloatArray
    error: IntArray
    correlation_time: FloatArray
    side: FloatArray
    start: IntArray
    log_size: FloatArray
    log_size_var: FloatArray


def measured_tracks(
    matches: Mapping[str, SensorMatches], sensors: Mapping[str, SensorConfig]
) -> MeasuredTracks:
    """Join all sensors' correct detections into one track an object, as the filter would take them in.

    Args:
        matches: by sensor.
        sensors: calibrated noise and bias, by sensor.
    """
    parts = [(_one_a_period(every), sensors[name]) for name, every in matches.items()]
    key = np.concatenate([m.key for m, _ in parts])
    t = np.concatenate([m.t for m, _ in parts])
    box = np.concatenate([m.box for m, _ in parts])
    rows = [len(m.t) for m, _ in parts]
    bias = np.repeat([s.bias for _, s in parts], rows, axis=0)
    sigma, rho_size = np.repeat([(s.sigma_px, s.rho_size) for _, s in parts], rows, axis=0).T
    rho = np.repeat([(s.rho_x, s.rho_y) for _, s in parts], rows, axis=0)
    share = np.repeat([s.correlated_share for _, s in parts], rows)
    error, correlation_time = error_states([s for _, s in parts])
    log_sigma = np.repeat([(s.sigma_log_width, s.sigma_log_height) for _, s in parts], rows, axis=0)
    order = np.lexsort((t, key[:, 1], key[:, 0]))
    change = np.any(np.diff(key[order], axis=0) != 0, axis=1)
    start = np.concatenate(([0], np.flatnonzero(change) + 1, [len(order)])).astype(np.int64)
    side = box[:, 2:]
    size = np.sqrt(side.prod(axis=1))
    of_axis = np.vectorize(base_variance, otypes=[float])
    by_score = np.concatenate([factors(m.hit_score, s.score_noise) for m, s in parts])[:, None] ** 2
    variance = by_score * of_axis(sigma[:, None], rho, side, rho_size[:, None], size[:, None])

    def sort(column: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return np.ascontiguousarray(column[order])

    return MeasuredTracks(
        t=sort(t),
        z=sort(box[:, :2] + (0.5 - bias[:, :2]) * side),
        R=sort((1.0 - share[:, None]) * variance),
        coloured_std=sort(np.sqrt(share[:, None] * variance)),
        error=sort(np.repeat(error, rows)),
        correlation_time=correlation_time,
        side=sort(size),
        start=start,
        log_size=sort(np.log(side) - bias[:, 2:]),
        log_size_var=sort(by_score * log_sigma**2),
    )


def _one_a_period(m: SensorMatches) -> SensorMatches:
    """Keep one correct detection of each object in each period."""
    period = np.floor(m.t / _PERIOD_S + 1e-6).astype(np.int64)
    first = np.unique(np.column_stack([m.key, period]), axis=0, return_index=True)[1]
    rows = np.sort(first)
    columns = ("key", "t", "box", "residual", "side", "hit_score")
    return replace(m, **{name: getattr(m, name)[rows] for name in columns})
