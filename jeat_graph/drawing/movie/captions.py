"""What stands beside the boxes of a film: number, class and speed of a track."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray, TextArray
from jeat_graph.data.trajectories import Trajectories

#: What a caption may hold, in its order.
NUMBER, CLASS, SPEED = "id", "class", "speed"
PARTS = (CLASS, NUMBER, SPEED)
_TOLERANCE_S = 1e-6
_ByTrack = Mapping[int, tuple[FloatArray, FloatArray | TextArray]]
#: A speed is of so much before or after (s).
_REACH_S = 0.5


class Captions:
    """Captions of tracks by time.

    Args:
        table: the tracks, of which the classes are taken.
        parts: which of `PARTS` are written.
        speeds: time (N,) in s, track (N,) and speed (N,) in km/h, or None where no road says them.
    """

    def __init__(
        self,
        table: Trajectories,
        parts: tuple[str, ...],
        speeds: tuple[FloatArray, IntArray, FloatArray] | None = None,
    ) -> None:
        self._parts = parts
        self._classes: _ByTrack = {}
        if table.classes is not None:
            labelled = table.classes != ""
            self._classes = _by_track(table.t[labelled], table.track_id[labelled], table.classes[labelled])
        self._speeds: _ByTrack = {} if speeds is None else _by_track(*speeds)

    def of(self, track_id: int, t: float) -> str:
        """Return the caption of a track at a time (s): its class is the one that it was last said to have."""
        texts = []
        if CLASS in self._parts and track_id in self._classes:
            times, names = self._classes[track_id]
            until = int(np.searchsorted(times, t + _TOLERANCE_S, side="right"))
            texts += [str(name) for name in names[:until][-1:]]
        if NUMBER in self._parts:
            texts.append(f"#{track_id}" if texts else str(track_id))
        caption = " ".join(texts)
        if SPEED in self._parts and track_id in self._speeds:
            speed = _near(*self._speeds[track_id], t)
            if not math.isnan(speed):
                return f"{caption}: {speed:.0f} km/h" if caption else f"{speed:.0f} km/h"
        return caption


def read_speeds(path: Path) -> tuple[FloatArray, IntArray, FloatArray]:
    """Read time (s), track and speed (km/h) of a table of the road (`road.csv`, `road_causal.csv`, …).

    A speed is NaN where its interval is too wide for `road` to tell it, and where the vehicle's own in a
    `speeds.csv` beside the table is blank.

    Raises:
        DataError: it is none.
    """
    from jeat_graph.data.normal import Z95
    from jeat_graph.io.tables.file_tables import read_table
    from jeat_graph.road.speeds import is_reported

    table = read_table(path, ("t", "track_id", "speed_kmh", "var_speed_kmh"))
    speed = table.number("speed_kmh", blank_ok=True, nan_ok=True)
    reach = Z95 * np.sqrt(table.number("var_speed_kmh", blank_ok=True, nan_ok=True))
    track = table.whole("track_id")
    pairs = zip(speed.tolist(), reach.tolist(), strict=True)
    known = np.array([is_reported(v, r) for v, r in pairs], dtype=bool)
    beside = path.with_name("speeds.csv")
    if path.name == "road.csv" and beside.is_file():
        own = read_table(beside, ("track_id", "speed_kmh"))
        blank = np.isnan(own.number("speed_kmh", blank_ok=True, nan_ok=True))
        known &= ~np.isin(track, own.whole("track_id")[blank])
    return table.number("t"), track, np.where(known, speed, np.nan)


def _by_track(t: FloatArray, track_id: IntArray, values: FloatArray | TextArray) -> _ByTrack:
    """Return times and values of each track, in order of time."""
    order = np.lexsort((t, track_id))
    ids = track_id[order]
    if not len(ids):
        return {}
    begins = np.flatnonzero(np.diff(ids, prepend=ids[0] - 1))
    return {
        int(ids[begin]): (t[rows], values[rows])
        for begin, rows in zip(begins, np.split(order, begins[1:]), strict=True)
    }


def _near(times: FloatArray, values: FloatArray | TextArray, t: float) -> float:
    nearest = int(np.abs(times - t).argmin())
    return float(values[nearest]) if abs(times[nearest] - t) <= _REACH_S else math.nan
