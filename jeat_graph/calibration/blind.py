"""Calibration without truth: confirmed tracks take its place.

The recordings are tracked with a base configuration; what its confirmed tracks took in counts as correct,
the rest as false. Noise and motion are then those under which the innovations of these tracks are most
likely, and the tracker runs again with what was found.

What this cannot know: a systematic error of a sensor (its bias is set to zero), vehicles that no track found
(P_D comes out too high), and how many of the boxes of a score are false: tracks are confirmed on false boxes
that repeat too, so a poor detector would be credited with what it invents. The precision by score stays what
the base configuration says; while the tracker runs it learns what it can of each sensor by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from jeat_graph.calibration.motion import (
    LEAST_JERK_PER_SIZE,
    PERSPECTIVE_RESERVE,
    VELOCITY_RESERVE,
    CentreSeries,
    fit_size,
    growth_rates,
    innovation_loss,
    size_loss,
)
from jeat_graph.calibration.rates import scan_rate
from jeat_graph.calibration.sensor import fit_detection
from jeat_graph.calibration.tracked import TrackedDetections, follow
from jeat_graph.config.kernel_form import error_states
from jeat_graph.config.schema import Config, InputConfig, MotionConfig, SensorConfig
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import portion, told

_MIN_LENGTH = 5
# A detector's errors persist over neighbouring scans; one detection a sensor and period is taken as
# independent.
_PERIOD_S = 0.1


def calibrate_blind(recordings: Sequence[Detections], base: Config, rounds: int = 2) -> Config:
    """Estimate sensors and motion from recordings without truth.

    Args:
        recordings: of the same sensors; all are pooled.
        base: configuration to begin with; sensors that it does not declare begin with the defaults.
        rounds: how often the tracker runs.

    Returns:
        A configuration that declares exactly the sensors that occur; all else is as in `base`.

    Raises:
        DataError: too little that the tracker could follow.
    """
    names = sorted({name for detections in recordings for name in detections.sensors})
    if not names:
        raise DataError("the recordings hold no scan")
    # Nothing is known of a sensor that the base does not declare, so its evidence is taken with most caution.
    new = SensorConfig(tempering=min(s.tempering for s in base.sensors.values()))
    sensors = {
        name: replace(base.sensors.get(name, new), rate_hz=scan_rate(recordings, name)) for name in names
    }
    association = replace(base.association, priority=())
    config = replace(base, sensors=sensors, association=association, input=InputConfig())
    for _ in told(range(rounds)):
        with portion(0.0, 0.5):
            followed = follow(recordings, config)
        config = _fit(config, followed)
    return config


def _fit(config: Config, data: TrackedDetections) -> Config:
    names = config.sensor_names
    thin = _thinned(data)
    start = np.concatenate(([0], np.flatnonzero(np.diff(thin.track)) + 1, [len(thin.t)])).astype(np.int64)
    if np.diff(start).max(initial=0) < _MIN_LENGTH:
        raise DataError("no track is long enough to estimate motion; the recording is too short or too poor")
    log_sigma, log_size = _fit_size_noise(config, thin, start)
    log_var = log_sigma[thin.sensor] ** 2
    size = fit_size(thin.t, log_size, log_var, start)
    growth = growth_rates(thin.t, log_size, log_var, start, size.rate_density, size.rate_std)
    noise, motion = _fit_noise_and_motion(config, thin, start, growth)
    sensors: dict[str, SensorConfig] = {}
    for s, name in enumerate(names):
        old, taken = config.sensors[name], data.taken[s]
        if taken.sum() < _MIN_LENGTH:
            raise DataError(f"confirmed tracks took almost nothing of sensor {name!r}; calibrate with --gt")
        p_detect, blind = fit_detection(data.detected[s], data.speed[s], data.visible[s])
        sensors[name] = replace(
            old,
            sigma_px=float(np.clip(noise[s, 0], 0.1, 100.0)),
            rho_x=float(noise[s, 1]),
            rho_y=float(noise[s, 1]),
            sigma_log_width=float(max(log_sigma[s, 0], 0.005)),
            sigma_log_height=float(max(log_sigma[s, 1], 0.005)),
            bias=(0.0, 0.0, 0.0, 0.0),
            p_detect=float(np.clip(p_detect, 0.05, 0.99)),
            clutter_per_scan=float((np.sum(~taken) + 0.5) / data.scans[s]),
            blind_speed=blind,
        )
    return replace(config, sensors=sensors, motion=motion, size=size)


def _thinned(data: TrackedDetections) -> TrackedDetections:
    """Keep one detection of each track and sensor in each period."""
    period = np.floor(data.t / _PERIOD_S + 1e-6).astype(np.int64)
    first = np.unique(np.column_stack([data.track, data.sensor, period]), axis=0, return_index=True)[1]
    rows = np.sort(first)
    return replace(data, t=data.t[rows], track=data.track[rows], sensor=data.sensor[rows], box=data.box[rows])


def _fit_noise_and_motion(
    config: Config, data: TrackedDetections, start: IntArray, growth: FloatArray
) -> tuple[FloatArray, MotionConfig]:
    """Maximise the innovation likelihood over σ and ρ (S, 2) of every sensor and the motion model.

    What the configuration says of coloured noise is kept: without truth, a slow error is motion.
    """
    side = data.box[:, 2:]
    z = data.box[:, :2] + 0.5 * side
    size = np.sqrt(side.prod(axis=1))
    known = [config.sensors[name] for name in config.sensor_names]
    rho = [max(np.sqrt(s.rho_x * s.rho_y), 0.005) for s in known]
    m = config.motion
    typical = float(np.median(size))
    first = np.log(
        [
            *(max(s.sigma_px, 0.3) for s in known),
            *rho,
            m.jerk_per_size + m.jerk_px / typical + 1e-3,
            max(m.jerk_per_growth / PERSPECTIVE_RESERVE, 0.5),
            (m.velocity_std_per_size + m.velocity_std_px / typical + 1e-3) / VELOCITY_RESERVE,
            m.acceleration_std_per_size + m.acceleration_std_px / typical + 1e-3,
        ]
    )
    n = len(known)
    share = np.array([s.correlated_share for s in known])[data.sensor][:, None]
    error_of, correlation_time = error_states(known)

    def loss(log_parameters: FloatArray) -> float:
        p = np.exp(np.clip(log_parameters, -8.0, 8.0))
        sigma2, rho2 = p[:n][data.sensor] ** 2, p[n : 2 * n][data.sensor] ** 2
        var = sigma2[:, None] + rho2[:, None] * side**2
        noise = ((1.0 - share) * var, np.sqrt(share * var), error_of[data.sensor], correlation_time)
        series = CentreSeries(data.t, z, *noise, size, growth, start)
        pull = 0.02 * float(np.sum((log_parameters - first) ** 2))
        return pull + float(innovation_loss(series, *p[2 * n :]))

    found = _minimise(loss, first, 0.5)
    p = np.exp(np.clip(found, -8.0, 8.0))
    motion = replace(
        config.motion,
        jerk_px=0.0,
        jerk_per_size=max(float(p[-4]), LEAST_JERK_PER_SIZE),
        jerk_per_growth=float(PERSPECTIVE_RESERVE * p[-3]),
        velocity_std_px=0.0,
        velocity_std_per_size=float(VELOCITY_RESERVE * p[-2]),
        acceleration_std_px=1e-3,
        acceleration_std_per_size=float(p[-1]),
    )
    return np.column_stack([p[:n], np.minimum(p[n : 2 * n], 1.0)]), motion


def _fit_size_noise(
    config: Config, data: TrackedDetections, start: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Noise (S, 2) of ln width and ln height of every sensor, and the measured logarithms (K, 2)."""
    log_size = np.log(data.box[:, 2:])
    known = [config.sensors[name] for name in config.sensor_names]
    out = np.empty((len(known), 2))
    for axis in range(2):
        z = np.ascontiguousarray(log_size[:, axis])
        noise = [s.sigma_log_width if axis == 0 else s.sigma_log_height for s in known]
        first = np.log([*noise, config.size.rate_density + 1e-3, config.size.rate_std + 1e-3])

        def loss(log_parameters: FloatArray, z: FloatArray = z, first: FloatArray = first) -> float:
            p = np.exp(np.clip(log_parameters, -8.0, 4.0))
            pull = 0.02 * float(np.sum((log_parameters - first) ** 2))
            return float(size_loss(data.t, z, p[data.sensor] ** 2, start, p[-2], p[-1])) + pull

        out[:, axis] = np.exp(_minimise(loss, first, 0.5))[: len(known)]
    return out, log_size


def _minimise(loss: Callable[[FloatArray], float], first: FloatArray, step: float) -> FloatArray:
    simplex = np.vstack([first, first + step * np.eye(len(first))])
    options: Any = {
        "xatol": 1e-2,
        "fatol": 1e-1,
        "maxfev": 250 * len(first),
        "adaptive": True,
        "initial_simplex": simplex,
    }
    return np.asarray(minimize(loss, first, method="Nelder-Mead", options=options).x)
