"""Lines of a stream of text, in bounded memory whatever comes."""

from __future__ import annotations

from collections.abc import Callable

from jeat_graph.data.errors import DataError

#: Longest line (bytes): a scan of a hundred thousand boxes has room in it.
LONGEST_LINE = 2**25
_REST = 2**20  # read at a time of what is longer


def line_reader(readline: Callable[[int], bytes]) -> Callable[[], bytes]:
    """Return a function that reads the next line, in bounded memory whatever comes.

    Args:
        readline: reads to the end of the line, or so many bytes of it; nothing at the end.

    Returns:
        Of a line longer than `LONGEST_LINE` it returns the beginning, which `read_batches` finds too long.
    """

    def read() -> bytes:
        line = rest = readline(LONGEST_LINE + 1)
        if len(line) > LONGEST_LINE:
            while rest and not rest.endswith(b"\n"):
                rest = readline(_REST)
        return line

    return read


def decode_line(line: bytes, name: str, number: int) -> str:
    """Return a line of UTF-8 as text, without blanks around it and a mark of byte order before the first.

    Args:
        line: the line.
        name: name of its stream, for messages.
        number: its number there, from 1.

    Raises:
        DataError: it is not UTF-8, or longer than any line should be.
    """
    if len(line) > LONGEST_LINE:
        raise DataError(f"is a line of more than {LONGEST_LINE} bytes", name, number)
    try:
        return line.decode("utf-8-sig" if number == 1 else "utf-8").strip()
    except UnicodeDecodeError:
        raise DataError("is not UTF-8", name, number) from None
