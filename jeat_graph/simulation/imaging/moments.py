"""The vehicles at a number of times, projected: outlines, faces and lights as the painter needs them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.simulation.world.scene import VehicleStates

_FADE_M = 25.0


class Look(NamedTuple):
    """What vehicles look like, one row a vehicle.

    Attributes:
        kind: (V,) index into `vehicles.KINDS`.
        size: (V, 3) length, width, height (m).
        colour: (V, 3) albedo of the paint.
        salt: (V,) of its texture.
        way: (V,) +1 facing away from the camera, -1 facing it.
        parked: (V,) true where it is parked.
        number: (V,) identity, for the instance buffer.
    """

    kind: IntArray
    size: FloatArray
    colour: FloatArray
    salt: IntArray
    way: IntArray
    parked: BoolArray
    number: IntArray


class Moments(NamedTuple):
    """V vehicles at J times, in the picture.

    A half-plane is (a, b, c): a u + b v + c is 0.5 plus the signed distance (px, inside positive) measured
    along the pixel grid, so that, limited to [0, 1], it is the part of a pixel on its inner side. A depth
    plane is (a, b, c) with a u + b v + c the inverse depth (1/m).

    Attributes:
        times: (J,) s.
        pose: (J, V, 4) x, y (m), sine and cosine of the direction of the vehicle's front.
        fade: (J, V) 0 where the vehicle is not there or out of range, up to 1.
        part_box: (J, V, PARTS, 4) left, top, right, bottom (px) of each body; empty where it is not seen.
        hull_count: (J, V, PARTS) sides of its outline.
        hull: (J, V, PARTS, 6, 3) half-planes of the outline.
        face_count: (J, V, PARTS) faces seen.
        face: (J, V, PARTS, 3) which.
        face_side: (J, V, PARTS, 3, 4, 3) half-planes of each face.
        face_depth: (J, V, PARTS, 3, 3) depth planes.
        face_light: (J, V, PARTS, 3, 3) illuminance in three channels (lux).
        face_slant: (J, V, PARTS, 3) 1 / cosine of the angle of view.
        depth: (J, V, PARTS, 2) nearest and farthest depth (m).
        lamp: (J, V, 4, 4) u, v (px), depth (m) and size (px) of head and tail lamps.
        lamp_flux: (J, V, 4, 3) radiance of the lamp's image, summed over pixels (cd/m²·px).
        lamp_seen: (J, V, 4) part of it that other vehicles leave free.
        touch: (J, V, 3, 4) boxes (px) of what a vehicle changes: body and shadow, glow, its beams' light.
    """

    times: FloatArray
    pose: FloatArray
    fade: FloatArray
    part_box: FloatArray
    hull_count: IntArray
    hull: FloatArray
    face_count: IntArray
    face: IntArray
    face_side: FloatArray
    face_depth: FloatArray
    face_light: FloatArray
    face_slant: FloatArray
    depth: FloatArray
    lamp: FloatArray
    lamp_flux: FloatArray
    lamp_seen: FloatArray
    touch: FloatArray


class Placed(NamedTuple):
    """V vehicles at J times, in the world.

    Attributes:
        times: (J,) s.
        pose: (J, V, 4) x, y (m), sine and cosine of the direction of the vehicle's front.
        fade: (J, V) how visible each is, 0 where it is not there or out of range, up to 1.
        brake: (J, V) how hard it brakes, 0 to 1.
    """

    times: FloatArray
    pose: FloatArray
    fade: FloatArray
    brake: FloatArray


def line_up(states: VehicleStates, number: IntArray, times: FloatArray, far_m: float) -> Placed:
    """Sort states of some times into a table of times by vehicles.

    Args:
        states: at the times.
        number: (V,) identities of the vehicles, ascending; others are left out.
        times: (J,) of the states (s).
        far_m: m.
    """
    column = np.minimum(np.searchsorted(number, states.object_id), max(len(number) - 1, 0))
    shape = (len(times), len(number))
    out = Placed(times, np.zeros((*shape, 4)), np.zeros(shape), np.zeros(shape))
    if not len(number):
        return out
    known = number[column] == states.object_id
    front = np.where(states.direction < 0, np.pi, 0.0)
    heading = states.pose[:, 2] + front
    sin, cos = np.sin(heading), np.cos(heading)
    at = (states.frame[known], column[known])
    out.pose[at] = np.column_stack([states.pose[:, :2], sin, cos])[known]
    ahead = states.acceleration[:, 0] * sin + states.acceleration[:, 1] * cos
    # Vehicles come out of the distance gradually: one that appeared at once would be a burst of events.
    out.fade[at] = np.clip((far_m - states.pose[:, 1]) / _FADE_M, 0.0, 1.0)[known]
    out.brake[at] = np.clip((-ahead - 0.6) / 0.8, 0.0, 1.0)[known]
    return out
