"""What of the picture a vehicle changes: by its body and shadow, and by its beams' light."""

from __future__ import annotations

from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.lighting import Lights
from jeat_graph_sehn.simulation.imaging.moments import BOX, SIDES, Look, Moments
from jeat_graph_sehn.simulation.imaging.shapes import PARTS
from jeat_graph_sehn.simulation.imaging.tiles import View

SHADOW_M = 0.9  # how far beside a vehicle its body keeps the sky's light off the road


@njit(cache=True, error_model="numpy")
def touch(out: Moments, j: int, v: int, look: Look, view: View, lights: Lights) -> None:
    """Boxes of what a vehicle changes in the picture."""
    x, y, sin, cos = out.pose[j, v]
    length, wide, high = look.size[v]
    box = out.touch[j, v, 0]
    box[0], box[1], box[2], box[3] = 1e9, 1e9, -1e9, -1e9
    for part in range(PARTS):
        body = out.body[j, v, part]
        if body[SIDES] > 0.0:
            box[0], box[1] = min(box[0], body[BOX]), min(box[1], body[BOX + 1])
            box[2], box[3] = max(box[2], body[BOX + 2]), max(box[3], body[BOX + 3])
    shift_x = shift_y = 0.0
    if lights.sun_lux > 0.0:
        shift_x = -lights.sun[0] / lights.sun[2] * high
        shift_y = -lights.sun[1] / lights.sun[2] * high
    whole = True
    for k in range(8):
        along = (0.5 * length + SHADOW_M) * (1.0 if k & 1 else -1.0)
        across = (0.5 * wide + SHADOW_M) * (1.0 if k & 2 else -1.0)
        px, py = x + along * sin + across * cos, y + along * cos - across * sin
        if k & 4:
            px, py = px + shift_x, py + shift_y
        whole &= _grow(box, px, py, 0.0, view)
    if not whole and box[2] > box[0]:
        box[3] = view.lens[5]
    beam = out.touch[j, v, 2]
    beam[0], beam[1], beam[2], beam[3] = 1e9, 1e9, -1e9, -1e9
    if lights.on and look.beams[v]:
        whole = True
        for k in range(16):
            share = (k >> 1) / 7.0
            forward = lights.beam_range_m * share * share
            across = (0.6 + 1.3 * forward) * (1.0 if k & 1 else -1.0)
            across = min(max(across, -30.0), 30.0)
            forward += 0.5 * length
            px, py = x + forward * sin + across * cos, y + forward * cos - across * sin
            whole &= _grow(beam, px, py, 0.0, view)
            whole &= _grow(beam, px, py, 0.9, view)
        if not whole and beam[2] > beam[0]:
            beam[0], beam[2], beam[3] = 0.0, view.lens[4], view.lens[5]


@njit(cache=True, error_model="numpy")
def _grow(box: FloatArray, px: float, py: float, pz: float, view: View) -> bool:
    """Grow a box by the image of a point; false where the point is behind the camera."""
    lens, eye, rotation = view.lens, view.eye, view.rotation
    dx, dy, dz = px - eye[0], py - eye[1], pz - eye[2]
    Z = rotation[2, 0] * dx + rotation[2, 1] * dy + rotation[2, 2] * dz
    if Z < 1.0:
        return False
    u = lens[0] * (rotation[0, 0] * dx + rotation[0, 1] * dy + rotation[0, 2] * dz) / Z + lens[2]
    v = lens[1] * (rotation[1, 0] * dx + rotation[1, 1] * dy + rotation[1, 2] * dz) / Z + lens[3]
    box[0], box[1] = min(box[0], u), min(box[1], v)
    box[2], box[3] = max(box[2], u), max(box[3], v)
    return True
