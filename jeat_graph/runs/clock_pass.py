"""A pass over a recording before it is tracked: do the clocks of its sensors differ?

To a tracker only differences matter. The earliest sensor is taken for right and all others for late, as a
detector gives its boxes late rather than early.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jeat_graph.config.schema import Config, SensorConfig
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.data.time_text import exact_text
from jeat_graph.rig.agreement import Agreement, best_agreement
from jeat_graph.rig.registering import clock_by_map
from jeat_graph.rig.sensor_tracks import SensorTracks
from jeat_graph.runs.latency import taken_off
from jeat_graph.runs.own_tracks import own_tracks

# Boxes must agree better than as the times are by this much, and this many times as much as usual.
_BETTER, _CLEAR = 0.08, 2.5
# So many vehicles must agree, and the offset be so many standard deviations, for it to be taken off.
_LEAST_VEHICLES, _SIGNIFICANT = 5, 4.0
#: Smaller offsets move no box by more than its noise (s).
LEAST_S = 0.02
# Lags of one sensor in several recordings are one where they differ by no more (s).
_SAME_LAG_S = 0.02
# That much of a recording is looked at for the exact offset (s): a tracker needs a few seconds for it.
_LOOKED_AT_S = 90.0
# Sensors contradict each other where each sees so many vehicles drive, most of them where the other one sees
# some, and their boxes agree at no difference of the clocks.
_MANY, _SAME_PLACES, _NEVER = 10, 0.6, 0.08
# Places are told apart by so many columns and rows.
_PLACES = 24


class _FoundClock(NamedTuple):
    """What was found of one sensor's clock: seconds ahead, standard deviation, whether it is taken off."""

    lag_s: float
    std_s: float
    sure: bool


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
        to be said.

    Raises:
        DataError: two sensors see the same part of the picture and contradict each other.
    """
    wanted = [name for name in detections.sensors if not _is_set(config, name)]
    if config.input.clocks != "find" or len(wanted) < 2:
        return detections, {}, []
    counts = {name: int(_boxes_of(detections, name).shape[0]) for name in wanted}
    reference = max(wanted, key=lambda name: counts[name])
    first = detections.select(reference)
    ahead: dict[str, _FoundClock] = {}
    lines: list[str] = []
    for name in wanted:
        if name == reference:
            continue
        second = detections.select(name)
        agreed = best_agreement(first, second)
        if agreed is None:
            continue
        if not _differ(agreed):
            _check_contradiction(first, second, agreed, (reference, name), names)
            continue
        found = _exactly(first, second, agreed)
        if found.sure:
            ahead[name] = found
        else:
            lines.append(_unsure(name, reference, found))
    if not ahead:
        return detections, {}, lines
    earliest = min(0.0, *(one.lag_s for one in ahead.values()))
    taken: dict[str, dict[str, float]] = {}
    for name in wanted:
        # One that was not found to differ has the reference's clock.
        one = ahead.get(name, _FoundClock(0.0, max(found.std_s for found in ahead.values()), True))
        if one.lag_s > earliest:
            taken[name] = {"lag_s": round(one.lag_s - earliest, 6), "std_s": round(one.std_s, 6)}
    lines += [_said(name, one["lag_s"], one["std_s"]) for name, one in taken.items()]
    return taken_off(detections, {name: one["lag_s"] for name, one in taken.items()}), taken, lines


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
        line for each thing that is to be said.

    Raises:
        DataError: as `find_clocks`.
    """
    found: dict[str, list[float]] = {}
    lines: list[str] = []
    for recording, name in zip(recordings, names, strict=True):
        _, taken, said = find_clocks(recording, config, name)
        lines += said
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


def _boxes_of(detections: Detections, name: str) -> FloatArray:
    rows = np.repeat(detections.scan_sensor, np.diff(detections.scan_start))
    return np.asarray(detections.boxes[rows == detections.sensors.index(name)])


def _differ(agreed: Agreement) -> bool:
    """Whether boxes agree clearly better at another difference of the clocks than as the times are."""
    return (
        abs(agreed.offset_s) >= LEAST_S
        and agreed.best - agreed.at_zero > _BETTER
        and agreed.best > _CLEAR * agreed.usual
    )


def _exactly(first: Detections, second: Detections, agreed: Agreement) -> _FoundClock:
    """Find the offset to the millisecond by the motion of vehicles that both saw."""
    tracks = _tracks_of_overlap(first, second, agreed.offset_s)
    same = PictureMap(np.eye(3, 4))
    clock = clock_by_map(*tracks, same, [agreed.offset_s], _LEAST_VEHICLES)
    if clock is None:
        return _FoundClock(agreed.offset_s, float("inf"), False)
    sure = abs(clock.offset_s) > max(LEAST_S, _SIGNIFICANT * clock.offset_std_s)
    return _FoundClock(clock.offset_s, clock.offset_std_s, sure)


def _tracks_of_overlap(
    first: Detections, second: Detections, offset_s: float
) -> tuple[SensorTracks, SensorTracks]:
    """Track each sensor alone for as long as both look, but no longer than is needed."""
    begin = max(first.scan_t[0], second.scan_t[0] - offset_s)
    end = min(first.scan_t[-1], second.scan_t[-1] - offset_s, begin + _LOOKED_AT_S)
    return (
        own_tracks(_between(first, begin, end)),
        own_tracks(_between(second, begin + offset_s, end + offset_s)),
    )


def _between(detections: Detections, begin: float, end: float) -> Detections:
    first, last = np.searchsorted(detections.scan_t, [begin, end], side="left")
    return Detections.from_scans(detections.scan(k) for k in range(int(first), int(last)))


def _check_contradiction(
    first: Detections, second: Detections, agreed: Agreement, pair: tuple[str, str], names: str
) -> None:
    """Refuse sensors that see traffic in the same places and never the same vehicles."""
    if agreed.best >= _NEVER or not _same_places(first, second):
        return
    tracks: tuple[SensorTracks, ...] = tuple(
        own_tracks(_between(one, one.scan_t[0], one.scan_t[0] + _LOOKED_AT_S)) for one in (first, second)
    )
    if min(int(one.moves.sum()) for one in tracks) < _MANY:
        return
    raise DataError(
        f"sensors {pair[0]!r} and {pair[1]!r} see vehicles in the same part of the picture, but never the "
        f"same ones, by whatever their clocks differ (at best {100 * agreed.best:.0f} % of the boxes agree): "
        "are both of one picture and one recording? `jeat-graph register` brings sensors together that have "
        "pictures of their own; leave one out, or track them as they are with --set input.clocks=as_given",
        names,
    )


def _same_places(first: Detections, second: Detections) -> bool:
    """Whether most boxes of each sensor lie where the other one has some at any time."""
    both = [one.boxes[:, :2] + 0.5 * one.boxes[:, 2:] for one in (first, second)]
    low = np.minimum(*(one.min(axis=0) for one in both))
    high = np.maximum(*(one.max(axis=0) for one in both))
    cells = [
        np.clip((one - low) / np.maximum(high - low, 1e-9) * _PLACES, 0, _PLACES - 1).astype(int)
        @ [_PLACES, 1]
        for one in both
    ]
    shares = [float(np.isin(a, b).mean()) for a, b in (cells, cells[::-1])]
    return min(shares) > _SAME_PLACES


def _said(name: str, lag_s: float, std_s: float) -> str:
    return (
        f"sensor {name!r}: its times are {lag_s:.4f} s late beside those of the others "
        f"(± {1e3 * std_s:.1f} ms), which is taken off (--set input.clocks=as_given leaves them)"
    )


def _unsure(name: str, reference: str, found: _FoundClock) -> str:
    late = f"{abs(found.lag_s):.4f} s {'late' if found.lag_s > 0 else 'early'} beside those of {reference!r}"
    setting = f"--set sensors.{name}.latency_s={exact_text(round(found.lag_s, 4))}"
    return (
        f"sensor {name!r}: its boxes agree best if its times are {late}, but too few vehicles say so: they "
        f"are left as they are; {setting} takes it off"
    )
