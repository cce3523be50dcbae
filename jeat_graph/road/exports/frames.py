"""The road's table at evenly spaced frames, as the formats of other programs want it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.steps import check_steps
from jeat_graph.io.tables.file_tables import read_table

_TABLES = ("road.csv", "road_smoothed.csv", "road_causal.csv")
_MOTION = ("x", "y", "speed_kmh", "heading_deg", "acceleration")
_SIZES = ("length", "width", "height")
_KMH = 3.6


class RoadFrames(NamedTuple):
    """Vehicles at frames, N rows, by frame and then identity.

    Attributes:
        rate_hz: frames per second; frame k is at k / rate_hz.
        frame: (N,) number of the frame.
        track_id: (N,) identity.
        xy: (N, 2) middle of the footprint on the road's axes (m).
        speed: (N,) m/s.
        heading: (N,) from the y axis towards x (rad).
        acceleration: (N,) along the way (m/s²).
        size: (N, 3) length, width, height (m), 0 where nothing tells.
        lane: (N,) name of the vehicle's lane, empty for none.
        kind: (N,) its class, empty where nothing tells.
    """

    rate_hz: float
    frame: IntArray
    track_id: IntArray
    xy: FloatArray
    speed: FloatArray
    heading: FloatArray
    acceleration: FloatArray
    size: FloatArray
    lane: npt.NDArray[np.str_]
    kind: npt.NDArray[np.str_]


def read_road_frames(source: str | Path, rate_hz: float) -> RoadFrames:
    """Read what `jeat-graph road` wrote and resample every vehicle to frames within its time.

    Args:
        source: its folder, or a table of the road.
        rate_hz: frames per second.

    Raises:
        DataError: there is no such table, or it is not valid.
    """
    folder = Path(source)
    found = [folder / name for name in _TABLES if (folder / name).is_file()] if folder.is_dir() else [folder]
    if not found:
        raise DataError(
            f"holds no table of a road ({', '.join(_TABLES)}): make one with jeat-graph road", source
        )
    table = read_table(found[0], ("t", "track_id", "x", "y", "speed_kmh", "heading_deg"))
    # A causal row may not know its speed yet: other programs take none without.
    known = np.isfinite(table.number("speed_kmh", blank_ok=True, nan_ok=True))

    def read(name: str) -> FloatArray:
        if name not in table:
            return np.zeros(int(known.sum()))
        return np.asarray(table.number(name, blank_ok=True, nan_ok=True)[known])

    t, ids = table.number("t")[known], table.whole("track_id")[known]
    columns = [read(name) for name in _MOTION]
    sizes = [np.nan_to_num(read(name)) for name in _SIZES]
    lanes = _by_vehicle(folder / "speeds.csv") if folder.is_dir() else {}
    order = np.lexsort((t, ids))
    cuts = np.flatnonzero(np.diff(ids[order])) + 1
    parts = []
    for rows in np.split(order, cuts) if len(order) else []:
        check_steps(float(t[rows[0]]), float(t[rows[-1]]), rate_hz, "frames")
        first, last = np.ceil(t[rows[0]] * rate_hz - 1e-6), np.floor(t[rows[-1]] * rate_hz + 1e-6)
        frame = np.arange(float(first), float(last) + 1.0)
        at = frame / rate_hz
        motion = [np.interp(at, t[rows], values[rows]) for values in columns]
        turned = np.unwrap(np.radians(columns[3][rows]))
        motion[3] = np.interp(at, t[rows], turned)
        size = [np.full(len(at), values[rows[0]]) for values in sizes]
        lane, kind = lanes.get(int(ids[rows[0]]), ("", ""))
        parts.append(_Part(frame, np.full(len(at), ids[rows[0]]), motion, size, lane, kind))
    return _joined(parts, rate_hz)


class _Part(NamedTuple):
    frame: FloatArray
    track_id: IntArray
    motion: list[FloatArray]
    size: list[FloatArray]
    lane: str
    kind: str


def _joined(parts: list[_Part], rate_hz: float) -> RoadFrames:
    frame = np.concatenate([np.zeros(0), *(p.frame for p in parts)]).astype(np.int64)
    ids = np.concatenate([np.zeros(0), *(p.track_id for p in parts)]).astype(np.int64)
    motion = np.concatenate([np.zeros((5, 0)), *(np.stack(p.motion) for p in parts)], axis=1)
    size = np.concatenate([np.zeros((3, 0)), *(np.stack(p.size) for p in parts)], axis=1)
    lane = np.array([p.lane for p in parts for _ in p.frame], dtype=np.str_)
    kind = np.array([p.kind for p in parts for _ in p.frame], dtype=np.str_)
    order = np.lexsort((ids, frame))
    return RoadFrames(
        rate_hz,
        frame[order],
        ids[order],
        motion[:2].T[order],
        motion[2][order] / _KMH,
        (motion[3][order] + np.pi) % (2.0 * np.pi) - np.pi,
        motion[4][order],
        size.T[order],
        lane[order],
        kind[order],
    )


def _by_vehicle(path: Path) -> dict[int, tuple[str, str]]:
    """Lane and class of each vehicle of `speeds.csv`; none where there is no such file."""
    if not path.is_file():
        return {}
    table = read_table(path, ("track_id", "lane", "class"))
    rows = zip(
        table.whole("track_id").tolist(),
        table.text("lane", blank_ok=True).tolist(),
        table.text("class", blank_ok=True).tolist(),
        strict=True,
    )
    return {track_id: (lane, kind) for track_id, lane, kind in rows}
