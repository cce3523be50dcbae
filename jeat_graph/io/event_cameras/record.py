"""What a kind of event camera is: one record, in the one file that knows its addresses and its library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from jeat_graph.io.files.addresses import LiveAddress


class EventDevice(Protocol):
    """An open camera.

    Attributes:
        size_px: width and height of its picture.
    """

    size_px: tuple[int, int]

    def read(self) -> Any:
        """Wait, half a second at most, for the next piece.

        Returns:
            (N,) rows with the columns that the record names; None if nothing has come.

        Raises:
            LostError: no more will come by this connection.
        """

    def close(self) -> None:
        """Let go of the camera."""


@dataclass(frozen=True)
class EventCameraKind:
    """A kind of event camera.

    Attributes:
        scheme: of its addresses; `SCHEME:NAME` is a camera of this machine.
        forms: its addresses, for help and messages.
        maker: who makes it, for the list of all.
        time: name of the column of times (µs, of the camera's clock), beside `x` and `y`.
        polarity: name of that of polarities.
        port: of `SCHEME://HOST`, where none is given; 0 where the camera has no network address.
        open: opens it; raises `LostError` if it does not answer, `ConfigError` if its library is missing.
    """

    scheme: str
    forms: tuple[str, ...]
    maker: str
    time: str
    polarity: str
    port: int
    open: Callable[[LiveAddress], EventDevice]


def first_words(error: Exception) -> str:
    """Return what a library's error says, without the places in its sources."""
    return (str(error).splitlines() or [""])[0].partition(" [")[0]
