"""Detections from and to the tables of other libraries: data frames, `supervision.Detections`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, TextArray
from jeat_graph.data.box_std import STD_COLUMNS, known_std
from jeat_graph.data.camera_motion import CAMERA_MOTION
from jeat_graph.data.column_names import BOX, DEFAULT_SENSOR
from jeat_graph.data.embeddings import EmbeddingArray
from jeat_graph.data.interop import boxes_of
from jeat_graph.data.tables.detection_table import DetectionRows, rows_of_frame
from jeat_graph.data.tables.reading import Reading, ReadingOptions
from jeat_graph.data.to_supervision import supervision_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt
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
            ...

        def embedding_rows(self) -> EmbeddingArray | None:
            """What each row of `to_rows` looks like."""
            ...

        def std_rows(self) -> FloatArray | None:
            """How sure the detector is of each row's sides."""
            ...

        def motion_rows(self) -> FloatArray | None:
            """The camera's motion in the first of each scan's rows."""
            ...

        @staticmethod
        def from_rows(
            t: npt.ArrayLike,
            sensor: Sequence[str] | TextArray,
            boxes: npt.ArrayLike,
            scores: npt.ArrayLike,
            empty: npt.ArrayLike | None = None,
            classes: TextArray | None = None,
            /,
        ) -> Detections:
            """Group rows into scans."""
            ...

        @staticmethod
        def from_table(rows: DetectionRows) -> Detections:
            """Group the rows of a table into scans."""
            ...

    def to_pandas(self) -> pd.DataFrame:
        """Return a data frame with the columns of `detections.csv`: one row a detection or empty scan."""
        import pandas as pd

        columns = self.columns()
        if "embedding" in columns:
            columns["embedding"] = list(columns["embedding"])
        if CAMERA_MOTION in columns:
            columns[CAMERA_MOTION] = [None if np.isnan(one[0]) else one for one in columns[CAMERA_MOTION]]
        return pd.DataFrame(columns)

    def columns(self) -> dict[str, Any]:
        """Return the columns of `detections.csv` by name, one row a detection or empty scan.

        Embeddings, if there are any, are one array (N, E), and motions of cameras one of (N, 11).
        """
        t, sensor, boxes, scores, _, classes = self.to_rows()
        columns: dict[str, Any] = {"t": t, "sensor": sensor}
        columns |= {name: boxes[:, k] for k, name in enumerate(BOX)}
        columns["score"] = scores
        if self.classes is not None:
            columns["class"] = classes
        spread = known_std(self.std_rows())
        if spread is not None:
            columns |= {name: spread[:, k] for k, name in enumerate(STD_COLUMNS)}
        vectors = self.embedding_rows()
        if vectors is not None:
            columns["embedding"] = vectors
        motions = self.motion_rows()
        if motions is not None:
            columns[CAMERA_MOTION] = motions
        return columns

    @classmethod
    def from_pandas(
        cls, frame: pd.DataFrame, sensor: str = DEFAULT_SENSOR, **options: Unpack[ReadingOptions]
    ) -> Detections:
        """Read a data frame as `read_detections` reads a file of the same columns.

        Args:
            frame: one row a detection, with the columns and other names that files may have: `t` (s, dates or
                spans of time) or frame numbers; `left, top, width, height`, or `left, top, right, bottom`, or
                `x1, y1, x2, y2` and so on (px); `score` (1 where there is no such column), `sensor`, `class`;
                `left_std, top_std, right_std, bottom_std` (px), `embedding` (an array of numbers each) and
                `camera_motion` where there are such. A row without a box is a scan that found nothing; a box
                without area is left out, and counted in `dropped`.
            sensor: name of the sensor where the frame has no such column.
            options: what the frame does not say itself, as `tables.reading.Reading` has it.

        Raises:
            DataError: a column is missing, or a row (from 0) is no detection; the message names it.
        """
        return cls.from_table(rows_of_frame(frame, Reading(**options), sensor))

    @classmethod
    def from_supervision(cls, source: Any, *, t: float, sensor: str = "rgb") -> Detections:
        """Take `supervision.Detections` of one picture as a scan; `concatenate` joins those of a video.

        Args:
            source: the detections, with names of classes if they have any.
            t: time of the picture (s).
            sensor: name of the sensor.
        """
        boxes, scores, classes, kept, *_ = boxes_of(source)
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
