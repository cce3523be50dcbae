"""What a tracker of the model smooths: the rows so far, those that are final, and all of them at the end."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from typing import TYPE_CHECKING, cast

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.corrected_tracks import CorrectedTracks, Disagreements
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import JeatGraphError
from jeat_graph.data.identity_links import IdentityLinks
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.smoothers.rows import ModelRows
from jeat_graph.tracking.engine import TrackEngine
from jeat_graph.tracking.identities.corrected import along_corrected
from jeat_graph.tracking.identities.lagging import LagSmoother
from jeat_graph.tracking.identities.log import IdentityLog
from jeat_graph.tracking.identities.passes import Pass
from jeat_graph.tracking.identities.whole import decided
from jeat_graph.tracking.pending_step import PendingStep
from jeat_graph.tracking.smoothed_instants import SmoothedInstants

if TYPE_CHECKING:
    from jeat_graph.tracking.model_tracker import ModelTracker


class SmoothedTables:
    """A tracker's smoothed tables; see `ModelTracker`."""

    _corrected: CorrectedTracks | None = None
    _disagreements: Disagreements | None = None

    if TYPE_CHECKING:
        sensor_names: tuple[str, ...]
        _model: TrackEngine
        _smooths: bool
        _finished: bool
        _log: IdentityLog | None
        _lag: LagSmoother | None
        _links: IdentityLinks | None
        _instants: SmoothedInstants

        def _smoothed_table(self, rows: ModelRows) -> Trajectories:
            """Return rows of the smoother as a table."""
            ...

    @property
    def keeps_recording(self) -> bool:
        """Whether it keeps all detections, to decide at the end who was who."""
        return self._log is not None

    def smoothed(self) -> Trajectories:
        """Return the smoothed trajectories so far, without what was drained.

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        self._check_smooths()
        if self._log is not None:
            return Trajectories.concatenate(list(self._decided(self._log)))
        if self._lag is not None:  # as if it ended now
            return deepcopy(self._tracker()).finish()
        return self._smoothed_table(self._model.smoothed())

    def drain_smoothed(self) -> Trajectories:
        """Return the smoothed rows that are final and forget them.

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        self._check_smooths()
        if self._log is not None:  # nothing is final before the end
            return Trajectories.empty(self.sensor_names)
        rows = self._smoothed_table(self._model.drain())
        return rows if self._lag is None else self._lag.drain(rows)

    def hand_over(self, taken: PendingStep | None) -> None:
        """Give the smoothers what a step took in; in order of time, and once."""
        if taken is not None:
            self._instants.note(taken.t)
            self._model.hand_over(taken.record, taken.given, taken.label, taken.share)
            self._decide_later(taken.batch, taken.ids, taken.given)

    def settle(self) -> None:
        """Have the smoother be as one that was saved and loaded."""
        self._model.settle()
        if self._lag is not None:
            self._lag.settle()

    def finish(self) -> Trajectories:
        """End all tracks and return their smoothed trajectories; empty when called again."""
        return Trajectories.concatenate([Trajectories.empty(self.sensor_names), *self.finish_in_pieces()])

    def finish_in_pieces(self) -> Iterator[Trajectories]:
        """Return what `finish` does, piece by piece, so that the rows need not all be in memory."""
        done, self._finished = self._finished, True
        if done:
            return iter(())
        if self._log is not None:
            return self._decided(self._log)
        if self._lag is not None:
            rows = self._smoothed_table(self._model.finish())
            return iter((self._lag.finish(self._tracker(), rows),))
        return iter((self._smoothed_table(self._model.finish()),) if self._smooths else ())

    def identity_links(self) -> IdentityLinks | None:
        """Return what the smoother joined, after `finish`; None where identities are causal."""
        return self._links if self._lag is None else self._lag.links()

    def forget_links(self) -> None:
        """Have the tracker keep no links: of a stream that goes on for months there are ever more."""
        if self._lag is not None:
            self._lag.logs_links = False

    def follow(self, rows: CorrectedTracks) -> None:
        """Have the smoothed tables follow identities that a person has corrected.

        Raises:
            JeatGraphError: the tracker keeps no recording (`smoother.identities` is not `whole`).
        """
        if not self.keeps_recording:
            raise JeatGraphError("corrected identities need smoother.identities=whole and a smoother")
        self._corrected = rows

    def disagreements(self) -> Disagreements | None:
        """Return where the model disagrees with what it follows, after `finish`; None if that is nothing."""
        return self._disagreements

    def _decided(self, log: IdentityLog) -> Iterator[Trajectories]:
        if self._corrected is not None:
            self._disagreements, pieces = along_corrected(self._tracker(), log, self._corrected)
        else:
            self._links, pieces = decided(self._tracker(), log)
        return pieces

    def _decide_later(
        self, batch: tuple[list[Scan], Pass, FloatArray] | None, ids: IntArray, given: IntArray | None
    ) -> None:
        """Have identities of a step that the smoother got be decided with a lag, if they are.

        Args:
            batch: its scans, which tracks took their detections, and how far the camera had moved (2,) (px).
            ids: (N,) the tracks after it.
            given: (N,) identities that the tables have in their place, or None.
        """
        if self._lag is None or batch is None:
            return
        scans, taken, camera = batch
        if given is not None:
            taken = taken._replace(assigned=given[np.searchsorted(ids, taken.assigned)])
        self._lag.note(scans, taken, camera, ids if given is None else given, self._tracker())

    def _check_smooths(self) -> None:
        if not self._smooths and self._log is None:
            raise JeatGraphError("the configuration asks for no smoother: smoother.engine is none")

    def _tracker(self) -> ModelTracker:
        return cast("ModelTracker", self)
