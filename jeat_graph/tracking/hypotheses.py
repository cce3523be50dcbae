"""What a tracker takes its tracks for, and why: the terms of each track's log odds of being real."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.evidence import Evidence
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.filters.object_probability import (
    LogOddsTerms,
    SensorBelief,
    log_odds_terms,
    sensor_effects,
)
from jeat_graph.filters.visibility import VISIBLE


class SensorEffect(NamedTuple):
    """What is known of a sensor did to a track.

    Attributes:
        sensor: its name.
        stood: by how much it changed the log odds that it may not see what stands.
        scores: by how much the weight of its scores did, given or because others contradict them.
        exactness: what a box of it counts of one of the most exact sensor: their variances' ratio.
        most_exact: the name of that one.
    """

    sensor: str
    stood: float
    scores: float
    exactness: float
    most_exact: str


class Hypotheses(NamedTuple):
    """The living tracks of one step, those too that are not reported.

    Attributes:
        sensors: names of the S sensors, in the order of the columns of `terms`.
        track_id: (N,) identities.
        boxes: (N, 4) left, top, width, height (px).
        log_odds: (N,) of being real, as the tracker has it.
        terms: their sum is `log_odds`, but for what was learnt since the last step.
        visible: (N,) probability that the object is there and not hidden.
        unseen_s: (N,) time since the last detection that confirmed it (s).
        detections: (N,) number of its detections.
        reported: (N,) whether the tables have it.
        side_std: (S,) standard deviation of a sensor's sides, as the filter takes it (sizes).
        evidence: what the log odds rest on.
        belief: what is believed of the sensors.
        constants: of the model.
    """

    sensors: tuple[str, ...]
    track_id: IntArray
    boxes: FloatArray
    log_odds: FloatArray
    terms: LogOddsTerms
    visible: FloatArray
    unseen_s: FloatArray
    detections: FloatArray
    reported: BoolArray
    side_std: FloatArray
    evidence: Evidence
    belief: SensorBelief
    constants: ModelConstants

    def effects(self, row: int) -> list[SensorEffect]:
        """Return what is known of each sensor did to one track: to its log odds, and to its place."""
        one = self.evidence.take(np.array([row]))
        stood, scores = sensor_effects(one, self.belief, self.constants)
        most_exact = int(np.argmin(self.side_std))
        return [
            SensorEffect(
                name,
                float(stood[0, k]),
                float(scores[0, k]),
                float((self.side_std[most_exact] / self.side_std[k]) ** 2),
                self.sensors[most_exact],
            )
            for k, name in enumerate(self.sensors)
        ]


def hypotheses_of(
    columns: Mapping[str, Any],
    belief: SensorBelief,
    side_std: FloatArray,
    constants: ModelConstants,
    t: float,
    shown: IntArray,
    sensors: tuple[str, ...],
) -> Hypotheses:
    """Collect what is believed of tracks.

    Args:
        columns: of the living tracks, by name, as the model's `tracks` returns them.
        belief: what is believed of the sensors.
        side_std: (S,) of their boxes' sides (sizes).
        constants: of the model.
        t: time of the last step (s).
        shown: (R,) identities of the tracks that are reported.
        sensors: names of the sensors as the model counts them.
    """
    evidence = Evidence(
        **{
            f.name: np.asarray(columns[f.name]).reshape(
                (-1, len(sensors)) if f.name in Evidence.PER_SENSOR else -1
            )
            for f in fields(Evidence)
        }
    )
    track_id = np.asarray(columns["track_id"]).reshape(-1)
    mean = np.asarray(columns["mean"]).reshape(len(track_id), 2, singer.STATES)
    sides = box_sides.corners(mean)
    return Hypotheses(
        sensors=sensors,
        track_id=track_id,
        boxes=np.concatenate([sides[:, :2], singer.box_size(mean)], axis=1),
        log_odds=np.asarray(columns["log_odds"]).reshape(-1),
        terms=log_odds_terms(evidence, belief, constants),
        visible=np.asarray(columns["presence"])[:, VISIBLE],
        unseen_s=t - evidence.confirmed_s,
        detections=evidence.detections,
        reported=np.isin(track_id, shown),
        side_std=side_std,
        evidence=evidence,
        belief=belief,
        constants=constants,
    )
