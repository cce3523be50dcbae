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
from jeat_graph.smoothers.backward import smooth_covs, smooth_means
from jeat_graph.smoothers.forward import filter_rows
from jeat_graph.smoothers.measurements import COINCIDENT_S
from jeat_graph.smoothers.passes import Covariances, Filtered, Observations, Span, Steps
from jeat_graph.smoothers.track_data import Prior

_ROWS = ("t", "jerk", "is_key", "gtsam_key", "mean", "cov", "reference")
_OBSERVED = ("row", "z", "information", "coloured_std", "error", "gain", "innovation", "variance")
_SAVED_ROWS = ("t", "jerk", "is_key")
_SAVED_OBSERVATIONS = ("z", "information", "coloured_std", "error")
_ROOM = 64


class Window:
    """Rows of one track's window.

    Args:
        prior: what is known of the state at the first key before the measurements.
        correlation_time: (n - 3,) correlation times of the error states (s).

    Attributes:
        first: the first row of the window, as an index into all arrays of rows.
        end: the row after the last.
        first_observation: the first measurement of the window, as an index into all arrays of measurements.
        end_observation: the measurement after the last.
        late: how many rows are no keys.
        base_mean: (2, n) state at the first row given all before it, and given the row's own measurements
            only once they are no longer kept.
        base_cov: (2, n, n) its covariance.
        correlation_time: (n - 3,) correlation times of the error states (s).
        t: (N,) times (s).
        jerk: (N,) root spectral density of the jerk over the interval that ends at the row (px/s^2.5).
        is_key: (N,) whether the row is a key; the first and the last row always are.
        gtsam_key: (N,) number of the row's state inside GTSAM, or -1.
        mean: (N, 2, n) filtered means.
        cov: (N, 2, n, n) filtered covariances.
        reference: (N, 2, n) filtered means as they were when the row came: unlike `mean`, no late
            measurement changes them.
        row: (M,) row of each measurement, ascending.
        z: (M, 2) measurements (px).
        information: (M, 2) information of their white parts (1/px²).
        coloured_std: (M, 2) standard deviation of their coloured parts (px).
        error: (M,) index of these, or -1.
        gain: (M, 2, n) gain with which the filter took it in.
        innovation: (M, 2) its innovation (px).
        variance: (M, 2) the variance of that (px²).
    """

    def __init__(self, prior: Prior, correlation_time: FloatArray) -> None:
        mean, cov = np.asarray(prior.mean, dtype=np.float64), np.asarray(prior.cov, dtype=np.float64)
        n = int(mean.shape[1])
        self.size = n
        self.first, self.end, self.first_observation, self.end_observation, self.late = 0, 1, 0, 0, 0
        self.base_mean, self.base_cov, self.correlation_time = mean, cov, correlation_time
        self.t, self.jerk = np.empty(_ROOM), np.zeros(_ROOM)
        self.is_key = np.ones(_ROOM, dtype=np.bool_)
        self.gtsam_key = np.full(_ROOM, -1, dtype=np.int64)
        self.mean, self.cov = np.empty((_ROOM, 2, n)), np.empty((_ROOM, 2, n, n))
        self.reference = np.empty((_ROOM, 2, n))
        # What lies behind the last measurement has no row, so that the passes stop there.
        self.row, self.error = np.full(_ROOM, -1, dtype=np.int64), np.empty(_ROOM, dtype=np.int64)
        self.z, self.information, self.coloured_std = (
            np.empty((_ROOM, 2)),
            np.empty((_ROOM, 2)),
            np.empty((_ROOM, 2)),
        )
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
        rows, places = slice(self.first, self.end), slice(self.first_observation, self.end_observation)
        out: dict[str, Any] = {name: getattr(self, name)[rows] for name in _SAVED_ROWS}
        out |= {name: getattr(self, name)[places] for name in _SAVED_OBSERVATIONS}
        out |= {"row": self.row[places] - self.first, "late": self.late}
        out |= {name: getattr(self, name) for name in ("base_mean", "base_cov", "correlation_time")}
        same = np.array_equal(self.reference[rows], self.mean[rows])
        return out | {"reference": None if same else self.reference[rows]}

    @staticmethod
    def from_saved(saved: dict[str, Any]) -> Window:
        """Make a window of what `saved` returned: the same to the last bit, but for GTSAM's numbers."""
        prior = Prior(float(saved["t"][0]), saved["base_mean"], saved["base_cov"])
        window = Window(prior, saved["correlation_time"])
        rows, places = len(saved["t"]), len(saved["row"])
        window._make_room(rows, places)
        window.end, window.end_observation, window.late = rows, places, saved["late"]
        window.gtsam_key[:rows] = -1
        for name in _SAVED_ROWS:
            getattr(window, name)[:rows] = saved[name]
        for name in ("row", *_SAVED_OBSERVATIONS):
            getattr(window, name)[:places] = saved[name]
        window._filter(0, 0)
        reference = saved["reference"]
        window.reference[:rows] = window.mean[:rows] if reference is None else reference
        return window

    def key_rows(self) -> IntArray:
        """Return the rows that are keys (K,)."""
        if not self.late:
            return np.arange(self.first, self.end)
        return self.first + np.flatnonzero(self.is_key[self.first : self.end])

    def append(self, key: IntArray, measured: RecordArray, opens: IntArray) -> None:
        """Append keys, all later than the last row, and filter them.

        Args:
            key: (M,) key of each measurement, counted from 0, ascending.
            measured: (M,) the measurements, in order of time.
            opens: (J,) the first measurement of each key, which gives it time and jerk.
        """
        self._make_room(len(opens), len(key))
        old, seen = self.end, self.end_observation
        rows = slice(old, old + len(opens))
        self.t[rows], self.jerk[rows] = measured["t"][opens], measured["jerk"][opens]
        self.is_key[rows], self.gtsam_key[rows] = True, -1
        self.end = rows.stop
        places = slice(seen, seen + len(key))
        self.row[places] = key + old
        self.z[places], self.coloured_std[places], self.error[places] = (
            measured["z"],
            measured["coloured_std"],
            measured["error"],
        )
        np.divide(1.0, measured["r"], out=self.information[places])
        self.end_observation = places.stop
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
            self.t[row], self.is_key[row], self.gtsam_key[row] = t, False, -1
            self.row[self.first_observation : self.end_observation] += (
                self.row[self.first_observation : self.end_observation] >= row
            )
        held = self.row[self.first_observation : self.end_observation]
        place = self.first_observation + int(np.searchsorted(held, row, side="right"))
        for name in _OBSERVED:
            column = getattr(self, name)
            column[place + 1 : self.end_observation + 1] = column[place : self.end_observation].copy()
        self.end_observation += 1
        self.row[place], self.z[place], self.information[place] = row, one["z"], 1.0 / one["r"]
        self.coloured_std[place], self.error[place] = one["coloured_std"], one["error"]
        self._filter(row, self.first_observation + int(np.searchsorted(held, row)))
        if alone:
            self.reference[row] = self.mean[row]

    def drop_before(self, row: int) -> None:
        """Forget the rows before a key; its filtered state becomes the base."""
        self.base_mean, self.base_cov = self.mean[row].copy(), self.cov[row].copy()
        if self.late:
            self.late -= int(np.count_nonzero(~self.is_key[self.first : row]))
        self.first_observation += int(
            np.searchsorted(self.row[self.first_observation : self.end_observation], row, side="right")
        )
        self.first = row

    def observations(self) -> Observations:
        """Return the measurements, in arrays that may be longer than what they hold."""
        return Observations(self.row, self.z, self.information, self.coloured_std, self.error)

    def steps(self) -> Steps:
        """Return the rows' times and how the state moves between them, in arrays that may be longer."""
        return Steps(self.t, self.jerk, self.correlation_time)

    def smooth_means(self, wanted: int) -> FloatArray:
        """Return the means (wanted, 2, n) of the first rows, given all measurements of the window."""
        out = np.empty((wanted, 2, self.size))
        smooth_means(*self._passes(), out)
        return out

    def smooth_covs(self, wanted: int) -> Covariances:
        """Return covariances of the first rows, given all measurements, and gains to the next row."""
        out = Covariances.allocate(wanted, self.size)
        smooth_covs(*self._passes(), out)
        return out

    def _passes(self) -> tuple[tuple[int, ...], Span, Steps, Observations, Filtered]:
        """What the passes back over the window take."""
        span = Span(self.first, self.end, self.end_observation)
        return self._dims, span, self.steps(), self.observations(), self._filtered()

    def _filtered(self) -> Filtered:
        return Filtered(self.mean, self.cov, self.gain, self.innovation, self.variance)

    def _filter(self, row: int, observation: int) -> None:
        """Filter the rows from `row` on; `observation` is the first measurement of these."""
        given = row == self.first
        if given:
            self.mean[row], self.cov[row] = self.base_mean, self.base_cov
        span = Span(row, self.end, observation)
        filter_rows(self._dims, span, given, self.steps(), self.observations(), self._filtered())

    def _make_room(self, rows: int, observations: int) -> None:
        """See to it that so many more rows and measurements fit, and that what lies behind them is no row."""
        if self.end + rows >= len(self.t):
            self._move(_ROWS, self.first, self.end, rows)
            self.row[self.first_observation : self.end_observation] -= self.first
            self.first, self.end = 0, self.end - self.first
        if self.end_observation + observations >= len(self.row):
            self._move(_OBSERVED, self.first_observation, self.end_observation, observations)
            self.first_observation, self.end_observation = 0, self.end_observation - self.first_observation
            self.row[self.end_observation :] = -1

    def _move(self, names: tuple[str, ...], begin: int, end: int, more: int) -> None:
        """Move what some arrays hold to their beginning, and into larger ones if there is little room."""
        held = end - begin
        needed = 2 * (held + more)
        for name in names:
            old = getattr(self, name)
            new = old if len(old) >= needed else np.empty((needed, *old.shape[1:]), dtype=old.dtype)
            new[:held] = old[begin:end]
            setattr(self, name, new)
