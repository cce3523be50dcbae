"""Which track takes which detection of one instant."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.association.boxes import clip_boxes, track_boxes
from jeat_graph.association.costs import likelihood_cost, log_evidence
from jeat_graph.association.densities import Likelihood
from jeat_graph.association.gates import Expected, Found, Pairs, gated_pairs
from jeat_graph.association.joint import associate_joint, associate_sequential, associate_slots
from jeat_graph.association.methods import JOINT, SLOTS
from jeat_graph.association.overlap import overlap
from jeat_graph.config.kernel_form import Model, Settings
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.stages.inner import inlined, inner
from jeat_graph.tracking.stages.predicting import Expectation
from jeat_graph.tracking.state import SceneState, TrackArrays


class Association(NamedTuple):
    """Which of the n tracks takes which of the M detections.

    Attributes:
        match: (n, S) detection that each track takes of each sensor, or -1.
        evidence: (n, S) its ln Λ.
        taken: (M,) 1 where a track has taken the detection, else 0; second views and births add to it.
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
            expectation.lasting,
            expectation.white,
            expectation.coloured_std,
            tracks.size_mean[:n, :, 0],
            tracks.size_cov[:n, :, 0, 0],
            sensors.size_var,
            tracks.cut[:n],
        ),
        Found(batch.z, batch.log_size, batch.weight, batch.spread, batch.sensor, batch.cut, batch.side),
        Likelihood(settings.tail_freedom, settings.log_size_range),
        settings.gate_bound,
        settings.size_gate_bound,
    )
    if np.max(sensors.least_overlap) > 0.0:
        pairs = _fitting(pairs, tracks, n, batch, model)
    log_clutter = np.empty(len(sensors.sigma_px))
    for s in range(len(log_clutter)):
        log_clutter[s] = math.log(scene.clutter[s]) - model.settings.log_clutter_volume
    return pairs, log_evidence(pairs, p_detect, batch.log_score, log_clutter, batch.sensor)


@inner
def shown_boxes(tracks: TrackArrays, n: int, settings: Settings) -> FloatArray:
    """Boxes (n, 4) of the first `n` tracks; where boxes may be cut, the part in the picture."""
    boxes = track_boxes(tracks.mean[:n], tracks.size_mean[:n])
    image = settings.image
    return clip_boxes(boxes, image.width, image.height) if image.edge_px > 0.0 else boxes


@inner
def _fitting(pairs: Pairs, tracks: TrackArrays, n: int, batch: Batch, model: Model) -> Pairs:
    """Leave out the pairs whose boxes fit less than the sensor's do that are right (`least_overlap`).

    A sensor whose boxes are mostly right where another's are like them, and mostly wrong elsewhere, says
    little where it disagrees; its noise, the same for all of its boxes, would let it draw the track off. What
    it alone has seen is left to it.
    """
    boxes = shown_boxes(tracks, n, model.settings)
    fit = np.ones(len(pairs.rows), dtype=np.bool_)
    for p in range(len(fit)):
        i, j = pairs.rows[p], pairs.cols[p]
        least = model.sensors.least_overlap[batch.sensor[j]]
        if least > 0.0 and tracks.seen_by[i] & ~(1 << batch.sensor[j]):
            fit[p] = overlap(batch.boxes[j], boxes[i]) >= least
    return Pairs(
        pairs.rows[fit], pairs.cols[fit], pairs.d2[fit], pairs.log_density[fit], pairs.log_size_density[fit]
    )


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
    """Associate a batch with the first `n` tracks, predicted to its time."""
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
    evidence, taken = np.zeros((n, num_sensors)), np.zeros(len(batch.sensor), dtype=np.int64)
    for p in range(len(rows)):
        s = batch.sensor[cols[p]]
        if match[rows[p], s] == cols[p]:
            evidence[rows[p], s] = pair_evidence[p]
            taken[cols[p]] = 1
    return Association(match, evidence, taken)


@inlined
def excuse_misfits(
    tracks: TrackArrays, n: int, batch: Batch, association: Association, p_detect: FloatArray, model: Model
) -> None:
    """Set P_D to 0, in place, of looks whose box of the track was refused for its fit (`least_overlap`).

    A box that coincides with a track begins none of its own. Where it is no vehicle's but this one's, only a
    worse outline of it, the sensor has not missed the track: the look says nothing.

    Args:
        tracks: the state, predicted to the time of the batch.
        n: number of tracks.
        batch: all detections of the step.
        association: which track takes which of them.
        p_detect: (n, S) of this look, changed.
        model: sensors and settings.
    """
    sensors = model.sensors
    if np.max(sensors.least_overlap) <= 0.0:
        return
    boxes = shown_boxes(tracks, n, model.settings)
    for j in range(len(batch.sensor)):
        s = batch.sensor[j]
        if association.taken[j] or sensors.least_overlap[s] <= 0.0:
            continue
        most, nearest = model.settings.birth.max_overlap, np.int64(-1)
        for i in range(n):
            if association.match[i, s] < 0:
                common = overlap(batch.boxes[j], boxes[i])
                if common > most:
                    most, nearest = common, np.int64(i)
        if nearest >= 0:
            p_detect[nearest, s] = 0.0
