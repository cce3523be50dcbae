"""What the core and the reference have in common: both are the one model, in C++ and in NumPy."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.special import expit

from jeat_graph.config.schema import Config
from jeat_graph.config.sensors import EVENT, SensorConfig
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.filters import singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.object_probability import SensorBelief
from jeat_graph.filters.score_calibration import logit
from jeat_graph.smoothers.histories import Existence
from jeat_graph.smoothers.rows import ModelRows, RowOutput
from jeat_graph.tracking.engine import StepBoxes
from jeat_graph.tracking.hypotheses import Hypotheses, hypotheses_of
from jeat_graph.tracking.model_measured import records_of
from jeat_graph.tracking.prediction import predicted
from jeat_graph.tracking.record_smoothing import SmoothsRecords, histories_of
from jeat_graph.tracking.sensor_state import SensorState


class Learnt(NamedTuple):
    """What is believed of S sensors and the scene.

    Attributes:
        belief: of the sensors.
        log_side_variance: (S,) ln of the variances of their boxes' sides, as the filter takes them.
        log_own_variance: (S,) ln ρ², without what lasts,
        spread_gain: (S,) and f² of the spreads that they give with their boxes (`box_spread`); 1
            without any.
        lasting_error: (S,) standard deviation of what of their errors lasts (sizes).
        log_scene_variance: the same of the scene; 0 before the first scan.
        leftovers: (S,) mean number of boxes in a scan that no track takes,
        false_boxes: (S,) and that are of nothing real.
        offsets: (S, 4) of the boxes, as `sensor_offsets` has them.
        boxes_at_edge: (S,) number of boxes that end at the edge of the picture,
        boxes_beyond: (S,) and that reach beyond it.
        process_noise: of the scene.
    """

    belief: SensorBelief
    log_side_variance: FloatArray
    log_own_variance: FloatArray
    spread_gain: FloatArray
    lasting_error: FloatArray
    log_scene_variance: float
    leftovers: FloatArray
    false_boxes: FloatArray
    offsets: FloatArray
    boxes_at_edge: FloatArray
    boxes_beyond: FloatArray
    process_noise: singer.ProcessNoise


def row_output(c: ModelConstants) -> RowOutput:
    """Return how tables report the states of the model."""
    return RowOutput(partial(singer.reported_motion, c=c), partial(singer.reported_covariance, c=c))


def given_of(declared: SensorConfig, constants: ModelConstants) -> tuple[float, float, float, float]:
    """Return what a user says of a sensor, as engines take it.

    The logit of the score at which a box is as likely real as not, NaN where it is to be learnt; the weight
    of its scores, NaN likewise; the variance of its lasting error (sizes²), NaN where it is to be learnt; the
    prior share of objects that it does not see while they stand, by what it is.
    """
    even = math.nan if declared.even_score is None else float(logit(np.array(declared.even_score)))
    lasting = math.nan if declared.lasting_error is None else declared.lasting_error**2
    is_event = declared.kind == EVENT
    blind = constants.event_stationary_unseen_share if is_event else constants.stationary_unseen_share
    weight = math.nan if declared.score_weight is None else declared.score_weight
    return even, weight, lasting, blind


class OneModel(SmoothsRecords):
    """What follows from the state of the model, whoever computes it.

    Args:
        constants: of the model.
        config: of which the smoother matters here.
        by_records: whether its records are smoothed here.
    """

    #: What an engine of the model has; see `TrackEngine`.
    has_fit = True
    weighs = True
    compares_appearance = True
    takes_owners = True

    def __init__(self, constants: ModelConstants, config: Config, by_records: bool = True) -> None:
        output, existence = row_output(constants), Existence(constants)
        super().__init__(histories_of(config, existence, output) if by_records else None)
        self.constants = constants

    @abstractmethod
    def learnt(self) -> Learnt:
        """Return what is believed of the sensors and the scene."""

    @abstractmethod
    def camera_moved(self) -> FloatArray:
        """Return how far the camera's motion has taken a point at rest (2,) (px)."""

    @abstractmethod
    def tracks(self) -> Mapping[str, Any]:
        """Return the columns of the living tracks by name."""

    @abstractmethod
    def rows(self) -> ModelRows:
        """Return the tracks that the last step reports."""

    @abstractmethod
    def states(self) -> tuple[FloatArray, FloatArray]:
        """Return their states: means (N, 14), and covariances (N, 98): two axes of 7 x 7."""

    @abstractmethod
    def assigned(self) -> IntArray:
        """Return the identity of the track (M,) that took each box of the last step."""

    @abstractmethod
    def fit(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how well the boxes of the last step fitted; see `TrackEngine.fit`."""

    def predicted(self, t: float) -> tuple[ModelRows, FloatArray]:
        """Return the reported tracks at a later time; see `TrackEngine.predicted`."""
        learnt = self.learnt()
        noise = learnt.process_noise, learnt.log_scene_variance
        return predicted(self.rows(), self.states(), t, noise, self.constants)

    def sensor_states(self) -> list[SensorState]:
        """Return what has been learnt of each sensor."""
        learnt, belief = self.learnt(), self.learnt().belief
        noise = np.exp(learnt.log_side_variance) / self.constants.side_std**2
        believed = 1.0 / (1.0 + np.exp(-belief.prior_odds))
        offsets = learnt.offsets.tolist()
        return [
            SensorState(
                clutter=float(learnt.false_boxes[k]),
                p_detect=float(belief.p_detect[k]),
                precision=float(believed[k]),
                unseen=float(belief.unseen[k]),
                stationary_unseen=float(belief.stationary_unseen[k]),
                noise_scale=float(noise[k]),
                lasting_error=float(learnt.lasting_error[k]),
                score_weight=float(belief.score_weight[k]),
                even_score=float(expit(belief.decision_threshold[k])),
                spread_factor=float(np.sqrt(learnt.spread_gain[k])),
                offset_centre_share=(offsets[k][0], offsets[k][1]),
                offset_log_size=(offsets[k][2], offsets[k][3]),
            )
            for k in range(len(noise))
        ]

    def measurements(self, measured: StepBoxes) -> RecordArray:
        """Return the boxes of the last step as the filter weighed them; see `TrackEngine.measurements`."""
        return records_of(measured, self.assigned(), self.fit(), self.learnt().process_noise, self.constants)

    def hypotheses(self, t: float, shown: IntArray, sensors: tuple[str, ...]) -> Hypotheses:
        """Return what the living tracks are taken for, and why; see `TrackEngine.hypotheses`."""
        learnt = self.learnt()
        side_std = np.exp(0.5 * learnt.log_side_variance)
        return hypotheses_of(self.tracks(), learnt.belief, side_std, self.constants, t, shown, sensors)
