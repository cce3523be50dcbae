"""A drawn film of a near miss, where there is no video: both vehicles as rectangles on the road.

In the camera's picture the ground stays and the vehicles drive; from above the view goes with them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.drawing.movie.film import MovieWriter
from jeat_graph.drawing.movie.lettering import darken, letters, paint, room_for
from jeat_graph.drawing.palette import TEXT, track_rgb
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.conflicts.drawing import ground
from jeat_graph.road.conflicts.encounters import Encounter
from jeat_graph.road.conflicts.measures import collision
from jeat_graph.road.conflicts.poses import HEADING, LENGTH, WIDTH, Poses

RATE_HZ = 20.0
#: From above: sides of the picture (px) and what it shows (m), with lines on the ground so far apart (m).
_SIDE_PX, _SIDE_M, _GRID_M = 720, 60.0, 10.0
_ROAD, _LINES, _WAYS, _OTHERS = 60, 80, 110, (150, 150, 150)
#: OpenCV takes no coordinates that are much larger.
_FARTHEST_PX = 1e4
#: Corners of a rectangle in halves of its length and width, front first.
_CORNERS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])
_TEXT_SCALE, _STROKE, _MARGIN_PX = 0.7, 2, 6
#: A longer time to collision is not shown (s).
_LONGEST_TTC_S = 9.9

Image = npt.NDArray[np.uint8]


class FilmFromAbove:
    """The road from above; the view goes with the vehicles."""

    size_px = (_SIDE_PX, _SIDE_PX)
    _scale = _SIDE_PX / _SIDE_M

    def __init__(self) -> None:
        self._middle = np.zeros(2)

    def begin(self, middle: FloatArray) -> Image:
        """Return the ground with its lines, seen around a place (2,) on the road (m)."""
        import cv2

        self._middle = middle
        canvas = np.full((_SIDE_PX, _SIDE_PX, 3), _ROAD, dtype=np.uint8)
        low, high = middle - _SIDE_M / 2.0, middle + _SIDE_M / 2.0
        for axis in (0, 1):
            for value in np.arange(np.ceil(low[axis] / _GRID_M) * _GRID_M, high[axis], _GRID_M):
                ends = np.stack([low, high])
                ends[:, axis] = value
                (x0, y0), (x1, y1) = np.rint(self.pixels(ends)).astype(int).tolist()
                cv2.line(canvas, (x0, y0), (x1, y1), (_LINES,) * 3, 1, cv2.LINE_AA)
        return canvas

    def pixels(self, places: FloatArray) -> FloatArray:
        """Return where places (N, 2) on the road are in the picture, driving upwards."""
        return (places - self._middle) * [self._scale, -self._scale] + _SIDE_PX / 2.0


class FilmInPicture:
    """The camera's picture.

    Args:
        camera: over the road.
        picture: of it; without one the ground is grey.
    """

    def __init__(self, camera: RoadCamera, picture: str | Path | None) -> None:
        whole = ground(camera, picture)
        # Films have even sides.
        self._ground = whole[: camera.height // 2 * 2, : camera.width // 2 * 2]
        self._camera = camera
        self.size_px = (self._ground.shape[1], self._ground.shape[0])

    def begin(self, middle: FloatArray) -> Image:
        """Return the ground."""
        return self._ground.copy()

    def pixels(self, places: FloatArray) -> FloatArray:
        """Return where places (N, 2) on the road are in the picture; NaN behind the camera."""
        pixels, depth = self._camera.project(np.c_[places, np.zeros(len(places))])
        return np.where(depth[:, None] > 1.0, pixels, np.nan)


def write_film(
    one: Encounter,
    vehicles: Sequence[Poses],
    path: str | Path,
    around_s: float,
    view: FilmFromAbove | FilmInPicture,
) -> None:
    """Draw the film of an encounter.

    Args:
        one: the encounter.
        vehicles: all vehicles; the two of it are coloured.
        path: the film, `.webm` or `.mp4`.
        around_s: so long before and after.
        view: where it is seen.
    """
    both = {v.track_id: v for v in vehicles if v.track_id in (one.first, one.second)}
    begin = max(one.t - around_s, min(v.t[0] for v in both.values()))
    end = min(one.t + around_s, max(v.t[-1] for v in both.values()))
    times = np.arange(begin, end + 1e-9, 1.0 / RATE_HZ)
    with MovieWriter(path, view.size_px, RATE_HZ) as writer:
        for picture in _pictures(one, vehicles, times, view):
            writer.append(picture)


def _pictures(
    one: Encounter, vehicles: Sequence[Poses], times: FloatArray, view: FilmFromAbove | FilmInPicture
) -> Iterator[Image]:
    middle = np.array([one.x, one.y])
    ways = [v.mean[:, :2] for v in vehicles if v.track_id in (one.first, one.second)]
    for t in times.tolist():
        now = {v.track_id: v.at(np.array([t])).mean[0] for v in vehicles if v.t[0] <= t <= v.t[-1]}
        pair = [now[k] for k in (one.first, one.second) if k in now]
        middle = np.mean([state[:2] for state in pair], axis=0) if pair else middle
        canvas = view.begin(middle)
        for way in ways:
            _way(canvas, view.pixels(way))
        for track, state in now.items():
            own = track in (one.first, one.second)
            _rectangle(canvas, view, state, track_rgb(track) if own else _OTHERS, filled=own)
        _write(canvas, _caption(one, t, pair))
        yield canvas


def _caption(one: Encounter, t: float, pair: Sequence[FloatArray]) -> str:
    text = f"{one.first} and {one.second}, {one.kind}: {t:.2f} s"
    if len(pair) == 2:
        ttc = float(collision(pair[0], pair[1]).ttc)
        if ttc <= _LONGEST_TTC_S:
            text += f", TTC {ttc:.1f} s"
    return text


def _way(canvas: Image, pixels: FloatArray) -> None:
    """Draw where a vehicle drives."""
    import cv2

    seen = pixels[np.isfinite(pixels).all(axis=1)]
    line = np.rint(np.clip(seen, -_FARTHEST_PX, _FARTHEST_PX)).astype(np.int32)
    cv2.polylines(canvas, [line], False, (_WAYS,) * 3, 1, cv2.LINE_AA)


def _rectangle(
    canvas: Image,
    view: FilmFromAbove | FilmInPicture,
    state: FloatArray,
    colour: tuple[int, int, int],
    *,
    filled: bool,
) -> None:
    """Draw a vehicle's rectangle on the ground, with its front as a thicker line."""
    import cv2

    ahead = np.array([np.sin(state[HEADING]), np.cos(state[HEADING])])
    aside = np.array([ahead[1], -ahead[0]])
    half = _CORNERS * [state[LENGTH] / 2.0, state[WIDTH] / 2.0]
    corners = view.pixels(state[:2] + half @ np.stack([ahead, aside]))
    if not np.isfinite(corners).all() or np.abs(corners).max() > _FARTHEST_PX:
        return
    shape = np.rint(corners).astype(np.int32)
    if filled:
        cv2.fillPoly(canvas, [shape], colour, cv2.LINE_AA)
    cv2.polylines(canvas, [shape], True, colour, 1, cv2.LINE_AA)
    cv2.polylines(canvas, [shape[:2]], False, (255, 255, 255) if filled else colour, 2, cv2.LINE_AA)


def _write(canvas: Image, text: str) -> None:
    painted = letters(text, _TEXT_SCALE, _STROKE)
    place = room_for(painted, (2.0 * _MARGIN_PX, 5.0 * _MARGIN_PX), (canvas.shape[1], canvas.shape[0]))
    darken(canvas, place, _MARGIN_PX)
    paint(canvas, painted, place, TEXT)
