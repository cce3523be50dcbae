"""The vehicles at a number of times, projected: outlines, faces and lights as the painter needs them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph_sehn.simulation.world.scene import VehicleStates

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
        shape: (V, PARTS, 9) bodies as fractions of the size, and their paint (see `shapes`).
        lamps: (V, LAMPS, 4) across (of the width), height (m), kind and strength (see `lamps`).
        beams: (V,) true where headlights shine on the road.
        blink_hz: (V,) rate of the indicators.
        hazard: (V,) true where both flash while the vehicle stands.
        led: (V,) true where the tail lamps are LED.
    """

    kind: IntArray
    size: FloatArray
    colour: FloatArray
    salt: IntArray
    way: IntArray
    parked: BoolArray
    number: IntArray
    shape: FloatArray
    lamps: FloatArray
    beams: BoolArray
    blink_hz: FloatArray
    hazard: BoolArray
    led: BoolArray


# A body's record: sides and faces seen, box, nearest and farthest depth, outline, then a record a face.
SIDES, FACES, BOX, NEAR, FAR, HULL, FACE = 0, 1, 2, 6, 7, 8, 26
# A face's record: which, depth plane, light, 1 / cosine of the angle of view, half-planes of its four sides.
FACE_PLANE, FACE_LIGHT, FACE_SLANT, FACE_SIDE, FACE_RECORD = 1, 4, 7, 8, 20
PAINT = FACE + 3 * FACE_RECORD  # what it is painted as
BODY_RECORD = PAINT + 1
# A lamp's record: u, v (px), depth (m), size (px), flux in three channels, part seen, reach of its glow (px).
# and the part of the mean flux that a pulsed lamp has now (its glow is that of the mean).
LAMP_FLUX, LAMP_SEEN, LAMP_REACH, LAMP_PULSE, LAMP_RECORD = 4, 7, 8, 9, 10
# Of a vehicle's signals: how hard it brakes, how bright its left and right indicators are, its LED's pulse.
BRAKES, LEFT_ON, PULSE = 0, 1, 3


class Moments(NamedTuple):
    """V vehicles at J times, in the picture, as flat records that kernels take a view of cheaply.

    A half-plane is (a, b, c): a u + b v + c is 0.5 plus the signed distance (px, inside positive) measured
    along the pixel grid, so that, limited to [0, 1], it is the part of a pixel on its inner side. A depth
    plane is (a, b, c) with a u + b v + c the inverse depth (1/m).

    Attributes:
        times: (J,) s.
        pose: (J, V, 4) x, y (m), sine and cosine of the direction of the vehicle's front.
        fade: (J, V) 0 where the vehicle is not there or out of range, up to 1.
        body: (J, V, PARTS, BODY_RECORD) each body: sides of its outline and faces seen (0 where it is not
            seen), box left, top, right, bottom (px), nearest and farthest depth (m), half-planes of the
            outline (6), and of each face seen (3): which, depth plane, illuminance in three channels (lux),
            1 / cosine of the angle of view, half-planes of its sides (4).
        lamp: (J, V, LAMPS, LAMP_RECORD) each lamp: u, v (px), depth (m) and size (px), radiance of its image
            summed over pixels (cd/m²·px) in three channels, the part of it that other vehicles leave free,
            and how far its glow matters (px).
        touch: (J, V, 3, 4) boxes (px) of what a vehicle changes: body and shadow, glow, its beams' light.
    """

    times: FloatArray
    pose: FloatArray
    fade: FloatArray
    body: FloatArray
    lamp: FloatArray
    touch: FloatArray


class Placed(NamedTuple):
    """V vehicles at J times, in the world.

    Attributes:
        times: (J,) s.
        pose: (J, V, 4) x, y (m), sine and cosine of the direction of the vehicle's front.
        fade: (J, V) how visible each is, 0 where it is not there or out of range, up to 1.
        signal: (J, V, 4) how hard it brakes, how bright its left and right indicators are (0 to 1), and the
            pulse of its LED lamps (of their mean).
    """

    times: FloatArray
    pose: FloatArray
    fade: FloatArray
    signal: FloatArray


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
    out = Placed(times, np.zeros((*shape, 4)), np.zeros(shape), np.zeros((*shape, 4)))
    out.signal[..., PULSE] = 1.0
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
    away = np.hypot(states.pose[:, 0], states.pose[:, 1])
    out.fade[at] = np.clip((far_m - away) / _FADE_M, 0.0, 1.0)[known]
    # Who stands in a lane has a foot on the brake.
    speed = np.hypot(states.velocity[:, 0], states.velocity[:, 1])
    held = np.where(states.parked, 0.0, np.clip(1.5 - speed, 0.0, 1.0))
    out.signal[(*at, BRAKES)] = np.maximum(np.clip((-ahead - 0.6) / 0.8, 0.0, 1.0), held)[known]
    return out
