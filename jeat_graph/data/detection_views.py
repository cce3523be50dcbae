"""Detections from and to the tables of other libraries: data frames, `supervision.Detections`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, TextArray
from jeat_graph.data.boxes import without_area
from jeat_graph.data.column_names import BOX
from jeat_graph.data.embeddings import EmbeddingArray, embeddings_of_objects
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import (
    ASIDE,
    boxes_of_columns,
    check_one_video,
    classes_of_columns,
    named_columns,
    numbers_of,
    times_of_columns,
)
from jeat_graph.data.interop import boxes_of
from jeat_graph.data.to_supervision import supervision_of

if TYPE_CHECKING:
    import pandas as pd

    from jeat_graph.data.detections import Detections


class DetectionViews:
    """What `Detections` offers beside its columns; see there for the attributes."""

    if TYPE_CHECKING:
        boxes: FloatArray
        scores: FloatArray
        classes: TextArray | None

        def to_rows(self) -> tuple[FloatArray, TextArray, FloatArray, FloatArray, BoolArray, TextArray]:
            """One row a detection or empty scan."""

        def embedding_rows(self) -> EmbeddingArray | None:
            """What each row of `to_rows` looks like."""

        @staticmethod
        def from_rows(*columns: Any) -> Detections:
            """Group rows into scans."""

    def to_pandas(self) -> pd.DataFrame:
        """Return a data frame with the columns of `detections.csv`: one row a detection or empty scan."""
        import pandas as pd

        t, sensor, boxes, scores, _, classes = self.to_rows()
        columns: dict[str, Any] = {"t": t, "sensor": sensor}
        columns |= {name: boxes[:, k] for k, name in enumerate(BOX)}
        columns["score"] = scores
        if self.classes is not None:
            columns["class"] = classes
        looks = self.embedding_rows()
        if looks is not None:
            columns["embedding"] = list(looks)
        return pd.DataFrame(columns)

    @classmethod
    def from_pandas(
        cls, frame: pd.DataFrame, sensor: str = "rgb", *, time_unit: str = "s", rate_hz: float | None = None
    ) -> Detections:
        """Read a data frame, one row a detection; columns may go by the other names that files may have.

        Args:
            frame: `t` (s, or dates or spans of time); `left, top, width, height`, or `left, top, right,
                bottom`, or `x1, y1, x2, y2` and so on (px); `score` (1 where there is none), `sensor`,
                `class` and `embedding` (an array of numbers each) where there are such. A row without a box
                is a scan that found nothing; a box without area is left out, and counted in `dropped`.
            sensor: name of the sensor where the frame has no such column.
            time_unit: unit of a column `t` of numbers: `s`, `ms`, `us` or `ns`.
            rate_hz: frames per second (Hz), for a frame with frame numbers in place of times; these count
                from 0 where there is a frame 0, else from 1.

        Raises:
            DataError: a column is missing, or a row is no detection; the message names it.
        """
        if not hasattr(frame, "columns"):
            raise DataError(f"detections are read from a data frame, not from {type(frame).__name__}")
        c = named_columns(frame, ("t", *BOX), ("sensor", "score", "embedding", *ASIDE), "detections")
        check_one_video(c)
        box = boxes_of_columns(c)
        empty = np.isnan(box).all(axis=1)
        flat = without_area(box)
        found = cls.from_rows(
            times_of_columns(c, time_unit, rate_hz),
            [sensor] * len(box) if "sensor" not in c else [str(name) for name in c["sensor"]],
            box,
            numbers_of(c["score"], "score") if "score" in c else np.ones(len(box)),
            empty | flat,
            classes_of_columns(c, len(box)),
            embeddings_of_objects(list(c["embedding"])) if "embedding" in c else None,
        )
        return replace(found, dropped=int(flat.sum()))

    @classmethod
    def from_supervision(cls, source: Any, *, t: float, sensor: str = "rgb") -> Detections:
        """Take `supervision.Detections` of one picture as a scan; `concatenate` joins those of a video.

        Args:
            source: the detections, with names of classes if they have any.
            t: time of the picture (s).
            sensor: name of the sensor.
        """
        boxes, scores, classes, kept, _ = boxes_of(source)
        if len(boxes):
            out = cls.from_rows(np.full(len(boxes), t), [sensor] * len(boxes), boxes, scores, None, classes)
        else:
            out = cls.from_rows([t], [sensor], np.full((1, 4), np.nan), [np.nan], [True])
        return replace(out, dropped=int(np.sum(~kept)))

    def to_supervision(self) -> Any:
        """Return all boxes as `supervision.Detections`; classes are numbered in the order of the alphabet.

        Take those of one time: `Detections.from_scans([detections.scan(k)])`.

        Raises:
            ImportError: the package `supervision` is not installed.
        """
        return supervision_of(self.boxes, self.scores, self.classes)
