"""Compiled filter on the road plane: where each vehicle is now, how fast, and how large, by the past alone.

State of a track: x, its speed; y, its speed and acceleration; length, width, height. Along the road the
acceleration forgets slowly (Singer's model); across it the speed is a random walk that is pulled to zero.
Each box is an extended Kalman update of its four channels (`box_kernel`). Errors with memory are taken for
white ones that tell as much in the long run, which costs one state less a sensor and channel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.road.box_kernel import (
    CHANNELS,
    NEITHER,
    UNKNOWNS,
    WHOLE,
    KernelCamera,
    box_channels,
    cuboid_sides,
)

#: Components of the state.
X, VX, Y, VY, AY, LENGTH, WIDTH, HEIGHT = range(8)
STATES = 8
OF_UNKNOWN = np.array([X, Y, LENGTH, WIDTH, HEIGHT])
#: Strips along the road, about the road below the camera: how many, and how wide (m).
STRIPS, _STRIP_M = 60, 2.0
_RECENT = 20.0  # vehicles that a strip remembers
LEAST_SIZE = np.array([1.2, 0.4, 0.8])
_LEAST_SPEED = 2.0


class RoadState(NamedTuple):
    """State of all tracks on the road, one row a track; rows beyond `count` are unused.

    Attributes:
        track_id: (C,) identities, ascending.
        mean: (C, 8) state.
        cov: (C, 8, 8) covariance.
        t: (C,) time of the state (s).
        seen: (C, S) time of each sensor's last box (s), minus infinity before the first.
        updated: (C,) time of the last box (s).
        boxes: (C,) how many were taken in.
        strip: (K, 3) of each strip along the road: vehicles that have told their speed along it, its mean
            (m/s) and its variance (m²/s²).
        count: (1,) rows in use.
    """

    track_id: IntArray
    mean: FloatArray
    cov: FloatArray
    t: FloatArray
    seen: FloatArray
    updated: FloatArray
    boxes: IntArray
    strip: FloatArray
    count: IntArray  # type: ignore[assignment]  # hides tuple.count, which nobody calls


class RoadModel(NamedTuple):
    """What is believed of vehicles and boxes.

    Attributes:
        size_mean: (3,) length, width, height (m) of a vehicle not seen yet.
        size_cov: (3, 3) covariance.
        speed_std: of the speed along the road (m/s).
        strip_std: of that of a vehicle where others have driven before, beyond how theirs differ (m/s).
        acceleration_std: of the acceleration along the road (m/s²).
        acceleration_s: how long an acceleration lasts (s).
        lateral_std: of the speed across the road (m/s).
        lateral_s: how long a motion across it lasts (s).
        memory_s: (S,) correlation time of each sensor's errors (s).
        coloured_share: (S,) share of the size's variance that persists.
        edge_px: a side this near the picture's edge is cut off by it (px).
        gate: squared distance a degree of freedom beyond which a box is believed less.
        picture: (2,) width and height (px).
    """

    size_mean: FloatArray
    size_cov: FloatArray
    speed_std: float
    strip_std: float
    acceleration_std: float
    acceleration_s: float
    lateral_std: float
    lateral_s: float
    memory_s: FloatArray
    coloured_share: FloatArray
    edge_px: float
    gate: float
    picture: FloatArray


@njit(cache=True)
def predict(m: FloatArray, P: FloatArray, dt: float, model: RoadModel) -> None:
    """Predict one state by dt (s), in place."""
    if dt <= 0.0:
        return
    fade = math.exp(-dt / model.acceleration_s)
    calm = math.exp(-dt / model.lateral_s)
    h = 0.5 * dt * dt
    to_speed = model.acceleration_s * (1.0 - fade)
    to_place = model.acceleration_s * (dt - to_speed)
    gain_x = model.lateral_s * (1.0 - calm)
    m[X] += gain_x * m[VX]
    m[VX] *= calm
    m[Y] += dt * m[VY] + to_place * m[AY]
    m[VY] += to_speed * m[AY]
    m[AY] *= fade
    for c in range(STATES):  # rows, F P
        P[X, c] += gain_x * P[VX, c]
        P[VX, c] *= calm
        P[Y, c] += dt * P[VY, c] + to_place * P[AY, c]
        P[VY, c] += to_speed * P[AY, c]
        P[AY, c] *= fade
    for r in range(STATES):  # columns, (F P) Fᵀ
        P[r, X] += gain_x * P[r, VX]
        P[r, VX] *= calm
        P[r, Y] += dt * P[r, VY] + to_place * P[r, AY]
        P[r, VY] += to_speed * P[r, AY]
        P[r, AY] *= fade
    lateral = model.lateral_std**2 * (1.0 - calm * calm)
    P[VX, VX] += lateral
    P[X, X] += lateral * dt * dt / 3.0
    P[X, VX] += lateral * dt / 2.0
    P[VX, X] += lateral * dt / 2.0
    q = 2.0 * model.acceleration_std**2 / model.acceleration_s
    P[AY, AY] += q * dt
    P[VY, VY] += q * dt**3 / 3.0
    P[Y, Y] += q * dt**5 / 20.0
    for a, b, value in ((VY, AY, q * h), (Y, AY, q * dt**3 / 6.0), (Y, VY, q * dt**4 / 8.0)):
        P[a, b] += value
        P[b, a] += value


@njit(cache=True)
def update(
    m: FloatArray,
    P: FloatArray,
    z: FloatArray,
    R: FloatArray,
    mode: IntArray,
    model: RoadModel,
    camera: KernelCamera,
) -> bool:
    """Take one box in, in place: its channels one after another, about one linearisation.

    Returns:
        False, with the state as it was, where the vehicle is not in front of the camera.
    """
    side, slope = np.empty(4), np.empty((4, UNKNOWNS))
    expected, J = np.empty(CHANNELS), np.empty((CHANNELS, UNKNOWNS))
    heading = math.atan2(m[VX], m[VY]) if m[VX] ** 2 + m[VY] ** 2 > _LEAST_SPEED**2 else 0.0
    if not cuboid_sides(camera, m[X], m[Y], heading, m[LENGTH:], side, slope):
        return False
    box_channels(side, slope, mode, expected, J)
    start = m.copy()
    gain = np.empty(STATES)
    for channel in range(CHANNELS):
        axis = channel % 2
        if mode[axis] == NEITHER or (channel >= 2 and mode[axis] != WHOLE):
            continue
        innovation = z[channel] - expected[channel]
        for c in range(UNKNOWNS):
            innovation -= J[channel, c] * (m[OF_UNKNOWN[c]] - start[OF_UNKNOWN[c]])
        S = R[channel]
        for r in range(STATES):
            total = 0.0
            for c in range(UNKNOWNS):
                total += P[r, OF_UNKNOWN[c]] * J[channel, c]
            gain[r] = total
        for c in range(UNKNOWNS):
            S += J[channel, c] * gain[OF_UNKNOWN[c]]
        distance = innovation * innovation / S
        if distance > model.gate:  # a doubtful box counts less, smoothly
            S += R[channel] * (distance / model.gate - 1.0)
        inverse = 1.0 / S
        for r in range(STATES):
            share = gain[r] * inverse
            m[r] += share * innovation
            for c in range(r, STATES):
                P[r, c] -= share * gain[c]
                P[c, r] = P[r, c]
    for c in range(3):
        m[LENGTH + c] = max(m[LENGTH + c], LEAST_SIZE[c])
    return True


@njit(cache=True)
def strip_of(x: float) -> int:
    """Strip that a place across the road (m) lies in."""
    return min(max(int(x / _STRIP_M + STRIPS / 2), 0), STRIPS - 1)


@njit(cache=True)
def tell_speed(strip: FloatArray, x: float, speed: float) -> None:
    """Count a vehicle's speed for its strip, in place: mean and variance of the recent ones."""
    row = strip[strip_of(x)]
    row[0] = min(row[0] + 1.0, _RECENT)
    off = speed - row[1]
    row[1] += off / row[0]
    row[2] += (off * (speed - row[1]) - row[2]) / row[0]
