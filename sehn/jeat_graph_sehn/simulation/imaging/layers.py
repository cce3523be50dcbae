"""Buffers of one tile of the picture: what lies over each of its pixels, sorted by depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.background import PACKED
from jeat_graph_sehn.simulation.imaging.lighting import luminance
from jeat_graph_sehn.simulation.imaging.tiles import TILE, TILE_H, TILE_W

LAYERS = 12  # bodies and lights over one pixel; more are left out, and nobody would see them
# Of a tile's light: on the ground and on barriers by headlights (lux), then glow in each channel.
ON_GROUND, ON_WALL, GLOW = 0, 1, 2


class TileLayers(NamedTuple):
    """Room to work in, for the P pixels of a tile in C channels (3, or 1 for luminance alone).

    Attributes:
        filled: (P,) bodies and lights over each pixel.
        value: (P, LAYERS, 2 + C) their depth, cover and colour times cover, the farthest first.
        shade: (P, 2) part of the sky's and of the sun's light that vehicles leave the ground.
        ground: (P, PACKED + 5 C) the tile's part of `Background.packed`.
        light: (P, 2 + C) light of beams (lux) and glow (cd/m²) over the tile.
        out: (P, C) what was painted (cd/m²).
    """

    filled: IntArray
    value: FloatArray
    shade: FloatArray
    ground: FloatArray
    light: FloatArray
    out: FloatArray


def make_canvas(channels: int) -> TileLayers:
    """Make room for one tile."""
    return TileLayers(
        filled=np.zeros(TILE, dtype=np.int64),
        value=np.zeros((TILE, LAYERS, 2 + channels)),
        shade=np.ones((TILE, 2)),
        ground=np.zeros((TILE, PACKED + 5 * channels)),
        light=np.zeros((TILE, 2 + channels)),
        out=np.zeros((TILE, channels)),
    )


@njit(cache=True, error_model="numpy", inline="always")
def insert(
    filled: IntArray, value: FloatArray, p: int, depth: float, cover: float, r: float, g: float, b: float
) -> None:
    """Put a layer over a pixel in its place by depth, the farthest first.

    It is part of whoever calls it: a call would count references to both arrays, once a pixel.
    """
    at = filled[p]
    if at < LAYERS:
        filled[p] = at + 1
        width = value.shape[2]
        while at > 0 and value[p, at - 1, 0] < depth:
            for k in range(width):
                value[p, at, k] = value[p, at - 1, k]
            at -= 1
        value[p, at, 0], value[p, at, 1] = depth, cover
        if width == 3:
            value[p, at, 2] = luminance(r, g, b)
        else:
            value[p, at, 2], value[p, at, 3], value[p, at, 4] = r, g, b


@njit(cache=True, error_model="numpy", inline="always")
def meets(left: float, top: float, right: float, low: float, row0: int, column0: int) -> bool:
    """Say whether a box (px) meets the tile that begins at (row0, column0).

    It takes numbers, and is part of whoever calls it: to take a part of an array counts references, whose
    price shows where it is done for each vehicle and each tile.
    """
    return right > column0 and left < column0 + TILE_W and low > row0 and top < row0 + TILE_H
