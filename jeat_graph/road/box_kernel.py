"""Compiled projection of cuboids: the box that a vehicle of a size makes at a place, with its derivatives."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.road.camera import RoadCamera

#: What of an axis of a box is measured: centre and size, one side alone (the other is cut off), or nothing.
WHOLE, LOW, HIGH, NEITHER = 0, 1, 2, 3
#: Channels of a box: centre x, centre y (px), ln width, ln height.
CHANNELS = 4
#: Unknowns that a channel depends on: x, y of the footprint's middle, length, width, height (m).
UNKNOWNS = 5
_NEAR_M = 0.5


class KernelCamera(NamedTuple):
    """A camera as compiled code takes it.

    Attributes:
        rotation: (3, 3) road to camera.
        position: (3,) m.
        lens: (6,) fx, fy, cx, cy (px), k1, k2.
    """

    rotation: FloatArray
    position: FloatArray
    lens: FloatArray


def kernel_camera(camera: RoadCamera) -> KernelCamera:
    """Return a camera in the form that compiled code takes."""
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.k1, camera.k2])
    rotation = np.ascontiguousarray(camera.rotation, dtype=np.float64)
    return KernelCamera(rotation, np.ascontiguousarray(camera.position, dtype=np.float64), lens)


@njit(cache=True)
def cuboid_sides(
    camera: KernelCamera,
    x: float,
    y: float,
    heading: float,
    size: FloatArray,
    side: FloatArray,
    slope: FloatArray,
) -> bool:
    """Sides of the box of one cuboid and their derivatives; as `cuboid.sides`, which is its oracle in tests.

    Args:
        camera: the camera.
        x: middle of the footprint (m).
        y: the same along the road (m).
        heading: direction of the long axis, from y towards x (rad).
        size: (3,) length, width, height (m).
        side: (4,) filled: left, top, right, bottom (px).
        slope: (4, 5) filled: derivatives with respect to x, y, length, width, height (px/m).

    Returns:
        Whether the whole cuboid is in front of the camera.
    """
    R, lens, position = camera.rotation, camera.lens, camera.position
    sin, cos = math.sin(heading), math.cos(heading)
    # The footprint's middle, half a length ahead, half a width beside and the height, as the camera sees
    # them: right, below, before (m). All corners are sums of these.
    px, py, pz = x - position[0], y - position[1], -position[2]
    half_l, half_w, height = 0.5 * size[0], 0.5 * size[1], size[2]
    mx = R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz
    my = R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz
    mz = R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz
    lx = half_l * (R[0, 0] * sin + R[0, 1] * cos)
    ly = half_l * (R[1, 0] * sin + R[1, 1] * cos)
    lz = half_l * (R[2, 0] * sin + R[2, 1] * cos)
    wx = half_w * (R[0, 0] * cos - R[0, 1] * sin)
    wy = half_w * (R[1, 0] * cos - R[1, 1] * sin)
    wz = half_w * (R[2, 0] * cos - R[2, 1] * sin)
    hx, hy, hz = height * R[0, 2], height * R[1, 2], height * R[2, 2]
    left = top = right = bottom = 0
    side[0] = side[1] = np.inf
    side[2] = side[3] = -np.inf
    for k in range(8):
        a = -1.0 if k & 2 == 0 else 1.0
        b = -1.0 if k & 1 == 0 else 1.0
        c = 1.0 if k >= 4 else 0.0
        Z = mz + a * lz + b * wz + c * hz
        if Z < _NEAR_M:
            return False
        inverse = 1.0 / Z
        n0, n1 = (mx + a * lx + b * wx + c * hx) * inverse, (my + a * ly + b * wy + c * hy) * inverse
        r2 = n0 * n0 + n1 * n1
        gain = 1.0 + lens[4] * r2 + lens[5] * r2 * r2
        u, v = n0 * gain * lens[0] + lens[2], n1 * gain * lens[1] + lens[3]
        if u < side[0]:
            side[0], left = u, k
        if v < side[1]:
            side[1], top = v, k
        if u > side[2]:
            side[2], right = u, k
        if v > side[3]:
            side[3], bottom = v, k
    for s in range(4):
        k, axis = (left, top, right, bottom)[s], s % 2
        a = -0.5 if k & 2 == 0 else 0.5
        b = -0.5 if k & 1 == 0 else 0.5
        c = 1.0 if k >= 4 else 0.0
        Z = mz + 2.0 * (a * lz + b * wz) + c * hz
        n0, n1 = (mx + 2.0 * (a * lx + b * wx) + c * hx) / Z, (my + 2.0 * (a * ly + b * wy) + c * hy) / Z
        r2 = n0 * n0 + n1 * n1
        gain = 1.0 + lens[4] * r2 + lens[5] * r2 * r2
        bend = 2.0 * lens[4] + 4.0 * lens[5] * r2
        n = n0 if axis == 0 else n1
        f = lens[axis] / Z
        d0 = f * (n * n0 * bend + (gain if axis == 0 else 0.0))
        d1 = f * (n * n1 * bend + (gain if axis == 1 else 0.0))
        d2 = -(d0 * n0 + d1 * n1)
        gx = d0 * R[0, 0] + d1 * R[1, 0] + d2 * R[2, 0]
        gy = d0 * R[0, 1] + d1 * R[1, 1] + d2 * R[2, 1]
        gz = d0 * R[0, 2] + d1 * R[1, 2] + d2 * R[2, 2]
        slope[s, 0], slope[s, 1] = gx, gy
        slope[s, 2] = a * (gx * sin + gy * cos)
        slope[s, 3] = b * (gx * cos - gy * sin)
        slope[s, 4] = gz if k >= 4 else 0.0
    return True


@njit(cache=True)
def box_channels(side: FloatArray, slope: FloatArray, mode: IntArray, z: FloatArray, J: FloatArray) -> None:
    """Turn sides into what is measured of a box.

    Args:
        side: (4,) left, top, right, bottom (px).
        slope: (4, 5) their derivatives.
        mode: (2,) of `WHOLE`, `LOW`, `HIGH`, `NEITHER` per axis.
        z: (4,) filled: the channels; the centre's is the side itself where only that is measured.
        J: (4, 5) filled: their derivatives, zero for what is not measured.
    """
    for axis in range(2):
        low, high = side[axis], side[axis + 2]
        extent = max(high - low, 1e-6)
        z[axis], z[axis + 2] = 0.0, 0.0
        for c in range(UNKNOWNS):
            J[axis, c], J[axis + 2, c] = 0.0, 0.0
        if mode[axis] == WHOLE:
            z[axis] = 0.5 * (low + high)
            z[axis + 2] = math.log(extent)
            for c in range(UNKNOWNS):
                J[axis, c] = 0.5 * (slope[axis, c] + slope[axis + 2, c])
                J[axis + 2, c] = (slope[axis + 2, c] - slope[axis, c]) / extent
        elif mode[axis] != NEITHER:
            s = axis if mode[axis] == LOW else axis + 2
            z[axis] = side[s]
            for c in range(UNKNOWNS):
                J[axis, c] = slope[s, c]
