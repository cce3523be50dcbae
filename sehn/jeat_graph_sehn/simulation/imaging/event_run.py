"""What the pixels of the event camera see within an interval, tile by tile, and their events."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.background import PACKED
from jeat_graph_sehn.simulation.imaging.event_pixel import LUMINANCE as SEEN
from jeat_graph_sehn.simulation.imaging.event_pixel import PixelModel, PixelState, advance, unsettled
from jeat_graph_sehn.simulation.imaging.event_sink import EventSink, SinkColumns, with_room
from jeat_graph_sehn.simulation.imaging.layers import GLOW, ON_GROUND, ON_WALL
from jeat_graph_sehn.simulation.imaging.painter import (
    any_touch,
    light_tile,
    paint_light,
    paint_tile,
    take_ground,
)
from jeat_graph_sehn.simulation.imaging.plan import who_touches
from jeat_graph_sehn.simulation.imaging.stage import Stage
from jeat_graph_sehn.simulation.imaging.tiles import TILE, TILE_H, TILE_W, Tile

SETTLE_STEPS = 8  # of pixels that see nothing move, while their photoreceptors still follow
_FOLLOWING, _SETTLED = 0.01, 1e-6  # ln
MAX_KEYS = 32
COARSE = 8  # steps that are tried as one
COARSE_LIT = 2  # where lamps' light is
UNNOTICED = 0.08  # relative change that needs no samples between
_BEND = 0.02  # relative distance of beams' and glow's light from a straight line in time
_FAINT_CD_M2 = 0.005


class Flicker(NamedTuple):
    """Street lamps that flicker within an interval.

    Attributes:
        share: (N,) part of each pixel's light in the static picture that is theirs; (0,) for steady lamps.
        change: (J + 1,) relative change of their light at the interval's times.
        steps: how often their light is looked at, a power of two; 1 for steady lamps.
    """

    share: FloatArray
    change: FloatArray
    steps: int


class Interval(NamedTuple):
    """What the pixels see within an interval of time.

    Attributes:
        tiles: (T, 2) first row and column of the tiles.
        boxes: (V, 3, 4) what each vehicle changes in the picture (px).
        steps: (T,) how often each tile's bodies are painted; 0 where there are none.
        lit: (T,) how often its beams and glow are at most; 0 where there are none.
        times_us: (J + 1,) beginning of the interval and the J times of painting (µs).
        static: (H, W) luminance of the picture without vehicles (cd/m²).
        quiet: (T,) true where a tile's pixels see the static picture and have settled; changed.
        glowing: (T,) true where beams or glow were on a tile at the interval's beginning; changed.
        light: (T, P, 3) that light; changed.
        flicker: street lamps that flicker.
        coarse: steps of a tile that are tried as one, a power of two.
    """

    tiles: IntArray
    boxes: FloatArray
    steps: IntArray
    lit: IntArray
    times_us: FloatArray
    static: FloatArray
    quiet: BoolArray
    glowing: BoolArray
    light: FloatArray
    flicker: Flicker
    coarse: int


@njit(cache=True, error_model="numpy")
def light_all(
    tiles: IntArray, boxes: FloatArray, lit: IntArray, stage: Stage, glowing: BoolArray, light: FloatArray
) -> None:
    """Fill the light of beams and glow of all tiles at the first of the moments."""
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    for n in range(len(tiles)):
        glowing[n] = lit[n] > 0
        if glowing[n]:
            row0, column0 = tiles[n]
            who_touches(row0, column0, boxes, who, counts)
            tile = take_ground(row0, column0, stage.packed, stage.canvas.ground)
            light_tile(tile, 0, who, counts, stage, light[n])


@njit(cache=True, error_model="numpy")
def fill(row0: int, column0: int, static: FloatArray, pixels: IntArray, luminance: FloatArray) -> int:
    """Pixels of a tile and what they see while nothing moves; returns how many there are."""
    height, width = static.shape
    count = 0
    for row in range(row0, min(row0 + TILE_H, height)):
        for column in range(column0, min(column0 + TILE_W, width)):
            pixels[count] = row * width + column
            luminance[count] = static[row, column]
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def read_luminance(patch: FloatArray, tile: Tile, luminance: FloatArray) -> None:
    """Luminance of a painted tile, in the order of `_fill`."""
    count = 0
    for r in range(tile.rows):
        for c in range(tile.columns):
            luminance[count] = patch[r * TILE_W + c, 0]
            count += 1


@njit(cache=True, error_model="numpy")
def key_lights(
    tile: Tile,
    most: int,
    who: IntArray,
    counts: IntArray,
    stage: Stage,
    now: FloatArray,
    keys: FloatArray,
) -> int:
    """Fill the light of beams and glow at key times, between which it is linear.

    Args:
        tile: whose ground is on the canvas.
        most: how many keys there may be at most, a power of two.
        who: vehicles that may touch it.
        counts: how many.
        stage: the scene at J times.
        now: (P, 3) light at the interval's beginning; then that at its end.
        keys: (1 + MAX_KEYS, P, 3) filled, the first with that of the beginning.

    Returns:
        How many keys follow the first, a power of two.
    """
    keys[0] = now
    available = len(stage.moments.times)
    most = min(most, len(keys) - 1)
    light_tile(tile, available - 1, who, counts, stage, keys[most])
    now[:] = keys[most]
    if most == 1:
        return 1
    middle, end = keys[most // 2], keys[most]
    light_tile(tile, available // 2 - 1, who, counts, stage, middle)
    bend = 0.0
    ground = stage.canvas.ground
    for r in range(tile.rows):
        for c in range(tile.columns):
            p = r * TILE_W + c
            on_ground, on_wall = ground[p, PACKED + 1], ground[p, PACKED + 3]
            sum0 = on_ground * keys[0, p, ON_GROUND] + on_wall * keys[0, p, ON_WALL] + keys[0, p, GLOW]
            sum1 = on_ground * middle[p, ON_GROUND] + on_wall * middle[p, ON_WALL] + middle[p, GLOW]
            sum2 = on_ground * end[p, ON_GROUND] + on_wall * end[p, ON_WALL] + end[p, GLOW]
            level = ground[p, PACKED] + ground[p, PACKED + 2] + ground[p, PACKED + 4] + _FAINT_CD_M2
            bend = max(bend, abs(sum1 - 0.5 * (sum0 + sum2)) / (level + min(sum0, sum1, sum2)))
    count = 2
    # A parabola's distance from its chord falls by four with each halving.
    while count < most and bend > _BEND:
        count *= 2
        bend *= 0.25
    for k in range(1, count + 1):
        if k == count:
            keys[k] = end
        elif 2 * k == count:
            keys[k] = middle
        else:
            light_tile(tile, k * (available // count) - 1, who, counts, stage, keys[k])
    return count


@njit(cache=True, error_model="numpy")
def between(keys: FloatArray, first: int, share: float, light: FloatArray) -> None:
    """Fill the light (P, 3) that lies a share of the way from one of the keys (K, P, 3) to the next."""
    for p in range(light.shape[0]):
        for k in range(light.shape[1]):
            before = keys[first, p, k]
            light[p, k] = before + share * (keys[first + 1, p, k] - before)


def coarse_steps(quick: bool) -> int:
    """Steps of a tile that are tried as one, a power of two; fewer where there is anything `quick`.

    No vehicle passes a tile unseen in them, for it is longer than its way between two frames. Insects would,
    and the pulse of a lamp.
    """
    return COARSE_LIT if quick else COARSE


@njit(cache=True, error_model="numpy")
def run_physical(
    work: Interval, stage: Stage, model: PixelModel, state: PixelState, sink: EventSink, room: int
) -> SinkColumns:
    """Take all pixels through an interval, tile by tile; returns what `SinkColumns` says."""
    tiles, boxes, steps, lit, times_us, static, quiet, glowing, light_now, flicker, most = work
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    pixels, luminance = np.zeros(TILE, dtype=np.int64), np.zeros(TILE)
    keys = np.zeros((1 + MAX_KEYS, TILE, GLOW + 1))
    light = np.zeros((TILE, GLOW + 1))
    seen, still, since = np.zeros((4, TILE)), np.zeros(TILE), np.zeros(TILE)
    stack, painted = np.zeros(4, dtype=np.int64), np.zeros(4, dtype=np.bool_)
    available = len(times_us) - 1
    start, end = times_us[0], times_us[available]
    canvas = stage.canvas
    rendered = 0
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        count = fill(row0, column0, static, pixels, luminance)
        sink = with_room(sink, room)
        if steps[n] == 0 and lit[n] == 0 and not glowing[n]:
            pieces = flicker.steps
            if flicker.steps > 1:
                quiet[n] = False
            elif not quiet[n]:
                apart = unsettled(pixels[:count], luminance[:count], model, state)
                pieces = SETTLE_STEPS if apart > _FOLLOWING else 1
                quiet[n] = apart < _SETTLED
            for k in range(pieces):
                a, b = start + (end - start) * k / pieces, start + (end - start) * (k + 1) / pieces
                since[:] = a
                seen[0, :count] = luminance[:count]
                if flicker.steps > 1:
                    _flicker(seen[0, :count], pixels, flicker, (k + 1) * (available // pieces))
                advance(pixels[:count], seen[0, :count], since, b, quiet[n], model, state, sink)
            continue
        quiet[n] = False
        who_touches(row0, column0, boxes, who, counts)
        tile = take_ground(row0, column0, stage.packed, canvas.ground)
        still[:count] = luminance[:count]
        key_count = 1
        if lit[n] > 0 or glowing[n]:
            key_count = key_lights(tile, max(lit[n], 1), who, counts, stage, light_now[n], keys)
            glowing[n] = lit[n] > 0
            constant = False
        else:
            keys[:2] = 0.0
            constant = True
        samples = max(steps[n], key_count, flicker.steps)
        stride = available // samples
        # Samples are taken coarsely first, and where they differ, those between them too.
        coarse = min(samples, most if constant else COARSE_LIT) if flicker.steps == 1 else 1
        for k in range(0, samples, coarse):
            top, stack[0] = 0, k + coarse
            done = k
            while top >= 0:
                here = int(stack[top])
                if not painted[top]:
                    touched = any_touch(here * stride - 1, who, counts, stage, row0, column0)
                    if constant and not touched:
                        seen[top, :count] = still[:count]
                    else:
                        if not constant:
                            place = here * key_count / samples
                            low = min(int(place), key_count - 1)
                            share = place - low
                            between(keys, low, share, light)
                        if touched:
                            paint_tile(tile, here * stride - 1, who, counts, stage, light)
                        else:
                            paint_light(tile, light, canvas.ground, canvas.out)
                        read_luminance(canvas.out, tile, seen[top])
                        rendered += 1
                    if flicker.steps > 1:
                        _flicker(seen[top, :count], pixels, flicker, here * stride)
                    painted[top] = True
                if here - done > 1 and _differ(seen[top, :count], pixels, model, state):
                    top += 1
                    stack[top] = (done + here) // 2
                    painted[top] = False
                    continue
                sink = with_room(sink, room)
                a, b = float(times_us[done * stride]), float(times_us[here * stride])
                since[:] = a
                advance(pixels[:count], seen[top, :count], since, b, False, model, state, sink)
                painted[top] = False
                done = here
                top -= 1
    return sink.used, sink.t_us, sink.pixel, sink.polarity, sink.by_motion, rendered


@njit(cache=True, error_model="numpy")
def _flicker(luminance: FloatArray, pixels: IntArray, flicker: Flicker, at: int) -> None:
    """Change the luminance of pixels as lamps do at one of the interval's times."""
    for n in range(len(luminance)):
        luminance[n] *= 1.0 + flicker.share[pixels[n]] * flicker.change[at]


@njit(cache=True, error_model="numpy")
def _differ(luminance: FloatArray, pixels: IntArray, model: PixelModel, state: PixelState) -> bool:
    """Say whether what pixels see differs from what they saw last by more than would go unnoticed."""
    for n in range(len(luminance)):
        before = state.table[pixels[n], SEEN]
        if abs(luminance[n] - before) > UNNOTICED * (before + model.dark):
            return True
    return False
