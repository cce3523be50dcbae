"""What a detector returns for one picture, as a tracker takes it in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.box_std import checked_std
from jeat_graph.data.embeddings import unit_embeddings
from jeat_graph.data.interop import boxes_of, is_supervision
from jeat_graph.data.scan import Scan
from jeat_graph.data.to_supervision import OwnDetections
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.scans import ScanLike


class Updates:
    """A tracker's way in for a detector's results; see `Tracker`."""

    if TYPE_CHECKING:
        logs_assigned: bool
        _class_ids: dict[str, int]

        def step(self, scans: ScanLike | Sequence[ScanLike]) -> Trajectories:
            """Take in scans of one time."""
            ...

        def assigned(self, count: int) -> IntArray:
            """Which track took each detection of the last step."""
            ...

    def update(
        self,
        source: Any,
        *,
        t: float,
        sensor: str,
        scores: npt.ArrayLike | None = None,
        classes: npt.ArrayLike | None = None,
        embeddings: npt.ArrayLike | None = None,
        box_std: npt.ArrayLike | None = None,
        format: Literal["ltwh", "xyxy", "xywh"] | None = None,  # what users of other libraries call it
    ) -> Trajectories:
        """Take in what a detector returned for one picture.

        Args:
            source: `supervision.Detections`, a result of `ultralytics`, a dict of `torchvision`, a data
                frame, or boxes (M, 4) in px, (M, 5) with scores, (M, 6) with scores and numbers of classes;
                None, or none (M = 0), if the sensor looked and found nothing. Boxes without area, which
                detectors clip, are left out.
            t: time (s), not before that of the last step. It is believed: a wrong one in the future ends all
                tracks, and right ones after it are refused (`LiveTracker` waits for others to confirm it).
            sensor: name of the sensor.
            scores: (M,) confidence in [0, 1], for boxes that come without; 1 where neither says it.
            classes: (M,) names or numbers of classes, for boxes that come without.
            embeddings: (M, E) what each looks like, of a network for re-identification; NaN where unknown.
            box_std: (M, 4) standard deviations of left, top, right, bottom by the detector (px); NaN where
                unknown. A data frame may have them in its columns.
            format: what boxes of an array are: `ltwh` (left, top, width, height; so they are taken without
                it), `xyxy` (left, top, right, bottom), or `xywh` (centre, width, height).

        Returns and raises as `step`; also a DataError where it cannot be known what `source` is.
        """
        found = boxes_of(source, scores, classes, format)
        vectors = None if embeddings is None else unit_embeddings(embeddings, len(found.kept))[found.kept]
        std = found.box_std if box_std is None else checked_std(box_std, len(found.kept))[found.kept]
        own = is_supervision(source)
        self.logs_assigned = self.logs_assigned or own
        scan = Scan(t, sensor, found.boxes, found.scores, found.classes, vectors, None, std)
        self._class_ids = {**self._class_ids, **found.class_ids}
        table = self.step(scan)
        if not own:
            return table
        assigned = np.zeros(len(found.kept), dtype=np.int64)
        assigned[found.kept] = self.assigned(len(scan))
        return replace(table, own=OwnDetections(source, assigned))
