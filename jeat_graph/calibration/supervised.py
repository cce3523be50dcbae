"""Calibration from detections and their truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.calibration.matches import SensorMatches, match_sensor
from jeat_graph.calibration.measured import measured_tracks
from jeat_graph.calibration.motion import fit_motion, fit_size
from jeat_graph.calibration.sensor import calibrate_sensor
from jeat_graph.config.schema import BirthConfig, Config, ImageConfig, InputConfig, SensorConfig
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import with_progress
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.runs.declaring import own_picture, scan_rate_hz

Recording = tuple[Detections, GroundTruth]


@dataclass(frozen=True, eq=False)
class MatchedSensors:
    """What matched detections say of each sensor, with the matches, from which all else is estimated.

    Attributes:
        base: configuration whose other settings are kept; None: the defaults.
        recordings: detections and truth of each sequence.
        matches: by sensor.
        sensors: estimates, by sensor; what detections cannot tell is the base's.
    """

    base: Config | None
    recordings: Sequence[Recording]
    matches: Mapping[str, SensorMatches]
    sensors: Mapping[str, SensorConfig]


def measure_sensors(recordings: Sequence[Recording], base: Config | None = None) -> MatchedSensors:
    """Estimate the sensors from recordings with truth; arguments and errors as of `calibrate`."""
    names = sorted({name for detections, _ in recordings for name in detections.sensors})
    if not names:
        raise DataError("the recordings hold no scan")
    matches: dict[str, SensorMatches] = {}
    sensors: dict[str, SensorConfig] = {}
    for name in with_progress(names):
        parts = [
            match_sensor(detections, truth, name, sequence).only_whole(_image_of(base, detections))
            for sequence, (detections, truth) in enumerate(recordings)
            if name in detections.sensors
        ]
        matches[name] = SensorMatches.pool(parts)
        known = _known(base, name)
        rate = scan_rate_hz([detections for detections, _ in recordings], name)
        sensors[name] = calibrate_sensor(matches[name], replace(known, rate_hz=rate or known.rate_hz))
    return MatchedSensors(base, recordings, matches, sensors)


def with_sensors(measured: MatchedSensors, sensors: Mapping[str, SensorConfig]) -> Config:
    """Estimate motion, size and births for given sensors: how large errors are says what is motion.

    Args:
        measured: matched detections.
        sensors: what the tracker shall believe of them.

    Raises:
        DataError: too little that matches.
    """
    base = measured.base
    config = (
        Config(sensors=dict(sensors))
        if base is None
        else replace(base, sensors=dict(sensors), association=replace(base.association, priority=()))
    )
    tracks = measured_tracks(measured.matches, sensors)
    size = fit_size(tracks.t, tracks.log_size, tracks.log_size_var, tracks.start)
    return replace(
        config,
        motion=fit_motion(tracks, size, config.motion),
        size=size,
        birth=fit_births(config, measured.matches, measured.recordings),
        input=InputConfig(picture=config.input.picture),
    )


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
    measured = measure_sensors(recordings, base)
    return with_sensors(measured, measured.sensors)


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


def _image_of(base: Config | None, detections: Detections) -> ImageConfig:
    return ImageConfig() if base is None else own_picture(base, detections).image


def _known(base: Config | None, name: str) -> SensorConfig:
    """What was known of a sensor before: the base's; of a new one what is assumed, most cautiously."""
    if base is None:
        return SensorConfig()
    if name in base.sensors:
        return base.sensors[name]
    # Tempering cannot be read off single detections.
    return replace(base.input.undeclared_sensor(), tempering=min(s.tempering for s in base.sensors.values()))
