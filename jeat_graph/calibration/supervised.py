"""Calibration from detections and their truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jeat_graph.calibration.matches import SensorMatches, match_sensor
from jeat_graph.calibration.motion import fit_motion, fit_size
from jeat_graph.calibration.sensor import calibrate_sensor
from jeat_graph.config import Config, SensorConfig
from jeat_graph.detections import Detections
from jeat_graph.errors import DataError
from jeat_graph.trajectories import GroundTruth


_PERIOD_S = 0.1


def calibrate(recordings: Sequence[tuple[Detections, GroundTruth]], base: Config | None = None) -> Config:
    """Estimate sensors and motion from recordings with truth.

    Args:
        recordings: detections and truth of each sequence; all are pooled.
        base: configuration whose other settings (association, lifecycle, …) are kept; the defaults if not given.

    Returns:
        A configuration that declares exactly the sensors that occur.

    Raises:
        DataError: too little that matches.
    """
    names = sorted({name for detections, _ in recordings for name in detections.sensors})
    if not names:
        raise DataError("the recordings hold no scan")
    matches: dict[str, SensorMatches] = {}
    sensors: dict[str, SensorConfig] = {}
    for name in names:
        parts = [
            match_sensor(detections, truth, name, sequence)
            for sequence, (detections, truth) in enumerate(recordings)
            if name in detections.sensors
        ]
        matches[name] = SensorMatches.pool(parts)
        sensors[name] = calibrate_sensor(matches[name], _rate([d for d, _ in recordings], name))
    config = (
        Config(sensors=sensors)
        if base is None
        else replace(base, sensors=sensors, association=replace(base.association, priority=()))
    )
    duration = sum(float(np.ptp(truth.frame_times())) for _, truth in recordings)
    objects = sum(len(np.unique(truth.object_id[~truth.ignore])) for _, truth in recordings)
    birth = replace(config.birth, arrival_rate_hz=objects / max(duration, 1.0))
    tracks = measured_tracks(matches, sensors)
    return replace(
        config, motion=fit_motion(*tracks[:5]), size=fit_size(tracks[0], tracks[5], tracks[6], tracks[4])
    )


def measured_tracks(
    matches: dict[str, SensorMatches], sensors: dict[str, SensorConfig]
) -> tuple[np.ndarray, ...]:  # type: ignore[type-arg]
    """Join all sensors' correct detections into one track an object.

    Returns:
        t (K,), z (K, 2), R (K, 2), size (K,), start (T + 1,), ln size (K, 2), its variances (K, 2).
    """
    columns: list[list[np.ndarray]] = [[] for _ in range(7)]  # type: ignore[type-arg]
    for name, every in matches.items():
        m = _one_a_period(every)
        s = sensors[name]
        bias = np.array(s.bias)
        side = m.box[:, 2:]
        log_size = np.log(side) - bias[2:]
        columns[0].append(m.key)
        columns[1].append(m.t)
        columns[2].append(m.box[:, :2] + (0.5 - bias[:2]) * side)
        columns[3].append(s.sigma_px**2 + (np.array([s.rho_x, s.rho_y]) * side) ** 2)
        columns[4].append(np.sqrt(side.prod(axis=1)))
        columns[5].append(log_size)
        columns[6].append(np.broadcast_to([s.sigma_log_width**2, s.sigma_log_height**2], log_size.shape))
    key, t, z, R, size, log_size, log_var = (np.concatenate(c) for c in columns)
    order = np.lexsort((t, key[:, 1], key[:, 0]))
    change = np.any(np.diff(key[order], axis=0) != 0, axis=1)
    start = np.concatenate(([0], np.flatnonzero(change) + 1, [len(order)])).astype(np.int64)
    c = [np.ascontiguousarray(a[order]) for a in (t, z, R, size, log_size, log_var)]
    return c[0], c[1], c[2], c[3], start, c[4], c[5]


def _one_a_period(m: SensorMatches) -> SensorMatches:
    """Keep one correct detection of each object in each period.

    A detector's errors persist over neighbouring scans; taken at every scan of a fast sensor they would pass for
    motion.
    """
    period = np.floor(m.t / _PERIOD_S + 1e-6).astype(np.int64)
    first = np.unique(np.column_stack([m.key, period]), axis=0, return_index=True)[1]
    rows = np.sort(first)
    return replace(
        m, key=m.key[rows], t=m.t[rows], box=m.box[rows], residual=m.residual[rows], side=m.side[rows]
    )


def _rate(recordings: Sequence[Detections], sensor: str) -> float:
    """Median rate (Hz) of a sensor's scans."""
    steps = []
    for detections in recordings:
        if sensor in detections.sensors:
            steps.append(
                np.diff(detections.scan_t[detections.scan_sensor == detections.sensors.index(sensor)])
            )
    every = np.concatenate(steps)
    return float(1.0 / np.median(every)) if len(every) else 20.0
