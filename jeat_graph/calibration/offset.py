"""How late each sensor's clock is, from how far its boxes lag behind moving vehicles.

The boxes of a sensor whose times are late by δ lie δ · v behind a vehicle of image velocity v: the slope of
the error over the velocity is −δ. With truth that holds for each sensor by itself; without, one sensor is
compared with another on the tracks that both see.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.calibration.matches import SensorMatches
from jeat_graph.calibration.tracked import TrackedDetections
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray

# Velocities are differences of places so long before and after, at least, or a period of the sensor;
_BASE_S = 0.08
# no longer than this, or so many periods.
_REACH_S, _REACH_PERIODS = 0.25, 2.1
# A lag counts where it is this many times its standard error,
_LEAST_SIGNIFICANCE = 4.0
# and this share of the sensor's own period: a smaller one moves no box by more than its noise.
_LEAST_SHARE = 0.15
_LEAST_ROWS, _LEAST_TRACKS = 100, 5
# Huber's bound on residuals, in robust standard deviations, and how often the weights are renewed.
_HUBER, _ROUNDS = 1.5, 10


@dataclass(frozen=True)
class Lag:
    """How late a sensor's times are.

    Attributes:
        sensor: its name.
        lag_s: lag (s), positive where its times are late.
        std_s: standard error (s), by the scatter between vehicles.
        found: whether it is beyond chance and large enough to matter.
    """

    sensor: str
    lag_s: float
    std_s: float
    found: bool


def lag_of(
    sensor: str, error: FloatArray, velocity: FloatArray, side: FloatArray, key: IntArray, period_s: float
) -> Lag:
    """Fit error = −lag · velocity + bias · side, robustly, over both axes.

    Args:
        sensor: name.
        error: (K, 2) of centres (px).
        velocity: (K, 2) of the vehicle in the picture (px/s).
        side: (K, 2) width and height (px).
        key: (K,) number of the vehicle, whose errors are not independent.
        period_s: of the sensor (s).
    """
    if len(error) < _LEAST_ROWS or len(np.unique(key)) < _LEAST_TRACKS:
        return Lag(sensor, 0.0, float("inf"), False)
    # Errors go with the size: in units of it the rows count equally. One bias an axis.
    size = np.sqrt(side.prod(axis=1))[:, None]
    y = (error / size).ravel()
    columns = np.zeros((len(error), 2, 3))
    columns[:, :, 0] = -velocity / size
    columns[:, 0, 1], columns[:, 1, 2] = (side / size).T
    X = columns.reshape(-1, 3)
    group = np.repeat(np.unique(key, return_inverse=True)[1], 2)
    weight, found, rest, normal = np.ones(len(y)), np.zeros(3), y, np.eye(3)
    for _ in range(_ROUNDS):
        normal = (X * weight[:, None]).T @ X + 1e-12 * np.eye(3)
        found = np.linalg.solve(normal, (X * weight[:, None]).T @ y)
        rest = y - X @ found
        spread = max(1.4826 * float(np.median(np.abs(rest))), 1e-9)
        weight = np.minimum(1.0, _HUBER * spread / np.maximum(np.abs(rest), 1e-12))
    # Sandwich estimate of the covariance, by vehicle (Liang, Zeger, Biometrika 73, 1986).
    scores = np.zeros((int(group.max()) + 1, 3))
    np.add.at(scores, group, X * (weight * rest)[:, None])
    inverse = np.linalg.inv(normal)
    std = float(np.sqrt((inverse @ (scores.T @ scores) @ inverse)[0, 0]))
    lag = float(found[0])
    enough = abs(lag) > _LEAST_SIGNIFICANCE * std and abs(lag) > _LEAST_SHARE * period_s
    return Lag(sensor, lag, std, enough)


def lags_from_truth(matches: Mapping[str, SensorMatches], periods_s: Mapping[str, float]) -> list[Lag]:
    """How late each sensor is against the truth.

    Args:
        matches: detections beside the truth, by sensor, whole boxes only.
        periods_s: of the sensors (s).
    """
    out = []
    for name, m in matches.items():
        number = np.unique(m.key, axis=0, return_inverse=True)[1].ravel()
        error = m.residual[:, :2] * m.side
        true = m.box[:, :2] + 0.5 * m.box[:, 2:] - error
        rows, velocity = _velocities(number, m.t, true, m.t, number, periods_s[name])
        out.append(lag_of(name, error[rows], velocity, m.side[rows], number[rows], periods_s[name]))
    return out


def lags_between(data: TrackedDetections, names: Sequence[str], periods_s: Sequence[float]) -> list[Lag]:
    """How late each sensor is against the one that saw most of the tracks; without truth.

    Args:
        data: detections with the tracks that took them.
        names: of the sensors.
        periods_s: of them (s).
    """
    counts = np.bincount(data.sensor, minlength=len(names))
    reference = int(np.argmax(counts))
    centre = data.box[:, :2] + 0.5 * data.box[:, 2:]
    ours = data.sensor == reference
    out = []
    for s, name in enumerate(names):
        if s == reference:
            continue
        theirs = np.flatnonzero(data.sensor == s)
        known = (data.track[ours], data.t[ours], centre[ours])
        # Places that also tell where the track was at the time itself would tie the velocity's error to it.
        rows, velocity = _velocities(*known, data.t[theirs], data.track[theirs], periods_s[reference])
        theirs = theirs[rows]
        at, there = _interpolated(*known, data.t[theirs], data.track[theirs], periods_s[reference])
        theirs, velocity = theirs[at], velocity[at]
        error = centre[theirs] - there
        out.append(lag_of(name, error, velocity, data.box[theirs, 2:], data.track[theirs], periods_s[s]))
    return out


def settled(find: Callable[[Mapping[str, float]], list[Lag]], rounds: Iterable[int]) -> list[Lag]:
    """Find lags, take them off, and find what is left of them, until nothing is.

    Late boxes overlap their vehicles less, so that the fastest are not matched and a lag is found too small.

    Args:
        find: what it is given are the lags (s) of sensors known so far, early ones negative.
        rounds: one for each time that it may be called.

    Returns:
        Of each sensor the sum of all that was found.
    """
    lags: dict[str, Lag] = {}
    for _ in rounds:
        new = find(found_lags(lags.values()))
        for lag in new:
            before = lags.get(lag.sensor)
            if before is None or not before.found:
                lags[lag.sensor] = lag
            elif lag.found:
                lags[lag.sensor] = replace(lag, lag_s=before.lag_s + lag.lag_s)
        if not any(lag.found for lag in new):
            break
    return list(lags.values())


def found_lags(lags: Iterable[Lag]) -> dict[str, float]:
    """Lags (s) by sensor, of those that are beyond chance and matter."""
    return {lag.sensor: lag.lag_s for lag in lags if lag.found}


def with_lags(config: Config, lags: Iterable[Lag]) -> Config:
    """Add the lags that were found to the sensors' `latency_s`; a sensor that is early has a negative one.

    Args:
        config: declares the sensors.
        lags: some of them have one.
    """
    found = found_lags(lags)
    sensors = {
        name: replace(s, latency_s=round(s.latency_s + found[name], 4)) if name in found else s
        for name, s in config.sensors.items()
    }
    return replace(config, sensors=sensors)


def earliest_on_time(config: Config) -> Config:
    """Make no sensor early: the earliest is on time, and all others are later by as much.

    To a tracker only the differences between its sensors' clocks matter. Without truth nothing else is known
    of them, and a detector gives its boxes late rather than early.
    """
    early_s = min(0.0, *(s.latency_s for s in config.sensors.values()))
    sensors = {
        name: replace(s, latency_s=round(s.latency_s - early_s, 4)) for name, s in config.sensors.items()
    }
    return replace(config, sensors=sensors)


def _neighbours(
    track: IntArray, t: FloatArray, at: FloatArray, whose: IntArray, gap_s: float, reach_s: float
) -> tuple[IntArray, IntArray, IntArray]:
    """Rows of the last sample before and the first after each time `at`, at least `gap_s` away from it."""
    order = np.lexsort((t, track))
    span = 1e6
    code = track[order] * span + t[order]
    before = np.searchsorted(code, whose * span + at - gap_s, side="right") - 1
    after = np.searchsorted(code, whose * span + at + gap_s, side="left")
    ok = (before >= 0) & (after < len(code))
    rows = np.flatnonzero(ok)
    b, a = order[before[rows]], order[after[rows]]
    near = (track[b] == whose[rows]) & (track[a] == whose[rows])
    near &= (at[rows] - t[b] <= reach_s) & (t[a] - at[rows] <= reach_s) & (t[a] > t[b])
    return rows[near], b[near], a[near]


def _velocities(
    track: IntArray, t: FloatArray, centre: FloatArray, at: FloatArray, whose: IntArray, period_s: float
) -> tuple[IntArray, FloatArray]:
    """Velocity (R, 2) of tracks around times `at` (K,), from samples on either side; and for which rows."""
    reach_s = max(_REACH_S, _REACH_PERIODS * period_s)
    rows, b, a = _neighbours(track, t, at, whose, max(_BASE_S, 0.99 * period_s), reach_s)
    return rows, (centre[a] - centre[b]) / (t[a] - t[b])[:, None]


def _interpolated(
    track: IntArray, t: FloatArray, centre: FloatArray, at: FloatArray, whose: IntArray, period_s: float
) -> tuple[IntArray, FloatArray]:
    """Centre (R, 2) of tracks at times `at` (K,), linearly between samples; and for which rows."""
    reach_s = max(_REACH_S, _REACH_PERIODS * period_s)
    rows, b, a = _neighbours(track, t, at, whose, -1e-4, reach_s)
    # With a sample at the very time, both neighbours are that one or the one beyond it.
    exact = np.abs(t[a] - at[rows]) <= 1e-3
    span = np.where(t[a] > t[b], t[a] - t[b], 1.0)
    share = np.clip((at[rows] - t[b]) / span, 0.0, 1.0)[:, None]
    between = (1.0 - share) * centre[b] + share * centre[a]
    return rows, np.where(exact[:, None], centre[a], between)
