"""Smoothing in a process of its own, so that a step of the tracker never waits for a solve.

The tracker's process only takes down its steps and sends them by packets; the worker makes of them just what
`SmoothingHere` would. The queue between them is bounded: a worker that falls behind by more than it holds
makes the tracker wait, since steps must not pile up without end.
"""

from __future__ import annotations

import queue
import signal
import warnings
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from jeat_graph.arrays import IntArray
from jeat_graph.config import Config
from jeat_graph.errors import JeatGraphError
from jeat_graph.smoothing.behind import COUNTS
from jeat_graph.smoothing.history import TrackHistory
from jeat_graph.smoothing.online import TrackSmoothers
from jeat_graph.smoothing.recorder import StepRecorder
from jeat_graph.smoothing.waiting import WaitingRows
from jeat_graph.state import TrackArrays
from jeat_graph.trajectories import Trajectories
from jeat_graph.update_log import UpdateLog

#: Packets that may wait for the worker: about half a minute of two sensors at 100 and 20 Hz.
MOST_WAITING = 64
_POLL_S = 0.02


class SmoothingWorker:
    """Smoothing in another process.

    The process is started fresh (`spawn`), so a script that uses it needs the usual
    `if __name__ == "__main__":`. It ends with the tracker's own.

    Args:
        config: settings of the smoother, the sizes and the output.
        most_waiting: bound of the queue (packets).
    """

    def __init__(self, config: Config, most_waiting: int = MOST_WAITING) -> None:
        context = get_context("spawn")
        self._recorder = StepRecorder(config)
        self._sensors = config.sensor_names
        self._rows = WaitingRows(config.sensor_names)
        self._counts = dict.fromkeys(COUNTS, 0)
        self._warned = self._ended = False
        self._orders: Any = context.Queue(most_waiting)
        self._answers, theirs = context.Pipe(duplex=False)
        self._process = context.Process(target=_serve, args=(config, self._orders, theirs), daemon=True)
        self._process.start()
        theirs.close()

    def record(
        self, t: float, tracks: TrackArrays, n: int, births: int, log: UpdateLog, reported: IntArray
    ) -> None:
        """Take down one step, and send a packet when it is full."""
        if self._recorder.record(t, tracks, n, births, log, reported):
            self._send("consume", self._recorder.take())

    def drain(self) -> Trajectories:
        """Return, and forget, the final rows that have come back so far, in order of time over all calls."""
        self._receive()
        tables = self._rows.take()
        return Trajectories.concatenate(tables) if tables else Trajectories.empty(self._sensors)

    def smoothed(self) -> Trajectories:
        """Return all rows not drained yet, those too that may still change; waits for the worker."""
        self._send("consume", self._recorder.take())
        self._send("smoothed", None)
        table = Trajectories.concatenate([*self._rows_and("smoothed"), *self._rows.peek()])
        return table.take(np.lexsort((table.track_id, table.t)))

    def finish(self) -> Trajectories:
        """End all tracks and return all rows not drained yet; the worker ends."""
        self._send("consume", self._recorder.take())
        self._send("finish", None)
        last = self._rows_and("finish")
        self._ended = True
        self._process.join()
        return Trajectories.concatenate([*self._rows.take(), *last])

    def counts(self) -> dict[str, int]:
        """How the smoothers fared, as far as the worker has told."""
        self._receive()
        return self._counts

    def confirmed_histories(self) -> list[TrackHistory]:
        """Refuse: the histories are in the other process.

        Raises:
            JeatGraphError: always.
        """
        raise JeatGraphError("the tracks' measurements are with the worker: set smoother.worker to false")

    def _send(self, order: str, content: Any) -> None:
        """Hand an order to the worker; where the queue is full, take in answers until there is room."""
        while True:
            try:
                self._orders.put((order, content), timeout=_POLL_S)
                return
            except queue.Full:
                if not self._warned:
                    warnings.warn("the smoothing worker falls behind: the tracker waits for it", stacklevel=4)
                    self._warned = True
                self._receive()

    def _receive(self) -> None:
        """Take in the answers that are there."""
        if self._ended:
            return
        while self._answers.poll():
            self._take(*self._answer())
        if not self._process.is_alive() and self._process.exitcode not in (0, None):
            raise JeatGraphError(f"the smoothing worker has died (exit code {self._process.exitcode})")

    def _rows_and(self, wanted: str) -> list[Trajectories]:
        """Wait for the answer to an order, taking in the rows that come before it."""
        while True:
            if not self._answers.poll(_POLL_S):
                self._receive()
                continue
            kind, content, counts = self._answer()
            self._take(kind, content, counts)
            if kind == wanted:
                return [content]

    def _answer(self) -> tuple[str, Any, dict[str, int]]:
        try:
            kind, content, counts = self._answers.recv()
        except EOFError:
            self._process.join()
            raise JeatGraphError(
                f"the smoothing worker has died (exit code {self._process.exitcode})"
            ) from None
        if kind == "error":
            raise content
        return kind, content, counts

    def _take(self, kind: str, content: Any, counts: dict[str, int]) -> None:
        self._counts = counts
        if kind == "rows":
            self._rows.append(content)


def _serve(config: Config, orders: Any, answers: Connection) -> None:
    """Do what the tracker's process orders until it says `finish`."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is the other process's to deal with
    smoothers = TrackSmoothers(config)

    def answer(kind: str, content: Any) -> None:
        answers.send((kind, content, {name: getattr(smoothers, name) for name in COUNTS}))

    try:
        while True:
            order, content = orders.get()
            if order == "consume":
                smoothers.consume(content)
                smoothers.work()
                rows = smoothers.drain()
                if len(rows):
                    answer("rows", rows)
            elif order == "smoothed":
                answer(order, smoothers.smoothed())
            else:
                answer(order, smoothers.finish())
                return
    except BrokenPipeError:
        return  # the tracker is gone
    except Exception as error:
        answer("error", error)
