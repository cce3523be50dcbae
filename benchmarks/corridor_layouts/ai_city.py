"""AI City's multi-camera tracking (CityFlow): folders of a scenario with a folder for each camera.

`S01/c001/gt/gt.txt` has `frame, ID, left, top, width, height, …` with identities of the whole scenario,
`S01/c001/calibration.txt` the homography from latitude and longitude to the picture, and
`cam_timestamp/S01.txt` beside the scenarios, or above them, when each camera began (s). Cameras run
at 10 Hz, c015 at 8 Hz. Source: Tang et al., CityFlow: A city-scale benchmark for multi-target multi-camera
vehicle tracking and re-identification, CVPR 2019.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.corridor_layouts.record import CameraPair, CorridorLayout, passages_of
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError

_RATE_HZ, _RATES_HZ = 10.0, {"c015": 8.0}
_EARTH_M = 6_371_000.0
#: A passage is fitted to so many seconds before and after it.
_REACH_S, _LEAST_POINTS, _SLOWEST = 0.6, 4, 0.5
#: Fewer vehicles in common than this tell nothing of a pair.
_LEAST_COMMON = 10
_NAME = "Homography matrix:"


class _CitySeen(NamedTuple):
    """Vehicles at the middle of a camera's view: identities, times from the camera's start (s), speeds (m/s).

    `place` is where most of them are then: latitude and longitude in rad.
    """

    who: IntArray
    t: FloatArray
    speed: FloatArray
    place: FloatArray


def _recognise(root: Path) -> bool:
    return root.is_dir() and any(root.rglob("c[0-9]*/calibration.txt"))


def read_homography(path: Path) -> FloatArray:
    """Read the homography (3, 3) from latitude and longitude in degrees to the picture (px).

    Raises:
        DataError: names the file and what is wrong.
    """
    text = path.read_text(encoding="utf-8")
    rows = text.split(_NAME, 1)[-1].strip().splitlines()[:1]
    try:
        matrix = np.array([[float(x) for x in row.split()] for row in rows[0].split(";")])
    except (ValueError, IndexError):
        matrix = np.zeros(0)
    if matrix.shape != (3, 3) or abs(np.linalg.det(matrix)) == 0.0:
        raise DataError(f"must begin with `{_NAME}` and three rows of three numbers, divided by ;", path)
    return matrix


def read_starts(path: Path) -> dict[str, float]:
    """Read when each camera began (s), a line `c001 1.640` each.

    Raises:
        DataError: names the first line that is none.
    """
    found = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        try:
            name, start = line.split()
            found[name] = float(start)
        except ValueError:
            raise DataError("must be a camera and when it began (s)", path, number) from None
    return found


def _pairs(root: Path) -> Iterator[CameraPair]:
    scenarios = sorted({path.parents[1] for path in root.rglob("c[0-9]*/calibration.txt")})
    for folder in scenarios:
        times = [parent / "cam_timestamp" / f"{folder.name}.txt" for parent in folder.parents]
        file = next((path for path in times if path.is_file()), None)
        if file is None:
            raise DataError(f"has no cam_timestamp/{folder.name}.txt beside or above it", folder)
        starts = read_starts(file)
        cameras = sorted(path for path in folder.iterdir() if (path / "gt" / "gt.txt").is_file())
        seen = {path.name: _seen(path) for path in cameras}
        for (a, first), (b, second) in itertools.combinations(seen.items(), 2):
            if a not in starts or b not in starts:
                raise DataError(f"says nothing of {a if a not in starts else b}", file)
            pair = _pair(f"{folder.name} {a}-{b}", (first, starts[a]), (second, starts[b]))
            if pair is not None:
                yield pair


def _seen(folder: Path) -> _CitySeen:
    """Where and when the vehicles of a camera pass the middle of what it sees of them."""
    path = folder / "gt" / "gt.txt"
    try:
        rows = np.loadtxt(path, delimiter=",", ndmin=2, usecols=range(6))
    except ValueError as error:
        raise DataError(f"must have frame, ID, left, top, width, height: {error}", path) from None
    to_map = np.linalg.inv(read_homography(folder / "calibration.txt"))
    foot = np.c_[rows[:, 2] + 0.5 * rows[:, 4], rows[:, 3] + rows[:, 5], np.ones(len(rows))]
    image = foot @ to_map.T
    place = np.radians(image[:, :2] / image[:, 2:])
    middle = np.median(place, axis=0)
    metres = _metres(place, middle)
    t = (rows[:, 0] - 1.0) / _RATES_HZ.get(folder.name, _RATE_HZ)
    found = []
    for who in np.unique(rows[:, 1]):
        own = np.flatnonzero(rows[:, 1] == who)
        own = own[np.argsort(t[own], kind="stable")]
        nearest = t[own[np.linalg.norm(metres[own], axis=1).argmin()]]
        near = own[np.abs(t[own] - nearest) <= _REACH_S]
        if len(near) >= _LEAST_POINTS:
            slope = np.polyfit(t[near] - nearest, metres[near], 1)[0]
            if (speed := float(np.linalg.norm(slope))) > _SLOWEST:
                found.append((who, nearest, speed))
    numbers = np.array(found, dtype=np.float64).reshape(-1, 3)
    return _CitySeen(numbers[:, 0].astype(np.int64), numbers[:, 1], numbers[:, 2], middle)


def _metres(place: FloatArray, origin: FloatArray) -> FloatArray:
    """North and east (N, 2) in m of places (N, 2) in rad, on a plane that touches the globe."""
    off = place - origin
    return np.asarray(_EARTH_M * off * np.array([1.0, np.cos(origin[0])]))


def _pair(name: str, a: tuple[_CitySeen, float], b: tuple[_CitySeen, float]) -> CameraPair | None:
    """Put two cameras together, the one that most pass first in front; None if they have few in common."""
    common = np.intersect1d(a[0].who, b[0].who)
    if len(common) < _LEAST_COMMON:
        return None
    at = [start + one.t[np.searchsorted(one.who, common)] for one, start in (a, b)]
    (first, begun), (second, later) = (a, b) if np.median(at[1] - at[0]) > 0.0 else (b, a)
    distance = float(np.linalg.norm(_metres(second.place, first.place)))
    before, after = (
        passages_of(side, one.t, one.speed, np.full(len(one.t), -1))
        for side, one in (("A", first), ("B", second))
    )
    # In a straight line: roads bend.
    return CameraPair(name, distance, 0.1 * distance, begun - later, before, after, first.who, second.who)


LAYOUT = CorridorLayout(
    name="ai-city",
    holds="AI City: S01/c001/gt/gt.txt, calibration.txt, cam_timestamp",
    recognise=_recognise,
    pairs=_pairs,
)
