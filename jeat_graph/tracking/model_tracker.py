"""The tracker over an engine (`engine.TrackEngine`): checks what comes, steps, makes tables of rows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.config.tracker import Engine as EngineName
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, RecordArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.diagnostics import Diagnostics
from jeat_graph.data.embeddings import EmbeddingArray
from jeat_graph.data.errors import DataError, JeatGraphError, TimeOrderError
from jeat_graph.data.identity_links import IdentityLinks
from jeat_graph.data.promised import promised
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.rig.common_picture import CommonPicture
from jeat_graph.smoothers.histories import StepRecord
from jeat_graph.smoothers.rows import ModelRows, in_order
from jeat_graph.tracking.appearance import Appearances, Compared, compare, embeddings_of, remember
from jeat_graph.tracking.classes import ClassTally, Votes, check_names, number_classes
from jeat_graph.tracking.engine import StepBoxes, StepInput, TrackEngine
from jeat_graph.tracking.engines import make_engine
from jeat_graph.tracking.first_sight import wider
from jeat_graph.tracking.heaps import Heaps
from jeat_graph.tracking.hypotheses import Hypotheses
from jeat_graph.tracking.identities.lagging import LagSmoother
from jeat_graph.tracking.identities.log import IdentityLog, counted
from jeat_graph.tracking.identities.passes import Pass, camera_moved, took
from jeat_graph.tracking.input_watch import InputWatch
from jeat_graph.tracking.model_measured import diagnostics_of
from jeat_graph.tracking.model_saving import ModelSnapshot, SavedModel
from jeat_graph.tracking.model_tables import (
    ClassNames,
    Places,
    TableForm,
    reported_table,
    table_of,
    with_classes,
)
from jeat_graph.tracking.old_names import OldNames
from jeat_graph.tracking.one_at_a_time import OneAtATime, one_at_a_time
from jeat_graph.tracking.pending_step import PendingStep
from jeat_graph.tracking.prediction import Prediction, of_motion, still_there, time_from
from jeat_graph.tracking.record_smoothing import unsmoothed
from jeat_graph.tracking.scans import ScanLike, as_scans, gather, sensor_index, sensors_of, surest_motion
from jeat_graph.tracking.sensor_state import SensorState
from jeat_graph.tracking.smoothed_instants import SmoothedInstants
from jeat_graph.tracking.smoothed_tables import SmoothedTables
from jeat_graph.tracking.updates import Updates

#: Most sensors: the columns of `Trajectories.used` are the bits of a signed number.
_MOST_SENSORS = 63
#: Greatest absolute value of ln of the similarity of a pair.
_MOST_SIMILARITY = 4.0
_NO_BOXES: IntArray = np.zeros(0, dtype=np.int64)
_FINISHED = "this tracker has been finished; make another one for another recording"


@one_at_a_time(
    "step take_in hand_over snapshot restore reset number_on_from assigned living last_scans meet causal "
    "rows_below_least predict last_updates last_measurements smoothed drain_smoothed settle finish "
    "finish_in_pieces follow disagreements identity_links state hypotheses learnt sensor_states"
)
class ModelTracker(Updates, SmoothedTables, SavedModel, OldNames, OneAtATime):
    """An engine as a tracker.

    Sensors have any names and are known from their first scan on. Boxes are reported up to the edge of the
    picture where `output.clip` says so and the detectors' end there, else as they are. With a fixed lag
    rows are final after twice `smoother.lag_s`, else when their track has ended.

    Threads that share a tracker wait for each other; those with a tracker each do not. `copy.copy` and
    `copy.deepcopy` give a tracker of its own in the same state.

    Args:
        config: a configuration, the name of a preset, or of a YAML file.
        image: width and height of the picture (px), also as "1920x1080".
        diagnostics: take down how well each detection fitted its track, for `last_updates`.
        engine: if not that of the configuration.
        constants: of the model, if not the usual ones; not for the engine `paper`.

    Raises:
        ConfigError: no such engine, or constants for one that has none.
        JeatGraphError: diagnostics of an engine that has none.
    """

    #: Whether a sensor that is met late changes nothing of what was before.
    meets_as_it_goes = True

    def __init__(
        self,
        config: Config | str | Path = "default",
        *,
        image: tuple[float, float] | str | None = None,
        diagnostics: bool = False,
        engine: EngineName | None = None,
        constants: ModelConstants | None = None,
    ) -> None:
        config = as_config(config, image)
        if engine is not None and config.tracker.engine != engine:
            config = replace(config, tracker=replace(config.tracker, engine=engine))
        self.config = config
        self.constants = constants or ModelConstants()
        self.sensor_names: tuple[str, ...] = config.sensor_names
        self._engine_sensors: tuple[str, ...] = ()  # names of the sensors as the engine counts them
        self._places = Places(())  # where these stand among all
        self.logs_assigned = True
        self._diagnostics = diagnostics
        wanted, identities = config.smoother.engine != "none", config.smoother.identities
        self._smooths = wanted and identities != "whole"
        self._log = IdentityLog() if wanted and identities == "whole" else None
        self._lag = LagSmoother(config.smoother) if wanted and identities == "lag" else None
        # Of the last step, where that is not None.
        self._counted: tuple[list[Scan], Pass, FloatArray] | None = None
        self._links: IdentityLinks | None = None
        self._model: TrackEngine = make_engine(config if self._smooths else unsmoothed(config), constants)
        if diagnostics and not self._model.has_fit:
            raise JeatGraphError(f"engine {self._model.name} has no diagnostics")
        self._heaps = Heaps(config.tracker.engine, self.constants)
        self._common = CommonPicture.of(config)
        self._watch = InputWatch(config)
        self._classes: ClassTally | None = None
        self._class_ids: dict[str, int] = {}
        self._called: list[str] = []  # names of classes by number
        self._appearance: Appearances | None = None
        self._causal: Trajectories | None = None
        # Of the last step: places of the boxes in the model's order, and how many were given.
        self._order, self._given = _NO_BOXES, 0
        self._boxes = StepBoxes.none()
        self._instants = SmoothedInstants(config)
        self._finished = False

    def fresh_copy(self, *, smooths: bool = True, constants: ModelConstants | None = None) -> ModelTracker:
        """Return a new tracker of this configuration, with causal identities, that warns of no input again.

        Args:
            smooths: whether it has a smoother.
            constants: by default this one's.
        """
        config = replace(self.config, smoother=replace(self.config.smoother, identities="causal"))
        made = ModelTracker(config if smooths else unsmoothed(config), constants=constants or self.constants)
        made._watch.end()
        made._heaps.end()
        return made

    @property
    def num_tracks(self) -> int:
        """Number of living tracks, those too that are not reported."""
        return self._model.size()

    @property
    def num_born(self) -> int:
        """Number of tracks started so far."""
        return self._model.born()

    @property
    def has_diagnostics(self) -> bool:
        """Whether `last_updates` and `last_measurements` have something to say."""
        return self._diagnostics

    @property
    def can_explain(self) -> bool:
        """Whether `hypotheses` has something to say."""
        return self._model.weighs

    @property
    def time(self) -> float | None:
        """Time of the last step (s), or None before the first."""
        return self._model.time()

    @property
    def smoother_counts(self) -> dict[str, int]:
        """What the smoothers count, by name."""
        return self._model.smoother_counts()

    def step(self, scans: ScanLike | Sequence[ScanLike]) -> Trajectories:
        """Take in one scan, or several of one and the same time.

        Args:
            scans: a `Scan`, or a tuple of time (s), name of the sensor, boxes (M, 4) left, top, width, height
                (px) and scores (M,), perhaps with classes (M,); or a list of these. No boxes (M = 0) say that
                the scan found nothing.

        Returns:
            The reported tracks at that time, no earlier rows: `Trajectories.concatenate` joins those of all
            steps.

        Raises:
            DataError: boxes, scores or embeddings that are not valid, or too many sensors.
            UnknownSensorError: a sensor that the configuration does not declare, if it has such refused.
            TimeOrderError: a time before that of the last step. In all three cases the state is as before.
            JeatGraphError: after `finish`.
        """
        batch = as_scans(scans)
        self._meet(batch)
        if self._common.ways:
            batch = [self._common.boxes(scan) for scan in batch]
        self._take_in(batch)
        if self._smooths:
            self._instants.note(float(batch[0].t))
            self._model.hand_over(None, None, *self._called_now())
            self._decide_later(self._counted, self._model.living(), None)
        return self._causal_table()

    def take_in(self, batch: Sequence[Scan], owners: FloatArray | None = None) -> PendingStep | None:
        """Do a step for a caller who may have to take it back, and hands it to the smoothers later.

        Args:
            batch: scans of one and the same time, in the common picture.
            owners: (M, 3) of their detections where who is who is given, as `StepInput` has them.

        Returns:
            What `hand_over` takes; None without a smoother. `causal` has the tracks that are reported.

        Raises:
            DataError, UnknownSensorError, TimeOrderError: as `step`.
            JeatGraphError: after `finish`.
        """
        self._meet(batch)
        self._take_in(batch, owners)
        if not self._smooths:
            return None
        ids, t = self._model.living(), float(batch[0].t)
        label, share = self._called_now()
        return PendingStep(self._model.record(), t, ids, label, share, batch=self._counted)

    def _take_in(self, batch: Sequence[Scan], owners: FloatArray | None = None) -> None:
        if self._finished:
            raise JeatGraphError(_FINISHED)
        t, now = float(batch[0].t), self.time
        if now is not None and t < now:
            raise TimeOrderError(f"scan at t = {t} s is older than the last one at {now} s")
        check_names(self._classes, batch)
        seen = any(scan.embeddings is not None for scan in batch)
        if seen and not self._model.compares_appearance:
            raise DataError("this engine compares no embeddings; leave them or the engine away")
        embeddings = embeddings_of(self._appearance, batch) if seen else None
        self._watch.check(batch)  # before anything changes: a user may have made warnings errors
        kept = self._heaps.kept(batch)
        self._declare(batch)
        codes = [self._engine_sensors.index(scan.sensor) for scan in batch]
        count, found = sum(map(len, batch)), gather(batch, codes, kept)
        compared = None if embeddings is None else self._compare(embeddings, sensors_of(batch, codes))
        similarity = None if compared is None else compared.log_ratio[:, found.order]
        given = None if owners is None else owners[found.order]
        self._model.take(StepInput(t, *found[:4], similarity, surest_motion(batch), given, found.box_std))
        self._order, self._given, self._causal = found.order, count, None
        if self._log is not None:
            self._log.add(batch, took(self, count), camera_moved(self), kept)
        if self._lag is not None:
            self._counted = *counted(batch, took(self, count), kept), camera_moved(self)
        if self._diagnostics:
            sensor = sensors_of(batch, codes)[found.order]
            self._boxes = StepBoxes(t, sensor, found.boxes.copy())
        self._count_classes(batch)
        if compared is not None:
            detection = np.arange(count, dtype=np.int64)
            self._appearance = remember(compared, self.assigned(count), detection, self._model.identities())

    def snapshot(self) -> ModelSnapshot:
        """Copy all that the next step depends on; the smoothers are not part of it."""
        return ModelSnapshot(
            *(self._model.snapshot(), self._engine_sensors, self._classes, self._appearance),
            *(self._order, self._given, self._boxes),
        )

    def restore(self, snapshot: ModelSnapshot) -> None:
        """Go back to a snapshot of this tracker."""
        (
            moment,
            self._engine_sensors,
            self._classes,
            self._appearance,
            self._order,
            self._given,
            self._boxes,
        ) = snapshot
        self._model.restore(moment)
        self._find_places()
        self._causal = None

    def reset(self, t: float) -> None:
        """End all tracks and let time go on from another moment, an earlier one too (s).

        Identities go on, and so does what was learnt of the scene: it is as if no time had passed.
        """
        if self._lag is not None and self.time is not None:
            self._lag.reset(self, t)
        self._model.reset(t)
        # The model has no last step now, so there are no boxes of one either.
        self._order, self._given = _NO_BOXES, 0
        self._boxes, self._causal = StepBoxes.none(), None
        self._instants.reset()

    def number_on_from(self, identity: int) -> None:
        """Give no track that begins from now on an identity below this."""
        self._model.number_on_from(identity)

    def assigned(self, count: int) -> IntArray:
        """Return which track took each of the `count` detections (M,) of the last step, 0 where none did."""
        out = np.zeros(count, dtype=np.int64)
        if count == self._given:
            out[self._order] = self._model.assigned()
        return out

    def appearance_of(self, identity: int) -> FloatArray | None:
        """Return what a living track looks like, as embeddings (E,); None where that is not known."""
        return None if self._appearance is None else self._appearance.of_track(identity)

    def living(self) -> tuple[IntArray, int]:
        """Return the identities (N,) of the living tracks, and that of the next one to be born."""
        return self._model.identities(), self._model.born() + 1

    def last_scans(self) -> dict[str, float]:
        """Return the time of each declared sensor's last scan (s), minus infinity before it."""
        times = np.nan_to_num(self._model.last_scans(), nan=-math.inf, neginf=-math.inf)
        never = dict.fromkeys(self.sensor_names, -math.inf)
        return never | dict(zip(self._engine_sensors, times.tolist(), strict=True))

    def meet(self, scans: Sequence[Scan]) -> None:
        """Have the configuration declare the sensors of some scans, if it lets it.

        Raises:
            UnknownSensorError: a name that is not declared and may not be, or too many sensors.
        """
        self._meet(scans)

    def _meet(self, scans: Sequence[Scan]) -> None:
        known = self.config.sensors
        if all(scan.sensor in known for scan in scans):
            return
        config = wider(self.config, (scan.sensor for scan in scans))
        if config is not None:
            self.config, self.sensor_names = config, config.sensor_names
            self._watch.know(config)
            self._find_places()
        for scan in scans:
            sensor_index(scan.sensor, self.sensor_names)

    def causal(self) -> Trajectories:
        """Return the tracks that are reported now, as the last step did: not the rows of earlier steps."""
        return self._causal_table()

    def _causal_table(self) -> Trajectories:
        if self._causal is None:
            parts = self._model.reported(), self._classes, self._form(), self.time
            self._causal = promised(partial(reported_table, *parts))
        return self._causal

    def rows_below_least(self) -> int:
        """Return how many rows of the last step `output.min_existence` left out of the table."""
        least = self.config.output.min_existence
        return 0 if least <= self.constants.report else int((self._model.rows()[4] < least).sum())

    def predict(self, t: float) -> Prediction:
        """Say where the tracks that are reported now will be at a time; nothing changes.

        Args:
            t: time (s), not before that of the last step.

        Raises:
            DataError: a time that is not finite.
            TimeOrderError: a time before that of the last step.
        """
        t = time_from(t, self.time)
        rows, covariance = self._model.predicted(t)
        rows, picture = with_classes(rows, self._classes, self._called), self._model.picture()
        table = self._table(rows)
        if picture is not None:
            table = table.take(np.isin(table.track_id, rows[1][still_there(rows, picture)]))
        return Prediction(**vars(table), cov=of_motion(covariance[np.isin(rows[1], table.track_id)]))

    def last_updates(self) -> Diagnostics:
        """Return what the last step gave to the tracks, those too that are not reported.

        Raises:
            JeatGraphError: the tracker was not made with `diagnostics`.
        """
        self._check_diagnostics()
        model = self._model
        measured = self._boxes._replace(sensor=self._places.at[self._boxes.sensor])
        return diagnostics_of(measured, model.assigned(), model.living(), model.fit(), self.sensor_names)

    def last_measurements(self) -> tuple[RecordArray, IntArray, BoolArray]:
        """Return what the last step gave to the tracks, for other smoothers.

        Returns:
            Records (M,) (`MEASUREMENT`), identities (N,) of the tracks, whether each is taken for real.

        Raises:
            JeatGraphError: the tracker was not made with `diagnostics`.
        """
        self._check_diagnostics()
        measured = self._boxes._replace(sensor=self._places.at[self._boxes.sensor])
        real = self._model.fit()[2]
        return self._model.measurements(measured), self._model.living(), real > self.constants.report

    def run(self, detections: Detections) -> Iterator[Trajectories]:
        """Step through a recording and yield the table of each time; scans of one time are taken jointly."""
        for batch in detections.batches():
            yield self.step(batch)

    def hypotheses(self) -> Hypotheses:
        """Return what the living tracks are taken for, and why (`jeat-graph explain`).

        Raises:
            JeatGraphError: the engine weighs none.
        """
        t = 0.0 if self.time is None else self.time
        return self._model.hypotheses(t, self.causal().track_id, self._engine_sensors)

    def learnt(self) -> dict[str, SensorState]:
        """Return what has been learnt of each sensor that has had a scan, by name; as `sensor_states`."""
        return self.sensor_states()

    def sensor_states(self) -> dict[str, SensorState]:
        """Return what has been learnt of each sensor that has had a scan, by name."""
        return dict(zip(self._engine_sensors, self._model.sensor_states(), strict=True))

    def step_record(self, taken: PendingStep) -> StepRecord:
        """Return how the filter went through a step that `take_in` returned, as every engine has it.

        Sensors are counted in the order of their first scans (`engine_sensors`).
        """
        return self._model.step_record(taken.record)

    @property
    def engine_sensors(self) -> tuple[str, ...]:
        """Names of the sensors that have had a scan, in the order in which the engine counts them."""
        return self._engine_sensors

    def _check_diagnostics(self) -> None:
        if not self._diagnostics:
            raise JeatGraphError("make the tracker with diagnostics=True for its updates")

    def _declare(self, batch: Sequence[Scan]) -> None:
        """Make the sensors of first scans known."""
        new = sorted({scan.sensor for scan in batch if scan.sensor not in self._engine_sensors})
        if len(self._engine_sensors) + len(new) > _MOST_SENSORS:
            raise DataError(f"at most {_MOST_SENSORS} sensors can be tracked together")
        for name in new:
            self._model.declare_sensor(name, self.config.sensors[name])
            self._engine_sensors = (*self._engine_sensors, name)
        if new:
            self._find_places()

    def _compare(self, embeddings: EmbeddingArray, sensor: IntArray) -> Compared:
        """Compare the embeddings (M, E) of a step's detections with the living tracks."""
        number = len(self._engine_sensors)
        before = self._appearance or Appearances.start(number, embeddings.shape[1])
        now = before.among(number).of(self._model.identities())
        return compare(now, embeddings, sensor, _MOST_SIMILARITY)

    def _count_classes(self, batch: Sequence[Scan]) -> None:
        """Let the boxes of a step vote for the classes of their tracks."""
        if self._classes is None and all(scan.classes is None for scan in batch):
            return
        self._class_ids = number_classes(self._class_ids, batch)
        votes = Votes.of_batch(batch, np.arange(self._given, dtype=np.int64))
        tally = self._classes or ClassTally.start()
        self._classes = tally.after(self._model.living(), self.assigned(self._given), votes)
        self._called += [name for name in self._classes.names.tolist() if name not in self._called]

    def _called_now(self) -> tuple[IntArray | None, FloatArray | None]:
        """Return numbers of the classes (N,) and their shares (N,) of the tracks of the last step."""
        if self._classes is None:
            return None, None
        called, share = self._classes.columns(self._model.living())
        number = {name: k for k, name in enumerate(self._called)}
        label = np.array([number.get(name, -1) for name in called.tolist()], dtype=np.int64)
        return label, np.nan_to_num(share)

    def _smoothed_table(self, rows: ModelRows) -> Trajectories:
        """Return rows of the smoother in order of time, then of identity."""
        return self._instants.of(self._table(in_order(rows)))

    def _table(self, rows: ModelRows) -> Trajectories:
        """Return rows as a table, whose sensors are those of the configuration."""
        return table_of(rows, self._form())

    def _form(self) -> TableForm:
        """Return the form of tables as it is now."""
        names = None if self._classes is None else ClassNames(tuple(self._called), self._class_ids)
        ends = self.config.output.clip and self._model.boxes_end_at_edge()
        clip = (self.config.image.width, self.config.image.height) if ends else None
        return TableForm(self.sensor_names, self._places, names, clip, self.config.output.min_existence)

    def _find_places(self) -> None:
        """Find out where the model's sensors stand among all."""
        self._places = Places([self.sensor_names.index(name) for name in self._engine_sensors])
