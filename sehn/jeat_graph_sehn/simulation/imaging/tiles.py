"""Tiles of the picture, and the camera as plain arrays for the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.world.camera import Camera

# Small tiles: only what changes is painted again, and a rolling shutter exposes rows at times of their own.
TILE_H, TILE_W = 8, 8
TILE = TILE_H * TILE_W


class View(NamedTuple):
    """The camera as plain arrays: lens (6,) fx, fy, cx, cy, width, height; eye (3,); rotation (3, 3)."""

    lens: FloatArray
    eye: FloatArray
    rotation: FloatArray


class Tile(NamedTuple):
    """A tile within a picture: its first row and column, and how many of each lie in the picture."""

    row: int
    column: int
    rows: int
    columns: int


def view_of(camera: Camera) -> View:
    """Take the camera apart."""
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height])
    return View(lens, np.ascontiguousarray(camera.position), np.ascontiguousarray(camera.rotation))


def tile_raster(width: int, height: int) -> IntArray:
    """First row and column of the tiles (T, 2) that cover a picture."""
    rows, columns = np.meshgrid(np.arange(0, height, TILE_H), np.arange(0, width, TILE_W), indexing="ij")
    return np.stack([rows.ravel(), columns.ravel()], axis=1).astype(np.int64)
