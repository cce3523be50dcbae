"""The reference model with the methods that the core's has: what `ModelTracker` is built on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters import gap_survival
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.singer import MOTION
from jeat_graph.smoothers.state_rts import FilterRecord, smooth
from jeat_graph.tracking.reference import step
from jeat_graph.tracking.reference_state import SensorScan, declare_sensor, initial_state

#: Numbers of what is told of a track: two axes of five.
_WIDTH = 2 * MOTION
#: Time, identity, mean (N, 10), variance (N, 10), posterior, sensors that found it at that time.
ModelRows = tuple[FloatArray, IntArray, FloatArray, FloatArray, FloatArray, IntArray]


class Moment(NamedTuple):
    """What is kept of a step for the smoothed table.

    Attributes:
        t: time (s).
        record: number of the step's last record.
        track_id: (N,) the tracks then.
        real: (N,) their posterior.
        used: (N,) the sensors that found them.
    """

    t: float
    record: int
    track_id: IntArray
    real: FloatArray
    used: IntArray


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
        self._records: list[FilterRecord] = []
        self._moments: list[Moment] = []
        self._rows, self._takers, self._living = _joined([]), np.zeros(0, np.int64), np.zeros(0, np.int64)

    def declare_sensor(self) -> None:
        """Add a sensor that has not looked yet."""
        declare_sensor(self._state, self.constants)

    def take(
        self, t: float, sensors: IntArray, numbers: IntArray, boxes: FloatArray, logits: FloatArray
    ) -> None:
        """Take in the scans of one time.

        Args:
            t: time (s).
            sensors: (K,) indices of the sensors that look.
            numbers: (K,) of boxes of each.
            boxes: (M, 4) left, top, right, bottom (px), sensor by sensor.
            logits: (M,) of their scores.
        """
        ends = np.cumsum(numbers)
        scans = [
            SensorScan(int(k), boxes[end - n : end], logits[end - n : end])
            for k, n, end in zip(sensors, numbers, ends, strict=True)
        ]
        done = step(self._state, t, scans, self.constants)
        self._takers = np.concatenate([*done.takers, np.zeros(0, np.int64)])
        self._living = done.tracks.track_id
        told = done.tracks.take(done.reported)
        self._rows = _rows(t, told.track_id, told.mean, told.covariance, told.real, told.used)
        if self._smooths:
            self._records += done.records
            kept = done.tracks
            self._moments.append(Moment(t, len(self._records) - 1, kept.track_id, kept.real, kept.used))

    def rows(self) -> ModelRows:
        """Return the tracks that the last step reports."""
        return self._rows

    def takers(self) -> IntArray:
        """Return the identity of the track (M,) that took each box of the last step."""
        return self._takers

    def living(self) -> IntArray:
        """Return the identities (N,) of the tracks of the last step, before any ended."""
        return self._living

    def size(self) -> int:
        """Return the number of living tracks."""
        return len(self._state.tracks)

    def born(self) -> int:
        """Return the number of tracks started so far."""
        return self._state.next_id - 1

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
        before = self._last_seen_by_moment()
        seen_next, final = np.full(size, np.inf), np.zeros(size)
        told = {}
        for number in range(len(self._moments) - 1, -1, -1):
            moment = self._moments[number]
            ids, found = moment.track_id, moment.used != 0
            last = found & np.isinf(seen_next[ids])
            final[ids[last]] = moment.real[last]
            seen_next[ids[found]] = moment.t
            real = np.where(final[ids] > c.sure, np.maximum(moment.real, final[ids]), moment.real)
            nearer = np.minimum(moment.t - before[number], seen_next[ids] - moment.t)
            real = np.where(found, real, real * gap_survival.survival(self._state.gaps, nearer, c))
            told[moment.record] = moment, np.where(np.isinf(seen_next[ids]), 0.0, real)
        parts = []
        for record, mean, covariance in smooth(self._records):
            if record in told:
                moment, real = told[record]
                rows = real > c.report
                state = mean[rows], covariance[rows], real[rows], moment.used[rows]
                parts.append(_rows(moment.t, moment.track_id[rows], *state))
        return _joined(parts[::-1])

    def _last_seen_by_moment(self) -> list[FloatArray]:
        """Return when the tracks (N,) of each moment had been seen last (s)."""
        last, out = np.full(self._state.next_id, -np.inf), []
        for moment in self._moments:
            found = moment.track_id[moment.used != 0]
            last[found] = moment.t
            out.append(last[moment.track_id])
        return out

    def drain(self) -> ModelRows:
        """Return no rows: whole tracks are final when the recording ends."""
        return _joined([])

    def finish(self) -> ModelRows:
        """Return the smoothed rows of all tracks."""
        return self.smoothed()

    def learnt(self) -> Mapping[str, Any]:
        """Return what is believed of the sensors and the scene, by name."""
        state = self._state
        return {
            **state.sensors._asdict(),
            "log_side_variance": state.log_side_variance,
            "leftovers": state.leftovers,
            "boxes_at_edge": state.boxes_at_edge,
            "boxes_beyond": state.boxes_beyond,
            "process_noise": tuple(state.process_noise),
        }


def _rows(
    t: float, ids: IntArray, mean: FloatArray, covariance: FloatArray, real: FloatArray, used: IntArray
) -> ModelRows:
    """Return tracks (N,) at one time."""
    variance = np.diagonal(covariance, axis1=2, axis2=3)
    flat = mean[..., :MOTION].reshape(-1, _WIDTH), variance[..., :MOTION].reshape(-1, _WIDTH)
    return np.full(len(ids), t), ids, *flat, real, used


def _joined(parts: Sequence[ModelRows]) -> ModelRows:
    """Return tables one behind the other."""
    nothing, state = np.zeros(0), np.zeros((0, _WIDTH))
    none: ModelRows = (nothing, np.zeros(0, np.int64), state, state, nothing, np.zeros(0, np.int64))
    t, ids, mean, variance, real, used = zip(none, *parts, strict=True)
    return (
        np.concatenate(t),
        np.concatenate(ids),
        np.concatenate(mean),
        np.concatenate(variance),
        np.concatenate(real),
        np.concatenate(used),
    )
