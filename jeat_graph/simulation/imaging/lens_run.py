"""What pixels behind a lens see within an interval, and their events.

A picture on the lens's canvas is kept up to date where vehicles or their light change it: each of its tiles
goes in straight lines from one painting to the next, which are as far apart as what is seen allows. Pixels
look at their places in it whenever one of the tiles there has been painted, and while the mount sways.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.simulation.imaging.event_pixel import PixelModel, PixelState, advance
from jeat_graph.simulation.imaging.event_run import COARSE, SETTLE_STEPS, UNNOTICED, any_touch
from jeat_graph.simulation.imaging.event_sink import EventSink, with_room
from jeat_graph.simulation.imaging.lens import place_on_canvas
from jeat_graph.simulation.imaging.lens_interval import LensInterval, Pictures, Sight
from jeat_graph.simulation.imaging.painter import paint_tile, take_ground
from jeat_graph.simulation.imaging.plan import who_touches
from jeat_graph.simulation.imaging.stage import Stage
from jeat_graph.simulation.imaging.tiles import TILE, TILE_H, TILE_W


@njit(cache=True)
def copy_tile(row0: int, column0: int, source: FloatArray, target: FloatArray) -> None:
    """Copy a tile of one picture (H, W) to another."""
    for row in range(row0, min(row0 + TILE_H, source.shape[0])):
        for column in range(column0, min(column0 + TILE_W, source.shape[1])):
            target[row, column] = source[row, column]


@njit(cache=True)
def run_lens(
    work: LensInterval, pictures: Pictures, sight: Sight, stage: Stage, model: PixelModel, state: PixelState,
    sink: EventSink, room: int,
) -> EventSink:  # fmt: skip
    """Take all pixels through an interval, step by step; returns the sink."""
    tiles, steps, first, times_us = work.tiles, work.steps, work.first, work.times_us
    reach, busy = sight.reach, work.busy
    count = len(times_us) - 1
    across = -(-pictures.now.shape[1] // TILE_W)
    begin, end = np.zeros(len(tiles), dtype=np.int64), np.zeros(len(tiles), dtype=np.int64)
    fresh, until = np.zeros(len(tiles), dtype=np.int64), np.full(len(tiles), -1)
    active = np.empty(len(tiles), dtype=np.int64)
    actives = 0
    for n in range(len(tiles)):
        if steps[n] > 0 or first[n + 1] > first[n]:
            active[actives] = n
            actives += 1
        else:
            end[n] = -1
            copy_tile(tiles[n, 0], tiles[n, 1], pictures.static, pictures.now)
            copy_tile(tiles[n, 0], tiles[n, 1], pictures.static, pictures.after)
    last = np.zeros(len(sight.tiles), dtype=np.int64)
    due, waiting = np.empty(len(sight.tiles), dtype=np.int64), np.zeros(len(sight.tiles), dtype=np.bool_)
    for step in range(1, count + 1):
        dues = 0
        everywhere = step % (count // work.shakes) == 0
        for k in range(actives):
            n = active[k]
            if end[n] == step - 1:
                begin[n] = step - 1
                end[n] = _next_painting(n, step - 1, count, work, pictures, stage, model.dark, until)
            if end[n] == step and not everywhere:
                for at in range(sight.first[n], sight.first[n + 1]):
                    s = sight.seen_by[at]
                    if not waiting[s]:
                        waiting[s] = True
                        due[dues] = s
                        dues += 1
        for s in range(len(due)):
            # Photoreceptors follow for a while after what they saw.
            if everywhere or (busy[s] and step % (count // SETTLE_STEPS) == 0 and not waiting[s]):
                due[dues] = s
                dues += 1
        for k in range(dues):
            s = due[k]
            waiting[s] = False
            for row in range(reach[s, 0], reach[s, 1] + 1):
                for column in range(reach[s, 2], reach[s, 3] + 1):
                    n = row * across + column
                    if end[n] >= 0 and fresh[n] != step:
                        fresh[n] = step
                        _bring(tiles[n, 0], tiles[n, 1], (step - begin[n]) / (end[n] - begin[n]), pictures)
            sink = with_room(sink, room)
            _look(
                s,
                times_us[last[s]],
                times_us[step],
                work.maps[step - 1],
                sight,
                pictures.now,
                model,
                state,
                sink,
            )
            last[s] = step
    for s in range(len(busy)):
        busy[s] = False
        for row in range(reach[s, 0], reach[s, 1] + 1):
            for column in range(reach[s, 2], reach[s, 3] + 1):
                busy[s] |= end[row * across + column] >= 0
    return sink


@njit(cache=True)
def _next_painting(
    n: int, start: int, count: int, work: LensInterval, pictures: Pictures, stage: Stage, dark: float,
    until: IntArray,
) -> int:  # fmt: skip
    """Paint a tile for the next time, into `after`; says for the end of which step.

    Several steps are tried as one first; where they differ, `until` keeps when what was painted will be.
    """
    row0, column0 = work.tiles[n]
    keys = max(0, int(work.first[n + 1] - work.first[n]) - 1)
    samples = max(int(work.steps[n]), keys, 1)
    stride = count // samples
    most = min(samples, COARSE if keys == 0 else COARSE // 2)
    copy_tile(row0, column0, pictures.after, pictures.before)
    # Light alone goes in straight lines between its keys.
    if most > 1 and work.steps[n] > 0 and start % (most * stride) == 0:
        far = start + most * stride
        _paint(n, far, keys, work, pictures.static, stage, pictures.ahead)
        if not _differ(row0, column0, pictures.ahead, pictures.before, dark):
            copy_tile(row0, column0, pictures.ahead, pictures.after)
            return far
        until[n] = far
    if start + stride == until[n]:
        copy_tile(row0, column0, pictures.ahead, pictures.after)
    else:
        _paint(n, start + stride, keys, work, pictures.static, stage, pictures.after)
    return start + stride


@njit(cache=True)
def _paint(
    n: int, step: int, keys: int, work: LensInterval, static: FloatArray, stage: Stage, picture: FloatArray
) -> None:
    """Paint a tile as it is at the end of a step into a picture."""
    row0, column0 = work.tiles[n]
    who = np.empty((3, max(1, len(work.boxes))), dtype=np.int64)
    counts = np.empty(3, dtype=np.int64)
    who_touches(row0, column0, work.boxes, who, counts)
    light, canvas = stage.canvas.light, stage.canvas
    if keys == 0:
        if not any_touch(step - 1, who, counts, stage.moments, row0, column0):
            copy_tile(row0, column0, static, picture)
            return
        light[:] = 0.0
    else:
        place = step * keys / (len(work.times_us) - 1)
        low = min(int(place), keys - 1)
        share, at = place - low, work.first[n] + low
        light[:] = work.light[at] + share * (work.light[at + 1] - work.light[at])
    tile = take_ground(row0, column0, stage.packed, canvas.ground)
    paint_tile(tile, step - 1, who, counts, stage, light)
    for r in range(tile.rows):
        for c in range(tile.columns):
            picture[row0 + r, column0 + c] = canvas.out[r * TILE_W + c, 0]


@njit(cache=True)
def _differ(row0: int, column0: int, one: FloatArray, other: FloatArray, dark: float) -> bool:
    """Say whether a tile of two pictures differs by more than would go unnoticed."""
    for row in range(row0, min(row0 + TILE_H, one.shape[0])):
        for column in range(column0, min(column0 + TILE_W, one.shape[1])):
            if abs(one[row, column] - other[row, column]) > UNNOTICED * (other[row, column] + dark):
                return True
    return False


@njit(cache=True)
def _bring(row0: int, column0: int, share: float, pictures: Pictures) -> None:
    """Bring a tile of the canvas to its place between two paintings."""
    before, after, now = pictures.before, pictures.after, pictures.now
    for row in range(row0, min(row0 + TILE_H, now.shape[0])):
        for column in range(column0, min(column0 + TILE_W, now.shape[1])):
            now[row, column] = before[row, column] + share * (after[row, column] - before[row, column])


@njit(cache=True)
def _look(
    s: int, start: float, end: float, m: FloatArray, sight: Sight, now: FloatArray, model: PixelModel,
    state: PixelState, sink: EventSink,
) -> None:  # fmt: skip
    """Let a tile of pixels see the canvas, and put their events. Nine parameters: the kernels' own tables."""
    rays = sight.rays
    height, width = rays.shape[:2]
    high, wide = now.shape
    pixels, luminance = np.empty(TILE, dtype=np.int64), np.empty(TILE)
    row0, column0 = sight.tiles[s]
    used = 0
    for row in range(row0, min(row0 + TILE_H, height)):
        for column in range(column0, min(column0 + TILE_W, width)):
            v, u = place_on_canvas(rays[row, column, 0], rays[row, column, 1], m, high, wide)
            r, c = int(v), int(u)
            a, b = v - r, u - c
            top = now[r, c] + b * (now[r, c + 1] - now[r, c])
            low = now[r + 1, c] + b * (now[r + 1, c + 1] - now[r + 1, c])
            pixels[used] = row * width + column
            luminance[used] = top + a * (low - top)
            used += 1
    advance(pixels[:used], luminance[:used], start, end, False, model, state, sink)
