"""The reference model with the methods that the core's has: what `ModelTracker` is built on."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters import gap_survival, sensor_offsets
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.picture_motion import PictureMotion
from jeat_graph.filters.singer import MOTION, STATES, told_covariance, told_motion
from jeat_graph.smoothers.state_rts import FilterRecord, smooth
from jeat_graph.tracking.reference import step
from jeat_graph.tracking.reference_life import begin_anew
from jeat_graph.tracking.reference_state import ReferenceState, SensorScan, declare_sensor, initial_state

#: Numbers of what is told of a track: two axes of five.
_WIDTH = 2 * MOTION
#: After so long without any scan all tracks are over (s).
_LONGEST_SILENCE_S = 300.0
#: Time, identity, mean (N, 10), variance (N, 10), posterior, sensors that found it at that time, number of
#: the class, and its share of the votes.
ModelRows = tuple[FloatArray, IntArray, FloatArray, FloatArray, FloatArray, IntArray, IntArray, FloatArray]


class Called(NamedTuple):
    """What a track is called in smoothed rows: the identity given out, number and share of its class."""

    given: int
    label: int
    share: float


class Step(NamedTuple):
    """What is kept of a step for the smoothed table.

    Attributes:
        t: time (s).
        records: of its scans.
        track_id: (N,) the tracks then.
        real: (N,) their posterior.
        used: (N,) the sensors that found them.
        confirmed: (N,) whether a detection of that time tells that they are still there.
        missed: (N,) detections that were to be expected since one did, 0 where it is of that time.
    """

    t: float
    records: list[FilterRecord]
    track_id: IntArray
    real: FloatArray
    used: IntArray
    confirmed: BoolArray
    missed: FloatArray

    def track_ids(self) -> IntArray:
        """Return the identities (N,) of the tracks after it, before any ended."""
        return self.track_id


class Answer(NamedTuple):
    """What the last step told; see the methods of `ReferenceModel`."""

    rows: ModelRows
    states: tuple[FloatArray, FloatArray]
    takers: IntArray
    living: IntArray
    fit: tuple[FloatArray, FloatArray, FloatArray]


class Moment(NamedTuple):
    """All that the next step depends on; the smoother is no part of it."""

    state: ReferenceState
    answer: Answer

    def identities(self) -> IntArray:
        """Return the identities (N,) of the living tracks."""
        return self.state.tracks.track_id

    def born(self) -> int:
        """Return the number of tracks started before it."""
        return self.state.next_id - 1


class ReferenceModel:
    """The model in NumPy; slow, and the definition of what the core computes.

    Args:
        constants: of the model.
        width, height: of the picture (px).
        known: whether they are.
        lag_s: negative for no smoother; else tracks are smoothed as a whole, whatever the lag.
    """

    def __init__(
        self, constants: ModelConstants, width: float, height: float, known: bool, lag_s: float
    ) -> None:
        self.constants = constants
        self._state = initial_state((width, height) if known else None, constants)
        self._smooths = lag_s >= 0.0
        self._steps: list[Step] = []
        self._called: dict[int, Called] = {}
        self._last: Step | None = None
        self._answer = _no_answer()

    def declare_sensor(self, even_logit: float = math.nan) -> None:
        """Add a sensor that has not looked yet."""
        declare_sensor(self._state, self.constants, even_logit)

    def take(
        self,
        t: float,
        sensors: IntArray,
        numbers: IntArray,
        boxes: FloatArray,
        logits: FloatArray,
        alike: FloatArray | None = None,
        motion: FloatArray | None = None,
    ) -> None:
        """Take in the scans of one time.

        Args:
            t: time (s).
            sensors: (K,) indices of the sensors that look.
            numbers: (K,) of boxes of each.
            boxes: (M, 4) left, top, right, bottom (px), sensor by sensor.
            logits: (M,) of their scores.
            alike: (N, M) how much more likely each box is of a living track than of another by what both look
                like, as ln of the ratio.
            motion: (11,) of the camera since its picture before, as `PictureMotion` has it.
        """
        ends = np.cumsum(numbers)
        if self._state.t is not None and t - self._state.t >= _LONGEST_SILENCE_S:
            begin_anew(self._state, t, self.constants)
            alike = motion = None
        scans = [
            SensorScan(
                int(k),
                boxes[end - n : end],
                logits[end - n : end],
                None if alike is None else alike[:, end - n : end],
            )
            for k, n, end in zip(sensors, numbers, ends, strict=True)
        ]
        moved = None if motion is None else PictureMotion.of_numbers(motion)
        done = step(self._state, t, scans, self.constants, moved)
        told, tracks = done.tracks.take(done.reported), done.tracks
        scale = [np.full(len(one), value) for one, value in zip(done.nis, done.noise_scale, strict=True)]
        nothing = np.zeros(0)
        self._answer = Answer(
            _rows(t, told.track_id, told.mean, told.covariance, told.real, told.used, self.constants),
            (told.mean.reshape(-1, 2 * STATES), told.covariance.reshape(-1, 2 * STATES**2)),
            np.concatenate([*done.takers, np.zeros(0, np.int64)]),
            tracks.track_id,
            (np.concatenate([nothing, *done.nis]), np.concatenate([nothing, *scale]), tracks.real),
        )
        confirmed = tracks.evidence.confirmed_s == t
        missed = np.where(confirmed, 0.0, tracks.evidence.missed)
        self._last = Step(t, done.records, tracks.track_id, tracks.real, tracks.used, confirmed, missed)

    def record(self) -> Step:
        """Return what the last step gave the smoother."""
        assert self._last is not None, "a step has been taken"
        return self._last

    def hand_over(
        self,
        record: Step | None = None,
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
        told = self.record() if record is None else record
        if not self._smooths:
            return
        self._steps.append(told)
        for k, track in enumerate(told.track_id.tolist()):
            self._called[track] = Called(
                track if given is None else int(given[k]),
                -1 if label is None else int(label[k]),
                0.0 if share is None else float(share[k]),
            )

    def begin_anew(self, t: float) -> None:
        """End all tracks and go on from another time (s), as if none had passed; what was learnt stays."""
        begin_anew(self._state, t, self.constants)
        self._answer = _no_answer()

    def snapshot(self) -> Moment:
        """Return a copy of all that the next step depends on."""
        return Moment(copy.deepcopy(self._state), self._answer)

    def restore(self, moment: Moment) -> None:
        """Go back to a snapshot of this model."""
        self._state, self._answer = copy.deepcopy(moment.state), moment.answer

    def number_on_from(self, identity: int) -> None:
        """Give no new track a smaller identity."""
        self._state.next_id = max(self._state.next_id, identity)

    def rows(self) -> ModelRows:
        """Return the tracks that the last step reports."""
        return self._answer.rows

    def states(self) -> tuple[FloatArray, FloatArray]:
        """Return their states: means (N, 14), and covariances (N, 98): two axes of 7 x 7."""
        return self._answer.states

    def takers(self) -> IntArray:
        """Return the identity of the track (M,) that took each box of the last step."""
        return self._answer.takers

    def living(self) -> IntArray:
        """Return the identities (N,) of the tracks of the last step, before any ended."""
        return self._answer.living

    def fit(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how well the boxes of the last step fitted.

        Returns:
            Squared distance of each centre (M,), NaN where it began a track; the scale of the sensor's noise
            (M,); the posteriors (N,) of the tracks in `living`.
        """
        return self._answer.fit

    def identities(self) -> IntArray:
        """Return the identities (N,) of the living tracks."""
        return self._state.tracks.track_id

    def size(self) -> int:
        """Return the number of living tracks."""
        return len(self._state.tracks)

    def born(self) -> int:
        """Return the number of tracks started so far."""
        return self._state.next_id - 1

    def sensors(self) -> int:
        """Return the number of sensors."""
        return self._state.num_sensors

    def time(self) -> float | None:
        """Return the time of the last step (s); None before the first."""
        return self._state.t

    def picture(self) -> tuple[float, float]:
        """Return width and height of the picture (px), as far as is known."""
        return self._state.picture

    def last_looks(self) -> FloatArray:
        """Return when each sensor (S,) looked last (s), NaN for never."""
        return self._state.last_look_s

    def waiting(self) -> int:
        """Return the number of smoothed rows that have become final: none before the end."""
        return 0

    def boxes_end_at_edge(self) -> bool:
        """Return whether boxes end at the edge of the picture more often than they reach beyond it."""
        state = self._state
        return state.picture_known and bool(state.boxes_at_edge.sum() >= state.boxes_beyond.sum())

    def smoothed(self) -> ModelRows:
        """Return the smoothed rows so far, of each track from its first to its last detection.

        A row's existence is the track's posterior at that time, or where it turned out to be real for sure,
        what it turned out to be. (Less than sure tells nothing of the past: what began as a second box is
        often taken over by an object.) While nobody sees the track, it counts times the probability that a
        gap as long as it is to the nearer one of its ends ends well.
        """
        size, c = self._state.next_id, self.constants
        steps = _with_sensors_of_their_time(self._steps)
        before = _missed_before(steps, size)
        seen_again, final = np.zeros(size, dtype=np.bool_), np.zeros(size)
        whole = np.zeros(size)  # of the gap, where there is one; 0 at its end
        told = {}
        last_records = np.cumsum([len(one.records) for one in self._steps]) - 1
        for number in range(len(steps) - 1, -1, -1):
            moment = steps[number]
            ids, found = moment.track_id, moment.confirmed
            last = found & ~seen_again[ids]
            final[ids[last]] = moment.real[last]
            seen_again[ids[found]] = True
            whole[ids] = np.where(found, 0.0, np.maximum(whole[ids], moment.missed))
            real = np.where(final[ids] > c.sure, np.maximum(moment.real, final[ids]), moment.real)
            nearer = np.minimum(moment.missed, whole[ids] - before[number])
            real = real * gap_survival.survival(self._state.gaps, nearer, c)
            if number + 1 < len(steps) and steps[number + 1].t == moment.t:
                continue  # a later step of the same time tells more
            told[int(last_records[number])] = moment, np.where(seen_again[ids], real, 0.0)
        parts = []
        for record, mean, covariance in smooth([one for taken in self._steps for one in taken.records]):
            if record in told:
                moment, real = told[record]
                rows = real > c.report
                state = mean[rows], covariance[rows], real[rows], moment.used[rows]
                called = [self._called[track] for track in moment.track_id[rows].tolist()]
                parts.append(_rows(moment.t, moment.track_id[rows], *state, c, called))
        return _joined(parts[::-1])

    def drain(self) -> ModelRows:
        """Return no rows: whole tracks are final when the recording ends."""
        return _joined([])

    def finish(self) -> ModelRows:
        """Return the smoothed rows of all tracks."""
        return self.smoothed()

    def tracks(self) -> Mapping[str, Any]:
        """Return the columns of the living tracks by name, as the core does."""
        own = self._state.tracks.columns()
        return {**own, **own.pop("evidence").columns()}

    def learnt(self) -> Mapping[str, Any]:
        """Return what is believed of the sensors and the scene, by name."""
        state = self._state
        return {
            **state.sensors._asdict(),
            "log_side_variance": state.log_side_variance,
            "log_scene_variance": state.log_scene_variance if state.t is not None else 0.0,
            "leftovers": state.leftovers,
            "false_boxes": state.false_boxes,
            "offsets": sensor_offsets.offsets(state.offsets, state.log_side_variance, self.constants),
            "boxes_at_edge": state.boxes_at_edge,
            "boxes_beyond": state.boxes_beyond,
            "process_noise": tuple(state.process_noise),
        }


def _with_sensors_of_their_time(steps: Sequence[Step]) -> list[Step]:
    """Return steps whose tracks have been found by the sensors of earlier steps of the same time as well."""
    out: list[Step] = []
    for one in steps:
        used, confirmed = one.used, one.confirmed
        if out and out[-1].t == one.t:
            before = out[-1]
            lived = np.isin(before.track_id, one.track_id)
            used, confirmed = used.copy(), confirmed.copy()
            rows = np.searchsorted(one.track_id, before.track_id[lived])
            used[rows] |= before.used[lived]
            confirmed[rows] |= before.confirmed[lived]
        missed = np.where(confirmed, 0.0, one.missed)
        out.append(one._replace(used=used, confirmed=confirmed, missed=missed))
    return out


def _missed_before(steps: Sequence[Step], size: int) -> list[FloatArray]:
    """Return what had been missed of the tracks (N,) by the step before each; `size` bounds identities."""
    last, out = np.zeros(size), []
    for one in steps:
        out.append(last[one.track_id])
        last[one.track_id] = one.missed
    return out


def _rows(
    t: float,
    ids: IntArray,
    mean: FloatArray,
    covariance: FloatArray,
    real: FloatArray,
    used: IntArray,
    c: ModelConstants,
    called: Sequence[Called] | None = None,
) -> ModelRows:
    """Return tracks (N,) at one time."""
    variance = np.diagonal(told_covariance(mean, covariance, c), axis1=2, axis2=3)
    flat = told_motion(mean, c).reshape(-1, _WIDTH), variance.reshape(-1, _WIDTH)
    if called is None:
        called = [Called(track, -1, 0.0) for track in ids.tolist()]
    given, label = (np.array([one[k] for one in called], dtype=np.int64) for k in (0, 1))
    share = np.array([one.share for one in called], dtype=np.float64)
    return np.full(len(ids), t), given, *flat, real, used, label, share


def _joined(parts: Sequence[ModelRows]) -> ModelRows:
    """Return tables one behind the other."""
    nothing, whole, state = np.zeros(0), np.zeros(0, np.int64), np.zeros((0, _WIDTH))
    none: ModelRows = (nothing, whole, state, state, nothing, whole, whole, nothing)
    t, ids, mean, variance, real, used, label, share = zip(none, *parts, strict=True)
    return (
        np.concatenate(t),
        np.concatenate(ids),
        np.concatenate(mean),
        np.concatenate(variance),
        np.concatenate(real),
        np.concatenate(used),
        np.concatenate(label),
        np.concatenate(share),
    )


def _no_answer() -> Answer:
    """Return what is told before the first step."""
    nothing, whole = np.zeros(0), np.zeros(0, np.int64)
    states = np.zeros((0, 2 * STATES)), np.zeros((0, 2 * STATES**2))
    return Answer(_joined([]), states, whole, whole, (nothing, nothing, nothing))
