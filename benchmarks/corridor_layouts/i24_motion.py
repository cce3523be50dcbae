"""I-24 MOTION: trajectories of a whole highway, as JSON; two short windows of it stand for two cameras.

A file is a list of trajectories, or one a line, with `timestamp` (s), `x_position` and `y_position` (feet
along and across the road), `direction` (1 or −1), and others that are not looked at. Length and class are of
the whole trajectory: both windows would have the same number, so that they are left out. Source:
Gloudemans et al., I-24 MOTION: An instrument for freeway traffic science, *Transportation Research Part C*
155, 2023.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.corridor_layouts.record import CameraPair, CorridorLayout, passages_of
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError

_FEET_M = 0.3048
_LANE_FEET = 12.0
#: Distances from window to window (m), and half the length of a window (m).
_GAPS_M, _HALF_M = (200.0, 500.0, 1000.0), 10.0
#: The second clock is ahead by this (s), which has to be found.
_OFFSET_S = 17.0
_HEAD = 4096
_LEAST_POINTS, _SLOWEST = 3, 0.5
_WANTED = ("timestamp", "x_position", "y_position", "direction")


class _Drive(NamedTuple):
    """One trajectory: times (s), places along the direction of travel (m), lanes."""

    t: FloatArray
    along: FloatArray
    lane: IntArray


def _files(root: Path) -> list[Path]:
    return [root] if root.is_file() else sorted([*root.glob("*.json"), *root.glob("*.jsonl")])


def _recognise(root: Path) -> bool:
    for path in _files(root)[:1]:
        with path.open(encoding="utf-8", errors="replace") as file:
            head = file.read(_HEAD)
        return '"x_position"' in head or '"timestamp"' in head
    return False


def read_trajectories(path: Path) -> list[dict[str, Any]]:
    """Read the trajectories of a file.

    Raises:
        DataError: names the file and what is wrong.
    """
    text = path.read_text(encoding="utf-8")
    try:
        rows = (
            json.loads(text)
            if text.lstrip().startswith("[")
            else [json.loads(line) for line in text.splitlines() if line.strip()]
        )
    except ValueError as error:
        raise DataError(f"is not JSON: {error}", path) from None
    for number, row in enumerate(rows, 1):
        if not isinstance(row, dict) or any(name not in row for name in _WANTED):
            raise DataError(f"trajectory {number} must have {', '.join(_WANTED)}", path)
        lengths = {len(row[name]) for name in _WANTED[:3]}
        if len(lengths) != 1:
            raise DataError(f"trajectory {number}: its columns are not of one length", path)
    return rows


def _pairs(root: Path) -> Iterator[CameraPair]:
    for path in _files(root):
        rows = read_trajectories(path)
        for direction in sorted({int(row["direction"]) for row in rows}):
            drives = [_drive(row) for row in rows if int(row["direction"]) == direction]
            drives = [one for one in drives if len(one.t) >= _LEAST_POINTS]
            if not drives:
                continue
            # In the middle of what was seen: as many as possible drive through both windows.
            low = float(np.median([one.along.min() for one in drives]))
            high = float(np.median([one.along.max() for one in drives]))
            for gap in _GAPS_M:
                start = 0.5 * (low + high) - 0.5 * gap
                name = f"{path.stem} {'east' if direction > 0 else 'west'}"
                yield _pair(name, drives, start, gap)


def _drive(row: dict[str, Any]) -> _Drive:
    t = np.array(row["timestamp"], dtype=np.float64)
    along = np.array(row["x_position"], dtype=np.float64) * _FEET_M * int(row["direction"])
    lane = np.floor(np.abs(np.array(row["y_position"], dtype=np.float64)) / _LANE_FEET).astype(np.int64)
    return _Drive(t, along, lane)


def _pair(name: str, drives: list[_Drive], start_m: float, gap_m: float) -> CameraPair:
    sides = []
    for place, clock in ((start_m, 0.0), (start_m + gap_m, _OFFSET_S)):
        found = [(k, seen) for k, one in enumerate(drives) if (seen := _passage(one, place)) is not None]
        who = np.array([k for k, _ in found], dtype=np.int64)
        numbers = np.array([seen for _, seen in found], dtype=np.float64).reshape(-1, 3)
        lane = numbers[:, 2].astype(np.int64)
        sides.append((who, passages_of(f"{place:.0f} m", numbers[:, 0] + clock, numbers[:, 1], lane)))
    (first, before), (second, after) = sides
    return CameraPair(name, gap_m, 0.01 * gap_m, _OFFSET_S, before, after, first, second)


def _passage(one: _Drive, place_m: float) -> tuple[float, float, int] | None:
    """Time (s), speed (m/s) and lane at a place, from the window around it; None where it is not passed."""
    near = np.flatnonzero(np.abs(one.along - place_m) <= _HALF_M)
    if len(near) < _LEAST_POINTS or not one.along[near[0]] < place_m < one.along[near[-1]]:
        return None
    t, along = one.t[near], one.along[near]
    middle = t.mean()
    speed, at = np.polyfit(t - middle, along, 1)
    if speed < _SLOWEST:
        return None
    return float(middle + (place_m - at) / speed), float(speed), int(np.median(one.lane[near]))


LAYOUT = CorridorLayout(
    name="i24-motion",
    holds="I-24 MOTION: JSON with timestamp, x_position, y_position, direction",
    recognise=_recognise,
    pairs=_pairs,
)
