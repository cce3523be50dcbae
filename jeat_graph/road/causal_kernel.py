"""Compiled beginnings of the filter on the road: boxes read, and states begun at them."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.road.box_kernel import (
    CHANNELS,
    HIGH,
    LOW,
    NEITHER,
    UNKNOWNS,
    WHOLE,
    KernelCamera,
    box_channels,
    cuboid_sides,
)
from jeat_graph.road.road_state import (
    AY,
    LEAST_SIZE,
    LENGTH,
    OF_UNKNOWN,
    STATES,
    VX,
    VY,
    Record,
    X,
    Y,
    strip_of,
)

_FIRST_STEPS = 4
# A filter that takes a box for whole that is cut off believes in a vehicle that stands in the edge.
_EDGE_SIGMAS, _EDGE_SHARE = 3.5, 0.4
_ENOUGH = 3.0  # vehicles of a strip that tell how fast the next one will be


@njit(cache=True)
def read_box(
    row: RecordArray,
    since_s: float,
    model: Record,
    errors: FloatArray,
    z: FloatArray,
    R: FloatArray,
    mode: IntArray,
) -> None:
    """Turn a record of the update log into channels, with white errors that tell as much as its own do.

    An error that persists tells (1 - φ) / (1 + φ) of what a new one does, φ its correlation between boxes.

    Args:
        row: of `filters.measurement.MEASUREMENT`.
        since_s: time since the sensor's last box (s).
        model: what is believed of boxes.
        errors: (S, 2) correlation time of each sensor's errors (s), share of the size's variance that
            persists.
        z: (4,) filled: channels.
        R: (4,) filled: variances.
        mode: (2,) filled: what of each axis is measured.
    """
    s = row["sensor"]
    forget = math.exp(-min(since_s, 1e3) / errors[s, 0])
    factor = (1.0 + forget) / max(1.0 - forget, 1e-3)
    share = errors[s, 1]
    for axis in range(2):
        centre, extent = row["z"][axis], math.exp(row["log_size"][axis])
        size_var = row["size_var"][axis] * row["scale"]
        R[axis] = row["r"][axis] + factor * row["coloured_std"][axis] ** 2
        R[axis + 2] = size_var * (1.0 - share + share * factor)
        spread = math.sqrt(
            row["r"][axis] + row["coloured_std"][axis] ** 2 + 0.25 * extent * extent * size_var
        )
        margin = model["edge_px"] + min(_EDGE_SIGMAS * spread, _EDGE_SHARE * extent)
        low, high = centre - 0.5 * extent, centre + 0.5 * extent
        sees_low, sees_high = low > margin, high < model["picture"][axis] - margin
        z[axis], z[axis + 2] = centre, row["log_size"][axis]
        if sees_low and sees_high:
            mode[axis] = WHOLE
            continue
        R[axis] += 0.25 * extent * extent * R[axis + 2]
        if sees_low:
            mode[axis], z[axis] = LOW, low
        elif sees_high:
            mode[axis], z[axis] = HIGH, high
        else:
            mode[axis] = NEITHER


@njit(cache=True)
def begin(
    m: FloatArray,
    P: FloatArray,
    z: FloatArray,
    R: FloatArray,
    mode: IntArray,
    model: Record,
    camera: KernelCamera,
    strip: FloatArray,
) -> bool:
    """Start a state at one box, in place; False where it does not stand on the road before the camera."""
    bottom = z[1] + 0.5 * math.exp(z[3]) if mode[1] == WHOLE else z[1]
    if mode[1] == LOW or mode[1] == NEITHER or mode[0] == NEITHER:
        return False
    lens, rotation, position = camera.lens, camera.rotation, camera.position
    d0, d1 = (z[0] - lens[2]) / lens[0], (bottom - lens[3]) / lens[1]
    n0, n1 = d0, d1
    for _ in range(4):
        r2 = n0 * n0 + n1 * n1
        gain = 1.0 + lens[4] * r2 + lens[5] * r2 * r2
        n0, n1 = d0 / gain, d1 / gain
    ray = n0 * rotation[0] + n1 * rotation[1] + rotation[2]
    if ray[2] >= -1e-6:
        return False
    reach = -position[2] / ray[2]
    dx, dy = ray[0] * reach, ray[1] * reach
    distance = math.hypot(dx, dy)
    m[:] = 0.0
    P[:] = 0.0
    for a in range(3):
        m[LENGTH + a] = model["size_mean"][a]
        for b in range(3):
            P[LENGTH + a, LENGTH + b] = model["size_cov"][a, b]
    ahead = 0.5 * model["size_mean"][0] * dy / distance / distance * abs(dy)
    m[X], m[Y] = position[0] + dx, position[1] + dy + ahead
    P[X, X] = (0.2 * distance) ** 2
    P[Y, Y] = (0.5 * distance) ** 2
    P[VX, VX] = model["lateral_std"] ** 2
    P[VY, VY] = model["speed_std"] ** 2
    near = strip[strip_of(m[X])]
    if near[0] >= _ENOUGH:
        m[VY] = near[1]
        P[VY, VY] = near[2] + model["strip_std"] ** 2
    P[AY, AY] = model["acceleration_std"] ** 2
    prior_m, prior_P = m.copy(), P.copy()
    for _ in range(_FIRST_STEPS):
        # Linearised anew about what the last pass found, each time from the prior.
        at = m.copy()
        m[:], P[:] = prior_m, prior_P
        if not _update_about(at, m, P, z, R, mode, camera):
            return False
    return True


@njit(cache=True)
def _update_about(
    at: FloatArray,
    m: FloatArray,
    P: FloatArray,
    z: FloatArray,
    R: FloatArray,
    mode: IntArray,
    camera: KernelCamera,
) -> bool:
    side, slope, expected = np.empty(4), np.empty((4, UNKNOWNS)), np.empty(CHANNELS)
    J = np.empty((CHANNELS, UNKNOWNS))
    if not cuboid_sides(camera, at[X], at[Y], 0.0, at[LENGTH:], side, slope):
        return False
    box_channels(side, slope, mode, expected, J)
    for channel in range(CHANNELS):
        axis = channel % 2
        if mode[axis] == NEITHER or (channel >= 2 and mode[axis] != WHOLE):
            continue
        h = np.zeros(STATES)
        for c in range(UNKNOWNS):
            h[OF_UNKNOWN[c]] = J[channel, c]
        innovation = z[channel] - expected[channel] - h @ (m - at)
        gain = P @ h
        S = h @ gain + R[channel]
        m += gain * (innovation / S)
        P -= np.outer(gain, gain) / S
    for c in range(3):
        m[LENGTH + c] = max(m[LENGTH + c], LEAST_SIZE[c])
    return True
