"""Tables with the columns of the highD data set: tracks, one row a vehicle about each, one row in all.

Their x runs along the road and y across it; x, y are the corner of the vehicle's box with the smallest
values, `width` is its extent along the road and `height` that across. Frames count from 1. Distances to the
vehicle ahead are from bumper to bumper.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.io.tables.table_writer import write_columns
from jeat_graph.road.exports.frames import RoadFrames

_AROUND = (
    "precedingId",
    "followingId",
    "leftPrecedingId",
    "leftAlongsideId",
    "leftFollowingId",
    "rightPrecedingId",
    "rightAlongsideId",
    "rightFollowingId",
)


def write_highd(frames: RoadFrames, folder: str | Path, name: str = "01") -> list[Path]:
    """Write `NAME_tracks.csv`, `NAME_tracksMeta.csv` and `NAME_recordingMeta.csv`; return their paths."""
    out = Path(folder)
    tables = {
        "tracks": track_columns(frames),
        "tracksMeta": meta_columns(frames),
        "recordingMeta": recording_columns(frames),
    }
    paths = []
    for kind, columns in tables.items():
        paths.append(out / f"{name}_{kind}.csv")
        write_columns(columns, paths[-1])
    return paths


def track_columns(frames: RoadFrames) -> dict[str, npt.NDArray[Any]]:
    """Rows of `tracks.csv`, by vehicle and then frame."""
    along, across = frames.xy[:, 1], frames.xy[:, 0]
    extent, breadth = frames.size[:, 0], frames.size[:, 1]
    sin, cos = np.sin(frames.heading), np.cos(frames.heading)
    lane = lane_numbers(frames)
    forward = cos >= 0
    around, gap = _surroundings(frames, lane, forward)
    row_of = {
        (f, i): k
        for k, (f, i) in enumerate(zip(frames.frame.tolist(), frames.track_id.tolist(), strict=True))
    }
    ahead = np.array(
        [row_of.get((f, i), -1) for f, i in zip(frames.frame.tolist(), around[:, 0].tolist(), strict=True)],
        dtype=np.int64,
    )
    has = around[:, 0] > 0
    preceding = np.where(has, np.where(forward, 1.0, -1.0)[ahead] * frames.speed[ahead], 0.0)
    closing = frames.speed - np.where(has, frames.speed[ahead], frames.speed)
    low, high = (float(along.min()), float(along.max())) if len(along) else (0.0, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        thw = np.where(has & (frames.speed > 0), gap / frames.speed, 0.0)
        ttc = np.where(has & (np.abs(closing) > 1e-6), gap / closing, 0.0)
    numbers = {
        "x": along - extent / 2.0,
        "y": across - breadth / 2.0,
        "width": extent,
        "height": breadth,
        "xVelocity": frames.speed * cos,
        "yVelocity": frames.speed * sin,
        "xAcceleration": frames.acceleration * cos,
        "yAcceleration": frames.acceleration * sin,
        "frontSightDistance": np.where(forward, high - along, along - low),
        "backSightDistance": np.where(forward, along - low, high - along),
        "dhw": np.where(has, gap, 0.0),
        "thw": thw,
        "ttc": ttc,
        "precedingXVelocity": preceding,
    }
    order = np.lexsort((frames.frame, frames.track_id))
    first = int(frames.frame.min()) if len(frames.frame) else 0
    columns: dict[str, npt.NDArray[Any]] = {
        "frame": (frames.frame - first + 1)[order],
        "id": (frames.track_id)[order],
    }
    columns |= {key: round_decimals(values, 3)[order] for key, values in numbers.items()}
    columns |= {key: around[order, k] for k, key in enumerate(_AROUND)}
    return columns | {"laneId": lane[order]}


def lane_numbers(frames: RoadFrames) -> IntArray:
    """Numbers of the lanes from left to right by their names, from 1; 0 for a vehicle in none (N,)."""
    names = [name for name in dict.fromkeys(frames.lane.tolist()) if name]
    middle = {name: float(np.median(frames.xy[frames.lane == name, 0])) for name in names}
    number = {name: k + 1 for k, name in enumerate(sorted(names, key=lambda name: middle[name]))}
    return np.array([number.get(name, 0) for name in frames.lane.tolist()], dtype=np.int64)


def _surroundings(frames: RoadFrames, lane: IntArray, forward: BoolArray) -> tuple[IntArray, FloatArray]:
    """Identities (N, 8) around each vehicle, 0 for none, and the gap (N,) to the one ahead (m)."""
    around = np.zeros((len(lane), len(_AROUND)), dtype=np.int64)
    gaps = np.zeros(len(lane))
    cuts = np.flatnonzero(np.diff(frames.frame)) + 1
    for rows in np.split(np.arange(len(lane)), cuts) if len(lane) else []:
        sign = np.where(forward[rows], 1.0, -1.0)
        # Distance of every other vehicle ahead of each, in its own direction.
        ahead = (frames.xy[rows, 1][None, :] - frames.xy[rows, 1][:, None]) * sign[:, None]
        half = (frames.size[rows, 0][None, :] + frames.size[rows, 0][:, None]) / 2.0
        apart = (lane[rows][None, :] - lane[rows][:, None]) * sign[:, None].astype(np.int64)
        same_way = (sign[None, :] == sign[:, None]) & (lane[rows] > 0)[None, :] & (lane[rows] > 0)[:, None]
        np.fill_diagonal(same_way, False)
        beside = np.abs(ahead) < half
        for place, (side, where) in enumerate(
            [(0, "ahead"), (0, "behind"), (-1, "ahead"), (-1, "beside"), (-1, "behind"),
             (1, "ahead"), (1, "beside"), (1, "behind")]
        ):  # fmt: skip
            fits = same_way & (apart == side)
            if where == "beside":
                fits &= beside
            else:
                fits &= (ahead > 0 if where == "ahead" else ahead < 0) & (~beside | (side == 0))
            distance = np.where(fits, np.abs(ahead), np.inf)
            best = distance.argmin(axis=1)
            there = np.isfinite(distance[np.arange(len(rows)), best])
            around[rows, place] = np.where(there, frames.track_id[rows][best], 0)
            if place == 0:
                gap = distance[np.arange(len(rows)), best] - half[np.arange(len(rows)), best]
                gaps[rows] = np.where(there, gap, 0.0)
    return around, gaps


def meta_columns(frames: RoadFrames) -> dict[str, npt.NDArray[Any]]:
    """Rows of `tracksMeta.csv`, one a vehicle."""
    first = int(frames.frame.min()) if len(frames.frame) else 0
    tracks = track_columns(frames)
    records: list[dict[str, Any]] = []
    for one in np.unique(frames.track_id).tolist():
        rows = np.flatnonzero(frames.track_id == one)
        own = tracks["id"] == one
        along = frames.speed[rows] * np.cos(frames.heading[rows])
        followed = own & (tracks["precedingId"] > 0)
        least = {
            f"min{name.upper()}": float(np.abs(tracks[name][followed]).min()) if followed.any() else -1.0
            for name in ("dhw", "thw", "ttc")
        }
        records.append(
            {
                "id": one,
                "width": frames.size[rows[0], 0],
                "height": frames.size[rows[0], 1],
                "initialFrame": int(frames.frame[rows].min()) - first + 1,
                "finalFrame": int(frames.frame[rows].max()) - first + 1,
                "numFrames": len(rows),
                "class": "Truck" if frames.kind[rows[0]] == "truck" else "Car",
                "drivingDirection": 2 if along.mean() >= 0 else 1,
                "traveledDistance": float(np.linalg.norm(np.diff(frames.xy[rows], axis=0), axis=1).sum()),
                "minXVelocity": float(np.abs(along).min()),
                "maxXVelocity": float(np.abs(along).max()),
                "meanXVelocity": float(np.abs(along).mean()),
                **least,
                "numLaneChanges": 0,
            }
        )
    names = list(records[0]) if records else ["id"]
    whole = ("id", "initialFrame", "finalFrame", "numFrames", "drivingDirection", "numLaneChanges")
    return {
        name: np.array([r[name] for r in records], dtype=np.int64 if name in whole else np.str_)
        if name in whole or name == "class"
        else round_decimals(np.array([r[name] for r in records], dtype=np.float64), 3)
        for name in names
    }


def recording_columns(frames: RoadFrames) -> dict[str, npt.NDArray[Any]]:
    """The row of `recordingMeta.csv`; what is not known (place, date, limit) is left at -1 or empty."""
    kinds = [str(frames.kind[frames.track_id == one][0]) for one in np.unique(frames.track_id)]
    trucks = sum(kind == "truck" for kind in kinds)
    duration = float(np.ptp(frames.frame)) / frames.rate_hz if len(frames.frame) else 0.0
    row: dict[str, Any] = {
        "id": 1,
        "frameRate": frames.rate_hz,
        "locationId": -1,
        "speedLimit": -1.0,
        "month": "",
        "weekDay": "",
        "startTime": "",
        "duration": round(duration, 3),
        "totalDrivenDistance": round(float(frames.speed.sum()) / frames.rate_hz, 3),
        "totalDrivenTime": round(len(frames.frame) / frames.rate_hz, 3),
        "numVehicles": len(kinds),
        "numCars": len(kinds) - trucks,
        "numTrucks": trucks,
        "upperLaneMarkings": _markings(frames, forward=False),
        "lowerLaneMarkings": _markings(frames, forward=True),
    }
    return {name: np.array([value]) for name, value in row.items()}


def _markings(frames: RoadFrames, forward: bool) -> str:
    """Lines between and beside the lanes of one direction, half way between their middles, as `a;b;c`."""
    way = (np.cos(frames.heading) >= 0) == forward
    lanes = [one for one in np.unique(frames.lane[way]).tolist() if one]
    middle = np.sort([float(np.median(frames.xy[(frames.lane == one) & way, 0])) for one in lanes])
    if not len(middle):
        return ""
    half = float(np.median(np.diff(middle))) / 2.0 if len(middle) > 1 else 1.8
    lines = np.concatenate([[middle[0] - half], (middle[1:] + middle[:-1]) / 2.0, [middle[-1] + half]])
    return ";".join(f"{value:.2f}" for value in lines)
