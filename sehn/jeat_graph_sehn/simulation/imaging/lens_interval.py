"""What the work of an event camera behind a lens is made of: pictures on its canvas, light, sight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.event_run import MAX_KEYS, Flicker, key_lights
from jeat_graph_sehn.simulation.imaging.layers import GLOW
from jeat_graph_sehn.simulation.imaging.painter import take_ground
from jeat_graph_sehn.simulation.imaging.plan import who_touches
from jeat_graph_sehn.simulation.imaging.stage import Stage
from jeat_graph_sehn.simulation.imaging.tiles import TILE


class Pictures(NamedTuple):
    """The canvas, luminance (H, W) in cd/m²: without vehicles, when last and next painted, later, and now."""

    static: FloatArray
    before: FloatArray
    after: FloatArray
    ahead: FloatArray
    now: FloatArray


class Sight(NamedTuple):
    """Which places of the canvas pixels look at.

    Attributes:
        tiles: (S, 2) first row and column of tiles of pixels.
        rays: (H, W, 2) of the pixels.
        reach: (S, 4) first and last row and column of the canvas's tiles that each may look at.
        first: (T + 1,) where in `seen_by` those begin that may look at a tile of the canvas.
        seen_by: tiles of pixels.
        middle: (S, 2) ray of a pixel in the middle of each tile.
        spread: (S, 4) from the place of that pixel to the first and last row and column that the tile's
            pixels look at, the mount at rest (px).
        contrast: relative change of luminance from one pixel of the static canvas to the next, at most, by
            rows and columns of its tiles.
    """

    tiles: IntArray
    rays: FloatArray
    reach: IntArray
    first: IntArray
    seen_by: IntArray
    middle: FloatArray
    spread: FloatArray
    contrast: FloatArray


class LensInterval(NamedTuple):
    """An interval of J steps.

    Attributes:
        tiles: (T, 2) first row and column of the canvas's tiles.
        boxes: (V, 3, 4) what each vehicle changes on the canvas (px).
        steps: (T,) how often each tile's bodies are painted at most; 0 where there are none.
        first: (T + 1,) where each tile's keys of light begin.
        light: (K, P, 3) keys of light of beams and glow, evenly spaced over the interval.
        times_us: (J + 1,) beginning, and ends of the steps (µs).
        maps: (J + 1, 3, 3) from rays to the canvas at those times.
        shakes: how often all pixels look.
        busy: (S,) tiles whose photoreceptors still followed at the end of the interval before; changed.
        since: (N,) from when on each pixel is still to be taken (µs); changed.
        before: (N,) luminance that each saw when its tile looked last (cd/m²); changed.
        flicker: street lamps that flicker.
        coarse: steps of a tile that are tried as one, a power of two.
    """

    tiles: IntArray
    boxes: FloatArray
    steps: IntArray
    first: IntArray
    light: FloatArray
    times_us: FloatArray
    maps: FloatArray
    shakes: int
    busy: BoolArray
    since: FloatArray
    before: FloatArray
    flicker: Flicker
    coarse: int


@njit(cache=True, error_model="numpy")
def light_canvas(
    tiles: IntArray, boxes: FloatArray, lit: IntArray, stage: Stage, glowing: BoolArray, now: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Light of beams and glow at key times of all tiles: `first` and `light` of an interval.

    `glowing` (T,) says where there was light at its beginning, and `now` (T, P, 3) which; both are changed.
    """
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    keys = np.zeros((1 + MAX_KEYS, TILE, GLOW + 1))
    first = np.zeros(len(tiles) + 1, dtype=np.int64)
    pool = np.zeros((len(tiles), TILE, GLOW + 1))
    used = 0
    for n in range(len(tiles)):
        if lit[n] > 0 or glowing[n]:
            row0, column0 = tiles[n]
            who_touches(row0, column0, boxes, who, counts)
            tile = take_ground(row0, column0, stage.packed, stage.canvas.ground)
            count = key_lights(tile, max(lit[n], 1), who, counts, stage, now[n], keys)
            glowing[n] = lit[n] > 0
            if used + count + 1 > len(pool):
                larger = np.zeros((2 * len(pool) + count + 1, TILE, GLOW + 1))
                larger[:used] = pool[:used]
                pool = larger
            pool[used : used + count + 1] = keys[: count + 1]
            used += count + 1
        first[n + 1] = used
    return first, pool
