"""Labels as a COCO data set: masked boxes are crowds, which neither training nor evaluation count."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from jeat_graph.io.exports.coco_writer import coco_annotations, coco_categories, coco_images, write_coco
from jeat_graph.io.media.picture_file import read_picture
from jeat_graph_sehn.teaching.recordings import store_frames
from jeat_graph_sehn.teaching.stills import Stills

_US = 1e6
_DIGITS = 4


def write_coco_set(parts: Mapping[str, Stills], out: Path) -> None:
    """Write `images/`, and a file of annotations for each part.

    Args:
        parts: by name, `train` and `val`.
        out: the folder, which is there.
    """
    for video, (name, stills) in enumerate(parts.items()):
        paths = store_frames(stills.video, stills.numbers, out / "images")
        height, width = read_picture(paths[0]).shape[:2]
        t_us = np.rint(stills.times * _US).astype(np.int64)
        images = coco_images(name, video, t_us, (width, height), [path.name for path in paths])
        annotations = []
        for k in range(len(paths)):
            found, weights = stills.boxes(k)
            low, size = found.corners[:, :2], found.corners[:, 2:] - found.corners[:, :2]
            count = len(low)
            rows = coco_annotations(
                video,
                np.full(count, k),
                np.hstack([low, size]),
                np.zeros(count, dtype=np.int64),
                found.object_id,
                np.ones(count),
                found.ignored,
            )
            for row, weight in zip(rows, weights.tolist(), strict=True):
                row["score"] = round(weight, _DIGITS)
                del row["visible"]  # nobody knows it
            annotations += rows
        write_coco(out / f"{name}.json", images, annotations, coco_categories(["vehicle"]))
