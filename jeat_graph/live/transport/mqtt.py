"""MQTT 5 by way of paho: quality of service 1, a session that the broker keeps, acknowledged by hand."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections import deque
from typing import Any, NamedTuple

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.address import Address
from jeat_graph.live.transport.brokers.record import Sink, Source
from jeat_graph.live.transport.brokers.registry import brokers
from jeat_graph.live.transport.mqtt_link import PACKET_MOST, MqttLink
from jeat_graph.live.transport.names import distinct_name
from jeat_graph.live.transport.notices import MOST_WARNED, Notices
from jeat_graph.live.transport.patience import SLICE_S, Overdue, UnconfirmedError, check, never

#: How long the broker keeps a session without a client (s): a day, for a machine that has to be mended.
SESSION_S = 86_400
#: Messages that may be open: Mosquitto sends so many to a client of MQTT 5 that asks for them.
MOST_OPEN = 1000
#: Answers that may be on their way: Mosquitto by itself takes no more than 20.
_MOST_SENT = 20
#: The number that is asked for has two bytes (`ReceiveMaximum`).
_MOST_ASKED = 65_535
_CONNECT_S = 10.0
_QOS = 1
#: Beside topic and payload a message has kind, length, length of topic, number, no properties (bytes).
_HEAD_BYTES = 1 + 4 + 2 + 2 + 1
#: The reason of MQTT 5 for refusing a message by its size.
_TOO_LARGE = 0x95


class _Message(NamedTuple):
    """What has come: its number and quality of service, topic and payload."""

    mid: int
    qos: int
    topic: str
    payload: bytes


class MqttSource(Source):
    """Subscription of a topic, wild cards allowed (see `record.Source`).

    The broker keeps the session of `client` (option; default from the topic) for a day, and with it what
    was published meanwhile, as much as its own `max_queued_messages` allows. It keeps what that client once
    subscribed to as well: messages of other topics are acknowledged, passed over and reported.

    Args:
        address: options `client`, `most` (messages open at a time).
        overdue: tells when the program is to end.
        notices: takes what the user is to know.

    Raises:
        JeatGraphError: nobody answers, or the broker refuses.
    """

    def __init__(self, address: Address, overdue: Overdue = never, notices: Notices | None = None) -> None:
        self.address, self._overdue = address, overdue
        self._notices = notices or Notices()
        self.most_open = address.number("most", MOST_OPEN, low=1, high=_MOST_ASKED)
        self._waiting: queue.Queue[tuple[int, _Message]] = queue.Queue()
        self._open: list[tuple[int, int]] = []
        self._settled = threading.Event()
        self._session = 0  # the connection that a message came by: others' message numbers mean nothing
        self._foreign: set[str] = set()  # topics of an old subscription
        self._refused = ""
        name = address.option("client", distinct_name(address.topic))
        self._link = link = MqttLink(address, name, manual_ack=True, notices=self._notices)
        self._client = link.client
        self._client.on_message = self._on_message
        self._client.on_subscribe = self._on_subscribe
        link.on_connected, link.on_lost = self._subscribe, self._on_lost
        link.properties.SessionExpiryInterval = SESSION_S
        link.properties.ReceiveMaximum = self.most_open
        link.open(_CONNECT_S)
        # Until the broker has answered, it gives what is published to nobody.
        if not self._settled.wait(_CONNECT_S) or self._refused:
            self._client.disconnect()
            self._client.loop_stop()
            raise JeatGraphError(
                f"{address}: {self._refused or 'the broker does not answer the subscription'}"
            )

    def _subscribe(self) -> None:
        self._client.subscribe(self.address.topic, _QOS)

    def _on_subscribe(self, client: Any, data: Any, number: int, reasons: Any, properties: Any) -> None:
        self._refused = next((str(reason) for reason in reasons if reason.is_failure), "")
        self._settled.set()

    def _on_lost(self) -> None:
        self._session += 1

    def _on_message(self, client: Any, data: Any, message: Any) -> None:
        # Without its properties, which take many times as much memory as what it says.
        self._waiting.put((self._session, _Message(message.mid, message.qos, message.topic, message.payload)))

    def _pass_over(self, message: _Message) -> None:
        """Take a message of an old subscription as done, and its topic from the session."""
        # Some brokers change the order of the others when one is acknowledged before those that came first.
        if message.qos and not self._open:
            self._client.ack(message.mid, message.qos)
        elif message.qos:
            self._open.append((self._session, message.mid))
        if message.topic not in self._foreign and len(self._foreign) < MOST_WARNED:
            self._foreign.add(message.topic)
            self._client.unsubscribe(message.topic)  # helps unless the subscription had wild cards
            self._notices.add(
                f"warning: {self.address}: this client once subscribed to {message.topic!r}, too; its "
                "messages are passed over (another ?client=NAME begins without)"
            )

    def receive(self, timeout_s: float) -> bytes | None:
        """Wait for the next message.

        Raises:
            JeatGraphError: another client has taken this one's place, or the subscription is refused.
        """
        end = time.monotonic() + timeout_s
        while True:
            self._notices.tell()
            self._link.check()
            if self._refused:
                raise JeatGraphError(f"{self.address}: the broker refuses the topic: {self._refused}")
            try:
                session, message = self._waiting.get(timeout=max(end - time.monotonic(), 0.0))
            except queue.Empty:
                return None
            if session != self._session:
                continue  # the broker sends it again by the new connection
            if not brokers()[self.address.scheme].covers(self.address.topic, message.topic):
                self._pass_over(message)
                continue
            if message.qos:
                self._open.append((session, message.mid))
            return bytes(message.payload)

    def commit(self) -> None:
        """Acknowledge all that was received by this connection; what came by one before comes again."""
        for session, number in self._open:
            if session == self._session:
                self._client.ack(number, _QOS)
        self._open = []

    def close(self) -> None:
        """Leave; the broker keeps the session."""
        # Closing a connection may lose what is still on its way. An answer says that all before has arrived.
        self._settled.clear()
        self._subscribe()
        end = time.monotonic() + _CONNECT_S
        while self._client.is_connected() and time.monotonic() < end and not self._overdue():
            if self._settled.wait(SLICE_S):
                break
        self._link.leave()
        self._notices.tell()


class MqttSink(Sink):
    """Publishes to a topic; sent again after a lost connection (see `record.Sink`).

    Args:
        address: options `client`, `most` (messages on their way at a time), `largest` (bytes of a message,
            where the broker does not say what it takes).
        overdue: tells when the program is to end.
        notices: takes what the user is to know.

    Raises:
        JeatGraphError: nobody answers, or the broker refuses.
    """

    def __init__(self, address: Address, overdue: Overdue = never, notices: Notices | None = None) -> None:
        self.address, self._overdue = address, overdue
        self._notices = notices or Notices()
        self._most = address.number("most", _MOST_SENT, low=1)
        self._head = _HEAD_BYTES + len(address.topic.encode())
        self._sent = self._confirmed = 0
        self._change = threading.Condition()
        self._sizes: dict[int, int] = {}  # of what is on its way, by its number
        self._answers: deque[tuple[int, Any]] = deque()  # numbers and the broker's reasons, not looked at yet
        self._lost = False  # since the connection was lost nothing has been confirmed
        self._largest = address.number("largest", PACKET_MOST, low=1, high=PACKET_MOST)
        self._name = address.option("client", "")
        self._link = MqttLink(address, self._name, manual_ack=False, notices=self._notices)
        self._link.on_lost = self._on_lost
        self._link.suspicion = self._suspicion
        self._client = self._link.client
        self._client.on_publish = self._on_publish
        self._link.open(_CONNECT_S)

    @property
    def too_large(self) -> int:
        """Messages that were not sent because of their size."""
        return self._notices.too_large

    def _on_publish(self, client: Any, data: Any, number: int, reason: Any, properties: Any) -> None:
        with self._change:
            self._confirmed += 1
            self._lost = False
            self._answers.append((number, reason))
            self._change.notify_all()

    def _on_lost(self) -> None:
        with self._change:
            self._lost = True
            self._change.notify_all()

    def _suspicion(self) -> str:
        size = max(list(self._sizes.values()), default=0)
        other = f"another client is called {self._name!r}, too; or " if self._name else ""
        return (
            f"{other}it takes no answer of {size} bytes, which was sent again each time; raise its bound "
            "or name it (?largest=BYTES) to have larger ones left out"
        )

    def send(self, message: bytes) -> None:
        """Publish; waits while too many are on their way, or while those before a lost connection are."""
        # The client sends what was not confirmed again only once the broker has greeted it, and what is new
        # as soon as there is a connection: what is new would come first.
        self._wait(self._most - 1, in_order=True)
        most = min(self._link.packet_most - self._head, self._largest)
        if len(message) > most:
            self._notices.larger(self.address, len(message), most)
        else:
            self._sizes[self._client.publish(self.address.topic, message, _QOS).mid] = len(message)
            self._sent += 1
        self._notices.tell()

    def flush(self) -> None:
        """Wait until all are acknowledged."""
        self._wait(0)
        self._notices.tell()

    def _wait(self, most: int, in_order: bool = False) -> None:
        def enough() -> bool:
            return self._sent - self._confirmed <= (0 if in_order and self._lost else most)

        done = False
        while not done:
            with self._change:
                done = self._change.wait_for(lambda: enough() or bool(self._link.trouble), SLICE_S)
            self._check_answers()
            self._notices.tell()
            self._link.check()
            if not done:
                check(self._overdue, self.address)

    def _check_answers(self) -> None:
        """Go through what the broker said of messages since the last time."""
        while self._answers:
            number, reason = self._answers.popleft()
            size = self._sizes.pop(number, 0)
            if reason.value == _TOO_LARGE:
                self._notices.larger(self.address, size, None)
            elif reason.is_failure:
                raise JeatGraphError(f"{self.address}: the broker refused tracks: {reason}")

    def close(self) -> None:
        """Flush and leave."""
        try:
            with contextlib.suppress(UnconfirmedError):
                self._wait(0)
        finally:
            self._link.leave()
