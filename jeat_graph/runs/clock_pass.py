"""A pass over a recording before it is tracked: do the clocks of its sensors differ?

To a tracker only differences matter. The earliest sensor is taken for right and all others for late, as a
detector gives its boxes late rather than early.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jeat_graph.config.schema import Config, SensorConfig
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.in_steps import run_through
from jeat_graph.runs.clock_comparison import (
    FoundClock,
    compare_in_steps,
    summary_of,
    taken_off_each,
    unsure_of,
)
from jeat_graph.runs.latency import taken_off

# Lags of one sensor in several recordings are one where they differ by no more (s).
_SAME_LAG_S = 0.02


def find_clocks(
    detections: Detections, config: Config, names: str
) -> tuple[Detections, dict[str, dict[str, float]], list[str]]:
    """Find sensors whose clocks differ, and bring them together.

    Args:
        detections: a recording whose boxes are in one picture.
        config: `input.clocks` says whether to look; a sensor whose `latency_s` is set is left as it is.
        names: what the user calls the recording.

    Returns:
        The recording; by sensor `lag_s` and `std_s` of what was taken off; and a line for each thing that is
        to be reported.

    Raises:
        DataError: two sensors see the same part of the picture and contradict each other.
    """
    wanted = [name for name in detections.sensors if not _is_set(config, name)]
    if config.input.clocks != "find" or len(wanted) < 2:
        return detections, {}, []
    counts = np.bincount(detections.box_sensor, minlength=len(detections.sensors))
    reference = max(wanted, key=lambda name: counts[detections.sensors.index(name)])
    first = detections.select(reference)
    ahead: dict[str, FoundClock] = {}
    lines: list[str] = []
    for name in wanted:
        if name == reference:
            continue
        compared = run_through(compare_in_steps(first, detections.select(name), (reference, name)))
        if compared.contradiction:
            raise DataError(compared.contradiction, names)
        if compared.differ is not None and compared.differ.sure:
            ahead[name] = compared.differ
        elif compared.differ is not None:
            lines.append(unsure_of(name, reference, compared.differ))
    if not ahead:
        return detections, {}, lines
    taken = taken_off_each(wanted, ahead)
    lines += [summary_of(name, one.lag_s, one.std_s) for name, one in taken.items()]
    record = {name: {"lag_s": one.lag_s, "std_s": one.std_s} for name, one in taken.items()}
    return taken_off(detections, {name: one.lag_s for name, one in taken.items()}), record, lines


def with_clocks(
    recordings: Sequence[Detections], config: Config, names: Sequence[str]
) -> tuple[Config, list[str]]:
    """Find the clocks of several recordings of one set of sensors, and write them into a configuration.

    Args:
        recordings: each with its own times.
        config: as `find_clocks`.
        names: what the user calls the recordings.

    Returns:
        The configuration, with `latency_s` of the sensors that are late in all recordings by the same; and a
        line for each thing to be reported.

    Raises:
        DataError: as `find_clocks`.
    """
    found: dict[str, list[float]] = {}
    lines: list[str] = []
    for recording, name in zip(recordings, names, strict=True):
        _, taken, notes = find_clocks(recording, config, name)
        lines += notes
        for sensor in recording.sensors:
            found.setdefault(sensor, []).append(taken.get(sensor, {}).get("lag_s", 0.0))
    sensors = dict(config.sensors)
    for sensor, lags in found.items():
        if not any(lags):
            continue
        if max(lags) - min(lags) > _SAME_LAG_S:
            lines.append(
                f"sensor {sensor!r}: its clock is late by {min(lags):.3f} to {max(lags):.3f} s, not by the "
                "same in all recordings: that is no setting of the sensor, and left out"
            )
            continue
        known = sensors.get(sensor, SensorConfig())
        sensors[sensor] = replace(known, latency_s=round(float(np.median(lags)), 4))
    return replace(config, sensors=sensors), lines


def _is_set(config: Config, name: str) -> bool:
    return name in config.sensors and config.sensors[name].latency_s != 0.0
