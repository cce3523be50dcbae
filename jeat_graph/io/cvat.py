"""Write tracks for the annotation tool CVAT: a zip of its import format `MOT 1.1`.

The zip holds `gt/gt.txt` (`frame, id, left, top, width, height, 1, class, visibility`, frames and classes
counted from 1) and `gt/labels.txt` (the names of the classes, one a line).
"""

from __future__ import annotations

import zipfile
from pathlib import Path

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.atomic import atomic_path
from jeat_graph.io.trajectories_io import by_frame

_FIRST_FRAME = 1
# A fixed date: the same tracks give the same bytes.
_DATE = (1980, 1, 1, 0, 0, 0)


def write_cvat(table: Trajectories, path: str | Path, rate_hz: float, label: str = "vehicle") -> None:
    """Write tracks whose rows are at frame times.

    Args:
        table: the tracks; times go to the nearest frame.
        path: the file, ending in `.zip`.
        rate_hz: frames per second; the first frame is at time 0.
        label: name of the class of all tracks, as it is called in CVAT's task.

    Raises:
        DataError: the rate is not positive, or a time lies before the first frame.
    """
    frame, rows = by_frame(table, path, rate_hz)
    lines = []
    for k in range(len(rows)):
        box = ",".join(f"{value:.3f}" for value in rows.boxes[k])
        lines.append(f"{frame[k] + _FIRST_FRAME},{rows.track_id[k]},{box},1,1,{rows.existence[k]:.3f}\n")
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo("gt/gt.txt", _DATE), "".join(lines))
        archive.writestr(zipfile.ZipInfo("gt/labels.txt", _DATE), f"{label}\n")
