"""What the work of an event camera behind a lens is made of: pictures on its canvas, light, sight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.simulation.imaging.event_run import MAX_KEYS, key_lights
from jeat_graph.simulation.imaging.layers import GLOW
from jeat_graph.simulation.imaging.painter import take_ground
from jeat_graph.simulation.imaging.plan import who_touches
from jeat_graph.simulation.imaging.stage import Stage
from jeat_graph.simulation.imaging.tiles import TILE


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
    """

    tiles: IntArray
    rays: FloatArray
    reach: IntArray
    first: IntArray
    seen_by: IntArray


class LensInterval(NamedTuple):
    """An interval of J steps.

    Attributes:
        tiles: (T, 2) first row and column of the canvas's tiles.
        boxes: (V, 3, 4) what each vehicle changes on the canvas (px).
        steps: (T,) how often each tile's bodies are painted at most; 0 where there are none.
        first: (T + 1,) where each tile's keys of light begin.
        light: (K, P, 3) keys of light of beams and glow, evenly spaced over the interval.
        times_us: (J + 1,) beginning, and ends of the steps (µs).
        maps: (J, 3, 3) from rays to the canvas at the ends of the steps.
        shakes: how often all pixels look.
        busy: (S,) tiles whose pixels saw something move in the interval before; changed.
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


@njit(cache=True)
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
