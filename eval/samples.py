"""The errors of several estimators at the same instants, taken where a track is matched to a true object."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.progress import with_progress
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.consistency import PARTS, chi2_bounds
from jeat_graph.eval.frames import build_frames
from jeat_graph.eval.kinematics import matched_errors
from jeat_graph.eval.lagged import States, last_record, states_at, states_by
from jeat_graph.smoothers.filtered_track import FilteredTrack

#: A sensor counts as available to a track if it gave it a detection within this time before (s).
RECENT_S = 0.1
#: A true box this near to an edge of the picture (px) is taken to be cut by it.
EDGE_PX = 1.0
# Between them errors are shown: near ones are finer, because motion in the picture goes as 1 / distance².
_DISTANCES_M = (0.0, 20.0, 30.0, 60.0, 100.0, np.inf)
_HEIGHTS_PX = (0.0, 25.0, 50.0, 100.0, 200.0, np.inf)
# A time of the truth further from the last scan than this is not judged (s).
_FURTHEST_S = 0.05


#: Smooths a whole track: means (K, 2, D) and covariances (K, 2, D, D) at its records.
WholeTrack: TypeAlias = Callable[[FilteredTrack], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, eq=False)
class Samples:
    """Errors of every estimator at the same N instants, at which a track is matched to a true object.

    Attributes:
        t: (N,) time (s).
        track_id: (N,) identity.
        truth: (N, 2, 3) true [p, v, a] per axis.
        states: estimates (N) by estimator.
        available: (N,) bit k is set where sensor k had lately given the track a detection.
        cut: (N,) whether the picture's edge cuts the true box.
        height: (N,) of the true box (px).
        distance: (N,) from the camera (m), or None.
    """

    t: FloatArray
    track_id: IntArray
    truth: FloatArray
    states: dict[str, States]
    available: IntArray
    cut: BoolArray
    height: FloatArray
    distance: FloatArray | None

    @property
    def has_motion(self) -> bool:
        """Whether the truth knows velocities, and not places alone."""
        return bool(np.isfinite(self.truth[:, :, 1]).any())

    def __len__(self) -> int:
        return len(self.t)

    def uncut(self) -> Samples:
        """Return those of objects that lie whole within the picture."""
        keep = ~self.cut
        return Samples(
            t=self.t[keep],
            track_id=self.track_id[keep],
            truth=self.truth[keep],
            states={name: States(one.mean[keep], one.cov[keep]) for name, one in self.states.items()},
            available=self.available[keep],
            cut=self.cut[keep],
            height=self.height[keep],
            distance=None if self.distance is None else self.distance[keep],
        )


def lag_name(lag_s: float) -> str:
    """Name of the estimator with that lag (s)."""
    return f"lag {lag_s:g} s"


def with_centres(truth: GroundTruth, image: tuple[float, float] | None = None) -> GroundTruth:
    """Return truth with the centres of its boxes for positions, where it does not say where an object is.

    Velocities and accelerations stay unknown (NaN). So does the place of what an edge of the picture cuts:
    the centre of what is left of a box is not that of the object.

    Args:
        truth: true boxes, with motion or without.
        image: width and height of the picture (px), or None where nothing is known to be cut.
    """
    motion = np.full((len(truth), 6), np.nan) if truth.motion is None else truth.motion.copy()
    centre = truth.boxes[:, :2] + 0.5 * truth.boxes[:, 2:]
    if image is not None:
        low, high = truth.boxes[:, :2], truth.boxes[:, :2] + truth.boxes[:, 2:]
        cut = (low <= EDGE_PX).any(axis=1) | (high >= np.array(image) - EDGE_PX).any(axis=1)
        centre[cut] = np.nan
    motion[:, :2] = np.where(np.isnan(motion[:, :2]), centre, motion[:, :2])
    return replace(truth, motion=motion)


def collect_samples(
    tracks: Sequence[FilteredTrack],
    truth: GroundTruth,
    causal: Trajectories,
    lags_s: Sequence[float],
    *,
    instants: FloatArray | None = None,
    iou: float = 0.5,
    others: Mapping[str, WholeTrack] | None = None,
) -> Samples:
    """Estimate each track at those times of the truth at which the causal table matches it to an object.

    Args:
        tracks: tracks, as the filter went through them.
        truth: true boxes with positions, and perhaps with motion (`with_centres`).
        causal: the causal table, with the same identities.
        lags_s: lags (s).
        instants: all times at which the tracker gave output (s), if known.
        iou: smallest IoU of a match.
        others: more smoothers of whole tracks, by what they are called.

    Of objects that the picture's edge cuts a detector sees the centre of what is left: they are marked as
    `cut`, and left out where the truth does not say where the whole of them is.
    """
    frames = build_frames(truth, causal, kind="causal", instants=instants)
    matched = matched_errors(frames, iou=iou)
    assert matched is not None
    assert truth.motion is not None
    entry, row = matched.track_entry, frames.truth_row[matched.truth_entry]
    known = np.isfinite(truth.motion[frames.truth_row[matched.truth_entry], :2]).all(axis=1)
    identity, row, cut = frames.tracks.track_id[entry][known], row[known], matched.truncated[known]
    t = truth.t[row]
    more = {} if others is None else others
    names = ["filter", *(lag_name(lag) for lag in lags_s), "full", *more]
    parts: list[tuple[IntArray, IntArray, list[States]]] = []
    for track in with_progress(tracks):
        mine = np.flatnonzero(identity == track.track_id)
        mine = mine[(t[mine] >= track.t[0]) & (t[mine] <= track.t[-1])]
        mine = mine[t[mine] - track.t[last_record(track, t[mine])] <= _FURTHEST_S]
        if len(mine):
            filtered, lagged, full = states_at(track, t[mine], lags_s)
            beside = [states_by(track, t[mine], smooth(track)) for smooth in more.values()]
            parts.append((mine, _available(track, t[mine]), [filtered, *lagged, full, *beside]))
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
        cut=cut[order],
        height=truth.boxes[rows, 3],
        distance=None if truth.distance is None else truth.distance[rows],
    )


def _available(track: FilteredTrack, t: FloatArray) -> IntArray:
    """Bits (T,) of the sensors that gave the track a detection within `RECENT_S` before each time."""
    out = np.zeros(len(t), dtype=np.int64)
    for s in np.unique(track.sensor[track.sensor >= 0]).tolist():
        times = track.t[track.sensor == s]
        last = np.searchsorted(times, t + 1e-6, side="right") - 1
        recent = (last >= 0) & (t - times[np.maximum(last, 0)] <= RECENT_S)
        out |= recent.astype(np.int64) << int(s)
    return out


def errors_of(samples: Samples, name: str, rows: BoolArray | None = None) -> dict[str, float]:
    """RMSE of each part, and NEES per degree of freedom: of each part, and of the whole state."""
    chosen = np.ones(len(samples), dtype=np.bool_) if rows is None else rows
    state, truth = samples.states[name], samples.truth[chosen]
    error, cov = state.mean[chosen] - truth, state.cov[chosen]
    count = len(error)
    out: dict[str, float] = {"count": count}
    for part, columns in PARTS.items():
        out[f"{part}_rmse"] = float(np.sqrt((error[:, :, columns] ** 2).sum() / count)) if count else np.nan
    nees = error**2 / np.diagonal(cov, axis1=2, axis2=3)
    for k, part in enumerate(PARTS):
        out[f"anees_{part}"] = float(nees[:, :, k].mean()) if count else np.nan
    whole = (error * np.linalg.solve(cov, error[..., None])[..., 0]).sum(axis=2)
    out["anees_state"] = float(whole.mean() / 3.0) if count else np.nan
    out["anees_low"], out["anees_high"] = chi2_bounds(count, 2)
    return out


def by_availability(samples: Samples, sensors: Sequence[str]) -> dict[str, BoolArray]:
    """Samples (N,) by the sensors that had lately given the track a detection, most sensors first."""
    masks = sorted(np.unique(samples.available).tolist(), key=lambda m: (-int(m).bit_count(), m))
    groups = {}
    for mask in masks:
        names = [name for k, name in enumerate(sensors) if int(mask) >> k & 1]
        label = "none" if not names else f"{names[0]} only" if len(names) == 1 else " + ".join(names)
        groups[label] = samples.available == mask
    return groups


def by_distance(samples: Samples) -> dict[str, BoolArray] | None:
    """Samples (N,) by their distance from the camera (m); None where the truth does not tell it."""
    return None if samples.distance is None else _in_bins(samples.distance, _DISTANCES_M, "m")


def by_height(samples: Samples) -> dict[str, BoolArray]:
    """Samples (N,) by the height of the true box (px)."""
    return _in_bins(samples.height, _HEIGHTS_PX, "px")


def _in_bins(value: FloatArray, edges: Sequence[float], unit: str) -> dict[str, BoolArray]:
    groups = {}
    for low, high in pairwise(edges):
        label = f"{low:g}–{high:g} {unit}" if np.isfinite(high) else f"over {low:g} {unit}"
        groups[label] = (value >= low) & (value < high)
    return groups
