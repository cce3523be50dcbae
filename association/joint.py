"""The three ways to associate one batch: slots, the paper's joint problem, fixed priority."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.association.assignment import assign
from jeat_graph.data.arrays import FloatArray, IntArray


@njit(cache=True)
def associate_slots(
    num_tracks: int,
    num_sensors: int,
    rows: IntArray,
    cols: IntArray,
    costs: FloatArray,
    sensor: IntArray,
    unassigned_cost: float,
) -> IntArray:
    """Solve one joint problem with a slot for each track and sensor.

    A vehicle takes at most one detection of *each* sensor, so a second sensor's view of it is not left over.

    Args:
        num_tracks: number of tracks N.
        num_sensors: number of sensors S.
        rows: (P,) track of each admissible pair.
        cols: (P,) detection of each pair.
        costs: (P,) cost of each pair.
        sensor: (M,) sensor of each detection.
        unassigned_cost: cost of a slot that stays empty.

    Returns:
        (N, S) detection of each track and sensor, or -1.
    """
    slots = np.empty(len(rows), dtype=np.int64)
    for p in range(len(rows)):
        slots[p] = rows[p] * num_sensors + sensor[cols[p]]
    match = assign(num_tracks * num_sensors, len(sensor), slots, cols, costs, unassigned_cost)
    return match.reshape(num_tracks, num_sensors)


@njit(cache=True)
def associate_joint(
    num_tracks: int,
    num_sensors: int,
    rows: IntArray,
    cols: IntArray,
    costs: FloatArray,
    sensor: IntArray,
    unassigned_cost: float,
) -> IntArray:
    """Solve the paper's joint problem: all detections compete, a track takes one of any sensor.

    Args and returns as `associate_slots`; at most one entry of each row is set.
    """
    match = assign(num_tracks, len(sensor), rows, cols, costs, unassigned_cost)
    out = np.full((num_tracks, num_sensors), -1, dtype=np.int64)
    for i in range(num_tracks):
        if match[i] >= 0:
            out[i, sensor[match[i]]] = match[i]
    return out


@njit(cache=True)
def associate_sequential(
    num_tracks: int,
    num_sensors: int,
    rows: IntArray,
    cols: IntArray,
    costs: FloatArray,
    sensor: IntArray,
    unassigned_cost: float,
    priority: IntArray,
) -> IntArray:
    """Associate sensor after sensor; a track that one has served is not offered to the next.

    This is the fixed hierarchy that the paper argues against, here as the baseline for it.

    Args:
        num_tracks: number of tracks N.
        num_sensors: number of sensors S.
        rows: (P,) track of each admissible pair.
        cols: (P,) detection of each pair.
        costs: (P,) cost of each pair.
        sensor: (M,) sensor of each detection.
        unassigned_cost: cost of a track that stays without detection.
        priority: (S,) sensors, the first served first.

    Returns:
        (N, S) detection of each track and sensor, or -1; at most one entry of each row is set.
    """
    out = np.full((num_tracks, num_sensors), -1, dtype=np.int64)
    served = np.zeros(num_tracks, dtype=np.bool_)
    for s in priority:
        keep = np.zeros(len(rows), dtype=np.bool_)
        for p in range(len(rows)):
            keep[p] = sensor[cols[p]] == s and not served[rows[p]]
        match = assign(num_tracks, len(sensor), rows[keep], cols[keep], costs[keep], unassigned_cost)
        for i in range(num_tracks):
            if match[i] >= 0:
                out[i, s] = match[i]
                served[i] = True
    return out
