"""Association of one batch with the predicted tracks."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.association.costs import likelihood_cost, log_evidence
from jeat_graph.association.gates import gated_pairs
from jeat_graph.association.joint import JOINT, SLOTS, associate_joint, associate_sequential, associate_slots
from jeat_graph.config.kernel_form import SensorArrays, Settings
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.tracking.batch import Measurements
from jeat_graph.tracking.stages.predicting import Expectation
from jeat_graph.tracking.state import SceneArrays, TrackArrays


@njit(cache=True)
def associate(
    tracks: TrackArrays,
    n: int,
    batch: Measurements,
    expectation: Expectation,
    p_detect: FloatArray,
    scene: SceneArrays,
    sensors: SensorArrays,
    settings: Settings,
    priority: IntArray,
) -> tuple[IntArray, FloatArray]:
    """Associate a batch with the predicted tracks.

    Returns:
        match (n, S): detection that each track takes of each sensor, or -1; evidence (n, S): its ln Λ.
    """
    num_sensors = len(sensors.sigma_px)
    rows, cols, d2, log_density, log_size_density = gated_pairs(
        expectation.centre,
        expectation.var,
        expectation.white,
        tracks.size_mean[:n, :, 0],
        tracks.size_cov[:n, :, 0, 0],
        sensors.size_var,
        batch.z,
        batch.log_size,
        batch.weight,
        batch.sensor,
        settings.gate,
        settings.size_gate,
    )
    log_clutter = np.empty(num_sensors)
    for s in range(num_sensors):
        log_clutter[s] = math.log(scene.clutter[s]) - settings.log_clutter_volume
    pair_evidence = log_evidence(
        rows,
        cols,
        log_density,
        log_size_density,
        p_detect,
        batch.log_score,
        log_clutter,
        batch.sensor,
    )
    if settings.likelihood:
        costs = likelihood_cost(rows, cols, pair_evidence, tracks.existence, p_detect, batch.sensor)
    else:
        costs = d2
    if settings.method == SLOTS:
        match = associate_slots(n, num_sensors, rows, cols, costs, batch.sensor, settings.unassigned_cost)
    elif settings.method == JOINT:
        match = associate_joint(n, num_sensors, rows, cols, costs, batch.sensor, settings.unassigned_cost)
    else:
        match = associate_sequential(
            n, num_sensors, rows, cols, costs, batch.sensor, settings.unassigned_cost, priority
        )
    evidence = np.zeros((n, num_sensors))
    for p in range(len(rows)):
        s = batch.sensor[cols[p]]
        if match[rows[p], s] == cols[p]:
            evidence[rows[p], s] = pair_evidence[p]
    return match, evidence
