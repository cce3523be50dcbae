"""Smoothing of all tracks of a running tracker, each by a smoother of its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import BoolArray, FloatArray, RecordArray
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


_SIDES: tuple[Literal["left"], Literal["right"]] = ("left", "right")

#: What handing a share of a packet to a track costs, in measurements solved for.
_HANDING = 4


class SortedPacket(NamedTuple):
    """A packet's steps and measurements, those of each track together and in order of time.

    Attributes:
        looks: (L,) steps that the table has rows at.
        confirmed: (L',) whether the track was confirmed, in all steps.
        updates: (M,) measurements.
    """

    looks: Looks
    confirmed: BoolArray
    updates: RecordArray


class Share(NamedTuple):
    """What a packet holds of one track; cut out of it only when its turn comes.

    Attributes:
        packet: the packet.
        looks: its part of `packet.looks`.
        steps: its part of `packet.confirmed`.
        updates: its part of `packet.updates`.
        last: whether the track ended in the packet.
    """

    packet: SortedPacket
    looks: slice
    steps: slice
    updates: slice
    last: bool

    @property
    def taken(self) -> int:
        """How many measurements it holds."""
        return int(self.updates.stop - self.updates.start)

    @property
    def oldest(self) -> float:
        """Time of its first row (s), or infinity."""
        part = self.looks
        return float(self.packet.looks.t[part.start]) if part.stop > part.start else np.inf

    def give_to(self, history: TrackHistory) -> None:
        """Hand it to the track's history."""
        history.watch(self.packet.looks.take(self.looks), bool(self.packet.confirmed[self.steps].any()))
        if self.taken:
            history.take(self.packet.updates[self.updates])


class TrackSmoothers:
    """Turns the steps of a tracker into smoothed trajectories behind it.

    Of tentative tracks the measurements are only kept; confirmed ones have a smoother, which takes the
    tentative start first. A track that ends frees all it held when its last share has been worked on. Of
    merged tracks the survivor keeps its own measurements only: a confirmed one in fifty ends so.

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
        self._shares: dict[int, deque[Share]] = {}
        self._to_do: deque[int] = deque()
        self._ready = WaitingRows(config.sensor_names)
        self._scan_t: list[FloatArray] = []

    def consume(self, packet: Packet | None) -> None:
        """Set the steps of a packet before the tracks, for `work` to do."""
        if packet is None:
            return
        if self._stitch:
            self._scan_t.append(packet.t[packet.wanted])
        ended = set(packet.ended)
        for track_id, share in self._split(packet, ended):
            if track_id not in self._histories:
                history = TrackHistory(track_id, self._config, self._errors, keep=self._stitch)
                self._histories[track_id] = history
            self._shares.setdefault(track_id, deque()).append(share)
            self._to_do.append(track_id)
        if self._whole:
            self.work()

    @property
    def backlog(self) -> int:
        """What the shares that wait will cost, in measurements to be solved for."""
        return sum(
            _HANDING * len(shares) + self._histories[track_id].to_solve(sum(share.taken for share in shares))
            for track_id, shares in self._shares.items()
        )

    def work(self, most: int | None = None) -> None:
        """Work on shares of about so much cost (`backlog`), on all if not given.

        Each track's shares are worked on one by one and in their order, so that it does not matter when.
        """
        while self._to_do and (most is None or most > 0):
            track_id = self._to_do.popleft()
            cost = self._work_on(track_id)
            most = None if most is None else most - cost

    def _work_on(self, track_id: int) -> int:
        """Work on the oldest share of a track: its smoother takes it in, and what is final is collected.

        Returns:
            What it cost.
        """
        shares, history = self._shares[track_id], self._histories[track_id]
        share = shares.popleft()
        if not shares:
            del self._shares[track_id]
        cost = _HANDING + history.to_solve(share.taken)
        share.give_to(history)
        if share.last:
            del self._histories[track_id]
            if self._stitch and history.confirmed:
                self._done.append(history)
            else:
                self._end(history)
        elif not self._whole:
            history.feed()
            self._collect(history.departed())
        return cost

    def drain(self) -> Trajectories:
        """Return, and forget, the final rows that no later ones can precede, by time and identity."""
        waiting = [share.oldest for shares in self._shares.values() for share in shares]
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
                now += rows
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

    def _collect(self, tables: list[Trajectories]) -> None:
        for rows in tables:
            self._ready.append(rows)

    def _gathered(self, more: list[Trajectories]) -> Trajectories:
        """All rows that are ready, and more, in order of time and identity."""
        parts = self._ready.peek() + more
        if not parts:
            return Trajectories.empty(self._config.sensor_names)
        table = Trajectories.concatenate(parts)
        return table.take(np.lexsort((table.track_id, table.t)))

    def _split(self, packet: Packet, ended: set[int]) -> Iterator[tuple[int, Share]]:
        """The share of each track in a packet, by identity."""
        order = np.argsort(packet.ids, kind="stable")
        rows = order if self._rate_hz <= 0.0 else order[np.repeat(packet.wanted, packet.counts)[order]]
        looks = Looks(
            np.repeat(packet.t, packet.counts)[rows],
            packet.existence[rows],
            packet.used[rows],
            packet.held[rows],
        )
        updates = packet.updates[np.argsort(packet.updates["track_id"], kind="stable")]
        whole = SortedPacket(looks, packet.confirmed[order], updates)
        # A track that ended between two packets has no step in this one.
        ids = np.union1d(packet.ids, np.array(packet.ended, dtype=np.int64))
        owners = packet.ids[rows], packet.ids[order], updates["track_id"]
        parts = [
            zip(*(np.searchsorted(o, ids, side).tolist() for side in _SIDES), strict=True) for o in owners
        ]
        for track_id, looked, stepped, updated in zip(ids.tolist(), *parts, strict=True):
            bounds = slice(*looked), slice(*stepped), slice(*updated)
            yield track_id, Share(whole, *bounds, track_id in ended)
