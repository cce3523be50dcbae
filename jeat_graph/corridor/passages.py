"""Vehicles as they pass the line of one camera, read from what `road` wrote.

A passage is when, in which lane, how fast, how long and of what class a vehicle was at that line. Standard
deviations come from the 95 % intervals of the tables, or from columns that state them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.normal import Z95
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.road.speeds import KMH

#: Of a crossing whose table does not state it: about the time between two pictures.
_USUAL_SIGMA_S = 0.03
#: Of the ln of a speed without an interval, and of the ln of a length without a variance.
_USUAL_SIGMA_SPEED = 0.03
_USUAL_SIGMA_LENGTH = 0.15
#: Slower than a pedestrian, nothing of travel times follows from a speed.
_LEAST_SPEED = 0.5
#: Two tracks of one vehicle are in one lane at one time: nobody follows closer than its own length.
_SAME_VEHICLE_S = 0.25
_SAME_SPEED = 0.25
#: Share of the crossings that may go the other way before it has to be said which way the traffic goes.
_OTHER_WAY_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Passages:
    """N vehicles at the line of a camera, in order of time.

    Attributes:
        camera: name of the camera.
        line: name of the line.
        track_id: (N,) identities at this camera.
        t: (N,) times by the camera's clock (s).
        sigma_t: (N,) standard deviations (s).
        log_speed: (N,) ln of the speed in m/s.
        sigma_speed: (N,) standard deviations of it.
        lane: (N,) places in `lanes`, −1 where unknown.
        log_length: (N,) ln of the length in m; NaN where unknown.
        sigma_length: (N,) standard deviations of it.
        kind: (N,) places in `kinds`, −1 where unknown.
        lanes: names of the lanes.
        kinds: names of the classes.
        span_s: begin and end of the recording (s).
        left_out: identities that are not among these, each with the reason.
        appearance: (N, E) what each looks like, NaN where that is not known; or None.
    """

    camera: str
    line: str
    track_id: IntArray
    t: FloatArray
    sigma_t: FloatArray
    log_speed: FloatArray
    sigma_speed: FloatArray
    lane: IntArray
    log_length: FloatArray
    sigma_length: FloatArray
    kind: IntArray
    lanes: tuple[str, ...]
    kinds: tuple[str, ...]
    span_s: tuple[float, float]
    left_out: tuple[tuple[int, str], ...] = ()
    appearance: FloatArray | None = None

    def __len__(self) -> int:
        """Number of vehicles."""
        return len(self.t)


def read_passages(
    folder: str | Path, camera: str, line: str | None = None, direction: str | None = None
) -> Passages:
    """Read the passages of one camera from a folder that `road` wrote.

    Args:
        folder: holds `crossings.csv` and `speeds.csv`.
        camera: what the camera is to be called.
        line: which line of `crossings.csv`; needed where there are several.
        direction: `left` or `right`, which crossings are of the traffic that goes through the corridor;
            needed where the line is crossed both ways.

    Raises:
        DataError: a table is missing or damaged, or it is not clear which line or direction is meant.
    """
    root = Path(folder)
    path = root / "crossings.csv"
    table = read_table(
        path,
        ("track_id", "line", "t", "speed_kmh"),
        ("lane", "low_kmh", "high_kmh", "direction", "sigma_t"),
    )
    lines = np.asarray(table.text("line"), dtype=np.str_)
    line = _chosen_line(lines, line, path)
    here = lines == line
    here &= _going(table, here, direction, path)
    track_id = table.whole("track_id")[here]
    t, kmh = table.number("t")[here], table.number("speed_kmh")[here]
    low, high = (_optional(table, name)[here] for name in ("low_kmh", "high_kmh"))
    sigma_t = np.where(np.isfinite(s := _optional(table, "sigma_t")[here]), s, _USUAL_SIGMA_S)
    lane = _texts(table, "lane")[here]
    order = np.lexsort((track_id, t))
    track_id, lane = track_id[order], lane[order]
    t, kmh, low, high, sigma_t = (values[order] for values in (t, kmh, low, high, sigma_t))
    slow = ~(kmh / KMH > _LEAST_SPEED)
    left_out = [
        (int(k), f"its speed at the line {line!r} is not known, or it stands") for k in track_id[slow]
    ]
    track_id, lane = track_id[~slow], lane[~slow]
    t, kmh, low, high, sigma_t = (values[~slow] for values in (t, kmh, low, high, sigma_t))
    sigma_speed = np.where(np.isfinite(high - low), (high - low) / (2.0 * Z95 * kmh), np.nan)
    sigma_speed = np.where(np.isfinite(sigma_speed), sigma_speed, _USUAL_SIGMA_SPEED)
    keep, doubled = _without_fragments(track_id, t, kmh, lane, sigma_speed)
    left_out += doubled
    log_length, sigma_length, kind_names, span_s = _of_vehicles(root / "speeds.csv", track_id)
    lanes, lane_code = _codes(lane[keep])
    kinds, kind = _codes(kind_names[keep])
    return Passages(
        camera, line, track_id[keep], t[keep], sigma_t[keep], np.log(kmh[keep] / KMH), sigma_speed[keep],
        lane_code, log_length[keep], sigma_length[keep], kind, lanes, kinds,
        (min(span_s[0], t.min(initial=np.inf)), max(span_s[1], t.max(initial=-np.inf))), tuple(left_out),
    )  # fmt: skip


def _chosen_line(lines: np.ndarray, line: str | None, path: Path) -> str:
    names = sorted(set(lines.tolist()))
    if not names:
        raise DataError("has no crossings: nothing passes this camera's line", path)
    if line is None and len(names) > 1:
        raise DataError(f"has the lines {', '.join(names)}: say which with --line CAMERA={names[0]}", path)
    if line is not None and line not in names:
        raise DataError(f"has no line {line!r}: there are {', '.join(names)}", path)
    return names[0] if line is None else line


def _going(table: FileTable, here: np.ndarray, direction: str | None, path: Path) -> np.ndarray:
    """Which crossings are of the traffic that goes through the corridor."""
    ways = _texts(table, "direction")
    if direction is not None:
        if not (ways[here] == direction).any():
            raise DataError(f"nothing crosses its line to the {direction}", path)
        return np.asarray(ways == direction)
    names, counts = np.unique(ways[here], return_counts=True)
    if counts.min() > _OTHER_WAY_SHARE * counts.sum() and len(names) > 1:
        both = ", ".join(f"{n} to the {name}" for name, n in zip(names, counts, strict=True))
        raise DataError(f"its line is crossed both ways ({both}): say --direction CAMERA=left or right", path)
    return np.asarray(ways == names[np.argmax(counts)])


def _without_fragments(
    track_id: IntArray, t: FloatArray, kmh: FloatArray, lane: np.ndarray, sigma_speed: FloatArray
) -> tuple[IntArray, list[tuple[int, str]]]:
    """Keep one of two tracks that pass in one lane at one time with one speed: the one that is surer."""
    replaced: dict[int, int] = {}
    for k in range(1, len(t)):
        for other in range(k - 1, -1, -1):
            if t[k] - t[other] > _SAME_VEHICLE_S:
                break
            similar = lane[k] == lane[other] and abs(np.log(kmh[k] / kmh[other])) < _SAME_SPEED
            if similar and other not in replaced:
                worse, better = (k, other) if sigma_speed[k] >= sigma_speed[other] else (other, k)
                replaced[worse] = better
                break
    keep = np.array([k for k in range(len(t)) if k not in replaced], dtype=np.int64)
    return keep, [
        (int(track_id[k]), f"passes with {int(track_id[b])}, as a second track of one vehicle does")
        for k, b in replaced.items()
    ]


def _of_vehicles(
    path: Path, track_id: IntArray
) -> tuple[FloatArray, FloatArray, np.ndarray, tuple[float, float]]:
    """Lengths (ln m, with standard deviations) and classes of the tracks, and the recording's span (s)."""
    table = read_table(path, ("track_id", "t_first", "t_last"), ("class", "length", "sigma_length"), short=())
    place = {int(k): row for row, k in enumerate(table.whole("track_id"))}
    rows = np.array([place.get(int(k), -1) for k in track_id], dtype=np.int64)
    if (rows < 0).any():
        raise DataError(f"has no track {int(track_id[rows < 0][0])}, which crossings.csv has", path)
    length, sigma = _optional(table, "length")[rows], _optional(table, "sigma_length")[rows]
    with np.errstate(invalid="ignore", divide="ignore"):
        log_length = np.where(length > 0.0, np.log(length), np.nan)
        relative = np.where(np.isfinite(sigma), sigma / length, _USUAL_SIGMA_LENGTH)
    first, last = table.number("t_first"), table.number("t_last")
    span = (float(first.min()), float(last.max())) if len(first) else (np.inf, -np.inf)
    return log_length, relative, _texts(table, "class")[rows], span


def _optional(table: FileTable, name: str) -> FloatArray:
    return table.number(name, blank_ok=True) if name in table else np.full(len(table), np.nan)


def _texts(table: FileTable, name: str) -> np.ndarray:
    return (
        np.asarray(table.text(name, blank_ok=True), dtype=np.str_)
        if name in table
        else np.full(len(table), "", "<U1")
    )


def _codes(names: np.ndarray) -> tuple[tuple[str, ...], IntArray]:
    """Distinct names but the empty one, and the place (N,) of each, −1 where it is empty."""
    known = tuple(sorted(set(names.tolist()) - {""}))
    place = {name: k for k, name in enumerate(known)} | {"": -1}
    return known, np.array([place[name] for name in names.tolist()], dtype=np.int64)
