"""Smoothing as the tracker sees it: one interface, whether the work is done in its process or in another."""

from __future__ import annotations

from typing import Protocol

from jeat_graph.config.schema import Config
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.smoothing.online import TrackSmoothers
from jeat_graph.tracking.smoothing.recorder import StepRecorder
from jeat_graph.tracking.smoothing.shares import packet_cost
from jeat_graph.tracking.step_record import StepRecord

#: What is counted of the smoothers (attributes of `TrackSmoothers`).
COUNTS = ("tracks", "rebuilds", "fallbacks", "too_late", "exchanged", "stitched")


class Smoothing(Protocol):
    """Takes the steps of one tracker and gives smoothed trajectories."""

    def record(self, step: StepRecord) -> None:
        """Record one step."""

    def drain(self) -> Trajectories:
        """Return, and forget, final rows, in order of time over all calls."""

    def smoothed(self) -> Trajectories:
        """Return all rows not drained yet, those too that may still change."""

    def finish(self) -> Trajectories:
        """End all tracks and return all rows not drained yet."""

    def settle(self) -> None:
        """Work off all that waits, and have GTSAM's windows built anew from our arrays."""

    def counts(self) -> dict[str, int]:
        """How the smoothers fared; after `finish`, all of it."""


#: What waits is worked off within so many packets of steps, should it ever be more than comes in.
_LEVELLING = 2


class InProcessSmoothing:
    """Smoothing in the tracker's own process, a few tracks after each step.

    Done at once for all tracks, the work of a packet would make one step in fifty a hundred times as long as
    the others, and tracks that were born together are due together. So each step does as much as comes in
    with a step on average, counted in measurements to be solved for; a track that takes more than what is
    left of a step's share takes it from the next ones. Counted, not timed: what is done when depends on the
    steps alone.
    """

    def __init__(self, config: Config) -> None:
        self._recorder = StepRecorder(config)
        self._smoothers = TrackSmoothers(config)
        self._steps = max(config.smoother.chunk, 1)
        self._incoming = self._share = self._left = 0.0

    def record(self, step: StepRecord) -> None:
        """Record one step and do a part of the work."""
        if self._recorder.record(step):
            self._consume()
        else:
            self._left += self._share
            self._left -= self._smoothers.work(self._left)
            # What a step did not need is not kept for a later one.
            self._left = min(self._left, 0.0)

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

    def settle(self) -> None:
        """Work off all that waits, and have GTSAM's windows built anew from our arrays."""
        self._consume()
        self._smoothers.settle()

    def counts(self) -> dict[str, int]:
        """How the smoothers fared."""
        return {name: getattr(self._smoothers, name) for name in COUNTS}

    def _consume(self) -> None:
        packet = self._recorder.drain()
        self._smoothers.consume(packet)
        if packet is not None:
            steps = len(packet.t)
            cost = packet_cost(packet, self._steps) / steps
            self._incoming += min(steps / self._steps, 1.0) * (cost - self._incoming)
        self._share = max(self._incoming, self._smoothers.backlog / (_LEVELLING * self._steps))
