"""What a tracker offers to be saved and to go on later (see `checkpoint`)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.tracking.damage import refusing_damage
from jeat_graph.tracking.input_watch import InputWatch
from jeat_graph.tracking.smoothing.access import SmoothedTracks
from jeat_graph.tracking.snapshot import Snapshot
from jeat_graph.tracking.state import TrackArrays
from jeat_graph.tracking.step_record import takers_in
from jeat_graph.tracking.update_log import UpdateLog, allocate_log

#: Longer ago than this is no longer told apart (s).
_LONGEST_AGO_S = 1e9


class SavedTracks(SmoothedTracks):
    """A tracker's state to and from files; see `Tracker`."""

    if TYPE_CHECKING:
        config: Config
        _diagnostics: bool
        _log: UpdateLog
        _watch: InputWatch

        def __init__(self, config: Config, *, diagnostics: bool = False) -> None:
            """Make a tracker."""

        def snapshot(self) -> Snapshot:
            """Copy all that the next step depends on."""

        def restore(self, snapshot: Snapshot) -> None:
            """Go back to a snapshot."""

    def save(self, path: str | Path) -> None:
        """Write the whole state to a file (`.npz`), smoothers included, for `load` to go on from.

        This tracker and the loaded one give the same bytes from here on.

        Raises:
            JeatGraphError: the smoothers are in a process of their own (`smoother.worker`).
        """
        from jeat_graph.tracking.checkpoint import save_state

        save_state(path, self.config, self.state())

    @classmethod
    def load(cls, path: str | Path, config: Config | None = None) -> Self:
        """Return the tracker that was saved to a file.

        Args:
            path: the file.
            config: the configuration that it must have had; None takes the file's.

        Raises:
            DataError: no such file, or one that holds no tracker, or one that takes late scans.
            JeatGraphError: it was saved by another version, or with other settings.
        """
        from jeat_graph.tracking.checkpoint import load_plain_state

        kept, state = load_plain_state(path, config)
        with refusing_damage(path):
            return cls.from_state(kept, state)

    def begin_anew(self, t: float) -> None:
        """End all tracks and let time go on from another moment, an earlier one too (s).

        Identities go on, and so does what was learnt of the scene: it is as if no time had passed.
        """
        now = self.snapshot()
        if now.t is None:
            return
        first, last = (
            _as_long_before(t, looks, now.t) for looks in (now.scene.first_look, now.scene.last_look)
        )
        none = TrackArrays._make(array[:0] for array in now.tracks)
        self.smooth_anew()
        self.restore(
            now._replace(t=None, tracks=none, scene=now.scene._replace(first_look=first, last_look=last))
        )

    def takers(self, count: int) -> IntArray:
        """Return which track took each of the `count` detections (M,) of the last step, 0 where none did."""
        return takers_in(self._log, count)

    def state(self, snapshot: Snapshot | None = None) -> dict[str, Any]:
        """Return what `from_state` takes: the state now, or at a snapshot; the smoothers' is not copied."""
        now = self.snapshot() if snapshot is None else snapshot
        # What the last step gave to the tracks is asked for after it, and so may it be after a restart.
        log = self._log.rows[: int(self._log.count[0])].copy() if self._diagnostics else None
        return {
            "diagnostics": self._diagnostics,
            "finished": self._finished,
            "now": now,
            "log": log,
            "smoothing": self._smoothers,
            "past": self._past,
            "class_ids": self._class_ids,
        }

    @classmethod
    def from_state(cls, config: Config, state: dict[str, Any]) -> Self:
        """Make a tracker of what `state` returned, of the engine that it was saved by."""
        if config.tracker.engine != "compiled":
            from jeat_graph.tracking.model_tracker import ModelTracker

            return cast(Self, ModelTracker.from_state(config, state))
        without = replace(config, smoother=replace(config.smoother, engine="none"))
        tracker = cls(without, diagnostics=state["diagnostics"])
        tracker.config, tracker._smoothers, tracker._past = config, state["smoothing"], state["past"]
        tracker.restore(state["now"])
        tracker._told.forget()
        tracker._finished = state["finished"]
        tracker._class_ids = dict(state["class_ids"])
        if state["log"] is not None:
            tracker._log = allocate_log(len(state["log"]))
            tracker._log.rows[:], tracker._log.count[0] = state["log"], len(state["log"])
        if state["now"].t is not None:
            tracker._watch.end()
        return tracker


def _as_long_before(t: float, looks: FloatArray, now: float) -> FloatArray:
    """Times (S,) that are as long before `t` as they were before `now` (s); infinite ones stay."""
    with np.errstate(over="ignore"):  # a clock may have gone from one end of the numbers to the other
        ago = np.minimum(now - looks, _LONGEST_AGO_S)
    return np.where(np.isfinite(looks), t - ago, looks)
