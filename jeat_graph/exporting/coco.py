"""Write tracks as a COCO data set: one image a frame, one annotation a box, with `track_id` and `score`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jeat_graph.data.tables.frame_filling import check_rate
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.exporting.record import ExportRequest, ExportTarget
from jeat_graph.exporting.sources import FRAME_OPTIONS, picture_of, tables_at_frames
from jeat_graph.io.exports.coco_writer import coco_annotations, coco_categories, coco_images, write_coco
from jeat_graph.io.tables.by_frame import by_frame

_US_PER_S = 1e6
_VIDEO = 0


def write_coco_tracks(
    table: Trajectories,
    path: str | Path,
    rate_hz: float,
    size_px: tuple[int, int],
    label: str = "vehicle",
) -> None:
    """Write tracks whose rows are at frame times.

    Args:
        table: the tracks; times go to the nearest frame. Classes become categories, in the order of the
            alphabet.
        path: the file, JSON.
        rate_hz: frames per second; the first frame is at time 0.
        size_px: width and height of the pictures.
        label: category of rows of which the class is not known.

    Raises:
        DataError: the rate is not positive, a time lies before the first frame, or there are too many frames.
    """
    frame, rows = by_frame(table, path, check_rate(rate_hz, path))
    named = (
        np.full(len(rows), label)
        if rows.classes is None
        else np.where(rows.classes == "", label, rows.classes)
    )
    names, kind = np.unique(named, return_inverse=True)
    count = int(frame.max()) + 1 if len(frame) else 0
    t_us = np.rint(np.arange(count) / rate_hz * _US_PER_S).astype(np.int64)
    images = coco_images("tracks", _VIDEO, t_us, size_px, [f"{k:06d}.jpg" for k in range(count)])
    n = len(rows)
    boxes = coco_annotations(
        _VIDEO, frame, rows.boxes, kind.reshape(-1), rows.track_id, np.ones(n), np.zeros(n, dtype=np.bool_)
    )
    for annotation, existence in zip(boxes, rows.existence.tolist(), strict=True):
        annotation["score"] = round(existence, 6)
        del annotation["visible"]  # of the truth alone
    write_coco(path, images, boxes, coco_categories(names if len(names) else [label]))


def _write(request: ExportRequest) -> str:
    frames, rate_hz, summary = tables_at_frames(request)
    width, height = picture_of(request)
    write_coco_tracks(frames, request.out, rate_hz, (round(width), round(height)))
    return summary


EXPORT = ExportTarget(
    name="coco",
    program="COCO tools",
    writes="`.json`: images, boxes with `track_id` and `score`, and categories",
    write=_write,
    options=FRAME_OPTIONS,
)
