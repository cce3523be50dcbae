"""Textures of vehicles: paint, glass, wheels, lamps' housings, as albedo at a place on a face."""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from jeat_graph_sehn.simulation.imaging.shapes import (
    BED,
    BODY,
    BOX,
    CAB,
    COACH,
    DARK,
    FRONT,
    LEFT,
    REAR,
    RIDER,
    RIGHT,
    TOP,
    VAN_TOP,
)
from jeat_graph_sehn.simulation.imaging.smooth import band, clamp01, disc, table_noise

CAR, SUV, VAN, TRUCK, BUS, MOTORCYCLE, PICKUP = range(7)  # as in `vehicles.KINDS`
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
        part: what it is painted as, as in `shapes`.
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


@njit(cache=True, error_model="numpy")
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
    if part == DARK:
        return _TYRE, _TYRE, _TYRE, 0.0
    r, g, b = colour
    glass = 0.0
    dark = 0.0
    h, w = z / height, abs(across) / (0.5 * width)
    y = along / length
    wide = soft
    if part == RIDER:
        cloth = 0.03 + 0.25 * r
        return cloth, 0.03 + 0.25 * g, 0.03 + 0.25 * b, 0.0
    if part == COACH:
        return _coach(face, along, w, h, length, width, height, soft, colour)
    if part == BED:
        rib = band(along % 0.8, 0.0, 0.1, max(wide, 0.1)) if face in (LEFT, RIGHT) else 0.0
        load = 0.13 * (1.0 + 0.5 * table_noise(2.0 * along, 2.0 * across, salt)) if face == TOP else -1.0
        if load > 0.0:
            return load, 0.9 * load, 0.75 * load, 0.0
        return r * (1.0 - 0.3 * rib), g * (1.0 - 0.3 * rib), b * (1.0 - 0.3 * rib), 0.0
    if part == BOX:
        # The trailer: a tarpaulin, mostly light, with a coloured field, ribs on the side, doors behind.
        tone = (0.62 if salt % 3 else 0.30) + 0.06 * table_noise(1.3 * along, 2.0 * z + across, salt)
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
    if part in (BODY, CAB) or (part == VAN_TOP and face in (LEFT, RIGHT, TOP)):
        if face in (LEFT, RIGHT):
            radius = 0.34 if part != CAB else 0.5
            ends = 0.30 * length if part != CAB else 0.42 * length
            wheel = disc(abs(along) - ends, z - radius, radius, wide)
            dark = max(dark, 0.95 * wheel)
            if part == BODY:
                dark = max(dark, 0.5 * band(y, 0.02, 0.02 + 0.03 / length, max(wide, 0.03) / length))
                dark = max(dark, 0.55 * band(h, 0.0, 0.22, wide / height))
            if part == CAB:
                glass = band(y, 0.41, 0.47, wide / length) * band(h, 0.5, 0.75, wide / height)
            if part == VAN_TOP and kind == VAN:
                glass = band(y, 0.14, 0.30, wide / length) * band(h, 0.52, 0.86, wide / height)
        elif face == FRONT:
            grille = band(w, -1.0, 0.55, wide / width) * band(h, 0.25, 0.42, wide / height)
            dark = max(dark, 0.85 * grille)
            if part == CAB:
                glass = band(h, 0.52, 0.76, wide / height) * band(w, -1.0, 0.9, wide / width)
        elif face == REAR:
            plate = band(across, -0.26, 0.26, wide) * band(h, 0.32, 0.32 + 0.11 / height, wide / height)
            dark = max(dark, 0.5 * band(h, 0.0, 0.28, wide / height))
            if kind == VAN:
                dark = max(dark, 0.6 * band(across, -0.02, 0.02, wide))
            r, g, b = r + plate * (0.6 - r), g + plate * (0.6 - g), b + plate * (0.55 - b)
        if face in (FRONT, REAR) and part != VAN_TOP:
            lamp = band(w, 0.64, 0.94, wide / width) * band(h, 0.40, 0.52, wide / height)
            red = 0.25 if face == REAR else 0.45
            cool = 0.03 if face == REAR else 0.45
            r, g, b = r + lamp * (red - r), g + lamp * (cool - g), b + lamp * (cool - b)
        if face == TOP and part == BODY:
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
    shade = (1.0 - dark) * (1.0 + 0.05 * table_noise(1.5 * along + 7.0 * across, 2.5 * z, salt))
    floor = _TYRE * dark
    keep = (1.0 - glass) * shade
    return (
        keep * r + floor + glass * _GLASS,
        keep * g + floor + glass * _GLASS,
        keep * b + floor + glass * _GLASS,
        glass,
    )


@njit(cache=True, error_model="numpy")
def _coach(
    face: int, along: float, w: float, h: float, length: float, width: float, height: float, soft: float,
    colour: tuple[float, float, float],
) -> tuple[float, float, float, float]:  # fmt: skip
    """Body of a bus: a band of windows all round, wheels, a windscreen; arguments as `paint` has them."""
    r, g, b = colour
    glass = dark = 0.0
    if face in (LEFT, RIGHT):
        glass = band(h, 0.48, 0.84, soft / height) * (1.0 - band(along % 1.6, 0.0, 0.12, max(soft, 0.12)))
        wheel = disc(abs(along) - 0.28 * length, h * height - 0.5, 0.5, soft)
        dark = max(0.95 * wheel, 0.5 * band(h, 0.0, 0.14, soft / height))
    elif face == FRONT:
        glass = band(h, 0.36, 0.88, soft / height) * band(w, -1.0, 0.93, soft / width)
        dark = 0.5 * band(h, 0.0, 0.2, soft / height)
    elif face == REAR:
        glass = band(h, 0.6, 0.86, soft / height) * band(w, -1.0, 0.8, soft / width)
        dark = 0.6 * band(h, 0.05, 0.3, soft / height)
    else:
        dark = 0.3 * band(along % 3.0, 0.0, 0.9, max(soft, 0.2)) * band(w, -1.0, 0.4, soft / width)
    keep = (1.0 - glass) * (1.0 - dark)
    floor = _TYRE * dark + glass * _GLASS
    return keep * r + floor, keep * g + floor, keep * b + floor, glass
