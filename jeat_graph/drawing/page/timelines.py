"""Collects the curves of each track over its life, as plain values that the page's script draws."""

from __future__ import annotations

from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.diagnostics import Diagnostics
from jeat_graph.data.progress import with_progress
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.drawing.page.thinning import extremes, milliseconds, occupied, sample, short, spread
from jeat_graph.eval.resampling import interpolate_to
from jeat_graph.runs.recorded import RunData, parts_of_tracks, rows_of_tracks

# Points of a curve: all tracks share a budget, so that the page stays small however many there are.
_BUDGET = 16_000
_MOST_POINTS, _LEAST_POINTS = 240, 30
#: So many tracks get timelines, those that live longest; all are on the map and in the list.
MOST_TRACKS = 600
_SENSOR_BINS = 300
_LEAST_BIN_S = 0.005


def timelines(data: RunData) -> list[dict[str, Any]]:
    """Curves of every track, by ascending identity (of the `MOST_TRACKS` longest).

    Keys of a track: `id`; `from`, `to` (ms since the run's first time); `bin` (ms) and `used`, for each
    sensor the numbers of the bins in which it gave the track a detection; `existence`: `t`, `v`; `scale` and
    `nis`, one `t`, `v` for each sensor, or None without diagnostics; `motion`, see `_motion`. Times are in ms
    since the run's first time.
    """
    ids, start = data.track_ids(), data.span_s()[0]
    causal = parts_of_tracks(data.causal)
    smoothed = parts_of_tracks(data.smoothed)
    paired = None
    if data.causal is not None and data.smoothed is not None:
        paired = _Paired(data.causal, data.smoothed)
    updates = {}
    if data.diagnostics is not None:
        updates = rows_of_tracks(data.diagnostics.track_id, data.diagnostics.t)
    chosen = _longest(ids, causal, smoothed)
    points = int(np.clip(_BUDGET // max(len(chosen), 1), _LEAST_POINTS, _MOST_POINTS))
    out = []
    for track_id in with_progress(chosen):
        mine, after = causal.get(track_id), smoothed.get(track_id)
        noted = None
        if data.diagnostics is not None:
            noted = data.diagnostics.take(updates.get(track_id, np.zeros(0, dtype=np.int64)))
        parts = [one.t for one in (mine, after, noted) if one is not None and len(one)]
        first, last = min(float(t[0]) for t in parts), max(float(t[-1]) for t in parts)
        width = max((last - first) / _SENSOR_BINS, _LEAST_BIN_S)
        source = mine if mine is not None else after
        assert source is not None
        one: dict[str, Any] = {
            "id": track_id,
            "from": milliseconds(np.array([first]), start)[0],
            "to": milliseconds(np.array([last]), start)[0],
            "bin": round(1e3 * width, 3),
            "used": [occupied(_used_times(name, mine, after, noted), first, width) for name in data.sensors],
            "existence": _existence(source, noted, start, points),
            "scale": None,
            "nis": None,
            "motion": _motion(source, after, paired, track_id, start, points),
        }
        if noted is not None:
            one["scale"] = [_curve(noted, name, "noise_scale", start, points) for name in data.sensors]
            one["nis"] = [_curve(noted, name, "nis", start, points) for name in data.sensors]
        out.append(one)
    return out


def _longest(ids: IntArray, causal: dict[int, Trajectories], smoothed: dict[int, Trajectories]) -> list[int]:
    def life(track_id: int) -> float:
        parts = [kind[track_id].t for kind in (causal, smoothed) if track_id in kind]
        return max(float(t[-1]) for t in parts) - min(float(t[0]) for t in parts)

    ranked = sorted(ids.tolist(), key=lambda track_id: (-life(track_id), track_id))
    return sorted(ranked[:MOST_TRACKS])


def _used_times(
    name: str, causal: Trajectories | None, smoothed: Trajectories | None, noted: Diagnostics | None
) -> FloatArray:
    """Times at which a sensor gave the track a detection, from whichever tables know of it."""
    times = []
    for table in (causal, smoothed):
        if table is not None and name in table.sensors:
            times.append(table.t[table.used >> table.sensors.index(name) & 1 > 0])
    if noted is not None and name in noted.sensors:
        times.append(noted.t[noted.sensor == noted.sensors.index(name)])
    return np.unique(np.concatenate(times)) if times else np.zeros(0)


def _existence(table: Trajectories, noted: Diagnostics | None, start: float, points: int) -> dict[str, Any]:
    """Existence in the table's rows, and before them as the diagnostics have it."""
    t, value = table.t, table.existence
    if noted is not None:
        early = np.flatnonzero((noted.t < t[0]) & np.isfinite(noted.existence))
        t, value = np.concatenate([noted.t[early], t]), np.concatenate([noted.existence[early], value])
    keep = extremes(t, value, points // 2)
    return {"t": milliseconds(t[keep], start), "v": short(value[keep])}


def _curve(noted: Diagnostics, name: str, column: str, start: float, points: int) -> dict[str, Any]:
    values: FloatArray = getattr(noted, column)
    here = np.zeros(len(noted), dtype=np.bool_)
    if name in noted.sensors:
        here = (noted.sensor == noted.sensors.index(name)) & np.isfinite(values)
    t, values = noted.t[here], values[here]
    keep = extremes(t, values, points // 2) if column != "nis" else sample(t, values, points)
    return {"t": milliseconds(t[keep], start), "v": short(values[keep])}


class _Paired:
    """The smoothed trajectories at the times of the causal table."""

    def __init__(self, causal: Trajectories, smoothed: Trajectories) -> None:
        times = np.unique(causal.t)
        found = interpolate_to(smoothed, times, instants=causal.instants)
        self._t = times[found.frame]
        self._mean, self._var = found.mean, found.var
        self._rows = rows_of_tracks(found.track_id, self._t)

    def at(self, track_id: int, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and variance (T, 6) each of a track at causal times (T,); NaN where it is not there."""
        mean, var = np.full((len(t), 6), np.nan), np.full((len(t), 6), np.nan)
        rows = self._rows.get(track_id)
        if rows is not None:
            place = np.searchsorted(self._t[rows], t)
            there = place < len(rows)
            there[there] = self._t[rows][place[there]] == t[there]
            mean[there], var[there] = self._mean[rows][place[there]], self._var[rows][place[there]]
        return mean, var


def _motion(
    source: Trajectories,
    smoothed: Trajectories | None,
    paired: _Paired | None,
    track_id: int,
    start: float,
    points: int,
) -> dict[str, Any]:
    """Filter against smoother at the same times.

    Keys: `t`; `x`, `y` position (px, smoothed where it is known); `vx`, `vy` of the filter with `svx`, `svy`
    its standard deviations; with a smoother also `dx`, `dy` filter minus smoother (px) with the filter's
    `sx`, `sy`, and `wx`, `wy` smoothed velocities with `swx`, `swy`.
    """
    keep = spread(len(source), points)
    t, mean, var = source.t[keep], source.mean[keep], source.var[keep]
    std = np.sqrt(np.maximum(var, 0.0))
    out: dict[str, Any] = {"t": milliseconds(t, start)}
    place = mean[:, :2]
    if paired is not None and smoothed is not None:
        late, late_var = paired.at(track_id, t)
        late_std = np.sqrt(np.maximum(late_var, 0.0))
        place = np.where(np.isfinite(late[:, :2]), late[:, :2], place)
        for k, axis in enumerate("xy"):
            out[f"d{axis}"] = short(mean[:, k] - late[:, k])
            out[f"s{axis}"] = short(std[:, k])
            out[f"w{axis}"] = short(late[:, 2 + k])
            out[f"sw{axis}"] = short(late_std[:, 2 + k])
    for k, axis in enumerate("xy"):
        out[axis] = short(place[:, k])
        out[f"v{axis}"] = short(mean[:, 2 + k])
        out[f"sv{axis}"] = short(std[:, 2 + k])
    return out
