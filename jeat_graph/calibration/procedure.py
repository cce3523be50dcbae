"""Calibration from beginning to end: sensors, rates, clocks, what scores mean, how far boxes are off."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jeat_graph.calibration.even_score import even_score
from jeat_graph.calibration.lasting_error import lasting_error
from jeat_graph.calibration.matches import SensorMatches, match_sensor
from jeat_graph.calibration.offset import (
    Lag,
    earliest_on_time,
    found_lags,
    lags_between,
    lags_from_truth,
    settled,
    with_lags,
)
from jeat_graph.calibration.tracked import follow
from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import with_progress
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.metrics import evaluate
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.runs.declaring import fit_input, own_picture
from jeat_graph.runs.latency import taken_off
from jeat_graph.tracking.whole import track

Recording = tuple[Detections, GroundTruth]
# How often lags are looked for, each time in what those found before leave.
_ROUNDS = 4
_DIGITS = 4


@dataclass(frozen=True)
class MeasuredSetting:
    """A setting of one sensor that was measured by the truth.

    Attributes:
        sensor: its name.
        value: of the setting; None where the boxes do not tell.
        before, after: (MOTA + IDF1 + HOTA) / 3 of the recordings (per cent) without and with it; None
            where that was not asked.
        kept: whether it is in the configuration.
    """

    sensor: str
    value: float | None
    before: float | None
    after: float | None
    kept: bool


@dataclass(frozen=True)
class Calibration:
    """A configuration and how it came about.

    Attributes:
        config: what was found; `sensors.*.latency_s` is what was known of their clocks and what was found.
        lags: how late each sensor's times were found to be, beyond what the base knew.
        even_scores: what scores mean, sensor by sensor; empty without truth.
        lasting_errors: what boxes are off as long as they show one object, of several sensors; empty of one,
            and without truth.
    """

    config: Config
    lags: tuple[Lag, ...]
    even_scores: tuple[MeasuredSetting, ...] = ()
    lasting_errors: tuple[MeasuredSetting, ...] = ()


def calibrate_with_truth(
    recordings: Sequence[Recording],
    base: Config,
    *,
    tuned: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Calibrate from recordings with truth.

    Args:
        recordings: detections, with the latencies that `base` knows taken off their times, and truth.
        base: configuration to begin with.
        tuned: track the recordings, and keep what was measured of a sensor only where that is no worse.
        progress: called with the name of each setting that was judged.

    Raises:
        DataError: too little that matches.
    """
    base = fit_input(base, *(detections for detections, _ in recordings))[0]
    lags = settled(
        lambda known: _lags_with_truth(_on_time(recordings, known), base),
        with_progress(range(_ROUNDS), 2 * _ROUNDS),
    )
    # Each sensor by its own lag, early ones too: the truth stays where it is.
    pairs = _on_time(recordings, found_lags(lags))
    trial = _Trial(pairs, base, tuned, progress)
    scores = trial.measure("even_score", lambda matched: even_score(matched.score, matched.correct))
    errors: tuple[MeasuredSetting, ...] = ()
    if len(base.sensors) > 1:
        errors = trial.measure("lasting_error", lambda matched: lasting_error(matched, ModelConstants()))
    return Calibration(with_lags(trial.config, lags), tuple(lags), scores, errors)


def calibrate_without_truth(recordings: Sequence[Detections], base: Config) -> Calibration:
    """Calibrate from recordings alone: which sensors there are, their rates and their clocks.

    What their boxes are worth the tracker learns while it runs; confirmed tracks are no truth to learn it
    from beforehand.

    Args:
        recordings: detections, with the latencies that `base` knows taken off their times.
        base: configuration to begin with.

    Raises:
        DataError: no detection at all.
    """
    if not any(len(detections) for detections in recordings):
        raise DataError("the recordings hold no detection")
    base = fit_input(base, *recordings)[0]

    def find(known: Mapping[str, float]) -> list[Lag]:
        periods = [1.0 / base.sensors[name].rate_hz for name in base.sensor_names]
        try:
            tracked = follow([taken_off(detections, known) for detections in recordings], base)
        except DataError:
            return []
        return lags_between(tracked, base.sensor_names, periods)

    lags = settled(find, with_progress(range(_ROUNDS)))
    config = base
    if found_lags(lags):
        config = earliest_on_time(with_lags(config, lags))
    return Calibration(config, tuple(lags))


def _on_time(recordings: Sequence[Recording], late_s: Mapping[str, float]) -> list[Recording]:
    return [(taken_off(detections, late_s), truth) for detections, truth in recordings]


def _matches(recordings: Sequence[Recording], base: Config, name: str) -> SensorMatches | None:
    """Pool the matches of one sensor over the recordings that have it."""
    found = [
        match_sensor(detections, truth, name, k).only_whole(own_picture(base, detections).image)
        for k, (detections, truth) in enumerate(recordings)
        if name in detections.sensors
    ]
    return SensorMatches.pool(found) if found else None


def _lags_with_truth(recordings: Sequence[Recording], base: Config) -> list[Lag]:
    matches = {name: _matches(recordings, base, name) for name in base.sensor_names}
    known = {name: found for name, found in matches.items() if found is not None}
    return lags_from_truth(known, {name: 1.0 / base.sensors[name].rate_hz for name in known})


def _accuracy(recordings: Sequence[Recording], config: Config) -> float:
    """(MOTA + IDF1 + HOTA) / 3 of causal tracks (per cent), pooled."""
    pairs = [(truth, track(own_picture(config, detections), detections)) for detections, truth in recordings]
    instants = [np.unique(detections.scan_t) for detections, _ in recordings]
    scores = evaluate(pairs, kind="causal", instants=instants)
    return float(scores.MOTA + scores.IDF1 + scores.HOTA) / 3.0


class _Trial:
    """Settings of sensors, measured one after the other and kept where they do no harm.

    Args:
        recordings: detections, by the common clock, and truth.
        config: to begin with; later with what was kept.
        tuned: whether the recordings are tracked for that.
        progress: called with the name of each setting that was judged.
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        config: Config,
        tuned: bool,
        progress: Callable[[str], None] | None,
    ) -> None:
        self._recordings, self._tuned, self._progress = recordings, tuned, progress
        self.config = config
        self._before = _accuracy(recordings, config) if tuned else None

    def measure(
        self, key: str, measured: Callable[[SensorMatches], float | None]
    ) -> tuple[MeasuredSetting, ...]:
        """Measure a setting of each sensor by its boxes that match the truth."""
        return tuple(self._one(name, key, measured) for name in self.config.sensor_names)

    def _one(self, name: str, key: str, measured: Callable[[SensorMatches], float | None]) -> MeasuredSetting:
        matched, before = _matches(self._recordings, self.config, name), self._before
        value = None if matched is None else measured(matched)
        if value is None:
            return MeasuredSetting(name, None, before, None, False)
        value = float(f"{value:.{_DIGITS}g}")
        given: dict[str, Any] = {key: value}
        changed = {**self.config.sensors, name: replace(self.config.sensors[name], **given)}
        config = replace(self.config, sensors=changed)
        after = _accuracy(self._recordings, config) if self._tuned else None
        kept = before is None or after is None or after >= before
        if kept:
            self.config, self._before = config, after
        if self._progress is not None:
            self._progress(f"sensors.{name}.{key}")
        return MeasuredSetting(name, value, before, after, kept)
