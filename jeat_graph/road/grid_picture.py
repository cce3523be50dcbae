"""The grid of the road as a camera sees it, drawn over its picture: the quickest check of a calibration."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.media.picture_file import read_picture
from jeat_graph.io.media.pictures import as_png
from jeat_graph.road.camera import RoadCamera

_ACROSS_M = np.arange(-21.0, 21.1, 3.5)
_ALONG_STEPS_M = (10.0, 50.0)
_SAMPLES = 400
_LEAST_DEPTH_M = 1.0
_FAR_M = 200.0


def draw_grid(camera: RoadCamera, path: str | Path, frame: str | Path | None = None) -> None:
    """Draw lines along the road every 3.5 m and across it every 10 m, up to 200 m ahead, as a PNG.

    Args:
        camera: the camera.
        path: the picture to write.
        frame: picture of the camera to draw over, of its size; without it the ground is grey.

    Raises:
        DataError: the frame cannot be read or is of another size.
    """
    canvas = np.full((camera.height, camera.width, 3), 60, dtype=np.uint8)
    if frame is not None:
        read = read_picture(frame)
        if read.shape[:2] != canvas.shape[:2]:
            raise DataError(
                f"is {read.shape[1]}x{read.shape[0]}, the camera is {camera.width}x{camera.height}", frame
            )
        canvas = np.ascontiguousarray(read)
    ahead = camera.position[1] + np.linspace(0.0, _FAR_M, _SAMPLES)
    middle = camera.position[0]
    for x in _ACROSS_M:
        _draw(canvas, camera, np.c_[np.full(_SAMPLES, middle + x), ahead], (90, 200, 90))
    across = np.linspace(_ACROSS_M[0], _ACROSS_M[-1], _SAMPLES) + middle
    for y in np.arange(0.0, _FAR_M + 1.0, _ALONG_STEPS_M[0]):
        colour = (60, 160, 255) if y % _ALONG_STEPS_M[1] == 0 else (90, 200, 90)
        _draw(canvas, camera, np.c_[across, np.full(_SAMPLES, camera.position[1] + y)], colour)
    data = as_png(canvas[..., ::-1])
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def _draw(canvas: np.ndarray, camera: RoadCamera, places: np.ndarray, colour: tuple[int, int, int]) -> None:
    import cv2

    pixels, depth = camera.project(np.c_[places, np.zeros(len(places))])
    near = np.abs(pixels - [camera.width / 2.0, camera.height / 2.0]).max(axis=1) < 4.0 * camera.width
    good = (depth > _LEAST_DEPTH_M) & near
    ends = np.rint(np.where(good[:, None], pixels, 0.0)).astype(np.int64)
    for k in np.flatnonzero(good[:-1] & good[1:]):
        start, end = ([int(v) for v in ends[i]] for i in (k, k + 1))
        cv2.line(canvas, start, end, colour, 1, cv2.LINE_AA)
