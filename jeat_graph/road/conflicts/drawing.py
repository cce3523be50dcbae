"""Heat map of conflicts, over the camera's picture or from above."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.media.picture_file import read_picture
from jeat_graph.io.media.pictures import as_png
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.conflicts.encounters import Encounter
from jeat_graph.road.conflicts.poses import Poses

#: Spread of one conflict on the road (m), and how strongly the hottest place covers the picture.
_SPREAD_M, _COVER = 3.0, 0.75
_GROUND, _WAYS = 60, 110
_ABOVE_PX, _MARGIN_M = 1000, 10.0


def draw_heat(
    found: Sequence[Encounter],
    vehicles: Sequence[Poses],
    path: str | Path,
    camera: RoadCamera | None = None,
    picture: str | Path | None = None,
) -> None:
    """Draw the density of conflicts as a PNG: in the camera's picture, or from above without a camera.

    Args:
        found: the conflicts.
        vehicles: all vehicles, whose ways are drawn beneath.
        path: the picture to write.
        camera: the camera over the road.
        picture: a picture of it, of its size; without it the ground is grey.

    Raises:
        DataError: the picture cannot be read or is of another size.
    """
    import cv2

    if camera is None:
        canvas, places, ways = _above(vehicles)
    else:
        canvas, places, ways = _in_picture(camera, vehicles, picture)
    if picture is None:
        for way in ways:
            cv2.polylines(canvas, [np.rint(way).astype(np.int32)], False, (_WAYS,) * 3, 1, cv2.LINE_AA)
    heat = np.zeros(canvas.shape[:2])
    for one in found:
        away = ((places - [one.x, one.y]) ** 2).sum(axis=-1)
        heat += np.exp(-0.5 * np.where(np.isfinite(away), away, np.inf) / _SPREAD_M**2)
    if heat.max() > 0.0:
        share = heat / heat.max()
        colour = cv2.applyColorMap(np.rint(255.0 * share).astype(np.uint8), cv2.COLORMAP_INFERNO)[..., ::-1]
        cover = (_COVER * np.clip(3.0 * share, 0.0, 1.0))[..., None]
        canvas = np.rint((1.0 - cover) * canvas + cover * colour).astype(np.uint8)
    data = as_png(np.ascontiguousarray(canvas))
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


Canvas = tuple[npt.NDArray[np.uint8], FloatArray, list[FloatArray]]


def ground(camera: RoadCamera, picture: str | Path | None) -> npt.NDArray[np.uint8]:
    """Return what a camera sees (H, W, 3): a picture of it, or grey.

    Raises:
        DataError: the picture cannot be read or is of another size.
    """
    if picture is None:
        return np.full((camera.height, camera.width, 3), _GROUND, dtype=np.uint8)
    read = read_picture(picture)
    if read.shape[:2] != (camera.height, camera.width):
        size = f"{read.shape[1]}x{read.shape[0]}, the camera is {camera.width}x{camera.height}"
        raise DataError(f"is {size}", picture)
    return np.ascontiguousarray(read)


def _in_picture(camera: RoadCamera, vehicles: Sequence[Poses], picture: str | Path | None) -> Canvas:
    canvas = ground(camera, picture)
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    pixels = np.stack([x, y], axis=-1, dtype=np.float64).reshape(-1, 2)
    places = camera.to_road(pixels).reshape(camera.height, camera.width, 2)
    ways = []
    for one in vehicles:
        pixels, depth = camera.project(np.c_[one.mean[:, :2], np.zeros(len(one.t))])
        ways.append(np.clip(pixels[depth > 1.0], -1e4, 1e4))
    return canvas, places, [way for way in ways if len(way)]


def _above(vehicles: Sequence[Poses]) -> Canvas:
    """Road from above, driving upwards; across it a metre is as long as along it."""
    states = np.concatenate([np.zeros((1, 2)) if not vehicles else vehicles[0].mean[:1, :2]])
    states = np.concatenate([states, *(one.mean[:, :2] for one in vehicles)])
    low, high = states.min(axis=0) - _MARGIN_M, states.max(axis=0) + _MARGIN_M
    scale = _ABOVE_PX / float((high - low).max())
    width, height = (max(round(float(v)), 1) for v in scale * (high - low))
    x = low[0] + (np.arange(width) + 0.5) / scale
    y = high[1] - (np.arange(height) + 0.5) / scale
    places = np.stack(np.meshgrid(x, y), axis=-1)
    ways = [(one.mean[:, :2] - [low[0], high[1]]) * [scale, -scale] for one in vehicles]
    return np.full((height, width, 3), _GROUND, dtype=np.uint8), places, ways
