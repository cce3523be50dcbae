"""The smoothers of all tracks of a running tracker: one a track, made with it and gone with it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from jeat_graph.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.config import Config
from jeat_graph.smoothing.history import TrackHistory
from jeat_graph.smoothing.looks import Looks
from jeat_graph.smoothing.priors import ErrorStates
from jeat_graph.smoothing.stitched import stitch_histories
from jeat_graph.smoothing.waiting import WaitingRows
from jeat_graph.state import TrackArrays
from jeat_graph.trajectories import Trajectories
from jeat_graph.update_log import UpdateLog

#: Engines that solve for a track once it has ended; only with these can fragments be stitched.
WHOLE = ("full", "rts")


class TrackSmoothers:
    """Takes down each step of a tracker, and turns it into smoothed trajectories behind it.

    Steps are gathered and handed to the smoothers in bulk. Of tentative tracks the measurements are only
    kept; confirmed ones have a smoother, which takes the tentative start first. A track that ends frees all
    it held. Of merged tracks the survivor keeps its own measurements only: a confirmed one in fifty ends so.

    The filter measures the velocity of standing tracks as zero; the smoothers do not. What they share is the
    lower jerk of a standing track.

    Memory: rows wait until `drain` takes them, many of them in a file. With a fixed lag it is bounded; the
    engines over whole tracks hold each track's measurements until it ends, and until the recording ends if
    fragments are to be stitched.

    Args:
        config: settings of the smoother, the sizes and the output.

    Attributes:
        rebuilds: how often GTSAM failed and a window was built anew.
        fallbacks: how often our own pass had to stand in for GTSAM.
        too_late: measurements that came too late for a window.
        stitched: joints between fragments of one vehicle.
        tracks: confirmed tracks that have ended.
    """

    def __init__(self, config: Config) -> None:
        self.rebuilds = self.fallbacks = self.too_late = self.stitched = self.tracks = 0
        self._config = config
        self._errors = ErrorStates.of(config)
        settings = config.smoother
        self._whole = settings.engine in WHOLE
        self._stitch = settings.stitch and self._whole
        self._steps_per_flush = max(settings.chunk, 1)
        self._rate_hz = settings.output_rate_hz
        self._bin = -np.inf
        self._histories: dict[int, TrackHistory] = {}
        self._done: list[TrackHistory] = []
        self._ready = WaitingRows(config.sensor_names)
        self._scan_t: list[float] = []
        self._ids: IntArray = np.zeros(0, dtype=np.int64)
        self._confirmed: BoolArray = np.zeros(0, dtype=np.bool_)
        self._ended: list[int] = []
        self._updates: list[FloatArray] = []
        self._update_t: list[float] = []
        self._looks: list[tuple[float, bool, IntArray, FloatArray, IntArray, BoolArray, BoolArray]] = []

    def record(
        self, t: float, tracks: TrackArrays, n: int, births: int, log: UpdateLog, reported: IntArray
    ) -> None:
        """Take down one step.

        Args:
            t: time of the step (s).
            tracks: state after it.
            n: living tracks.
            births: how many of these were born in it.
            log: what the tracks took in.
            reported: identities in the causal table of the step, ascending.
        """
        count = int(log.count[0])
        if count:
            self._updates.append(log.rows[:count].copy())
            self._update_t.append(t)
        ids, confirmed = tracks.track_id[:n].copy(), tracks.confirmed[:n].copy()
        held = np.zeros(n, dtype=np.bool_)
        held[np.searchsorted(ids, reported)] = True
        held &= tracks.standing[:n]
        wanted = self._row_wanted(t)
        if wanted and self._stitch:
            self._scan_t.append(t)
        self._looks.append(
            (t, wanted, ids, tracks.existence[:n].copy(), tracks.used[:n].copy(), confirmed, held)
        )
        over = False
        if n - births != len(self._ids):
            gone = ~np.isin(self._ids, ids)
            self._ended.extend(self._ids[gone].tolist())
            over = bool(self._confirmed[gone].any())
        self._ids, self._confirmed = ids, confirmed
        if over or len(self._looks) >= self._steps_per_flush:
            self.flush()

    def _row_wanted(self, t: float) -> bool:
        """Whether the table gets rows at this step: the first one in each interval of the output's rate."""
        if self._rate_hz <= 0.0:
            return True
        bin_ = np.floor(t * self._rate_hz + 1e-9)
        wanted = bool(bin_ > self._bin)
        self._bin = bin_
        return wanted

    def flush(self) -> None:
        """Hand what was taken down to the tracks, end those that are over, collect final rows."""
        for track_id, looks, confirmed in self._split_looks():
            history = self._histories.get(track_id)
            if history is None:
                history = TrackHistory(track_id, self._config, self._errors, keep=self._stitch)
                self._histories[track_id] = history
            history.watch(looks, confirmed)
        for track_id, rows in self._split_updates():
            self._histories[track_id].take(rows)
        for track_id in self._ended:
            history = self._histories.pop(track_id)
            if self._stitch and history.confirmed:
                self._done.append(history)
            else:
                self._end(history)
        self._ended = []
        if not self._whole:
            for history in self._histories.values():
                history.feed()
                self._collect(history.departed())

    def drain(self) -> Trajectories:
        """Return, and forget, the final rows that no later ones can precede, by time and identity."""
        self.flush()
        horizon = min((h.oldest for h in (*self._histories.values(), *self._done)), default=np.inf)
        table = self._gathered([])
        early = table.t < horizon
        self._ready.take()
        self._ready.append(table.take(~early))
        return table.take(early)

    def smoothed(self) -> Trajectories:
        """Return all rows not drained yet: final ones and, of living tracks, those that may still change."""
        self.flush()
        now = []
        for history in (*self._histories.values(), *self._done):
            if history.confirmed:
                final, rows = history.current()
                self._collect(final)
                now += [rows] if rows is not None else []
        return self._gathered(now)

    def finish(self) -> Trajectories:
        """End all tracks, stitch fragments if that is wanted, and return all rows not drained yet."""
        self.flush()
        self._done.extend(self._histories.values())
        self._histories = {}
        histories, self._done = sorted(self._done, key=lambda h: h.track_id), []
        if self._stitch:
            histories = [history for history in histories if history.confirmed]
            histories, joints = stitch_histories(histories, np.asarray(self._scan_t), self._config)
            self.stitched += joints
        for history in histories:
            self._end(history)
        table = self._gathered([])
        self._ready.take()
        return table

    def confirmed_histories(self) -> list[TrackHistory]:
        """Return all confirmed tracks so far, with all they took in; for engines that stitch only."""
        self.flush()
        found = [h for h in (*self._done, *self._histories.values()) if h.confirmed]
        return sorted(found, key=lambda h: h.track_id)

    def _end(self, history: TrackHistory) -> None:
        """Collect the last rows of a track that is over, and its counts."""
        history.feed()
        self._collect(history.finish())
        if history.smoother is not None:
            self.tracks += 1
            self.rebuilds += history.smoother.rebuilds
            self.fallbacks += history.smoother.fallbacks
            self.too_late += history.smoother.too_late
        history.close()

    def _collect(self, rows: Trajectories | None) -> None:
        if rows is not None:
            self._ready.append(rows)

    def _gathered(self, more: list[Trajectories]) -> Trajectories:
        """All rows that are ready, and more, in order of time and identity."""
        parts = self._ready.peek() + more
        if not parts:
            return Trajectories.empty(self._config.sensor_names)
        table = Trajectories.concatenate(parts)
        return table.take(np.lexsort((table.track_id, table.t)))

    def _split_looks(self) -> Iterator[tuple[int, Looks, bool]]:
        """The steps taken down since the last flush, track by track, and whether it was confirmed in any."""
        if not self._looks:
            return
        t, wanted, ids, existence, used, confirmed, held = zip(*self._looks, strict=True)
        self._looks = []
        counts = [len(part) for part in ids]
        owner = np.concatenate(ids)
        order = np.argsort(owner, kind="stable")
        looks = Looks(
            np.repeat(t, counts)[order],
            np.concatenate(existence)[order],
            np.concatenate(used)[order],
            np.concatenate(held)[order],
        )
        is_confirmed, row_wanted = np.concatenate(confirmed)[order], np.repeat(wanted, counts)[order]
        for track_id, part in _groups(owner[order]):
            piece = looks.take(part)
            rows = piece if self._rate_hz <= 0.0 else piece.take(row_wanted[part])
            yield track_id, rows, bool(is_confirmed[part].any())

    def _split_updates(self) -> Iterator[tuple[int, FloatArray]]:
        """The measurements taken down since the last flush, track by track, with their times."""
        if not self._updates:
            return
        t = np.repeat(self._update_t, [len(part) for part in self._updates])
        rows = np.concatenate(self._updates)
        self._updates, self._update_t = [], []
        owner = rows[:, 0].astype(np.int64)
        order = np.argsort(owner, kind="stable")
        table = np.concatenate([t[order, None], rows[order]], axis=1)
        for track_id, part in _groups(owner[order]):
            yield track_id, table[part]


def _groups(owner: IntArray) -> Iterator[tuple[int, slice]]:
    """Runs of equal values in an ascending array (N,), with the value of each."""
    if not len(owner):
        return
    start = np.flatnonzero(np.diff(owner, prepend=-1))
    end = np.append(start[1:], len(owner))
    for a, b in zip(start.tolist(), end.tolist(), strict=True):
        yield int(owner[a]), slice(a, b)
