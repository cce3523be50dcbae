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
from jeat_graph.filters.object_probability import LogOddsTerms, SensorBelief, log_odds_terms
from jeat_graph.filters.visibility import VISIBLE


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


def hypotheses_of(
    columns: Mapping[str, Any],
    belief: SensorBelief,
    constants: ModelConstants,
    t: float,
    shown: IntArray,
    sensors: tuple[str, ...],
) -> Hypotheses:
    """Collect what is believed of tracks.

    Args:
        columns: of the living tracks, by name, as the model's `tracks` returns them.
        belief: what is believed of the sensors.
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
    )
