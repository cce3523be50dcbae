"""Two real cameras that look at one stretch of road, their windows cut apart, as cameras of a corridor.

In each session of BrnoCompSpeed `left` and `center` see the stretch between the laser gates. Of `left` only
the first 30 % of the stretch are kept, of `center` the last 30 %: 11 m lie between if it is 28 m long.
Both are calibrated from their measured lengths. A vehicle is known by the row of its laser gates, which
both have; passages without one are left out. A longer gap is simulated behind the second window: each vehicle
goes on at its true speed times 1 + s z, s = 0.04 (1 − exp(−gap / 400 m)) + 0.005, z standard normal.
"""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks.handover_scores import pair_scores
from benchmarks.road_real import Gates, read_gates
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.road.speeds import ContactConfig

#: Simulated gaps (m), that of the windows included.
GAPS_M = (200.0, 500.0, 1000.0)
#: Where the windows end and begin, as shares of the stretch between the gates.
_BEFORE, _AFTER = 0.3, 0.7
_KMH = 3.6
_LANE_M = 3.4
_LEAST_WAY_M = 2.0
_SIGMA_T = 0.02
#: A passage is that of the gates whose time and speed fit this well: s, and s for each km/h.
_MOST_OFF, _OFF_PER_KMH = 0.3, 0.02
_SAME_CLOCK_S = 0.05


class Window(NamedTuple):
    """Passages at the end of a window that faces the gap.

    Attributes:
        t: (N,) by the camera's clock (s).
        kmh: (N,) mean speeds in the window.
        sigma_kmh: (N,) their standard deviations.
        x: (N,) where across the road (m).
        gate: (N,) rows of the laser gates.
        gates: the gates.
        stretch_m: from the first to the last of them.
    """

    t: FloatArray
    kmh: FloatArray
    sigma_kmh: FloatArray
    x: FloatArray
    gate: IntArray
    gates: Gates
    stretch_m: float


def judge_sessions(root: Path) -> list[dict[str, Any]]:
    """Judge all sessions that have both cameras, each with all gaps."""
    out = []
    for folder in sorted(root.glob("*_left")):
        other = folder.with_name(folder.name.replace("_left", "_center"))
        if other.is_dir():
            out += judge_session(folder, other)
    return out


def judge_session(left: Path, center: Path) -> list[dict[str, Any]]:
    """Follow vehicles from one camera to the other, with each gap."""
    from jeat_graph.corridor.gap_model import Gap
    from jeat_graph.corridor.handover import KnownGap, solve

    before, after = window(left, before=True), window(center, before=False)
    offset_s, same = common_gates(before.gates, after.gates)
    first = passages_of(before, before.t, "left")
    who = np.array([same.get(int(k), -2) for k in before.gate])
    out = []
    between = (_AFTER - _BEFORE) * before.stretch_m
    for distance in (between, *GAPS_M):
        t = after.t
        if distance > between:
            spread = 0.04 * (1.0 - np.exp(-distance / 400.0)) + 0.005
            noise = np.random.default_rng(int(distance)).normal(size=len(t))
            speed = after.gates.kmh[after.gate] / _KMH * (1.0 + spread * noise)
            t = t + (distance - between) / speed
        second = passages_of(after, t, "center")
        known = KnownGap("left", "center", distance, 0.01 * distance)
        over = solve(known, Gap.of(first, second))
        out.append(
            {
                "session": left.name.removesuffix("_left"),
                "distance": distance,
                **pair_scores(over, who[first.track_id], after.gate[second.track_id]),
                "offset_error_s": over.fitted.parameters.offset_s - offset_s,
                "offset_sd_s": float(over.fitted.covariance[0, 0] ** 0.5),
            }
        )
    return out


def window(folder: Path, before: bool) -> Window:
    """Calibrate a camera, and follow its vehicles through its part of the stretch."""
    from jeat_graph.road.calibrate import calibrate
    from jeat_graph.road.evidence import CalibrationConfig, thin
    from jeat_graph.road.inputs import PointTable, read_lengths, read_points_table
    from jeat_graph.road.motion_fit import MotionFitConfig
    from jeat_graph.road.points_road import follow_points
    from jeat_graph.road.residuals import Problem

    points, lengths = read_points_table(folder / "points.csv.gz"), read_lengths(folder / "lengths.csv")
    about = json.loads((folder / "recording.json").read_text(encoding="utf-8"))
    size, config = (int(about["width"]), int(about["height"])), CalibrationConfig()
    tracks = thin(points.t, points.track_id, points.pixels, config, size)
    camera = calibrate(Problem(*size, lengths, None, tracks, config)).camera
    contact = ContactConfig()
    road = camera.to_road(points.pixels, contact.height_m)
    lines = [_line_at(points, road, line) for line in about["lines"]]
    far, near = max(lines), min(lines)
    gates = read_gates(folder / "speeds.csv")
    stretch = float(np.median(gates.kmh / _KMH * (gates.times[:, 1] - gates.times[:, 0])))
    scale = stretch / (far - near)
    along = (far - road[:, 1]) * scale
    end = (_BEFORE if before else _AFTER) * stretch
    keep = along < end if before else along > end
    part = PointTable(points.t[keep], points.track_id[keep], points.pixels[keep])
    rows = []
    for vehicle in follow_points(part, camera, MotionFitConfig(), contact)[0]:
        place = vehicle.fit.at(vehicle.t)
        way = (far - place[:, 1]) * scale
        if way[-1] - way[0] < _LEAST_WAY_M:
            continue
        k = -1 if before else 0
        here, mean = vehicle.speed_at(float(vehicle.t[k])), vehicle.mean_speed(*vehicle.fit.window())
        mean = mean if np.isfinite(mean.kmh) else here
        if here.kmh > 2.0 and mean.kmh > 2.0:
            t = float(vehicle.t[k]) + (end - way[k]) / (here.kmh / _KMH)
            rows.append((t, mean.kmh, mean.noise_kmh, float(np.median(place[:, 0]))))
    t, kmh, sigma, x = np.array(rows).T
    which = 0 if before else 1
    to_gate = (0.0 if before else stretch) - end
    gate = _gates_of(t + to_gate / (kmh / _KMH), kmh, gates.times[:, which], gates.kmh)
    known = gate >= 0
    return Window(t[known], kmh[known], sigma[known], x[known], gate[known], gates, stretch)


def _line_at(points: Any, road: FloatArray, line: list[float]) -> float:
    """Where along the road tracks cross a line a x + b y + c = 0 of the picture: the median (m)."""
    side = points.pixels @ np.array(line[:2]) + line[2]
    at = []
    for rows in points.tracks():
        own, place = side[rows], road[rows, 1]
        change = np.flatnonzero(np.signbit(own[:-1]) != np.signbit(own[1:]))
        if len(change):
            k = change[0]
            at.append(place[k] + own[k] / (own[k] - own[k + 1]) * (place[k + 1] - place[k]))
    return float(np.median(at))


def _gates_of(t: FloatArray, kmh: FloatArray, gate_t: FloatArray, gate_kmh: FloatArray) -> IntArray:
    """Rows (N,) of the gates that the passages went through, −1 where none fits."""
    off = t[:, None] - gate_t[None]
    nearest = off[np.arange(len(t)), np.abs(off).argmin(axis=1)]
    usual = np.median(nearest[np.abs(nearest) < 0.5])
    cost = np.abs(off - usual) + _OFF_PER_KMH * np.abs(kmh[:, None] - gate_kmh[None])
    rows, columns = linear_sum_assignment(np.minimum(cost, 1.0))
    out = np.full(len(t), -1)
    good = cost[rows, columns] < _MOST_OFF
    out[rows[good]] = columns[good]
    return out


def common_gates(first: Gates, second: Gates) -> tuple[float, dict[int, int]]:
    """Offset of the second clock (s), and which gates of the second are those of the first, by speed."""
    rows, columns = np.nonzero(first.kmh[:, None] == second.kmh[None])
    apart = second.times[columns, 0] - first.times[rows, 0]
    rough = Counter(np.round(apart, 1).tolist()).most_common(1)[0][0]
    near = np.abs(apart - rough) < 0.2
    offset = float(np.median(apart[near]))
    same = np.abs(apart - offset) < _SAME_CLOCK_S
    return offset, dict(zip(rows[same].tolist(), columns[same].tolist(), strict=True))


def passages_of(one: Window, t: FloatArray, name: str) -> Any:
    """Passages of a window at other times, in order; `track_id` is the row of the window."""
    from jeat_graph.corridor.passages import Passages

    order = np.argsort(t, kind="stable")
    lane = np.round((one.x - np.median(one.x)) / _LANE_M).astype(np.int64)
    names, code = np.unique(lane, return_inverse=True)
    count, kmh = len(t), one.kmh[order]
    unknown = np.full(count, np.nan)
    return Passages(
        name,
        "window",
        order,
        t[order],
        np.full(count, _SIGMA_T),
        np.log(kmh / _KMH),
        np.maximum(one.sigma_kmh[order] / kmh, 0.01),
        code[order],
        unknown,
        unknown,
        np.full(count, -1),
        tuple(map(str, names.tolist())),
        (),
        (float(t.min()), float(t.max())),
    )
