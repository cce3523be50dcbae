"""Calibration from beginning to end: clocks, estimates, what of them is kept, and what tracking chooses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from jeat_graph.calibration.cuts import folds, shorten
from jeat_graph.calibration.learning import LEARNT, choose_learnt, learn_sensors, without_learnt
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
from jeat_graph.calibration.parts import PARTS, PartChoice, choose_parts
from jeat_graph.calibration.score_fit import SCORE_FIT, choose_score_fit, measure_score_fit
from jeat_graph.calibration.supervised import Recording, calibrate
from jeat_graph.calibration.tracked import follow
from jeat_graph.calibration.tune import Choice, tune, tuned_settings
from jeat_graph.calibration.verdict import judge
from jeat_graph.calibration.written_variances import measure_written_variances
from jeat_graph.config.schema import Config, InputConfig
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import with_progress
from jeat_graph.runs.declaring import fit_input, own_picture
from jeat_graph.runs.latency import taken_off

# How often lags are looked for, each time in what those found before leave.
_ROUNDS = 4
_PASSES = 2
# About so many scans are tracked to measure what is written.
_SCANS = 6000
POSITION_SCALE, LASTING_ERROR = "output.position_scale", "output.lasting_error"


@dataclass(frozen=True)
class Calibration:
    """A configuration and how it came about.

    Attributes:
        config: what was found; `sensors.*.latency_s` is what was known of their clocks and what was found.
        lags: how late each sensor's times were found to be, beyond what the base knew.
        parts: which parts of the estimates are kept; empty without truth.
        choices: what was chosen by tracking.
    """

    config: Config
    lags: tuple[Lag, ...]
    parts: tuple[PartChoice, ...] = ()
    choices: tuple[Choice, ...] = ()


def steps_with_truth(config: Config) -> int:
    """How often `calibrate_with_truth` calls its `progress` at most."""
    return len(PARTS) + _PASSES * len(tuned_settings(config)) + 3


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
        tuned: also choose by tracking what the estimates are good for, and what they cannot tell.
        progress: called with the name of each thing decided by tracking.

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
    short = shorten(pairs, _SCANS)
    if not tuned:
        config = measure_score_fit(calibrate(pairs, base), short)
        config = measure_written_variances(config, short, base.output)
        return Calibration(with_lags(config, lags), tuple(lags))
    # First of all what the tracker learns without being told: estimates have to do better than that.
    base, learnt = choose_learnt(base, short)
    if progress is not None:
        progress(LEARNT)
    config, parts = choose_parts(pairs, base, progress=progress)
    config, choices = tune(config, pairs, passes=_PASSES, progress=progress)
    config, fits = choose_score_fit(config, short)
    if fits is not None:
        parts = (*parts, fits)
    if progress is not None:
        progress(SCORE_FIT)
    if learnt is not None:
        parts = (learnt, *parts)
        if learnt.kept:
            config = learn_sensors([detections for detections, _ in short], without_learnt(config))
    config = measure_written_variances(config, short, base.output)
    halves = folds(short)
    score = judge([config] * len(halves), halves).mean
    choices = (
        *choices,
        Choice(POSITION_SCALE, config.output.position_scale, score),
        Choice(LASTING_ERROR, config.output.lasting_error, score),
    )
    if progress is not None:
        progress(POSITION_SCALE)
    return Calibration(with_lags(config, lags), tuple(lags), parts, choices)


def calibrate_without_truth(recordings: Sequence[Detections], base: Config) -> Calibration:
    """Calibrate from recordings alone: which sensors there are, their rates, clocks and worth.

    Confirmed tracks could stand in for truth, and say how many boxes are false, how many vehicles are missed
    and how large the errors are. Of real recordings they say it wrongly (tracks are confirmed on false boxes
    that repeat, and errors that last look like motion), and configurations that believed any of it tracked
    worse than the base: half a point to ten of IDF1. All of that the tracker learns while it runs. What it
    learns of how far scores and sensors are to be believed is taken along (`learning`), if there are several:
    of six detectors by themselves two tracked worse with it (.5 and .9 MOTA), and their mean gained nothing.

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
    association = replace(base.association, priority=())
    config = replace(base, association=association, input=InputConfig(picture=base.input.picture))
    late_s = found_lags(lags)
    looked = {name for detections in recordings for name in detections.sensors}
    # What a sensor says of itself while it is alone, nobody bears out.
    if len(looked) > 1 and config.lifecycle.judges_worth:
        config = learn_sensors([taken_off(detections, late_s) for detections in recordings], config)
    if late_s:
        config = earliest_on_time(with_lags(config, lags))
    return Calibration(config, tuple(lags))


def _on_time(recordings: Sequence[Recording], late_s: Mapping[str, float]) -> list[Recording]:
    return [(taken_off(detections, late_s), truth) for detections, truth in recordings]


def _lags_with_truth(recordings: Sequence[Recording], base: Config) -> list[Lag]:
    matches = {}
    for name in base.sensor_names:
        found = [
            match_sensor(detections, truth, name, k).only_whole(own_picture(base, detections).image)
            for k, (detections, truth) in enumerate(recordings)
            if name in detections.sensors
        ]
        if found:
            matches[name] = SensorMatches.pool(found)
    return lags_from_truth(matches, {name: 1.0 / base.sensors[name].rate_hz for name in matches})
