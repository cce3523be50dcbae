"""The online tracker: scans in, the tracks of the moment out, nothing kept that grows."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from jeat_graph.config.kernel_form import kernel_model
from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.diagnostics import Diagnostics
from jeat_graph.data.errors import JeatGraphError, TimeOrderError, UnknownSensorError
from jeat_graph.data.interop import boxes_of
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.batch import Arrivals
from jeat_graph.tracking.reporting import report
from jeat_graph.tracking.state import Scene, allocate, grow
from jeat_graph.tracking.step import step
from jeat_graph.tracking.update_log import allocate_log

if TYPE_CHECKING:
    from jeat_graph.tracking.smoothing.behind import Smoothing
    from jeat_graph.tracking.smoothing.history import TrackHistory

ScanLike: TypeAlias = Scan | tuple[float, str, npt.ArrayLike, npt.ArrayLike]

_FIRST_CAPACITY = 64


class Tracker:
    """Joint tracker of all vehicles over any number of asynchronous sensors (paper algorithm 1).

    Feed it scans in time order. Each step sees only what has arrived: the table it returns is causal. Memory
    does not grow with time (smoothed rows that nobody fetches go to a temporary file, see `drain_smoothed`).

    Args:
        config: sensors and settings, from `load_config`; or the name of a preset, or of a YAML file.
        image: width and height of the picture (px), if not those of the configuration.
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
        image: tuple[float, float] | None = None,
        diagnostics: bool = False,
    ) -> None:
        config = as_config(config, image)
        self.config = config
        self._diagnostics = diagnostics
        self.sensor_names = config.sensor_names
        self._index = {name: k for k, name in enumerate(self.sensor_names)}
        self._model = kernel_model(config)
        sensors = self._model.sensors
        self._tracks = allocate(_FIRST_CAPACITY, len(self.sensor_names), len(sensors.correlation_time_s))
        self._scene = Scene(
            clutter=sensors.clutter_per_scan.copy(),
            p_detect=sensors.p_detect.copy(),
            undetected=np.array([config.birth.initial]),
        )
        self._num_tracks = 0
        self._next_id = 1
        self._t: float | None = None
        self._log = allocate_log(0)
        self._finished = False
        self._smoothers: Smoothing | None = None
        if config.smoother.engine != "none":
            self._smoothers = _smoothing(config)

    @property
    def num_tracks(self) -> int:
        """Number of living tracks, the tentative ones included."""
        return self._num_tracks

    @property
    def num_born(self) -> int:
        """Number of tracks started so far."""
        return self._next_id - 1

    @property
    def time(self) -> float | None:
        """Time of the last step (s), or None before the first."""
        return self._t

    def step(self, scans: ScanLike | Sequence[ScanLike]) -> Trajectories:
        """Take in one scan, or several of one and the same time, which are associated jointly.

        Args:
            scans: a `Scan` or a tuple (t, sensor, boxes (M, 4), scores (M,)), or a sequence of these. A scan
                that found nothing (M = 0) is information too.

        Returns:
            The tracks that are reported now, one row each.

        Raises:
            DataError: boxes or scores that are not valid.
            UnknownSensorError: a sensor that the configuration does not declare.
            TimeOrderError: a time before that of the last step. In all three cases the state is as before.
            JeatGraphError: after `finish`.
        """
        if self._finished:
            raise JeatGraphError("this tracker has been finished; make another one for another recording")
        batch = _as_scans(scans)
        t = batch[0].t
        if any(scan.t != t for scan in batch):
            raise TimeOrderError("the scans of one step must have one and the same time")
        if self._t is not None and t < self._t:
            raise TimeOrderError(f"scan at t = {t} s is older than the last one at {self._t} s")
        codes = [self._sensor_index(scan.sensor) for scan in batch]
        if len(batch) == 1:
            boxes, scores = batch[0].boxes, batch[0].scores
            sensor = np.full(len(scores), codes[0], dtype=np.int64)
        else:
            boxes = np.concatenate([scan.boxes for scan in batch])
            scores = np.concatenate([scan.scores for scan in batch])
            sensor = np.repeat(np.array(codes, dtype=np.int64), [len(scan) for scan in batch])
        present = np.zeros(len(self.sensor_names), dtype=np.bool_)
        present[codes] = True

        longest = self.config.lifecycle.max_silence_s
        dt = 0.0 if self._t is None else min(t - self._t, longest)
        if dt == longest:
            self._num_tracks = 0
        self._tracks = grow(self._tracks, self._num_tracks, self._num_tracks + len(scores))
        logs = self._diagnostics or self._smoothers is not None
        if logs and len(scores) > len(self._log.rows):
            self._log = allocate_log(2 * len(scores))
        first_id = self._next_id
        self._num_tracks, self._next_id = step(
            self._tracks,
            self._num_tracks,
            self._next_id,
            dt,
            Arrivals(t, boxes, scores, sensor, present),
            self._scene,
            self._model,
            self._log,
        )
        self._t = t
        table = self.causal()
        if self._smoothers is not None:
            births = self._next_id - first_id
            self._smoothers.record(t, self._tracks, self._num_tracks, births, self._log, table.track_id)
        return table

    def update(
        self, source: Any, *, t: float, sensor: str, scores: npt.ArrayLike | None = None
    ) -> Trajectories:
        """Take in what a detector returned for one picture.

        Args:
            source: `supervision.Detections`, a result of `ultralytics`, or boxes (M, 4) left, top, width,
                height in px; none (M = 0) if the sensor looked and found nothing.
            t: time (s).
            sensor: name of the sensor.
            scores: (M,) confidence in [0, 1], for boxes that come without.

        Returns and raises as `step`; also a DataError where it cannot be told what `source` is.
        """
        found = boxes_of(source, scores)
        return self.step(Scan(t, sensor, found.boxes, found.scores))

    def causal(self) -> Trajectories:
        """Return the tracks that are reported now, as the last step did."""
        t = 0.0 if self._t is None else self._t
        settings = self._model.settings
        by_existence = settings.lifecycle.by_existence
        columns = report(self._tracks, self._num_tracks, t, settings.image, settings.output, by_existence)
        return Trajectories(*columns, sensors=self.sensor_names)

    def last_updates(self) -> Diagnostics:
        """Return what the last step gave to the tracks, those too that are not reported.

        Raises:
            JeatGraphError: the tracker was not made with `diagnostics`.
        """
        if not self._diagnostics:
            raise JeatGraphError("make the tracker with diagnostics=True to be told of its updates")
        t = 0.0 if self._t is None else self._t
        rows = self._log.rows[: int(self._log.count[0])]
        n = self._num_tracks
        living = (self._tracks.track_id[:n], self._tracks.existence[:n])
        return Diagnostics.from_log(t, rows, *living, self.sensor_names)

    def smoothed(self) -> Trajectories:
        """Return the smoothed trajectories of the confirmed tracks so far, without what was drained.

        Their whole life: the time before confirmation and gaps included, up to the last detection. With a
        fixed lag the rows older than that are final; all others may still change. (The call makes the
        smoothers take in what they had set aside: with a fixed lag some states become final a part of a chunk
        earlier than in a run without it, and differ from there by what that part would have told.)

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        return self._wanted_smoothers().smoothed()

    def drain_smoothed(self) -> Trajectories:
        """Return the smoothed rows that are final and forget them, in order of time over all calls.

        A live caller that keeps a smoother calls this now and then: rows that nobody fetches are kept for
        `finish`, some 200 bytes each, the first 100,000 in memory and the rest in a temporary file. The
        engines over whole tracks give a track's rows when it has ended, and all at `finish` if fragments are
        to be stitched.

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        return self._wanted_smoothers().drain()

    def finish(self) -> Trajectories:
        """End all tracks and return their smoothed trajectories, without what was drained before.

        The tracker takes no more scans. Called again, or without a smoother, it returns an empty table.
        """
        self._finished = True
        if self._smoothers is None:
            return Trajectories.empty(self.sensor_names)
        return self._smoothers.finish()

    @property
    def smoother_counts(self) -> dict[str, int]:
        """How the smoothers fared: tracks, rebuilds, fallbacks, late measurements, joints; {} without one."""
        return self._smoothers.counts() if self._smoothers is not None else {}

    def confirmed_histories(self) -> list[TrackHistory]:
        """Return what the confirmed tracks took in so far; only engines that stitch (full, rts) keep it.

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        return self._wanted_smoothers().confirmed_histories()

    def _wanted_smoothers(self) -> Smoothing:
        if self._smoothers is None:
            raise JeatGraphError("the configuration asks for no smoother: smoother.engine is none")
        return self._smoothers

    def run(self, detections: Detections) -> Iterator[Trajectories]:
        """Step through a recording and yield the table of each time; scans of one time are taken jointly."""
        for batch in detections.batches():
            yield self.step(batch)

    def _sensor_index(self, name: str) -> int:
        index = self._index.get(name)
        if index is None:
            near = difflib.get_close_matches(name, self.sensor_names, 1)
            hint = f"did you mean {near[0]!r}?" if near else f"declared: {', '.join(self.sensor_names)}"
            raise UnknownSensorError(f"sensor {name!r} is not declared in the configuration; {hint}")
        return index


def track(config: Config, detections: Detections) -> Trajectories:
    """Track a recording from beginning to end and return the whole causal table.

    Args:
        config: sensors and settings.
        detections: the recording.
    """
    causal_only = replace(config, smoother=replace(config.smoother, engine="none"))
    return Trajectories.concatenate(list(Tracker(causal_only).run(detections)) or [Trajectories.empty()])


def _as_scans(scans: Any) -> list[Scan]:
    if isinstance(scans, Scan):
        return [scans]
    if isinstance(scans, tuple) and len(scans) == 4 and isinstance(scans[1], str):
        return [Scan(*scans)]
    if isinstance(scans, Iterable):
        out = [scan if isinstance(scan, Scan) else Scan(*scan) for scan in scans]
        if out:
            return out
    raise TypeError("step takes a Scan, a tuple (t, sensor, boxes, scores), or a sequence of these")


def _smoothing(config: Config) -> Smoothing:
    """Smoothing here, or in a process of its own; imported only where it is wanted."""
    if config.smoother.worker:
        from jeat_graph.tracking.smoothing.worker import SmoothingWorker

        return SmoothingWorker(config)
    from jeat_graph.tracking.smoothing.behind import SmoothingHere

    return SmoothingHere(config)
