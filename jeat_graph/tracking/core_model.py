"""The model in C++ as an engine: `tracker.engine=core`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.core import tracking as core
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters import singer
from jeat_graph.filters.gap_survival import GapCounts
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.object_probability import SensorBelief
from jeat_graph.filters.score_calibration import logit
from jeat_graph.smoothers.histories import StepRecord
from jeat_graph.smoothers.rows import ModelRows
from jeat_graph.smoothers.state_rts import FilterRecord
from jeat_graph.tracking.engine import Moment, Recorded, StepInput
from jeat_graph.tracking.one_model import Learnt, OneModel, given_of
from jeat_graph.tracking.record_smoothing import by_gtsam, lag_of

#: Under which name a saved state has what GTSAM smooths.
_RECORDS = "records"


class CoreModel(OneModel):
    """The compiled model.

    Args:
        constants: of the model.
        config: the picture, if it is given there, and the smoother.
    """

    name = "core"
    can_save = True

    def __init__(self, constants: ModelConstants, config: Config) -> None:
        known = config.input.picture == "given"
        size = (float(config.image.width), float(config.image.height)) if known else (1.0, 1.0)
        by_records = by_gtsam(config)
        # What GTSAM smooths is recorded only; the core's own pass never gets it.
        self._model = core.Model(constants, *size, known, math.inf if by_records else lag_of(config))
        super().__init__(constants, config, by_records)

    def declare_sensor(self, name: str, declared: SensorConfig) -> None:
        """Add a sensor that has had no scan yet."""
        self._model.declare_sensor(*given_of(declared, self.constants))

    def take(self, inputs: StepInput) -> None:
        """Take in the scans of one time."""
        similarity = None if inputs.similarity is None else np.ascontiguousarray(inputs.similarity)
        owners = None if inputs.owners is None else np.ascontiguousarray(inputs.owners)
        boxes, logits = np.ascontiguousarray(inputs.boxes), logit(inputs.scores)
        box_std = None if inputs.box_std is None else np.ascontiguousarray(inputs.box_std)
        found = inputs.sensors, inputs.numbers, boxes, logits
        self._model.take(inputs.t, *found, similarity, inputs.motion, owners, box_std)

    def reset(self, t: float) -> None:
        """End all tracks and go on from another time (s)."""
        if self._histories is not None:
            self._histories.end_all(GapCounts(*self._model.gaps()))
        self._model.reset(t)

    def number_on_from(self, identity: int) -> None:
        """Give no new track a smaller identity."""
        self._model.number_on_from(identity)

    def snapshot(self) -> Moment:
        """Return a copy of all that the next step depends on."""
        return self._model.snapshot()

    def restore(self, moment: Moment) -> None:
        """Go back to a snapshot."""
        self._model.restore(_own_moment(moment))

    def time(self) -> float | None:
        """Return the time of the last step (s)."""
        return self._model.time()

    def size(self) -> int:
        """Return the number of living tracks."""
        return self._model.size()

    def born(self) -> int:
        """Return the number of tracks started so far."""
        return self._model.born()

    def identities(self) -> IntArray:
        """Return the identities (N,) of the living tracks."""
        return self._model.identities()

    def living(self) -> IntArray:
        """Return the identities (N,) of the tracks of the last step, before any ended."""
        return self._model.living()

    def assigned(self) -> IntArray:
        """Return the identity of the track (M,) that took each box of the last step."""
        return self._model.assigned()

    def rows(self) -> ModelRows:
        """Return the tracks that the last step reports."""
        return self._model.rows()

    def reported(self) -> Callable[[], ModelRows]:
        """Return a function that gives these rows, after later steps too."""
        return self._model.reported().columns

    def states(self) -> tuple[FloatArray, FloatArray]:
        """Return their means (N, 14) and covariances (N, 98)."""
        return self._model.states()

    def fit(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how well the boxes of the last step fitted."""
        return self._model.fit()

    def last_scans(self) -> FloatArray:
        """Return the time of each sensor's (S,) last scan (s)."""
        return self._model.last_scans()

    def picture(self) -> tuple[float, float] | None:
        """Return width and height of the picture (px), as far as is known."""
        return self._model.picture()

    def camera_moved(self) -> FloatArray:
        """Return how far the camera's motion has taken a point at rest (2,) (px)."""
        return self._model.camera_moved()

    def boxes_end_at_edge(self) -> bool:
        """Return whether boxes end at the edge of the picture more often than they reach beyond it."""
        return self._model.boxes_end_at_edge()

    def tracks(self) -> Mapping[str, Any]:
        """Return the columns of the living tracks by name."""
        return self._model.tracks()

    def learnt(self) -> Learnt:
        """Return what is believed of the sensors and the scene."""
        learnt = self._model.learnt()
        column = {name: _column(learnt[name]) for name in learnt.keys() - {"process_noise"}}
        return Learnt(
            belief=SensorBelief(
                p_detect=column["p_detect"],
                unseen=column["unseen"],
                stationary_unseen=column["stationary_unseen"],
                decision_threshold=column["decision_threshold"],
                prior_odds=column["prior_odds"],
                agreed_mean=column["agreed_mean"],
                agreed_std=column["agreed_std"],
                agreed_share=column["agreed_share"],
                score_weight=column["score_weight"],
                stationary_prior=column["stationary_prior"],
                noise_share=float(column["noise_share"]),
            ),
            log_own_variance=column["log_own_variance"],
            spread_gain=column["spread_gain"],
            log_side_variance=column["log_side_variance"],
            lasting_error=np.sqrt(column["lasting"]),
            log_scene_variance=float(column["log_scene_variance"]),
            leftovers=column["leftovers"],
            false_boxes=column["false_boxes"],
            offsets=column["offsets"],
            boxes_at_edge=column["boxes_at_edge"],
            boxes_beyond=column["boxes_beyond"],
            process_noise=singer.ProcessNoise(*_column(learnt["process_noise"]).tolist()),
        )

    def record(self) -> Recorded:
        """Return what the last step gave the smoother; once."""
        return self._model.record()

    def step_record(self, record: Recorded) -> StepRecord:
        """Return the states of a step."""
        own = _own_record(record)
        t, is_reset, real, used, confirmed, missed, kept, later = own.fields()
        codes, counts, born_before, *states = own.scans(self._model)
        ids = own.track_ids()
        starts, scans = np.concatenate([[0], np.cumsum(counts)]).tolist(), []
        for number, code in enumerate(codes.tolist()):
            F, *columns = (column[starts[number] : starts[number + 1]] for column in states)
            before, before_cov, after, after_cov = columns
            took = (before != after).any(axis=1) | (before_cov != after_cov).any(axis=1)
            took[born_before[number] :] = True  # what begins with a box has no prediction
            known = len(took)
            shape = (known, 2, singer.STATES)
            square = (*shape, singer.STATES)
            scans.append(
                FilterRecord(
                    ids[:known],
                    F.reshape(known, 1, singer.STATES, singer.STATES),
                    before.reshape(shape),
                    before_cov.reshape(square),
                    after.reshape(shape),
                    after_cov.reshape(square),
                    np.where(took, code, -1),
                )
            )
        return StepRecord(
            t=t,
            is_reset=is_reset,
            track_id=ids,
            scans=scans,
            real=real,
            used=used,
            confirmed=confirmed.astype(np.bool_),
            missed=missed,
            later=later,
            kept=kept.astype(np.bool_),
            gaps=GapCounts(*own.gaps()),
            gaps_after=GapCounts(*own.gaps_after()),
        )

    def hand_over(
        self,
        record: Recorded | None = None,
        given: IntArray | None = None,
        label: IntArray | None = None,
        share: FloatArray | None = None,
    ) -> None:
        """Tell the smoother of a step."""
        if self._histories is not None:
            super().hand_over(record, given, label, share)
            return
        own = None if record is None else _own_record(record)
        self._model.hand_over(own, given, label, share)

    def forget(self, track_id: IntArray, until: FloatArray) -> None:
        """Have no smoothed rows of tracks up to a time each."""
        if self._histories is None:
            self._model.forget(track_id, until)
        else:
            super().forget(track_id, until)

    def smoothed(self) -> ModelRows:
        """Return the smoothed rows so far."""
        return self._model.smoothed() if self._histories is None else super().smoothed()

    def drain(self) -> ModelRows:
        """Return the smoothed rows that have become final, and forget them."""
        return self._model.drain() if self._histories is None else super().drain()

    def finish(self) -> ModelRows:
        """End all tracks and return the smoothed rows."""
        return self._model.finish() if self._histories is None else super().finish()

    def state(self, moment: Moment | None = None) -> Mapping[str, Any]:
        """Return all as arrays by name."""
        state = self._model.state(None if moment is None else _own_moment(moment))
        return state if self._histories is None else {**state, _RECORDS: self._histories.state()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state` returned."""
        own = dict(state)
        records = own.pop(_RECORDS, None)
        if (records is None) != (self._histories is None):
            raise ValueError("it is of another smoother")
        self._model.set_state(own)
        if self._histories is not None:
            self._histories.set_state(records)


def _own_record(record: Recorded) -> core.Record:
    if not isinstance(record, core.Record):
        raise TypeError("this record is of another engine")
    return record


def _own_moment(moment: Moment) -> core.Moment:
    if not isinstance(moment, core.Moment):
        raise TypeError("this snapshot is of another engine")
    return moment


def _column(values: object) -> FloatArray:
    return np.asarray(values, dtype=np.float64)
