"""Smoothing of all tracks of a running tracker, each by a smoother of its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.progress import progress_span, with_progress
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.smoothers.engine import load_engine
from jeat_graph.smoothers.fixed_lag import FixedLagSmoother
from jeat_graph.tracking.smoothing.exchanged import exchange_histories
from jeat_graph.tracking.smoothing.history import WHOLE, TrackHistory
from jeat_graph.tracking.smoothing.priors import ErrorStates
from jeat_graph.tracking.smoothing.recorder import Packet
from jeat_graph.tracking.smoothing.shares import HANDING, Share, cost_of_solving, split
from jeat_graph.tracking.smoothing.stitched import stitch_histories
from jeat_graph.tracking.smoothing.waiting import WaitingRows

# Share of the last work that joining fragments is: each is smoothed twice for it, in a simpler way.
_STITCHED = 0.5


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
        exchanged: encounters after which two vehicles changed places in hindsight.
        stitched: joints between fragments of one vehicle.
        tracks: confirmed tracks that have ended.
    """

    def __init__(self, config: Config) -> None:
        self.rebuilds = self.fallbacks = self.too_late = self.exchanged = self.stitched = self.tracks = 0
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
        for track_id, share in split(packet, self._rate_hz):
            if track_id not in self._histories:
                given = int(packet.given[np.argmax(packet.ids == track_id)])
                history = TrackHistory(track_id, self._config, self._errors, self._stitch, given)
                self._histories[track_id] = history
            self._shares.setdefault(track_id, deque()).append(share)
            self._to_do.append(track_id)
        if self._whole:
            self.work()

    @property
    def backlog(self) -> int:
        """What the shares that wait will cost, in measurements to be solved for."""
        return sum(
            HANDING * len(shares)
            + cost_of_solving(self._histories[track_id].to_solve(sum(share.measured for share in shares)))
            for track_id, shares in self._shares.items()
        )

    def work(self, most: float = np.inf) -> int:
        """Work on shares of about so much cost (`backlog`), on all if not given.

        Each track's shares are worked on one by one and in their order, so that it does not matter when.

        Returns:
            What it cost; the last share worked on may have made it more than `most`.
        """
        spent = 0
        while self._to_do and spent < most:
            spent += self._work_on(self._to_do.popleft())
        return spent

    def _work_on(self, track_id: int) -> int:
        """Work on the oldest share of a track: its smoother takes it in, and what is final is collected.

        Returns:
            What it cost.
        """
        shares, history = self._shares[track_id], self._histories[track_id]
        share = shares.popleft()
        if not shares:
            del self._shares[track_id]
        share.give_to(history)
        to_solve = history.to_solve()
        if share.last:
            del self._histories[track_id]
            if self._stitch and history.confirmed:
                self._done.append(history)
            else:
                self._end(history)
        elif to_solve and not self._whole:
            history.feed()
            self._collect(history.departed())
        return HANDING + cost_of_solving(to_solve)

    def settle(self) -> None:
        """Work on all shares, and have GTSAM's windows built anew from our arrays."""
        self.work()
        for history in self._histories.values():
            if isinstance(history.smoother, FixedLagSmoother):
                history.smoother.forget_gtsam()

    def drain(self) -> Trajectories:
        """Return, and forget, the final rows that no later ones can precede, by time and identity."""
        horizon = min(self._without_rows(), default=np.inf)
        table = self._joined(self._ready.drain())
        early = table.t < horizon
        self._ready.append(table.take(~early))
        rows = np.flatnonzero(early)
        return table.take(rows[np.lexsort((table.track_id[rows], table.t[rows]))])

    def _without_rows(self) -> Iterator[float]:
        """The time of the first step without a row of each track that has such (s)."""
        for history in self._done:
            yield history.oldest
        for track_id, history in self._histories.items():
            oldest = history.oldest
            if oldest < np.inf:
                yield oldest
                continue
            for share in self._shares.get(track_id, ()):
                if share.oldest < np.inf:
                    yield share.oldest
                    break

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
        """End all tracks, put identities right in hindsight, and return all rows not drained yet."""
        self.work()
        self._done.extend(self._histories.values())
        self._histories = {}
        histories, self._done = sorted(self._done, key=lambda h: h.track_id), []
        if self._stitch:
            histories = [history for history in histories if history.confirmed]
            with progress_span(0.0, 0.5 * _STITCHED):
                histories, exchanges = exchange_histories(histories, self._config)
            with progress_span(0.5 * _STITCHED, _STITCHED):
                histories, joints = stitch_histories(
                    histories, np.concatenate([np.zeros(0), *self._scan_t]), self._config
                )
            self.exchanged += exchanges
            self.stitched += joints
        with progress_span(_STITCHED if self._stitch else 0.0, 1.0):
            for history in with_progress(histories):
                self._end(history)
        table = self._gathered([])
        self._ready.drain()
        return table

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
        table = self._joined(self._ready.peek() + more)
        return table.take(np.lexsort((table.track_id, table.t)))

    def _joined(self, parts: list[Trajectories]) -> Trajectories:
        """One table of many."""
        if len(parts) == 1:
            return parts[0]
        return Trajectories.concatenate([Trajectories.empty(self._config.sensor_names), *parts])
