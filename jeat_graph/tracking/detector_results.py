"""A sensor that was not declared, as the compiled tracker takes it in."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from jeat_graph.config.learnt import LearntConfig
from jeat_graph.config.schema import Config
from jeat_graph.data.errors import InputWarning
from jeat_graph.data.scan import Scan
from jeat_graph.tracking.first_sight import wider
from jeat_graph.tracking.notice import notice_many
from jeat_graph.tracking.saving import SavedTracks
from jeat_graph.tracking.updates import Updates


class DetectorResults(Updates, SavedTracks):
    """A tracker's ways in; see `Tracker`."""

    if TYPE_CHECKING:
        _t: float | None
        _next_id: int

        def learnt(self) -> dict[str, LearntConfig]:
            """What has been learnt of the sensors."""

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
