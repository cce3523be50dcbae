"""Tracks on the road against truth in metres: errors of place and speed, and whether their intervals hold."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.normal import Z95
from jeat_graph.io.tables.file_tables import read_table

_TRUE = ("x", "y", "speed_kmh")
_ESTIMATED = (*_TRUE, "var_x", "var_y", "var_speed_kmh")
#: Of a row of a table of tracks that may be blank: a speed that is not known yet.
_SPEED = ("speed_kmh", "var_speed_kmh")


@dataclass(frozen=True)
class RoadJudging:
    """Which rows count, and which true vehicle a track is taken for."""

    near_m: float = number(20.0, "m", "nearest place along the road that counts")
    far_m: float = number(100.0, "m", "farthest place along the road that counts", open_low=True)
    gate_across_m: float = number(1.5, "m", "a track is at a vehicle that is so near across", open_low=True)
    gate_along_m: float = number(8.0, "m", "and so near along the road", open_low=True)
    least_share: float = number(0.5, "1", "share of a track's rows that have to be at its vehicle", 0.0, 1.0)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, eq=False)
class RoadRows:
    """Rows of some vehicles on the road, by identity and then time.

    Attributes:
        t: (N,) time (s).
        identity: (N,) of the track or the true vehicle.
        values: (N, 3) x, y (m), speed (km/h); of tracks (N, 6), with their variances; a speed that is not
            known yet is NaN.
    """

    t: FloatArray
    identity: IntArray
    values: FloatArray

    def each(self) -> list[RoadRows]:
        """The rows of each vehicle."""
        cuts = np.flatnonzero(np.diff(self.identity)) + 1
        parts = np.split(np.arange(len(self.t)), cuts) if len(self.t) else []
        return [RoadRows(self.t[p], self.identity[p], self.values[p]) for p in parts]


def read_road_truth(path: str | Path) -> RoadRows:
    """Read `t, object_id, x, y, speed_kmh`, such as the simulator's `gt_road.csv`.

    Raises:
        DataError: names the file, the line and what is wrong.
    """
    return _read(path, "object_id", _TRUE)


def read_road_tracks(path: str | Path) -> RoadRows:
    """Read a table of the road with its variances (`road.csv`, `road_causal.csv`, `road_smoothed.csv`).

    Raises:
        DataError: names the file, the line and what is wrong.
    """
    return _read(path, "track_id", _ESTIMATED, _SPEED)


def _read(path: str | Path, identity: str, columns: tuple[str, ...], blank: tuple[str, ...] = ()) -> RoadRows:
    table = read_table(path, ("t", identity, *columns))
    t, ids = table.number("t"), table.whole(identity)
    values = np.stack(
        [table.number(name, blank_ok=name in blank, nan_ok=name in blank) for name in columns], axis=1
    )
    order = np.lexsort((t, ids))
    return RoadRows(t[order], ids[order], values[order])


def share_held(error: FloatArray, var: FloatArray) -> FloatArray:
    """Per cent of errors (N, ...) within the 95 % intervals of normal errors of these variances (...)."""
    return np.asarray(100.0 * (np.abs(error) <= Z95 * np.sqrt(var)).mean(axis=0), dtype=np.float64)


class Matched(NamedTuple):
    """A track and the vehicle that it is.

    Attributes:
        track_id: identity of the track.
        t: (N,) times of its rows during the vehicle's life (s).
        true: (N, 3) x, y (m), speed (km/h) of the vehicle.
        found: (N, 6) what the track says of them, with variances.
    """

    track_id: int
    t: FloatArray
    true: FloatArray
    found: FloatArray


@dataclass(frozen=True, eq=False)
class RoadErrors:
    """Errors of rows that count.

    Attributes:
        error: (N, 3) across, along (m), speed (km/h): estimate less truth; NaN where no speed is stated.
        var: (N, 3) variances as stated.
        tracks: how many tracks they are of.
        t: (N,) times (s).
        track_id: (N,) identities of the tracks.
        along: (N,) true places along the road (m).
    """

    error: FloatArray
    var: FloatArray
    tracks: int
    t: FloatArray
    track_id: IntArray
    along: FloatArray

    def take(self, rows: BoolArray | IntArray) -> RoadErrors:
        """Return some of the rows."""
        track_id = self.track_id[rows]
        columns = (self.t[rows], track_id, self.along[rows])
        return RoadErrors(self.error[rows], self.var[rows], len(np.unique(track_id)), *columns)

    def scores(self) -> dict[str, float | int]:
        """Root mean squares, normalised squares and the shares of 95 % intervals that hold.

        Scores of the speed are over the rows that state one, whose share is `speed_known` (%).
        """
        if not len(self.error):
            return {"rows": 0, "tracks": 0}
        place, place_var = self.error[:, :2], self.var[:, :2]
        known = np.isfinite(self.error[:, 2])
        speed, speed_var = self.error[known, 2], self.var[known, 2]
        held = share_held(place, place_var)
        rmse = np.sqrt((place**2).mean(axis=0))
        scores: dict[str, float | int] = {"across_rmse_m": float(rmse[0]), "along_rmse_m": float(rmse[1])}
        if known.any():
            scores |= {
                "speed_rmse_kmh": float(np.sqrt((speed**2).mean())),
                "speed_median_kmh": float(np.median(np.abs(speed))),
                "speed_bias_kmh": float(speed.mean()),
                "speed_nees": float((speed**2 / speed_var).mean()),
                "speed_held": float(share_held(speed, speed_var)),
            }
        return scores | {
            # Two coordinates: one where the covariances are right.
            "nees": float((place**2 / place_var).mean()),
            "across_held": float(held[0]),
            "along_held": float(held[1]),
            "speed_known": float(100.0 * known.mean()),
            "rows": len(self.error),
            "tracks": self.tracks,
        }


def judge_road(tracks: RoadRows, truth: RoadRows, config: RoadJudging) -> RoadErrors:
    """Compare tracks with the true vehicles that they are at for most of their time.

    Truth is interpolated to the tracks' times. Which vehicle a track is taken for is decided over its whole
    life; all of its rows then count, those far off too. A vehicle is one track's at a time, the one's that is
    at it for longest: a false track that vehicles drive by is none of them.

    Args:
        tracks: estimates with variances.
        truth: of the same recording.
        config: which rows count.

    Raises:
        DataError: truth without rows.
    """
    errors, variances, count = [np.zeros((0, 3))], [np.zeros((0, 3))], 0
    t, ids = [np.zeros(0)], [np.zeros(0, dtype=np.int64)]
    y = [np.zeros(0)]
    for one in matched(tracks, truth, config):
        counts = (one.true[:, 1] >= config.near_m) & (one.true[:, 1] <= config.far_m)
        errors.append((one.found[:, :3] - one.true)[counts])
        variances.append(one.found[counts, 3:])
        t.append(one.t[counts])
        y.append(one.true[counts, 1])
        ids.append(np.full(int(counts.sum()), one.track_id))
        count += bool(counts.any())
    return RoadErrors(
        *(np.concatenate(errors), np.concatenate(variances), count),
        *(np.concatenate(t), np.concatenate(ids), np.concatenate(y)),
    )


class _Pair(NamedTuple):
    """A track and a vehicle that it may be.

    Attributes:
        track: place of the track.
        vehicle: place of the vehicle.
        during: which of the track's rows are during the vehicle's life.
        true: (K, 3) the vehicle at the times of those.
        near: (N,) times at which the track is at the vehicle (s).
    """

    track: int
    vehicle: int
    during: BoolArray
    true: FloatArray
    near: FloatArray


def matched(tracks: RoadRows, truth: RoadRows, config: RoadJudging) -> list[Matched]:
    """Tell which vehicle each track is, and list the track's rows beside the truth; as `judge_road`.

    Raises:
        DataError: truth without rows.
    """
    vehicles, all_tracks = truth.each(), tracks.each()
    if not vehicles:
        raise DataError("the truth on the road has no rows")
    gate = np.array([config.gate_across_m, config.gate_along_m])
    pairs: list[_Pair] = []
    for k, track in enumerate(all_tracks):
        for v, one in enumerate(vehicles):
            during, true = _beside(track, one)
            near = (np.abs(true[:, :2] - track.values[during, :2]) < gate).all(axis=1)
            if near.sum() > config.least_share * len(track.t):
                pairs.append(_Pair(k, v, during, true, track.t[during][near]))
    taken: dict[int, list[FloatArray]] = {}
    chosen: dict[int, _Pair] = {}
    for pair in sorted(pairs, key=lambda one: -len(one.near)):
        free = np.ones(len(pair.near), dtype=np.bool_)
        for other in taken.get(pair.vehicle, []):
            free &= (pair.near < other[0]) | (pair.near > other[-1])
        if pair.track not in chosen and free.sum() > config.least_share * len(all_tracks[pair.track].t):
            chosen[pair.track] = pair
            taken.setdefault(pair.vehicle, []).append(pair.near)
    out = []
    for k in sorted(chosen):
        track, pair = all_tracks[k], chosen[k]
        found = track.values[pair.during]
        out.append(Matched(int(track.identity[0]), track.t[pair.during], pair.true, found))
    return out


def _beside(track: RoadRows, vehicle: RoadRows) -> tuple[BoolArray, FloatArray]:
    """Which rows of a track (N,) are during a vehicle's life, and the truth at those (K, 3)."""
    during = np.asarray((track.t >= vehicle.t[0]) & (track.t <= vehicle.t[-1]))
    true = [np.interp(track.t[during], vehicle.t, column) for column in vehicle.values.T]
    return during, np.stack(true, axis=1)


def judge_road_run(
    run: str | Path, truth: str | Path, config: RoadJudging | None = None
) -> dict[str, dict[str, float | int]]:
    """Scores by table of a folder that holds tables of the road, or of one table.

    Raises:
        DataError: there is no table of a road, or a file is not valid.
    """
    path, names = Path(run), ("road_causal.csv", "road_smoothed.csv", "road.csv")
    files = [path / name for name in names if (path / name).is_file()] if path.is_dir() else [path]
    if not files:
        raise DataError("holds no table of a road: track with --camera, or use jeat-graph road", run)
    true, settings = read_road_truth(truth), config or RoadJudging()
    return {file.stem: judge_road(read_road_tracks(file), true, settings).scores() for file in files}
