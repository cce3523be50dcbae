"""What an engine is: the contract between the tracker and the models that it is built on.

`CoreModel` (C++), `ReferenceModel` (NumPy, the definition of the same model) and `PaperModel` (the paper's
method) fulfil it, and `engines.make_engine` chooses one. What an engine does not have it says with a
`JeatGraphError` that names it; nothing is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from jeat_graph.config.sensors import SensorConfig
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.data.errors import JeatGraphError
from jeat_graph.smoothers.histories import StepRecord
from jeat_graph.smoothers.rows import ModelRows
from jeat_graph.tracking.hypotheses import Hypotheses
from jeat_graph.tracking.sensor_state import SensorState

#: After so long without any scan all tracks are over: longer predictions outgrow a double's digits (s).
LONGEST_SILENCE_S = 300.0


class StepInput(NamedTuple):
    """What sensors saw at one time, M boxes of K sensors.

    Attributes:
        t: time (s).
        sensors: (K,) indices of the sensors with a scan, ascending.
        numbers: (K,) of boxes of each.
        boxes: (M, 4) left, top, width, height (px), sensor by sensor.
        scores: (M,) of them.
        similarity: (N, M) how much more likely each box is of a living track than of another by their
            appearance, as ln of the ratio; None where nothing is known.
        motion: (11,) of the camera since its picture before, as `PictureMotion` has it; or None.
        owners: (M, 3) where who is who is given: whose each box is, below 0 for nobody's, at most one box
            of a sensor each; 1 where more of its owner's are to come; posterior of an object there by what
            comes later, for the smoother, below 0 where it is not known. A track of an owner takes no box
            but its own, and lives as long as it is awaited. None where the engine decides.
        box_std: (M, 4) standard deviations of left, top, right, bottom by the detector (px), NaN where
            unknown; None where all are.
    """

    t: float
    sensors: IntArray
    numbers: IntArray
    boxes: FloatArray
    scores: FloatArray
    similarity: FloatArray | None = None
    motion: FloatArray | None = None
    owners: FloatArray | None = None
    box_std: FloatArray | None = None


class StepBoxes(NamedTuple):
    """The boxes of the last step, in the order of `TrackEngine.assigned`.

    Attributes:
        t: its time (s).
        sensor: (M,) index of each box's sensor.
        boxes: (M, 4) left, top, width, height (px).
    """

    t: float
    sensor: IntArray
    boxes: FloatArray

    @staticmethod
    def none() -> StepBoxes:
        """Return what there is before the first step."""
        return StepBoxes(0.0, np.zeros(0, dtype=np.int64), np.zeros((0, 4)))


class Moment(Protocol):
    """All that the next step of an engine depends on; the smoother is no part of it."""

    def identities(self) -> IntArray:
        """Return the identities (N,) of the living tracks."""
        ...

    def born(self) -> int:
        """Return the number of tracks started before it."""
        ...


class Recorded(Protocol):
    """What an engine keeps of a step for `hand_over`; only the engine that made it can take it."""

    def track_ids(self) -> IntArray:
        """Return the identities (N,) of the tracks after the step, before any ended."""
        ...


class TrackEngine(Protocol):
    """A model with its tracks: steps in, rows out. Arrays that it returns are not written to later."""

    @property
    def name(self) -> str:
        """Name, as `tracker.engine` has it."""
        ...

    @property
    def can_save(self) -> bool:
        """Whether `state` has something to say."""
        ...

    @property
    def has_fit(self) -> bool:
        """Whether `fit` and `measurements` have."""
        ...

    @property
    def weighs(self) -> bool:
        """Whether `hypotheses` has."""
        ...

    @property
    def compares_appearance(self) -> bool:
        """Whether it takes what boxes look like."""
        ...

    @property
    def takes_owners(self) -> bool:
        """Whether it can be given who is who."""
        ...

    def declare_sensor(self, name: str, declared: SensorConfig) -> None:
        """Add a sensor that has had no scan yet, with what the user says of it."""

    def take(self, inputs: StepInput) -> None:
        """Take in the scans of one time, which is not before that of the last step.

        Raises:
            JeatGraphError: owners are given to an engine that takes none.
        """

    def reset(self, t: float) -> None:
        """End all tracks and go on from another time (s), as if none had passed; what was learnt stays."""

    def number_on_from(self, identity: int) -> None:
        """Give no new track a smaller identity."""

    def snapshot(self) -> Moment:
        """Return a copy of all that the next step depends on."""
        ...

    def restore(self, moment: Moment) -> None:
        """Go back to a snapshot of this engine.

        Raises:
            TypeError: it is of another one.
        """

    def time(self) -> float | None:
        """Return the time of the last step (s); None before the first."""
        ...

    def size(self) -> int:
        """Return the number of living tracks."""
        ...

    def born(self) -> int:
        """Return the number of tracks started so far."""
        ...

    def identities(self) -> IntArray:
        """Return the identities (N,) of the living tracks, ascending."""
        ...

    def living(self) -> IntArray:
        """Return the identities (N,) of the tracks of the last step, before any ended."""
        ...

    def assigned(self) -> IntArray:
        """Return the identity of the track (M,) that took each box of the last step, 0 where none did."""
        ...

    def rows(self) -> ModelRows:
        """Return the tracks that the last step reports."""
        ...

    def reported(self) -> Callable[[], ModelRows]:
        """Return a function that gives these rows, after later steps too."""
        ...

    def predicted(self, t: float) -> tuple[ModelRows, FloatArray]:
        """Return these tracks at a later time (s), and the covariances (N, 2, 5, 5) of what is reported."""
        ...

    def last_scans(self) -> FloatArray:
        """Return the time of each sensor's (S,) last scan (s), NaN before it."""
        ...

    def picture(self) -> tuple[float, float] | None:
        """Return width and height of the picture (px), as far as is known; None where it does not matter."""
        ...

    def boxes_end_at_edge(self) -> bool:
        """Return whether boxes are to end at the edge of the picture where `output.clip` says so."""
        ...

    def sensor_states(self) -> Sequence[SensorState]:
        """Return what has been learnt of each sensor."""
        ...

    def fit(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how well the boxes of the last step fitted.

        Returns:
            Squared distance of each centre (M,), NaN where it began a track; the scale of the sensor's noise
            (M,); the posteriors (N,) of the tracks in `living`.

        Raises:
            JeatGraphError: the engine does not say it.
        """
        ...

    def measurements(self, measured: StepBoxes) -> RecordArray:
        """Return the boxes of the last step as `MEASUREMENT` (M,), as the filter weighed them.

        Raises:
            JeatGraphError: the engine does not say it.
        """
        ...

    def hypotheses(self, t: float, shown: IntArray, sensors: tuple[str, ...]) -> Hypotheses:
        """Return what the living tracks are taken for, and why.

        Args:
            t: time of the last step (s).
            shown: (R,) identities of the tracks that are reported.
            sensors: names of the sensors as the engine counts them.

        Raises:
            JeatGraphError: the engine weighs no hypotheses.
        """
        ...

    def record(self) -> Recorded:
        """Return what the last step gave the smoother; once."""
        ...

    def step_record(self, record: Recorded) -> StepRecord:
        """Return the states of a step that `record` returned, as every engine has them."""
        ...

    def hand_over(
        self,
        record: Recorded | None = None,
        given: IntArray | None = None,
        label: IntArray | None = None,
        share: FloatArray | None = None,
    ) -> None:
        """Tell the smoother of a step (of the last one without a record), in order of time.

        Args:
            record: of `record`.
            given: (N,) identity given out for each of its tracks.
            label: (N,) number of each one's class, below 0 for none.
            share: (N,) share of the votes that speak for it.
        """

    def forget(self, track_id: IntArray, until: FloatArray) -> None:
        """Have no smoothed rows of living tracks up to a time each, so that their states need not be kept.

        Args:
            track_id: (K,) the tracks, ascending.
            until: (K,) the times (s).
        """

    def smoothed(self) -> ModelRows:
        """Return the smoothed rows so far, without what was drained."""
        ...

    def drain(self) -> ModelRows:
        """Return the smoothed rows that have become final, and forget them."""
        ...

    def finish(self) -> ModelRows:
        """End all tracks and return the smoothed rows that are not drained."""
        ...

    def smoother_counts(self) -> dict[str, int]:
        """Return what the smoother counts, by name."""
        ...

    def settle(self) -> None:
        """Forget what the smoother can make again: what follows is as of one that was saved and loaded."""

    def state(self, moment: Moment | None = None) -> Mapping[str, Any]:
        """Return all as arrays by name, the smoother's too; that at a moment, if one is given.

        Raises:
            JeatGraphError: the engine is not saved.
        """
        ...

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state` returned.

        Raises:
            ValueError: it is not what the engine can be in; nothing is changed then.
            JeatGraphError: the engine is not saved.
        """


def lacking(engine: str, what: str) -> JeatGraphError:
    """Return the error that says what an engine does not have."""
    return JeatGraphError(f"engine {engine} {what}")
