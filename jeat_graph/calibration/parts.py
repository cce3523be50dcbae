"""Which parts of a calibration are kept: those that win on recordings they were not estimated from.

Matched detections give noise, reliability, motion and births that describe the recordings; whether a tracker
does better with them is another question. Each half of the recordings is tracked with what the other half
gives, and a part (say, the motion) for which the base configuration's own values do better there goes back to
them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.calibration.supervised import calibrate
from jeat_graph.calibration.tune import Recording, folds, shorten, tracking_score
from jeat_graph.config.schema import Config
from jeat_graph.data.errors import DataError

_SENSOR_PARTS = {
    "noise of the centre": (
        "sigma_px",
        "rho_x",
        "rho_y",
        "rho_size",
        "correlated_share",
        "memory_s",
        "bias",
    ),
    "noise of the size": ("sigma_log_width", "sigma_log_height"),
    "reliability": ("p_detect", "clutter_per_scan", "precision", "score_precision", "blind_speed"),
}
#: The parts, in the order in which they are tried.
PARTS = (*_SENSOR_PARTS, "motion", "births")
# A part goes only where the base does better by more than this (per cent): less is chance.
_LEAST_GAIN = 0.2


@dataclass(frozen=True)
class PartChoice:
    """What was decided of one part.

    Attributes:
        part: one of `PARTS`.
        kept: whether the calibrated values are kept.
        gain: what they gain over the base's on recordings that they were not estimated from, with the parts
            kept so far: (MOTA + IDF1 + HOTA) / 3 (per cent).
    """

    part: str
    kept: bool
    gain: float


def with_parts(base: Config, calibrated: Config, parts: Sequence[str]) -> Config:
    """Take some parts of a calibrated configuration and all else of the base.

    Args:
        base: the configuration that the calibration began with; a sensor that it does not declare is the
            calibrated one.
        calibrated: declares the sensors.
        parts: some of `PARTS`.
    """
    out = calibrated
    for part, names in _SENSOR_PARTS.items():
        if part not in parts:
            sensors = {
                name: replace(s, **{f: getattr(base.sensors[name], f) for f in names})
                if name in base.sensors
                else s
                for name, s in out.sensors.items()
            }
            out = replace(out, sensors=sensors)
    if "motion" not in parts:
        out = replace(out, motion=base.motion, size=base.size)
    if "births" not in parts:
        out = replace(out, birth=base.birth)
    return out


def choose_parts(
    recordings: Sequence[Recording],
    base: Config,
    *,
    max_scans: int = 6000,
    progress: Callable[[str], None] | None = None,
) -> tuple[Config, tuple[PartChoice, ...]]:
    """Calibrate, and keep of it what does better than the base on recordings left out.

    Args:
        recordings: detections and truth.
        base: configuration to begin with; declares what is assumed of the sensors.
        max_scans: about so many scans are tracked for each decision.
        progress: called with the name of each part when it is decided.

    Returns:
        The configuration, and what was decided of each part; of none where a half is too small to be
        calibrated from.

    Raises:
        DataError: as `supervised.calibrate`.
    """
    whole = calibrate(recordings, base)
    parts = folds(shorten(recordings, max_scans))
    try:
        halves = [calibrate(other, base) for other in reversed(parts)] if len(parts) == 2 else []
    except DataError:
        halves = []
    if not halves:
        return whole, ()

    def score(kept: Sequence[str]) -> float:
        found = [
            tracking_score(with_parts(base, half, kept), mine)
            for half, mine in zip(halves, parts, strict=True)
        ]
        return float(np.mean(found))

    kept, now = list(PARTS), score(PARTS)
    choices = []
    for part in PARTS:
        without = [one for one in kept if one != part]
        other = score(without)
        gain = now - other
        if gain < -_LEAST_GAIN:
            kept, now = without, other
        choices.append(PartChoice(part, part in kept, gain))
        if progress is not None:
            progress(part)
    return with_parts(base, whole, kept), tuple(choices)
