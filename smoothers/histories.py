"""What the filter did to every living track, and the smoothed rows that follow from it.

A track's rows are final when it has ended, or with a finite lag when so much time has followed: then the
window of two lags is smoothed and its older half is given out. So memory does not grow with time.
`core/smoothers/histories.hpp` does the same for the core's own pass.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.filters import gap_survival
from jeat_graph.filters.gap_survival import GapCounts
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.filtered_track import FilteredTrack, smoothed_together
from jeat_graph.smoothers.gap_ends import known_around, whole_gaps
from jeat_graph.smoothers.history import History, TrackUpdate, UpdateColumns, update_columns, updates_of
from jeat_graph.smoothers.rows import Called, ModelRows, RowOutput, joined, rows_of
from jeat_graph.smoothers.state_rts import FilterRecord

# Tracks that have ended wait until so many are smoothed together.
_MOST_WAITING = 32
# Tracks that began together are given out one after the other: each waits for a share of the second lag.
_GOLDEN, _LOW_BITS = 0.6180339887498949, 0xFFFF


class StepRecord(NamedTuple):
    """What the filter did in one step; every engine hands over the same.

    Attributes:
        t: its time (s).
        is_reset: whether all tracks had ended before it.
        track_id: (N,) the tracks after it, before any of them ended, ascending.
        scans: of its scans in the order they were taken in, each with the first of these tracks: those that
            had been born.
        real: (N,) their posterior.
        used: (N,) the sensors that found them.
        confirmed: (N,) whether a detection of that time tells that they are still there.
        missed: (N,) detections that were to be expected since one confirmed them, 0 where it is of that time.
        kept: (N,) which of them live on.
        gaps: that have been counted before tracks ended,
        gaps_after: and after it.
        later: (N,) posterior of an object by what comes later, of those that found a detection of which that
            is given, else -1; None where it is of none.
    """

    t: float
    is_reset: bool
    track_id: IntArray
    scans: list[FilterRecord]
    real: FloatArray
    used: IntArray
    confirmed: BoolArray
    missed: FloatArray
    kept: BoolArray
    gaps: GapCounts
    gaps_after: GapCounts
    later: FloatArray | None = None

    def track_ids(self) -> IntArray:
        """Return the identities (N,) of the tracks after it, before any ended."""
        return self.track_id


class Existence(NamedTuple):
    """Which rows a smoothed table has.

    Attributes:
        constants: of the model, of which it takes what counts as sure, and from when on a row is given.
        of_any_time: whether a track is what it was taken for at any time, and not at its last detection; no
            row of it is given before.
    """

    constants: ModelConstants
    of_any_time: bool = False


class Solver(Protocol):
    """Smooths windows of tracks: each begins with a filtered state, and its records follow one another."""

    def smoothed(
        self, windows: Sequence[FilteredTrack], wanted: Sequence[int], final: bool
    ) -> list[tuple[FloatArray, FloatArray]]:
        """Return means (K, A, D) and covariances (K, A, D, D) of the first records of each window.

        Args:
            windows: of tracks.
            wanted: how many of each one's records.
            final: whether rows are given out of them; else nobody may notice that they were asked for.
        """
        ...

    def leave(self, track_id: int, count: int) -> None:
        """Take note that the first records of a track's window were given out and are in it no more."""

    def end(self, track_id: int) -> None:
        """Forget a track."""

    def settle(self) -> None:
        """Forget what can be made again of windows."""

    def counts(self) -> dict[str, int]:
        """Return what it counts, by name."""
        ...


class RtsSolver:
    """Our own pass backwards."""

    def smoothed(
        self, windows: Sequence[FilteredTrack], wanted: Sequence[int], final: bool
    ) -> list[tuple[FloatArray, FloatArray]]:
        """Return means (K, A, D) and covariances (K, A, D, D) of the first records of each window."""
        found = zip(smoothed_together(windows), wanted, strict=True)
        return [(mean[:count], covariance[:count]) for (mean, covariance), count in found]

    def leave(self, track_id: int, count: int) -> None:
        """Do nothing: nothing is kept between windows."""

    def end(self, track_id: int) -> None:
        """Do nothing."""

    def settle(self) -> None:
        """Do nothing."""

    def counts(self) -> dict[str, int]:
        """Return nothing."""
        return {}


class Histories:
    """Takes steps in, in order of time, and gives smoothed rows out.

    Args:
        lag_s: fixed lag (s); infinite for whole tracks.
        existence: which rows are given.
        output: how states are reported.
        solver: of the states; our own pass if None.
    """

    def __init__(
        self, lag_s: float, existence: Existence, output: RowOutput, solver: Solver | None = None
    ) -> None:
        self._lag_s, self._existence, self._output = lag_s, existence, output
        self._solver: Solver = RtsSolver() if solver is None else solver
        self._living: list[History] = []
        self._ended: list[tuple[History, GapCounts]] = []
        self._rows: list[ModelRows] = []
        self._gaps = gap_survival.no_gaps()
        self._smoothed = 0

    def counts(self) -> dict[str, int]:
        """Return how many tracks have ended, and what the solver counts."""
        return {"tracks": self._smoothed, **self._solver.counts()}

    def take(self, record: StepRecord, called: Sequence[Called]) -> None:
        """Take in a step; `called` is of its tracks (N,).

        Raises:
            ValueError: it is not the step behind the last one.
        """
        if record.is_reset:
            self.end_all(record.gaps)
        ids = record.track_id.tolist()
        if [one.track_id for one in self._living] != ids[: len(self._living)]:
            raise ValueError("steps must be handed over once, and in order of time")
        self._living += [History(k, Called(k)) for k in ids[len(self._living) :]]
        for number, scan in enumerate(record.scans):
            last = number == len(record.scans) - 1
            for i in range(len(scan.track_id)):
                self._living[i].entries.append(_entry(record, scan, i, last))
        for history, name in zip(self._living, called, strict=True):
            history.called = name
        self._advance(record.t, record.gaps)
        self._end(record.kept, record.gaps_after)
        self._gaps = record.gaps_after

    def end_all(self, gaps: GapCounts | None = None) -> None:
        """End all tracks; gaps are those counted so far, if not those of the last step."""
        self._end(np.zeros(len(self._living), dtype=np.bool_), self._gaps if gaps is None else gaps)

    def preview(self) -> ModelRows:
        """Return all rows that are not drained, those of living tracks as of now; these stay."""
        self._smooth_ended()
        wanted = [one for one in self._living if one.entries]
        found = self._solver.smoothed(
            [one.window() for one in wanted], [len(one.entries) for one in wanted], False
        )
        parts = [
            self._rows_of(one, one.columns(), len(one.entries), self._gaps, states)
            for one, states in zip(wanted, found, strict=True)
        ]
        return joined([*self._rows, *parts])

    def drain(self) -> ModelRows:
        """Return, and forget, the rows that have become final."""
        self._smooth_ended()
        rows, self._rows = joined(self._rows), []
        return rows

    def finish(self) -> ModelRows:
        """End all tracks and return all rows that are not drained."""
        self.end_all()
        return self.drain()

    def forget(self, until: Mapping[int, float]) -> None:
        """Forget updates of living tracks, by identity those up to a time (s): nobody wants their rows."""
        for one in self._living:
            limit = until.get(one.track_id, -math.inf)
            if one.entries and one.entries[0].t <= limit:
                columns = one.columns()
                count = int(np.searchsorted(columns.t, limit, side="right"))
                one.forget(columns, count, self._existence.constants.report)
                self._solver.end(one.track_id)  # it begins again with a filtered state

    def settle(self) -> None:
        """Forget what can be made again: what follows is as of one that was saved and loaded."""
        self._smooth_ended()
        self._solver.settle()

    def state(self) -> dict[str, Any]:
        """Return what `set_state` takes: plain data and arrays."""
        self.settle()
        return {
            "gaps": np.stack(self._gaps),
            "smoothed": self._smoothed,
            "rows": list(joined(self._rows)),
            "called": [tuple(one.called) for one in self._living],
            "missed": np.array([one.missed for one in self._living]),
            "later": np.array([one.later for one in self._living]),
            "was_real": np.array([one.was_real for one in self._living], dtype=np.bool_),
            "track_id": np.array([one.track_id for one in self._living], dtype=np.int64),
            "entries": [update_columns(one.entries) for one in self._living],
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned.

        Raises:
            ValueError: it is not what histories can be in.
        """
        try:
            missed, ids = state["missed"].tolist(), state["track_id"].tolist()
            later, was_real = state["later"].tolist(), state["was_real"].tolist()
            called = [Called(int(given), int(label), float(share)) for given, label, share in state["called"]]
            entries = [updates_of(one) for one in state["entries"]]
            living = [
                History(int(track), name, float(number), float(known), bool(real), updates)
                for track, name, number, known, real, updates in zip(
                    ids, called, missed, later, was_real, entries, strict=True
                )
            ]
            rows = joined([tuple(state["rows"])])
            gaps = GapCounts(*np.asarray(state["gaps"], dtype=np.float64))
        except (KeyError, TypeError, AttributeError, IndexError) as error:
            raise ValueError(f"its smoother's records are none ({error})") from None
        if len({len(column) for column in rows}) != 1 or not all(np.isfinite(one).all() for one in rows):
            raise ValueError("its smoothed rows are none")
        self._living, self._rows, self._gaps = living, [rows], gaps
        self._ended, self._smoothed = [], int(state["smoothed"])

    def _advance(self, now: float, gaps: GapCounts) -> None:
        """Give out what has become final while tracks live on."""
        if not math.isfinite(self._lag_s):
            return
        ready = [
            one
            for one in self._living
            if one.entries
            and one.entries[0].t < now - (1.0 + _share_of(one)) * self._lag_s
            and self._is_decided(one)
        ]
        if not ready:
            return
        columns = [one.columns() for one in ready]
        counts = [int(np.searchsorted(one.t, now - self._lag_s, side="right")) for one in columns]
        found = self._solver.smoothed([one.window() for one in ready], counts, True)
        for one, told, count, states in zip(ready, columns, counts, found, strict=True):
            self._rows.append(self._rows_of(one, told, count, gaps, states))
            one.forget(told, count, self._existence.constants.report)
            self._solver.leave(one.track_id, count)

    def _is_decided(self, history: History) -> bool:
        """Return whether rows of a living track can be given: what it is may still turn out, or has."""
        rule = self._existence
        return not rule.of_any_time or any(one.real > rule.constants.report for one in history.entries)

    def _end(self, kept: BoolArray, gaps: GapCounts) -> None:
        """Have tracks wait to be smoothed that end, and forget them."""
        ended = [one for one, stays in zip(self._living, kept.tolist(), strict=True) if not stays]
        if not ended:
            return
        self._smoothed += len(ended)
        self._living = [one for one, stays in zip(self._living, kept.tolist(), strict=True) if stays]
        self._ended += [(one, gaps) for one in ended]
        if len(self._ended) > _MOST_WAITING:
            self._smooth_ended()

    def _smooth_ended(self) -> None:
        whole = [(one, gaps) for one, gaps in self._ended if one.entries]
        counts = [len(one.entries) for one, _ in whole]
        found = self._solver.smoothed([one.window() for one, _ in whole], counts, True)
        for (one, gaps), count, states in zip(whole, counts, found, strict=True):
            self._rows.append(self._rows_of(one, one.columns(), count, gaps, states))
        for one, _ in self._ended:
            self._solver.end(one.track_id)
        self._ended = []

    def _rows_of(
        self,
        history: History,
        columns: UpdateColumns,
        count: int,
        gaps: GapCounts,
        states: tuple[FloatArray, FloatArray],
    ) -> ModelRows:
        """Return the rows of the first updates of a window, by all that it tells.

        A row's existence is the track's posterior at that time, or where it turned out to be real for sure,
        what it turned out to be, times the probability that it had been so for as long as it took to turn
        out: what began as a second box, or as one of nothing, is often taken over by an object. While nobody
        sees the track, it counts times the probability that a gap as long as it is to the nearer one of its
        ends ends well. What comes later may say less of the detections around a row than what it turned
        out to be.
        """
        c = self._existence.constants
        t, real, used, later, confirmed, missed, last, same = columns
        seen = np.flatnonzero(confirmed & last)
        final = float(real[seen[-1]]) if len(seen) else 0.0
        if self._existence.of_any_time:
            final = float(real.max())
        gap, before = whole_gaps(confirmed, missed, last), max(history.missed, 0.0)
        settled = np.flatnonzero(last[:count])
        nearer = np.minimum(missed[settled], gap[settled] - np.concatenate([[before], missed[settled]])[:-1])
        given = settled <= (seen[-1] if len(seen) else -1)
        given &= ~np.isin(settled, same)  # a later step of the same time tells more
        rows = settled[given]
        around, _ = known_around(later, last, history.later, count)
        turned = np.minimum(final, around[rows])
        found = np.flatnonzero(real > c.report)
        if not self._existence.of_any_time and not history.was_real and len(found):
            turned = turned * np.exp(-np.maximum(t[found[0]] - t[rows], 0.0) / c.turning_s)
        is_real = np.maximum(real[rows], turned) if final > c.sure else real[rows]
        is_real = is_real * gap_survival.survival(gaps, nearer[given], c)
        shown = is_real > c.report
        rows, is_real = rows[shown], is_real[shown]
        return rows_of(
            t[rows],
            [history.called] * len(rows),
            (states[0][rows], states[1][rows]),
            is_real,
            used[rows],
            self._output,
        )


def _entry(record: StepRecord, scan: FilterRecord, row: int, last: bool) -> TrackUpdate:
    """Return the update of one track in one scan; the output of a step stands in its last scan."""
    return TrackUpdate(
        t=record.t,
        F=scan.F[row],
        predicted_mean=scan.predicted_mean[row],
        predicted_covariance=scan.predicted_covariance[row],
        mean=scan.mean[row],
        covariance=scan.covariance[row],
        sensor=int(scan.sensor[row]),
        real=float(record.real[row]) if last else 0.0,
        used=int(record.used[row]) if last else 0,
        confirmed=last and bool(record.confirmed[row]),
        missed=float(record.missed[row]) if last else 0.0,
        later=float(record.later[row]) if last and record.later is not None else -1.0,
        last_of_step=last,
    )


def _share_of(history: History) -> float:
    """Return which share of the second lag a track waits for: first as its identity says, then all of it."""
    if history.missed >= 0.0:
        return 1.0  # its first rows are out
    turns = _GOLDEN * (history.track_id & _LOW_BITS)
    return turns - math.floor(turns)
