"""What a detector returns for one picture, and a sensor that was not declared, as a tracker takes them in."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from jeat_graph.config.learnt import LearntConfig
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import IntArray
from jeat_graph.data.embeddings import unit_embeddings
from jeat_graph.data.errors import InputWarning
from jeat_graph.data.interop import boxes_of, is_supervision
from jeat_graph.data.scan import Scan
from jeat_graph.data.to_supervision import OwnDetections
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.first_sight import wider
from jeat_graph.tracking.notice import notice_many
from jeat_graph.tracking.saving import SavedTracks
from jeat_graph.tracking.scans import ScanLike


class DetectorResults(SavedTracks):
    """A tracker's ways in; see `Tracker`."""

    if TYPE_CHECKING:
        _t: float | None
        _next_id: int
        logs_takers: bool

        def step(self, scans: ScanLike | Sequence[ScanLike]) -> Trajectories:
            """Take in scans of one time."""

        def takers(self, count: int) -> IntArray:
            """Which track took each detection of the last step."""

        def learnt(self) -> dict[str, LearntConfig]:
            """What has been learnt of the sensors."""

    def update(
        self,
        source: Any,
        *,
        t: float,
        sensor: str,
        scores: npt.ArrayLike | None = None,
        classes: npt.ArrayLike | None = None,
        embeddings: npt.ArrayLike | None = None,
        format: str | None = None,  # what users of other libraries call it
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
            format: what boxes of an array are: `ltwh` (left, top, width, height; so they are taken without
                it), `xyxy` (left, top, right, bottom), or `xywh` (centre, width, height).

        Returns and raises as `step`; also a DataError where it cannot be told what `source` is.
        """
        found = boxes_of(source, scores, classes, format)
        looks = None if embeddings is None else unit_embeddings(embeddings, len(found.kept))[found.kept]
        own = is_supervision(source)
        self.logs_takers = self.logs_takers or own
        scan = Scan(t, sensor, found.boxes, found.scores, found.classes, looks)
        self._class_ids = {**self._class_ids, **found.class_ids}
        table = self.step(scan)
        if not own:
            return table
        taker = np.zeros(len(found.kept), dtype=np.int64)
        taker[found.kept] = self.takers(len(scan))
        return replace(table, own=OwnDetections(source, taker))

    def meet(self, scans: Sequence[Scan]) -> None:
        """Declare the sensors of some scans that are not declared, if the configuration lets it.

        Tracks, identities and all that was learnt stay, unless the tracker has been told too much since it
        began (`first_sight`): then all tracks end, which a warning says, and identities go on.

        Raises:
            UnknownSensorError: a name that no sensor can have, or too many sensors.
        """
        config = wider(self.config, (scan.sensor for scan in scans))
        if config is None:
            return
        if config.smoother.engine != "none":
            notice_many(sum(one.correlated_share > 0.0 for one in config.sensors.values()))
        told, watch, numbers, logs = self._told, self._watch, self._class_ids, self.logs_takers
        if told.is_known:
            if config.smoother.worker and self._smoothers is not None:
                self._smoothers.finish()
            fresh = type(self)(config, diagnostics=self._diagnostics)
            fresh._watch.end()
            told.tell(fresh)
        else:
            fresh = self._anew(config)
            fresh._told.forget()
            names = sorted(set(config.sensors) - set(self.config.sensors))
            warnings.warn(
                f"sensor {names[0]!r} is met late, for the first time at t = {scans[0].t:.6g} s: all tracks "
                "end and begin anew; declare it beforehand (sensors.NAME of the configuration)",
                InputWarning,
                stacklevel=4,
            )
        fresh._watch, fresh._class_ids, fresh.logs_takers = watch, numbers, logs
        watch.know(config)
        vars(self).update(vars(fresh))

    def number_on_from(self, identity: int) -> None:
        """Give no track that begins from now on an identity below this."""
        self._next_id = max(self._next_id, identity)

    def _anew(self, config: Config) -> DetectorResults:
        """Return a tracker without tracks, of what was learnt here, whose identities and time go on."""
        learnt = self.learnt()
        sensors = {
            name: replace(one, learnt=learnt.get(name, one.learnt)) for name, one in config.sensors.items()
        }
        fresh = type(self)(replace(config, sensors=sensors), diagnostics=self._diagnostics)
        fresh._next_id, fresh._t = self._next_id, self._t
        if self._smoothers is not None:
            fresh._past = [*self._past, self._smoothers.finish()]
        return fresh
