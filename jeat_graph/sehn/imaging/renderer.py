"""The renderer of one scene: static picture, vehicles at any times, and which tiles they change."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.sehn.imaging.background import Background, make_background
from jeat_graph.sehn.imaging.config import RenderConfig
from jeat_graph.sehn.imaging.lighting import lights_of
from jeat_graph.sehn.imaging.moments import Look, Moments, line_up, project_moments
from jeat_graph.sehn.imaging.optics import optics_of
from jeat_graph.sehn.imaging.paint import PALETTE
from jeat_graph.sehn.imaging.painter import TILE_H, TILE_W, make_layers, paint_tile, view_of
from jeat_graph.sehn.scene import Scene
from jeat_graph.sehn.streams import stream

MAX_STEPS = 256
_BEAM_STEP_M = 0.3  # a beam's light on the road may move this far from one rendering to the next
_NEAR_M = -25.0


class Renderer:
    """Renders one scene.

    Attributes:
        scene: what is rendered.
        config: how.
        background: the static picture.
        tiles: (T, 2) first row and column of each tile.
    """

    def __init__(self, scene: Scene, config: RenderConfig, seed: int) -> None:
        """Render the static picture, and give each vehicle a colour by `seed`."""
        self.scene = scene
        self.config = config
        self.lights = lights_of(scene, config)
        self.optics = optics_of(scene.camera, config)
        self.view = view_of(scene.camera)
        self.background: Background = make_background(scene, self.lights, self.optics, config)
        rng = stream(seed, "paint")
        total = max(1, len(scene.fleet) + len(scene.parked_fleet))
        palette = np.array(PALETTE)
        self._colours = palette[rng.integers(0, len(palette), total)] * rng.uniform(0.85, 1.15, (total, 1))
        height, width = self.background.lux.shape
        rows, columns = np.meshgrid(
            np.arange(0, height, TILE_H), np.arange(0, width, TILE_W), indexing="ij"
        )
        self.tiles: IntArray = np.stack([rows.ravel(), columns.ravel()], axis=1).astype(np.int64)

    def moments(self, times: FloatArray) -> tuple[Moments, Look]:
        """Project the vehicles at `times` (J,) (s)."""
        states = self.scene.states_at(times, self.config.far_m, _NEAR_M)
        first, pose, more = line_up(states, len(times), self.config.far_m)
        number = states.object_id[first]
        look = Look(
            kind=states.kind[first],
            size=states.size[first],
            colour=self._colours[(number - 1) % len(self._colours)],
            salt=100 + number,
            way=states.direction[first],
            parked=states.parked[first],
            number=number,
        )
        made = project_moments(
            times, pose, more, look, self.scene.camera, self.lights, self.optics, self.config
        )
        return made, look

    def steps(self, start_s: float, end_s: float) -> IntArray:
        """How often each vehicle's image must be renewed from `start_s` to `end_s`.

        Returns:
            (K, 3) identity, steps for its body, and steps for its beams; powers of two.
        """
        camera = self.scene.camera
        states = self.scene.states_at(np.array([start_s, (start_s + end_s) / 2.0, end_s]), self.config.far_m, _NEAR_M)
        place, velocity, acceleration = states.corners()
        assert velocity is not None
        assert acceleration is not None
        pixel, speed, _ = camera.project_motion(place, velocity, acceleration)
        depth = camera.to_camera(place)[..., 2]
        # Corners that are in the picture, or nearly; of a vehicle without any, those in front of the camera.
        margin = 40.0
        size = np.array([camera.width, camera.height])
        inside = (depth > 1.0) & ((pixel > -margin) & (pixel < size + margin)).all(axis=2)
        inside |= (depth > 1.0) & ~inside.any(axis=1)[:, None]
        moved = np.where(inside, np.hypot(speed[..., 0], speed[..., 1]), 0.0).max(axis=1)
        # The speed within the interval may exceed that at its ends a little.
        moved = 1.1 * moved * (end_s - start_s) / self.config.max_step_px
        driven = np.hypot(states.velocity[:, 0], states.velocity[:, 1]) * (end_s - start_s) / _BEAM_STEP_M
        number, column = np.unique(states.object_id, return_inverse=True)
        out = np.zeros((len(number), 2))
        np.maximum.at(out, column, np.stack([moved, np.minimum(driven, 3.0 * moved)], axis=1))
        return np.column_stack([number, power_of_two(out)])

    def touched(self, moments: Moments) -> FloatArray:
        """Boxes (V, 3, 4) of what each vehicle changes in the picture at any of the moments (px)."""
        there = moments.fade > 0.0
        box = moments.touch
        low = np.where(there[..., None, None], box[..., :2], np.inf).min(axis=0)
        high = np.where(there[..., None, None], box[..., 2:], -np.inf).max(axis=0)
        return np.concatenate([low, high], axis=2)

    def picture(self, time_s: float) -> FloatArray:
        """Render the whole picture at one time: radiance (H, W, 3) in cd/m²."""
        moments, look = self.moments(np.array([time_s]))
        boxes = self.touched(moments)
        out = self.background.whole.copy()
        _paint_all(
            out, self.tiles, boxes, self.background, moments, look, self.lights, self.optics, self.view,
            make_layers(),
        )  # fmt: skip
        return out


def power_of_two(counts: FloatArray) -> IntArray:
    """Round counts (...) up to powers of two from 1 to `MAX_STEPS`."""
    capped = np.clip(counts, 1.0, MAX_STEPS)
    return (2 ** np.ceil(np.log2(capped))).astype(np.int64)


def steps_for(steps: IntArray, number: IntArray, default: int) -> IntArray:
    """Look up the steps of vehicles `number` (V,) in what `Renderer.steps` returned.

    Returns:
        (V, 2) steps of body and beams; `default` for a vehicle that came into range only later.
    """
    out = np.full((len(number), 2), default, dtype=np.int64)
    if len(steps):
        at = np.minimum(np.searchsorted(steps[:, 0], number), len(steps) - 1)
        out = np.where((steps[at, 0] == number)[:, None], steps[at, 1:], out)
    return np.minimum(out, default)


@njit(cache=True)
def tile_steps(who: IntArray, counts: IntArray, every: IntArray, available: int) -> int:
    """How often a tile is rendered: as its bodies, its glow (which is smooth) or its beams demand."""
    most = 1
    for n in range(counts[0]):
        most = max(most, every[who[0, n], 0])
    for n in range(counts[1]):
        most = max(most, every[who[1, n], 0] // 4)
    for n in range(counts[2]):
        most = max(most, every[who[2, n], 1])
    return min(most, available)


@njit(cache=True)
def who_touches(
    row0: int, column0: int, boxes: FloatArray, who: IntArray, counts: IntArray
) -> None:
    """List the vehicles whose bodies, glow and beams may touch a tile.

    Args:
        row0: first row of the tile.
        column0: first column of the tile.
        boxes: (V, 3, 4) what each vehicle changes (px).
        who: (3, V) filled with the vehicles.
        counts: (3,) filled with how many of each.
    """
    counts[:] = 0
    for v in range(len(boxes)):
        for kind in range(3):
            box = boxes[v, kind]
            apart = box[2] <= column0 or box[0] >= column0 + TILE_W or box[3] <= row0 or box[1] >= row0 + TILE_H
            if not apart and box[2] > box[0]:
                who[kind, counts[kind]] = v
                counts[kind] += 1


@njit(cache=True)
def _paint_all(
    out, tiles, boxes, ground, moments, look, lights, optics, view, layers
):  # type: ignore[no-untyped-def]  # fmt: skip
    height, width = ground.lux.shape
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    patch = np.zeros((TILE_H * TILE_W, 3))
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        who_touches(row0, column0, boxes, who, counts)
        if counts.sum() == 0:
            continue
        paint_tile(row0, column0, 0, who, counts, ground, moments, look, lights, optics, view, layers, patch)
        for r in range(min(TILE_H, height - row0)):
            for c in range(min(TILE_W, width - column0)):
                out[row0 + r, column0 + c] = patch[r * TILE_W + c]
