"""Smoothing behind a tracker: what the tracker talks to, be the work done here or in another process."""

from __future__ import annotations

from typing import Protocol

from jeat_graph.config.schema import Config
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.smoothing.history import TrackHistory
from jeat_graph.tracking.smoothing.online import TrackSmoothers
from jeat_graph.tracking.smoothing.recorder import StepRecorder
from jeat_graph.tracking.step_record import StepRecord

#: What is counted of the smoothers (attributes of `TrackSmoothers`).
COUNTS = ("tracks", "rebuilds", "fallbacks", "too_late", "stitched")


class Smoothing(Protocol):
    """Takes down the steps of one tracker and gives smoothed trajectories."""

    def record(self, step: StepRecord) -> None:
        """Take down one step."""

    def drain(self) -> Trajectories:
        """Return, and forget, final rows, in order of time over all calls."""

    def smoothed(self) -> Trajectories:
        """Return all rows not drained yet, those too that may still change."""

    def finish(self) -> Trajectories:
        """End all tracks and return all rows not drained yet."""

    def counts(self) -> dict[str, int]:
        """How the smoothers fared; after `finish`, all of it."""

    def confirmed_histories(self) -> list[TrackHistory]:
        """Return what the confirmed tracks took in so far."""


#: A step in process does one part in so many packets of steps of all that waits.
_LEVELLING = 2


class SmoothingHere:
    """Smoothing in the tracker's own process, a few tracks after each step.

    Done at once for all tracks, the work of a packet would make one step in fifty a hundred times as long as
    the others. So each step does the same share of what waits, counted in measurements to be solved for, and
    such a share that the waves of tracks that were born together are levelled. Counted, not timed: what is
    done when depends on the steps alone.
    """

    def __init__(self, config: Config) -> None:
        self._recorder = StepRecorder(config)
        self._smoothers = TrackSmoothers(config)
        self._steps = _LEVELLING * max(config.smoother.chunk, 1)
        self._per_step = 0

    def record(self, step: StepRecord) -> None:
        """Take down one step and do a part of the work."""
        if self._recorder.record(step):
            self._consume()
        else:
            self._smoothers.work(self._per_step)

    def drain(self) -> Trajectories:
        """Return, and forget, final rows, in order of time over all calls."""
        return self._smoothers.drain()

    def smoothed(self) -> Trajectories:
        """Return all rows not drained yet, those too that may still change."""
        self._consume()
        return self._smoothers.smoothed()

    def finish(self) -> Trajectories:
        """End all tracks and return all rows not drained yet."""
        self._consume()
        return self._smoothers.finish()

    def counts(self) -> dict[str, int]:
        """How the smoothers fared."""
        return {name: getattr(self._smoothers, name) for name in COUNTS}

    def confirmed_histories(self) -> list[TrackHistory]:
        """Return what the confirmed tracks took in so far; only engines that stitch keep it."""
        self._consume()
        return self._smoothers.confirmed_histories()

    def _consume(self) -> None:
        self._smoothers.consume(self._recorder.take())
        self._per_step = -(-self._smoothers.backlog // self._steps)
