"""What stands beside and above the road, and what it is made of, as plain numbers for the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.ground import GroundLayout, layout_of
from jeat_graph_sehn.simulation.world.bend import bend_points
from jeat_graph_sehn.simulation.world.road import RoadConfig
from jeat_graph_sehn.simulation.world.surroundings import Surroundings

_BARRIER_HALF_M, _BARRIER_TOP_M = 0.28, 0.85
_RAIL_LOW_M, _RAIL_TOP_M, _RAIL_BESIDE_M = 0.45, 0.78, 0.5
_DECK_M, _CLEARANCE_M, _PARAPET_M = 1.3, 5.4, 1.0
CONCRETE, RAIL, HEDGE, PANELS = range(4)


class Country(NamedTuple):
    """Trees, hills and clouds.

    Attributes:
        trees: distance from the pavement (m; 0 for none), and height (m).
        leaves: albedo.
        hills: tangent of their elevation.
        grade: what the horizon is lifted by, likewise.
        clouds: contrast.
        salt: makes it its own.
    """

    trees: tuple[float, float]
    leaves: tuple[float, float, float]
    hills: float
    grade: float
    clouds: float
    salt: int


class Landscape(NamedTuple):
    """All that stands still, beside lamps.

    Attributes:
        layout: cross-section and surface of the road.
        curvature: of the road (1/m), positive to the right.
        walls: (W, 7) walls along the road: place across, bottom and top (m), albedo (3), what it is made of.
        boxes: (B, 13) boxes: x, y, sine and cosine of the direction, from and to along it and across (m),
            bottom and top (m), albedo (3).
        decks: (D, 2) where bridges begin and end along the road (m), whose shadow lies on it.
        country: trees, hills and clouds.
    """

    layout: GroundLayout
    curvature: float
    walls: FloatArray
    boxes: FloatArray
    decks: FloatArray
    country: Country


def landscape_of(road: RoadConfig, around: Surroundings) -> Landscape:
    """Build walls and boxes from what the surroundings say."""
    layout = layout_of(road, around)
    edge = layout.paved + _RAIL_BESIDE_M
    walls: list[tuple[float, ...]] = []
    if around.median == 1:
        walls += [(s * _BARRIER_HALF_M, 0.0, _BARRIER_TOP_M, 0.3, 0.3, 0.3, CONCRETE) for s in (-1, 1)]
    elif around.median == 2:
        walls += [(s * 0.35, _RAIL_LOW_M, _RAIL_TOP_M, 0.35, 0.35, 0.35, RAIL) for s in (-1, 1)]
    elif around.median == 3:
        top = 1.1
        walls += [(s * 0.25 * road.median_m, 0.0, top, 0.028, 0.04, 0.018, HEDGE) for s in (-1, 1)]
    for side, there in ((-1, around.rail_left), (1, around.rail_right)):
        if there:
            walls.append((side * edge, _RAIL_LOW_M, _RAIL_TOP_M, 0.35, 0.35, 0.35, RAIL))
    for side, high in ((-1, around.noise_left_m), (1, around.noise_right_m)):
        if high > 0.0:
            r, g, b = around.noise_colour
            walls.append((side * (edge + 1.5), 0.0, high, r, g, b, PANELS))
    boxes: list[tuple[float, ...]] = []
    for y in around.gantries_m:
        boxes += _gantry(y, layout, road, around)
    decks = []
    for y in around.bridges_m:
        boxes += _bridge(y, layout, around)
        decks.append((y, y + around.bridge_wide_m))
    return Landscape(
        layout,
        road.curvature_per_m,
        np.array(walls, dtype=np.float64).reshape(-1, 7),
        np.array(boxes, dtype=np.float64).reshape(-1, 13),
        np.array(decks, dtype=np.float64).reshape(-1, 2),
        Country(
            (around.trees_m, around.trees_high_m),
            around.trees_colour,
            around.hills,
            around.grade,
            around.clouds,
            20 * around.salt,
        ),
    )


def _at(y: float, curvature: float) -> tuple[float, float, float, float]:
    px, py = bend_points(np.zeros(1), np.array([y]), curvature)
    return float(px[0]), float(py[0]), float(np.sin(curvature * y)), float(np.cos(curvature * y))


def _gantry(
    y: float, layout: GroundLayout, road: RoadConfig, around: Surroundings
) -> list[tuple[float, ...]]:
    """A bridge of trusses with signs over the lanes that drive away, and its legs."""
    at = _at(y, road.curvature_per_m)
    steel, end = (0.28, 0.29, 0.30), layout.paved + 0.9
    boxes: list[tuple[float, ...]] = [
        (*at, 0.0, 0.5, -0.4, end, 6.6, 6.9, *steel),
        (*at, 0.0, 0.5, -0.4, end, 7.7, 8.0, *steel),
        (*at, 0.0, 0.5, end - 0.4, end, 0.0, 8.0, *steel),
        (*at, 0.0, 0.5, -0.4, 0.0, 0.0, 8.0, *steel),
    ]
    # The back of signs for those who drive away, their front for none: grey, with a frame.
    for k in range(road.lanes_per_direction):
        if (k + int(y)) % 3:
            middle = layout.inner + (k + 0.5) * layout.lane_width
            boxes.append((*at, -0.1, 0.0, middle - 1.4, middle + 1.4, 5.9, 8.3, *around.sign_colour))
    return boxes


def _bridge(y: float, layout: GroundLayout, around: Surroundings) -> list[tuple[float, ...]]:
    """A road across: deck, parapet and piers."""
    at = _at(y, layout.curvature)
    low, wide, half = _CLEARANCE_M, around.bridge_wide_m, layout.paved + 30.0
    concrete = around.bridge_colour
    side = layout.paved + 2.0
    boxes: list[tuple[float, ...]] = [
        (*at, 0.0, wide, -half, half, low, low + _DECK_M, *concrete),
        (*at, 0.0, 0.3, -half, half, low, low + _DECK_M + _PARAPET_M, *(0.9 * c for c in concrete)),
    ]
    if layout.inner >= 1.0:
        boxes.append((*at, 0.4 * wide, 0.6 * wide, -0.45, 0.45, 0.0, low, *concrete))
    for s in (-1.0, 1.0):
        ends = sorted((s * side, s * (side + 1.0)))
        boxes.append((*at, 0.3 * wide, 0.7 * wide, *ends, 0.0, low, *concrete))
    return boxes
