"""Detections: what the sensors' detectors reported, scan by scan (see `scan`)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, TextArray
from jeat_graph.data.beside import Beside
from jeat_graph.data.box_std import checked_std, join_std, spread_std
from jeat_graph.data.boxes import class_texts, find_bad_row
from jeat_graph.data.camera_motion import bad_motions, join_motions, motions_of_scans, rows_of_motions
from jeat_graph.data.class_columns import rows_of_class
from jeat_graph.data.detection_views import DetectionViews
from jeat_graph.data.embeddings import EmbeddingArray, join_embeddings, spread_embeddings, unit_embeddings
from jeat_graph.data.errors import DataError
from jeat_graph.data.grouping import group_rows
from jeat_graph.data.scan import Scan, trusted_scan
from jeat_graph.data.tables.detection_table import DetectionRows

__all__ = ["Detections", "Scan"]


@dataclass(frozen=True, eq=False)
class Detections(DetectionViews):
    """Scans of any number of sensors, in time order, in columns.

    Attributes:
        sensors: names of the sensors that occur, in alphabetical order.
        scan_t: (K,) time of each scan (s), not decreasing.
        scan_sensor: (K,) index into `sensors`.
        scan_start: (K + 1,) scan k owns the rows `scan_start[k]:scan_start[k + 1]`.
        boxes: (N, 4) left, top, width, height (px).
        scores: (N,) confidence in [0, 1].
        classes: (N,) class names (empty text where unknown), or None if no class is known.
        dropped: boxes without area that a reader has left out; their scans are there.
        embeddings: (N, E) what each looks like, of unit length; NaN where unknown; or None.
        camera_motion: (K, 11) how the camera moved before each scan, NaN where unknown; or None.
        box_std: (N, 4) standard deviations of left, top, right, bottom by the detector (px), NaN where
            unknown; or None.
    """

    sensors: tuple[str, ...]
    scan_t: FloatArray
    scan_sensor: IntArray
    scan_start: IntArray
    boxes: FloatArray
    scores: FloatArray
    classes: TextArray | None = None
    dropped: int = 0
    embeddings: EmbeddingArray | None = None
    camera_motion: FloatArray | None = None
    box_std: FloatArray | None = None

    @staticmethod
    def from_rows(
        t: npt.ArrayLike,
        sensor: Sequence[str] | TextArray,
        boxes: npt.ArrayLike,
        scores: npt.ArrayLike,
        empty: npt.ArrayLike | None = None,
        classes: Sequence[str] | TextArray | None = None,
        **beside: Unpack[Beside],
    ) -> Detections:
        """Group rows, in any order, into scans. Rows of one scan keep their order.

        Args:
            t: (R,) time of each row (s).
            sensor: (R,) sensor name of each row.
            boxes: (R, 4) left, top, width, height (px); ignored where `empty`.
            scores: (R,) confidence; ignored where `empty`.
            empty: (R,) true where the row only says that the scan took place; none by default.
            classes: (R,) class of each row, optional.
            beside: `embeddings`, `camera_motion` and `box_std`, each optional, as `Beside` has them.

        Raises:
            DataError: a time, a box or an embedding that is not valid; the message names the row.
        """
        names = np.asarray(sensor, dtype=np.str_).reshape(-1)
        try:
            time = np.array(t, dtype=np.float64).reshape(-1)
            b = np.array(boxes, dtype=np.float64, order="C").reshape(-1, 4)
            s = np.array(scores, dtype=np.float64).reshape(-1)
        except (TypeError, ValueError):
            raise DataError("t (R,) in seconds, boxes (R, 4) and scores (R,) must be numbers") from None
        gap = np.zeros(len(time), dtype=bool) if empty is None else np.asarray(empty, dtype=bool)
        if not len(time) == len(names) == len(b) == len(s) == len(gap):
            raise DataError("t, sensor, boxes, scores and empty must have one entry a row")
        if not np.isfinite(time).all():
            row = int(np.argmin(np.isfinite(time)))
            raise DataError(f"row {row}: t must be finite, got {time[row]}")
        rows = np.flatnonzero(~gap) if gap.any() else slice(None)
        bad = find_bad_row(b[rows], s[rows])
        if bad is not None:
            raise DataError(f"row {np.arange(len(time))[rows][bad[0]]}: {bad[1]}")
        sensors, code = np.unique(names, return_inverse=True)
        kinds = None if classes is None else class_texts(classes, len(time)).copy()
        embeddings, camera_motion = beside.get("embeddings"), beside.get("camera_motion")
        box_std = beside.get("box_std")
        vectors = None if embeddings is None else unit_embeddings(embeddings, len(time))
        if camera_motion is not None and bad_motions(camera_motion).any():
            raise DataError(f"row {int(np.argmax(bad_motions(camera_motion)))}: camera_motion is none")
        spread = None if box_std is None else checked_std(box_std, len(time))
        return Detections.from_checked(
            time, sensors.tolist(), code.reshape(-1), (b, s, kinds), gap, vectors, camera_motion, spread
        )

    @staticmethod
    def from_checked(
        t: FloatArray,
        sensors: Sequence[str],
        code: IntArray,
        found: tuple[FloatArray, FloatArray, TextArray | None],
        empty: BoolArray,
        embeddings: EmbeddingArray | None = None,
        camera_motion: FloatArray | None = None,
        box_std: FloatArray | None = None,
    ) -> Detections:
        """Group rows that are known to be good, as `from_rows`; their arrays may become the detections' own.

        Args:
            t: (R,) time of each row (s).
            sensors: names, in alphabetical order; each occurs.
            code: (R,) index into them.
            found: boxes (R, 4), scores (R,), and classes (R,) or None.
            empty: (R,) true where the row only says that the scan took place.
            embeddings: (R, E) what each row looks like, or None.
            camera_motion: (R, 11) in one row of each scan that knows it, NaN in the others; or None.
            box_std: (R, 4), or None.
        """
        groups = group_rows(t, code, empty)
        boxes, scores, classes = found
        rows = slice(None) if groups.rows is None else groups.rows
        return Detections(
            sensors=tuple(sensors),
            scan_t=t[groups.first],
            scan_sensor=code[groups.first].astype(np.int64),
            scan_start=groups.start,
            boxes=np.ascontiguousarray(boxes[rows]),
            scores=np.ascontiguousarray(scores[rows]),
            classes=None if classes is None else classes[rows],
            embeddings=None if embeddings is None else embeddings[rows],
            camera_motion=motions_of_scans(camera_motion, groups.scan, len(groups.first)),
            box_std=None if box_std is None else np.ascontiguousarray(box_std[rows]),
        )

    @staticmethod
    def from_table(rows: DetectionRows) -> Detections:
        """Group the rows of a table, which are known to be good, into scans."""
        found = Detections.from_checked(
            rows.t,
            rows.sensors,
            rows.code,
            (rows.boxes, rows.scores, rows.classes),
            rows.empty,
            rows.embeddings,
            rows.camera_motion,
            rows.box_std,
        )
        return replace(found, dropped=rows.dropped)

    @staticmethod
    def from_scans(scans: Iterable[Scan]) -> Detections:
        """Collect scans, in any order; scans of one sensor at one time become one."""
        items = list(scans)
        rows = [max(len(scan), 1) for scan in items]
        blank = np.full((1, 4), np.nan)
        return Detections.from_rows(
            t=np.repeat([scan.t for scan in items], rows),
            sensor=np.repeat([scan.sensor for scan in items], rows) if items else [],
            boxes=np.concatenate([scan.boxes if len(scan) else blank for scan in items] or [blank[:0]]),
            scores=np.concatenate(
                [scan.scores if len(scan) else blank[:, 0] for scan in items] or [blank[:0, 0]]
            ),
            empty=np.repeat([len(scan) == 0 for scan in items], rows),
            classes=_classes_of_rows(items),
            embeddings=join_embeddings([scan.embeddings for scan in items], rows),
            camera_motion=rows_of_motions([scan.camera_motion for scan in items], np.array(rows)),
            box_std=join_std([scan.box_std if len(scan) else None for scan in items], rows),
        )

    @staticmethod
    def concatenate(parts: Sequence[Detections]) -> Detections:
        """Merge several recordings of one scene (say, one file a sensor) into one.

        Rows of one sensor at one time that stand in several parts become one scan.
        """
        rows = [part.to_rows() for part in parts]
        columns = [np.concatenate(column) for column in zip(*rows, strict=True)]
        has_class = any(part.classes is not None for part in parts)
        t, sensor, boxes, scores, empty, classes = columns
        vectors = [part.embedding_rows() for part in parts]
        whole = Detections.from_rows(
            *(t, sensor, boxes, scores, empty, classes if has_class else None),
            embeddings=join_embeddings(vectors, [len(t) for t, *_ in rows]),
            camera_motion=join_motions([part.motion_rows() for part in parts], [len(t) for t, *_ in rows]),
            box_std=join_std([part.std_rows() for part in parts], [len(t) for t, *_ in rows]),
        )
        return replace(whole, dropped=sum(part.dropped for part in parts))

    def to_rows(
        self,
    ) -> tuple[FloatArray, TextArray, FloatArray, FloatArray, npt.NDArray[np.bool_], TextArray]:
        """Flatten to one row a detection, and one row for each empty scan.

        Returns:
            t (R,), sensor (R,), boxes (R, 4) and scores (R,) (NaN in rows of empty scans),
            empty (R,), classes (R,) (empty text where unknown).
        """
        count = np.diff(self.scan_start)
        rows = np.maximum(count, 1)
        scan = np.repeat(np.arange(len(count)), rows)
        empty = count[scan] == 0
        boxes = np.full((len(scan), 4), np.nan)
        scores = np.full(len(scan), np.nan)
        boxes[~empty] = self.boxes
        scores[~empty] = self.scores
        names = np.asarray(self.sensors, dtype=np.str_)
        classes = np.zeros(len(scan), dtype=np.str_ if self.classes is None else self.classes.dtype)
        if self.classes is not None:
            classes[~empty] = self.classes
        sensor = names[self.scan_sensor[scan]] if len(scan) else np.zeros(0, dtype=np.str_)
        return self.scan_t[scan], sensor, boxes, scores, empty, classes

    def embedding_rows(self) -> EmbeddingArray | None:
        """Return the embeddings (R, E) of the rows of `to_rows`, NaN where there is none; or None."""
        count = np.diff(self.scan_start)
        return spread_embeddings(self.embeddings, np.repeat(count > 0, np.maximum(count, 1)))

    def std_rows(self) -> FloatArray | None:
        """Return `box_std` (R, 4) of the rows of `to_rows`, NaN where unknown; or None."""
        count = np.diff(self.scan_start)
        return spread_std(self.box_std, np.repeat(count > 0, np.maximum(count, 1)))

    def motion_rows(self) -> FloatArray | None:
        """Return the camera's motions (R, 11) in the first of each scan's rows of `to_rows`; or None."""
        return rows_of_motions(self.camera_motion, np.maximum(np.diff(self.scan_start), 1))

    @property
    def num_scans(self) -> int:
        """Number of scans K, the empty ones included."""
        return len(self.scan_t)

    def __len__(self) -> int:
        return len(self.scores)

    def scan(self, k: int) -> Scan:
        """Return scan `k` (0 <= k < num_scans)."""
        rows = slice(int(self.scan_start[k]), int(self.scan_start[k + 1]))
        return trusted_scan(
            float(self.scan_t[k]),
            self.sensors[self.scan_sensor[k]],
            self.boxes[rows],
            self.scores[rows],
            None if self.classes is None else self.classes[rows],
            None if self.embeddings is None else self.embeddings[rows],
            self._motion_of(k),
            None if self.box_std is None else self.box_std[rows],
        )

    def _motion_of(self, k: int) -> FloatArray | None:
        motion = None if self.camera_motion is None else self.camera_motion[k]
        return None if motion is None or np.isnan(motion[0]) else motion

    def sensor_times(self, sensor: str) -> FloatArray:
        """Times of one sensor's scans (s), not decreasing."""
        return np.asarray(self.scan_t[self.scan_sensor == self.sensors.index(sensor)])

    @property
    def box_t(self) -> FloatArray:
        """Times (N,) of all boxes (s)."""
        return np.repeat(self.scan_t, np.diff(self.scan_start))

    @property
    def box_sensor(self) -> IntArray:
        """Indices (N,) into `sensors` of all boxes."""
        return np.repeat(self.scan_sensor, np.diff(self.scan_start))

    def scans(self) -> Iterator[Scan]:
        """Iterate over the scans in time order."""
        return (self.scan(k) for k in range(self.num_scans))

    def batches(self) -> Iterator[list[Scan]]:
        """Iterate over groups of scans of different sensors at one and the same time."""
        starts = np.flatnonzero(np.diff(self.scan_t, prepend=-np.inf) != 0)
        ends = np.append(starts, self.num_scans)[1:]
        for start, end in zip(starts, ends, strict=True):
            yield [self.scan(k) for k in range(start, end)]

    def select(self, sensors: str | Iterable[str]) -> Detections:
        """Keep the scans of one sensor, or of some.

        Raises:
            DataError: there is no sensor of such a name; the message names those there are.
        """
        wanted = {sensors} if isinstance(sensors, str) else set(sensors)
        strange = sorted(str(name) for name in wanted - set(self.sensors))
        if strange:
            there = ", ".join(self.sensors) or "none"
            raise DataError(f"there is no sensor {strange[0]!r} in the recording; there are: {there}")
        keep = np.array([name in wanted for name in self.sensors], dtype=bool)
        return Detections.from_scans(self.scan(k) for k in range(self.num_scans) if keep[self.scan_sensor[k]])

    def of_class(self, *names: str) -> Detections:
        """Keep the detections of some classes, and those of which no class is known; all scans stay.

        Raises:
            DataError: no detection has a class, or none is of one of these.
        """
        return self.where(rows_of_class(self.classes, names, unknown=True))

    def where(self, keep: BoolArray) -> Detections:
        """Keep the detections (N,) that a mask says; all scans stay."""
        before = np.concatenate(([0], np.cumsum(keep)))
        return replace(
            self,
            scan_start=before[self.scan_start].astype(np.int64),
            boxes=self.boxes[keep],
            scores=self.scores[keep],
            classes=None if self.classes is None else self.classes[keep],
            embeddings=None if self.embeddings is None else self.embeddings[keep],
            box_std=None if self.box_std is None else self.box_std[keep],
        )


def _classes_of_rows(scans: Sequence[Scan]) -> TextArray | None:
    """Classes of the rows that `from_scans` makes, one of them for an empty scan; None if nothing has any."""
    if all(scan.classes is None for scan in scans):
        return None
    texts = [
        np.zeros(max(len(scan), 1), dtype="U1") if scan.classes is None or not len(scan) else scan.classes
        for scan in scans
    ]
    return np.concatenate(texts)
