"""Draws tracks with exactly known truth: from the motion model, or from real paths with simulated noise."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.prior import write_prior
from jeat_graph.smoothers.measurements import measurements
from jeat_graph.smoothers.track_data import Prior, TrackData

# (rate in Hz, standard deviation in px, share with memory, memory in s) of an event and an RGB detector.
EVT, RGB = (100.0, 2.5, 0.5, 0.15), (20.0, 1.5, 0.5, 0.25)
_P_DETECT = 0.85
_VELOCITY_STD, _ACCELERATION_STD = 150.0, 60.0
# A vehicle's path in metres is seen as from a height at which a metre is so many pixels.
_PX_PER_M = 10.0


@dataclass(frozen=True, eq=False)
class DrawnTrack:
    """Measurements of one vehicle and where it truly was.

    Attributes:
        data: as smoothers take them.
        t: (T,) times of the truth (s).
        truth: (T, 2, 3) true [p, v, a] per axis.
    """

    data: TrackData
    t: FloatArray
    truth: FloatArray


def from_model(seed: int, memory: bool, duration_s: float = 8.0, jerk: float = 100.0) -> DrawnTrack:
    """Draw a vehicle from the white-jerk model and measurements of both sensors from the noise model.

    Args:
        seed: of the drawing.
        memory: whether a part of the noise persists; else all of it is white.
        duration_s: length (s).
        jerk: root spectral density (px/s^2.5).
    """
    from jeat_graph.filters.motion import process_noise, transition

    rng = np.random.default_rng(seed)
    t, sensor = _looks(rng, duration_s)
    x = np.zeros((len(t), 2, 3))
    x[0] = rng.normal(size=(2, 3)) * [0.0, _VELOCITY_STD, _ACCELERATION_STD]
    steps = np.diff(t).tolist()
    root = np.linalg.cholesky(np.array([process_noise(dt, jerk) for dt in steps]))
    push = rng.normal(size=(len(steps), 2, 3)) @ root.mT
    for k, dt in enumerate(steps):
        x[k + 1] = x[k] @ transition(dt).T + push[k]
    return DrawnTrack(_measured(rng, t, sensor, x[:, :, 0], jerk, memory), t[1:], x[1:])


def from_paths(path: Path, seed: int, jerk: float = 40.0) -> list[DrawnTrack]:
    """Give real paths the noise of both sensors.

    Between its samples a path is a cubic spline, whose derivatives are taken for the true motion.

    Args:
        path: CSV with the columns t (s), object_id, x_m, y_m.
        seed: of the noise.
        jerk: root spectral density that the smoothers are given (px/s^2.5).
    """
    from scipy.interpolate import CubicSpline

    with path.open(encoding="utf-8", newline="") as file:
        rows = [
            (r["object_id"], float(r["t"]), float(r["x_m"]), float(r["y_m"])) for r in csv.DictReader(file)
        ]
    rng = np.random.default_rng(seed)
    out = []
    for name in dict.fromkeys(row[0] for row in rows):
        mine = np.array([row[1:] for row in rows if row[0] == name])
        if len(mine) < 20:
            continue
        spline = CubicSpline(mine[:, 0], _PX_PER_M * mine[:, 1:])
        t, sensor = _looks(rng, float(mine[-1, 0] - mine[0, 0]))
        t = t + mine[0, 0]
        truth = np.stack([spline(t), spline(t, 1), spline(t, 2)], axis=2)
        out.append(DrawnTrack(_measured(rng, t, sensor, truth[:, :, 0], jerk, True), t[1:], truth[1:]))
    return out


def _looks(rng: np.random.Generator, duration_s: float) -> tuple[FloatArray, IntArray]:
    """Times (K,) at which one of the two sensors finds the vehicle, and which (K,)."""
    times = [np.arange(k * 1e-3, duration_s, 1.0 / rate) for k, (rate, *_) in enumerate((EVT, RGB))]
    t = np.concatenate(times)
    sensor = np.repeat([0, 1], [len(part) for part in times])
    order = np.argsort(t, kind="stable")
    kept = order[rng.random(len(t)) < _P_DETECT]
    return t[kept], sensor[kept]


def _measured(
    rng: np.random.Generator, t: FloatArray, sensor: IntArray, p: FloatArray, jerk: float, memory: bool
) -> TrackData:
    """Measure positions (K, 2); the first measurement is the prior."""
    std = np.array([EVT[1], RGB[1]])[sensor]
    share = np.array([EVT[2], RGB[2]])[sensor] if memory else np.zeros(len(t))
    tau = np.array([EVT[3], RGB[3]])
    error = np.zeros((len(t), 2))
    for s in range(2):
        mine = np.flatnonzero(sensor == s)
        lasting = rng.normal(size=2)
        for before, k in zip(np.append(-1, mine[:-1]), mine, strict=True):
            if before >= 0:
                phi = np.exp(-(t[k] - t[before]) / tau[s])
                lasting = phi * lasting + np.sqrt(1.0 - phi**2) * rng.normal(size=2)
            error[k] = lasting
    coloured_std = (np.sqrt(share) * std)[:, None].repeat(2, axis=1)
    white = ((1.0 - share) * std**2)[:, None].repeat(2, axis=1)
    z = p + coloured_std * error + np.sqrt(white) * rng.normal(size=p.shape)
    D = 5 if memory else 3
    mean, cov = np.empty((2, D)), np.empty((2, D, D))
    spread = np.full(2, _VELOCITY_STD**2), np.full(2, _ACCELERATION_STD**2)
    if memory:
        write_prior(z[0], white[0], coloured_std[0], int(sensor[0]), *spread, mean, cov)
        coloured = measurements(
            t[1:], z[1:], white[1:], np.full(len(t) - 1, jerk), coloured_std[1:], sensor[1:]
        )
        return TrackData.from_measurements(Prior(float(t[0]), mean, cov), coloured, tau)
    write_prior(z[0], std[[0, 0]] ** 2, np.zeros(2), -1, *spread, mean, cov)
    plain = measurements(t[1:], z[1:], white[1:], np.full(len(t) - 1, jerk))
    return TrackData.from_measurements(Prior(float(t[0]), mean, cov), plain)
