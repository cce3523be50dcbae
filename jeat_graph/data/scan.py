"""A scan: everything that one sensor reported at one time.

One without boxes is data too: it says that the sensor looked and found nothing.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, TextArray
from jeat_graph.data.box_std import checked_std
from jeat_graph.data.boxes import check_boxes, class_texts, without_area
from jeat_graph.data.camera_motion import motion_of
from jeat_graph.data.embeddings import EmbeddingArray, unit_embeddings
from jeat_graph.data.errors import DataError
from jeat_graph.data.interop import from_xyxy


@dataclass(frozen=True, eq=False)
class Scan:
    """All detections of one sensor at one time.

    A box without area is refused here; files, streams and `Tracker.update`, where a detector has clipped it,
    leave it out.

    Attributes:
        t: time (s), finite.
        sensor: name of the sensor.
        boxes: (M, 4) left, top, width, height (px); M may be 0.
        scores: (M,) confidence in [0, 1].
        classes: (M,) class names, empty text where unknown, or None.
        embeddings: (M, E) what each looks like, of unit length (float32); NaN where unknown; or None.
        camera_motion: (11,) how the camera moved since its picture before (see `camera_motion`), or None.
        box_std: (M, 4) standard deviations of left, top, right, bottom by the detector (px), NaN where
            unknown; or None.

    Raises:
        DataError: if any value is not valid (see `check_boxes`, `unit_embeddings`, `motion_of`,
            `checked_std`).
    """

    t: float
    sensor: str
    boxes: FloatArray
    scores: FloatArray
    classes: TextArray | None = None
    embeddings: EmbeddingArray | None = None
    camera_motion: FloatArray | None = None
    box_std: FloatArray | None = None

    def __post_init__(self) -> None:
        t = time_of(self.t)
        if not isinstance(self.sensor, str):
            raise DataError(f"sensor is the name of the sensor (a text), got {self.sensor!r}")
        object.__setattr__(self, "sensor", str(self.sensor))  # NumPy's texts name themselves otherwise
        boxes, scores = check_boxes(self.boxes, self.scores)
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "boxes", boxes)
        object.__setattr__(self, "scores", scores)
        if self.classes is not None:
            object.__setattr__(self, "classes", class_texts(self.classes, len(scores)))
        if self.embeddings is not None:
            object.__setattr__(self, "embeddings", unit_embeddings(self.embeddings, len(scores)))
        if self.camera_motion is not None:
            object.__setattr__(self, "camera_motion", motion_of(self.camera_motion))
        if self.box_std is not None:
            object.__setattr__(self, "box_std", checked_std(self.box_std, len(scores)))

    def __len__(self) -> int:
        return len(self.scores)

    @staticmethod
    def from_xyxy(
        t: float,
        sensor: str,
        corners: npt.ArrayLike,
        scores: npt.ArrayLike,
        classes: TextArray | None = None,
    ) -> Scan:
        """Make a scan of boxes (M, 4) that are given as left, top, right, bottom (px)."""
        return Scan(t, sensor, from_xyxy(corners), np.asarray(scores, dtype=np.float64), classes)


def time_of(t: Any) -> float:
    """Return a time (s) as a number.

    Raises:
        DataError: it is none, or not finite.
    """
    if type(t) is float and math.isfinite(t):
        return t
    dated = getattr(getattr(t, "dtype", None), "kind", "") in ("m", "M")  # of ns, it would pass for a number
    try:
        number = np.nan if dated else float(t)
    except (TypeError, ValueError, OverflowError):
        dated, number = True, np.nan
    if dated:
        raise DataError(f"t is a time in seconds (a number), got {t!r:.60}; dates have .timestamp()")
    if not np.isfinite(number):
        raise DataError(f"the time of a scan must be finite, got {t}")
    return number


def scan_with_area(
    t: float,
    sensor: str,
    boxes: npt.ArrayLike,
    scores: npt.ArrayLike,
    classes: npt.ArrayLike | None = None,
    embeddings: npt.ArrayLike | None = None,
    camera_motion: npt.ArrayLike | None = None,
    box_std: npt.ArrayLike | None = None,
) -> tuple[Scan, int]:
    """Make a scan of what a detector gave, which may have clipped boxes to nothing.

    Args:
        t: time (s).
        sensor: name of the sensor.
        boxes: (M, 4) left, top, width, height (px).
        scores: (M,) confidence in [0, 1]; that of a box without area is not looked at.
        classes: (M,) class names, or None.
        embeddings: (M, E), or None.
        camera_motion: (11,), or None.
        box_std: (M, 4), or None.

    Returns:
        The scan without the boxes that have no area, and how many these were.

    Raises:
        DataError: as `Scan` does.
    """
    columns: list[Any] = [boxes, scores, classes, embeddings, box_std]
    flat = None
    with contextlib.suppress(TypeError, ValueError, OverflowError):  # what is no array is named by `Scan`
        table = np.asarray(boxes, dtype=np.float64)
        if table.ndim == 2 and table.shape[1] == 4:
            columns[0] = table
            # Of most scans no box has been clipped, which one look at all sides says.
            flat = without_area(table) if len(table) and not table[:, 2:].min() > 0.0 else None
        if flat is not None and flat.any() and all(one is None or len(one) == len(flat) for one in columns):
            columns = [None if one is None else np.asarray(one)[~flat] for one in columns]
    motion = None if camera_motion is None else motion_of(camera_motion)
    made = Scan(t, sensor, columns[0], columns[1], columns[2], columns[3], motion, columns[4])
    return made, 0 if flat is None else int(flat.sum())


def trusted_scan(
    t: float,
    sensor: str,
    boxes: FloatArray,
    scores: FloatArray,
    classes: TextArray | None,
    embeddings: EmbeddingArray | None,
    camera_motion: FloatArray | None,
    box_std: FloatArray | None,
) -> Scan:
    """Make a scan of arrays that were checked already, without checking them again."""
    scan = object.__new__(Scan)
    values: dict[str, Any] = {"t": t, "sensor": sensor, "boxes": boxes, "scores": scores}
    values |= {"classes": classes, "embeddings": embeddings, "camera_motion": camera_motion}
    values["box_std"] = box_std
    for name, value in values.items():
        object.__setattr__(scan, name, value)
    return scan
