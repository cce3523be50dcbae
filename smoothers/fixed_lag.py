"""Fixed-lag smoothing of one live track: each state is final once a lag's worth of data has followed.

The values come from GTSAM's incremental fixed-lag smoother (or, with `use_gtsam=False`, from our own
Rauch-Tung-Striebel pass over the window). The covariances do not depend on the measured values, and come
from the pass over our own arrays in both cases: the same numbers as GTSAM's marginals (tested), at a
twentieth of the cost (about 1 ms for one marginal at the far end of a window of a second at 120 Hz,
0.1 ms for all of the window's).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from jeat_graph.arrays import FloatArray
from jeat_graph.errors import DataError
from jeat_graph.smoothers import factors
from jeat_graph.smoothers.gtsam_window import GtsamWindow
from jeat_graph.smoothers.interpolation import bridge
from jeat_graph.smoothers.track_data import COINCIDENT_S, SmoothedTrack, check_measurements, fuse, group_times
from jeat_graph.smoothers.window import Window

#: What GTSAM's C++ exceptions become in Python.
_GTSAM_ERRORS = (RuntimeError, IndexError, ValueError)


class FixedLagSmoother:
    """Smoother of one live track, of bounded memory and bounded time per measurement.

    Measurements are taken in by chunks. After each, the states that lie at least `lag_s` behind the
    newest one and have at least `chunk` keys after them leave the window, with what is known by then.

    Args:
        prior_t: time of the prior (s).
        prior_mean: (2, 3) prior mean of [p, v, a] per axis (px, px/s, px/s²).
        prior_cov: (2, 3, 3) prior covariance.
        lag_s: how far a state lies behind the newest when it leaves, at least (s).
        chunk: measurements per update. More make an update cheaper per measurement, and a state leave
            later.
        use_gtsam: whether GTSAM does the solving, or our own RTS pass.

    Attributes:
        rebuilds: how often GTSAM failed and the window was built anew from our arrays.
        fallbacks: how often that failed as well, and the RTS pass gave the values.
        too_late: measurements refused because they were older than the window.
    """

    def __init__(
        self,
        prior_t: float,
        prior_mean: FloatArray,
        prior_cov: FloatArray,
        *,
        lag_s: float = 1.0,
        chunk: int = 24,
        use_gtsam: bool = True,
    ) -> None:
        self.lag_s, self.chunk = lag_s, chunk
        self.rebuilds = self.fallbacks = self.too_late = 0
        self._use_gtsam = use_gtsam
        self._window: Window | None = Window(prior_t, np.asarray(prior_mean), np.asarray(prior_cov))
        self._gtsam: GtsamWindow | None = None
        self._first = 0  # number, inside GTSAM, of the window's first key
        self._leaving = range(0)  # keys that have left our window but not yet GTSAM's
        self._pending: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]] = []
        self._waiting = 0
        self._departed: list[SmoothedTrack] = []
        if use_gtsam:
            self._rebuild()

    def feed(self, t: npt.ArrayLike, z: npt.ArrayLike, r: npt.ArrayLike, q: npt.ArrayLike) -> None:
        """Take in accepted measurements, in any order.

        One that is older than the newest key, but inside the window, becomes one more linear factor on
        the two neighbouring states. (Two late ones between the same two keys are taken for independent
        given these; the process noise that they share is negligible beside their own.)

        Args:
            t: (M,) times (s).
            z: (M, 2) centres (px).
            r: (M, 2) variances (px²), as the filter used them.
            q: (M,) root spectral density of the jerk since the measurement before (px/s^2.5).

        Raises:
            DataError: wrong shapes, numbers that are not finite, variances or densities <= 0.
        """
        window = self._live()
        rows = check_measurements(t, z, r, q)
        if rows[0].min(initial=np.inf) <= window.t[-1] + COINCIDENT_S:
            late = rows[0] <= window.t[-1] + COINCIDENT_S
            for i in np.flatnonzero(late):
                self._take_late(float(rows[0][i]), rows[1][i], rows[2][i])
            rows = (rows[0][~late], rows[1][~late], rows[2][~late], rows[3][~late])
        if len(rows[0]):
            self._pending.append(rows)
            self._waiting += len(rows[0])
        if self._waiting >= self.chunk:
            self._absorb()

    def departed(self) -> SmoothedTrack:
        """Return the states that have become final since the last call, and forget them."""
        parts, self._departed = self._departed, []
        return SmoothedTrack.concatenate(parts)

    def current(self) -> SmoothedTrack:
        """Return the states inside the window, given all measurements so far; the last is the filter's."""
        self._absorb()
        window = self._live()
        rows = window.key_rows()
        means, cov, gain = window.smooth()
        if self._use_gtsam:
            means = self._gtsam_means(len(rows), means)
        return SmoothedTrack(window.t[rows], window.q[rows], means, cov, gain)

    def finish(self) -> SmoothedTrack:
        """Return all states not yet returned by `departed`, and close."""
        last = self.current()
        result = SmoothedTrack.concatenate([self.departed(), last])
        self.close()
        return result

    def close(self) -> None:
        """Free everything; the smoother takes no more measurements."""
        self._window = self._gtsam = None
        self._pending, self._departed = [], []

    def _live(self) -> Window:
        """Return the window, or refuse if the smoother is closed."""
        if self._window is None:
            raise DataError("this smoother is closed")
        return self._window

    def _absorb(self) -> None:
        """Make the waiting measurements keys, and let the oldest states leave."""
        window = self._live()
        if not self._pending:
            return
        t, z, r, q = (np.concatenate(column) for column in zip(*self._pending, strict=True))
        self._pending, self._waiting = [], 0
        order = np.argsort(t, kind="stable")
        t, z, r, q = t[order], z[order], r[order], q[order]
        key, first = group_times(t, float(window.t[-1]))
        fused_z, info = fuse(key - 1, z, r, len(first))
        old = len(window.t)
        number = self._first + int(np.count_nonzero(window.is_key))
        window.append(t[first], q[first], fused_z, info)
        if self._gtsam is not None:
            graph = factors.LinearGraph()
            dt, reference = np.diff(window.t[old - 1 :]), window.reference[old - 1 :]
            graph.add_steps(number - 1, *factors.step_rows(dt, q[first], fused_z, info, reference))
            self._update(graph, number, len(first))
        elif self._use_gtsam:
            self._rebuild()
        self._depart()

    def _take_late(self, t: float, z: FloatArray, r: FloatArray) -> None:
        """Add a late measurement (2,), (2,) to the window and, as a linear factor, to GTSAM."""
        window = self._live()
        if t < window.t[0] - COINCIDENT_S:
            self.too_late += 1
            return
        row = window.insert(t, z, 1.0 / r)
        if self._gtsam is not None:
            graph = factors.LinearGraph()
            self._add_between(graph, row, z, r)
            self._update(graph, 0, 0)

    def _add_between(self, graph: factors.LinearGraph, row: int, z: FloatArray, r: FloatArray) -> None:
        """Add a measurement at the window's row `row` to a graph: on its key, or between its neighbours."""
        window = self._live()
        t = float(window.t[row])
        before = int(np.count_nonzero(window.is_key[: row + 1])) - 1
        if window.is_key[row]:
            graph.add_measurement(self._first + before, z, 1.0 / r, window.reference[row])
            return
        pair = window.key_rows()[before : before + 2]
        start, end = window.t[pair]
        L, S, noise = bridge(np.array([t - start]), np.array([end - start]), window.q[pair[1:]])
        late = factors.late_rows(L[0, 0], S[0, 0], float(noise[0, 0, 0]), z, r, window.reference[pair])
        graph.add_late(self._first + before, *late)

    def _update(self, graph: factors.LinearGraph, first: int, count: int) -> None:
        """Hand a graph with new states to GTSAM; if that fails, build its window anew."""
        assert self._gtsam is not None
        leaving, self._leaving = self._leaving, range(0)
        try:
            self._gtsam.update(graph, first, count, leaving)
        except _GTSAM_ERRORS:
            self.rebuilds += 1
            self._rebuild()

    def _rebuild(self) -> None:
        """Build GTSAM's window from our arrays; without GTSAM until the next chunk if that fails."""
        window = self._live()
        rows = window.key_rows()
        t, z, info, reference = (a[rows] for a in (window.t, window.z, window.info, window.reference))
        graph = factors.LinearGraph()
        self._leaving = range(0)
        self._gtsam = None
        try:
            prior = factors.prior_rows(window.base_mean, window.base_cov, z[0], info[0], reference[0])
            graph.add_prior(self._first, *prior)
            steps = factors.step_rows(np.diff(t), window.q[rows[1:]], z[1:], info[1:], reference)
            graph.add_steps(self._first, *steps)
            for row in np.flatnonzero(~window.is_key):
                self._add_between(graph, int(row), window.z[row], 1.0 / window.info[row])
            gtsam = GtsamWindow()
            gtsam.update(graph, self._first, len(rows), range(0))
            self._gtsam = gtsam
        except (*_GTSAM_ERRORS, np.linalg.LinAlgError):
            self.fallbacks += 1

    def _gtsam_means(self, count: int, fallback: FloatArray) -> FloatArray:
        """Return GTSAM's means (count, 2, 3) of the first keys, or the first of `fallback`."""
        window = self._live()
        reference = window.reference[window.key_rows()[:count]]
        for _ in range(2):
            if self._gtsam is None:
                break
            try:
                return self._gtsam.means(range(self._first, self._first + count), reference)
            except _GTSAM_ERRORS:
                self.rebuilds += 1
                self._rebuild()
        return fallback[:count]

    def _depart(self) -> None:
        """Emit the states that are final by now, and drop them from the window."""
        window = self._live()
        rows = window.key_rows()
        old = int(np.searchsorted(window.t[rows], window.t[-1] - self.lag_s, side="right"))
        count = min(old, len(rows) - self.chunk)
        if count <= 0:
            return
        means, cov, gain = window.smooth()
        if self._use_gtsam:
            means = self._gtsam_means(count, means)
        leaving = rows[:count]
        self._departed.append(
            SmoothedTrack(
                window.t[leaving],
                window.q[leaving],
                means[:count].copy(),
                cov[:count].copy(),
                gain[:count].copy(),
            )
        )
        window.drop_before(int(rows[count]))
        self._leaving = range(self._leaving.start if self._leaving else self._first, self._first + count)
        self._first += count
