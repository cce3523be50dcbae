"""Draws the times of a sensor's scans: rate, jitter, dropped scans and bursts of empty ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import BoolArray, FloatArray

_TICK_S = 1e-6


@dataclass(frozen=True)
class TimingConfig:
    """Clock of one sensor."""

    rate_hz: float = number(20.0, "Hz", "nominal rate", open_low=True)
    phase_s: float = number(0.0, "s", "time of the first scan")
    jitter_s: float = number(0.0005, "s", "std of the capture time about the nominal one")
    drop_probability: float = number(0.002, "1", "share of scans that never arrive", 0.0, 0.9)
    blank_rate_hz: float = number(0.03, "1/s", "how often a burst of scans that find nothing begins")
    blank_duration_s: float = number(0.1, "s", "mean length of such a burst", open_low=True)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, eq=False)
class Clock:
    """Scans of one sensor.

    Attributes:
        times: (K,) capture times (s), ascending, whole microseconds.
        dropped: (K,) true where the scan never arrives.
        blank: (K,) true where the scan arrives without a single box.
    """

    times: FloatArray
    dropped: BoolArray
    blank: BoolArray


def run_clock(rng: np.random.Generator, config: TimingConfig, duration_s: float) -> Clock:
    """Draw the scans of one sensor in [0, duration_s).

    Jitter is cut off at 0.4 periods, so that scans keep their order.
    """
    period = 1.0 / config.rate_hz
    nominal = np.arange(config.phase_s, duration_s - 1e-9, period)
    jitter = np.clip(rng.normal(0.0, 1.0, len(nominal)) * config.jitter_s, -0.4 * period, 0.4 * period)
    times = np.maximum(np.round((nominal + jitter) / _TICK_S) * _TICK_S, 0.0).round(6)
    dropped = rng.random(len(nominal)) < config.drop_probability
    blank = np.zeros(len(nominal), dtype=bool)
    starts = rng.uniform(0.0, duration_s, rng.poisson(config.blank_rate_hz * duration_s))
    for start, length in zip(starts, rng.exponential(config.blank_duration_s, len(starts)), strict=True):
        blank |= (times >= start) & (times < start + length)
    return Clock(times, dropped, blank)
