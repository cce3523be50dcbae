"""What another smoothing worker needs to go on where one has died: a state, and the packets since."""

from __future__ import annotations

from collections import deque

import numpy as np

from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.smoothing.recorder import Packet

#: The worker sends its state after so many packets (some ten seconds); as many are done again at most.
PACKETS_PER_STATE = 32


class Journal:
    """The packets that are not in a state which the worker has sent, and how many rows came since.

    Attributes:
        sent: how many packets have been sent to a worker so far.
        state: the last state that came, or None: then the packets begin with the first.
        packets: those after that state.
    """

    def __init__(self) -> None:
        self.sent = 0
        self.state: tuple[str, bytes] | None = None
        self.packets: deque[Packet | None] = deque()
        self._rows = self._skip = 0

    def note(self, packet: Packet | None) -> None:
        """A packet has been sent."""
        self.sent += 1
        self.packets.append(packet)

    def keep(self, consumed: int, state: tuple[str, bytes]) -> None:
        """A state has come, with so many packets in it."""
        while self.sent - len(self.packets) < consumed:
            self.packets.popleft()
        self.state, self._rows = state, 0

    def begin_again(self) -> None:
        """Another worker begins with the state: the rows that have come since will come again."""
        self._skip, self._rows = self._skip + self._rows, 0

    def new_rows(self, table: Trajectories) -> Trajectories:
        """Return the rows of a table that have not come before."""
        again = min(self._skip, len(table))
        self._skip -= again
        self._rows += len(table)
        return table.take(np.arange(again, len(table)))
