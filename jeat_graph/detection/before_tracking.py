"""Raw pictures and events become a file of detections in the run directory: what tracking begins with."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from jeat_graph.data.detections import Detections
from jeat_graph.detection.automatic import resolved
from jeat_graph.detection.declared import known_of
from jeat_graph.detection.detecting import detect_files, picture_of
from jeat_graph.detection.live_detecting import detect_live, live_detections
from jeat_graph.detection.request import DetectRequest

#: Within the run directory, where raw recordings were tracked.
DETECTIONS = "detections.csv"


class DetectedFile(NamedTuple):
    """A file of detections; what is known of the networks that made it stands in it (`sensor_columns`).

    Attributes:
        path: the file.
        image: width and height of the picture (px), where only the events tell it.
        detectors: what made it, `sensor: name`.
    """

    path: str
    image: tuple[int, int] | None
    detectors: tuple[str, ...] = ()


def detect_before(
    request: DetectRequest,
    out: Path,
    *,
    declare: bool = True,
    say: Callable[[str], object] = lambda _: None,
    detect: Callable[[DetectRequest], Detections] | None = None,
) -> DetectedFile:
    """Detect, and write `detections.csv` into a run directory.

    Args:
        request: what to look for, and where.
        out: the run directory.
        declare: whether the tracker takes what is known of the networks, as `default` does: then it is
            reported.
        say: called with each thing that was found out.
        detect: looks; by default `detect_files`.

    Raises:
        ConfigError: a detector or a setting that is not known.
        DataError: a file cannot be read or written.
    """
    from jeat_graph.io.files.locking import hold_made_folder
    from jeat_graph.io.tables.detections_io import write_detections

    request = resolved(request, say)
    known = known_of(request, say if declare else lambda _: None)
    image = picture_of(request)
    found = out / DETECTIONS
    with hold_made_folder(out):  # detecting takes long; the run directory is held by what tracks
        detections = detect_files(request, say) if detect is None else detect(request)
        write_detections(detections, found, declared=known)
    return DetectedFile(str(found), image, request.detectors)


def detect_live_before(
    request: DetectRequest,
    out: Path,
    *,
    declare: bool = True,
    say: Callable[[str], object] = lambda _: None,
    until: Callable[[], bool] = lambda: False,
) -> DetectedFile:
    """Do the same with cameras that are on, until an end is asked for.

    Args and errors as of `detect_before`; `until` tells when to end.
    """
    from jeat_graph.io.files.locking import hold_made_folder
    from jeat_graph.io.tables.detections_io import write_detections

    found = out / DETECTIONS
    known: list[tuple[DetectRequest, tuple[int, int]]] = []
    with hold_made_folder(out):
        scans = detect_live(request, say, until=until, prepared=lambda *what: known.append(what))
        detections = live_detections(scans, request)
        [(asked, size_px)] = known
        write_detections(detections, found, declared=known_of(asked, say if declare else lambda _: None))
    return DetectedFile(str(found), size_px, asked.detectors)
