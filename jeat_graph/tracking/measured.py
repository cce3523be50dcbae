"""Keeps what confirmed tracks took in, so that it can be written down or smoothed in other ways.

Whether a track is ever confirmed is not known when it takes its first detections: what a tentative track took
waits here until that is decided, and is forgotten if the track ends before.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from jeat_graph.data.arrays import IntArray, RecordArray
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.tracking.tracker import Tracker


class ConfirmedMeasurements:
    """Collects the measurements of a tracker's confirmed tracks, step by step.

    Args:
        tracker: made with `diagnostics`.
    """

    def __init__(self, tracker: Tracker) -> None:
        self._tracker = tracker
        self._waiting: list[RecordArray] = []
        self._confirmed: list[IntArray] = []
        self._living: IntArray = np.zeros(0, dtype=np.int64)

    def add_step(self) -> None:
        """Take down what the tracker's last step gave to its tracks."""
        rows, self._living, confirmed = self._tracker.last_measurements()
        if len(rows):
            self._waiting.append(rows)
        self._confirmed.append(self._living[confirmed])

    def state(self) -> dict[str, Any]:
        """Return what `set_state` takes: all that is kept here."""
        return {"waiting": self._waiting, "confirmed": self._confirmed, "living": self._living}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        self._waiting, self._confirmed, self._living = (state[k] for k in ("waiting", "confirmed", "living"))

    def release(self) -> RecordArray:
        """Return, and forget, the records (M,) of tracks confirmed by now, those of each in order of time."""
        rows = np.concatenate([np.zeros(0, dtype=MEASUREMENT), *self._waiting])
        confirmed = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *self._confirmed]))
        chosen = np.isin(rows["track_id"], confirmed)
        self._waiting = [rows[~chosen & np.isin(rows["track_id"], self._living)]]
        self._confirmed = [np.intersect1d(confirmed, self._living)]
        return np.asarray(rows[chosen])
