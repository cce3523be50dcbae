"""The reference model as an engine: `tracker.engine=reference`."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters import box_spread, sensor_offsets
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.object_probability import SensorBelief
from jeat_graph.filters.picture_motion import PictureMotion
from jeat_graph.filters.score_calibration import logit
from jeat_graph.filters.singer import STATES
from jeat_graph.smoothers.histories import StepRecord
from jeat_graph.smoothers.rows import Called, ModelRows, joined, rows_of
from jeat_graph.tracking.engine import LONGEST_SILENCE_S, Moment, StepInput, lacking
from jeat_graph.tracking.one_model import Learnt, OneModel, given_of, row_output
from jeat_graph.tracking.reference import step
from jeat_graph.tracking.reference_life import reset
from jeat_graph.tracking.reference_state import ReferenceState, SensorScan, declare_sensor, initial_state


class Answer(NamedTuple):
    """The output of the last step; see the methods of `ReferenceModel`."""

    rows: ModelRows
    states: tuple[FloatArray, FloatArray]
    assigned: IntArray
    living: IntArray
    fit: tuple[FloatArray, FloatArray, FloatArray]


class ReferenceMoment(NamedTuple):
    """All that the next step depends on; the smoother is no part of it."""

    state: ReferenceState
    answer: Answer

    def identities(self) -> IntArray:
        """Return the identities (N,) of the living tracks."""
        return self.state.tracks.track_id

    def born(self) -> int:
        """Return the number of tracks started before it."""
        return self.state.next_id - 1


class ReferenceModel(OneModel):
    """The model in NumPy; slow, and the definition of what the core computes.

    Args:
        constants: of the model.
        config: the picture, if it is given there, and the smoother.
    """

    name = "reference"
    can_save = False

    def __init__(self, constants: ModelConstants, config: Config) -> None:
        super().__init__(constants, config)
        size = float(config.image.width), float(config.image.height)
        self._state = initial_state(size if config.input.picture == "given" else None, constants)
        self._output = row_output(constants)
        self._answer = _no_answer()

    def declare_sensor(self, name: str, declared: SensorConfig) -> None:
        """Add a sensor that has had no scan yet."""
        declare_sensor(self._state, self.constants, *given_of(declared, self.constants))

    def take(self, inputs: StepInput) -> None:
        """Take in the scans of one time."""
        t, similarity, motion, owners = inputs.t, inputs.similarity, inputs.motion, inputs.owners
        sides = np.concatenate([inputs.boxes[:, :2], inputs.boxes[:, :2] + inputs.boxes[:, 2:]], axis=1)
        logits, ends = logit(inputs.scores), np.cumsum(inputs.numbers)
        spread = None
        if inputs.box_std is not None:
            spread = box_spread.squares(inputs.box_std, inputs.boxes[:, 2:], self.constants)
        is_reset = self._state.t is not None and t - self._state.t >= LONGEST_SILENCE_S
        if is_reset:
            reset(self._state, t, self.constants)
            similarity = motion = None
        if self._state.t is None and self._state.reset_s is not None and t < self._state.reset_s:
            # Time goes on from before the moment that it was to go on from.
            reset(self._state, t, self.constants)
        scans = [
            SensorScan(
                int(k),
                sides[end - n : end],
                logits[end - n : end],
                None if similarity is None else similarity[:, end - n : end],
                owners=None if owners is None else owners[end - n : end, 0].astype(np.int64),
                awaited=None if owners is None else owners[end - n : end, 1] > 0,
                spread=None if spread is None else spread[end - n : end],
            )
            for k, n, end in zip(inputs.sensors, inputs.numbers, ends, strict=True)
        ]
        moved = None if motion is None else PictureMotion.of_numbers(motion)
        done = step(self._state, t, scans, self.constants, moved)
        reported, tracks = done.tracks.take(done.reported), done.tracks
        nothing = np.zeros(0)
        called = [Called(track) for track in reported.track_id.tolist()]
        states, when = (reported.mean, reported.covariance), np.full(len(called), t)
        self._answer = Answer(
            rows_of(when, called, states, reported.real, reported.used, self._output),
            (reported.mean.reshape(-1, 2 * STATES), reported.covariance.reshape(-1, 2 * STATES**2)),
            np.concatenate([*done.assigned, np.zeros(0, np.int64)]),
            tracks.track_id,
            (np.concatenate([nothing, *done.nis]), np.concatenate([nothing, *done.noise_scale]), tracks.real),
        )
        kept = np.isin(tracks.track_id, self._state.tracks.track_id)
        confirmed = tracks.evidence.confirmed_s == t
        missed = np.where(confirmed, 0.0, tracks.evidence.missed)
        later = _later(tracks.track_id, self._answer.assigned, owners)
        flags = tracks.real, tracks.used, confirmed, missed, kept
        gaps = done.gaps, self._state.gaps
        self._last = StepRecord(t, is_reset, tracks.track_id, done.records, *flags, *gaps, later)

    def reset(self, t: float) -> None:
        """End all tracks and go on from another time (s), as if none had passed; what was learnt stays."""
        reset(self._state, t, self.constants)
        self._answer = _no_answer()
        if self._histories is not None:
            self._histories.end_all(self._state.gaps)

    def snapshot(self) -> ReferenceMoment:
        """Return a copy of all that the next step depends on."""
        return ReferenceMoment(copy.deepcopy(self._state), self._answer)

    def restore(self, moment: Moment) -> None:
        """Go back to a snapshot of this model."""
        if not isinstance(moment, ReferenceMoment):
            raise TypeError("this snapshot is of another engine")
        self._state, self._answer = copy.deepcopy(moment.state), moment.answer

    def number_on_from(self, identity: int) -> None:
        """Give no new track a smaller identity."""
        self._state.next_id = max(self._state.next_id, identity)

    def rows(self) -> ModelRows:
        """Return the tracks that the last step reports."""
        return self._answer.rows

    def reported(self) -> Callable[[], ModelRows]:
        """Return a function that gives these rows, after later steps too."""
        rows = self.rows()
        return lambda: rows

    def states(self) -> tuple[FloatArray, FloatArray]:
        """Return their states: means (N, 14), and covariances (N, 98): two axes of 7 x 7."""
        return self._answer.states

    def assigned(self) -> IntArray:
        """Return the identity of the track (M,) that took each box of the last step."""
        return self._answer.assigned

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

    def time(self) -> float | None:
        """Return the time of the last step (s); None before the first."""
        return self._state.t

    def picture(self) -> tuple[float, float] | None:
        """Return width and height of the picture (px), as far as is known."""
        return self._state.picture

    def last_scans(self) -> FloatArray:
        """Return the time of each sensor's (S,) last scan (s), NaN before it."""
        return self._state.last_scan_s

    def camera_moved(self) -> FloatArray:
        """Return how far the camera's motion has taken a point at rest (2,) (px)."""
        return self._state.camera_path.moved

    def boxes_end_at_edge(self) -> bool:
        """Return whether boxes end at the edge of the picture more often than they reach beyond it."""
        state = self._state
        return state.picture_known and bool(state.boxes_at_edge.sum() >= state.boxes_beyond.sum())

    def tracks(self) -> Mapping[str, Any]:
        """Return the columns of the living tracks by name, as the core does."""
        own = self._state.tracks.columns()
        return {**own, **own.pop("evidence").columns()}

    def learnt(self) -> Learnt:
        """Return what is believed of the sensors and the scene."""
        state = self._state
        return Learnt(
            SensorBelief(*state.sensors),
            state.log_noise(self.constants),
            state.log_side_variance,
            state.spread_gains(),
            np.sqrt(state.accuracy.lasting),
            state.log_scene_variance(self.constants) if state.t is not None else 0.0,
            state.leftovers,
            state.false_boxes,
            sensor_offsets.offsets(state.offsets, state.log_noise(self.constants), self.constants),
            state.boxes_at_edge,
            state.boxes_beyond,
            state.process_noise,
        )

    def state(self, moment: Moment | None = None) -> Mapping[str, Any]:
        """Refuse: the reference is not saved."""
        raise lacking(self.name, "is not saved; tracker.engine=core is")

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Refuse: the reference is not saved."""
        raise lacking(self.name, "is not saved; tracker.engine=core is")


def _later(track_id: IntArray, assigned: IntArray, owners: FloatArray | None) -> FloatArray:
    """Return what is known by later (N,) of the tracks that took a box; -1 for the others."""
    out = np.full(len(track_id), -1.0)
    if owners is not None:
        np.maximum.at(out, np.searchsorted(track_id, assigned), owners[:, 2])
    return out


def _no_answer() -> Answer:
    """Return the output before the first step."""
    nothing, whole = np.zeros(0), np.zeros(0, np.int64)
    states = np.zeros((0, 2 * STATES)), np.zeros((0, 2 * STATES**2))
    return Answer(joined([]), states, whole, whole, (nothing, nothing, nothing))
