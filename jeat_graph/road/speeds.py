"""How fast each vehicle drove, with an interval that counts the noise and the calibration."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.normal import Z95
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.evidence import within
from jeat_graph.road.key_motion import RoadMotion
from jeat_graph.road.motion_fit import MotionFitConfig, fit_motion, thinned
from jeat_graph.road.stuck import vehicles_part

KMH = 3.6
_LEAST_POINTS = 3
_FEW = 12
_LIFT_M = 0.01


@dataclass(frozen=True)
class ContactConfig:
    """Where on the vehicle a tracked point is.

    A tracker follows the lowest thing that it sees of a vehicle. That is between the tyres' contact with the
    road and the underside of the bumper, about 0.2 m above it: by that alone evenly spread between the two.
    Seen from a camera at height H, a point z above the road seems to move faster by z / (H - z).
    """

    height_m: float = number(0.1, "m", "height of tracked points above the road, of the mean vehicle")
    height_sd_m: float = number(0.058, "m", "how well that is known (0.2 / √12)")
    spread_m: float = number(0.03, "m", "how it differs from vehicle to vehicle")

    def __post_init__(self) -> None:
        check(self)


class Speed(NamedTuple):
    """A speed and what is not known about it.

    Attributes:
        kmh: the estimate (km/h).
        noise_kmh: standard deviation by this vehicle's own errors (km/h).
        calibration_kmh: standard deviation by what is equally wrong for all vehicles of a camera (km/h).
        low_kmh: lower end of the 95 % interval, not below zero (km/h).
        high_kmh: its upper end (km/h).
    """

    kmh: float
    noise_kmh: float
    calibration_kmh: float
    low_kmh: float
    high_kmh: float


#: A speed is not reported where its 95 % interval reaches farther than this, and than this share of the
#: speed.
_MOST_REACH_KMH, _MOST_REACH_SHARE = 10.0, 0.5
UNKNOWN_SPEED = Speed(math.nan, math.nan, math.nan, math.nan, math.nan)


def reported_speed(speed: Speed) -> Speed:
    """Return a speed, or `UNKNOWN_SPEED` where next to nothing is known of it."""
    return speed if is_reported(speed.kmh, speed.high_kmh - speed.kmh) else UNKNOWN_SPEED


def is_reported(kmh: float, reach_kmh: float) -> bool:
    """Whether enough is known of a speed (km/h) whose 95 % interval reaches so far to either side."""
    return reach_kmh <= max(_MOST_REACH_KMH, _MOST_REACH_SHARE * kmh)


def interval(kmh: float, noise: float, calibration: float) -> Speed:
    """Add the 95 % interval to a speed with two independent standard deviations (km/h)."""
    half = Z95 * math.hypot(noise, calibration)
    return Speed(kmh, noise, calibration, max(kmh - half, 0.0), kmh + half)


@dataclass(frozen=True, eq=False)
class Vehicle:
    """One track, fitted on the road.

    Attributes:
        track_id: its identity.
        t: (N,) all its times (s).
        fit: its motion; its covariance is by noise alone.
        by_calibration: (2 C, 2 C) covariance of the motion's coefficients by what the camera has wrong.
        height_gain: relative change of speed per metre of height of the point (1/m).
        spread_m: standard deviation of that height from vehicle to vehicle (m).
    """

    track_id: int
    t: FloatArray
    fit: RoadMotion
    by_calibration: FloatArray
    height_gain: float
    spread_m: float

    def mean_speed(self, start: float, end: float) -> Speed:
        """Mean speed between two times: the straight distance over the time."""
        row = (self.fit.basis(np.array(end)) - self.fit.basis(np.array(start))) / (end - start)
        return self._speed(row)

    def speed_at(self, t: float) -> Speed:
        """Speed at a time."""
        return self._speed(self.fit.basis(np.array(t), 1))

    def _speed(self, row: FloatArray) -> Speed:
        vector = self.fit.coefficients @ row
        size = float(np.linalg.norm(vector))
        unit = vector / size if size > 0 else np.array([0.0, 1.0])
        gradient = np.concatenate([unit[0] * row, unit[1] * row])
        own = math.sqrt(float(gradient @ self.fit.covariance @ gradient))
        noise = KMH * math.hypot(own, size * self.height_gain * self.spread_m)
        systematic = KMH * math.sqrt(max(float(gradient @ self.by_calibration @ gradient), 0.0))
        return interval(KMH * size, noise, systematic)


def fit_vehicle(
    track_id: int,
    t: FloatArray,
    pixels: FloatArray,
    camera: RoadCamera,
    motion: MotionFitConfig,
    contact: ContactConfig,
) -> Vehicle | None:
    """Fit one track's points (t ascending (N,), pixels (N, 2)); None where too few are on the road."""
    all_t = t
    inside = within(pixels, (camera.width, camera.height), motion.edge_share)
    t, pixels = t[inside], pixels[inside]
    own = _vehicles_part(t, pixels, camera, motion, contact)
    t, pixels = t[own], pixels[own]
    if len(t) < _LEAST_POINTS:
        return None
    t, pixels, counts = thinned(t, pixels, motion)
    xy = camera.to_road(pixels, contact.height_m)
    seen = np.isfinite(xy).all(axis=1)
    if seen.sum() < _LEAST_POINTS or t[seen][-1] <= t[seen][0]:
        return None
    t, pixels, counts, xy = t[seen], pixels[seen], counts[seen], xy[seen]
    fit = fit_motion(t, xy, camera.to_road_jacobian(xy, contact.height_m), motion, counts)
    effect = np.einsum("ani,nip->ap", fit.gain, _systematic(camera, t, pixels, xy, contact))
    covariance = np.zeros((effect.shape[1], effect.shape[1]))
    covariance[:-1, :-1] = camera.covariance
    covariance[-1, -1] = contact.height_sd_m**2
    return Vehicle(
        track_id,
        all_t,
        fit,
        effect @ covariance @ effect.T,
        1.0 / (float(camera.position[2]) - contact.height_m),
        contact.spread_m,
    )


def _vehicles_part(
    t: FloatArray, pixels: FloatArray, camera: RoadCamera, motion: MotionFitConfig, contact: ContactConfig
) -> IntArray:
    """Indices of the points (N, 2) on the road that are not of an end that stays behind."""
    xy = camera.to_road(pixels, contact.height_m)
    seen = np.flatnonzero(np.isfinite(xy).all(axis=1))
    if len(seen) < _LEAST_POINTS:
        return np.arange(len(t))
    metres = camera.to_road_jacobian(xy[seen], contact.height_m)
    sigma = np.sqrt((metres**2).sum(axis=(1, 2))) * math.hypot(motion.white_px, motion.memory_px)
    own: IntArray = seen[vehicles_part(t[seen], xy[seen], sigma)]
    return own


def _systematic(
    camera: RoadCamera, t: FloatArray, pixels: FloatArray, xy: FloatArray, contact: ContactConfig
) -> FloatArray:
    """Derivative (M, 2, 13) of the places with respect to the camera's parameters and the points' height.

    It is smooth along a track: a few points tell it for all.
    """
    few = np.unique(np.linspace(0, len(t) - 1, min(len(t), _FEW)).astype(int))
    coarse = camera.calibration_jacobian(pixels[few], contact.height_m)
    lift = (camera.to_road(pixels[few], contact.height_m + _LIFT_M) - xy[few]) / _LIFT_M
    coarse = np.concatenate([coarse, lift[..., None]], axis=-1)
    dense = [np.interp(t, t[few], column) for column in coarse.reshape(len(few), -1).T]
    return np.stack(dense, axis=1).reshape(len(t), *coarse.shape[1:])
