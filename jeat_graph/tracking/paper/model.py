"""The paper's method as an engine: `tracker.engine=paper`, which the preset `paper` asks for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.config.paper import PaperConfig
from jeat_graph.config.schema import Config
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.filters import gap_survival
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.histories import Existence, StepRecord
from jeat_graph.smoothers.rows import REPORTED, Called, ModelRows, RowOutput, rows_of
from jeat_graph.tracking.engine import LONGEST_SILENCE_S, Moment, StepBoxes, StepInput, lacking
from jeat_graph.tracking.hypotheses import Hypotheses
from jeat_graph.tracking.paper.kalman import predict
from jeat_graph.tracking.paper.state import MOST_LOG_SIZE, Found, PaperTracks, together
from jeat_graph.tracking.paper.step import step
from jeat_graph.tracking.record_smoothing import SmoothsRecords, histories_of
from jeat_graph.tracking.sensor_state import SensorState

#: A track that is confirmed is taken for a vehicle.
_EXISTENCE = Existence(ModelConstants(), of_any_time=True)


class PaperMoment(NamedTuple):
    """All that the next step depends on. Its arrays are never written to.

    Attributes:
        t: time of the last step (s), or None before the first.
        next_id: identity of the next track to be born.
        tracks: the living tracks.
        sensors: the names of the sensors in the order in which they were declared.
        last_scan_s: time of each one's last scan (s), NaN before it.
        step_ids: (N,) the tracks of the last step, before any ended.
        assigned: (M,) which of them took each of its boxes.
    """

    t: float | None
    next_id: int
    tracks: PaperTracks
    sensors: tuple[str, ...]
    last_scan_s: FloatArray
    step_ids: IntArray
    assigned: IntArray

    def identities(self) -> IntArray:
        """Return the identities (N,) of the living tracks."""
        return self.tracks.track_id

    def born(self) -> int:
        """Return the number of tracks started before it."""
        return self.next_id - 1


class PaperModel(SmoothsRecords):
    """Algorithm 1 of the paper over any number of sensors, with the settings of the section `paper`.

    Args:
        config: a configuration.
    """

    name = "paper"
    can_save = False
    has_fit = False
    weighs = False
    compares_appearance = False
    takes_owners = False

    def __init__(self, config: Config) -> None:
        super().__init__(histories_of(config, _EXISTENCE, _OUTPUT))
        self._settings: PaperConfig = config.paper
        none = np.zeros(0, dtype=np.int64)
        self._now = PaperMoment(None, 1, PaperTracks.none(0), (), np.zeros(0), none, none)
        self._declared: dict[str, SensorConfig] = {}

    def declare_sensor(self, name: str, declared: SensorConfig) -> None:
        """Add a sensor that has had no scan yet."""
        self._declared[name] = declared
        now = self._now
        self._now = now._replace(
            sensors=(*now.sensors, name),
            tracks=now.tracks.with_sensors(len(now.sensors) + 1),
            last_scan_s=np.append(now.last_scan_s, math.nan),
        )

    def take(self, inputs: StepInput) -> None:
        """Take in the scans of one time.

        Raises:
            JeatGraphError: who is who is given.
        """
        if inputs.owners is not None:
            raise lacking(self.name, "is not given who is who; tracker.engine=core is")
        now, t = self._now, inputs.t
        dt = 0.0 if now.t is None else t - now.t
        done = step(now.tracks, t, dt, self._found(inputs), now.next_id, self._settings)
        last_scan_s = now.last_scan_s.copy()
        last_scan_s[inputs.sensors] = t
        every = done.every
        self._now = PaperMoment(
            t,
            now.next_id + done.births,
            every.take(done.kept),
            now.sensors,
            last_scan_s,
            every.track_id,
            done.assigned,
        )
        real = every.confirmed.astype(np.float64)
        flags = real, every.used, every.used != 0, np.zeros(len(every)), done.kept
        gaps = gap_survival.no_gaps(), gap_survival.no_gaps()
        self._last = StepRecord(t, dt >= LONGEST_SILENCE_S, every.track_id, done.records, *flags, *gaps)

    def reset(self, t: float) -> None:
        """End all tracks and go on from another time (s); what was learnt of them is lost."""
        now = self._now
        if now.t is None:
            return
        if self._histories is not None:
            self._histories.end_all()
        none = np.zeros(0, dtype=np.int64)
        self._now = now._replace(t=t, tracks=now.tracks.take(none), step_ids=none, assigned=none)

    def number_on_from(self, identity: int) -> None:
        """Give no new track a smaller identity."""
        self._now = self._now._replace(next_id=max(self._now.next_id, identity))

    def snapshot(self) -> PaperMoment:
        """Return all that the next step depends on."""
        return self._now

    def restore(self, moment: Moment) -> None:
        """Go back to a snapshot."""
        if not isinstance(moment, PaperMoment):
            raise TypeError("this snapshot is of another engine")
        self._now = moment

    def time(self) -> float | None:
        """Return the time of the last step (s)."""
        return self._now.t

    def size(self) -> int:
        """Return the number of living tracks, the tentative ones included."""
        return len(self._now.tracks)

    def born(self) -> int:
        """Return the number of tracks started so far."""
        return self._now.next_id - 1

    def identities(self) -> IntArray:
        """Return the identities (N,) of the living tracks."""
        return self._now.tracks.track_id

    def living(self) -> IntArray:
        """Return the identities (N,) of the tracks of the last step, before any ended."""
        return self._now.step_ids

    def assigned(self) -> IntArray:
        """Return the identity of the track (M,) that took each box of the last step."""
        return self._now.assigned

    def rows(self) -> ModelRows:
        """Return the confirmed tracks."""
        return _rows(self._reported(), self._now.t)[0]

    def reported(self) -> Callable[[], ModelRows]:
        """Return a function that gives these rows, after later steps too."""
        rows = self.rows()
        return lambda: rows

    def predicted(self, t: float) -> tuple[ModelRows, FloatArray]:
        """Return the confirmed tracks at a later time (s), and the covariances of what is reported."""
        dt = 0.0 if self._now.t is None else t - self._now.t
        return _rows(predict(self._reported(), dt, self._settings), t)

    def last_scans(self) -> FloatArray:
        """Return the time of each sensor's (S,) last scan (s), NaN before it."""
        return self._now.last_scan_s

    def picture(self) -> tuple[float, float] | None:
        """Return nothing: the paper's method has no picture."""
        return None

    def boxes_end_at_edge(self) -> bool:
        """Return that they do: nothing is learnt of that."""
        return True

    def sensor_states(self) -> list[SensorState]:
        """Return the mean factor on each sensor's noise; the paper learns nothing else of them."""
        scale = self._reported().scale
        mean = scale.mean(axis=0) if len(scale) else np.ones(len(self._now.sensors))
        return [SensorState(float(one)) for one in mean]

    def fit(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Refuse: there are no diagnostics."""
        raise lacking(self.name, "has no diagnostics")

    def measurements(self, measured: StepBoxes) -> RecordArray:
        """Refuse: there are no diagnostics."""
        raise lacking(self.name, "has no diagnostics")

    def hypotheses(self, t: float, shown: IntArray, sensors: tuple[str, ...]) -> Hypotheses:
        """Refuse: a track is confirmed or not."""
        raise lacking(self.name, "weighs no hypotheses: a track is confirmed or not")

    def state(self, moment: Moment | None = None) -> Mapping[str, Any]:
        """Refuse: a run with this engine is short enough to begin again."""
        raise lacking(self.name, "is not saved; tracker.engine=core is")

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Refuse: it is not saved."""
        raise lacking(self.name, "is not saved; tracker.engine=core is")

    def _reported(self) -> PaperTracks:
        return self._now.tracks.take(self._now.tracks.confirmed)

    def _found(self, inputs: StepInput) -> Found:
        """Return the detections of a step with their noise R_base g(p), g = 1 / max(p, floor).

        Sensors are numbered as they were met; births are by their names, as in a configuration.
        """
        sensor = np.repeat(inputs.sensors, inputs.numbers)
        known = [self._declared[name] for name in self._now.sensors]
        variance: FloatArray = np.array([one.sigma_px**2 for one in known])
        size_variance: FloatArray = np.array([one.sigma_log_size**2 for one in known])
        by_name = np.argsort(np.argsort(self._now.sensors)) if known else np.zeros(0, dtype=np.int64)
        size = inputs.boxes[:, 2:]
        return Found(
            inputs.boxes[:, :2] + 0.5 * size,
            np.log(size),
            sensor,
            variance[sensor] / np.maximum(inputs.scores, self._settings.score_floor),
            size_variance[sensor],
            by_name[sensor],
        )


def _reported_mean(mean: FloatArray) -> FloatArray:
    """Return states (..., 2, 5) as they are, sides of boxes bounded: e^l must not overflow."""
    out = mean.copy()
    out[..., 3] = np.minimum(out[..., 3], MOST_LOG_SIZE)
    return out


_OUTPUT = RowOutput(_reported_mean, lambda _, covariance: covariance)


def _rows(tracks: PaperTracks, t: float | None) -> tuple[ModelRows, FloatArray]:
    """Return confirmed tracks as rows of existence 1, and covariances (N, 2, 5, 5) of what is reported."""
    n = len(tracks)
    states = together(tracks)
    when = np.full(n, 0.0 if t is None else t)
    called = [Called(track) for track in tracks.track_id.tolist()]
    rows = rows_of(when, called, states, np.ones(n), tracks.used, _OUTPUT)
    return rows, states[1].reshape(n, 2, REPORTED, REPORTED)
