"""Which track takes which detection of one instant."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.association.costs import likelihood_cost, log_evidence
from jeat_graph.association.densities import Likelihood
from jeat_graph.association.gates import Expected, Found, Pairs, gated_pairs
from jeat_graph.association.joint import associate_joint, associate_sequential, associate_slots
from jeat_graph.association.methods import JOINT, SLOTS
from jeat_graph.config.kernel_form import Model
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.stages.inner import inner
from jeat_graph.tracking.stages.predicting import Expectation
from jeat_graph.tracking.state import SceneState, TrackArrays


class Association(NamedTuple):
    """Which of the n tracks takes which of the M detections.

    Attributes:
        match: (n, S) detection that each track takes of each sensor, or -1.
        evidence: (n, S) its ln Λ.
        taken: (M,) 1 where a track has taken the detection, else 0; filled while they are taken in.
    """

    match: IntArray
    evidence: FloatArray
    taken: IntArray


@inner
def judge_pairs(
    tracks: TrackArrays,
    n: int,
    batch: Batch,
    expectation: Expectation,
    p_detect: FloatArray,
    scene: SceneState,
    model: Model,
) -> tuple[Pairs, FloatArray]:
    """List the pairs of the first `n` tracks and a batch inside the gates, and the evidence ln Λ of each."""
    sensors, settings = model.sensors, model.settings.association
    pairs = gated_pairs(
        Expected(
            expectation.centre,
            expectation.var,
            expectation.white,
            tracks.size_mean[:n, :, 0],
            tracks.size_cov[:n, :, 0, 0],
            sensors.size_var,
            tracks.cut[:n],
        ),
        Found(batch.z, batch.log_size, batch.weight, batch.sensor, batch.cut, batch.side),
        Likelihood(settings.tail_freedom, settings.log_size_range),
        settings.gate_bound,
        settings.size_gate_bound,
    )
    log_clutter = np.empty(len(sensors.sigma_px))
    for s in range(len(log_clutter)):
        log_clutter[s] = math.log(scene.clutter[s]) - model.settings.log_clutter_volume
    return pairs, log_evidence(pairs, p_detect, batch.log_score, log_clutter, batch.sensor)


@inner
def associate(
    tracks: TrackArrays,
    n: int,
    batch: Batch,
    expectation: Expectation,
    p_detect: FloatArray,
    scene: SceneState,
    model: Model,
) -> Association:
    """Associate a batch with the first `n` tracks, predicted to its time; nothing counts as taken yet."""
    settings, num_sensors = model.settings.association, len(model.sensors.sigma_px)
    pairs, pair_evidence = judge_pairs(tracks, n, batch, expectation, p_detect, scene, model)
    rows, cols = pairs.rows, pairs.cols
    if settings.by_likelihood:
        judged = pair_evidence.copy()
        if len(batch.alike):  # who looks like whom says nothing of false boxes, so only here
            for p in range(len(rows)):
                judged[p] += batch.alike[rows[p], cols[p]]
        costs = likelihood_cost(rows, cols, judged, tracks.existence, p_detect, batch.sensor)
    else:
        costs = pairs.d2
    unassigned = settings.unassigned_cost
    if settings.method_code == SLOTS:
        match = associate_slots(n, num_sensors, rows, cols, costs, batch.sensor, unassigned)
    elif settings.method_code == JOINT:
        match = associate_joint(n, num_sensors, rows, cols, costs, batch.sensor, unassigned)
    else:
        match = associate_sequential(
            n, num_sensors, rows, cols, costs, batch.sensor, unassigned, model.priority
        )
    evidence = np.zeros((n, num_sensors))
    for p in range(len(rows)):
        s = batch.sensor[cols[p]]
        if match[rows[p], s] == cols[p]:
            evidence[rows[p], s] = pair_evidence[p]
    return Association(match, evidence, np.zeros(len(batch.sensor), dtype=np.int64))
