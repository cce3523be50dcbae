"""Sensors that nobody declared, as a tracker of late scans meets them; and what it passes on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from jeat_graph.config.schema import Config
from jeat_graph.data.scan import Scan
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.first_sight import ToldSoFar, wider
from jeat_graph.tracking.prediction import Prediction
from jeat_graph.tracking.tracker import Tracker

if TYPE_CHECKING:
    from jeat_graph.live.lateness import LatenessCounter
    from jeat_graph.live.repetition import Repetition
    from jeat_graph.live.rewinding import Rewinding
    from jeat_graph.live.time_base import TimeBase


class MetSensors:
    """A part of `LiveTracker`; see there."""

    if TYPE_CHECKING:
        tracker: Tracker
        policy: str
        lateness: LatenessCounter
        _told: ToldSoFar
        _rewinding: Rewinding
        _base: TimeBase
        _repetition: Repetition

        def __init__(self, tracker: Tracker, policy: str = "rewind") -> None:
            """Make a tracker of late scans."""

        def know(self, config: Config) -> None:
            """Go by what a configuration says of its sensors."""

        def _hand_over(self) -> None:
            """Tell the smoothers of all that cannot be taken again."""

    def meet(self, scans: Sequence[Scan]) -> None:
        """Declare the sensors that are met for the first time, as `Tracker.meet` does."""
        config = wider(self.tracker.config, (scan.sensor for scan in scans))
        if config is None:
            return
        if self.tracker.meets_as_it_goes:
            self.tracker.meet(scans)
            self.know(self.tracker.config)
            self.lateness = self.lateness.among(self.tracker.config.sensor_names)
            return
        told = self._told
        if told.is_known:
            live = type(self)(Tracker(config, diagnostics=self.tracker.has_diagnostics), self.policy)
            told.tell(live)
        else:
            self._rewinding.settle(math.inf)
            self._hand_over()
            self.tracker.meet(scans)
            self.tracker.number_on_from(self._rewinding.identities.next_given)
            live = type(self)(self.tracker, self.policy)
            live._base, live._repetition = self._base, self._repetition
            live.lateness = self.lateness.among(self.tracker.sensor_names)
        live._told = told
        vars(self).update(vars(live))

    def predict(self, t: float) -> Prediction:
        """Say where the tracks will be at a time not before the newest scan's (see `Tracker.predict`)."""
        return self._rewinding.identities.rename(self.tracker.predict(t))

    def drain_smoothed(self) -> Trajectories:
        """Return the smoothed rows that are final and forget them (see `Tracker.drain_smoothed`)."""
        self._told.note("drain_smoothed")
        return self.tracker.drain_smoothed()
