"""Streaks of light that vehicles' lamps draw on a wet road."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.background import LUX
from jeat_graph_sehn.simulation.imaging.layers import insert
from jeat_graph_sehn.simulation.imaging.moments import LAMP_FLUX, Moments
from jeat_graph_sehn.simulation.imaging.stage import WET
from jeat_graph_sehn.simulation.imaging.tiles import TILE_W, Tile
from jeat_graph_sehn.simulation.imaging.wet_road import COARSE, STREAK, WIDER, fresnel

_LAMP_M = 0.7  # height of vehicles' lamps
_REACH = 3.0  # standard deviations that are drawn


def reach_streaks(moments: Moments, fy: float) -> None:
    """Let what vehicles change in the picture reach down to the ends of their lamps' streaks."""
    lamp = moments.lamp
    there = lamp[..., LAMP_FLUX] > 0.0
    drop = np.where(there, 2.0 * _LAMP_M * fy / np.maximum(lamp[..., 2], 1.0), 0.0)
    wide, long = WIDER * lamp[..., 3], STREAK * drop + lamp[..., 3]
    box = moments.touch[:, :, 0]
    # A camera that is rolled by a few degrees moves a streak sideways by less than its length.
    side = np.where(there, _REACH * wide + 0.1 * drop, 0.0)
    box[..., 3] = np.maximum(
        box[..., 3], np.where(there, lamp[..., 1] + drop + _REACH * long, -np.inf).max(axis=2)
    )
    box[..., 0] = np.minimum(box[..., 0], np.where(there, lamp[..., 0] - side, np.inf).min(axis=2))
    box[..., 2] = np.maximum(box[..., 2], np.where(there, lamp[..., 0] + side, -np.inf).max(axis=2))


@njit(cache=True, error_model="numpy")
def add_streaks(
    tile: Tile, lamps: FloatArray, camera: FloatArray, scene: FloatArray, ground: FloatArray,
    filled: IntArray, value: FloatArray,
) -> None:  # fmt: skip
    """Add the streaks of a vehicle's lamps (LAMPS, LAMP_RECORD) on the ground of a tile."""
    eye_z = camera[8]
    for k in range(len(lamps)):
        red, green, blue = lamps[k, LAMP_FLUX], lamps[k, LAMP_FLUX + 1], lamps[k, LAMP_FLUX + 2]
        if red <= 0.0:
            continue
        Z = lamps[k, 2]
        u = lamps[k, 0] - 2.0 * _LAMP_M * camera[0] * camera[11] / Z
        drop = -2.0 * _LAMP_M * camera[1] * camera[14] / Z
        w = lamps[k, 1] + drop
        wide, long = WIDER * lamps[k, 3], STREAK * abs(drop) + lamps[k, 3]
        share = scene[WET] * COARSE * fresnel((eye_z + _LAMP_M) / max(Z, eye_z + _LAMP_M))
        share /= 2.0 * math.pi * wide * long
        depth = Z * eye_z / (eye_z + _LAMP_M)
        for r in range(
            max(0, int(w - _REACH * long) - tile.row), min(tile.rows, int(w + _REACH * long) + 1 - tile.row)
        ):
            for c in range(
                max(0, int(u - _REACH * wide) - tile.column),
                min(tile.columns, int(u + _REACH * wide) + 1 - tile.column),
            ):
                p = r * TILE_W + c
                a, b = (tile.column + c + 0.5 - u) / wide, (tile.row + r + 0.5 - w) / long
                r2 = a * a + b * b
                if ground[p, LUX] <= 0.0 or r2 >= _REACH * _REACH:
                    continue
                # Light ends smoothly, as that of the lamps themselves.
                window = 1.0 - r2 / (_REACH * _REACH)
                part = share * math.exp(-0.5 * r2) * window * window
                insert(filled, value, p, depth, 0.0, part * red, part * green, part * blue)
