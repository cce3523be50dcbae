"""Lines on standard output, each handed on at once; a reader who does not read holds up no signal."""

from __future__ import annotations

import os
import stat
import sys

from jeat_graph.io.files.pipe_writer import write_to_pipe
from jeat_graph.live.transport.patience import Overdue, UnconfirmedError, never


class StdoutLines:
    """Writes lines to standard output.

    Args:
        overdue: tells whether the program is to end; then a reader who does not read is not waited for.
    """

    def __init__(self, overdue: Overdue = never) -> None:
        self._overdue = overdue
        self._pipe = _pipe_number()

    def write(self, text: str) -> None:
        """Write text that ends with a line.

        Raises:
            UnconfirmedError: the program is to end, and the reader has not taken it.
            BrokenPipeError: the reader has gone.
        """
        if self._pipe is None:
            sys.stdout.write(text)
            sys.stdout.flush()
            return
        data = text.encode(sys.stdout.encoding, sys.stdout.errors or "strict")
        if write_to_pipe(self._pipe, data, self._overdue) < len(data):
            raise UnconfirmedError("standard output: its reader has not taken all tracks")


def _pipe_number() -> int | None:
    """The number of standard output if it is a pipe, with nothing left in Python's own store."""
    try:
        number = sys.stdout.fileno()
        is_pipe = os.name != "nt" and stat.S_ISFIFO(os.fstat(number).st_mode)
        sys.stdout.flush()
    except (AttributeError, ValueError, OSError):
        return None
    return number if is_pipe else None
