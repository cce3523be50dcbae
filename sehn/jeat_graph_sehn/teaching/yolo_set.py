"""Labels as a YOLO data set: its labels have no word for what is masked, so that is painted over."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.io.media.pictures import as_png
from jeat_graph.io.media.video import open_frames
from jeat_graph_sehn.teaching.stills import Stills, painted

_DIGITS = 6
_DATA = "path: .\ntrain: images/train\nval: images/val\nnames:\n  0: vehicle\n"


def write_yolo_set(parts: Mapping[str, Stills], out: Path) -> None:
    """Write pictures and labels of each part, and `data.yaml`.

    Args:
        parts: by name, `train` and `val`.
        out: the folder, which is there.

    Raises:
        DataError: a picture that cannot be read.
    """
    for name, stills in parts.items():
        images, labels = out / "images" / name, out / "labels" / name
        images.mkdir(parents=True)
        labels.mkdir(parents=True)
        with open_frames(stills.video) as frames:
            for k, number in enumerate(stills.numbers):
                found, _ = stills.boxes(k)
                picture = frames.frame(number)
                shown = np.ascontiguousarray(painted(picture, found)[..., ::-1])
                (images / f"{number:06d}.png").write_bytes(as_png(shown))
                height, width = picture.shape[:2]
                lines = _lines(found.corners[~found.ignored], (width, height))
                (labels / f"{number:06d}.txt").write_text("".join(lines), encoding="utf-8")
        if not stills.numbers:
            raise DataError("has no pictures at the times of the labels", stills.video)
    (out / "data.yaml").write_text(_DATA, encoding="utf-8")


def _lines(corners: np.ndarray, size_px: tuple[int, int]) -> list[str]:
    """Return a line a box: class, middle and size in shares of the picture."""
    shares = corners / np.array([*size_px, *size_px])
    middle, size = (shares[:, :2] + shares[:, 2:]) / 2.0, shares[:, 2:] - shares[:, :2]
    rows = np.hstack([middle, size]).round(_DIGITS).tolist()
    return ["0 " + " ".join(f"{value:.{_DIGITS}f}" for value in row) + "\n" for row in rows]
