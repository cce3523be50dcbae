"""A configuration fits itself to a recording: undeclared sensors, their rates, the picture's size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config, SensorConfig
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.rates import median_rate_hz

# A clock that differs more than this from the declared one is another clock.
_SAME_RATE = 1.1
# A box tells how far the picture reaches if so many boxes, itself among them, reach at least half as far.
# Of few boxes none is taken for wild.
_NEAR, _COMPANY, _COMPANY_SHARE, _FEW = 0.5, 3, 5e-4, 10
# Left and width are each rounded where boxes are written, and their sum may lie that far outside the picture.
_ROUNDING_PX = 0.05
# So many boxes that end within so little of each other (px), and begin at places that differ by more, are cut
# by the picture's edge, and no parked vehicle.
_PILE, _PILE_PX, _BEGIN_PX = 5, 0.5, 10.0
# Edges of two recordings that are as near to each other (px) are those of pictures of one size.
_SAME_EDGE_PX = 2.0
# Fewer scans do not tell a clock.
LEAST_SCANS = 3


def fit_input(config: Config, *recordings: Detections) -> tuple[Config, list[str]]:
    """Declare what a configuration leaves open (`config.input`) by what is seen in recordings.

    Args:
        config: with `input.undeclared` or `input.picture` set, or neither: then it comes back as it is.
        recordings: the whole of each; their times have nothing to do with each other's.

    Returns:
        The configuration for these recordings, and a line for each thing that was found.
    """
    notes: list[str] = []
    if config.input.undeclared == "declare" and any(d.num_scans for d in recordings):
        config, notes = _declare_sensors(config, recordings)
    if config.input.picture == "seen" and any(len(d) for d in recordings):
        config = fit_picture(config, recordings)
        notes.append(
            f"the picture is taken for {config.image.width:g} x {config.image.height:g} px, as far as the "
            "boxes reach "
            "(--image WxH says otherwise)"
        )
    return config, notes


def fit_picture(config: Config, recordings: Sequence[Detections]) -> Config:
    """Let the picture reach as far as the boxes of some recordings do (whole px).

    Where several have pictures of different sizes it stays to be seen of each (`input.picture`); until then
    it is the largest.
    """
    filled = [d.boxes for d in recordings if len(d)]
    if not filled:
        return config
    reach = np.concatenate([boxes[:, :2] + boxes[:, 2:] for boxes in filled])
    sides = [max(math.ceil(_farthest(v) - _ROUNDING_PX), 1) for v in reach.T]
    fitted = as_config(config, (sides[0], sides[1]))
    differ = any(_ends_before(boxes[:, k], boxes[:, 2 + k], sides[k]) for boxes in filled for k in range(2))
    return replace(fitted, input=replace(fitted.input, picture="seen")) if differ else fitted


def own_picture(config: Config, recording: Detections) -> Config:
    """Fit the picture to one recording, if its size is still to be seen (`input.picture`)."""
    return fit_picture(config, [recording]) if config.input.picture == "seen" else config


def _ends_before(begin: FloatArray, side: FloatArray, size: float) -> bool:
    """Whether boxes (N,) pile up at an edge that lies before the end of a picture of some size."""
    reach = begin + side
    edge = _farthest(reach)
    piled = begin[np.abs(reach - edge) <= _PILE_PX]
    return edge < size - _SAME_EDGE_PX and len(piled) >= _PILE and bool(np.ptp(piled) > _BEGIN_PX)


def _farthest(reach: FloatArray) -> float:
    """How far boxes reach (N,), but for a few wild ones: those that hardly any other comes near."""
    reach = np.sort(reach)
    if len(reach) < _FEW:
        return float(reach[-1])
    near = len(reach) - np.searchsorted(reach, reach - (1.0 - _NEAR) * np.abs(reach))
    return float(reach[near >= max(_COMPANY, _COMPANY_SHARE * len(reach))][-1])


def _declare_sensors(config: Config, recordings: Sequence[Detections]) -> tuple[Config, list[str]]:
    notes: list[str] = []
    sensors: dict[str, SensorConfig] = {}
    for name in sorted({name for d in recordings for name in d.sensors}):
        known = config.sensors.get(name)
        sensor = SensorConfig() if known is None else known
        rate = scan_rate_hz(recordings, name)
        other = rate is not None and not 1.0 / _SAME_RATE < rate / sensor.rate_hz < _SAME_RATE
        if rate is not None and (known is None or other):
            sensor = replace(sensor, rate_hz=rate)
        if known is None:
            found = "its scans are too few to tell a rate" if rate is None else f"it scans at {rate:.3g} Hz"
            notes.append(f"sensor {name!r} is not declared: taken for a detector; {found}")
        elif other:
            # A rate that is the default may be one that nobody stated.
            stated = "" if known.rate_hz == SensorConfig().rate_hz else f", not at {known.rate_hz:g}"
            notes.append(f"sensor {name!r} scans at {rate:.3g} Hz{stated}")
        sensors[name] = sensor
    if config.sensors and sensors and not sensors.keys() & config.sensors.keys():
        idle, seen = (", ".join(repr(name) for name in sorted(names)) for names in (config.sensors, sensors))
        notes.append(f"warning: what the configuration says of {idle} has no effect: the sensors are {seen}")
    return replace(config, sensors=sensors), notes


def scan_rate_hz(recordings: Sequence[Detections], sensor: str) -> float | None:
    """Rate (Hz) of a sensor's clock, or None if its scans are too few to judge it by.

    Args:
        recordings: some of them with this sensor, each with times of its own.
        sensor: its name.
    """
    clocks = [d.sensor_times(sensor) for d in recordings if sensor in d.sensors]
    rate = median_rate_hz(*clocks) if sum(map(len, clocks)) >= LEAST_SCANS else None
    return None if rate is None else round(rate, 6)
