"""Filter against smoothers: what delay buys, where the errors are, and whether the covariances are honest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.measured_track import MeasuredTrack
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.breakdown import DISTANCE_BINS_M
from jeat_graph.eval.frames import build_frames
from jeat_graph.eval.kinematics import matched_errors
from jeat_graph.eval.lagged import Innovations, States, states_at
from jeat_graph.eval.tables import Cell, Table

#: Lags of the curve (s).
LAGS_S = (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0)
#: A sensor counts as available to a track if it gave it a detection within this time before (s).
RECENT_S = 0.1
#: Autocorrelations of the innovations are taken up to this many steps.
WHITENESS_STEPS = 5
_PARTS = {"position": slice(0, 1), "velocity": slice(1, 2), "acceleration": slice(2, 3)}


@dataclass(frozen=True, eq=False)
class Samples:
    """Errors of every estimator at the same N instants, at which a track is matched to a true object.

    Attributes:
        t: (N,) time (s).
        track_id: (N,) identity.
        truth: (N, 2, 3) true [p, v, a] per axis.
        states: estimates (N) by estimator.
        available: (N,) bit k is set where sensor k had lately given the track a detection.
        distance: (N,) from the camera (m), or None.
    """

    t: FloatArray
    track_id: IntArray
    truth: FloatArray
    states: dict[str, States]
    available: IntArray
    distance: FloatArray | None

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, eq=False)
class Comparison:
    """The result: tables to read, values for JSON, and the samples to draw.

    Attributes:
        values: all figures, ready for JSON.
        tables: the same for people.
        samples: single errors, None without truth.
        lags_s: lags of the curve (s).
    """

    values: dict[str, Any]
    tables: list[Table]
    samples: Samples | None
    lags_s: tuple[float, ...] = field(default=LAGS_S)


def compare(
    tracks: Sequence[MeasuredTrack],
    sensors: Sequence[str],
    *,
    truth: GroundTruth | None = None,
    smoothed: Trajectories | None = None,
    lags_s: Sequence[float] = LAGS_S,
    iou: float = 0.5,
) -> Comparison:
    """Compare the filter, the smoother at several lags, and the smoother of whole tracks.

    All of them see the same measurements, those that the tracker accepted.

    Args:
        tracks: confirmed tracks with their measurements.
        sensors: names of the sensors.
        truth: true boxes with motion; without them only consistency is judged.
        smoothed: the smoothed table, which decides what track is matched to what object at what time.
        lags_s: lags (s); 0 is the filter.
        iou: smallest IoU of a match.
    """
    lags = tuple(sorted(set(lags_s)))
    values: dict[str, Any] = {"tracks": len(tracks), "sensors": list(sensors)}
    consistency, table = _consistency(tracks)
    values["consistency"] = consistency
    tables = [table]
    samples = None
    if truth is not None and smoothed is not None and truth.motion is not None:
        samples = collect_samples(tracks, truth, smoothed, lags, iou)
        if len(samples):
            errors = {name: _errors(samples, name) for name in samples.states}
            values["errors"] = errors
            values["lag_curve"] = [{"lag_s": lag, **errors[lag_name(lag)]} for lag in lags]
            values["by_availability"] = _by_group(samples, _availability(samples, sensors))
            tables.insert(0, _error_table(errors))
            tables.append(_group_table(values["by_availability"], "By sensors that saw the track lately"))
            if samples.distance is not None:
                values["by_distance"] = _by_group(samples, _distances(samples.distance))
                tables.append(_group_table(values["by_distance"], "By distance"))
    return Comparison(values, tables, samples, lags)


def lag_name(lag_s: float) -> str:
    """Name of the estimator with that lag (s)."""
    return f"lag {lag_s:g} s"


def collect_samples(
    tracks: Sequence[MeasuredTrack],
    truth: GroundTruth,
    smoothed: Trajectories,
    lags_s: Sequence[float],
    iou: float = 0.5,
) -> Samples:
    """Estimate each matched track at the times of the truth, by every estimator.

    Objects cut off by the picture's edge are left out: a detector sees the centre of what is left of them.
    """
    frames = build_frames(truth, smoothed, kind="smoothed")
    matched = matched_errors(frames, iou=iou)
    assert matched is not None
    assert truth.motion is not None
    entry, row = matched.track_entry, frames.truth_row[matched.truth_entry]
    whole = ~matched.truncated
    identity, row = frames.tracks.track_id[entry][whole], row[whole]
    t = truth.t[row]
    names = ["filter", *(lag_name(lag) for lag in lags_s), "full"]
    parts: list[tuple[IntArray, IntArray, list[States]]] = []
    for track in tracks:
        mine = np.flatnonzero(identity == track.track_id)
        mine = mine[(t[mine] >= track.data.t[0]) & (t[mine] <= track.data.t[-1])]
        if len(mine):
            filtered, lagged, full, _ = states_at(track.data, t[mine], lags_s)
            parts.append((mine, _available(track, t[mine]), [filtered, *lagged, full]))
    order = np.concatenate([mine for mine, _, _ in parts]) if parts else np.zeros(0, dtype=np.int64)
    states = {
        name: States(
            np.concatenate([part[2][k].mean for part in parts]) if parts else np.zeros((0, 2, 3)),
            np.concatenate([part[2][k].cov for part in parts]) if parts else np.zeros((0, 2, 3, 3)),
        )
        for k, name in enumerate(names)
    }
    rows = row[order]
    return Samples(
        t=truth.t[rows],
        track_id=identity[order],
        truth=truth.motion[rows].reshape(-1, 3, 2).transpose(0, 2, 1),
        states=states,
        available=np.concatenate([part[1] for part in parts]) if parts else order,
        distance=None if truth.distance is None else truth.distance[rows],
    )


def _available(track: MeasuredTrack, t: FloatArray) -> IntArray:
    """Bits (T,) of the sensors that gave the track a detection within `RECENT_S` before each time."""
    out = np.zeros(len(t), dtype=np.int64)
    measured = np.concatenate([track.data.t[:1], track.data.t[track.data.key]])
    sensor = np.concatenate([[track.birth_sensor], track.sensor])
    for s in np.unique(sensor).tolist():
        times = np.sort(measured[sensor == s])
        last = np.searchsorted(times, t + 1e-6, side="right") - 1
        recent = (last >= 0) & (t - times[np.maximum(last, 0)] <= RECENT_S)
        out |= recent.astype(np.int64) << int(s)
    return out


def _errors(samples: Samples, name: str, rows: BoolArray | None = None) -> dict[str, float]:
    """RMSE of each part, and NEES per degree of freedom: of the position, and of the whole state."""
    chosen = np.ones(len(samples), dtype=np.bool_) if rows is None else rows
    state, truth = samples.states[name], samples.truth[chosen]
    error, cov = state.mean[chosen] - truth, state.cov[chosen]
    count = len(error)
    out: dict[str, float] = {"count": count}
    for part, columns in _PARTS.items():
        out[f"{part}_rmse"] = float(np.sqrt((error[:, :, columns] ** 2).sum() / count)) if count else np.nan
    position = error[:, :, 0] ** 2 / cov[:, :, 0, 0]
    whole = (error * np.linalg.solve(cov, error[..., None])[..., 0]).sum(axis=2)
    out["anees_position"] = float(position.mean()) if count else np.nan
    out["anees_state"] = float(whole.mean() / 3.0) if count else np.nan
    out["anees_low"], out["anees_high"] = chi2_bounds(count, 2)
    return out


def chi2_bounds(count: int, freedom: int) -> tuple[float, float]:
    """95 % interval of the mean of `count` independent χ² values, per degree of freedom."""
    if not count:
        return float("nan"), float("nan")
    from scipy.special import chdtri

    total = float(count * freedom)
    return float(chdtri(total, 0.975)) / total, float(chdtri(total, 0.025)) / total


def _availability(samples: Samples, sensors: Sequence[str]) -> dict[str, BoolArray]:
    masks = sorted(np.unique(samples.available).tolist(), key=lambda m: (-int(m).bit_count(), m))
    groups = {}
    for mask in masks:
        names = [name for k, name in enumerate(sensors) if int(mask) >> k & 1]
        label = "none" if not names else f"{names[0]} only" if len(names) == 1 else " + ".join(names)
        groups[label] = samples.available == mask
    return groups


def _distances(distance: FloatArray) -> dict[str, BoolArray]:
    groups = {}
    for low, high in pairwise(DISTANCE_BINS_M):
        label = f"{low:g}–{high:g} m" if np.isfinite(high) else f"over {low:g} m"
        groups[label] = (distance >= low) & (distance < high)
    return groups


def _by_group(samples: Samples, groups: dict[str, BoolArray]) -> list[dict[str, Any]]:
    """Errors of filter and full smoother in each group that is not empty."""
    return [
        {"group": label, **{name: _errors(samples, name, rows) for name in ("filter", "full")}}
        for label, rows in groups.items()
        if rows.any()
    ]


def _error_table(errors: dict[str, dict[str, float]]) -> Table:
    base = errors["filter"]
    records: list[dict[str, Cell]] = []
    for name, one in errors.items():
        if name == lag_name(0.0):
            continue
        records.append(
            {
                "estimator": name,
                "position": one["position_rmse"],
                "velocity": one["velocity_rmse"],
                "acceleration": one["acceleration_rmse"],
                "position/filter": one["position_rmse"] / base["position_rmse"],
                "velocity/filter": one["velocity_rmse"] / base["velocity_rmse"],
                "ANEES position": one["anees_position"],
                "ANEES state": one["anees_state"],
            }
        )
    bounds = f"{base['anees_low']:.3f} to {base['anees_high']:.3f}"
    return Table.from_records(
        records,
        title=f"RMSE (px, px/s, px/s²) at {int(base['count'])} instants; ANEES should be 1 (95 %: {bounds})",
    )


def _group_table(groups: Sequence[dict[str, Any]], title: str) -> Table:
    records: list[dict[str, Cell]] = []
    for one in groups:
        record: dict[str, Cell] = {"group": one["group"], "instants": int(one["filter"]["count"])}
        for part in ("position", "velocity"):
            for name in ("filter", "full"):
                record[f"{part} {name}"] = one[name][f"{part}_rmse"]
        record["ANEES filter"] = one["filter"]["anees_position"]
        record["ANEES full"] = one["full"]["anees_position"]
        records.append(record)
    return Table.from_records(records, title=title + " (RMSE in px, px/s)")


def _consistency(tracks: Sequence[MeasuredTrack]) -> tuple[dict[str, Any], Table]:
    """What can be judged without truth: the innovations, and the smoother against the filter."""
    innovations: list[Innovations] = []
    ratio: list[FloatArray] = []
    for track in tracks:
        filtered, _, full, surprise = states_at(track.data, track.data.t, [])
        innovations.append(surprise)
        ratio.append(_disagreement(filtered, full))
    nis = np.concatenate([one.nis() for one in innovations]) if innovations else np.zeros(0)
    low, high = chi2_bounds(len(nis), 2)
    white = whiteness([one.normalised() for one in innovations])
    bound = 1.96 / np.sqrt(max(2 * len(nis), 1))
    square = np.concatenate(ratio) if ratio else np.zeros((0, 3))
    values: dict[str, Any] = {
        "innovations": len(nis),
        "nis": float(nis.mean() / 2.0) if len(nis) else np.nan,
        "nis_low": low,
        "nis_high": high,
        "autocorrelation": white.tolist(),
        "autocorrelation_bound": float(bound),
        "smoother_filter": {
            part: float(np.nanmean(square[:, k])) if len(square) else np.nan for k, part in enumerate(_PARTS)
        },
    }
    records: list[dict[str, Cell]] = [
        {"check": "NIS per degree of freedom", "value": values["nis"], "expected": f"{low:.3f} to {high:.3f}"}
    ]
    for step, value in enumerate(white.tolist(), start=1):
        what = f"innovation autocorrelation, {step} step{'s' * (step > 1)}"
        records.append({"check": what, "value": value, "expected": f"±{bound:.3f}"})
    for part, value in values["smoother_filter"].items():
        what = f"(filter − full)² / (P filter − P full), {part}"
        records.append({"check": what, "value": value, "expected": "1"})
    return values, Table.from_records(records, title="Consistency without truth", digits={"value": 3})


def whiteness(normalised: Sequence[FloatArray], steps: int = WHITENESS_STEPS) -> FloatArray:
    """Autocorrelation (steps,) of normalised innovations, pooled over tracks and axes.

    Args:
        normalised: (K, 2) of each track, in order of time.
        steps: how many steps apart at most.
    """
    power = sum(float((one**2).sum()) for one in normalised)
    count = sum(one.size for one in normalised)
    out = np.full(steps, np.nan)
    for step in range(1, steps + 1):
        pairs = sum(one[step:].size for one in normalised)
        product = sum(float((one[step:] * one[:-step]).sum()) for one in normalised)
        if pairs and power > 0.0:
            out[step - 1] = (product / pairs) / (power / count)
    return out


def _disagreement(filtered: States, full: States) -> FloatArray:
    """Squared difference over difference of variances (K, 3) for p, v, a, mean of both axes; 1 is expected.

    What the future adds is independent of what the past knew, so Cov(filter − full) = P_filter − P_full.
    NaN at the end of a track, where both are the same.
    """
    squared = (filtered.mean - full.mean) ** 2
    gained = np.diagonal(filtered.cov - full.cov, axis1=2, axis2=3)
    known = gained > 1e-3 * np.diagonal(filtered.cov, axis1=2, axis2=3)
    ratio = np.where(known, squared / np.where(known, gained, 1.0), np.nan)
    both = known.all(axis=1)
    return np.asarray(np.where(both, np.where(known, ratio, 0.0).mean(axis=1), np.nan))
