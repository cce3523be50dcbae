"""NATS JetStream: a pull consumer that takes up where it was, and publishing with acknowledgements."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections import deque
from collections.abc import Coroutine
from concurrent.futures import wait
from typing import Any, TypeVar

import nats
from nats.errors import Error as NatsError
from nats.js.api import AckPolicy, ConsumerConfig, DeliverPolicy
from nats.js.errors import NotFoundError

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.address import Address
from jeat_graph.live.transport.patience import SLICE_S, Overdue, UnconfirmedError, check, never

MOST_OPEN = 256
#: A message that is not acknowledged in this time comes again (s); nothing is left open for as long.
_ACK_WAIT_S = 600.0
_CONNECT_S, _CALL_S = 10, 10.0
_T = TypeVar("_T")


class _Connection:
    """A connection kept up by an event loop in a thread of its own, since the client is asynchronous."""

    def __init__(self, address: Address, overdue: Overdue) -> None:
        self.address, self.overdue = address, overdue
        self.reconnects = 0
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        try:
            self.client = self.call(self._open(), _CONNECT_S + _CALL_S)
            self.stream = self._stream()
        except (NatsError, OSError, TimeoutError) as error:
            self.stop()
            raise JeatGraphError(f"{address}: {error or 'the server does not answer'}") from None

    async def _open(self) -> Any:
        async def reconnected() -> None:
            self.reconnects += 1

        async def silent(_: Exception) -> None:
            return

        # The first connection must succeed at once; one that was lost is mended for as long as it takes.
        await asyncio.wait_for(self._probe(), _CONNECT_S)
        return await nats.connect(
            f"nats://{self.address.host}:{self.address.port}",
            user=self.address.user,
            password=self.address.password,
            connect_timeout=_CONNECT_S,
            max_reconnect_attempts=-1,
            reconnect_time_wait=0.5,
            allow_reconnect=True,
            reconnected_cb=reconnected,
            error_cb=silent,
        )

    async def _probe(self) -> None:
        _, writer = await asyncio.open_connection(self.address.host, self.address.port)
        writer.close()

    def _stream(self) -> str:
        """Name of the stream that holds the topic; made if there is none."""
        self.jet = self.client.jetstream()
        wanted = self.address.options.get("stream")
        if wanted is not None:
            return wanted
        try:
            return str(self.call(self.jet.find_stream_name_by_subject(self.address.topic)))
        except NotFoundError:
            name = "".join(c if c.isalnum() else "-" for c in self.address.topic)
            self.call(self.jet.add_stream(name=name, subjects=[self.address.topic]))
            return name

    def call(self, work: Coroutine[Any, Any, _T], timeout_s: float = _CALL_S) -> _T:
        """Run a coroutine in the loop and wait for it.

        Raises:
            TimeoutError: it takes too long, or the program is to end.
        """
        future = asyncio.run_coroutine_threadsafe(work, self._loop)
        end = time.monotonic() + timeout_s
        while not wait([future], SLICE_S).done:
            if time.monotonic() > end or self.overdue():
                future.cancel()
                raise TimeoutError
        return future.result()

    def start(self, work: Coroutine[Any, Any, _T]) -> Any:
        """Begin a coroutine in the loop and return its future."""
        return asyncio.run_coroutine_threadsafe(work, self._loop)

    def close(self) -> None:
        """Leave; a server that is gone is not waited for."""
        with contextlib.suppress(NatsError, OSError):
            self.call(self.client.close())
        self.stop()

    def stop(self) -> None:
        def end() -> None:
            # What still waits for a server that is gone would complain of being left behind.
            for task in asyncio.all_tasks(self._loop):
                task.cancel()
            self._loop.call_soon(self._loop.stop)

        self._loop.call_soon_threadsafe(end)
        self._thread.join()


class NatsSource:
    """Messages of a subject from its JetStream stream, in the stream's order (see `ends.Source`).

    The consumer is called `durable` (option; default `jeat-graph`). After a crash, and after a lost
    connection, it is made anew where it was, so that what is delivered again comes in its order and not
    mixed with what is new.

    Args:
        address: options `stream`, `durable`, `most` (messages open at a time).
        overdue: tells when the program is to end.

    Raises:
        JeatGraphError: nobody answers, or the server has no JetStream.
    """

    def __init__(self, address: Address, overdue: Overdue = never) -> None:
        self.most_open = address.number("most", MOST_OPEN, low=1)
        self._durable = address.option("durable", "jeat-graph")
        self._last = 0  # number in the stream of the last message received
        self._open: Any = None
        self._waiting: deque[Any] = deque()
        self._connection = _Connection(address, overdue)
        self._reconnects = 0
        try:
            self._subscribe(self._committed())
        except (NatsError, TimeoutError) as error:
            self._connection.stop()
            raise JeatGraphError(f"{address}: {error or 'no JetStream here?'}") from None

    def _committed(self) -> int:
        """Number in the stream of the last message that was committed, 0 if none was."""
        link = self._connection
        with contextlib.suppress(NotFoundError):
            known = link.call(link.jet.consumer_info(link.stream, self._durable))
            return int(known.ack_floor.stream_seq) if known.ack_floor is not None else 0
        return 0

    def _subscribe(self, after: int) -> None:
        link = self._connection
        with contextlib.suppress(NotFoundError):
            link.call(link.jet.delete_consumer(link.stream, self._durable))
        settings = ConsumerConfig(
            durable_name=self._durable,
            ack_policy=AckPolicy.ALL,
            ack_wait=_ACK_WAIT_S,
            max_ack_pending=self.most_open,
            deliver_policy=DeliverPolicy.BY_START_SEQUENCE,
            opt_start_seq=after + 1,
            filter_subject=link.address.topic,
        )
        link.call(link.jet.add_consumer(link.stream, settings))
        self._pull = link.call(link.jet.pull_subscribe(link.address.topic, self._durable, stream=link.stream))
        self._waiting.clear()

    def receive(self, timeout_s: float) -> bytes | None:
        """Wait for the next message."""
        link = self._connection
        try:
            if self._reconnects != link.reconnects:
                reconnects = link.reconnects
                self._subscribe(self._last)
                self._open, self._reconnects = None, reconnects
            if not self._waiting:
                self._waiting.extend(
                    link.call(self._pull.fetch(self.most_open, timeout=timeout_s), timeout_s + _CALL_S)
                )
        except (NatsError, TimeoutError):
            return None
        if not self._waiting:
            return None
        message = self._waiting.popleft()
        self._last, self._open = message.metadata.sequence.stream, message
        return bytes(message.data)

    def commit(self) -> None:
        """Acknowledge the last message, and with it all before."""
        if self._open is not None:
            with contextlib.suppress(NatsError, TimeoutError):
                self._connection.call(self._open.ack_sync())
            self._open = None

    def close(self) -> None:
        """Leave; the server keeps the consumer."""
        self._connection.close()


class NatsSink:
    """Publishes to a subject that a JetStream stream keeps (see `ends.Sink`).

    Args:
        address: options `stream`, `most` (messages on their way at a time).
        overdue: tells when the program is to end.

    Raises:
        JeatGraphError: nobody answers, or the server has no JetStream.
    """

    def __init__(self, address: Address, overdue: Overdue = never) -> None:
        self._most = address.number("most", MOST_OPEN, low=1)
        self._connection = _Connection(address, overdue)
        self._open: deque[tuple[bytes, Any]] = deque()
        self._reconnects = 0

    def send(self, message: bytes) -> None:
        """Publish; waits while too many are on their way, and after a lost connection until none is."""
        link = self._connection
        if self._reconnects != link.reconnects or not link.client.is_connected:
            # What was on its way may be lost and has to be sent again, before what comes after it.
            self._wait(0)
            self._reconnects = link.reconnects
        self._wait(self._most - 1)
        self._open.append((message, self._publish(message)))

    def _publish(self, message: bytes) -> Any:
        link = self._connection
        return link.start(link.jet.publish(link.address.topic, message, timeout=_CALL_S, stream=link.stream))

    def flush(self) -> None:
        """Wait until all are acknowledged."""
        self._wait(0)

    def _wait(self, most: int) -> None:
        """Wait for the oldest until so many are open; what the server did not confirm is sent again."""
        link = self._connection
        while len(self._open) > most:
            message, future = self._open[0]
            if not wait([future], SLICE_S).done:
                check(link.overdue, link.address)
                continue
            try:
                future.result()
                self._open.popleft()
            except (NatsError, TimeoutError):
                if link.client.is_closed:
                    raise JeatGraphError(f"{link.address}: the server refuses") from None
                check(link.overdue, link.address)
                self._open[0] = (message, self._publish(message))

    def close(self) -> None:
        """Flush and leave."""
        with contextlib.suppress(UnconfirmedError):
            self._wait(0)
        for _, future in self._open:
            future.cancel()
        self._connection.close()
