"""Our own arrays of a fixed-lag window: filtered states and measurements, from which all can be rebuilt.

A window is a sequence of *rows* in order of time. Most rows are keys, states that the smoother
estimates; a row that is none is a measurement that came late, between two keys. What lies before the
window is summed up in its *base*, the filtered state at the first row.

The arrays are longer than what they hold: new rows are written behind the last one, old ones are left
behind, and only when the end of an array is reached everything moves, so that a chunk costs no copies.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.smoothers.backward import smooth_rows
from jeat_graph.smoothers.forward import filter_rows
from jeat_graph.smoothers.measurements import COINCIDENT_S
from jeat_graph.smoothers.track_data import Prior

_ROWS = ("t", "q", "is_key", "anchor", "mean", "cov", "reference")
_TAKEN = ("row", "z", "info", "lever", "error", "gain", "innovation", "variance")
_ROOM = 64


class Window:
    """Rows of one track's window.

    Args:
        prior: what is known of the state at the first key before the measurements.
        memory: (n - 3,) memory of the error states (s).

    Attributes:
        first: the first row of the window, as an index into all arrays of rows.
        end: the row after the last.
        taken: the first measurement of the window, as an index into all arrays of measurements.
        taken_end: the measurement after the last.
        late: how many rows are no keys.
        base_mean: (2, n) state at the first row given all before it, and given the row's own measurements
            only once they are no longer kept.
        base_cov: (2, n, n) its covariance.
        memory: (n - 3,) memory of the error states (s).
        t: (N,) times (s).
        q: (N,) root spectral density of the jerk over the interval that ends at the row (px/s^2.5).
        is_key: (N,) whether the row is a key; the first and the last row always are.
        anchor: (N,) number of the row's state inside GTSAM, or -1.
        mean: (N, 2, n) filtered means.
        cov: (N, 2, n, n) filtered covariances.
        reference: (N, 2, n) filtered means as they were when the row came: unlike `mean`, no late
            measurement changes them.
        row: (M,) row of each measurement, ascending.
        z: (M, 2) measurements (px).
        info: (M, 2) information of their white parts (1/px²).
        lever: (M, 2) factor of their error states (px).
        error: (M,) index of these, or -1.
        gain: (M, 2, n) gain with which the filter took it in.
        innovation: (M, 2) its innovation (px).
        variance: (M, 2) the variance of that (px²).
    """

    def __init__(self, prior: Prior, memory: FloatArray) -> None:
        mean, cov = np.asarray(prior.mean, dtype=np.float64), np.asarray(prior.cov, dtype=np.float64)
        n = int(mean.shape[1])
        self.size = n
        self.first, self.end, self.taken, self.taken_end, self.late = 0, 1, 0, 0, 0
        self.base_mean, self.base_cov, self.memory = mean, cov, memory
        self.t, self.q = np.empty(_ROOM), np.zeros(_ROOM)
        self.is_key = np.ones(_ROOM, dtype=np.bool_)
        self.anchor = np.full(_ROOM, -1, dtype=np.int64)
        self.mean, self.cov = np.empty((_ROOM, 2, n)), np.empty((_ROOM, 2, n, n))
        self.reference = np.empty((_ROOM, 2, n))
        # What lies behind the last measurement has no row, so that the passes stop there.
        self.row, self.error = np.full(_ROOM, -1, dtype=np.int64), np.empty(_ROOM, dtype=np.int64)
        self.z, self.info, self.lever = np.empty((_ROOM, 2)), np.empty((_ROOM, 2)), np.empty((_ROOM, 2))
        self.gain = np.empty((_ROOM, 2, n))
        self.innovation, self.variance = np.empty((_ROOM, 2)), np.empty((_ROOM, 2))
        self.t[0], self.mean[0], self.cov[0], self.reference[0] = prior.t, mean, cov, mean
        self._dims = (0,) * n

    @property
    def newest(self) -> float:
        """Time of the last row (s)."""
        return float(self.t[self.end - 1])

    def saved(self) -> dict[str, Any]:
        """Return all from which `from_saved` makes this window again, without what filtering gives anew."""
        rows, taken = slice(self.first, self.end), slice(self.taken, self.taken_end)
        out: dict[str, Any] = {name: getattr(self, name)[rows] for name in ("t", "q", "is_key")}
        out |= {name: getattr(self, name)[taken] for name in ("z", "info", "lever", "error")}
        out |= {"row": self.row[taken] - self.first, "late": self.late, "memory": self.memory}
        out |= {"base_mean": self.base_mean, "base_cov": self.base_cov}
        same = np.array_equal(self.reference[rows], self.mean[rows])
        return out | {"reference": None if same else self.reference[rows]}

    @staticmethod
    def from_saved(saved: dict[str, Any]) -> Window:
        """Make a window of what `saved` returned: the same to the last bit, but for GTSAM's numbers."""
        prior = Prior(float(saved["t"][0]), saved["base_mean"], saved["base_cov"])
        window = Window(prior, saved["memory"])
        rows, taken = len(saved["t"]), len(saved["row"])
        window._make_room(rows, taken)
        window.end, window.taken_end, window.late = rows, taken, saved["late"]
        window.anchor[:rows] = -1
        for name in ("t", "q", "is_key"):
            getattr(window, name)[:rows] = saved[name]
        for name in ("row", "z", "info", "lever", "error"):
            getattr(window, name)[:taken] = saved[name]
        window._filter(0, 0)
        reference = saved["reference"]
        window.reference[:rows] = window.mean[:rows] if reference is None else reference
        return window

    def key_rows(self) -> IntArray:
        """Return the rows that are keys (K,)."""
        if not self.late:
            return np.arange(self.first, self.end)
        return self.first + np.flatnonzero(self.is_key[self.first : self.end])

    def append(self, key: IntArray, taken: RecordArray, opens: IntArray) -> None:
        """Append keys, all later than the last row, and filter them.

        Args:
            key: (M,) key of each measurement, counted from 0, ascending.
            taken: (M,) the measurements, in order of time.
            opens: (J,) the first measurement of each key, which gives it time and jerk.
        """
        self._make_room(len(opens), len(key))
        old, seen = self.end, self.taken_end
        rows = slice(old, old + len(opens))
        self.t[rows], self.q[rows] = taken["t"][opens], taken["jerk"][opens]
        self.is_key[rows], self.anchor[rows] = True, -1
        self.end = rows.stop
        places = slice(seen, seen + len(key))
        self.row[places] = key + old
        self.z[places], self.lever[places], self.error[places] = taken["z"], taken["lever"], taken["error"]
        np.divide(1.0, taken["r"], out=self.info[places])
        self.taken_end = places.stop
        self._filter(old, seen)
        self.reference[rows] = self.mean[rows]

    def insert(self, one: np.void) -> None:
        """Take in a measurement that came late: into a row at its time, or into one of its own.

        Args:
            one: the measurement; its time is not before the first row and not after the last.
        """
        t = float(one["t"])
        self._make_room(1, 1)
        times = self.t[self.first : self.end]
        row = self.first + int(np.argmin(np.abs(times - t)))
        # At large times a microsecond is a few roundings: what lies outside the rows belongs to the nearest.
        alone = abs(self.t[row] - t) > COINCIDENT_S and times[0] < t < times[-1]
        if alone:
            row = self.first + int(np.searchsorted(times, t))
            for name in _ROWS:
                column = getattr(self, name)
                column[row + 1 : self.end + 1] = column[row : self.end].copy()
            self.end += 1
            self.late += 1
            self.t[row], self.is_key[row], self.anchor[row] = t, False, -1
            self.row[self.taken : self.taken_end] += self.row[self.taken : self.taken_end] >= row
        held = self.row[self.taken : self.taken_end]
        place = self.taken + int(np.searchsorted(held, row, side="right"))
        for name in _TAKEN:
            column = getattr(self, name)
            column[place + 1 : self.taken_end + 1] = column[place : self.taken_end].copy()
        self.taken_end += 1
        self.row[place], self.z[place], self.info[place] = row, one["z"], 1.0 / one["r"]
        self.lever[place], self.error[place] = one["lever"], one["error"]
        self._filter(row, self.taken + int(np.searchsorted(held, row)))
        if alone:
            self.reference[row] = self.mean[row]

    def drop_before(self, row: int) -> None:
        """Forget the rows before a key; its filtered state becomes the base."""
        self.base_mean, self.base_cov = self.mean[row].copy(), self.cov[row].copy()
        if self.late:
            self.late -= int(np.count_nonzero(~self.is_key[self.first : row]))
        self.taken += int(np.searchsorted(self.row[self.taken : self.taken_end], row, side="right"))
        self.first = row

    def smooth(self, wanted: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Smooth the first rows, given all measurements of the window.

        Returns:
            (wanted, 2, n) means, (wanted, 2, n, n) covariances, and (wanted, 2, n, n) gains to the next row.
        """
        n = self.size
        out = (np.empty((wanted, 2, n)), np.empty((wanted, 2, n, n)), np.empty((wanted, 2, n, n)))
        smooth_rows(
            self._dims,
            self.first,
            self.end,
            self.taken_end,
            wanted,
            self.t,
            self.q,
            self.memory,
            self.row,
            self.lever,
            self.error,
            self.mean,
            self.cov,
            self.gain,
            self.innovation,
            self.variance,
            *out,
        )
        return out

    def _filter(self, row: int, taken: int) -> None:
        """Filter the rows from `row` on; `taken` is the first measurement of these."""
        if row == self.first:
            self.mean[row], self.cov[row] = self.base_mean, self.base_cov
        filter_rows(
            self._dims,
            row,
            self.end,
            taken,
            row == self.first,
            self.t,
            self.q,
            self.memory,
            self.row,
            self.z,
            self.info,
            self.lever,
            self.error,
            self.mean,
            self.cov,
            self.gain,
            self.innovation,
            self.variance,
        )

    def _make_room(self, rows: int, taken: int) -> None:
        """See to it that so many more rows and measurements fit, and that what lies behind them is no row."""
        if self.end + rows >= len(self.t):
            self._move(_ROWS, self.first, self.end, rows)
            self.row[self.taken : self.taken_end] -= self.first
            self.first, self.end = 0, self.end - self.first
        if self.taken_end + taken >= len(self.row):
            self._move(_TAKEN, self.taken, self.taken_end, taken)
            self.taken, self.taken_end = 0, self.taken_end - self.taken
            self.row[self.taken_end :] = -1

    def _move(self, names: tuple[str, ...], begin: int, end: int, more: int) -> None:
        """Move what some arrays hold to their beginning, and into larger ones if there is little room."""
        held = end - begin
        needed = 2 * (held + more)
        for name in names:
            old = getattr(self, name)
            new = old if len(old) >= needed else np.empty((needed, *old.shape[1:]), dtype=old.dtype)
            new[:held] = old[begin:end]
            setattr(self, name, new)
