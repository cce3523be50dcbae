"""Vehicles as rectangles that move over the road, with what is not known of them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError

_KMH = 3.6
#: Columns that have a variance: x, y (m), speed (km/h), heading (degrees), length, width (m).
_STATES = ("x", "y", "speed_kmh", "heading_deg", "length", "width")
_UNITS = np.array([1.0, 1.0, 1.0 / _KMH, np.pi / 180.0, 1.0, 1.0])
#: A vehicle slower than this (m/s) does not show where it faces.
_DRIVES = 2.0
X, Y, SPEED, HEADING, LENGTH, WIDTH = range(6)


class Poses(NamedTuple):
    """A vehicle at its times.

    Attributes:
        track_id: its identity.
        kind: its class, empty where unknown.
        t: (N,) times, ascending (s).
        mean: (N, 6) x, y of the middle (m), speed (m/s), heading (rad, from the y axis towards x), length and
            width (m).
        sigma: (N, 6) standard deviations of them.
    """

    track_id: int
    kind: str
    t: FloatArray
    mean: FloatArray
    sigma: FloatArray

    def at(self, t: FloatArray) -> Poses:
        """Return it at other times within its own, by linear interpolation."""
        mean = np.stack([np.interp(t, self.t, column) for column in self.mean.T], axis=-1)
        sigma = np.stack([np.interp(t, self.t, column) for column in self.sigma.T], axis=-1)
        return Poses(self.track_id, self.kind, t, mean, sigma)

    def drawn(self, z: FloatArray) -> FloatArray:
        """States (K, N, 6) with errors z (K, 6), which last for as long as an encounter does."""
        mean, sigma = self.mean.T[:, None], self.sigma.T[:, None]
        # A state's values lie side by side in memory: it is one state at a time that is worked with.
        out: FloatArray = np.moveaxis(mean + z.T[:, :, None] * sigma, 0, -1)
        out[..., SPEED] = np.maximum(out[..., SPEED], 0.0)
        out[..., LENGTH:] = np.maximum(out[..., LENGTH:], 0.1)
        return out


def read_poses(source: str | Path) -> tuple[list[Poses], int]:
    """Read what `road` wrote: vehicles that drive and have a size, by identity, and how many do not.

    Args:
        source: a folder that `road` wrote, or a table of it.

    Raises:
        DataError: it has no such table, or no vehicle has a size.
    """
    from jeat_graph.io.tables.file_tables import read_table

    path = Path(source)
    if path.is_dir():
        path = path / "road.csv"
        if not path.is_file():
            raise DataError("holds no road.csv: make it with jeat-graph road", source)
    names = ("t", "track_id", *_STATES, *(f"var_{name}" for name in _STATES))
    table = read_table(path, names)
    t, ids = table.number("t"), table.whole("track_id")

    def read(prefix: str) -> FloatArray:
        columns = [table.number(prefix + name, blank_ok=True, nan_ok=True) for name in _STATES]
        return np.stack(columns, axis=1) if len(t) else np.zeros((0, len(_STATES)))

    mean, sigma = read("") * _UNITS, np.sqrt(np.maximum(read("var_"), 0.0)) * _UNITS
    known = np.all(np.isfinite(mean) & np.isfinite(sigma), axis=1)
    kinds = _kinds(path.with_name("speeds.csv"))
    vehicles, unknown = [], 0
    order = np.lexsort((t, ids))
    for rows in np.split(order, np.flatnonzero(np.diff(ids[order])) + 1) if len(order) else []:
        own = rows[known[rows]]
        if len(own) < 2:
            unknown += 1
            continue
        states, spread = mean[own], sigma[own]
        drives = np.flatnonzero(states[:, SPEED] >= _DRIVES)
        if not len(drives):
            unknown += 1
            continue
        # While it stands it faces as it did when it drove last, or will drive next.
        after = np.minimum(np.searchsorted(drives, np.arange(len(own))), len(drives) - 1)
        before = np.maximum(after - 1, 0)
        nearer = np.arange(len(own)) - drives[before] < drives[after] - np.arange(len(own))
        known_at = drives[np.where(nearer, before, after)]
        states[:, HEADING], spread[:, HEADING] = states[known_at, HEADING], spread[known_at, HEADING]
        states[:, HEADING] = np.unwrap(states[:, HEADING])
        track = int(ids[own[0]])
        vehicles.append(Poses(track, kinds.get(track, ""), t[own], states, spread))
    if unknown and not vehicles:
        raise DataError(
            "no vehicle has a length and a width: make it from boxes (road RUN), not from points", path
        )
    return vehicles, unknown


def _kinds(path: Path) -> dict[int, str]:
    from jeat_graph.io.tables.file_tables import read_table

    if not path.is_file():
        return {}
    table = read_table(path, ("track_id", "class"))
    kinds = table.text("class", blank_ok=True).tolist()
    return dict(zip(table.whole("track_id").tolist(), kinds, strict=True))
