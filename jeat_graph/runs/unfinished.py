"""The state of a run that is not finished, kept in its folder so that a crash costs some seconds of work.

Beside the tracker's state there is a log of all rows so far. A run that goes on writes its tables again from
the log, then goes on from the state: its files are, byte for byte, those of a run that was never broken off.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jeat_graph.config.schema import Config
from jeat_graph.data.diagnostics import Diagnostics
from jeat_graph.data.errors import DataError, JeatGraphError, OtherRunError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.files.packing import pack, plain_codec, unpack
from jeat_graph.tracking.checkpoint import load_state, save_state
from jeat_graph.tracking.damage import refusing_damage

_STATE, _ROWS = "state.npz", "rows.bin"
_CODECS = {kind.__name__: plain_codec(kind) for kind in (Trajectories, Diagnostics)}
#: Lengths of a part's text and of its bytes.
_HEAD = struct.Struct("<qq")


class UnfinishedRun:
    """The state and the rows of a run in a folder of their own.

    Args:
        folder: the folder, which need not exist.
        identity: all that the run's files depend on, plain data.
    """

    def __init__(self, folder: Path, identity: dict[str, Any]) -> None:
        self._state, self._rows, self._identity = folder / _STATE, folder / _ROWS, identity
        self._parts: dict[str, list[Any]] = {}
        self._length = 0  # of the log, up to the parts that wait

    def load(self) -> dict[str, Any] | None:
        """Return the state that was saved last, or None.

        Raises:
            OtherRunError: it is of another run or version, or cannot be read.
        """
        if not self._state.exists():
            return None
        try:
            _, state = load_state(self._state)
        except JeatGraphError as error:
            raise OtherRunError(str(error)) from None
        identity, length = state.get("identity"), state.get("rows")
        if not isinstance(identity, dict) or not isinstance(length, int):
            raise OtherRunError(f"{self._state}: holds no run that is not finished")
        other = [key for key, value in self._identity.items() if identity.get(key) != value]
        if other:
            raise OtherRunError(f"{self._state}: was left by a run with other {' and '.join(other)}")
        if not self._rows.is_file() or self._rows.stat().st_size < length:
            raise OtherRunError(f"{self._rows}: is shorter than when the state was saved")
        self._length = length
        return state

    def begin(self) -> None:
        """Make the folder; of an earlier state and rows only what has been loaded is kept."""
        self._rows.parent.mkdir(exist_ok=True)
        if not self._length:
            self._state.unlink(missing_ok=True)
        with self._rows.open("ab") as file:
            file.truncate(self._length)

    def rows(self) -> Iterator[tuple[str, Any]]:
        """Yield what had been written before the state was saved, in its order for each file.

        Raises:
            DataError: the rows are damaged.
        """
        with self._rows.open("rb") as file:
            while file.tell() < self._length:
                with refusing_damage(self._rows):
                    text, block = _HEAD.unpack(file.read(_HEAD.size))
                    if min(text, block) < 0 or file.tell() + text + block > self._length:
                        raise DataError("is damaged: rows are missing")
                    parts = unpack(file.read(text).decode(), file.read(block), _CODECS)
                    pieces = [(name, piece) for name, pieces in parts.items() for piece in pieces]
                yield from pieces

    def add(self, name: str, piece: Any) -> None:
        """Take down a piece of a table, or of records, that has been written to one of the run's files."""
        self._parts.setdefault(name, []).append(piece)

    def flush(self) -> None:
        """Write down the pieces since the last call."""
        if not self._parts:
            return
        text, block = pack(self._parts, _CODECS)
        content = text.encode()
        with self._rows.open("ab") as file:
            file.write(_HEAD.pack(len(content), len(block)) + content + block)
            self._length = file.tell()
        self._parts = {}

    def save(self, config: Config, state: dict[str, Any]) -> None:
        """Save a state, after all pieces up to it.

        Args:
            config: the run's configuration.
            state: plain data and what a tracker's state may hold (`tracking/checkpoint.py`).
        """
        self.flush()
        save_state(self._state, config, state | {"identity": self._identity, "rows": self._length})
