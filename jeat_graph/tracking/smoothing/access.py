"""What a tracker says of its smoothed tracks: the part of it that has to do with the smoothers alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from jeat_graph.config.schema import Config
from jeat_graph.data.errors import JeatGraphError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.first_sight import ToldSoFar

if TYPE_CHECKING:
    from jeat_graph.tracking.smoothing.behind import Smoothing


class SmoothedTracks:
    """The smoothers behind a tracker, here or in a process of their own, or none.

    Args:
        config: settings of the smoother, the sizes and the output.

    Attributes:
        sensor_names: names of the sensors, in alphabetical order.
    """

    def __init__(self, config: Config) -> None:
        self.config = config
        self.sensor_names = config.sensor_names
        self._finished = False
        self._smoothers: Smoothing | None = None
        if config.smoother.engine != "none":
            self._smoothers = _smoothing(config)
        self._told = ToldSoFar()
        if config.input.undeclared != "declare":
            self._told.forget()  # no sensor is ever met
        self._class_ids: dict[str, int] = {}  # number of each class named so far
        self._past: list[Trajectories] = []  # rows of earlier bases of time that were not fetched

    def smoothed(self) -> Trajectories:
        """Return the smoothed trajectories of the confirmed tracks so far, without what was drained.

        Their whole life: the time before confirmation and gaps included, but for those longer than
        `smoother.max_gap_s` where that is set, up to the last detection. With a fixed lag the rows older than
        that are final; all others may still change. (The call makes the smoothers take in what they had set
        aside: with a fixed lag some states become final a part of a chunk earlier than in a run without it,
        and differ from there by what that part would have told.)

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        self._told.note("smoothed")
        return self._numbered(self._wanted_smoothers().smoothed())

    def drain_smoothed(self) -> Trajectories:
        """Return the smoothed rows that are final and forget them, in order of time over all calls.

        A live caller that keeps a smoother calls this now and then: rows that nobody fetches are kept for
        `finish`, some 200 bytes each, the first 100,000 in memory and the rest in a temporary file. The
        engines over whole tracks give a track's rows when it has ended, and all at `finish` if fragments are
        to be stitched.

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        self._told.note("drain_smoothed")
        rows = self._wanted_smoothers().drain()
        if self._past:
            rows, self._past = Trajectories.concatenate([*self._past, rows]), []
        return self._numbered(rows)

    def smooth_anew(self) -> None:
        """End all tracks of the smoothers, which may then be told of earlier times; their rows wait."""
        self._told.forget()
        if self._smoothers is not None:
            self._past.append(self._smoothers.finish())
            self._smoothers = _smoothing(self.config)

    def finish(self) -> Trajectories:
        """End all tracks and return their smoothed trajectories, without what was drained before.

        The tracker takes no more scans. Called again, or without a smoother, it returns an empty table.
        """
        self._finished = True
        if self._smoothers is None:
            return Trajectories.empty(self.sensor_names)
        rows, past = self._smoothers.finish(), self._past
        self._past = []
        return self._numbered(Trajectories.concatenate([*past, rows]) if past else rows)

    def _numbered(self, rows: Trajectories) -> Trajectories:
        """Have rows know the numbers of their classes."""
        return replace(rows, class_ids=self._class_ids) if self._class_ids else rows

    def settle(self) -> None:
        """Let the smoothers take in all that they had set aside, and begin anew from what is known then.

        Their state after it follows from the steps so far alone, so that a tracker which is saved here and
        loaded goes on with the same bytes as one that settles here and is not saved.
        """
        self._told.note("settle")
        if self._smoothers is not None:
            self._smoothers.settle()

    @property
    def smoother_counts(self) -> dict[str, int]:
        """How the smoothers fared: tracks, rebuilds, fallbacks, late measurements, joints; {} without one."""
        return self._smoothers.counts() if self._smoothers is not None else {}

    def _wanted_smoothers(self) -> Smoothing:
        if self._smoothers is None:
            raise JeatGraphError("the configuration asks for no smoother: smoother.engine is none")
        return self._smoothers


def _smoothing(config: Config) -> Smoothing:
    """Smoothing here, or in a process of its own; imported only where it is wanted."""
    if config.smoother.worker:
        from jeat_graph.tracking.smoothing.worker import SmoothingWorker

        return SmoothingWorker(config)
    from jeat_graph.tracking.smoothing.behind import InProcessSmoothing

    return InProcessSmoothing(config)
