"""Which tiles change within an interval, through which vehicles, and how often they must be rendered."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.insects import Insects
from jeat_graph_sehn.simulation.imaging.moments import NEAR, SIDES, Look, Moments
from jeat_graph_sehn.simulation.imaging.tiles import TILE_H, TILE_W, View

MAX_STEPS = 256
_BEAM_STEP_M = 0.5  # a beam's light on the road may move this far from one rendering to the next
_GLOW_EASE = 4.0  # glow and beams are smooth: their motion asks for fewer renderings than an edge's
_BEAM_EASE = 0.33
_MARGIN_PX = 3.0


class Pace(NamedTuple):
    """How far an edge may move from one rendering to the next (px), and the time of all steps (s).

    That time may be a part of the interval.
    """

    step_px: float
    duration_s: float


class Plan(NamedTuple):
    """Work of one interval.

    Attributes:
        look: the V vehicles there are in it.
        boxes: (V + I, 3, 4) what each vehicle changes in the picture (px), by body and shadow, glow, beams;
            then what each insect does.
        steps: (T,) how often each tile's bodies are painted, a power of two; 0 where there are none.
        lit: (T,) how often its beams and glow are at most, a power of two; 0 where there are none.
        most: the greatest of them, at least 1.
        every: (V,) stride at which a vehicle is needed among `most` times.
        insects: the I insects there are in it.
    """

    look: Look
    boxes: FloatArray
    steps: IntArray
    lit: IntArray
    most: int
    every: IntArray
    insects: Insects


def make_plan(
    moments: Moments,
    velocity: FloatArray,
    look: Look,
    insects: Insects,
    tiles: IntArray,
    view: View,
    pace: Pace,
    on: bool,
) -> Plan:
    """Plan an interval.

    Args:
        moments: the vehicles at the interval's beginning, middle and end.
        velocity: (V, 3) greatest speed across and along each vehicle's way (m/s), and how often it is
            painted at least.
        look: the vehicles.
        insects: those before the lens.
        tiles: (T, 2) first row and column of the tiles.
        view: the camera.
        pace: of the renderings.
        on: whether vehicles have their lights on.
    """
    there = (moments.fade > 0.0)[..., None, None]
    low = np.where(there, moments.touch[..., :2], np.inf).min(axis=0) - _MARGIN_PX
    high = np.where(there, moments.touch[..., 2:], -np.inf).max(axis=0) + _MARGIN_PX
    boxes = np.concatenate([low, high], axis=2)
    if not on:
        boxes[:, 1:, 2] = -np.inf
    seen = (moments.body[..., SIDES] > 0) & (moments.fade > 0.0)[..., None]
    near = np.where(seen, moments.body[..., NEAR], np.inf).min(axis=(0, 2))
    way = np.zeros((len(look.kind), 2))
    for j in range(len(moments.times)):
        way = np.where(moments.fade[j][:, None] > 0.0, moments.pose[j, :, 2:], way)
    motion = np.column_stack([velocity[:, :2], way, velocity[:, 2]])
    top = np.ascontiguousarray(look.size[:, 2])
    if len(insects.middle):
        path = insects.path(float(moments.times[0]), float(moments.times[-1]), view)
        boxes, motion, near, top = _with_insects(path, view, boxes, motion, near, top)
    steps, lit, needed = _plan(tiles, boxes, motion, near, top, view, pace.duration_s, pace.step_px)
    needed = needed[: len(look.kind)]
    count = int(max(steps.max(initial=1), lit.max(initial=1), 1))
    return Plan(look, boxes, steps, lit, count, count // np.maximum(needed, 1), insects)


def _with_insects(
    path: tuple[FloatArray, FloatArray],
    view: View,
    boxes: FloatArray,
    motion: FloatArray,
    near: FloatArray,
    top: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Append insects to what `_plan` knows of vehicles: each as a thing 1 m away that moves across only."""
    where, speed = path
    count = len(where)
    more = np.full((count, 3, 4), -np.inf)
    more[:, 0] = where
    moving = np.zeros((count, 5))
    moving[:, 0], moving[:, 4] = speed / view.lens[0], 1.0
    flat = float(np.hypot(*view.rotation[2, :2]))
    moving[:, 2:4] = view.rotation[2, :2] / flat if flat > 0.0 else (0.0, 1.0)
    return (
        np.concatenate([boxes, more]),
        np.concatenate([motion, moving]),
        np.concatenate([near, np.ones(count)]),
        np.concatenate([top, np.full(count, view.eye[2])]),
    )


@njit(cache=True, error_model="numpy")
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
    right, low = column0 + TILE_W, row0 + TILE_H
    for v in range(len(boxes)):
        for kind in range(3):
            if boxes[v, kind, 2] <= column0 or boxes[v, kind, 0] >= right:
                continue
            if boxes[v, kind, 3] <= row0 or boxes[v, kind, 1] >= low:
                continue
            if boxes[v, kind, 2] > boxes[v, kind, 0]:
                who[kind, counts[kind]] = v
                counts[kind] += 1
    return int(counts[0] + counts[1] + counts[2])


@njit(cache=True, error_model="numpy")
def _plan(
    tiles: IntArray, boxes: FloatArray, motion: FloatArray, near: FloatArray, top: FloatArray, view: View,
    duration: float, step_px: float,
) -> tuple[IntArray, IntArray, IntArray]:  # fmt: skip
    """Steps of each tile's bodies and of its light, and the most that each vehicle's image is needed for."""
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    R = view.rotation
    steps = np.zeros(len(tiles), dtype=np.int64)
    lit = np.zeros(len(tiles), dtype=np.int64)
    needed = np.ones(len(boxes), dtype=np.int64)
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    # What moves straight on moves away from its direction's vanishing point, in proportion to the distance
    # from it and to speed over depth.
    vanish = np.full((len(boxes), 2), np.inf)
    for v in range(len(boxes)):
        sin, cos = motion[v, 2], motion[v, 3]
        ahead = R[2, 0] * sin + R[2, 1] * cos
        if abs(ahead) > 1e-6:
            vanish[v, 0] = fx * (R[0, 0] * sin + R[0, 1] * cos) / ahead + cx
            vanish[v, 1] = fy * (R[1, 0] * sin + R[1, 1] * cos) / ahead + cy
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        if who_touches(row0, column0, boxes, who, counts) == 0:
            continue
        X, Y = (column0 + 0.5 * TILE_W - cx) / fx, (row0 + TILE_H - cy) / fy
        fall = X * R[0, 2] + Y * R[1, 2] + R[2, 2]
        for kind in range(3):
            most = 1.0
            for m in range(counts[kind]):
                v = who[kind, m]
                du = max(abs(column0 - vanish[v, 0]), abs(column0 + TILE_W - vanish[v, 0]))
                dv = max(abs(row0 - vanish[v, 1]), abs(row0 + TILE_H - vanish[v, 1]))
                # The nearest place of the vehicle that this tile can show is at the height of its roof.
                depth = near[v]
                if fall < -1e-6:
                    depth = max(depth, 0.95 * (top[v] - view.eye[2]) / fall)
                across, along = motion[v, 0], motion[v, 1]
                flow = duration * (along * np.sqrt(du * du + dv * dv) + across * fx)
                flow /= max(depth, 0.3) * step_px
                if kind == 1:
                    flow /= _GLOW_EASE
                elif kind == 2:
                    flow = min(flow / _BEAM_EASE, duration * along / (_BEAM_STEP_M * step_px))
                most = max(most, flow, motion[v, 4] if kind < 2 else 1.0)
            count = 1
            while count < most and count < MAX_STEPS:
                count *= 2
            if counts[kind] == 0:
                continue
            if kind == 0:
                steps[n] = count
            else:
                lit[n] = max(lit[n], count)
            if kind < 2:
                for m in range(counts[kind]):
                    needed[who[kind, m]] = max(needed[who[kind, m]], count)
        if counts[1] and lit[n] > 1:
            # Glow and beams share their times, so that each glowing vehicle is needed at all of them.
            for m in range(counts[1]):
                needed[who[1, m]] = max(needed[who[1, m]], lit[n])
    return steps, lit, needed
