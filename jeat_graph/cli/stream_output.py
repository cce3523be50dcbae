"""Where `jeat-graph stream` gives out its tracks: lines on stdout, or messages to a broker."""

from __future__ import annotations

from typing import TYPE_CHECKING

from jeat_graph.live.stdout_lines import StdoutLines
from jeat_graph.live.transport.patience import Overdue, never

if TYPE_CHECKING:
    from jeat_graph.data.trajectories import Trajectories
    from jeat_graph.live.health import HealthChange
    from jeat_graph.live.messages import ScanMessage
    from jeat_graph.live.transport.brokers.record import Sink


class StreamOutput:
    """Tracks to stdout, each line flushed at once, or as messages to a broker.

    Args:
        form: `json` or `csv`, of stdout.
        encoding: of messages to a broker.
        sink: the broker; None for stdout.
        overdue: tells whether the program is to end.

    Attributes:
        seq: number of the next message to a broker.
    """

    def __init__(self, form: str, encoding: str, sink: Sink | None, overdue: Overdue = never) -> None:
        self.seq = 0
        self._say = StdoutLines(overdue).write
        self._encoding, self._sink = encoding, sink
        self._csv = form == "csv"
        self._classes: bool | None = None  # whether the rows of CSV have them

    def tracks(self, t: float, table: Trajectories, message: ScanMessage, late_s: float) -> None:
        """Give out the tracks after an arrival; CSV has no rows twice, so none after a late one."""
        from jeat_graph.io.streams.track_lines import csv_rows, json_line
        from jeat_graph.live.messages import encode_tracks

        if self._sink is not None:
            self._sink.send(encode_tracks(json_line(t, table), self.seq, message, self._encoding))
            self.seq += 1
        elif not self._csv:
            self._say(json_line(t, table))
        elif late_s == 0.0:
            self.begin(table.classes is not None)
            self._say(csv_rows(table, bool(self._classes)))

    def begin(self, classes: bool = False) -> None:
        """Give out the header of CSV, once; the first answer shows whether there are classes."""
        from jeat_graph.io.streams.track_lines import csv_header

        if self._csv and self._classes is None:
            self._classes = classes
            self._say(csv_header(classes))

    def event(self, event: HealthChange) -> None:
        """Say on the output, too, that a sensor fails or is well again, or that its clock was found."""
        line = event.line() + "\n"
        if self._sink is not None:
            from jeat_graph.live.messages import encode_tracks

            self._sink.send(encode_tracks(line, self.seq, None, self._encoding))
            self.seq += 1
        elif not self._csv:
            self._say(line)

    def flush(self) -> None:
        """Wait until the broker has all."""
        if self._sink is not None:
            self._sink.flush()
