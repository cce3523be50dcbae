"""Projection of the vehicles' bodies: outlines, faces, depths."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.faces import light_face
from jeat_graph_sehn.simulation.imaging.lamps import LAMPS, hide_lamps, light_lamps
from jeat_graph_sehn.simulation.imaging.lighting import Lights, Surface
from jeat_graph_sehn.simulation.imaging.moments import (
    BODY_RECORD,
    BOX,
    FACE,
    FACE_LIGHT,
    FACE_PLANE,
    FACE_RECORD,
    FACE_SIDE,
    FACE_SLANT,
    FACES,
    FAR,
    HULL,
    LAMP_RECORD,
    NEAR,
    PAINT,
    SIDES,
    Look,
    Moments,
    Placed,
)
from jeat_graph_sehn.simulation.imaging.optics import Optics
from jeat_graph_sehn.simulation.imaging.reach import touch
from jeat_graph_sehn.simulation.imaging.shapes import BOTTOM, EDGES, FACE_CORNERS, PARTS
from jeat_graph_sehn.simulation.imaging.tiles import View

NEAR_M = 0.5
_MOST_SLANT = 6.0  # a face seen at a grazing angle is filtered no wider than this


def project_moments(
    placed: Placed, look: Look, every: IntArray, view: View, lights: Lights, optics: Optics
) -> Moments:
    """Project vehicles at J times.

    Args:
        placed: where the vehicles are.
        look: what they look like.
        every: (V,) a vehicle is projected at each so-many-th time only, the last one included; where it is
            not, only its pose stands.
        view: the camera.
        lights: of the scene.
        optics: of the lens.
    """
    count, vehicles = placed.pose.shape[:2]
    out = Moments(
        times=placed.times,
        pose=placed.pose,
        fade=placed.fade,
        body=np.zeros((count, vehicles, PARTS, BODY_RECORD)),
        lamp=np.zeros((count, vehicles, LAMPS, LAMP_RECORD)),
        touch=np.zeros((count, vehicles, 3, 4)),
    )
    _project(out, placed.signal, look, every, view, lights, optics)
    return out


@njit(cache=True, error_model="numpy")
def _project(
    out: Moments, signal: FloatArray, look: Look, every: IntArray, view: View, lights: Lights, optics: Optics
) -> None:
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    eye, rotation = view.eye, view.rotation
    corner = np.empty((8, 3))
    pixel = np.empty((8, 3))
    seen = np.empty(6, dtype=np.bool_)
    forward = rotation[2]
    for j in range(len(out.times)):
        for v in range(len(look.kind)):
            if out.fade[j, v] <= 0.0 or (j + 1) % every[v] != 0:
                continue
            x, y, sin, cos = out.pose[j, v]
            length, wide, high = look.size[v]
            low_m, high_m = _in_front(x, y, sin, cos, wide, high, eye, forward)
            for part in range(PARTS):
                body = look.shape[v, part]
                if body[7] <= body[6]:
                    continue
                if min(body[1], body[3]) * length <= low_m or max(body[0], body[2]) * length >= high_m:
                    continue
                mid_x, mid_y, mid_z, mid_u, mid_v = 0.0, 0.0, 0.0, 0.0, 0.0
                for k in range(8):
                    top = k & 1
                    along = length * body[2 * top + (k >> 2)]
                    along = min(max(along, low_m), high_m)
                    across = wide * body[4 + top] * (1.0 if k & 2 else -1.0)
                    z = high * body[6 + top]
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
                record = out.body[j, v, part]
                record[BOX], record[BOX + 1], record[BOX + 2], record[BOX + 3] = left, up, right, low
                record[PAINT] = body[8]
                record[NEAR], record[FAR] = pixel[:, 2].min(), pixel[:, 2].max()
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
                    facing = nx * (eye[0] - a[0]) + ny * (eye[1] - a[1]) + nz * (eye[2] - a[2])
                    seen[f] = facing > 1e-6
                    if not seen[f] or f == BOTTOM or faces == 3:
                        continue
                    shown = record[FACE + faces * FACE_RECORD : FACE + (faces + 1) * FACE_RECORD]
                    shown[0] = f
                    centre = (a + c) / 2.0
                    surface = Surface(centre[0], centre[1], centre[2], nx, ny, nz)
                    _face_plane(shown[FACE_PLANE : FACE_PLANE + 3], surface, facing, view)
                    _face_sides(shown[FACE_SIDE:], f, pixel)
                    far = math.sqrt((eye[0] - mid_x) ** 2 + (eye[1] - mid_y) ** 2 + (eye[2] - mid_z) ** 2)
                    shown[FACE_SLANT] = min(_MOST_SLANT, far / facing)
                    light_face(out, j, v, look, surface, lights, shown[FACE_LIGHT : FACE_LIGHT + 3])
                    faces += 1
                record[FACES] = faces
                sides = 0
                middle = np.array([mid_u, mid_v, 0.0])
                for k in range(12):
                    if seen[EDGES[k, 2]] != seen[EDGES[k, 3]] and sides < 6:
                        side = record[HULL + 3 * sides : HULL + 3 * sides + 3]
                        _half_plane(pixel[EDGES[k, 0]], pixel[EDGES[k, 1]], middle, side)
                        sides += 1
                record[SIDES] = sides
            touch(out, j, v, look, view, lights)
            if lights.signals:
                light_lamps(out, j, v, signal[j, v], look, view, lights)
        if lights.on:
            hide_lamps(out, j, look, eye, lights, optics, every)


@njit(cache=True, error_model="numpy")
def _in_front(
    x: float, y: float, sin: float, cos: float, wide: float, high: float, eye: FloatArray, forward: FloatArray
) -> tuple[float, float]:
    """Range along a vehicle (m) in which its whole cross-section is in front of the near plane."""
    slope = forward[0] * sin + forward[1] * cos
    base = forward[0] * (x - eye[0]) + forward[1] * (y - eye[1]) - forward[2] * eye[2]
    base -= 0.5 * wide * abs(forward[0] * cos - forward[1] * sin)
    base += min(0.0, high * forward[2])
    if slope > 1e-9:
        return (NEAR_M - base) / slope, np.inf
    if slope < -1e-9:
        return -np.inf, (NEAR_M - base) / slope
    return (np.inf if base < NEAR_M else -np.inf), np.inf


@njit(cache=True, error_model="numpy")
def _face_plane(plane: FloatArray, face: Surface, facing: float, view: View) -> None:
    """Write the depth plane (3,) of a face whose plane lies `facing` m before the eye."""
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    rotation, nx, ny, nz = view.rotation, face.nx, face.ny, face.nz
    # Inverse depth is linear in the picture: n · ray / (n · (corner - eye)).
    scale = -1.0 / facing
    n0 = rotation[0, 0] * nx + rotation[0, 1] * ny + rotation[0, 2] * nz
    n1 = rotation[1, 0] * nx + rotation[1, 1] * ny + rotation[1, 2] * nz
    n2 = rotation[2, 0] * nx + rotation[2, 1] * ny + rotation[2, 2] * nz
    plane[0], plane[1] = scale * n0 / fx, scale * n1 / fy
    plane[2] = scale * (n2 - n0 * cx / fx - n1 * cy / fy)


@njit(cache=True, error_model="numpy")
def _face_sides(sides: FloatArray, f: int, pixel: FloatArray) -> None:
    """Write the half-planes (12,) of face `f` from the pixels (8, 3) of its body's corners."""
    centre = (pixel[FACE_CORNERS[f, 0]] + pixel[FACE_CORNERS[f, 2]]) / 2.0
    for k in range(4):
        start, end = pixel[FACE_CORNERS[f, k]], pixel[FACE_CORNERS[f, (k + 1) % 4]]
        _half_plane(start, end, centre, sides[3 * k : 3 * k + 3])


@njit(cache=True, error_model="numpy")
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
