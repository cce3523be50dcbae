"""The paper's method as a tracker: `Tracker(engine="paper")`, which the preset `paper` asks for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from jeat_graph.config.paper import PaperConfig
from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError, JeatGraphError, TimeOrderError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.rig.common_picture import CommonPicture
from jeat_graph.tracking.classes import ClassTally, Votes, check_names, number_classes
from jeat_graph.tracking.paper.kalman import predict
from jeat_graph.tracking.paper.smoothing import PaperSmoothers, StepTaken
from jeat_graph.tracking.paper.state import Found, PaperTracks
from jeat_graph.tracking.paper.step import step
from jeat_graph.tracking.paper.table import predicted, table_of
from jeat_graph.tracking.prediction import Prediction, time_from
from jeat_graph.tracking.scans import ScanLike, as_scans, sensor_index
from jeat_graph.tracking.sensor_state import SensorState
from jeat_graph.tracking.updates import Updates

# Most sensors: the columns of `Trajectories.used` are the bits of a signed number.
_MOST_SENSORS = 63


class PaperSnapshot(NamedTuple):
    """All that the next step depends on. Its arrays are never written to.

    Attributes:
        t: time of the last step (s), or None before the first.
        next_id: identity of the next track to be born.
        tracks: the living tracks.
        classes: votes on their classes, or None before the first.
        sensor_names: the sensors that are known.
    """

    t: float | None
    next_id: int
    tracks: PaperTracks
    classes: ClassTally | None
    sensor_names: tuple[str, ...]


class PaperTracker(Updates):
    """Algorithm 1 of the paper over any number of sensors, with the settings of the section `paper`.

    Args:
        config: a configuration, the name of a preset, or of a YAML file.
        image: width and height of the picture (px), also as "1920x1080".
        diagnostics: must be False.

    Raises:
        JeatGraphError: diagnostics are asked for.
    """

    #: Whether a run that was broken off can go on.
    can_save = False
    #: There are no diagnostics.
    has_diagnostics = False

    def __init__(
        self,
        config: Config | str | Path = "paper",
        *,
        image: tuple[float, float] | str | None = None,
        diagnostics: bool = False,
    ) -> None:
        if diagnostics:
            self._refuse("diagnostics")
        self.config = as_config(config, image)
        self.sensor_names = self.config.sensor_names
        self._settings: PaperConfig = self.config.paper
        self._common = CommonPicture.of(self.config)
        self._tracks = PaperTracks.none(len(self.sensor_names))
        self._t: float | None = None
        self._next_id = 1
        self._classes: ClassTally | None = None
        self._class_ids: dict[str, int] = {}
        self.logs_takers = True
        self._taker: IntArray = np.zeros(0, dtype=np.int64)
        self._looked: dict[str, float] = {}
        self._smoothers: PaperSmoothers | None = None
        if self.config.smoother.engine != "none":
            self._smoothers = PaperSmoothers(self.config)
        self._finished = False

    @property
    def num_tracks(self) -> int:
        """Number of living tracks, the tentative ones included."""
        return len(self._tracks)

    @property
    def num_born(self) -> int:
        """Number of tracks started so far."""
        return self._next_id - 1

    @property
    def time(self) -> float | None:
        """Time of the last step (s), or None before the first."""
        return self._t

    @property
    def smoother_counts(self) -> dict[str, int]:
        """How the smoothers fared: tracks smoothed, and fallbacks from GTSAM; {} without one."""
        return self._smoothers.counts() if self._smoothers is not None else {}

    def step(self, scans: ScanLike | Sequence[ScanLike]) -> Trajectories:
        """Take in one scan, or several of one and the same time; see `Tracker.step`.

        Raises:
            DataError: boxes or scores that are not valid, embeddings, or too many sensors.
            UnknownSensorError: a sensor that is not declared, if the configuration has such refused.
            TimeOrderError: a time before that of the last step. In all three cases the state is as before.
            JeatGraphError: after `finish`.
        """
        self.hand_over(self.take_in([self._common.boxes(scan) for scan in as_scans(scans)]))
        return self.causal()

    def take_in(self, batch: Sequence[Scan]) -> StepTaken | None:
        """Do a step for a caller who may have to take it back; see `Tracker.take_in`.

        Args and errors as `step`.

        Returns:
            What `hand_over` takes; None without a smoother.
        """
        if self._finished:
            raise JeatGraphError("this tracker has been finished; make another one for another recording")
        t = float(batch[0].t)
        if self._t is not None and t < self._t:
            raise TimeOrderError(f"scan at t = {t} s is older than the last one at {self._t} s")
        if any(scan.embeddings is not None for scan in batch):
            raise DataError("this engine compares no embeddings; leave them or the engine away")
        names = self._with_met(batch)
        check_names(self._classes, batch)
        if names != self.sensor_names:
            self.sensor_names = names
            self._tracks = self._tracks.with_sensors(len(names))
        found = self._found(batch)
        dt = 0.0 if self._t is None else t - self._t
        taken = step(self._tracks, t, dt, found, self._next_id, self._settings)
        self._tracks, self._taker, self._t = taken.tracks, taken.taker, t
        self._next_id += taken.births
        self._looked |= dict.fromkeys((scan.sensor for scan in batch), t)
        votes = Votes.of_batch(batch, np.arange(len(found), dtype=np.int64))
        if votes is not None or self._classes is not None:
            self._class_ids = number_classes(self._class_ids, batch)
            tally = self._classes or ClassTally.start()
            self._classes = tally.after(taken.tracks.track_id, taken.taker, votes)
        if self._smoothers is None:
            return None
        ids, called = taken.tracks.track_id, self._classes
        classes, shares = (None, None) if called is None else called.columns(ids)
        told = taken.tracks, taken.z, taken.information
        return StepTaken(t, taken.births, ids, *told, self.sensor_names, classes, shares)

    def hand_over(self, taken: StepTaken | None) -> None:
        """Give the smoothers what a step took in; in order of time, and once."""
        if self._smoothers is not None and taken is not None:
            self._smoothers.record(taken)

    def meet(self, scans: Sequence[Scan]) -> None:
        """Refuse sensors that are not declared and may not be; others are known from their first scan.

        Raises:
            UnknownSensorError: a name that is not declared and may not be.
            DataError: too many sensors.
        """
        self._with_met(scans)

    def begin_anew(self, t: float) -> None:
        """End all tracks and let time go on from another moment, an earlier one too (s); identities go on."""
        if self._t is not None:
            if self._smoothers is not None:
                self._smoothers.begin_anew()
            nothing = np.zeros(0, dtype=np.int64)
            self._tracks, self._taker, self._t = self._tracks.take(nothing), nothing, t

    def number_on_from(self, identity: int) -> None:
        """Give no track that begins from now on an identity below this."""
        self._next_id = max(self._next_id, identity)

    def living(self) -> tuple[IntArray, int]:
        """Return the identities (N,) of the living tracks, and that of the next one to be born."""
        return self._tracks.track_id, self._next_id

    def last_looks(self) -> dict[str, float]:
        """Return when each declared sensor looked last (s), minus infinity for never."""
        return dict.fromkeys(self.sensor_names, -math.inf) | self._looked

    def takers(self, count: int) -> IntArray:
        """Return the identity of the track that took each of the `count` detections (M,) of the last step."""
        return self._taker[:count]

    def snapshot(self) -> PaperSnapshot:
        """Return all that the next step depends on; the smoothers are not part of it."""
        return PaperSnapshot(self._t, self._next_id, self._tracks, self._classes, self.sensor_names)

    def restore(self, snapshot: PaperSnapshot) -> None:
        """Go back to a snapshot of this tracker."""
        self._t, self._next_id, self._tracks, self._classes, self.sensor_names = snapshot

    def run(self, detections: Detections) -> Iterator[Trajectories]:
        """Step through a recording and yield the table of each time; scans of one time are taken jointly."""
        for batch in detections.batches():
            yield self.step(batch)

    def causal(self) -> Trajectories:
        """Return the confirmed tracks as they are now."""
        t = 0.0 if self._t is None else self._t
        table = table_of(self._reported(), t, self.config, self.sensor_names, self._classes)
        return self._numbered(replace(table, instants=None if self._t is None else np.array([t])))

    def rows_below_least(self) -> int:
        """Return how many rows `output.min_existence` left out: none, confirmed tracks have existence 1."""
        return 0

    def predict(self, t: float) -> Prediction:
        """Say where the confirmed tracks will be at a time, and how surely; the tracker stays as it is.

        Args:
            t: time (s), not before that of the last step.

        Raises:
            DataError: a time that is not finite.
            TimeOrderError: a time before that of the last step.
        """
        t = time_from(t, self._t)
        dt = 0.0 if self._t is None else t - self._t
        tracks = predict(self._reported(), dt, self._settings)
        return predicted(tracks, t, self.config, self.sensor_names, self._classes)

    def smoothed(self) -> Trajectories:
        """Return the smoothed trajectories so far, without what was drained.

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        return self._numbered(self._wanted_smoothers().smoothed(self.sensor_names))

    def drain_smoothed(self) -> Trajectories:
        """Return the smoothed rows that are final and forget them.

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        return self._numbered(self._wanted_smoothers().drain(self.sensor_names))

    def settle(self) -> None:
        """Do nothing: no smoother works behind."""

    def finish(self) -> Trajectories:
        """End all tracks and return their smoothed trajectories; empty when called again."""
        rows = Trajectories.empty(self.sensor_names)
        if self._smoothers is not None and not self._finished:
            rows = self._smoothers.finish(self.sensor_names)
        self._finished = True
        return self._numbered(rows)

    def sensor_states(self) -> dict[str, SensorState]:
        """Return the mean factor on each sensor's noise, by name; the paper learns nothing else of them."""
        scale = self._tracks.scale[self._tracks.confirmed]
        mean = scale.mean(axis=0) if len(scale) else np.ones(len(self.sensor_names))
        return {name: SensorState(float(mean[s])) for s, name in enumerate(self.sensor_names)}

    def save(self, path: str | Path) -> NoReturn:
        """Refuse: a run with this engine is short enough to begin again."""
        self._refuse("save")

    def _refuse(self, name: str) -> NoReturn:
        """Say that the engine lacks something.

        Raises:
            JeatGraphError: always.
        """
        raise JeatGraphError(f"engine paper has no {name}")

    def _wanted_smoothers(self) -> PaperSmoothers:
        if self._smoothers is None:
            raise JeatGraphError("the configuration asks for no smoother: smoother.engine is none")
        return self._smoothers

    def _numbered(self, table: Trajectories) -> Trajectories:
        """Return a table with the numbers of its classes."""
        return replace(table, class_ids=self._class_ids or None)

    def _reported(self) -> PaperTracks:
        return self._tracks.take(self._tracks.confirmed)

    def _with_met(self, batch: Sequence[Scan]) -> tuple[str, ...]:
        """Return the names of the sensors, those included that look for the first time."""
        new = sorted({scan.sensor for scan in batch} - set(self.sensor_names))
        if self.config.input.undeclared != "declare":
            for name in new:
                sensor_index(name, self.sensor_names)  # refuses it
        if len(self.sensor_names) + len(new) > _MOST_SENSORS:
            raise DataError(f"at most {_MOST_SENSORS} sensors can be tracked together")
        return (*self.sensor_names, *new)

    def _found(self, batch: Sequence[Scan]) -> Found:
        """Return the detections of a step with their noise R_base g(p), g = 1 / max(p, floor)."""
        sensor = np.repeat([self.sensor_names.index(s.sensor) for s in batch], [len(s) for s in batch])
        boxes = np.concatenate([s.boxes for s in batch]).reshape(-1, 4)
        scores = np.concatenate([s.scores for s in batch])
        known = [self.config.sensors.get(name, SensorConfig()) for name in self.sensor_names]
        variance: FloatArray = np.array([one.sigma_px**2 for one in known])
        size_variance: FloatArray = np.array([one.sigma_log_size**2 for one in known])
        sensor = sensor.astype(np.int64)
        noise = variance[sensor] / np.maximum(scores, self._settings.score_floor)
        return Found(
            boxes[:, :2] + 0.5 * boxes[:, 2:], np.log(boxes[:, 2:]), sensor, noise, size_variance[sensor]
        )
