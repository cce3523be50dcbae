"""Fixed-lag smoothing of one live track: each state is final once a lag's worth of data has followed.

The values come from GTSAM's incremental fixed-lag smoother (or, with `use_gtsam=False`, from our own
pass over the window). GTSAM solves for every `STRIDE`-th state; those in between are eliminated
before (`whitened.py`) and follow from the solved state after them, exactly. The covariances do not
depend on the measured values, and come from the pass over our own arrays in both cases: the same numbers
as GTSAM's marginals (tested), at a twentieth of the cost (about 1 ms for one marginal at the far end of a
window of a second at 120 Hz).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.data.errors import DataError
from jeat_graph.smoothers.gains import fill_back
from jeat_graph.smoothers.gtsam.linear_graph import LinearGraph
from jeat_graph.smoothers.gtsam.whitened import prior_rows, segment_rows
from jeat_graph.smoothers.gtsam.window import GtsamError, GtsamWindow
from jeat_graph.smoothers.measurements import (
    COINCIDENT_S,
    by_time,
    check_measurements,
    concatenate_measurements,
    group_times,
)
from jeat_graph.smoothers.track_data import Prior, SmoothedTrack
from jeat_graph.smoothers.window import Window

#: GTSAM solves for one state in so many. More would hardly be faster: what is left is the cost of a chunk.
STRIDE = 24


class FixedLagSmoother:
    """Smoother of one live track, of bounded memory and bounded time per measurement.

    Measurements are taken in by chunks. After each, the states that lie at least `lag_s` behind the
    newest one and have at least `chunk` keys after them leave the window, with what is known by then.

    Args:
        prior: what is known of the state before the measurements.
        lag_s: how far a state lies behind the newest when it leaves, at least (s).
        chunk: measurements per update. More make an update cheaper per measurement, and a state leave
            later.
        use_gtsam: whether GTSAM does the solving, or our own pass.
        correlation_time: (B,) correlation times of the error states (s).

    Attributes:
        rebuilds: how often GTSAM failed and the window was built anew from our arrays.
        fallbacks: how often our own pass gave the values, because that failed as well or came too late.
        too_late: measurements refused because they were older than the window.
        waiting: measurements set aside until there is a chunk of them.
    """

    def __init__(
        self,
        prior: Prior,
        *,
        lag_s: float = 1.0,
        chunk: int = 24,
        use_gtsam: bool = True,
        correlation_time: npt.ArrayLike = (),
    ) -> None:
        self.lag_s, self.chunk = lag_s, chunk
        self.rebuilds = self.fallbacks = self.too_late = self.waiting = 0
        self._correlation_time = np.asarray(correlation_time, dtype=np.float64)
        self._window: Window | None = Window(prior, self._correlation_time)
        self._use_gtsam = use_gtsam
        self._gtsam: GtsamWindow | None = None
        self._outdated = use_gtsam  # whether GTSAM's window has to be built from ours
        self._oldest = self._next = 0  # number of the oldest state inside GTSAM, and of the next one
        self._pending: list[RecordArray] = []
        self._departed: list[SmoothedTrack] = []

    def feed(self, measured: RecordArray) -> None:
        """Take in accepted measurements, in any order.

        One that is older than the newest key, but inside the window, gets no key of its own; apart from
        that it counts as if it had come in time.

        Args:
            measured: (M,) records, see `measurements.measurements`.

        Raises:
            DataError: records of another kind, numbers that are not finite, variances or densities <= 0,
                error states that do not exist.
        """
        window = self._live()
        check_measurements(measured, len(self._correlation_time))
        late = measured["t"] <= window.newest + COINCIDENT_S
        if late.any():
            self._insert_late(measured[late])
            measured = measured[~late]
        if len(measured):
            self._pending.append(measured)
            self.waiting += len(measured)
        if self.waiting >= self.chunk:
            self._absorb()

    def departed(self) -> list[SmoothedTrack]:
        """Return the states that have become final since the last call, and forget them.

        Returns:
            Pieces, each of one solve. The last state of a piece is not final: it is there for what lies
            between it and the one before, and the next piece begins with it, solved anew. Two states of
            different solves say nothing about the time between them: they differ by what the solves knew.
        """
        parts, self._departed = self._departed, []
        return parts

    def current(self) -> SmoothedTrack:
        """Return the states inside the window, given all measurements so far; the last is the filter's."""
        self._absorb()
        keys = self._live().key_rows()
        return self._smoothed(keys, len(keys))

    def finish(self) -> list[SmoothedTrack]:
        """Return all states not yet returned by `departed`, in pieces as there, and close."""
        last = self.current()
        result = [*self.departed(), last]
        self.close()
        return result

    def close(self) -> None:
        """Free everything; the smoother takes no more measurements."""
        self._window = self._gtsam = None
        self._pending, self._departed = [], []

    def saved(self) -> dict[str, Any]:
        """Return the attributes of a smoother like this one that has yet to build GTSAM's window."""
        return vars(self) | {"_gtsam": None, "_outdated": self._use_gtsam}

    def forget_gtsam(self) -> None:
        """Have GTSAM's window built anew from our arrays when it is next needed."""
        self._gtsam, self._outdated = None, self._use_gtsam

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
        measured = by_time(concatenate_measurements(self._pending))
        self._pending, self.waiting = [], 0
        key, opens = group_times(measured["t"], window.newest)
        window.append(key - 1, measured, opens)
        if self._gtsam is not None:
            # GTSAM always solves for the newest row, so that it knows all measurements.
            last = window.end - 1
            self._extend(self._gtsam, np.append(np.arange(last - len(opens), last, STRIDE), last))
        elif self._use_gtsam:
            self._rebuild()
        self._depart()

    def _insert_late(self, late: RecordArray) -> None:
        """Add late measurements to the window; GTSAM's is to be built anew."""
        window = self._live()
        for one in late:
            if one["t"] < window.t[window.first] - COINCIDENT_S:
                self.too_late += 1
                continue
            window.insert(one)
            self._gtsam, self._outdated = None, self._use_gtsam

    def _segments(self, graph: LinearGraph, ends: IntArray) -> None:
        """Add all steps and measurements after the row `ends`[0], which GTSAM has, up to the other `ends`."""
        w = self._live()
        count = len(ends) - 1
        measured = w.observations().select(slice(w.first_observation, w.end_observation))
        rows = segment_rows((0,) * w.size, ends, w.steps(), measured, w.reference)
        graph.add_segments(int(w.gtsam_key[ends[0]]), *rows)
        w.gtsam_key[ends[1:]] = np.arange(self._next, self._next + count)
        self._next += count

    def _extend(self, gtsam: GtsamWindow, ends: IntArray) -> None:
        """Tell GTSAM of the rows after the newest it has; if that fails, build its window anew."""
        window, first = self._live(), self._next
        graph = LinearGraph(window.size)
        self._segments(graph, ends)
        numbers = window.gtsam_key[window.first : window.end]
        oldest = int(numbers[np.argmax(numbers >= 0)])
        try:
            gtsam.update(graph, first, self._next - first, range(self._oldest, oldest))
            self._oldest = oldest
        except GtsamError:
            self.rebuilds += 1
            self._rebuild()

    def _rebuild(self) -> None:
        """Build GTSAM's window from our arrays; without GTSAM until the next chunk if that fails."""
        window = self._live()
        self._gtsam, self._outdated = None, False
        window.gtsam_key[window.first : window.end] = -1
        window.gtsam_key[window.first] = self._oldest = self._next
        self._next += 1
        graph = LinearGraph(window.size)
        try:
            held = window.row[window.first_observation : window.end_observation]
            count = int(np.searchsorted(held, window.first, side="right"))
            here = slice(window.first_observation, window.first_observation + count)
            observed = window.observations().select(here)
            prior = prior_rows(window.base_mean, window.base_cov, window.reference[window.first], observed)
            rows = window.key_rows()
            if len(rows) > 1:
                self._segments(graph, np.append(rows[:-1:STRIDE], rows[-1]))
            graph.add_prior(self._oldest, *prior)
            gtsam = GtsamWindow(window.size)
            gtsam.update(graph, self._oldest, self._next - self._oldest, range(0))
            self._gtsam = gtsam
        except (GtsamError, np.linalg.LinAlgError):
            self.fallbacks += 1

    def _smoothed(self, keys: IntArray, count: int) -> SmoothedTrack:
        """Return the first `count` of the window's keys (K,), smoothed with all its measurements."""
        window = self._live()
        end = int(keys[count]) if count < len(keys) else window.end
        if self._outdated:
            self._rebuild()
        if self._gtsam is None:
            means = window.smooth_means(end - window.first)
            cov, gain = window.smooth_covs(end - window.first)
        else:
            solved = window.first + np.flatnonzero(window.gtsam_key[window.first : window.end] >= 0)
            solved = solved[: int(np.searchsorted(solved, end - 1)) + 1]
            cov, gain = window.smooth_covs(int(solved[-1]) + 1 - window.first)
            means = self._gtsam_means(self._gtsam, solved, gain)
        chosen = keys[:count]
        t, jerk = window.t[chosen], window.jerk[chosen]
        if not window.late:
            return SmoothedTrack(t, jerk, means[:count], cov[:count], gain[:count])
        # States are a Markov chain, so the gain over several steps is the product of theirs.
        for row in np.flatnonzero(~window.is_key[window.first : end])[::-1]:
            gain[row - 1] = gain[row - 1] @ gain[row]
        chosen = chosen - window.first
        return SmoothedTrack(t, jerk, means[chosen], cov[chosen], gain[chosen])

    def _gtsam_means(self, gtsam: GtsamWindow, solved: IntArray, gain: FloatArray) -> FloatArray:
        """Return GTSAM's means (N, 2, n) of the rows up to the last of `solved`, or our own if it fails."""
        window = self._live()
        try:
            known = gtsam.means(window.gtsam_key[solved].tolist(), window.reference[solved])
        except GtsamError:
            self.rebuilds += 1
            self.fallbacks += 1
            self._rebuild()
            return window.smooth_means(len(gain))
        rows, here = solved - window.first, slice(window.first, window.end)
        out = np.empty((len(gain), 2, window.size))
        out[rows] = known
        model = ((0,) * window.size, window.t[here], window.correlation_time)
        fill_back(*model, rows, window.mean[here], gain, out)
        return out

    def _depart(self) -> None:
        """Emit the states that are final by now, and drop them from the window."""
        window = self._live()
        keys = window.key_rows()
        if len(keys) <= self.chunk:
            return
        old = int(np.searchsorted(window.t[keys], window.newest - self.lag_s, side="right"))
        count = min(old, len(keys) - self.chunk)
        if count <= 0:
            return
        self._departed.append(self._smoothed(keys, count + 1))
        window.drop_before(int(keys[count]))
