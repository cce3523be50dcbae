"""A broker of MQTT 5 that greets, takes subscriptions and ends connections without saying why."""

from __future__ import annotations

import contextlib
import socket
import threading
from typing import Self

CONNECT, PUBLISH, SUBSCRIBE = 1, 3, 8
#: No flags, success, no properties.
CONNACK = bytes([0x20, 3, 0, 0, 0])

#: The end of a session, since another client of its name came.
TAKEN_OVER = bytes([0xE0, 2, 0x8E, 0])


class FakeBroker:
    """Answers each client by itself.

    Args:
        ends_after_subscription: end a connection as soon as the topic is subscribed.
        takes_over: end the older of two connections of one name, and give the reason.
        ends_above: end a connection that brings a packet larger than this (bytes).

    Attributes:
        port: where it listens.
        connections: clients that it greeted.
    """

    def __init__(
        self,
        ends_after_subscription: bool = False,
        takes_over: bool = False,
        ends_above: int | None = None,
    ) -> None:
        self.connections = 0
        self._takes_over, self._last = takes_over, None
        self._ends_after_subscription, self._ends_above = ends_after_subscription, ends_above
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]

    def __enter__(self) -> Self:
        threading.Thread(target=self._listen, daemon=True).start()
        return self

    def __exit__(self, *error: object) -> None:
        self._listener.close()

    def _listen(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        with contextlib.suppress(OSError, EOFError), connection, connection.makefile("rb") as stream:
            while True:
                kind, body = _packet(stream)
                if kind == CONNECT:
                    self.connections += 1
                    if self._takes_over and self._last is not None:
                        self._last.sendall(TAKEN_OVER)
                        self._last.shutdown(socket.SHUT_RDWR)
                    self._last = connection
                    connection.sendall(CONNACK)
                elif kind == SUBSCRIBE:
                    connection.sendall(bytes([0x90, 4]) + body[:2] + bytes([0, 1]))
                    if self._ends_after_subscription:
                        return
                elif kind == PUBLISH:
                    if self._ends_above is not None and len(body) > self._ends_above:
                        return
                    topic = int.from_bytes(body[:2], "big")
                    connection.sendall(bytes([0x40, 2]) + body[2 + topic : 4 + topic])


def _packet(stream) -> tuple[int, bytes]:
    """Kind and body of the next packet."""
    first = stream.read(1)
    if not first:
        raise EOFError
    length = shift = 0
    while True:
        digit = stream.read(1)[0]
        length |= (digit & 0x7F) << shift
        shift += 7
        if digit < 0x80:
            break
    return first[0] >> 4, stream.read(length)
