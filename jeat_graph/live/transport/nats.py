"""NATS JetStream: a pull consumer that takes up where it was, and publishing with acknowledgements."""

from __future__ import annotations

import contextlib
import secrets
import time
from collections import deque
from concurrent.futures import Future, wait
from typing import Any

from nats.errors import Error as NatsError
from nats.errors import MaxPayloadError
from nats.js.api import AckPolicy, ConsumerConfig, DeliverPolicy, Header
from nats.js.errors import APIError, NoStreamResponseError, NotFoundError

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.address import Address
from jeat_graph.live.transport.brokers.record import Sink, Source
from jeat_graph.live.transport.names import distinct_name
from jeat_graph.live.transport.nats_link import CALL_S, NatsLink, why
from jeat_graph.live.transport.nats_presence import Presence
from jeat_graph.live.transport.notices import Notices
from jeat_graph.live.transport.patience import SLICE_S, Overdue, UnconfirmedError, check, never

MOST_OPEN = 256
#: What tells sinks apart within the minutes that a server remembers (bytes); it counts with each message.
_RUN_BYTES = 4
#: A number of a message as long as any will be.
NUMBER_MOST = 10**15
#: A message that is not acknowledged in this time comes again (s); nothing is left open for as long.
_ACK_WAIT_S = 600.0
_CONNECT_S = 10.0
#: Bounds of the pause before something is sent again that the server did not take (s).
_BACK_OFF_S = (0.1, 10.0)
#: JetStream's number for a message that is larger than the stream takes; and kinds of errors as in HTTP.
_STREAM_TOO_LARGE, _ASKED_WRONGLY = 10054, range(400, 500)


class NatsSource(Source):
    """Messages of a subject from its JetStream stream, in the stream's order (see `record.Source`).

    The consumer is called `durable` (option; the default is made of stream and subject, so that streams of
    other subjects have others). After a crash, and after a lost connection, it is made again where it was,
    so that what is delivered again comes in its order and not mixed with what is new. One that reads another
    subject, that was made by another program or that another stream is using is left alone.

    Args:
        address: options `stream`, `durable`, `most` (messages open at a time).
        overdue: tells when the program is to end.
        notices: takes what the user is to know.

    Raises:
        JeatGraphError: nobody answers, the server has no JetStream, or the consumer is another's.
    """

    def __init__(self, address: Address, overdue: Overdue = never, notices: Notices | None = None) -> None:
        self.address = address
        self._notices = notices or Notices()
        self.most_open = address.number("most", MOST_OPEN, low=1)
        self._last = 0  # number in the stream of the last message received
        self._open: Any = None
        self._waiting: deque[Any] = deque()
        self._link = link = NatsLink(address, overdue, self._notices, _CONNECT_S)
        self._durable = address.option("durable", distinct_name(link.stream, address.topic))
        self._reconnects = 0
        try:
            self._presence = Presence(link, self._durable)
            self._presence.claim()
            self._subscribe(self._committed())
        except (NatsError, TimeoutError, ValueError) as error:
            link.stop()
            raise JeatGraphError(f"{address}: {why(error) or 'no JetStream here?'}") from None
        except JeatGraphError:
            link.close()
            raise

    def _committed(self) -> int:
        """Number in the stream of the last message that was committed, 0 if none was.

        Raises:
            JeatGraphError: the consumer is another program's.
        """
        link = self._link
        with contextlib.suppress(NotFoundError):
            known = link.call(link.jet.consumer_info(link.stream, self._durable))
            subject = known.config.filter_subject
            if subject != self.address.topic:
                self._refuse(
                    f"reads {subject or known.config.filter_subjects or 'all'!r} of stream {link.stream!r}"
                )
            if known.config.ack_policy != AckPolicy.ALL or known.config.deliver_subject:
                self._refuse(f"of stream {link.stream!r} was made by another program")
            if self._presence.pulled(known):
                self._refuse(f"of stream {link.stream!r} is in use")
            return int(known.ack_floor.stream_seq) if known.ack_floor is not None else 0
        return 0

    def _refuse(self, what: str) -> None:
        raise JeatGraphError(
            f"{self.address}: the consumer {self._durable!r} {what}; give this one a name of its own "
            "(?durable=NAME)"
        )

    def _subscribe(self, after: int) -> None:
        link = self._link
        with contextlib.suppress(NotFoundError):
            link.call(link.jet.delete_consumer(link.stream, self._durable))
        settings = ConsumerConfig(
            durable_name=self._durable,
            ack_policy=AckPolicy.ALL,
            ack_wait=_ACK_WAIT_S,
            max_ack_pending=self.most_open,
            deliver_policy=DeliverPolicy.BY_START_SEQUENCE,
            opt_start_seq=after + 1,
            filter_subject=self.address.topic,
        )
        made = link.call(link.jet.add_consumer(link.stream, settings))
        self._presence.made(made.created)
        self._pull = link.call(link.jet.pull_subscribe(self.address.topic, self._durable, stream=link.stream))
        self._waiting.clear()

    def receive(self, timeout_s: float) -> bytes | None:
        """Wait for the next message.

        Raises:
            JeatGraphError: another stream took the consumer while the connection was lost.
        """
        link = self._link
        self._notices.tell()
        try:
            if self._reconnects != link.reconnects:
                reconnects = link.reconnects
                self._presence.claim()
                self._subscribe(self._last)
                self._open, self._reconnects = None, reconnects
            if not self._waiting:
                self._waiting.extend(
                    link.call(self._pull.fetch(self.most_open, timeout=timeout_s), timeout_s + CALL_S)
                )
        except TimeoutError:
            pass
        except NatsError:
            self._lost(timeout_s)
        with contextlib.suppress(NatsError, TimeoutError):
            self._presence.check()
        if not self._waiting:
            return None
        message = self._waiting.popleft()
        self._last, self._open = message.metadata.sequence.stream, message
        return bytes(message.data)

    def _lost(self, timeout_s: float) -> None:
        """Make the consumer again, which somebody deleted; not at once, since the server may just start."""
        link = self._link
        end = time.monotonic() + timeout_s
        while time.monotonic() < end and not link.overdue():
            time.sleep(min(SLICE_S, timeout_s))
        if not link.client.is_connected:
            return  # it is mended by itself
        self._notices.once(
            f"warning: {self.address}: the consumer {self._durable!r} of stream {link.stream!r} is gone; "
            "it is made again"
        )
        with contextlib.suppress(NatsError, TimeoutError):
            self._subscribe(self._last)
            self._open = None
            self._notices.forget()

    def commit(self) -> None:
        """Acknowledge the last message, and with it all before."""
        if self._open is not None:
            with contextlib.suppress(NatsError, TimeoutError):
                self._link.call(self._open.ack_sync())
            self._open = None

    def close(self) -> None:
        """Leave; the server keeps the consumer."""
        self._link.close()


class NatsSink(Sink):
    """Publishes to a subject that a JetStream stream keeps (see `record.Sink`).

    Args:
        address: options `stream`, `most` (messages on their way at a time).
        overdue: tells when the program is to end.
        notices: takes what the user is to know.

    Raises:
        JeatGraphError: nobody answers, or the server has no JetStream.
    """

    def __init__(self, address: Address, overdue: Overdue = never, notices: Notices | None = None) -> None:
        self.address = address
        self._notices = notices or Notices()
        self._most = address.number("most", MOST_OPEN, low=1)
        self._link = NatsLink(address, overdue, self._notices, _CONNECT_S)
        self._open: deque[tuple[bytes, int, Any]] = deque()
        self._reconnects = 0
        self._pause_s = _BACK_OFF_S[0]
        # By these the server knows what is sent again after a lost connection, and keeps it once.
        self._run, self._number = secrets.token_hex(_RUN_BYTES), 0
        # The server counts what stands before a message, too.
        head = (
            f"NATS/1.0\r\n{Header.EXPECTED_STREAM.value}: {self._link.stream}\r\n"
            f"{Header.MSG_ID.value}: {self._run}-{NUMBER_MOST}\r\n\r\n"
        )
        self._head_bytes = len(head.encode())

    @property
    def too_large(self) -> int:
        """Messages that were not sent because of their size."""
        return self._notices.too_large

    def send(self, message: bytes) -> None:
        """Publish; waits while too many are on their way, and after a lost connection until none is."""
        link = self._link
        if self._reconnects != link.reconnects or not link.client.is_connected:
            # What was on its way may be lost and has to be sent again, before what comes after it.
            self._wait(0)
            self._reconnects = link.reconnects
        self._wait(self._most - 1)
        self._number += 1
        self._open.append((message, self._number, self._publish(message, self._number)))
        self._notices.tell()

    def _publish(self, message: bytes, number: int) -> Any:
        link = self._link
        if len(message) > self._payload_most():
            refused: Future[None] = Future()
            refused.set_exception(MaxPayloadError())
            return refused
        headers = {Header.MSG_ID.value: f"{self._run}-{number}"}
        return link.start(
            link.jet.publish(self.address.topic, message, timeout=CALL_S, stream=link.stream, headers=headers)
        )

    def _payload_most(self) -> int:
        """Largest message that the server takes (bytes); it may change with a connection."""
        return int(self._link.client.max_payload) - self._head_bytes

    def flush(self) -> None:
        """Wait until all are acknowledged."""
        self._wait(0)

    def _wait(self, most: int) -> None:
        """Wait for the oldest until so many are open; what the server did not confirm is sent again."""
        link = self._link
        while len(self._open) > most:
            if self._reconnects != link.reconnects and link.client.is_connected:
                self._send_again()
            message, number, future = self._open[0]
            self._notices.tell()
            if not wait([future], SLICE_S).done:
                check(link.overdue, self.address)
                continue
            try:
                future.result()
                self._open.popleft()
                self._pause_s = _BACK_OFF_S[0]
            except (NatsError, TimeoutError) as error:
                self._not_taken(len(message), error)
                if self._open and self._open[0][2] is future:
                    self._open[0] = (message, number, self._publish(message, number))
        self._notices.tell()

    def _send_again(self) -> None:
        """Send all that is on its way by the new connection; the server keeps what it has already once."""
        self._reconnects = self._link.reconnects
        for _, _, future in self._open:
            future.cancel()
        self._open = deque(
            (message, number, self._publish(message, number)) for message, number, _ in self._open
        )

    def _not_taken(self, size: int, error: Exception) -> None:
        """Deal with the oldest message, which the server did not take: drop it, wait a while, or end.

        Raises:
            JeatGraphError: the server will not take it another time either.
            UnconfirmedError: the program is to end.
        """
        link = self._link
        by_stream = isinstance(error, APIError) and error.err_code == _STREAM_TOO_LARGE
        if by_stream or isinstance(error, MaxPayloadError):
            self._notices.larger(self.address, size, None if by_stream else self._payload_most())
            self._open.popleft()
            return
        if link.client.is_closed:
            raise JeatGraphError(f"{self.address}: the server refuses")
        if link.forbidden and isinstance(error, TimeoutError):
            raise JeatGraphError(f"{self.address}: the server refuses tracks: {link.forbidden}")
        if isinstance(error, APIError):
            if error.code in _ASKED_WRONGLY:
                raise JeatGraphError(f"{self.address}: the server refuses tracks: {why(error)}")
            self._notices.once(f"warning: {self.address}: {why(error)}; the tracks are sent again")
        if isinstance(error, NoStreamResponseError):
            self._notices.once(
                f"warning: {self.address}: no stream keeps this subject now; the tracks are sent again"
            )
        self._back_off()

    def _back_off(self) -> None:
        """Wait before the next attempt, longer each time."""
        end = time.monotonic() + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, _BACK_OFF_S[1])
        self._notices.tell()
        while time.monotonic() < end:
            check(self._link.overdue, self.address)
            time.sleep(min(SLICE_S, max(end - time.monotonic(), 0.0)))
        check(self._link.overdue, self.address)

    def close(self) -> None:
        """Flush and leave."""
        try:
            with contextlib.suppress(UnconfirmedError):
                self._wait(0)
        finally:
            for _, _, future in self._open:
                future.cancel()
            self._link.close()
