"""The clock of stamped messages beside that of the camera whose events they hold, as bags have both.

A driver stamps each message by the clock of its machine, and the events in it have the camera's own. These
two part: the camera's runs a little faster or slower, and stamps come late by what the machine was busy.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.ros_messages import Decoded

_US_PER_S = 1_000_000
#: Events this far from their message's stamp have another clock than it (µs).
OTHER_CLOCK_US = 10 * _US_PER_S
# So many pieces are held back where stamps do not go on.
_MOST_HELD = 64


class Dated(NamedTuple):
    """What a message holds, piece by piece.

    Attributes:
        topic: of the message.
        stamp_us: of the first piece, the message's stamp on the clock of the bag (µs); None of others.
        decoded: events and edges.
    """

    topic: str
    stamp_us: int | None
    decoded: Decoded


class Stamps(NamedTuple):
    """What a recording's two clocks say.

    Attributes:
        first_us: stamp of the first message (µs).
        last_us: of the last.
        own_first_us: time of the first message's first event by the camera's clock (µs).
        own_last_us: of the last's.
        apart_us: by how much the clocks part after the first message at most (µs).
    """

    first_us: int
    last_us: int
    own_first_us: int
    own_last_us: int
    apart_us: int

    @property
    def differ(self) -> bool:
        """Whether the camera has a clock of its own."""
        return abs(self.first_us - self.own_first_us) > OTHER_CLOCK_US

    def and_then(self, stamp_us: int, own_us: int) -> Stamps:
        """Return what it is with a further message."""
        apart = abs((stamp_us - self.first_us) - (own_us - self.own_first_us))
        return Stamps(self.first_us, stamp_us, self.own_first_us, own_us, max(self.apart_us, apart))

    def line(self) -> str:
        """Return it in a line."""
        first, last, own_first, own_last = (value / _US_PER_S for value in self[:4])
        text = f"stamps of messages: {first:.6f} to {last:.6f} s; first events of these: "
        if not self.differ:
            return f"{text}the same clock, {own_first:.6f} to {own_last:.6f} s"
        return (
            f"{text}{own_first:.6f} to {own_last:.6f} s by the camera's own clock; counted from the first "
            f"one they part by up to {self.apart_us / _US_PER_S:.6f} s (--event-clock header goes by the "
            "stamps)"
        )


def by_stamps(dated: Iterator[Dated], topic: str) -> Iterator[Dated]:
    """Bring the events of messages to the clock of their stamps, where they have another one.

    The first event of each message has its stamp, and those between two messages lie between their stamps as
    they do by the camera's clock; behind the last, the camera's clock leads on. Edges of other topics lie
    among the events as by the camera's clock. A stamp that is not after the one before is passed over.

    Args:
        dated: messages in their order; one is held back.
        topic: that of the events.
    """
    held: list[Dated] = []
    begin: tuple[int, int] | None = (
        None  # stamp of the message that is held back, and time of its first event
    )
    for one in dated:
        own = one.decoded.first_us
        if one.topic == topic and one.stamp_us is not None and own is not None:
            if begin is None:
                begin = one.stamp_us, own
            elif one.stamp_us > begin[0] and own > begin[1]:
                yield from _moved(held, begin, one.stamp_us - begin[0], own - begin[1])
                held, begin = [], (one.stamp_us, own)
            elif len(held) >= _MOST_HELD:
                yield from _moved(held, begin, 1, 1)
                held, begin = [], (one.stamp_us, own)
        held.append(one)
    yield from _moved(held, begin or (0, 0), 1, 1)


def _moved(held: list[Dated], begin: tuple[int, int], length: int, own_length: int) -> Iterator[Dated]:
    stamp, own = begin
    if abs(stamp - own) <= OTHER_CLOCK_US:
        yield from held
        return

    def on_stamps(t_us: IntArray) -> IntArray:
        return stamp + (t_us - own) * length // own_length

    for one in held:
        d = one.decoded
        edges = d.triggers._replace(t_us=on_stamps(d.triggers.t_us))
        yield one._replace(decoded=d._replace(t_us=on_stamps(d.t_us), triggers=edges))
