"""How much a packed file may unpack to: a file of a megabyte must not fill memory, or take minutes to refuse.

Tables of a recording shrink to a third or a tenth, seldom to a thirtieth. What shrinks to less than a
hundredth says the same again and again: by mistake, or to do harm.
"""

from __future__ import annotations

from pathlib import Path

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.limits import free_memory

#: Times its size that a packed file may unpack to; one of less than `LEAST_ROOM / MOST_TIMES` bytes to more.
MOST_TIMES = 100
#: What unpacks to no more than that does no harm (bytes).
LEAST_ROOM = 1 << 26
#: More than that is no table (bytes).
LARGEST_UNPACKED = 2**33
#: Share of the free memory that may be filled, for columns are made of it.
_SHARE = 0.3


def most_unpacked(packed: int) -> int:
    """Return the number of bytes that a file of so many packed bytes may unpack to."""
    free = free_memory()
    room = min(LARGEST_UNPACKED, max(MOST_TIMES * packed, LEAST_ROOM))
    return room if free is None else min(room, int(free * _SHARE))


def check_unpacked(size: int, packed: int, path: str | Path, what: str = "") -> None:
    """Refuse what would unpack to more than it may.

    Args:
        size: bytes that it says it unpacks to.
        packed: bytes that it has.
        path: the file.
        what: of an archive, the member, for the message.

    Raises:
        DataError: says how much that is.
    """
    most = most_unpacked(packed)
    if size > most:
        name = f"{what}: " if what else ""
        raise DataError(f"{name}unpacks to more than {most} bytes, from {packed}; no recording does", path)
