"""A scan: everything that one sensor reported at one time.

One without boxes is data too: it says that the sensor looked and found nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, TextArray
from jeat_graph.data.boxes import check_boxes, class_texts
from jeat_graph.data.embeddings import EmbeddingArray, unit_embeddings
from jeat_graph.data.errors import DataError
from jeat_graph.data.interop import from_xyxy


@dataclass(frozen=True, eq=False)
class Scan:
    """All detections of one sensor at one time.

    Attributes:
        t: time (s), finite.
        sensor: name of the sensor.
        boxes: (M, 4) left, top, width, height (px); M may be 0.
        scores: (M,) confidence in [0, 1].
        classes: (M,) class names, empty text where unknown, or None.
        embeddings: (M, E) what each looks like, of unit length (float32); NaN where unknown; or None.

    Raises:
        DataError: if any value is not valid (see `check_boxes`, `unit_embeddings`).
    """

    t: float
    sensor: str
    boxes: FloatArray
    scores: FloatArray
    classes: TextArray | None = None
    embeddings: EmbeddingArray | None = None

    def __post_init__(self) -> None:
        t = float(self.t)
        if not np.isfinite(t):
            raise DataError(f"the time of a scan must be finite, got {self.t}")
        boxes, scores = check_boxes(self.boxes, self.scores)
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "boxes", boxes)
        object.__setattr__(self, "scores", scores)
        if self.classes is not None:
            object.__setattr__(self, "classes", class_texts(self.classes, len(scores)))
        if self.embeddings is not None:
            object.__setattr__(self, "embeddings", unit_embeddings(self.embeddings, len(scores)))

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


def trusted_scan(
    t: float,
    sensor: str,
    boxes: FloatArray,
    scores: FloatArray,
    classes: TextArray | None,
    embeddings: EmbeddingArray | None,
) -> Scan:
    """Make a scan of arrays that were checked already, without checking them again."""
    scan = object.__new__(Scan)
    values = {"t": t, "sensor": sensor, "boxes": boxes, "scores": scores}
    for name, value in (values | {"classes": classes, "embeddings": embeddings}).items():
        object.__setattr__(scan, name, value)
    return scan
