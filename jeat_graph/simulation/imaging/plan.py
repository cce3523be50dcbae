"""Which tiles change within an interval, through which vehicles, and how often they must be rendered."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.simulation.imaging.moments import Look, Moments
from jeat_graph.simulation.imaging.tiles import TILE_H, TILE_W, View

MAX_STEPS = 256
_BEAM_STEP_M = 0.5  # a beam's light on the road may move this far from one rendering to the next
_GLOW_EASE = 4.0  # glow and beams are smooth: their motion asks for fewer renderings than an edge's
_BEAM_EASE = 0.33
_MARGIN_PX = 3.0


class Plan(NamedTuple):
    """Work of one interval.

    Attributes:
        look: the V vehicles there are in it.
        boxes: (V, 3, 4) what each changes in the picture (px): body and shadow, glow, beams' light.
        steps: (T,) how often each tile is rendered, a power of two; 0 where nothing changes.
        most: the greatest of them, at least 1.
        every: (V,) stride at which a vehicle is needed among `most` times.
    """

    look: Look
    boxes: FloatArray
    steps: IntArray
    most: int
    every: IntArray


def make_plan(
    moments: Moments,
    velocity: FloatArray,
    look: Look,
    tiles: IntArray,
    view: View,
    step_px: float,
    duration_s: float,
    on: bool,
) -> Plan:
    """Plan an interval.

    Args:
        moments: the vehicles at the interval's beginning, middle and end.
        velocity: (V, 2) greatest speed across and along the road (m/s).
        look: the vehicles.
        tiles: (T, 2) first row and column of the tiles.
        view: the camera.
        step_px: how far an edge may move from one rendering to the next (px).
        duration_s: time in which the steps are taken (s); it may be a part of the interval.
        on: whether vehicles have their lights on.
    """
    there = (moments.fade > 0.0)[..., None, None]
    low = np.where(there, moments.touch[..., :2], np.inf).min(axis=0) - _MARGIN_PX
    high = np.where(there, moments.touch[..., 2:], -np.inf).max(axis=0) + _MARGIN_PX
    boxes = np.concatenate([low, high], axis=2)
    if not on:
        boxes[:, 1:, 2] = -np.inf
    seen = (moments.hull_count > 0) & (moments.fade > 0.0)[..., None]
    near = np.where(seen, moments.depth[..., 0], np.inf).min(axis=(0, 2))
    steps, needed = _plan(
        tiles, boxes, velocity, near, np.ascontiguousarray(look.size[:, 2]), view, duration_s, step_px
    )
    count = int(max(steps.max(initial=1), 1))
    return Plan(look, boxes, steps, count, count // np.maximum(needed, 1))


@njit(cache=True)
def who_touches(row0: int, column0: int, boxes: FloatArray, who: IntArray, counts: IntArray) -> int:
    """List the vehicles whose bodies, glow and beams may touch a tile.

    Args:
        row0: first row of the tile.
        column0: first column of the tile.
        boxes: (V, 3, 4) what each vehicle changes (px).
        who: (3, V) filled with the vehicles.
        counts: (3,) filled with how many of each.

    Returns:
        How many there are in all.
    """
    counts[:] = 0
    for v in range(len(boxes)):
        for kind in range(3):
            box = boxes[v, kind]
            apart = box[2] <= column0 or box[0] >= column0 + TILE_W
            apart |= box[3] <= row0 or box[1] >= row0 + TILE_H
            if not apart and box[2] > box[0]:
                who[kind, counts[kind]] = v
                counts[kind] += 1
    return int(counts[0] + counts[1] + counts[2])


@njit(cache=True)
def _plan(
    tiles: IntArray, boxes: FloatArray, velocity: FloatArray, near: FloatArray, top: FloatArray, view: View,
    duration: float, step_px: float,
) -> tuple[IntArray, IntArray]:  # fmt: skip
    """Steps of each tile, and the most that each vehicle's own image is needed for."""
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    R = view.rotation
    steps = np.zeros(len(tiles), dtype=np.int64)
    needed = np.ones(len(boxes), dtype=np.int64)
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    # What moves along the road moves away from the road's vanishing point, in proportion to the distance
    # from it and to speed over depth.
    vanish_u, vanish_v = np.inf, np.inf
    if R[2, 1] > 1e-6:
        vanish_u, vanish_v = fx * R[0, 1] / R[2, 1] + cx, fy * R[1, 1] / R[2, 1] + cy
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        if who_touches(row0, column0, boxes, who, counts) == 0:
            continue
        du = max(abs(column0 - vanish_u), abs(column0 + TILE_W - vanish_u))
        dv = max(abs(row0 - vanish_v), abs(row0 + TILE_H - vanish_v))
        away = np.sqrt(du * du + dv * dv)
        X, Y = (column0 + 0.5 * TILE_W - cx) / fx, (row0 + TILE_H - cy) / fy
        fall = X * R[0, 2] + Y * R[1, 2] + R[2, 2]
        most = 1.0
        for kind in range(3):
            for m in range(counts[kind]):
                v = who[kind, m]
                # The nearest place of the vehicle that this tile can show is at the height of its roof.
                depth = near[v]
                if fall < -1e-6:
                    depth = max(depth, 0.95 * (top[v] - view.eye[2]) / fall)
                across, along = velocity[v, 0], velocity[v, 1]
                flow = duration * (along * away + across * fx) / max(depth, 0.3) / step_px
                if kind == 1:
                    flow /= _GLOW_EASE
                elif kind == 2:
                    flow = min(flow / _BEAM_EASE, duration * along / (_BEAM_STEP_M * step_px))
                most = max(most, flow)
        count = 1
        while count < most and count < MAX_STEPS:
            count *= 2
        steps[n] = count
        for kind in range(2):
            for m in range(counts[kind]):
                needed[who[kind, m]] = max(needed[who[kind, m]], count)
    return steps, needed
