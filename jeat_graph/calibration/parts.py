"""Which parts of a calibration are kept: those that win on recordings they were not estimated from.

Matched detections give noise, reliability, motion and births that describe the recordings; whether a tracker
does better with them is another question, and a tracker that learns its sensors while it runs often does not.
Each half of the recordings is tracked with what the other half gives, and with the base. Where all parts
together do better than the base they are kept, but for those (say, the births) without which it goes better
still; else the base stays, but for those with which it does better.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from jeat_graph.calibration.cuts import folds, shorten
from jeat_graph.calibration.supervised import MatchedSensors, Recording, measure_sensors, with_sensors
from jeat_graph.calibration.verdict import Verdict, better, judge, scene_error
from jeat_graph.config.schema import Config
from jeat_graph.data.errors import DataError

_CENTRE, _SIZE, _BIRTHS = "noise and motion", "noise and growth of the size", "births"
_RELIABILITY = "reliability"
#: Estimates of a sensor that are kept, or go back to the base's, together.
SENSOR_PARTS = {
    _CENTRE: (
        "sigma_px",
        "rho_x",
        "rho_y",
        "rho_size",
        "correlated_share",
        "memory_s",
        "bias",
        "bias_std",
    ),
    _SIZE: ("sigma_log_width", "sigma_log_height"),
    "noise by score": ("score_noise",),
    _RELIABILITY: ("p_detect", "clutter_per_scan", "precision", "score_precision", "blind_speed"),
}
#: The parts, in the order in which they are tried.
PARTS = (*SENSOR_PARTS, _BIRTHS)
# What a change must gain (per cent) to be made: less is chance.
_LEAST_GAIN = 0.2


@dataclass(frozen=True)
class PartChoice:
    """What was decided of one part.

    Attributes:
        part: one of `PARTS`, or another name of what was estimated.
        kept: whether the calibrated values are kept.
        gain: what they gain over the base's on recordings that they were not estimated from, with the parts
            kept so far: (MOTA + IDF1 + HOTA) / 3 (per cent); 0 where that cannot be told.
    """

    part: str
    kept: bool
    gain: float


def with_parts(measured: MatchedSensors, parts: Sequence[str]) -> Config:
    """Take some parts of what was estimated and all else of the base.

    What only means something together stays together: motion is whatever noise does not explain, so large
    errors with the motion that was fitted to small ones, or the other way round, describe nothing.

    Args:
        measured: what matched detections say; its base declares what is assumed of the sensors (one that it
            does not declare is as measured).
        parts: some of `PARTS`.
    """
    base = measured.base
    if base is None:
        raise ValueError("there is no base to take parts of")
    sensors = dict(measured.sensors)
    for part, names in SENSOR_PARTS.items():
        if part not in parts:
            sensors = {
                name: replace(s, **{f: getattr(base.sensors[name], f) for f in names})
                if name in base.sensors
                else s
                for name, s in sensors.items()
            }
    if _RELIABILITY in parts:
        # What tracking taught of scores was learnt of what the base takes them to mean.
        sensors = {name: replace(s, learnt=None) for name, s in sensors.items()}
    out = with_sensors(measured, sensors)
    if _SIZE not in parts:
        out = replace(out, size=base.size)
    if _CENTRE not in parts:
        out = replace(out, motion=base.motion)
    if _BIRTHS not in parts:
        out = replace(out, birth=base.birth)
    return out


def choose_parts(
    recordings: Sequence[Recording],
    base: Config,
    *,
    max_scans: int = 6000,
    progress: Callable[[str], None] | None = None,
) -> tuple[Config, tuple[PartChoice, ...]]:
    """Calibrate, and keep of it what does not do worse than the base on recordings left out.

    Args:
        recordings: detections and truth.
        base: configuration to begin with; declares what is assumed of the sensors.
        max_scans: about so many scans are tracked for each decision.
        progress: called with the name of each part when it is decided.

    Returns:
        The configuration, and what was decided of each part. Where a half is too small to be calibrated from,
        nothing can be held against the base, and it stays.

    Raises:
        DataError: as `supervised.calibrate`.
    """
    whole = measure_sensors(recordings, base)
    parts = folds(shorten(recordings, max_scans))
    unknown = tuple(PartChoice(part, False, 0.0) for part in PARTS)
    if len(parts) < 2:
        return with_parts(whole, ()), unknown
    try:
        halves = [measure_sensors(other, base) for other in reversed(parts)]
        scatter = scene_error(recordings)
        kept, choices = _choose(
            lambda some: replace(
                judge([with_parts(half, some) for half in halves], parts), scene_error=scatter
            ),
            progress or (lambda _: None),
        )
    except DataError:
        return with_parts(whole, ()), unknown
    return with_parts(whole, kept), choices


def _choose(
    verdict: Callable[[Sequence[str]], Verdict], progress: Callable[[str], None]
) -> tuple[list[str], tuple[PartChoice, ...]]:
    """Choose parts: leave some out of all where all together beat the base, else add some to none."""
    now, every = verdict(()), verdict(PARTS)
    kept: list[str] = []
    if better(every, now, _LEAST_GAIN):
        kept, now = list(PARTS), every
    choices = []
    for part in PARTS:
        turned = [one for one in PARTS if (one in kept) != (one == part)]
        other = verdict(turned)
        gain = (other.mean - now.mean) * (1.0 if part in turned else -1.0)
        if better(other, now, _LEAST_GAIN):
            kept, now = turned, other
        choices.append(PartChoice(part, part in kept, gain))
        progress(part)
    return kept, tuple(choices)
