"""The online tracker: scans in, the tracks of the moment out, nothing kept that grows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from jeat_graph.config.kernel_form import kernel_model
from jeat_graph.config.learnt import LearntConfig
from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import BoolArray, IntArray, RecordArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.diagnostics import Diagnostics
from jeat_graph.data.embeddings import EmbeddingArray
from jeat_graph.data.errors import JeatGraphError, TimeOrderError
from jeat_graph.data.scan import time_of
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.rig.common_picture import CommonPicture, with_map_noise
from jeat_graph.tracking.appearance import Compared, Looks, compare, embeddings_of, remember
from jeat_graph.tracking.classes import ClassTally, check_names, count_votes, number_classes
from jeat_graph.tracking.compaction import allocate, grow
from jeat_graph.tracking.compiled_prediction import predict_reported
from jeat_graph.tracking.detector_results import DetectorResults
from jeat_graph.tracking.direct_call import DirectCall
from jeat_graph.tracking.engines import ChosenEngine
from jeat_graph.tracking.input_watch import InputWatch
from jeat_graph.tracking.learnt import begin_with, learnt_of
from jeat_graph.tracking.notice import notice_if_cold
from jeat_graph.tracking.prediction import Prediction
from jeat_graph.tracking.reporting import as_table, longest_gaps_s, report
from jeat_graph.tracking.scans import ScanLike, arrivals_of, as_scans
from jeat_graph.tracking.sensor_state import SensorState, sensor_states
from jeat_graph.tracking.snapshot import Snapshot
from jeat_graph.tracking.state import start_scene
from jeat_graph.tracking.step import step
from jeat_graph.tracking.step_record import StepRecord, record_step
from jeat_graph.tracking.update_log import allocate_log

_FIRST_CAPACITY = 64


class Tracker(ChosenEngine, DetectorResults):
    """Joint tracker of all vehicles over any number of asynchronous sensors (paper algorithm 1).

    Feed it scans in time order. Each step sees only what has arrived: the table it returns is causal. Memory
    does not grow with time (smoothed rows that nobody fetches go to a temporary file, see `drain_smoothed`).

    Args:
        config: sensors and settings, from `load_config`; or the name of a preset, or of a YAML file.
        image: width and height of the picture (px), also as "1920x1080", if not those of the configuration.
        engine: "compiled", "core" or "reference" (`ModelTracker`), if not that of the configuration.
        diagnostics: take down how well each detection fitted its track, for `last_updates`.

    Example:
        >>> from jeat_graph import Tracker
        >>> tracker = Tracker(image=(1920, 1080))
        >>> table = tracker.step((0.0, "rgb", [[100, 100, 40, 30]], [0.9]))
        >>> tracker.num_tracks
        1
    """

    def __init__(
        self,
        config: Config | str | Path = "default",
        *,
        image: tuple[float, float] | str | None = None,
        diagnostics: bool = False,
        engine: str | None = None,
    ) -> None:
        config = as_config(self._chosen, image)
        super().__init__(config)
        self.config = config
        self._diagnostics = diagnostics
        self._common = CommonPicture.of(config)
        self._model = kernel_model(with_map_noise(config) if self._common.ways else config)
        sensors = self._model.sensors
        choices = config.motion.densities, config.size.densities
        num_errors = len(sensors.correlation_time_s)
        self._tracks = allocate(_FIRST_CAPACITY, len(self.sensor_names), num_errors, *choices)
        self._scene = begin_with(start_scene(sensors, config), config)
        self._num_tracks = 0
        self._next_id = 1
        self._t: float | None = None
        self._log = allocate_log(0)
        self.logs_takers = False  # whether `takers` will be asked
        # Of a step's arguments `arrivals_of` alone comes from outside, and it sees to their types.
        self._step, self._report = DirectCall(step), DirectCall(report)
        self._classes: ClassTally | None = None
        self._looks: Looks | None = None
        self._watch = InputWatch(config)
        notice_if_cold()

    @property
    def num_tracks(self) -> int:
        """Number of living tracks, the tentative ones included."""
        return self._num_tracks

    @property
    def num_born(self) -> int:
        """Number of tracks started so far."""
        return self._next_id - 1

    @property
    def has_diagnostics(self) -> bool:
        """Whether `last_updates` and `last_measurements` have something to say."""
        return self._diagnostics

    @property
    def time(self) -> float | None:
        """Time of the last step (s), or None before the first."""
        return self._t

    def step(self, scans: ScanLike | Sequence[ScanLike]) -> Trajectories:
        """Take in one scan, or several of one and the same time, which are associated jointly.

        Args:
            scans: a `Scan` or a tuple (t, sensor, boxes (M, 4), scores (M,)), also with names of classes (M,)
                and embeddings (M, E) behind, or a sequence of these. A scan that found nothing (M = 0) is
                information too. Boxes of a sensor that has a picture of its own (`sensors.NAME.image`) are in
                that picture; times are the common clock's, whatever `latency_s` and `clock` say.

        Returns:
            The tracks that are reported now, one row each.

        Raises:
            DataError: boxes or scores that are not valid.
            UnknownSensorError: a sensor that the configuration does not declare, if it has such refused
                (`input.undeclared`); `default` has it declared (`meet`).
            TimeOrderError: a time before that of the last step. In all three cases the state is as before.
            JeatGraphError: after `finish`.
        """
        batch = as_scans(scans)
        if not self._finished:
            self.meet(batch)
        self.hand_over(self._take_in([self._common.boxes(scan) for scan in batch]))
        self._told.note("step", batch, sum(map(len, batch)))
        return self.causal()

    def take_in(self, batch: Sequence[Scan]) -> StepRecord | None:
        """Do a step for a caller who may have to take it back, and hands it to the smoothers later.

        Args:
            batch: scans of one and the same time.

        Returns:
            What `hand_over` takes; None without a smoother. `causal` has the tracks that are reported.

        Raises:
            DataError, UnknownSensorError, TimeOrderError: as `step`.
            JeatGraphError: after `finish`.
        """
        self._told.forget()
        return self._take_in(batch)

    def _take_in(self, batch: Sequence[Scan]) -> StepRecord | None:
        if self._finished:
            raise JeatGraphError("this tracker has been finished; make another one for another recording")
        arrivals = arrivals_of(batch, self.sensor_names)
        t, count = arrivals.t, len(arrivals.scores)
        if self._t is not None and t < self._t:
            raise TimeOrderError(f"scan at t = {t} s is older than the last one at {self._t} s")
        check_names(self._classes, batch)
        embeddings = embeddings_of(self._looks, batch)
        self._watch.look(batch)  # before anything changes: a user may have made warnings errors
        longest = self.config.lifecycle.max_silence_s
        dt = 0.0 if self._t is None else min(t - self._t, longest)
        if dt == longest:
            self._num_tracks = 0
        self._tracks = grow(self._tracks, self._num_tracks, self._num_tracks + count)
        told = embeddings is not None or any(s.classes is not None for s in batch)
        logs = self._diagnostics or self._smoothers is not None or told or self.logs_takers
        if logs and count > len(self._log.rows):
            self._log = allocate_log(2 * count)
        compared = None
        if embeddings is not None:
            compared = self._compare(embeddings, arrivals.sensor)
            arrivals = arrivals._replace(alike=compared.log_ratio)
        first_id = self._next_id
        self._num_tracks, self._next_id = self._step(
            self._tracks, self._num_tracks, self._next_id, dt, arrivals, self._scene, self._model, self._log
        )
        self._t = t
        living = self._tracks.track_id[: self._num_tracks]
        self._classes, votes = count_votes(self._classes, batch, self._log, living)
        self._class_ids = number_classes(self._class_ids, batch)
        if compared is not None:
            taken = int(self._log.count[0])
            takers, detection = self._log.rows["track_id"][:taken], self._log.detection[:taken]
            self._looks = remember(compared, takers, detection, living)
        if self._smoothers is None:
            return None
        n, births = self._num_tracks, self._next_id - first_id
        # Only of tracks that stand still does it matter whether they are reported.
        standing = bool(self._tracks.standing[:n].any())
        reported = self.causal().track_id if standing else np.zeros(0, dtype=np.int64)
        return record_step(t, self._tracks, n, births, self._log, reported, votes)

    def _compare(self, embeddings: EmbeddingArray, sensor: IntArray) -> Compared:
        """Compare the embeddings (M, E) of a step's detections with the living tracks."""
        looks, living = self._looks, self._tracks.track_id[: self._num_tracks]
        looks = looks or Looks.start(len(self.sensor_names), embeddings.shape[1])
        return compare(looks.of(living), embeddings, sensor, self.config.association.most_alike)

    def hand_over(self, taken: StepRecord | None) -> None:
        """Give the smoothers what a step took in; in order of time, and once."""
        if self._smoothers is not None and taken is not None:
            self._smoothers.record(taken)

    def snapshot(self) -> Snapshot:
        """Copy all that the next step depends on; the smoothers are not part of it."""
        now = Snapshot.of(self._t, self._next_id, self._tracks, self._num_tracks, self._scene)
        return now._replace(classes=self._classes, looks=self._looks)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot of this tracker."""
        self._told.forget()
        self._t, self._next_id, self._num_tracks = snapshot.t, snapshot.next_id, snapshot.num_tracks
        self._classes, self._looks = snapshot.classes, snapshot.looks
        self._tracks = grow(self._tracks, 0, self._num_tracks)
        snapshot.copy_to(self._tracks, self._scene)

    def living(self) -> tuple[IntArray, int]:
        """Return the identities (N,) of the living tracks, and that of the next one to be born."""
        return self._tracks.track_id[: self._num_tracks].copy(), self._next_id

    def last_looks(self) -> dict[str, float]:
        """Return when each sensor looked last (s), minus infinity for never."""
        return dict(zip(self.sensor_names, self._scene.last_look.tolist(), strict=True))

    def sensor_states(self) -> dict[str, SensorState]:
        """Return what has been learnt of each sensor: clutter, detection probability, noise."""
        return sensor_states(self.snapshot(), self.sensor_names)

    def learnt(self) -> dict[str, LearntConfig]:
        """Return what has been learnt of the sensors that have looked: `sensors.NAME.learnt` of the next."""
        return learnt_of(self._scene, self.config)

    def predict(self, t: float) -> Prediction:
        """Say where the tracks that are reported now will be at a time, and how surely.

        The tracker stays as it is: for a caller who needs an answer more often than the sensors give one, or
        for the moment at which his own answer will arrive.

        Args:
            t: time (s), not before that of the last step.

        Raises:
            DataError: a time that is not finite.
            TimeOrderError: a time before that of the last step.
        """
        t = time_of(t)
        if self._t is not None and t < self._t:
            raise TimeOrderError(f"t = {t} s is before the last scan at {self._t} s: that is past")
        return predict_reported(self.snapshot(), t, self._model, self.sensor_names)

    def causal(self) -> Trajectories:
        """Return the tracks that are reported now, as the last step did."""
        t = 0.0 if self._t is None else self._t
        settings, by_existence = self._model.settings, self._model.settings.lifecycle.by_existence
        gaps = longest_gaps_s(self._scene, self._model, t)
        columns = self._report(
            self._tracks, self._num_tracks, t, gaps, settings.image, settings.output, by_existence
        )
        table = as_table(columns, self.sensor_names, self._classes)
        at = None if self._t is None else np.array([t])
        return replace(table, instants=at, class_ids=self._class_ids or None)

    def last_updates(self) -> Diagnostics:
        """Return what the last step gave to the tracks, those too that are not reported.

        Raises:
            JeatGraphError: the tracker was not made with `diagnostics`.
        """
        rows, ids, _ = self.last_measurements()
        t = 0.0 if self._t is None else self._t
        return Diagnostics.from_log(t, rows, ids, self._tracks.existence[: len(ids)], self.sensor_names)

    def last_measurements(self) -> tuple[RecordArray, IntArray, BoolArray]:
        """Return what the last step gave to the tracks, for other smoothers.

        Returns:
            Records (M,) (`MEASUREMENT`), identities (N,) of the living tracks, whether each is confirmed.

        Raises:
            JeatGraphError: the tracker was not made with `diagnostics`.
        """
        if not self._diagnostics:
            raise JeatGraphError("make the tracker with diagnostics=True to be told of its updates")
        n, rows = self._num_tracks, self._log.rows[: int(self._log.count[0])]
        return rows.copy(), self._tracks.track_id[:n].copy(), self._tracks.confirmed[:n].copy()

    def run(self, detections: Detections) -> Iterator[Trajectories]:
        """Step through a recording and yield the table of each time; scans of one time are taken jointly."""
        for batch in detections.batches():
            yield self.step(batch)
