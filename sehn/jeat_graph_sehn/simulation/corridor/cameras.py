"""What cameras over a road say of the vehicles that pass: errors, misses, fragments, clocks of their own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.normal import Z95
from jeat_graph.io.tables.table_writer import write_columns
from jeat_graph_sehn.simulation.corridor.traffic import KINDS, Driven

_KMH = 3.6
#: Longest lengths of the classes as `road` tells them (m).
_CLASS_LENGTHS = (3.0, 5.2, 7.0)


@dataclass(frozen=True)
class CameraErrors:
    """How a camera errs.

    Attributes:
        sigma_t: standard deviation of a time (s).
        sigma_speed: of a speed, as a share.
        scale: of the camera's calibration, as a share: the same for all of its speeds.
        sigma_length: of a length, as a share.
        missed: share of the vehicles that it does not see.
        wrong_speed: share of the tracks that are fragments, whose speed is wrong by a fifth.
        wrong_lane: share of the passages in a wrong lane.
        false_per_h: tracks of nothing, an hour.
    """

    sigma_t: float = 0.02
    sigma_speed: float = 0.012
    scale: float = 0.007
    sigma_length: float = 0.05
    missed: float = 0.03
    wrong_speed: float = 0.015
    wrong_lane: float = 0.005
    false_per_h: float = 20.0


class Seen(NamedTuple):
    """Passages of one camera, in order of time; track identities count from 1.

    Attributes:
        t: (N,) by the camera's clock (s).
        speed: (N,) m/s.
        sigma_speed: (N,) m/s.
        lane: (N,) from 0.
        length: (N,) m.
        vehicle: (N,) rows of the traffic, −1 for nothing.
    """

    t: FloatArray
    speed: FloatArray
    sigma_speed: FloatArray
    lane: IntArray
    length: FloatArray
    vehicle: IntArray


def see(driven: Driven, place: int, clock_s: float, errors: CameraErrors, rng: np.random.Generator) -> Seen:
    """Return what the camera at a place says.

    Args:
        driven: the traffic.
        place: which of its places.
        clock_s: the camera's clock less the true time (s).
        errors: how it errs.
        rng: of these errors.
    """
    t = driven.t[:, place]
    rows = np.flatnonzero(np.isfinite(t) & (rng.random(len(t)) >= errors.missed))
    scale = float(np.exp(errors.scale * rng.normal()))
    speed = driven.speed[rows, place] * scale * np.exp(errors.sigma_speed * rng.normal(size=len(rows)))
    wrong = rng.random(len(rows)) < errors.wrong_speed
    speed[wrong] *= np.exp(0.2 * rng.normal(size=wrong.sum()))
    lane = driven.lane[rows, place].copy()
    moved = rng.random(len(rows)) < errors.wrong_lane
    lane[moved] = np.abs(lane[moved] - 1)
    length = driven.length[rows] * np.exp(errors.sigma_length * rng.normal(size=len(rows)))
    at = t[rows] + clock_s + errors.sigma_t * rng.normal(size=len(rows))
    start, end = (at.min(initial=0.0), at.max(initial=1.0))
    false = rng.poisson(errors.false_per_h * (end - start) / 3600.0)
    pick = rng.integers(0, max(len(rows), 1), false) if len(rows) else np.zeros(0, dtype=np.int64)
    at = np.concatenate([at, rng.uniform(start, end, len(pick))])
    vehicle = np.concatenate([rows, np.full(len(pick), -1)])
    speed, length = (np.concatenate([v, v[pick]]) for v in (speed, length))
    lane = np.concatenate([lane, lane[pick]])
    order = np.argsort(at, kind="stable")
    sigma = np.hypot(errors.sigma_speed, errors.scale) * speed
    return Seen(at[order], speed[order], sigma[order], lane[order], length[order], vehicle[order])


def write_seen(seen: Seen, folder: Path, errors: CameraErrors) -> None:
    """Write `crossings.csv` and `speeds.csv` as `road` does."""
    folder.mkdir(parents=True, exist_ok=True)
    count = len(seen.t)
    track_id = np.arange(1, count + 1)
    lane = (seen.lane + 1).astype(np.str_)
    low, high = (_KMH * (seen.speed + sign * Z95 * seen.sigma_speed) for sign in (-1.0, 1.0))
    speed = _rounded(_KMH * seen.speed, low, high)
    kind = np.array(KINDS)[np.searchsorted(_CLASS_LENGTHS, seen.length)]
    crossings = {
        "track_id": track_id,
        "line": np.full(count, "middle"),
        "t": np.round(seen.t, 4),
        "lane": lane,
        "speed_kmh": speed[0],
        "low_kmh": speed[1],
        "high_kmh": speed[2],
        "direction": np.full(count, "right"),
        "sigma_t": np.full(count, errors.sigma_t),
    }
    write_columns(crossings, folder / "crossings.csv")
    about_s = 20.0 / np.maximum(seen.speed, 1.0)
    speeds = {
        "track_id": track_id,
        "t_first": np.round(seen.t - about_s, 4),
        "t_last": np.round(seen.t + about_s, 4),
        "lane": lane,
        "class": kind,
        "length": np.round(seen.length, 3),
        "sigma_length": np.round(errors.sigma_length * seen.length, 3),
        "speed_kmh": speed[0],
        "low_kmh": speed[1],
        "high_kmh": speed[2],
    }
    write_columns(speeds, folder / "speeds.csv")


def common(a: Seen, b: Seen) -> tuple[IntArray, IntArray]:
    """Rows of both cameras that are one vehicle."""
    real = np.flatnonzero(a.vehicle >= 0)
    place: BoolArray = np.isin(a.vehicle[real], b.vehicle)
    rows = real[place]
    order = np.argsort(b.vehicle, kind="stable")
    return rows, order[np.searchsorted(b.vehicle[order], a.vehicle[rows])]


def _rounded(*values: FloatArray) -> list[FloatArray]:
    return [np.round(value, 3) for value in values]
