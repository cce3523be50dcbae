"""Calibration from detections and their truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.calibration.matches import SensorMatches, match_sensor
from jeat_graph.calibration.motion import fit_motion, fit_size
from jeat_graph.calibration.rates import scan_rate
from jeat_graph.calibration.sensor import calibrate_sensor
from jeat_graph.config import BirthConfig, Config, SensorConfig
from jeat_graph.detections import Detections
from jeat_graph.errors import DataError
from jeat_graph.trajectories import GroundTruth

Recording = tuple[Detections, GroundTruth]

_PERIOD_S = 0.1


def calibrate(recordings: Sequence[Recording], base: Config | None = None) -> Config:
    """Estimate sensors and motion from recordings with truth.

    Args:
        recordings: detections and truth of each sequence; all are pooled.
        base: configuration whose other settings (association, lifecycle, …) are kept; the defaults if not
            given.

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
        found = calibrate_sensor(matches[name], scan_rate([d for d, _ in recordings], name))
        sensors[name] = replace(found, tempering=_tempering(base, name))
    config = (
        Config(sensors=sensors)
        if base is None
        else replace(base, sensors=sensors, association=replace(base.association, priority=()))
    )
    tracks = measured_tracks(matches, sensors)
    return replace(
        config,
        motion=fit_motion(tracks.t, tracks.z, tracks.R, tracks.side, tracks.start),
        size=fit_size(tracks.t, tracks.log_size, tracks.log_size_var, tracks.start),
        birth=fit_births(config, matches, recordings),
    )


def fit_births(
    config: Config, matches: Mapping[str, SensorMatches], recordings: Sequence[Recording]
) -> BirthConfig:
    """Estimate how many vehicles wait for a track at the start, and how many more a second.

    A vehicle that no sensor detects for longer than a confirmed track is kept has to be born again, so it
    counts again.

    Args:
        config: says how long a confirmed track is kept.
        matches: detections beside the truth, of all sensors.
        recordings: for their duration and the number of vehicles in a picture.
    """
    key = np.concatenate([m.key for m in matches.values()])
    t = np.concatenate([m.t for m in matches.values()])
    order = np.lexsort((t, key[:, 1], key[:, 0]))
    same = np.all(np.diff(key[order], axis=0) == 0, axis=1)
    lost = np.diff(t[order]) > config.lifecycle.max_gap_confirmed_s
    births = 1 + int(np.sum(~same | lost))
    frames = [truth.frame_times() for _, truth in recordings]
    duration = sum(float(f[-1] - f[0]) for f in frames)
    boxes = sum(int(np.sum(~truth.ignore)) for _, truth in recordings)
    initial = boxes / sum(len(f) for f in frames)
    arrivals = max(births - initial * len(recordings), 1.0)
    return replace(config.birth, arrival_rate_hz=arrivals / max(duration, 1.0), initial=initial)


@dataclass(frozen=True, eq=False)
class MeasuredTracks:
    """Correct detections of all sensors, object by object.

    Attributes:
        t: (K,) time (s), ascending within a track.
        z: (K, 2) centre without the sensor's bias (px).
        R: (K, 2) its variance (px²).
        side: (K,) sqrt(w h) (px).
        start: (T + 1,) track i owns the rows start[i]:start[i + 1].
        log_size: (K, 2) ln width and ln height without bias.
        log_size_var: (K, 2) their variances.
    """

    t: FloatArray
    z: FloatArray
    R: FloatArray
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
    rho = np.repeat([(s.rho_x, s.rho_y) for _, s in parts], rows, axis=0)
    sigma = np.repeat([s.sigma_px for _, s in parts], rows)
    log_sigma = np.repeat([(s.sigma_log_width, s.sigma_log_height) for _, s in parts], rows, axis=0)
    order = np.lexsort((t, key[:, 1], key[:, 0]))
    change = np.any(np.diff(key[order], axis=0) != 0, axis=1)
    start = np.concatenate(([0], np.flatnonzero(change) + 1, [len(order)])).astype(np.int64)
    side = box[:, 2:]

    def sort(column: FloatArray) -> FloatArray:
        return np.ascontiguousarray(column[order])

    return MeasuredTracks(
        t=sort(t),
        z=sort(box[:, :2] + (0.5 - bias[:, :2]) * side),
        R=sort(sigma[:, None] ** 2 + (rho * side) ** 2),
        side=sort(np.sqrt(side.prod(axis=1))),
        start=start,
        log_size=sort(np.log(side) - bias[:, 2:]),
        log_size_var=sort(log_sigma**2),
    )


def _tempering(base: Config | None, name: str) -> float:
    """Tempering cannot be read off single detections: the base's, for a new sensor its most cautious one."""
    if base is None:
        return SensorConfig().tempering
    if name in base.sensors:
        return base.sensors[name].tempering
    return min(s.tempering for s in base.sensors.values())


def _one_a_period(m: SensorMatches) -> SensorMatches:
    """Keep one correct detection of each object in each period.

    A detector's errors persist over neighbouring scans; taken at every scan of a fast sensor they would
    pass for motion.
    """
    period = np.floor(m.t / _PERIOD_S + 1e-6).astype(np.int64)
    first = np.unique(np.column_stack([m.key, period]), axis=0, return_index=True)[1]
    rows = np.sort(first)
    return replace(
        m, key=m.key[rows], t=m.t[rows], box=m.box[rows], residual=m.residual[rows], side=m.side[rows]
    )
