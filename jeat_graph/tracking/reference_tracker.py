"""`Tracker(engine="reference")`: the reference model behind the methods of `Tracker`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import numpy.typing as npt

from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.embeddings import unit_embeddings
from jeat_graph.data.errors import DataError, JeatGraphError, TimeOrderError
from jeat_graph.data.interop import boxes_of
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.score_calibration import logit
from jeat_graph.smoothers.state_rts import FilterRecord, smooth
from jeat_graph.tracking.classes import ClassTally, Votes, check_names
from jeat_graph.tracking.reference import Reported, step
from jeat_graph.tracking.reference_state import SensorScan, declare_sensor, initial_state
from jeat_graph.tracking.scans import ScanLike, as_scans

#: Most sensors: the columns of `Trajectories.used` are the bits of a signed number.
_MOST_SENSORS = 63


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


class ReferenceTracker:
    """The reference model as a tracker; slow, and the definition of what a fast one computes.

    Sensors have any names and are known from their first scan on. Boxes are reported as they are, beyond the
    picture too. It takes the size of the picture from the configuration if that was given, and whether there
    is a smoother; nothing else of it.

    Args:
        config: a configuration, the name of a preset, or of a YAML file.
        image: width and height of the picture (px), also as "1920x1080".
        diagnostics: must be False.
        constants: of the model.

    Raises:
        JeatGraphError: diagnostics are asked for.
    """

    def __init__(
        self,
        config: Config | str | Path = "default",
        *,
        image: tuple[float, float] | str | None = None,
        diagnostics: bool = False,
        constants: ModelConstants | None = None,
    ) -> None:
        if diagnostics:
            raise JeatGraphError("the reference engine has no diagnostics; leave diagnostics or engine away")
        self.config = config = as_config(config, image)
        self.constants = constants or ModelConstants()
        known = config.input.picture == "given"
        picture = (config.image.width, config.image.height) if known else None
        self.sensor_names: tuple[str, ...] = ()
        self._state = initial_state(picture, self.constants)
        self._smooths = config.smoother.engine != "none"
        self._records: list[FilterRecord] = []
        self._moments: list[Moment] = []
        self._classes: ClassTally | None = None
        self._called: dict[int, tuple[str, float]] = {}  # class and its share of each track so far
        self._causal = Trajectories.empty()
        self._finished = False

    @property
    def num_tracks(self) -> int:
        """Number of living tracks, those too that are not reported."""
        return len(self._state.tracks)

    @property
    def num_born(self) -> int:
        """Number of tracks started so far."""
        return self._state.next_id - 1

    @property
    def time(self) -> float | None:
        """Time of the last step (s), or None before the first."""
        return self._state.t

    def step(self, scans: ScanLike | Sequence[ScanLike]) -> Trajectories:
        """Take in one scan, or several of one and the same time; see `Tracker.step`.

        Raises:
            DataError: boxes or scores that are not valid, embeddings, or too many sensors.
            TimeOrderError: a time before that of the last step. In both cases the state is as before.
            JeatGraphError: after `finish`.
        """
        if self._finished:
            raise JeatGraphError("this tracker has been finished; make another one for another recording")
        batch = as_scans(scans)
        t = batch[0].t
        if self.time is not None and t < self.time:
            raise TimeOrderError(f"scan at t = {t} s is older than the last one at {self.time} s")
        if any(scan.embeddings is not None for scan in batch):
            raise DataError("the reference engine compares no embeddings; leave them or the engine away")
        check_names(self._classes, batch)
        self._declare(batch)
        # Several scans of one sensor at one time are one.
        sensor = np.repeat([self.sensor_names.index(s.sensor) for s in batch], [len(s) for s in batch])
        boxes = np.concatenate([s.boxes for s in batch])
        sides = np.concatenate([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]], axis=1)
        scores = logit(np.concatenate([s.scores for s in batch]))
        looking = sorted({self.sensor_names.index(s.sensor) for s in batch})
        rows = [np.flatnonzero(sensor == k) for k in looking]
        joined = [SensorScan(k, sides[r], scores[r]) for k, r in zip(looking, rows, strict=True)]
        done = step(self._state, t, joined, self.constants)
        taker = np.zeros(len(boxes), dtype=np.int64)
        for r, ids in zip(rows, done.takers, strict=True):
            taker[r] = ids
        self._count_classes(batch, done.tracks.track_id, taker)
        self._causal = self._table(t, done)
        if self._smooths:
            self._records += done.records
            kept = done.tracks
            self._moments.append(Moment(t, len(self._records) - 1, kept.track_id, kept.real, kept.used))
        return self._causal

    def update(
        self,
        source: Any,
        *,
        t: float,
        sensor: str,
        scores: npt.ArrayLike | None = None,
        classes: npt.ArrayLike | None = None,
        embeddings: npt.ArrayLike | None = None,
        format: str | None = None,
    ) -> Trajectories:
        """Take in what a detector returned for one picture; see `Tracker.update`. Embeddings are refused."""
        found = boxes_of(source, scores, classes, format)
        looks = None if embeddings is None else unit_embeddings(embeddings, len(found.kept))[found.kept]
        return self.step(Scan(t, sensor, found.boxes, found.scores, found.classes, looks))

    def causal(self) -> Trajectories:
        """Return the tracks that are reported now, as the last step did."""
        return self._causal

    def run(self, detections: Detections) -> Iterator[Trajectories]:
        """Step through a recording and yield the table of each time; scans of one time are taken jointly."""
        for batch in detections.batches():
            yield self.step(batch)

    def smoothed(self) -> Trajectories:
        """Return the smoothed trajectories so far, of each track from its first to its last detection.

        A row is told from the time on at which the track's posterior passed one half, and its existence is
        the largest posterior up to then. The final one, which Bayes' rule gives for the whole life of a thing
        that does not change, tells too much: what began as a second box is often taken over by an object.

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        if not self._smooths:
            raise JeatGraphError("the configuration asks for no smoother: smoother.engine is none")
        last, best = np.full(self._state.next_id, -np.inf), np.zeros(self._state.next_id)
        existence = {}
        for moment in self._moments:
            ids = moment.track_id
            last[ids[moment.used != 0]] = moment.t
            best[ids] = np.maximum(best[ids], moment.real)
            existence[moment.record] = moment, best[ids]
        parts = []
        for number, mean, covariance in smooth(self._records):
            if number in existence:
                moment, real = existence[number]
                ids = moment.track_id
                told = (real > self.constants.report) & (moment.t <= last[ids])
                state = mean[told], covariance[told], real[told], moment.used[told]
                parts.append(self._rows(moment.t, ids[told], *state))
        return Trajectories.concatenate(parts[::-1]) if parts else Trajectories.empty(self.sensor_names)

    def finish(self) -> Trajectories:
        """End all tracks and return their smoothed trajectories; empty when called again."""
        rows = Trajectories.empty(self.sensor_names)
        if self._smooths and not self._finished:
            rows = self.smoothed()
        self._finished = True
        return rows

    def save(self, path: str | Path) -> NoReturn:
        """Refuse: see `_refuse`."""
        self._refuse("save")

    def snapshot(self) -> NoReturn:
        """Refuse: see `_refuse`."""
        self._refuse("snapshot")

    def take_in(self, batch: Sequence[Scan]) -> NoReturn:
        """Refuse: see `_refuse`."""
        self._refuse("take_in")

    def restore(self, snapshot: object) -> NoReturn:
        """Refuse: see `_refuse`."""
        self._refuse("restore")

    def predict(self, t: float) -> NoReturn:
        """Refuse: see `_refuse`."""
        self._refuse("predict")

    def _refuse(self, name: str) -> NoReturn:
        """Say that the reference engine lacks what only a live tracker needs."""
        raise JeatGraphError(
            f"the reference engine has no {name}: it is neither saved nor taken back; use another engine"
        )

    def _declare(self, batch: Sequence[Scan]) -> None:
        """Make the sensors known that look for the first time."""
        new = sorted({scan.sensor for scan in batch} - set(self.sensor_names))
        if len(self.sensor_names) + len(new) > _MOST_SENSORS:
            raise DataError(f"at most {_MOST_SENSORS} sensors can be tracked together")
        for name in new:
            declare_sensor(self._state, self.constants)
            self.sensor_names = (*self.sensor_names, name)

    def _count_classes(self, batch: Sequence[Scan], living: IntArray, taker: IntArray) -> None:
        """Let the boxes of a step vote for the classes of their tracks; ended ones keep theirs."""
        votes = Votes.of_batch(batch, np.arange(len(taker), dtype=np.int64))
        if votes is None and self._classes is None:
            return
        self._classes = (self._classes or ClassTally.start()).after(living, taker, votes)
        names, shares = self._classes.columns(living)
        called = zip(names.tolist(), shares.tolist(), strict=True)
        self._called.update(zip(living.tolist(), called, strict=True))

    def _table(self, t: float, done: Reported) -> Trajectories:
        """Return the rows of a step."""
        tracks = done.tracks.take(done.reported)
        return self._rows(t, tracks.track_id, tracks.mean, tracks.covariance, tracks.real, tracks.used)

    def _rows(
        self,
        t: float,
        ids: IntArray,
        mean: FloatArray,
        covariance: FloatArray,
        real: FloatArray,
        used: IntArray,
    ) -> Trajectories:
        """Return tracks (N,) at one time as a table."""
        sides, size = box_sides.corners(mean), singer.box_size(mean)
        variance = np.diagonal(covariance, axis1=2, axis2=3)
        called = [self._called.get(track, ("", np.nan)) for track in ids.tolist()]
        known = self._classes is not None
        motion = [singer.POSITION, singer.VELOCITY, singer.ACCELERATION]
        return Trajectories(
            t=np.full(len(ids), t),
            track_id=ids,
            boxes=np.concatenate([sides[:, :2], size], axis=1),
            existence=real,
            mean=mean[:, :, motion].transpose(0, 2, 1).reshape(-1, 6),
            var=variance[:, :, motion].transpose(0, 2, 1).reshape(-1, 6),
            used=used,
            sensors=self.sensor_names,
            classes=np.array([name for name, _ in called], dtype=np.str_) if known else None,
            class_probability=np.array([share for _, share in called], dtype=np.float64) if known else None,
            size_var=size**2 * variance[:, :, singer.LOG_SIZE],
        )
