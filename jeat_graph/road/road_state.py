"""Compiled filter on the road plane: where each vehicle is now, how fast, and how large, by the past alone.

State of a track: x, its speed; y, its speed and acceleration; length, width, height. Along the road the
acceleration forgets slowly (Singer's model); across it the speed is a random walk that is pulled to zero.
Each box is an extended Kalman update of its four channels (`box_kernel`). Errors with memory are taken for
white ones that tell as much in the long run, which costs one state less a sensor and channel.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.road.box_kernel import (
    CHANNELS,
    NEITHER,
    UNKNOWNS,
    WHOLE,
    KernelCamera,
    box_channels,
    cuboid_sides,
)

#: A record of `MODEL`.
Record = Any
#: Components of the state.
X, VX, Y, VY, AY, LENGTH, WIDTH, HEIGHT = range(8)
STATES = 8
#: Place of the speed in a row of a table of the road, before its heading and acceleration.
SPEED = 2
OF_UNKNOWN = np.array([X, Y, LENGTH, WIDTH, HEIGHT])
#: Strips along the road, about the road below the camera: how many, and how wide (m).
STRIPS, _STRIP_M = 60, 2.0
_RECENT = 20.0  # vehicles that a strip remembers
LEAST_SIZE = np.array([1.2, 0.4, 0.8])
_LEAST_SPEED = 2.0


#: One track on the road: its identity, how many boxes it took in, the time of the state and that of the
#: last box (s), the state and its covariance. A record, for one array is handed over sooner than nine.
TRACK = np.dtype(
    [
        ("track_id", np.int64),
        ("boxes", np.int64),
        ("t", np.float64),
        ("updated", np.float64),
        ("mean", np.float64, (STATES,)),
        ("cov", np.float64, (STATES, STATES)),
    ]
)

#: What is believed of vehicles and boxes, in one record for the same reason.
#:
#: size_mean, size_cov: length, width, height (m) of a vehicle not seen yet. speed_std: of the speed along the
#: road (m/s); strip_std: of that of a vehicle where others drove before, beyond how theirs differ (m/s).
#: acceleration_std, acceleration_s: spread of accelerations along the road (m/s²) and how long one lasts (s).
#: lateral_std, lateral_s: the same of speeds across it (m/s, s). edge_px: a side this near the picture's edge
#: is cut off by it. gate: squared distance a degree of freedom beyond which a box is believed less. pause:
#: share of a sensor's memory within which a further box of it is left out. picture: width and height (px).
#: extremes, most_beyond: sizes that a vehicle may have (`fleet`).
MODEL = np.dtype(
    [
        ("size_mean", np.float64, (3,)),
        ("size_cov", np.float64, (3, 3)),
        ("speed_std", np.float64),
        ("strip_std", np.float64),
        ("acceleration_std", np.float64),
        ("acceleration_s", np.float64),
        ("lateral_std", np.float64),
        ("lateral_s", np.float64),
        ("edge_px", np.float64),
        ("gate", np.float64),
        ("pause", np.float64),
        ("picture", np.float64, (2,)),
        ("extremes", np.float64, (2, 2, 3)),
        ("most_beyond", np.float64),
    ]
)


#: A track at one time: x, y (m), speed (m/s), heading from y towards x (rad), acceleration along the way
#: (m/s²), length, width, height (m), and their variances by noise alone.
ROAD_ROW = np.dtype(
    [
        ("t", np.float64),
        ("track_id", np.int64),
        ("mean", np.float64, (STATES,)),
        ("var", np.float64, (STATES,)),
    ]
)


class RoadState(NamedTuple):
    """State of all tracks on the road, one row a track; rows beyond `count` are unused.

    Attributes:
        track: (C,) records of `TRACK`, by identity.
        seen: (C, S) time of each sensor's last box (s), minus infinity before the first.
        strip: (K, 3) of each strip along the road: vehicles that have told their speed along it, its mean
            (m/s) and its variance (m²/s²).
        count: (1,) rows in use.
    """

    track: RecordArray
    seen: FloatArray
    strip: FloatArray
    count: IntArray  # type: ignore[assignment]  # hides tuple.count, which nobody calls


@njit(cache=True)
def predict(m: FloatArray, P: FloatArray, dt: float, model: Record) -> None:
    """Predict one state by dt (s), in place."""
    if dt <= 0.0:
        return
    fade = math.exp(-dt / model["acceleration_s"])
    calm = math.exp(-dt / model["lateral_s"])
    h = 0.5 * dt * dt
    to_speed = model["acceleration_s"] * (1.0 - fade)
    to_place = model["acceleration_s"] * (dt - to_speed)
    gain_x = model["lateral_s"] * (1.0 - calm)
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
    lateral = model["lateral_std"] ** 2 * (1.0 - calm * calm)
    P[VX, VX] += lateral
    P[X, X] += lateral * dt * dt / 3.0
    P[X, VX] += lateral * dt / 2.0
    P[VX, X] += lateral * dt / 2.0
    q = 2.0 * model["acceleration_std"] ** 2 / model["acceleration_s"]
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
    model: Record,
    camera: KernelCamera,
) -> bool:
    """Take one box in, in place: its channels one after another, about one linearisation.

    Returns:
        False, with the state as it was, where the vehicle is not in front of the camera.
    """
    # One piece of memory: asking for each of them costs as much as their arithmetic.
    work = np.empty(2 * CHANNELS * (1 + UNKNOWNS) + 2 * STATES)
    side, expected, start, gain = work[:4], work[4:8], work[8 : 8 + STATES], work[16 : 16 + STATES]
    slope, J = work[24:44].reshape(4, UNKNOWNS), work[44:].reshape(CHANNELS, UNKNOWNS)
    heading = math.atan2(m[VX], m[VY]) if m[VX] ** 2 + m[VY] ** 2 > _LEAST_SPEED**2 else 0.0
    if not cuboid_sides(camera, m[X], m[Y], heading, m[LENGTH:], side, slope):
        return False
    box_channels(side, slope, mode, expected, J)
    start[:] = m
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
        if distance > model["gate"]:  # a doubtful box counts less, smoothly
            S += R[channel] * (distance / model["gate"] - 1.0)
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
