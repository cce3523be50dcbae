"""Which smoother a configuration asks for, and how an engine smooths by the records that it keeps."""

from __future__ import annotations

import math
from dataclasses import replace

from jeat_graph.config.schema import Config
from jeat_graph.config.smoothing import LAGGED
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import JeatGraphError
from jeat_graph.smoothers.histories import Existence, Histories, RtsSolver, Solver, StepRecord
from jeat_graph.smoothers.rows import Called, ModelRows, RowOutput
from jeat_graph.tracking.engine import Recorded


def lag_of(config: Config) -> float:
    """Return the lag of the smoother (s): infinite for whole tracks, negative for none."""
    engine = config.smoother.engine
    if engine == "none":
        return -1.0
    return config.smoother.lag_s if engine in LAGGED else math.inf


def unsmoothed(config: Config) -> Config:
    """Return a configuration without a smoother."""
    return replace(config, smoother=replace(config.smoother, engine="none"))


def histories_of(config: Config, existence: Existence, output: RowOutput) -> Histories | None:
    """Return what smooths as a configuration asks for; None where it wants no smoother."""
    lag_s = lag_of(config)
    return None if lag_s < 0.0 else Histories(lag_s, existence, output, _solver_of(config))


def by_gtsam(config: Config) -> bool:
    """Return whether a configuration has GTSAM smooth."""
    return config.smoother.engine.startswith("gtsam")


def _solver_of(config: Config) -> Solver:
    if not by_gtsam(config):
        return RtsSolver()
    from jeat_graph.smoothers.gtsam.solvers import GtsamFull, GtsamLag

    return GtsamLag() if config.smoother.engine in LAGGED else GtsamFull()


class SmoothsRecords:
    """The part of an engine that smooths: in NumPy, over its `StepRecord`s.

    Args:
        histories: what smooths; None for no smoother.
    """

    def __init__(self, histories: Histories | None) -> None:
        self._histories = histories
        self._last: StepRecord | None = None  # of an engine in NumPy, whose step makes it

    def record(self) -> Recorded:
        """Return what the last step gave the smoother."""
        assert self._last is not None, "a step has been taken"
        return self._last

    def step_record(self, record: Recorded) -> StepRecord:
        """Return the states of a step."""
        if not isinstance(record, StepRecord):
            raise TypeError("this record is of another engine")
        return record

    def hand_over(
        self,
        record: Recorded | None = None,
        given: IntArray | None = None,
        label: IntArray | None = None,
        share: FloatArray | None = None,
    ) -> None:
        """Tell the smoother of a step; see `TrackEngine.hand_over`."""
        if self._histories is None:
            return
        step = self.step_record(self.record() if record is None else record)
        ids = step.track_id.tolist()
        names = ids if given is None else given.tolist()
        labels = [-1] * len(ids) if label is None else label.tolist()
        shares = [0.0] * len(ids) if share is None else share.tolist()
        self._histories.take(step, [Called(*one) for one in zip(names, labels, shares, strict=True)])

    def forget(self, track_id: IntArray, until: FloatArray) -> None:
        """Have no smoothed rows of tracks up to a time each; see `TrackEngine.forget`."""
        self._wanted().forget(dict(zip(track_id.tolist(), until.tolist(), strict=True)))

    def smoothed(self) -> ModelRows:
        """Return the smoothed rows so far, without what was drained."""
        return self._wanted().preview()

    def drain(self) -> ModelRows:
        """Return the smoothed rows that have become final, and forget them."""
        return self._wanted().drain()

    def finish(self) -> ModelRows:
        """End all tracks and return the smoothed rows that are not drained."""
        return self._wanted().finish()

    def smoother_counts(self) -> dict[str, int]:
        """Return what the smoother counts, by name."""
        return {} if self._histories is None else self._histories.counts()

    def settle(self) -> None:
        """Forget what the smoother can make again of the records that it keeps."""
        if self._histories is not None:
            self._histories.settle()

    def _wanted(self) -> Histories:
        if self._histories is None:
            raise JeatGraphError("the configuration asks for no smoother: smoother.engine is none")
        return self._histories
