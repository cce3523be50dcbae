"""Compiled steps of the filter on the road: all tracks advanced at once, and read out."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.road.box_kernel import CHANNELS, WHOLE, KernelCamera
from jeat_graph.road.causal_kernel import begin, read_box
from jeat_graph.road.fleet import beyond_vehicles
from jeat_graph.road.road_state import (
    AY,
    LENGTH,
    STATES,
    VX,
    VY,
    Record,
    RoadState,
    X,
    Y,
    predict,
    tell_speed,
    update,
)

_FIRST_BOXES = 5  # of a track that have to be whole
_TELLS_AFTER = 30  # boxes of a track after which its speed counts for its strip
_SIZE = 5  # first place of the size in a row of a table of the road
_LEAST_MS = 1e-3  # a heading of a slower vehicle is not known at all


@njit(cache=True)
def find(track: RecordArray, count: int, identity: int) -> int:
    """First row of the first `count` whose identity is not less."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if track[middle]["track_id"] < identity:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True)
def copy_row(state: RoadState, source: int, target: int) -> None:
    """Copy one track's row over another's."""
    state.track[target] = state.track[source]
    state.seen[target] = state.seen[source]


@njit(cache=True)
def remove(state: RoadState, i: int) -> None:
    """Remove one track, in place."""
    for r in range(i, state.count[0] - 1):
        copy_row(state, r + 1, r)
    state.count[0] -= 1


@njit(cache=True)
def advance(
    state: RoadState, t: float, rows: RecordArray, model: Record, errors: FloatArray, camera: KernelCamera
) -> None:
    """Take in what one step of the tracker gave to its tracks, in place.

    A box that comes a fraction of its errors' memory after the last one of its sensor has nearly the same
    error, and tells next to nothing: it is left out.

    Args:
        state: with room for as many new tracks as there are rows.
        t: time of the step (s).
        rows: (M,) records of `filters.measurement.MEASUREMENT`.
        model: what is believed of vehicles and boxes.
        errors: (S, 2) as in `read_box`.
        camera: the camera.
    """
    z, R, mode = np.empty(CHANNELS), np.empty(CHANNELS), np.empty(2, dtype=np.int64)
    for j in range(len(rows)):
        row = rows[j]
        s, identity = row["sensor"], row["track_id"]
        n = state.count[0]
        i = find(state.track, n, identity)
        if i == n or state.track[i]["track_id"] != identity:
            read_box(row, np.inf, model, errors, z, R, mode)
            _enter(state, i, t, row, (z, R, mode), model, camera)
            continue
        track = state.track[i]
        since = t - state.seen[i, s]
        if since < model["pause"] * errors[s, 0]:
            continue
        m, P = track["mean"], track["cov"]
        predict(m, P, t - track["t"], model)
        track["t"] = t
        read_box(row, since, model, errors, z, R, mode)
        if track["boxes"] < _FIRST_BOXES and (mode[0] != WHOLE or mode[1] != WHOLE):
            remove(state, i)  # it may not have been whole at first either
            continue
        if update(m, P, z, R, mode, model, camera):
            state.seen[i, s] = t
            track["updated"] = t
            track["boxes"] += 1
            if track["boxes"] == _TELLS_AFTER:
                tell_speed(state.strip, m[X], m[VY])


@njit(cache=True)
def _enter(
    state: RoadState,
    i: int,
    t: float,
    row: RecordArray,
    box: tuple[FloatArray, FloatArray, IntArray],
    model: Record,
    camera: KernelCamera,
) -> None:
    """Begin a track at its first box, at row i, if it stands on the road."""
    z, R, mode = box
    mean, cov = np.empty(STATES), np.empty((STATES, STATES))
    if not begin(mean, cov, z, R, mode, model, camera, state.strip):
        return
    for r in range(state.count[0], i, -1):  # younger tracks make room
        copy_row(state, r - 1, r)
    track = state.track[i]
    track["track_id"], track["boxes"] = row["track_id"], 1
    track["t"], track["updated"] = t, t
    track["mean"][:] = mean
    track["cov"][:] = cov
    state.seen[i] = -np.inf
    state.seen[i, row["sensor"]] = t
    state.count[0] += 1


@njit(cache=True)
def states_at(state: RoadState, t: float, ids: IntArray, model: Record, found: RecordArray) -> int:
    """States of some tracks at a time.

    Args:
        state: of all tracks; those asked for are predicted to t in place.
        t: time (s), not before theirs.
        ids: (N,) identities.
        model: what is believed of vehicles.
        found: (N,) records of `ROAD_ROW`, filled with those of the known ones, in the order of `ids`.

    Returns:
        How many are known, and of a vehicle's size.
    """
    count, n = 0, state.count[0]
    for j in range(len(ids)):
        i = find(state.track, n, ids[j])
        if i == n or state.track[i]["track_id"] != ids[j]:
            continue
        track, row = state.track[i], found[count]
        predict(track["mean"], track["cov"], t - track["t"], model)
        track["t"] = max(t, track["t"])
        row["t"], row["track_id"] = t, ids[j]
        road_terms(track["mean"], track["cov"], row["mean"], row["var"])
        if (
            beyond_vehicles(row["mean"][_SIZE:], row["var"][_SIZE:], model["extremes"])
            <= model["most_beyond"]
        ):
            count += 1
    return count


@njit(cache=True)
def road_terms(m: FloatArray, P: FloatArray, mean: FloatArray, var: FloatArray) -> None:
    """Write a state as tables of the road have it, with its variances.

    Args:
        m: (8,) state.
        P: (8, 8) its covariance.
        mean: (8,) filled: x, y (m), speed (m/s), heading from y towards x (rad), acceleration along the way
            (m/s²), length, width, height (m).
        var: (8,) filled: variances.
    """
    speed = math.hypot(m[VX], m[VY])
    ux, uy = 0.0, 1.0
    if speed > 0.0:
        ux, uy = m[VX] / speed, m[VY] / speed
    xx, xy, yy = P[VX, VX], P[VX, VY], P[VY, VY]
    mean[0], var[0] = m[X], P[X, X]
    mean[1], var[1] = m[Y], P[Y, Y]
    mean[2], var[2] = speed, ux * ux * xx + 2.0 * ux * uy * xy + uy * uy * yy
    mean[3] = math.atan2(m[VX], m[VY])
    var[3] = (uy * uy * xx - 2.0 * ux * uy * xy + ux * ux * yy) / max(speed, _LEAST_MS) ** 2
    mean[4], var[4] = m[AY] * uy, P[AY, AY] * uy * uy
    for k in range(LENGTH, LENGTH + 3):
        mean[k], var[k] = m[k], P[k, k]


@njit(cache=True)
def step_road(
    state: RoadState,
    t: float,
    rows: RecordArray,
    ids: IntArray,
    model: RecordArray,
    errors: FloatArray,
    camera: KernelCamera,
    found: RecordArray,
) -> int:
    """`advance`, then `states_at`: one call, for handing the state over costs as much as some boxes.

    `model` is one record in an array, and all else as there.
    """
    advance(state, t, rows, model[0], errors, camera)
    return states_at(state, t, ids, model[0], found)


@njit(cache=True)
def forget(state: RoadState, t: float, silence_s: float) -> None:
    """Remove tracks without a box for longer than `silence_s`, in place."""
    kept = 0
    for i in range(state.count[0]):
        if t - state.track[i]["updated"] > silence_s:
            continue
        if kept < i:
            copy_row(state, i, kept)
        kept += 1
    state.count[0] = kept
