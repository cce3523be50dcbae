"""The vehicles at a number of times, projected: outlines, faces and lights as the painter needs them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.sehn.camera import Camera
from jeat_graph.sehn.imaging.config import RenderConfig
from jeat_graph.sehn.imaging.lighting import LAMP_HEIGHT_M, Lights, beam_candela, beam_lux, lamp_lux
from jeat_graph.sehn.imaging.optics import Optics
from jeat_graph.sehn.imaging.shapes import BOTTOM, EDGES, FACE_CORNERS, PARTS, body_table
from jeat_graph.sehn.scene import VehicleStates
from jeat_graph.sehn.vehicles import KINDS

NEAR_M = 0.5
SHADOW_M = 0.9  # how far beside a vehicle its body keeps the sky's light off the road
_FADE_M = 25.0
_LAMP_SIGMA_M = 0.07
_BODIES = body_table(tuple(kind.name for kind in KINDS))
_LAMPS = 4
# A face is lit evenly; beams light it as at most this high, for most of their light falls on its lower part.
_LIT_HEIGHT_M = 0.9
_BACK_LUX = 0.3  # what the road before a vehicle gives back of its own beams to its front


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


def line_up(
    states: VehicleStates, number: IntArray, count: int, far_m: float
) -> tuple[FloatArray, FloatArray]:
    """Sort states of `count` times into a table of times by vehicles.

    Args:
        states: at the times.
        number: (V,) identities of the vehicles, ascending; others are left out.
        count: number of times J.
        far_m: m.

    Returns:
        Poses (J, V, 4) with x, y, sine and cosine of the front's direction; and how visible each vehicle is,
        0 where it is not there, and how hard it brakes, (J, V, 2).
    """
    column = np.minimum(np.searchsorted(number, states.object_id), max(len(number) - 1, 0))
    pose = np.zeros((count, len(number), 4))
    more = np.zeros((count, len(number), 2))
    if not len(number):
        return pose, more
    known = number[column] == states.object_id
    front = np.where(states.direction < 0, np.pi, 0.0)
    heading = states.pose[:, 2] + front
    sin, cos = np.sin(heading), np.cos(heading)
    at = (states.frame[known], column[known])
    pose[at] = np.column_stack([states.pose[:, :2], sin, cos])[known]
    ahead = states.acceleration[:, 0] * sin + states.acceleration[:, 1] * cos
    # Vehicles come out of the distance gradually: one that appeared at once would be a burst of events.
    fade = np.clip((far_m - states.pose[:, 1]) / _FADE_M, 0.0, 1.0)
    more[at] = np.column_stack([fade, np.clip((-ahead - 0.6) / 0.8, 0.0, 1.0)])[known]
    return pose, more


def project_moments(
    times: FloatArray,
    pose: FloatArray,
    more: FloatArray,
    look: Look,
    camera: Camera,
    lights: Lights,
    optics: Optics,
    config: RenderConfig,
    every: IntArray,
) -> Moments:
    """Project vehicles at J times.

    Args:
        times: (J,) s.
        pose: as `line_up` returns it.
        more: as `line_up` returns it.
        look: what the vehicles look like.
        camera: the camera.
        lights: of the scene.
        optics: of the lens.
        config: settings.
        every: (V,) a vehicle is projected at each so-many-th time only, the last one included; where it is
            not, only its pose stands.
    """
    count, vehicles = pose.shape[:2]
    p = (count, vehicles, PARTS)
    out = Moments(
        times=times,
        pose=pose,
        fade=np.ascontiguousarray(more[..., 0]),
        part_box=np.zeros((*p, 4)),
        hull_count=np.zeros(p, dtype=np.int64),
        hull=np.zeros((*p, 6, 3)),
        face_count=np.zeros(p, dtype=np.int64),
        face=np.zeros((*p, 3), dtype=np.int64),
        face_side=np.zeros((*p, 3, 4, 3)),
        face_depth=np.zeros((*p, 3, 3)),
        face_light=np.zeros((*p, 3, 3)),
        face_slant=np.zeros((*p, 3)),
        depth=np.zeros((*p, 2)),
        lamp=np.zeros((count, vehicles, _LAMPS, 4)),
        lamp_flux=np.zeros((count, vehicles, _LAMPS, 3)),
        lamp_seen=np.zeros((count, vehicles, _LAMPS)),
        touch=np.zeros((count, vehicles, 3, 4)),
    )
    candela = np.array([config.taillight_candela, config.brakelight_candela, config.parking_candela])
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height])
    _project(
        out, np.ascontiguousarray(more[..., 1]), look, lens, camera.position,
        np.ascontiguousarray(camera.rotation), lights, optics, candela, _BODIES,
        every,
    )  # fmt: skip
    return out


@njit(cache=True)
def _project(
    out: Moments, brake: FloatArray, look: Look, lens: FloatArray, eye: FloatArray, rotation: FloatArray,
    lights: Lights, optics: Optics, candela: FloatArray, bodies: FloatArray,
    every: IntArray,
) -> None:  # fmt: skip
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    local = np.empty((8, 3))
    corner = np.empty((8, 3))
    pixel = np.empty((8, 3))
    seen = np.empty(6, dtype=np.bool_)
    normal = np.empty((6, 3))
    forward = rotation[2]
    for j in range(len(out.times)):
        for v in range(len(look.kind)):
            if out.fade[j, v] <= 0.0 or (j + 1) % every[v] != 0:
                continue
            x, y, sin, cos = out.pose[j, v]
            length, wide, high = look.size[v]
            # Range along the vehicle in which its whole cross-section is in front of the near plane.
            slope = forward[0] * sin + forward[1] * cos
            base = forward[0] * (x - eye[0]) + forward[1] * (y - eye[1]) - forward[2] * eye[2]
            base -= 0.5 * wide * abs(forward[0] * cos - forward[1] * sin)
            base += min(0.0, high * forward[2])
            low_m, high_m = -np.inf, np.inf
            if slope > 1e-9:
                low_m = (NEAR_M - base) / slope
            elif slope < -1e-9:
                high_m = (NEAR_M - base) / slope
            elif base < NEAR_M:
                low_m = np.inf
            for part in range(PARTS):
                body = bodies[look.kind[v], part]
                if min(body[1], body[3]) * length <= low_m or max(body[0], body[2]) * length >= high_m:
                    continue
                mid_x, mid_y, mid_z, mid_u, mid_v = 0.0, 0.0, 0.0, 0.0, 0.0
                for k in range(8):
                    top = k & 1
                    along = length * body[2 * top + (k >> 2)]
                    along = min(max(along, low_m), high_m)
                    across = wide * body[4 + top] * (1.0 if k & 2 else -1.0)
                    z = high * body[6 + top]
                    local[k, 0], local[k, 1], local[k, 2] = along, across, z
                    corner[k, 0] = x + along * sin + across * cos
                    corner[k, 1] = y + along * cos - across * sin
                    corner[k, 2] = z
                    dx, dy, dz = corner[k, 0] - eye[0], corner[k, 1] - eye[1], z - eye[2]
                    X = rotation[0, 0] * dx + rotation[0, 1] * dy + rotation[0, 2] * dz
                    Y = rotation[1, 0] * dx + rotation[1, 1] * dy + rotation[1, 2] * dz
                    Z = rotation[2, 0] * dx + rotation[2, 1] * dy + rotation[2, 2] * dz
                    pixel[k, 0], pixel[k, 1], pixel[k, 2] = fx * X / Z + cx, fy * Y / Z + cy, Z
                    mid_x += corner[k, 0] / 8.0
                    mid_y += corner[k, 1] / 8.0
                    mid_z += z / 8.0
                    mid_u += pixel[k, 0] / 8.0
                    mid_v += pixel[k, 1] / 8.0
                left, up = pixel[:, 0].min() - 1.0, pixel[:, 1].min() - 1.0
                right, low = pixel[:, 0].max() + 1.0, pixel[:, 1].max() + 1.0
                out.part_box[j, v, part] = np.array([left, up, right, low])
                out.depth[j, v, part, 0] = pixel[:, 2].min()
                out.depth[j, v, part, 1] = pixel[:, 2].max()
                faces = 0
                for f in range(6):
                    a, b = corner[FACE_CORNERS[f, 0]], corner[FACE_CORNERS[f, 1]]
                    c, d = corner[FACE_CORNERS[f, 2]], corner[FACE_CORNERS[f, 3]]
                    e1, e2 = c - a, d - b
                    nx = e1[1] * e2[2] - e1[2] * e2[1]
                    ny = e1[2] * e2[0] - e1[0] * e2[2]
                    nz = e1[0] * e2[1] - e1[1] * e2[0]
                    size = math.sqrt(nx * nx + ny * ny + nz * nz)
                    seen[f] = False
                    if size < 1e-12:
                        continue
                    outward = nx * (a[0] - mid_x) + ny * (a[1] - mid_y) + nz * (a[2] - mid_z)
                    size = math.copysign(size, outward)
                    nx, ny, nz = nx / size, ny / size, nz / size
                    normal[f, 0], normal[f, 1], normal[f, 2] = nx, ny, nz
                    facing = nx * (eye[0] - a[0]) + ny * (eye[1] - a[1]) + nz * (eye[2] - a[2])
                    seen[f] = facing > 1e-6
                    if not seen[f] or f == BOTTOM or faces == 3:
                        continue
                    out.face[j, v, part, faces] = f
                    # Inverse depth is linear in the picture: n · ray / (n · (a - eye)).
                    scale = -1.0 / facing
                    n0 = rotation[0, 0] * nx + rotation[0, 1] * ny + rotation[0, 2] * nz
                    n1 = rotation[1, 0] * nx + rotation[1, 1] * ny + rotation[1, 2] * nz
                    n2 = rotation[2, 0] * nx + rotation[2, 1] * ny + rotation[2, 2] * nz
                    plane = out.face_depth[j, v, part, faces]
                    plane[0], plane[1] = scale * n0 / fx, scale * n1 / fy
                    plane[2] = scale * (n2 - n0 * cx / fx - n1 * cy / fy)
                    far = math.sqrt((eye[0] - mid_x) ** 2 + (eye[1] - mid_y) ** 2 + (eye[2] - mid_z) ** 2)
                    out.face_slant[j, v, part, faces] = min(6.0, far / max(facing, 1e-6))
                    for k in range(4):
                        _half_plane(
                            pixel[FACE_CORNERS[f, k]],
                            pixel[FACE_CORNERS[f, (k + 1) % 4]],
                            (pixel[FACE_CORNERS[f, 0]] + pixel[FACE_CORNERS[f, 2]]) / 2.0,
                            out.face_side[j, v, part, faces, k],
                        )
                    centre = (a + c) / 2.0
                    light = out.face_light[j, v, part, faces]
                    _light_face(out, j, v, look, lights, centre, nx, ny, nz, light)
                    faces += 1
                out.face_count[j, v, part] = faces
                sides = 0
                middle = np.array([mid_u, mid_v, 0.0])
                for k in range(12):
                    if seen[EDGES[k, 2]] != seen[EDGES[k, 3]] and sides < 6:
                        _half_plane(
                            pixel[EDGES[k, 0]], pixel[EDGES[k, 1]], middle, out.hull[j, v, part, sides]
                        )
                        sides += 1
                out.hull_count[j, v, part] = sides
            _touch(out, j, v, look, lens, eye, rotation, lights)
            if lights.on:
                _light_lamps(out, j, v, brake[j, v], look, lens, eye, rotation, lights, candela)
        if lights.on:
            _hide_lamps(out, j, look, eye, optics, every)


@njit(cache=True)
def _half_plane(p: FloatArray, q: FloatArray, inside: FloatArray, out: FloatArray) -> None:
    """Write the half-plane beyond the line through two pixels, on the side of a third."""
    a, b = p[1] - q[1], q[0] - p[0]
    reach = abs(a) + abs(b)
    if reach < 1e-9:
        out[0], out[1], out[2] = 0.0, 0.0, 1.0
        return
    if a * (inside[0] - p[0]) + b * (inside[1] - p[1]) < 0.0:
        reach = -reach
    out[0], out[1] = a / reach, b / reach
    out[2] = 0.5 - out[0] * p[0] - out[1] * p[1]


@njit(cache=True)
def _light_face(
    out: Moments, j: int, v: int, look: Look, lights: Lights, at: FloatArray,
    nx: float, ny: float, nz: float, light: FloatArray,
) -> None:  # fmt: skip
    """Illuminance of a face at its centre by sky, sun, lamps and the beams of other vehicles."""
    sun = max(0.0, nx * lights.sun[0] + ny * lights.sun[1] + nz * lights.sun[2])
    sun *= lights.sun_lux / lights.sun[2]
    # A wall sees half the sky, and the road, which gives back a tenth of its light.
    sky = lights.sky_lux * (0.55 + 0.45 * nz) + 0.1 * lights.sun_lux * (0.5 - 0.5 * nz)
    lamp = lamp_lux(at[0], at[1], at[2], nx, ny, nz, lights)
    if len(lights.lamps):
        lamp += 0.05 * lamp_lux(at[0], at[1], 0.0, 0.0, 0.0, 1.0, lights)
    beams = 0.0
    if lights.on:
        for w in range(len(look.kind)):
            if w == v or look.parked[w] or out.fade[j, w] <= 0.0:
                continue
            ox, oy, sin, cos = out.pose[j, w]
            lamp_x, lamp_y = ox + 0.5 * look.size[w, 0] * sin, oy + 0.5 * look.size[w, 0] * cos
            height = min(at[2], _LIT_HEIGHT_M)
            beams += beam_lux(at[0], at[1], height, nx, ny, nz, lamp_x, lamp_y, sin, cos, lights)
        if ny * out.pose[j, v, 3] + nx * out.pose[j, v, 2] > 0.5 and not look.parked[v]:
            beams += _BACK_LUX
    for c in range(3):
        light[c] = (
            sun * lights.sun_tint[c]
            + sky * lights.sky_tint[c]
            + lamp * lights.lamp_tint[c]
            + beams * lights.head_tint[c]
        )


@njit(cache=True)
def _grow(
    box: FloatArray, px: float, py: float, pz: float, lens: FloatArray, eye: FloatArray, rotation: FloatArray
) -> bool:
    """Grow a box by the image of a point; false where the point is behind the camera."""
    dx, dy, dz = px - eye[0], py - eye[1], pz - eye[2]
    Z = rotation[2, 0] * dx + rotation[2, 1] * dy + rotation[2, 2] * dz
    if Z < 1.0:
        return False
    u = lens[0] * (rotation[0, 0] * dx + rotation[0, 1] * dy + rotation[0, 2] * dz) / Z + lens[2]
    v = lens[1] * (rotation[1, 0] * dx + rotation[1, 1] * dy + rotation[1, 2] * dz) / Z + lens[3]
    box[0], box[1] = min(box[0], u), min(box[1], v)
    box[2], box[3] = max(box[2], u), max(box[3], v)
    return True


@njit(cache=True)
def _touch(
    out: Moments, j: int, v: int, look: Look, lens: FloatArray, eye: FloatArray, rotation: FloatArray,
    lights: Lights,
) -> None:  # fmt: skip
    """Boxes of what a vehicle changes in the picture."""
    x, y, sin, cos = out.pose[j, v]
    length, wide, high = look.size[v]
    box = out.touch[j, v, 0]
    box[0], box[1], box[2], box[3] = 1e9, 1e9, -1e9, -1e9
    for part in range(PARTS):
        if out.hull_count[j, v, part]:
            body = out.part_box[j, v, part]
            box[0], box[1] = min(box[0], body[0]), min(box[1], body[1])
            box[2], box[3] = max(box[2], body[2]), max(box[3], body[3])
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
        whole &= _grow(box, px, py, 0.0, lens, eye, rotation)
    if not whole and box[2] > box[0]:
        box[3] = lens[5]
    beam = out.touch[j, v, 2]
    beam[0], beam[1], beam[2], beam[3] = 1e9, 1e9, -1e9, -1e9
    if lights.on and not look.parked[v]:
        whole = True
        for k in range(16):
            share = (k >> 1) / 7.0
            forward = lights.beam_range_m * share * share
            across = (0.6 + 1.3 * forward) * (1.0 if k & 1 else -1.0)
            across = min(max(across, -30.0), 30.0)
            forward += 0.5 * length
            px, py = x + forward * sin + across * cos, y + forward * cos - across * sin
            whole &= _grow(beam, px, py, 0.0, lens, eye, rotation)
            whole &= _grow(beam, px, py, 0.9, lens, eye, rotation)
        if not whole and beam[2] > beam[0]:
            beam[0], beam[2], beam[3] = 0.0, lens[4], lens[5]


@njit(cache=True)
def _light_lamps(
    out: Moments, j: int, v: int, brake: float, look: Look, lens: FloatArray, eye: FloatArray,
    rotation: FloatArray, lights: Lights, candela: FloatArray,
) -> None:  # fmt: skip
    """Place the lamps of a vehicle in the picture: two in front, two behind."""
    x, y, sin, cos = out.pose[j, v]
    length, wide = look.size[v, 0], look.size[v, 1]
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    for k in range(_LAMPS):
        ahead = 1.0 if k < 2 else -1.0
        across = 0.39 * wide * (1.0 if k & 1 else -1.0)
        along = 0.5 * length * ahead
        z = LAMP_HEIGHT_M + (0.0 if k < 2 else 0.2)
        dx, dy = x + along * sin + across * cos - eye[0], y + along * cos - across * sin - eye[1]
        dz = z - eye[2]
        Z = rotation[2, 0] * dx + rotation[2, 1] * dy + rotation[2, 2] * dz
        # From the lamp to the eye, along the vehicle's axes.
        forward = -(dx * sin + dy * cos) * ahead
        if Z < 2.0 or forward <= 0.0:
            continue
        distance2 = dx * dx + dy * dy + dz * dz
        facing = forward / math.sqrt(distance2)
        if look.parked[v]:
            power = candela[2] * facing
        elif k < 2:
            power = 0.5 * beam_candela(forward, -(dx * cos - dy * sin), -dz, lights)
        else:
            power = (candela[0] + (candela[1] - candela[0]) * brake) * facing
        at = out.lamp[j, v, k]
        at[0] = fx * (rotation[0, 0] * dx + rotation[0, 1] * dy + rotation[0, 2] * dz) / Z + cx
        at[1] = fy * (rotation[1, 0] * dx + rotation[1, 1] * dy + rotation[1, 2] * dz) / Z + cy
        at[2] = Z
        at[3] = math.sqrt((_LAMP_SIGMA_M * fx / Z) ** 2 + 0.25)
        red = k >= 2
        for c in range(3):
            tint = lights.tail_tint[c] if red else lights.head_tint[c]
            out.lamp_flux[j, v, k, c] = out.fade[j, v] * power * fx * fy / distance2 * tint


@njit(cache=True)
def _hide_lamps(out: Moments, j: int, look: Look, eye: FloatArray, optics: Optics, every: IntArray) -> None:
    """Dim the lamps that stand behind other vehicles, and say how far their glow reaches."""
    for v in range(len(look.kind)):
        if (j + 1) % every[v] != 0:
            continue
        box = out.touch[j, v, 1]
        box[0], box[1], box[2], box[3] = 1e9, 1e9, -1e9, -1e9
        for k in range(_LAMPS):
            if out.lamp_flux[j, v, k, 0] <= 0.0:
                continue
            x, y, sin, cos = out.pose[j, v]
            along = (0.5 if k < 2 else -0.5) * look.size[v, 0]
            across = 0.39 * look.size[v, 1] * (1.0 if k & 1 else -1.0)
            px, py = x + along * sin + across * cos, y + along * cos - across * sin
            pz = LAMP_HEIGHT_M + (0.0 if k < 2 else 0.2)
            free = 1.0
            for w in range(len(look.kind)):
                if w != v and out.fade[j, w] > 0.0:
                    # Nearer vehicles only; a ray that passes through one is dimmed by its way inside it.
                    if out.pose[j, w, 1] > py + 10.0:
                        continue
                    inside = chord(px, py, pz, eye[0], eye[1], eye[2], out.pose[j, w], look.size[w])
                    free *= 1.0 - min(1.0, inside / 0.2)
            out.lamp_seen[j, v, k] = free
            if free > 0.0:
                u, vv = out.lamp[j, v, k, 0], out.lamp[j, v, k, 1]
                reach = max(optics.reach_px, 4.0 * out.lamp[j, v, k, 3])
                box[0], box[1] = min(box[0], u - reach), min(box[1], vv - reach)
                box[2], box[3] = max(box[2], u + reach), max(box[3], vv + reach)


@njit(cache=True)
def chord(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, pose: FloatArray, size: FloatArray
) -> float:
    """Length (m) of the part of the way from a to b that lies within a vehicle's box, a little shrunk."""
    sin, cos = pose[2], pose[3]
    ox, oy = ax - pose[0], ay - pose[1]
    dx, dy, dz = bx - ax, by - ay, bz - az
    low, high = 0.0, 1.0
    for axis in range(3):
        if axis == 0:
            start, step, most = ox * sin + oy * cos, dx * sin + dy * cos, 0.48 * size[0]
        elif axis == 1:
            start, step, most = ox * cos - oy * sin, dx * cos - dy * sin, 0.46 * size[1]
        else:
            start, step, most = az, dz, 0.92 * size[2]
        least = -most if axis < 2 else 0.0
        if abs(step) < 1e-12:
            if start < least or start > most:
                return 0.0
            continue
        first, second = (least - start) / step, (most - start) / step
        low, high = max(low, min(first, second)), min(high, max(first, second))
    if high <= low:
        return 0.0
    return (high - low) * math.sqrt(dx * dx + dy * dy + dz * dz)
