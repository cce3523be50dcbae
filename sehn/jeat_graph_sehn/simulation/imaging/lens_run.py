"""What pixels behind a lens see within an interval, and their events.

A picture on the lens's canvas is kept up to date where vehicles or their light change it: each of its tiles
goes in straight lines from one painting to the next, which are as far apart as what is seen allows. Pixels
look at their places in it whenever one of the tiles there has been painted, and while the mount sways.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.event_pixel import LUMINANCE as SEEN
from jeat_graph_sehn.simulation.imaging.event_pixel import OUTPUT, SIGNAL, PixelModel, PixelState, advance
from jeat_graph_sehn.simulation.imaging.event_run import COARSE_LIT, SETTLE_STEPS, UNNOTICED, between
from jeat_graph_sehn.simulation.imaging.event_sink import EventSink, with_room
from jeat_graph_sehn.simulation.imaging.lens import place_on_canvas
from jeat_graph_sehn.simulation.imaging.lens_interval import LensInterval, Pictures, Sight
from jeat_graph_sehn.simulation.imaging.painter import any_touch, paint_light, paint_tile, take_ground
from jeat_graph_sehn.simulation.imaging.plan import who_touches
from jeat_graph_sehn.simulation.imaging.stage import Stage
from jeat_graph_sehn.simulation.imaging.tiles import TILE, TILE_H, TILE_W

_LATER = 0.04  # relative change of a pixel that may wait: a fifth of what makes an event
_SLACK_PX = 1.5  # about what a tile of pixels looks at: the step of the mount's turn and what its roll does


@njit(cache=True, error_model="numpy")
def copy_tile(row0: int, column0: int, source: FloatArray, target: FloatArray) -> None:
    """Copy a tile of one picture (H, W) to another."""
    for row in range(row0, min(row0 + TILE_H, source.shape[0])):
        for column in range(column0, min(column0 + TILE_W, source.shape[1])):
            target[row, column] = source[row, column]


@njit(cache=True, error_model="numpy")
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
    touched = np.zeros(len(busy), dtype=np.bool_)
    for s in range(len(busy)):
        for row in range(reach[s, 0], reach[s, 1] + 1):
            for column in range(reach[s, 2], reach[s, 3] + 1):
                touched[s] |= end[row * across + column] >= 0
    work.since[:] = times_us[0]
    flickers = work.flicker.steps > 1
    foot = np.zeros((len(busy), 4), dtype=np.int64)
    last = np.zeros(len(sight.tiles), dtype=np.int64)
    due, waiting = np.empty(len(sight.tiles), dtype=np.int64), np.zeros(len(sight.tiles), dtype=np.bool_)
    for step in range(1, count + 1):
        dues = 0
        everywhere = step % (count // work.shakes) == 0
        _footprints(work.maps[step], sight, pictures.now, foot)
        for k in range(actives):
            n = active[k]
            if end[n] == step - 1:
                begin[n] = step - 1
                end[n] = _next_painting(n, step - 1, count, work, pictures, stage, model.dark, until)
            if end[n] == step and not everywhere:
                for at in range(sight.first[n], sight.first[n + 1]):
                    s = sight.seen_by[at]
                    here = foot[s, 0] <= n // across <= foot[s, 1] and foot[s, 2] <= n % across <= foot[s, 3]
                    if here and not waiting[s]:
                        waiting[s] = True
                        due[dues] = s
                        dues += 1
        for s in range(len(due)):
            if everywhere and step < count and not touched[s] and not busy[s] and not flickers:
                # What is plain shows nothing new to a mount that turns a little.
                way = _way(s, work.maps[last[s]], work.maps[step], sight, pictures.now)
                most = 0.0
                for row in range(foot[s, 0], foot[s, 1] + 1):
                    for column in range(foot[s, 2], foot[s, 3] + 1):
                        most = max(most, sight.contrast[row, column])
                if most * way < _LATER:
                    continue
            # Photoreceptors follow for a while after what they saw.
            if everywhere or (busy[s] and step % (count // SETTLE_STEPS) == 0 and not waiting[s]):
                due[dues] = s
                dues += 1
        for k in range(dues):
            s = int(due[k])
            waiting[s] = False
            for row in range(foot[s, 0], foot[s, 1] + 1):
                for column in range(foot[s, 2], foot[s, 3] + 1):
                    n = row * across + column
                    if end[n] >= 0 and fresh[n] != step:
                        fresh[n] = step
                        share = float((step - begin[n]) / (end[n] - begin[n]))
                        _bring(tiles[n, 0], tiles[n, 1], share, pictures)
            sink = with_room(sink, room)
            following = _look(s, last[s], step, work, sight, pictures.now, model, state, sink)
            if step == count:
                busy[s] = following
            last[s] = step
    return sink


@njit(cache=True, error_model="numpy")
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
    most = min(samples, work.coarse if keys == 0 else COARSE_LIT)
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


@njit(cache=True, error_model="numpy")
def _paint(
    n: int, step: int, keys: int, work: LensInterval, static: FloatArray, stage: Stage, picture: FloatArray
) -> None:
    """Paint a tile as it is at the end of a step into a picture."""
    row0, column0 = work.tiles[n]
    who = np.empty((3, max(1, len(work.boxes))), dtype=np.int64)
    counts = np.empty(3, dtype=np.int64)
    who_touches(row0, column0, work.boxes, who, counts)
    light, canvas = stage.canvas.light, stage.canvas
    touched = any_touch(step - 1, who, counts, stage, row0, column0)
    if keys == 0:
        if not touched:
            copy_tile(row0, column0, static, picture)
            return
        light[:] = 0.0
    else:
        place = step * keys / (len(work.times_us) - 1)
        low = min(int(place), keys - 1)
        share, at = place - low, work.first[n] + low
        between(work.light, at, share, light)
    tile = take_ground(row0, column0, stage.packed, canvas.ground)
    if touched:
        paint_tile(tile, step - 1, who, counts, stage, light)
    else:
        paint_light(tile, light, canvas.ground, canvas.out)
    for r in range(tile.rows):
        for c in range(tile.columns):
            picture[row0 + r, column0 + c] = canvas.out[r * TILE_W + c, 0]


@njit(cache=True, error_model="numpy")
def _differ(row0: int, column0: int, one: FloatArray, other: FloatArray, dark: float) -> bool:
    """Say whether a tile of two pictures differs by more than would go unnoticed."""
    for row in range(row0, min(row0 + TILE_H, one.shape[0])):
        for column in range(column0, min(column0 + TILE_W, one.shape[1])):
            if abs(one[row, column] - other[row, column]) > UNNOTICED * (other[row, column] + dark):
                return True
    return False


@njit(cache=True, error_model="numpy")
def _bring(row0: int, column0: int, share: float, pictures: Pictures) -> None:
    """Bring a tile of the canvas to its place between two paintings."""
    before, after, now = pictures.before, pictures.after, pictures.now
    for row in range(row0, min(row0 + TILE_H, now.shape[0])):
        for column in range(column0, min(column0 + TILE_W, now.shape[1])):
            now[row, column] = before[row, column] + share * (after[row, column] - before[row, column])


@njit(cache=True, error_model="numpy")
def _footprints(m: FloatArray, sight: Sight, now: FloatArray, foot: IntArray) -> None:
    """First and last row and column of the canvas's tiles (S, 4) that tiles of pixels look at by a map."""
    high, wide = now.shape
    for s in range(len(foot)):
        v, u = place_on_canvas(sight.middle[s, 0], sight.middle[s, 1], m, high, wide)
        spread = sight.spread[s]
        foot[s, 0] = max(int(v + spread[0] - _SLACK_PX), 0) // TILE_H
        foot[s, 1] = min(int(v + spread[1] + _SLACK_PX) + 1, high - 1) // TILE_H
        foot[s, 2] = max(int(u + spread[2] - _SLACK_PX), 0) // TILE_W
        foot[s, 3] = min(int(u + spread[3] + _SLACK_PX) + 1, wide - 1) // TILE_W


@njit(cache=True, error_model="numpy")
def _way(s: int, before: FloatArray, after: FloatArray, sight: Sight, now: FloatArray) -> float:
    """How far (px along rows and columns) the middle of a tile of pixels has gone over the canvas."""
    x, y = sight.middle[s, 0], sight.middle[s, 1]
    v0, u0 = place_on_canvas(x, y, before, now.shape[0], now.shape[1])
    v1, u1 = place_on_canvas(x, y, after, now.shape[0], now.shape[1])
    return abs(v1 - v0) + abs(u1 - u0)


@njit(cache=True, error_model="numpy")
def _look(
    s: int, last: int, step: int, work: LensInterval, sight: Sight, now: FloatArray, model: PixelModel,
    state: PixelState, sink: EventSink,
) -> bool:  # fmt: skip
    """Let a tile of pixels see the canvas, and put their events. Nine parameters: the kernels' own tables.

    It says whether any photoreceptor still follows what it saw. Pixels that see next to nothing new wait:
    their change is taken at once when it is enough to be noticed, or at the interval's end.
    """
    rays, memory, dark = sight.rays, state.table, model.dark
    height, width = rays.shape[:2]
    high, wide = now.shape
    m, since, before, flicker = work.maps[step], work.since, work.before, work.flicker
    start, end, all_of_them = work.times_us[last], work.times_us[step], step == len(work.times_us) - 1
    late, pixels = np.empty(TILE, dtype=np.int64), np.empty(TILE, dtype=np.int64)
    first, luminance = np.empty(TILE), np.empty(TILE)
    begun, going = np.empty(TILE), np.empty(TILE)
    row0, column0 = sight.tiles[s]
    lates = used = 0
    for row in range(row0, min(row0 + TILE_H, height)):
        for column in range(column0, min(column0 + TILE_W, width)):
            v, u = place_on_canvas(rays[row, column, 0], rays[row, column, 1], m, high, wide)
            r, c = int(v), int(u)
            a, b = v - r, u - c
            top = now[r, c] + b * (now[r, c + 1] - now[r, c])
            low = now[r + 1, c] + b * (now[r + 1, c + 1] - now[r + 1, c])
            seen, i = top + a * (low - top), row * width + column
            if flicker.steps > 1:
                seen *= 1.0 + flicker.share[i] * flicker.change[step]
            old = memory[i, SEEN]
            same = abs(seen - old) <= _LATER * (old + dark)
            same = same and abs(memory[i, OUTPUT] - memory[i, SIGNAL]) <= _LATER
            if not same and since[i] < start:
                late[lates], first[lates], begun[lates] = i, before[i], since[i]
                lates += 1
                since[i] = start
            before[i] = seen
            if not same or all_of_them:
                pixels[used], luminance[used], going[used] = i, seen, since[i]
                used += 1
                since[i] = end
    if lates:
        advance(late[:lates], first[:lates], begun, start, False, model, state, sink)
    advance(pixels[:used], luminance[:used], going, end, False, model, state, sink)
    following = 0.0
    for n in range(used):
        following = max(following, abs(memory[pixels[n], OUTPUT] - memory[pixels[n], SIGNAL]))
    return following > _LATER
