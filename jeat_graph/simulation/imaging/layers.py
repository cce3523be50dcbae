"""Room to work in for one tile: what lies over each of its pixels, sorted by depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.simulation.imaging.tiles import TILE, TILE_H, TILE_W

_LAYERS = 12  # bodies and lights over one pixel; more are left out, and nobody would see them


class Layers(NamedTuple):
    """Room to work in, for the P pixels of a tile.

    Attributes:
        filled: (P,) bodies and lights over each pixel.
        value: (P, _LAYERS, 5) their depth, cover and colour times cover, the farthest first.
        shade: (P, 2) part of the sky's and of the sun's light that vehicles leave the ground.
        beams: (P, 2) illuminance of the ground and of the barriers by headlights (lux).
    """

    filled: IntArray
    value: FloatArray
    shade: FloatArray
    beams: FloatArray


def make_layers() -> Layers:
    """Make room for one tile."""
    return Layers(
        np.zeros(TILE, dtype=np.int64), np.zeros((TILE, _LAYERS, 5)), np.zeros((TILE, 2)), np.zeros((TILE, 2))
    )


@njit(cache=True)
def insert(layers: Layers, p: int, depth: float, cover: float, r: float, g: float, b: float) -> None:
    """Put a layer over a pixel in its place by depth, the farthest first."""
    n = layers.filled[p]
    if n == _LAYERS:
        return
    value = layers.value
    at = n
    while at > 0 and value[p, at - 1, 0] < depth:
        for k in range(5):
            value[p, at, k] = value[p, at - 1, k]
        at -= 1
    value[p, at, 0], value[p, at, 1] = depth, cover
    value[p, at, 2], value[p, at, 3], value[p, at, 4] = r, g, b
    layers.filled[p] = n + 1


@njit(cache=True)
def meets(box: FloatArray, row0: int, column0: int) -> bool:
    """Say whether a box (px) meets the tile that begins at (row0, column0)."""
    inside: bool = box[2] > column0 and box[0] < column0 + TILE_W
    return inside and box[3] > row0 and box[1] < row0 + TILE_H
