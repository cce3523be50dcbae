"""Textures of vehicles: paint, glass, wheels, lamps' housings, as albedo at a place on a face."""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from jeat_graph.simulation.imaging.shapes import FRONT, LEFT, REAR, RIGHT, TOP
from jeat_graph.simulation.imaging.smooth import band, clamp01, disc, value_noise

CAR, SUV, VAN, TRUCK = range(4)  # as in `vehicles.KINDS`
PALETTE = (
    (0.70, 0.70, 0.69), (0.42, 0.43, 0.44), (0.16, 0.165, 0.17), (0.035, 0.035, 0.04), (0.05, 0.09, 0.24),
    (0.36, 0.05, 0.045), (0.62, 0.61, 0.58), (0.24, 0.26, 0.28), (0.07, 0.15, 0.12), (0.45, 0.36, 0.20),
)  # fmt: skip
_GLASS = 0.03
_TYRE = 0.025


class Body(NamedTuple):
    """One of the bodies that a vehicle is made of.

    Attributes:
        kind: index into `vehicles.KINDS`.
        part: 0 underbody, 1 body or trailer, 2 cabin.
        length: of the vehicle (m).
        width: of the vehicle (m).
        height: of the vehicle (m).
        colour: the paint's albedo, red, green, blue.
        salt: makes each vehicle's texture its own.
    """

    kind: int
    part: int
    length: float
    width: float
    height: float
    colour: tuple[float, float, float]
    salt: int


@njit(cache=True)
def paint(
    body: Body, face: int, along: float, across: float, z: float, soft: float
) -> tuple[float, float, float, float]:
    """Albedo (red, green, blue) and share of glass at a place on a vehicle.

    Args:
        body: which body, of what vehicle.
        face: of the body, as in `shapes`.
        along: from the middle to the front (m).
        across: from the middle to the vehicle's right (m).
        z: above the road (m).
        soft: width of the filter, about a pixel on the face (m).
    """
    kind, part, length, width, height, colour, salt = body
    if part == 0:
        return _TYRE, _TYRE, _TYRE, 0.0
    r, g, b = colour
    glass = 0.0
    dark = 0.0
    h, w = z / height, abs(across) / (0.5 * width)
    y = along / length
    wide = soft
    if kind == TRUCK and part == 1:
        # The trailer: a light tarpaulin with a coloured field, ribs on the side, doors behind.
        tone = 0.62 + 0.06 * value_noise(1.3 * along, 2.0 * z + across, salt)
        if face in (LEFT, RIGHT):
            field = band(y, -0.36, 0.16, wide / length) * band(h, 0.45, 0.85, wide / height)
            rib = band(along % 1.2, 0.0, 0.06, max(wide, 0.06))
        elif face == REAR:
            field = 0.0
            rib = band(across, -0.03, 0.03, wide) + band(h, 0.28, 0.33, wide / height)
        else:
            field = 0.0
            rib = 0.4 * band(along % 1.2, 0.0, 0.08, max(wide, 0.08)) if face == TOP else 0.0
        keep = (1.0 - field) * tone
        shade = 1.0 - 0.55 * clamp01(rib)
        return (
            (keep + field * r) * shade,
            (keep + field * g) * shade,
            (keep * 0.97 + field * b) * shade,
            0.0,
        )
    if part == 1 or kind == TRUCK or (kind == VAN and face in (LEFT, RIGHT, TOP)):
        if face in (LEFT, RIGHT):
            radius = 0.34 if kind != TRUCK else 0.5
            ends = 0.30 * length if kind != TRUCK else 0.42 * length
            wheel = disc(abs(along) - ends, z - radius, radius, wide)
            dark = max(dark, 0.95 * wheel)
            if part == 1:
                dark = max(dark, 0.5 * band(y, 0.02, 0.02 + 0.03 / length, max(wide, 0.03) / length))
                dark = max(dark, 0.55 * band(h, 0.0, 0.22, wide / height))
            if kind == VAN and part == 2:
                glass = band(y, 0.14, 0.30, wide / length) * band(h, 0.52, 0.86, wide / height)
        elif face == FRONT:
            grille = band(w, -1.0, 0.55, wide / width) * band(h, 0.25, 0.42, wide / height)
            dark = max(dark, 0.85 * grille)
            if kind == TRUCK:
                glass = band(h, 0.52, 0.76, wide / height) * band(w, -1.0, 0.9, wide / width)
        elif face == REAR:
            plate = band(across, -0.26, 0.26, wide) * band(h, 0.32, 0.32 + 0.11 / height, wide / height)
            dark = max(dark, 0.5 * band(h, 0.0, 0.28, wide / height))
            if kind == VAN:
                dark = max(dark, 0.6 * band(across, -0.02, 0.02, wide))
            r, g, b = r + plate * (0.6 - r), g + plate * (0.6 - g), b + plate * (0.55 - b)
        if face in (FRONT, REAR):
            lamp = band(w, 0.64, 0.94, wide / width) * band(h, 0.40, 0.52, wide / height)
            red = 0.25 if face == REAR else 0.45
            cool = 0.03 if face == REAR else 0.45
            r, g, b = r + lamp * (red - r), g + lamp * (cool - g), b + lamp * (cool - b)
        if face == TOP and part == 1:
            # The bonnet's joint, across, and a gap where the cabin stands.
            dark = max(dark, 0.35 * band(y, 0.24, 0.24 + 0.05 / length, max(wide, 0.05) / length))
    elif face == TOP:
        if kind == SUV:
            dark = max(dark, 0.6 * band(w, 0.80, 0.9, wide / width))
        dark = max(dark, 0.8 * band(y, -0.12, -0.02, wide / length) * band(w, -1.0, 0.6, wide / width))
    elif face == FRONT:
        glass = band(w, -1.0, 0.88, wide / width) * band(h, 0.60, 0.97, wide / height)
    elif face == REAR:
        glass = band(w, -1.0, 0.82, wide / width) * band(h, 0.62, 0.93, wide / height)
    else:
        glass = band(h, 0.64, 0.93, wide / height)
        pillar = band(y, -0.09, -0.09 + 0.08 / length, max(wide, 0.08) / length)
        glass *= 1.0 - pillar
    shade = (1.0 - dark) * (1.0 + 0.05 * value_noise(1.5 * along + 7.0 * across, 2.5 * z, salt))
    floor = _TYRE * dark
    keep = (1.0 - glass) * shade
    return (
        keep * r + floor + glass * _GLASS,
        keep * g + floor + glass * _GLASS,
        keep * b + floor + glass * _GLASS,
        glass,
    )
