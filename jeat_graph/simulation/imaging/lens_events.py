"""The event camera behind a real lens on a swaying mount.

Where `EventCamera` takes a tile of the picture through an interval at a time, here each step of time has a
whole picture on the canvas of the lens. Only tiles that vehicles touch are painted anew; all pixels look at
their places in it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.events import EventArray
from jeat_graph.simulation.imaging.config import ImagingConfig
from jeat_graph.simulation.imaging.event_pixel import PixelModel, PixelState, advance, make_model, make_state
from jeat_graph.simulation.imaging.event_sink import EventSink, make_sink, to_events, with_room
from jeat_graph.simulation.imaging.lens import Lens, place_on_canvas
from jeat_graph.simulation.imaging.lighting import LUMINANCE
from jeat_graph.simulation.imaging.painter import light_tile, paint_tile, take_ground
from jeat_graph.simulation.imaging.plan import who_touches
from jeat_graph.simulation.imaging.renderer import Renderer
from jeat_graph.simulation.imaging.stage import Stage
from jeat_graph.simulation.imaging.tiles import TILE, TILE_H, TILE_W, tile_raster
from jeat_graph.simulation.streams import stream

_SWAY_STEP_PX = 0.5  # the mount turns no farther from one sample to the next
_MOST_SWAY_STEPS = 32
_MOST_LIGHT_STEPS = 8  # of tiles on which only beams and glow change
_SETTLE_STEPS = 8  # of pixels that saw something move in the interval before
_LARGEST_CHANGE = 45.0  # ln of the largest ratio of luminances, with room to spare


class LensEventCamera:
    """Makes the events of one scene behind a lens, interval by interval."""

    def __init__(
        self, renderer: Renderer, lens: Lens, config: ImagingConfig, seed: int, segment_seed: int
    ) -> None:
        """Start at time 0, with pixels that have settled at what they see then.

        Args:
            renderer: of the scene, with the lens's canvas as camera.
            lens: before it.
            config: settings.
            seed: of the camera; its pixels' mismatch is the same for all segments.
            segment_seed: of the segment's noise.

        Raises:
            ConfigError: CARLA's sensor has no lens.
        """
        if config.evt.mode == "carla":
            raise ConfigError("evt.mode: carla has no lens; leave the section `lens` out")
        self.renderer, self.lens = renderer, lens
        height, width = lens.rays.shape[:2]
        self._width = width
        self._static = np.ascontiguousarray(renderer.background.whole @ LUMINANCE)
        picture = renderer.picture(0.0) @ LUMINANCE
        first = lens.look(picture[..., None], 0.0, 0.0, 0.0).ravel()
        self._model = make_model(config.evt, stream(seed, "evt.mismatch"), width * height)
        self._state = make_state(self._model, first, stream(segment_seed, "evt.noise"))
        least = float(min(self._model.on.min(), self._model.off.min()))
        self._room = TILE * math.ceil(_LARGEST_CHANGE / least + 100.0)
        self._before, self._after = picture.copy(), picture
        self._tiles = tile_raster(width, height)
        self._reach = _reach(lens, self._tiles)
        self._busy = np.ones(len(self._tiles), dtype=np.int64)
        self._now_us = 0

    def advance(self, until_us: int) -> EventArray:
        """Return the events from where the call before ended up to `until_us`."""
        r, start, end = self.renderer, 1e-6 * self._now_us, 1e-6 * until_us
        plan = r.plan(start, end)
        path = self.lens.canvas.fx * self.lens.sway.speed() * (end - start)
        shakes = 1
        while shakes < path / _SWAY_STEP_PX and shakes < _MOST_SWAY_STEPS:
            shakes *= 2
        keys = np.maximum(plan.steps, np.minimum(plan.lit, _MOST_LIGHT_STEPS))
        count = max(int(keys.max(initial=1)), shakes)
        times = self._now_us + (until_us - self._now_us) * np.arange(count + 1, dtype=np.float64) / count
        stage = r.stage(r.moments(1e-6 * times[1:], plan.look), plan.look, channels=1)
        across = -(-self.lens.canvas.width // TILE_W)
        needed = _needed(self._reach, keys, across, shakes)
        samples = np.minimum(np.maximum(needed, np.minimum(self._busy, _SETTLE_STEPS)), count)
        self._busy = needed
        _rest(keys, r.tiles, self._static, self._before, self._after)
        sink = make_sink(max(1 << 18, 2 * self._room))
        for j in range(count):
            _paint(j, count, keys, r.tiles, plan.boxes, stage, self._before, self._after)
            look = (
                j,
                count,
                keys,
                self._before,
                self._after,
                self.lens.homography(1e-6 * float(times[j + 1])),
            )
            sink = _see(
                look, self._tiles, samples, self.lens.rays, times, self._model, self._state, sink, self._room
            )
        self._now_us = until_us
        return to_events(sink, self._width)


def _reach(lens: Lens, tiles: IntArray) -> IntArray:
    """First and last tile of the canvas, by row and column (T, 4), that each tile of pixels may look at."""
    height, width = lens.canvas.height, lens.canvas.width
    rest = np.array([[lens.canvas.fx, 0.0, lens.canvas.cx], [0.0, lens.canvas.fy, lens.canvas.cy]])
    place = lens.rays @ rest[:, :2].T + rest[:, 2]
    turns = lens.sway.most()
    far = 1.0 + float((lens.rays**2).sum(axis=-1).max())
    spare = lens.canvas.fx * (far * float(turns[:2].max()) + math.sqrt(far) * float(turns[2])) + 1.5
    out = np.zeros((len(tiles), 4), dtype=np.int64)
    for n, (row, column) in enumerate(tiles.tolist()):
        part = place[row : row + TILE_H, column : column + TILE_W].reshape(-1, 2)
        low = np.maximum(np.floor(part.min(axis=0) - spare), 0)
        high = np.minimum(np.ceil(part.max(axis=0) + spare), (width - 1, height - 1))
        low = np.minimum(low, (width - 1, height - 1))
        high = np.maximum(high, low)
        out[n] = low[1] // TILE_H, high[1] // TILE_H, low[0] // TILE_W, high[0] // TILE_W
    return out


@njit(cache=True)
def _needed(reach: IntArray, keys: IntArray, across: int, shakes: int) -> IntArray:
    """How often each tile of pixels is looked through: as often as what it looks at is painted."""
    out = np.full(len(reach), shakes)
    for n in range(len(reach)):
        for row in range(reach[n, 0], reach[n, 1] + 1):
            for column in range(reach[n, 2], reach[n, 3] + 1):
                out[n] = max(out[n], keys[row * across + column])
    return out


@njit(cache=True)
def _rest(keys: IntArray, tiles: IntArray, static: FloatArray, before: FloatArray, after: FloatArray) -> None:
    """Show the static picture where no vehicle is."""
    for n in range(len(tiles)):
        if keys[n] == 0:
            row, column = tiles[n]
            part = static[row : row + TILE_H, column : column + TILE_W]
            before[row : row + TILE_H, column : column + TILE_W] = part
            after[row : row + TILE_H, column : column + TILE_W] = part


@njit(cache=True)
def _paint(
    j: int, count: int, keys: IntArray, tiles: IntArray, boxes: FloatArray, stage: Stage, before: FloatArray,
    after: FloatArray,
) -> None:  # fmt: skip
    """Paint the tiles whose next key begins at step `j`: between `before` and `after` light is linear."""
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    canvas = stage.canvas
    for n in range(len(tiles)):
        if keys[n] == 0 or j % (count // keys[n]) != 0:
            continue
        row0, column0 = tiles[n]
        at = j + count // keys[n] - 1
        who_touches(row0, column0, boxes, who, counts)
        tile = take_ground(row0, column0, stage.packed, canvas.ground)
        light_tile(tile, at, who, counts, stage, canvas.light)
        paint_tile(tile, at, who, counts, stage, canvas.light)
        for r in range(tile.rows):
            for c in range(tile.columns):
                before[row0 + r, column0 + c] = after[row0 + r, column0 + c]
                after[row0 + r, column0 + c] = canvas.out[r * TILE_W + c, 0]


@njit(cache=True)
def _on_canvas(
    row: int, column: int, j: int, count: int, keys: IntArray, before: FloatArray, after: FloatArray
) -> float:
    """Luminance of a place on the canvas after step `j`, between its tile's two keys."""
    across = (before.shape[1] + TILE_W - 1) // TILE_W
    often = keys[(row // TILE_H) * across + column // TILE_W]
    old: float = before[row, column]
    if often == 0:
        return old
    stride = count // often
    new: float = after[row, column]
    out: float = old + (new - old) * ((j % stride) + 1) / stride
    return out


@njit(cache=True)
def _see(
    look: tuple[int, int, IntArray, FloatArray, FloatArray, FloatArray], tiles: IntArray, samples: IntArray,
    rays: FloatArray, times: FloatArray, model: PixelModel, state: PixelState, sink: EventSink, room: int,
) -> EventSink:  # fmt: skip
    """Take the pixels whose sample ends with this step to there. Nine parameters: the kernels' own tables.

    Args:
        look: step, number of steps, keys of the canvas's tiles, pictures before and after, map of the rays.
        tiles: (T, 2) of pixels.
        samples: (T,) how often each is looked through.
        rays: (H, W, 2) of the pixels.
        times: (J + 1,) µs.
        model: constants of all pixels.
        state: of all pixels; changed.
        sink: where events go.
        room: that a tile's events may need.
    """
    j, count, keys, before, after, m = look
    height, width = rays.shape[:2]
    high, wide = before.shape
    pixels, luminance = np.zeros(TILE, dtype=np.int64), np.zeros(TILE)
    for n in range(len(tiles)):
        stride = count // samples[n]
        if (j + 1) % stride != 0:
            continue
        row0, column0 = tiles[n]
        used = 0
        for row in range(row0, min(row0 + TILE_H, height)):
            for column in range(column0, min(column0 + TILE_W, width)):
                v, u = place_on_canvas(rays[row, column, 0], rays[row, column, 1], m, high, wide)
                r, c = math.floor(v), math.floor(u)
                a, b = v - r, u - c
                top = (1.0 - b) * _on_canvas(r, c, j, count, keys, before, after)
                top += b * _on_canvas(r, c + 1, j, count, keys, before, after)
                low = (1.0 - b) * _on_canvas(r + 1, c, j, count, keys, before, after)
                low += b * _on_canvas(r + 1, c + 1, j, count, keys, before, after)
                pixels[used] = row * width + column
                luminance[used] = (1.0 - a) * top + a * low
                used += 1
        sink = with_room(sink, room)
        advance(
            pixels[:used], luminance[:used], times[j + 1 - stride], times[j + 1], False, model, state, sink
        )
    return sink
