"""One model of what a sensor says as a tracker: `Tracker(engine="core")` in C++, `"reference"` in NumPy.

Both compute the same: the reference is the definition, the core is fast.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn, cast

import numpy as np
import numpy.typing as npt

from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.core import _core
from jeat_graph.data.arrays import IntArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.embeddings import unit_embeddings
from jeat_graph.data.errors import DataError, JeatGraphError, TimeOrderError
from jeat_graph.data.interop import boxes_of
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.score_calibration import logit
from jeat_graph.tracking.classes import ClassTally, Votes, check_names
from jeat_graph.tracking.reference_model import ModelRows, ReferenceModel
from jeat_graph.tracking.scans import ScanLike, as_scans
from jeat_graph.tracking.sensor_state import SensorState

#: Most sensors: the columns of `Trajectories.used` are the bits of a signed number.
_MOST_SENSORS = 63
_MOTION = [singer.POSITION, singer.VELOCITY, singer.ACCELERATION]


class ModelTracker:
    """The model as a tracker.

    Sensors have any names and are known from their first scan on. Boxes are reported up to the edge of the
    picture where the detectors' end there, and else as they are (`output.clip` false: always). Of the
    configuration it takes besides the size of the picture, if that was given, and the smoother (with a fixed
    lag rows are final after twice `smoother.lag_s`, else when their track has ended).

    Args:
        config: a configuration, the name of a preset, or of a YAML file.
        image: width and height of the picture (px), also as "1920x1080".
        diagnostics: must be False.
        engine: "core" or "reference", which smooths whole tracks only.
        constants: of the model.

    Raises:
        JeatGraphError: diagnostics are asked for.
    """

    #: Whether a run that was broken off can go on: it cannot yet.
    can_save = False

    def __init__(
        self,
        config: Config | str | Path = "default",
        *,
        image: tuple[float, float] | str | None = None,
        diagnostics: bool = False,
        engine: str = "core",
        constants: ModelConstants | None = None,
    ) -> None:
        self._engine = engine
        if diagnostics:
            self._refuse("diagnostics")
        self.config = config = as_config(config, image)
        self.constants = constants or ModelConstants()
        self.sensor_names: tuple[str, ...] = ()
        self._smooths = config.smoother.engine != "none"
        # The core's has the methods of the reference.
        make = cast(type[ReferenceModel], _core.tracking.Model) if engine == "core" else ReferenceModel
        known = config.input.picture == "given"
        size = (float(config.image.width), float(config.image.height)) if known else (1.0, 1.0)
        self._model = make(self.constants, *size, known, self._lag_s())
        self._t: float | None = None
        self._classes: ClassTally | None = None
        self._called: dict[int, tuple[str, float]] = {}  # class and its share of each track so far
        self._causal = Trajectories.empty()
        self._finished = False

    @property
    def num_tracks(self) -> int:
        """Number of living tracks, those too that are not reported."""
        return self._model.size()

    @property
    def num_born(self) -> int:
        """Number of tracks started so far."""
        return self._model.born()

    @property
    def time(self) -> float | None:
        """Time of the last step (s), or None before the first."""
        return self._t

    @property
    def smoother_counts(self) -> dict[str, int]:
        """What the smoothers count: nothing here."""
        return {}

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
        t = float(batch[0].t)
        if self._t is not None and t < self._t:
            raise TimeOrderError(f"scan at t = {t} s is older than the last one at {self._t} s")
        if any(scan.embeddings is not None for scan in batch):
            raise DataError("this engine compares no embeddings; leave them or the engine away")
        check_names(self._classes, batch)
        self._declare(batch)
        # Several scans of one sensor at one time are one.
        sensor = np.repeat([self.sensor_names.index(s.sensor) for s in batch], [len(s) for s in batch])
        order = np.argsort(sensor, kind="stable")
        looking = np.array(sorted({self.sensor_names.index(s.sensor) for s in batch}), dtype=np.int64)
        boxes = np.concatenate([s.boxes for s in batch])[order]
        scores = np.concatenate([s.scores for s in batch])[order]
        numbers = np.bincount(sensor, minlength=len(self.sensor_names))[looking].astype(np.int64)
        sides = np.concatenate([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]], axis=1)
        self._model.take(t, looking, numbers, sides, logit(scores))
        self._t = t
        taker = np.zeros(len(boxes), dtype=np.int64)
        taker[order] = self._model.takers()
        self._count_classes(batch, taker)
        self._causal = self._table(self._model.rows())
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
        """Return the smoothed trajectories so far, without what was drained.

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        self._check_smooths()
        return self._in_order(self._model.smoothed())

    def drain_smoothed(self) -> Trajectories:
        """Return the smoothed rows that are final and forget them.

        Raises:
            JeatGraphError: the configuration asks for no smoother.
        """
        self._check_smooths()
        return self._in_order(self._model.drain())

    def settle(self) -> None:
        """Do nothing: no smoother works behind."""

    def finish(self) -> Trajectories:
        """End all tracks and return their smoothed trajectories; empty when called again."""
        rows = Trajectories.empty(self.sensor_names)
        if self._smooths and not self._finished:
            rows = self._in_order(self._model.finish())
        self._finished = True
        return rows

    def sensor_states(self) -> dict[str, SensorState]:
        """Return what has been learnt of each sensor, by name; offsets and lags are not told."""
        learnt = self._model.learnt()
        noise = np.exp(learnt["log_side_variance"]) / self.constants.side_std**2
        believed = 1.0 / (1.0 + np.exp(-learnt["prior_odds"]))
        return {
            name: SensorState(
                clutter=float(learnt["leftovers"][k]),
                p_detect=float(learnt["p_detect"][k]),
                trust=float(believed[k]),
                blind=0.0,
                noise_scale=float(noise[k]),
            )
            for k, name in enumerate(self.sensor_names)
        }

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
        """Say that the engine lacks something.

        Raises:
            JeatGraphError: always.
        """
        raise JeatGraphError(f"engine {self._engine} has no {name} yet; tracker.engine=compiled has it")

    def _lag_s(self) -> float:
        if not self._smooths:
            return -1.0
        return self.config.smoother.lag_s if self.config.smoother.engine.startswith("fixed-lag") else math.inf

    def _check_smooths(self) -> None:
        if not self._smooths:
            raise JeatGraphError("the configuration asks for no smoother: smoother.engine is none")

    def _declare(self, batch: Sequence[Scan]) -> None:
        """Make the sensors known that look for the first time."""
        new = sorted({scan.sensor for scan in batch} - set(self.sensor_names))
        if len(self.sensor_names) + len(new) > _MOST_SENSORS:
            raise DataError(f"at most {_MOST_SENSORS} sensors can be tracked together")
        for name in new:
            self._model.declare_sensor()
            self.sensor_names = (*self.sensor_names, name)

    def _count_classes(self, batch: Sequence[Scan], taker: IntArray) -> None:
        """Let the boxes of a step vote for the classes of their tracks; ended ones keep theirs."""
        votes = Votes.of_batch(batch, np.arange(len(taker), dtype=np.int64))
        if votes is None and self._classes is None:
            return
        living = self._model.living()
        self._classes = (self._classes or ClassTally.start()).after(living, taker, votes)
        names, shares = self._classes.columns(living)
        called = zip(names.tolist(), shares.tolist(), strict=True)
        self._called.update(zip(living.tolist(), called, strict=True))

    def _in_order(self, rows: ModelRows) -> Trajectories:
        """Return rows in order of time, then of identity."""
        order = np.lexsort((rows[1], rows[0]))
        t, ids, mean, variance, real, used = rows
        return self._table((t[order], ids[order], mean[order], variance[order], real[order], used[order]))

    def _table(self, rows: ModelRows) -> Trajectories:
        """Return rows as a table."""
        t, ids, mean, variance, real, used = rows
        state, spread = mean.reshape(-1, 2, singer.MOTION), variance.reshape(-1, 2, singer.MOTION)
        sides, size = box_sides.corners(state), singer.box_size(state)
        if self.config.output.clip and self._model.boxes_end_at_edge():
            picture = [self.config.image.width, self.config.image.height]
            sides = np.clip(sides, 0.0, np.array([*picture, *picture], dtype=np.float64))
        called = [self._called.get(track, ("", np.nan)) for track in ids.tolist()]
        known = self._classes is not None
        table = Trajectories(
            t=t,
            track_id=ids,
            boxes=np.concatenate([sides[:, :2], sides[:, 2:] - sides[:, :2]], axis=1),
            existence=real,
            mean=state[:, :, _MOTION].transpose(0, 2, 1).reshape(-1, 6),
            var=spread[:, :, _MOTION].transpose(0, 2, 1).reshape(-1, 6),
            used=used,
            sensors=self.sensor_names,
            classes=np.array([name for name, _ in called], dtype=np.str_) if known else None,
            class_probability=np.array([share for _, share in called], dtype=np.float64) if known else None,
            size_var=size**2 * spread[:, :, singer.LOG_SIZE],
        )
        left = (table.boxes[:, 2:] > 0.0).all(axis=1)
        return table if left.all() else table.take(np.flatnonzero(left))
