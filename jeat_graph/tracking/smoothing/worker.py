"""Smoothing in a process of its own, so that a step of the tracker never waits for a solve.

The tracker's process only records its steps and sends them in packets; the worker makes of them just what
`InProcessSmoothing` would. What waits between them is bounded: a worker that falls behind by more than that
makes the tracker wait, since steps must not pile up without end.
"""

from __future__ import annotations

import pickle
import queue
import signal
import traceback
import warnings
import weakref
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.errors import JeatGraphError
from jeat_graph.data.processes import safe_start
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.smoothing.behind import COUNTS
from jeat_graph.tracking.smoothing.history import WHOLE
from jeat_graph.tracking.smoothing.journal import PACKETS_PER_STATE, Journal
from jeat_graph.tracking.smoothing.online import TrackSmoothers
from jeat_graph.tracking.smoothing.outbox import Outbox
from jeat_graph.tracking.smoothing.recorder import StepRecorder
from jeat_graph.tracking.smoothing.waiting import WaitingRows
from jeat_graph.tracking.step_record import StepRecord

#: Packets that may wait for the worker: about half a minute of two sensors at 100 and 20 Hz.
MOST_WAITING = 64
_POLL_S = 0.02
#: So many workers may die without one message in between; then it is the work that kills them.
MOST_DEATHS = 3


class SmoothingWorker:
    """Smoothing in another process.

    The process is started fresh (`spawn`), so a script that uses it needs the usual
    `if __name__ == "__main__":`. It ends with `finish`, and otherwise with this object or with the process
    that made it, however that ends.

    One that dies is replaced: another one begins with the last state that it sent, and is given the packets
    since again. Its rows may differ from those it would have made in the last digits of a double.

    An error in the worker is raised here by the next call that hears of it, at the latest by the one after
    the next packet; from then on every call raises.

    Args:
        config: settings of the smoother, the sizes and the output.
        most_waiting: how many packets may wait.
    """

    def __init__(self, config: Config, most_waiting: int = MOST_WAITING) -> None:
        self._recorder = StepRecorder(config)
        self._rows = WaitingRows(config.sensor_names)
        self._sensors = config.sensor_names
        self._counts = dict.fromkeys(COUNTS, 0)
        self._warned = self._ended = False
        self._failure: str | None = None
        self._asked = self._deaths = 0
        self._config, self._most_waiting = config, most_waiting
        self._journal = Journal()
        self._start(most_waiting)

    def _start(self, most_waiting: int) -> None:
        """Start a process, with room for so many orders that wait."""
        context = get_context("spawn")
        orders, mine = context.Pipe(duplex=False)
        self._answers, theirs = context.Pipe(duplex=False)
        arguments = (self._config, orders, theirs, self._most_waiting)
        self._process = context.Process(target=_serve, args=arguments, daemon=True)
        with safe_start():
            self._process.start()
        # Whoever holds an end open keeps the other side from seeing that there is nobody any more.
        orders.close()
        theirs.close()
        self._orders = Outbox(mine, most_waiting)
        self._stop = weakref.finalize(self, _stop, self._process, self._orders)

    def _replace(self) -> None:
        """Let another process go on where one has died: from its last state, with the packets since.

        Raises:
            JeatGraphError: it has died again and again without getting any further.
        """
        self._process.join()
        self._deaths += 1
        died = f"the smoothing worker has died (exit code {self._process.exitcode})"
        if self._deaths > MOST_DEATHS:
            self._failure = f"{died}, {self._deaths} times at one place"
            raise JeatGraphError(self._failure)
        warnings.warn(f"{died}: another one goes on in its place, nothing is lost", stacklevel=5)
        self._stop()
        self._journal.begin_again()
        self._start(self._most_waiting + len(self._journal.packets) + 1)
        if self._journal.state is not None:
            kept = self._journal.sent - len(self._journal.packets)
            self._orders.put(("load", (kept, self._journal.state)), _POLL_S)
        for packet in self._journal.packets:
            self._orders.put(("consume", packet), _POLL_S)
        self._failure = None

    def record(self, step: StepRecord) -> None:
        """Record one step, and send a packet when it is full."""
        if self._recorder.record(step):
            self._send("consume", self._recorder.drain())
            self._receive()

    def drain(self) -> Trajectories:
        """Return, and forget, the final rows that have come back so far, in order of time over all calls."""
        self._receive()
        return Trajectories.concatenate([Trajectories.empty(self._sensors), *self._rows.drain()])

    def smoothed(self) -> Trajectories:
        """Return all rows not drained yet, those too that may still change; waits for the worker."""
        if self._ended:
            return Trajectories.empty(self._sensors)
        table = Trajectories.concatenate([self._ask("smoothed"), *self._rows.peek()])
        return table.take(np.lexsort((table.track_id, table.t)))

    def finish(self) -> Trajectories:
        """End all tracks and return all rows not drained yet; the worker ends."""
        if self._ended:
            return Trajectories.empty(self._sensors)
        last = self._ask("finish")
        self._ended = True
        self._process.join()
        self._stop()
        return Trajectories.concatenate([*self._rows.drain(), last])

    def settle(self) -> None:
        """Have the worker work off all that waits, and build GTSAM's windows anew from our arrays."""
        self._send("consume", self._recorder.drain())
        self._send("settle", None)

    def counts(self) -> dict[str, int]:
        """How the smoothers fared, as far as the worker has told."""
        self._receive()
        return self._counts

    def _send(self, order: str, content: Any) -> None:
        """Hand an order to the worker; where too many wait, take in answers until there is room."""
        while True:
            self._receive()
            try:
                self._orders.put((order, content), _POLL_S)
                if order == "consume":
                    self._journal.note(content)
                return
            except queue.Full:
                if not self._warned:
                    warnings.warn("the smoothing worker falls behind: the tracker waits for it", stacklevel=4)
                    self._warned = True
            except BrokenPipeError:
                # The end of its answers says why.
                self._answers.poll(_POLL_S)

    def _ask(self, order: str) -> Trajectories:
        """Send all steps and a question, and wait for its answer, taking in the rows that come before it."""
        self._asked += 1
        self._send("consume", self._recorder.drain())
        self._send(order, self._asked)
        while True:
            self._answers.poll(None)
            process = self._process
            kind, table = self._answer()
            if process is not self._process:
                self._send(order, self._asked)  # the one who was asked is dead
            # An answer to a question before may come first: an interrupt had given up waiting for it.
            if kind == self._asked:
                return table

    def _receive(self) -> None:
        """Take in the answers that are there."""
        if self._failure is not None:
            raise JeatGraphError(self._failure)
        while not self._ended and self._answers.poll():
            self._answer()

    def _answer(self) -> tuple[int | str, Trajectories]:
        """Take in the next answer, which has begun to come.

        Returns:
            The number of the question, "rows", "state" or "replaced", and the table.
        """
        # An interrupt in here may leave half an answer in the pipe: then nothing that follows can be read.
        self._failure = "the smoothing worker was interrupted; make another tracker"
        try:
            kind, content, self._counts = self._answers.recv()
        except (EOFError, ConnectionResetError):
            self._replace()
            return "replaced", Trajectories.empty(self._sensors)
        if kind == "error":
            self._failure = f"the smoothing worker has failed: {content}"
            raise content
        self._failure = None
        self._deaths = 0
        if kind == "rows":
            self._rows.append(self._journal.new_rows(content))
        if kind == "state":
            self._journal.keep(*content)
        return kind, content


def _stop(process: Any, orders: Outbox) -> None:
    """End the worker, be it busy or not, and what sends to it."""
    process.kill()  # it has nothing to put in order
    process.join()
    orders.close()


def _serve(config: Config, orders: Connection, answers: Connection, most_waiting: int) -> None:
    """Do what the tracker's process orders until it says `finish`, or is there no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is the other process's to deal with
    from jeat_graph.tracking.compiled_codecs import pack_smoothers, unpack_smoothers

    smoothers, before = TrackSmoothers(config), 0
    bounded = config.smoother.engine not in WHOLE  # else the state holds all that has ever been measured
    outbox = Outbox(answers, most_waiting)

    def answer(kind: int | str, content: Any) -> None:
        counts = {name: getattr(smoothers, name) for name in COUNTS}
        while True:
            try:
                return outbox.put((kind, content, counts), 1.0)
            except queue.Full:
                continue

    try:
        order, consumed = "", 0
        while order != "finish":
            order, content = orders.recv()
            if order == "consume":
                smoothers.consume(content)
                smoothers.work()
                rows = smoothers.drain()
                if len(rows):
                    answer("rows", rows)
                consumed += 1
                if bounded and consumed % PACKETS_PER_STATE == 0:
                    answer("state", (before + consumed, pack_smoothers(config, smoothers)))
            elif order == "settle":
                smoothers.settle()
            elif order == "load":
                before, state = content
                smoothers = unpack_smoothers(config, state)
            else:
                answer(content, smoothers.finish() if order == "finish" else smoothers.smoothed())
    except (EOFError, BrokenPipeError):
        return  # the tracker is gone
    except Exception as error:
        answer("error", _portable(error))
    outbox.close()


def _portable(error: Exception) -> Exception:
    """The error with its traceback as a note, or another one in its place if it cannot be sent."""
    error.add_note(f"In the smoothing worker:\n{traceback.format_exc()}")
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return JeatGraphError(f"{type(error).__name__} in the smoothing worker: {error}")
    return error
