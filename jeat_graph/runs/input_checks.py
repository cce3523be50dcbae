"""Do these detections fit this configuration? What does not is reported before the tracker starts."""

from __future__ import annotations

import difflib

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError, UnknownSensorError
from jeat_graph.io.tables.time_units import LONGEST_STEP_S, unit_question
from jeat_graph.runs.clocks import check_clocks, wrong_times
from jeat_graph.runs.declaring import LEAST_SCANS, scan_rate_hz
from jeat_graph.tracking.input_watch import CORNERS, SHARES, look_like_corners, look_like_shares

# Detectors guess what the picture cuts off, so that a tenth or two of the centres may lie outside. Where more
# of them do, the picture is most likely another.
MOST_OUTSIDE = 0.5
# So many outside are worth a question, whether they are corners taken for sizes.
MANY_OUTSIDE = 0.05
# A clock that differs this much from the declared one is worth a word: rates decide about clutter and misses.
RATE_FACTOR = 1.5


def check_detections(detections: Detections, config: Config, names: str = "the detections") -> list[str]:
    """Check a recording against the configuration that shall track it.

    Args:
        detections: the recording.
        config: the configuration.
        names: what the user calls the recording, for messages.

    Returns:
        Warnings, each one line.

    Raises:
        DataError: there is no scan at all, the times are not in seconds, the boxes are shares of the picture
            or two corners each, or sensors have different clocks.
        UnknownSensorError: a sensor that the configuration does not declare.
    """
    if not detections.num_scans:
        raise DataError(
            "no scans: a recording needs at least one row, with t and sensor if nothing was found", names
        )
    clocks = check_units(detections, config, names)
    _check_sensors(detections, config, names)
    warnings = [] if len(detections) else [f"{names}: all scans are empty, so there is nothing to track"]
    if detections.dropped:
        warnings.append(f"{names}: {detections.dropped} box(es) without area left out")
    warnings += clocks + wrong_times(detections, names)
    return warnings + _check_picture(detections, config, names) + _check_rates(detections, config, names)


def _check_sensors(detections: Detections, config: Config, names: str) -> None:
    unknown = [name for name in detections.sensors if name not in config.sensors]
    if not unknown:
        return
    near = difflib.get_close_matches(unknown[0], config.sensor_names, 1)
    settings = []
    for name in unknown:
        rate = scan_rate_hz([detections], name)
        setting = "rate_hz: 20" if rate is None else f"rate_hz: {rate:.3g}"
        settings.append(f"--set 'sensors.{name}={{{setting}}}'")
    several = (
        f"sensors {', '.join(map(repr, unknown))} are" if len(unknown) > 1 else f"sensor {unknown[0]!r} is"
    )
    raise UnknownSensorError(
        f"{names}: {several} not declared (declared: {', '.join(config.sensor_names) or 'none'})"
        + (f"; did you mean {near[0]!r}?" if near else ";")
        + f" declare with {' '.join(settings)} or in a file from `jeat-graph calibrate`,"
        + " take any sensor with --set input.undeclared=declare, or rename it with NAME=path"
    )


def check_units(detections: Detections, config: Config, names: str) -> list[str]:
    """Refuse boxes in shares of the picture, times that cannot be seconds, and sensors of different clocks.

    Times are believed where the sensor is declared to be as slow, or as fast, as that.

    Returns:
        Warnings of sensors that never look at one time, each one line.

    Raises:
        DataError: says what seems to be the unit, or how far the clocks are apart.
    """
    if look_like_shares(detections.boxes):
        raise DataError(
            f"{SHARES}; multiply left and width by its width, top and height by its height", names
        )
    for name in detections.sensors:
        times = np.unique(detections.sensor_times(name))
        step = float(np.median(np.diff(times))) if len(times) >= LEAST_SCANS else 0.0
        question = unit_question(step)
        steps = config.sensors[name].rate_hz * step if name in config.sensors else float("nan")
        long = step >= LONGEST_STEP_S
        if question and not (steps < RATE_FACTOR if long else steps > 1.0 / RATE_FACTOR):
            raise DataError(
                f"sensor {name!r} has a {question}; or, if it is so {'slow' if long else 'fast'}, "
                f"--set sensors.{name}.rate_hz={1.0 / step:.3g}",
                names,
            )
    return check_clocks(detections, config, names)


def _check_picture(detections: Detections, config: Config, names: str) -> list[str]:
    boxes, width, height = detections.boxes, config.image.width, config.image.height
    if not len(boxes):
        return []
    centre = boxes[:, :2] + 0.5 * boxes[:, 2:]
    outside = (centre < 0.0).any(axis=1) | (centre[:, 0] > width) | (centre[:, 1] > height)
    count, total = int(outside.sum()), len(boxes)
    if not count:
        return []
    if count > MANY_OUTSIDE * total and look_like_corners(boxes, width, height):
        raise DataError(f"{names}: {CORNERS}")
    low, high = centre.min(axis=0), centre.max(axis=0)
    beyond = float(max((-low).max(), (high - (width, height)).max()))
    found = (
        f"{names}: {count} of {total} box centres lie outside the picture of {width:g} x {height:g} px, "
        f"up to {beyond:.0f} px beyond its edge (they reach from {low[0]:.0f}, {low[1]:.0f} to "
        f"{high[0]:.0f}, {high[1]:.0f})"
    )
    if count > MOST_OUTSIDE * total:
        found += "; if the picture has another size, give it: --image WIDTHxHEIGHT (in Python image=)"
    return [found]


def _check_rates(detections: Detections, config: Config, names: str) -> list[str]:
    warnings = []
    for name in detections.sensors:
        rate, declared = scan_rate_hz([detections], name), config.sensors[name].rate_hz
        if rate is not None and not 1.0 / RATE_FACTOR < rate / declared < RATE_FACTOR:
            warnings.append(
                f"{names}: sensor {name!r} scans at {rate:.3g} Hz, but is declared with {declared:g} Hz "
                f"(--set sensors.{name}.rate_hz={rate:.3g})"
            )
    return warnings
