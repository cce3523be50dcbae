"""Events in the layout of the DSEC data set, which is our own HDF5 too, through the common reader."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph.io.events.reader import PIECE_ROWS, EventReader, agreed_size

#: DSEC's own files do not say their size; its cameras have this one (px).
DSEC_SIZE = (640, 480)


class DsecReader(EventReader):
    """Reads HDF5 in the layout of DSEC (`io.events.dsec_hdf5`).

    Args:
        path: the file.
        size_px: width and height of the picture; by default as the file says, else that of DSEC. Where events
            lie outside of the latter, the file is refused: it is none of DSEC's.

    Raises:
        DataError: as `EventFile`, or a size that is smaller than the file's.
    """

    format_name = "HDF5 (DSEC)"

    def __init__(self, path: Path, size_px: tuple[int, int] | None) -> None:
        file = EventFile(path)
        try:
            size = agreed_size(size_px, file.size_px, path)
        except DataError:
            file.close()
            raise
        super().__init__(path, size or DSEC_SIZE)
        self._events = file
        self._assumed = size is None
        self.t_offset_us = file.t_offset_us

    def close(self) -> None:
        """Close the file."""
        self._events.close()

    def pieces(self) -> Iterator[EventArray]:
        """Yield all events in the order of their times, at most `PIECE_ROWS` at a time.

        Raises:
            DataError: times run backwards, or the data are damaged.
        """
        assert self.size_px is not None
        width, height = self.size_px
        for piece in self._events.pieces(PIECE_ROWS, self.labels):
            inside = (piece.x < width) & (piece.y < height)
            if self._assumed:
                check_assumed(piece, self.path)
            self.damage.outside += int((~inside).sum())
            self.damage.events += int(inside.sum())
            yield piece if inside.all() else piece.take(inside)


def check_assumed(events: EventArray, path: Path) -> None:
    """Check that events lie in the picture of DSEC, which was assumed as the file does not say its own.

    Raises:
        DataError: one of them does not.
    """
    width, height = DSEC_SIZE
    if len(events) and (int(events.x.max()) >= width or int(events.y.max()) >= height):
        raise DataError(
            f"does not say the size of its picture, and its events reach x = {events.x.max()}, y = "
            f"{events.y.max()}, beyond the {width} x {height} px of DSEC; give it with --event-size WxH",
            path,
        )
