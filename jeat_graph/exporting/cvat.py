"""Write tracks for the annotation tool CVAT: a zip of its import format `MOT 1.1`.

The zip holds `gt/gt.txt` (`frame, id, left, top, width, height, 1, class, visibility`, frames and classes
counted from 1) and `gt/labels.txt` (the names of the classes, one a line).
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.exporting.record import ExportRequest, ExportTarget
from jeat_graph.exporting.sources import FRAME_OPTIONS, tables_at_frames
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.files.zipped import LABELS, MEMBER
from jeat_graph.io.tables.by_frame import by_frame

_FIRST_FRAME = _FIRST_LABEL = 1
# A fixed date: the same tracks give the same bytes.
_DATE = (1980, 1, 1, 0, 0, 0)


def write_cvat(table: Trajectories, path: str | Path, rate_hz: float, label: str = "vehicle") -> None:
    """Write tracks whose rows are at frame times.

    Args:
        table: the tracks; times go to the nearest frame.
        path: the file, ending in `.zip`.
        rate_hz: frames per second; the first frame is at time 0.
        label: class of rows of which it is not known, as it is called in CVAT's task.

    Raises:
        DataError: the rate is not positive, or a time lies before the first frame.
    """
    frame, rows = by_frame(table, path, rate_hz)
    named = np.full(len(rows), label) if rows.classes is None else rows.classes
    labels, number = np.unique(np.where(named == "", label, named), return_inverse=True)
    labels = labels if len(labels) else np.array([label])
    number = number.reshape(-1) + _FIRST_LABEL
    lines = []
    for k in range(len(rows)):
        box = ",".join(f"{value:.3f}" for value in rows.boxes[k])
        lines.append(
            f"{frame[k] + _FIRST_FRAME},{rows.track_id[k]},{box},1,{number[k]},{rows.existence[k]:.3f}\n"
        )
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo(MEMBER, _DATE), "".join(lines))
        archive.writestr(zipfile.ZipInfo(LABELS, _DATE), "".join(f"{name}\n" for name in labels))


def _write(request: ExportRequest) -> str:
    frames, rate_hz, summary = tables_at_frames(request)
    write_cvat(frames, request.out, rate_hz)
    return summary


EXPORT = ExportTarget(
    name="cvat",
    program="CVAT",
    writes="`.zip` for its import as `MOT 1.1`",
    write=_write,
    options=FRAME_OPTIONS,
)
