"""State of the reference tracker: the tracks in arrays, and what is learnt of sensors and scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Self

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters import (
    box_spread,
    camera_motion,
    gap_survival,
    object_probability,
    score_calibration,
    sensor_accuracy,
    sensor_offsets,
    singer,
)
from jeat_graph.filters.array_table import ArrayTable
from jeat_graph.filters.box_sides import SIDES
from jeat_graph.filters.camera_motion import CameraVariance
from jeat_graph.filters.camera_path import CameraPath
from jeat_graph.filters.evidence import Evidence
from jeat_graph.filters.gap_survival import GapCounts
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.object_probability import SensorBelief
from jeat_graph.filters.picture_motion import CameraVelocity
from jeat_graph.filters.score_calibration import RepeatCounts
from jeat_graph.filters.sensor_accuracy import AccuracySums
from jeat_graph.filters.sensor_offsets import OffsetSums
from jeat_graph.filters.singer import STATES, ProcessNoise
from jeat_graph.filters.visibility import seen


@dataclass(frozen=True, eq=False)
class ReferenceTracks(ArrayTable):
    """All living tracks, in ascending order of identity.

    Attributes:
        track_id: (N,) identities, from 1 on.
        mean: (N, 2, 7) per axis position (px), velocity (px/s), acceleration (px/s²), ln size, its rate
            (1/s), lasting errors of position (px) and of ln size.
        covariance: (N, 2, 7, 7).
        presence: (N, 3) probabilities of visible, hidden, gone.
        recent_hits, recent_misses: (N, S) with a memory, for the track's own P_D, in correlation times.
        last_box: (N, S, 4) the last box of each sensor (left, top, right, bottom in px), as it was given; 0
            before the first.
        last_box_s: (N, S) its time (s).
        apart: (N, S, S, 5) what a sensor's box differed by from another's, less their mean difference, and
            the sum of both aspects,
        apart_s: (N, S, S) its time (s),
        has_apart: (N, S, S) and whether there was one.
        innovation: (N, 4) the last normalised innovation of centre and ln size.
        has_innovation: (N,) whether there was one.
        evidence: what the posterior rests on.
        real: (N,) posterior of a real object, as of the last step.
        log_odds: (N,) its log odds.
        sees: (N, S) probability that a sensor is not blind to it as it moves now.
        used: (N,) bit k is set where sensor k has found it at the time of this step.
        given: (N,) whose boxes it takes where that is given, -1 for any that are nobody's.
        awaited: (N,) whether more boxes of its owner are to come.
    """

    PER_SENSOR: ClassVar[frozenset[str]] = frozenset(
        ("recent_hits", "recent_misses", "last_box", "last_box_s", "sees")
    )
    PER_PAIR: ClassVar[frozenset[str]] = frozenset(("apart", "apart_s", "has_apart"))

    track_id: IntArray
    mean: FloatArray
    covariance: FloatArray
    presence: FloatArray
    recent_hits: FloatArray
    recent_misses: FloatArray
    last_box: FloatArray
    last_box_s: FloatArray
    apart: FloatArray
    apart_s: FloatArray
    has_apart: BoolArray
    innovation: FloatArray
    has_innovation: BoolArray
    evidence: Evidence
    real: FloatArray
    log_odds: FloatArray
    sees: FloatArray
    used: IntArray
    given: IntArray
    awaited: BoolArray

    def __len__(self) -> int:
        return len(self.track_id)

    @classmethod
    def begun(cls, track_id: IntArray, mean: FloatArray, covariance: FloatArray, evidence: Evidence) -> Self:
        """Return tracks (M,) that have just begun with these states and this evidence."""
        number, sensors = evidence.hits.shape
        return cls(
            track_id=track_id,
            mean=mean,
            covariance=covariance,
            presence=seen(number),
            recent_hits=np.zeros((number, sensors)),
            recent_misses=np.zeros((number, sensors)),
            last_box=np.zeros((number, sensors, SIDES)),
            last_box_s=np.zeros((number, sensors)),
            apart=np.zeros((number, sensors, sensors, SIDES + 1)),
            apart_s=np.zeros((number, sensors, sensors)),
            has_apart=np.zeros((number, sensors, sensors), dtype=np.bool_),
            innovation=np.zeros((number, SIDES)),
            has_innovation=np.zeros(number, dtype=np.bool_),
            evidence=evidence,
            real=np.zeros(number),
            log_odds=np.zeros(number),
            sees=np.zeros((number, sensors)),
            used=np.int64(1) << evidence.owner,
            given=np.full(number, -1, dtype=np.int64),
            awaited=np.zeros(number, dtype=np.bool_),
        )

    @classmethod
    def none(cls) -> Self:
        """Return no tracks of no sensors."""
        state = np.zeros((0, 2, STATES)), np.zeros((0, 2, STATES, STATES))

        return cls.begun(np.zeros(0, dtype=np.int64), *state, Evidence.none(0))


class SensorScan(NamedTuple):
    """One scan of a sensor.

    Attributes:
        sensor: its index.
        boxes: (M, 4) left, top, right, bottom (px).
        logits: (M,) of their scores.
        similarity: (N, M) ln of how much more likely each box is of a track than of another by what both look
            like, of the first N tracks; None where nothing is known of that.
        edges: (M, 2, 2) by axis and side which end at the edge of the picture; `correct_boxes` writes it.
        owners: (M,) whose each box is, -1 for nobody's, at most one of each owner; None where the tracker
            decides.
        awaited: (M,) whether more boxes of its owner are to come; given with `owners`.
        spread: (M, 2, 2) by axis and side (σ/s)² as the detector says it (`box_spread`), NaN where unknown;
            or None.
    """

    sensor: int
    boxes: FloatArray
    logits: FloatArray
    similarity: FloatArray | None = None
    edges: BoolArray = np.zeros((0, 2, 2), dtype=np.bool_)
    owners: IntArray | None = None
    awaited: BoolArray | None = None
    spread: FloatArray | None = None


@dataclass
class ReferenceState:
    """Everything that the next step depends on; behind each field stands the stage that writes it.

    Attributes:
        tracks: the living tracks.
        t: time of the last step (s); None before the first. `predict`
        reset_s: moment that time was last to go on from (s); None before it was to. `reset`
        next_id: identity of the next track. `begin_tracks`
        picture: width and height (px); 1 x 1 and growing with the boxes where it is not known. `begin_scan`
        picture_known: whether it is.
        process_noise: of the scene. `learn_noise`
        camera: variances of the camera's motion. `follow_camera`
        camera_velocity: its velocity as the last picture showed it. `follow_picture`
        camera_path: where its motion takes what is at rest. `predict`, `follow_picture`, `follow_camera`
        gaps: how gaps ended. `count_gaps`, and `end_tracks` for those that never end
        sensors: what is believed of each. `learn`; decision thresholds: `begin_scan`
        ended: evidence of the last tracks that ended. `end_tracks`
        learnt_s: when sensors were learnt last (s). `learn`
        offsets: what two sensors' boxes differ by. `compare_sensors`
        accuracy: what lasts of the sensors' errors. `compare_sensors`, `learn`
        log_side_variance: (S,) ln ρ² of the sensors' sides. `learn_noise`
        mean_spread: (S,) mean of (σ/s)² of their boxes, NaN where none is known. `learn_noise`
        leftovers: (S,) running mean of boxes a scan that no track takes. `count_clutter`
        false_boxes: (S,) the same of boxes that are of nothing real. `count_false_boxes`
        period_s: (S,) running mean of the time between two scans (s); NaN before the second. `begin_scan`
        last_scan_s: (S,) time of the last scan (s); NaN before it. `begin_scan`
        boxes_at_edge, boxes_beyond: (S,) boxes that end at the edge of the picture, and beyond it.
            `begin_scan`
        repetition: of S sensors, which boxes come again. `begin_scan`
        even_logit: (S,) logit of the score at which the user says that a box is as likely real as not; NaN
            where it is learnt.
        given_weight: (S,) weight of its scores as the user says; NaN where it is learnt.
        given_lasting: (S,) variance of what lasts of its errors, as the user says (sizes²); NaN where it is
            learnt.
    """

    tracks: ReferenceTracks
    t: float | None
    reset_s: float | None
    next_id: int
    picture: tuple[float, float]
    picture_known: bool
    process_noise: ProcessNoise
    camera: CameraVariance
    camera_velocity: CameraVelocity
    camera_path: CameraPath
    gaps: GapCounts
    sensors: SensorBelief
    ended: Evidence
    learnt_s: float
    offsets: OffsetSums
    accuracy: AccuracySums
    log_side_variance: FloatArray
    mean_spread: FloatArray
    leftovers: FloatArray
    false_boxes: FloatArray
    period_s: FloatArray
    last_scan_s: FloatArray
    boxes_at_edge: FloatArray
    boxes_beyond: FloatArray
    repetition: tuple[RepeatCounts, ...]
    even_logit: FloatArray
    given_weight: FloatArray
    given_lasting: FloatArray

    @property
    def time(self) -> float:
        """Time that the tracks are predicted to (s)."""
        assert self.t is not None, "tracks are predicted before anything else"
        return self.t

    def log_noise(self, c: ModelConstants) -> FloatArray:
        """Return ln of the variances (S,) of the sensors' sides, as the filter takes them."""
        compared = self.offsets.weight.sum(axis=1)
        return sensor_accuracy.log_noise(self.log_side_variance, compared, self.accuracy.lasting, c)

    def spread_gains(self) -> FloatArray:
        """Return f² (S,), by which the sensors' own variances of sides are taken."""
        pairs = zip(self.log_side_variance.tolist(), self.mean_spread.tolist(), strict=True)
        return np.array([box_spread.gain(*pair) for pair in pairs])

    def noise_of(self, scan: SensorScan, c: ModelConstants) -> FloatArray:
        """Return the mean variance (M,) of each box's sides, in sizes²."""
        k, noise = scan.sensor, math.exp(self.log_noise(c)[scan.sensor])
        if scan.spread is None:
            return np.full(len(scan.boxes), noise)
        own = float(self.log_side_variance[k]), float(self.spread_gains()[k])
        return box_spread.mean_noise(noise, scan.spread, *own)

    def spread_of(self, scan: SensorScan, size: FloatArray) -> FloatArray | None:
        """Return what the variances of a scan's sides are more by its own spreads (..., M, 2, 2), in px².

        Args:
            scan: of M boxes.
            size: (..., M or 1, 2) width and height of the objects (px).
        """
        if scan.spread is None:
            return None
        k, own = scan.sensor, scan.boxes[:, 2:] - scan.boxes[:, :2]
        noise = float(self.log_side_variance[k]), float(self.spread_gains()[k])
        return box_spread.more_variance(scan.spread, own, size, *noise)

    def log_scene_variance(self, c: ModelConstants) -> float:
        """Return the mean of these over sensors that have had a scan: the scale of lasting errors."""
        return float(self.log_noise(c)[~np.isnan(self.last_scan_s)].mean())

    @property
    def num_sensors(self) -> int:
        """Number of sensors that have been declared."""
        return len(self.repetition)


def initial_state(picture: tuple[float, float] | None, c: ModelConstants) -> ReferenceState:
    """Return the state before the first scan, of no sensor; `picture` is width and height (px) if known."""
    none = np.zeros(0)
    return ReferenceState(
        tracks=ReferenceTracks.none(),
        t=None,
        reset_s=None,
        next_id=1,
        picture=(1.0, 1.0) if picture is None else picture,
        picture_known=picture is not None,
        process_noise=singer.initial_process_noise(c),
        camera=camera_motion.initial_variance(c),
        camera_velocity=CameraVelocity.none(),
        camera_path=CameraPath.none(),
        gaps=gap_survival.no_gaps(),
        sensors=SensorBelief.of_none(c.noise_share),
        ended=Evidence.none(0),
        learnt_s=-math.inf,
        offsets=sensor_offsets.no_offsets(),
        accuracy=sensor_accuracy.no_accuracy(),
        log_side_variance=none,
        mean_spread=none,
        leftovers=none,
        false_boxes=none,
        period_s=none,
        last_scan_s=none,
        boxes_at_edge=none,
        boxes_beyond=none,
        repetition=(),
        even_logit=none,
        given_weight=none,
        given_lasting=none,
    )


def declare_sensor(
    state: ReferenceState,
    c: ModelConstants,
    even_logit: float = math.nan,
    score_weight: float = math.nan,
    lasting: float = math.nan,
    stationary_prior: float | None = None,
) -> None:
    """Add a sensor without a scan yet, of which what is usual is believed but for what the user says."""
    weight = 1.0 if math.isnan(score_weight) else score_weight
    new, old = object_probability.initial_sensor(c, weight, stationary_prior), state.sensors
    columns = (np.append(a, b) for a, b in zip(old[:-1], new[:-1], strict=True))
    state.sensors = SensorBelief._make([*columns, old.noise_share])
    state.tracks, state.ended = state.tracks.widened(), state.ended.widened()
    state.offsets = sensor_offsets.widened(state.offsets)
    state.log_side_variance = np.append(state.log_side_variance, 2.0 * math.log(c.side_std))
    state.mean_spread = np.append(state.mean_spread, np.nan)
    state.leftovers = np.append(state.leftovers, c.first_leftovers)
    state.false_boxes = np.append(state.false_boxes, c.first_leftovers)
    state.period_s = np.append(state.period_s, np.nan)
    state.last_scan_s = np.append(state.last_scan_s, np.nan)
    state.boxes_at_edge = np.append(state.boxes_at_edge, 0.0)
    state.boxes_beyond = np.append(state.boxes_beyond, 0.0)
    state.repetition = (*state.repetition, score_calibration.no_repetition())
    state.even_logit = np.append(state.even_logit, even_logit)
    state.given_weight = np.append(state.given_weight, score_weight)
    state.given_lasting = np.append(state.given_lasting, lasting)
    state.accuracy = sensor_accuracy.widened(state.accuracy, 0.0 if math.isnan(lasting) else lasting)
