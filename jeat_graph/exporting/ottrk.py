"""Write tracks as OpenTrafficCam's `.ottrk`: JSON, compressed with bz2, which its OTAnalytics reads.

It counts frames of a video from 1. Since version 1.1 of its detections x, y are the top left corner of a box,
and since 1.2 times are seconds since 1970. The video itself is found by its name, beside the file.
"""

from __future__ import annotations

import bz2
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import TextArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.exporting.record import ExportRequest, ExportTarget
from jeat_graph.exporting.sources import FRAME_OPTIONS, picture_of, tables_at_frames
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.tables.by_frame import by_frame
from jeat_graph.version import __version__

_FIRST_FRAME = 1
_FORMAT, _DETECTION_FORMAT = "1.1", "1.2"
# Class of vehicles of which it is not known.
_UNKNOWN = "car"


class OttrkVideo(NamedTuple):
    """The video that the tracks belong to.

    Attributes:
        name: its file name with its type, such as `cam1_2024-05-01_12-00-00.mp4`.
        width: px.
        height: px.
        rate_hz: frames per second.
        start: seconds since 1970 at its first frame.
    """

    name: str
    width: int
    height: int
    rate_hz: float
    start: float = 0.0


def write_ottrk(
    table: Trajectories, path: str | Path, video: OttrkVideo, classes: TextArray | None = None
) -> None:
    """Write tracks whose rows are at frame times.

    Args:
        table: the tracks; times go to the nearest frame.
        path: the file, ending in `.ottrk`.
        video: the video.
        classes: (N,) class of each row, if not the table's; `car` where neither says it.

    Raises:
        DataError: the rate is not positive, or a time lies before the first frame.
    """
    frame, rows = by_frame(table, path, video.rate_hz)
    kinds = rows.classes if classes is None else classes
    kinds = np.full(len(rows), _UNKNOWN) if kinds is None or len(kinds) != len(rows) else kinds
    last_of = {int(k): int(frame[rows.track_id == k].max()) for k in np.unique(rows.track_id)}
    seen: set[int] = set()
    detections = []
    for k in np.lexsort((rows.track_id, frame)).tolist():
        one, at = int(rows.track_id[k]), int(frame[k])
        left, top, width, height = rows.boxes[k].tolist()
        detections.append(
            {
                "class": str(kinds[k]) or _UNKNOWN,
                "confidence": round(float(rows.existence[k]), 4),
                "x": round(left, 3),
                "y": round(top, 3),
                "w": round(width, 3),
                "h": round(height, 3),
                "frame": at + _FIRST_FRAME,
                "occurrence": round(video.start + at / video.rate_hz, 6),
                "input_file_path": f"{Path(video.name).stem}.otdet",
                "interpolated-detection": bool(rows.used[k] == 0),
                "first": one not in seen,
                "finished": at == last_of[one],
                "track-id": one,
            }
        )
        seen.add(one)
    frames = int(frame.max()) + 1 if len(rows) else 0
    names = sorted({str(kind) or _UNKNOWN for kind in kinds.tolist()}) or [_UNKNOWN]
    content: dict[str, Any] = {
        "metadata": _metadata(video, frames, names),
        "data": {"detections": detections},
    }
    with atomic_path(path) as temporary:
        temporary.write_bytes(bz2.compress(json.dumps(content, ensure_ascii=False).encode("utf-8")))


def _metadata(video: OttrkVideo, frames: int, classes: Sequence[str]) -> dict[str, Any]:
    seconds = frames / video.rate_hz
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    name = Path(video.name)
    return {
        "otdet_version": _DETECTION_FORMAT,
        "ottrk_version": _FORMAT,
        "video": {
            "filename": name.stem,
            "filetype": name.suffix,
            "width": video.width,
            "height": video.height,
            "expected_duration": int(np.ceil(seconds)),
            "recorded_fps": video.rate_hz,
            "actual_fps": video.rate_hz,
            "number_of_frames": frames,
            "recorded_start_date": video.start,
            "length": f"{hours}:{minutes:02d}:{rest:02d}",
        },
        "detection": {
            "otvision_version": "",
            "model": {
                "name": "jeat-graph",
                "weights": "",
                "iou_threshold": 0.0,
                "image_size": 0,
                "max_confidence": 1.0,
                "half_precision": False,
                "classes": {str(number): name for number, name in enumerate(classes)},
            },
            "chunksize": 1,
            "normalized_bbox": False,
        },
        "tracking": {
            "otvision_version": "",
            "first_tracked_video_start": video.start,
            "last_tracked_video_end": video.start + seconds,
            "tracking_run_id": "1",
            "frame_group": "0",
            "tracker": {"name": "jeat-graph", "version": __version__},
        },
    }


def _write(request: ExportRequest) -> str:
    frames, rate_hz, summary = tables_at_frames(request)
    width, height = picture_of(request)
    name = request.video or f"{Path(request.source).resolve().name}.mp4"
    write_ottrk(frames, request.out, OttrkVideo(name, int(width), int(height), rate_hz, request.start or 0.0))
    return summary


EXPORT = ExportTarget(
    name="ottrk",
    program="OTAnalytics",
    writes="`.ottrk`: a run's boxes by frames of the video",
    write=_write,
    options=(*FRAME_OPTIONS, "video", "start"),
)
