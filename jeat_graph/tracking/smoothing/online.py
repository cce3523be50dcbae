"""The smoothers of all tracks of a running tracker: one a track, made with it and gone with it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.smoothers.engine import load_engine
from jeat_graph.tracking.smoothing.history import TrackHistory
from jeat_graph.tracking.smoothing.looks import Looks
from jeat_graph.tracking.smoothing.priors import ErrorStates
from jeat_graph.tracking.smoothing.recorder import Packet
from jeat_graph.tracking.smoothing.stitched import stitch_histories
from jeat_graph.tracking.smoothing.waiting import WaitingRows

#: Engines that solve for a track once it has ended; only with these can fragments be stitched.
WHOLE = ("full", "rts")


class _Share(NamedTuple):
    """What a packet holds of one track.

    Attributes:
        looks: its steps that the table has rows at.
        confirmed: whether the track was confirmed in any of them.
        rows: (M,) measurements, or None.
    """

    looks: Looks
    confirmed: bool
    rows: RecordArray | None

    def give_to(self, history: TrackHistory) -> None:
        """Hand it to the track's history."""
        history.watch(self.looks, self.confirmed)
        if self.rows is not None:
            history.take(self.rows)


class TrackSmoothers:
    """Turns the steps of a tracker into smoothed trajectories behind it.

    Of tentative tracks the measurements are only kept; confirmed ones have a smoother, which takes the
    tentative start first. A track that ends frees all it held. Of merged tracks the survivor keeps its own
    measurements only: a confirmed one in fifty ends so.

    The filter measures the velocity of standing tracks as zero; the smoothers do not. What they share is the
    lower jerk of a standing track.

    What comes out depends on the steps alone: not on when rows are fetched, nor on whether the work is done
    at once, little by little or in another process.

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
        load_engine(settings.engine)
        self._whole = settings.engine in WHOLE
        self._stitch = settings.stitch and self._whole
        self._rate_hz = settings.output_rate_hz
        self._histories: dict[int, TrackHistory] = {}
        self._done: list[TrackHistory] = []
        self._shares: dict[int, deque[_Share]] = {}
        self._to_do: deque[int] = deque()
        self._ready = WaitingRows(config.sensor_names)
        self._scan_t: list[FloatArray] = []

    def consume(self, packet: Packet | None) -> None:
        """Set the steps of a packet before the tracks, for `work` to do, and end the tracks that are over."""
        if packet is None:
            return
        if self._stitch:
            self._scan_t.append(packet.t[packet.wanted])
        rows = dict(_split_updates(packet))
        for track_id, looks, confirmed in self._split_looks(packet):
            if track_id not in self._histories:
                history = TrackHistory(track_id, self._config, self._errors, keep=self._stitch)
                self._histories[track_id] = history
            share = _Share(looks, confirmed, rows.get(track_id))
            self._shares.setdefault(track_id, deque()).append(share)
            self._to_do.append(track_id)
        for track_id in packet.ended:
            self._end_track(track_id)
        if self._whole:
            self.work()

    @property
    def waiting(self) -> int:
        """How many shares of packets wait to be worked on."""
        return sum(len(shares) for shares in self._shares.values())

    def work(self, most: int | None = None) -> None:
        """Work on at most so many shares, all if not given: feed the smoothers, collect final rows.

        Each track's shares are worked on one by one and in their order, so that it does not matter when.
        """
        while self._to_do and most != 0:
            track_id = self._to_do.popleft()
            if track_id not in self._shares:
                continue  # it has ended, and all it had waiting was done then
            self._work_on(track_id)
            most = None if most is None else most - 1

    def _work_on(self, track_id: int) -> None:
        """Work on the oldest share of a track."""
        shares, history = self._shares[track_id], self._histories[track_id]
        shares.popleft().give_to(history)
        if not shares:
            del self._shares[track_id]
        if not self._whole:
            history.feed()
            self._collect(history.departed())

    def _end_track(self, track_id: int) -> None:
        """End a track: all its shares at once, of the last only what its smoother takes with the end."""
        shares = self._shares.get(track_id, deque())
        while len(shares) > 1:
            self._work_on(track_id)
        history = self._histories.pop(track_id)
        for last in self._shares.pop(track_id, deque()):
            last.give_to(history)
        if self._stitch and history.confirmed:
            self._done.append(history)
        else:
            self._end(history)

    def drain(self) -> Trajectories:
        """Return, and forget, the final rows that no later ones can precede, by time and identity."""
        waiting = [
            float(share.looks.t[0])
            for shares in self._shares.values()
            for share in shares
            if len(share.looks)
        ]
        oldest = [history.oldest for history in (*self._histories.values(), *self._done)]
        horizon = min(oldest + waiting, default=np.inf)
        table = self._gathered([])
        early = table.t < horizon
        self._ready.take()
        self._ready.append(table.take(~early))
        return table.take(early)

    def smoothed(self) -> Trajectories:
        """Return all rows not drained yet: final ones and, of living tracks, those that may still change."""
        self.work()
        now = []
        for history in (*self._histories.values(), *self._done):
            if history.confirmed:
                final, rows = history.current()
                self._collect(final)
                now += [rows] if rows is not None else []
        return self._gathered(now)

    def finish(self) -> Trajectories:
        """End all tracks, stitch fragments if that is wanted, and return all rows not drained yet."""
        self.work()
        self._done.extend(self._histories.values())
        self._histories = {}
        histories, self._done = sorted(self._done, key=lambda h: h.track_id), []
        if self._stitch:
            histories = [history for history in histories if history.confirmed]
            histories, joints = stitch_histories(
                histories, np.concatenate([np.zeros(0), *self._scan_t]), self._config
            )
            self.stitched += joints
        for history in histories:
            self._end(history)
        table = self._gathered([])
        self._ready.take()
        return table

    def confirmed_histories(self) -> list[TrackHistory]:
        """Return all confirmed tracks so far, with all they took in; for engines that stitch only."""
        self.work()
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

    def _split_looks(self, packet: Packet) -> Iterator[tuple[int, Looks, bool]]:
        """The steps of a packet, track by track, and whether the track was confirmed in any."""
        order = np.argsort(packet.ids, kind="stable")
        looks = Looks(
            np.repeat(packet.t, packet.counts)[order],
            packet.existence[order],
            packet.used[order],
            packet.held[order],
        )
        confirmed, wanted = packet.confirmed[order], np.repeat(packet.wanted, packet.counts)[order]
        for track_id, part in _groups(packet.ids[order]):
            piece = looks.take(part)
            rows = piece if self._rate_hz <= 0.0 else piece.take(wanted[part])
            yield track_id, rows, bool(confirmed[part].any())


def _split_updates(packet: Packet) -> Iterator[tuple[int, RecordArray]]:
    """The measurements of a packet, track by track."""
    owner = packet.updates["track_id"]
    order = np.argsort(owner, kind="stable")
    table = packet.updates[order]
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
