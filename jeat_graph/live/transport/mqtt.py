"""MQTT 5 by way of paho: quality of service 1, a session that the broker keeps, acknowledged by hand."""

from __future__ import annotations

import contextlib
import queue
import socket
import threading
import time
from typing import Any

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.address import Address
from jeat_graph.live.transport.patience import SLICE_S, Overdue, UnconfirmedError, check, never

#: How long the broker keeps a session without a client (s): a day, for a machine that has to be mended.
SESSION_S = 86_400
#: Messages that may be on their way without an acknowledgement; Mosquitto by itself sends no more than 20.
MOST_OPEN = 20
_CONNECT_S = 10.0
_QOS = 1


#: paho declares no types for it.
_properties: Any = Properties


def _connect(address: Address, client: Any, properties: Any) -> None:
    """Connect, and keep the connection up from a thread of the client's own.

    Raises:
        JeatGraphError: nobody answers, or the broker refuses.
    """
    answered = threading.Event()
    refusal: list[str] = []
    inner = client.on_connect

    def on_connect(who: Any, data: Any, flags: Any, reason: Any, props: Any) -> None:
        if reason.is_failure:
            refusal.append(str(reason))
        elif inner is not None:
            inner(who, data, flags, reason, props)
        answered.set()

    client.on_connect = on_connect
    client.on_socket_open = _send_at_once
    client.reconnect_delay_set(1, 10)
    if address.user is not None:
        client.username_pw_set(address.user, address.password)
    try:
        client.connect(address.host, address.port, clean_start=False, properties=properties)
    except OSError as error:
        raise JeatGraphError(f"{address}: {error.strerror or error}") from None
    client.loop_start()
    if not answered.wait(_CONNECT_S) or refusal:
        client.loop_stop()
        raise JeatGraphError(f"{address}: {refusal[0] if refusal else 'the broker does not answer'}")


def _send_at_once(client: Any, data: Any, connection: Any) -> None:
    """Let no acknowledgement wait for the one before it to arrive (Nagle's algorithm)."""
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def _client(name: str, manual_ack: bool) -> Any:
    return paho.Client(
        CallbackAPIVersion.VERSION2, client_id=name, protocol=paho.MQTTv5, manual_ack=manual_ack
    )


def _leave(client: Any) -> None:
    """Take leave of a broker that is there; one that is not, the client's thread may go on waiting for."""
    there = client.is_connected()
    client.disconnect()
    if there:
        client.loop_stop()


class MqttSource:
    """Subscription of a topic, wild cards allowed (see `ends.Source`).

    The broker keeps the session of `client` (option; default from the topic) for a day, and with it what
    was published meanwhile, as much as its own `max_queued_messages` allows.

    Args:
        address: options `client`, `most` (messages open at a time).
        overdue: tells when the program is to end.

    Raises:
        JeatGraphError: nobody answers, or the broker refuses.
    """

    def __init__(self, address: Address, overdue: Overdue = never) -> None:
        self._overdue = overdue
        self.most_open = address.number("most", MOST_OPEN, low=1)
        self._topic = address.topic
        self._waiting: queue.Queue[tuple[int, Any]] = queue.Queue()
        self._open: list[tuple[int, int]] = []
        self._settled = threading.Event()
        self._session = 0  # the connection that a message came by: others' message numbers mean nothing
        name = address.option(
            "client", "jeat-graph-" + "".join(c if c.isalnum() else "-" for c in self._topic)
        )
        self._client = _client(name, manual_ack=True)
        self._client.on_connect = self._on_connect
        self._client.on_disconnect = self._on_disconnect
        self._client.on_message = self._on_message
        self._client.on_subscribe = self._on_subscribe
        self._refused = ""
        properties = _properties(PacketTypes.CONNECT)
        properties.SessionExpiryInterval = SESSION_S
        properties.ReceiveMaximum = self.most_open
        _connect(address, self._client, properties)
        # Until the broker has answered, it gives what is published to nobody.
        if not self._settled.wait(_CONNECT_S) or self._refused:
            self._client.disconnect()
            self._client.loop_stop()
            raise JeatGraphError(
                f"{address}: {self._refused or 'the broker does not answer the subscription'}"
            )

    def _on_connect(self, client: Any, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        client.subscribe(self._topic, _QOS)

    def _on_subscribe(self, client: Any, data: Any, number: int, reasons: Any, properties: Any) -> None:
        self._refused = next((str(reason) for reason in reasons if reason.is_failure), "")
        self._settled.set()

    def _on_disconnect(self, client: Any, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        self._session += 1

    def _on_message(self, client: Any, data: Any, message: Any) -> None:
        self._waiting.put((self._session, message))

    def receive(self, timeout_s: float) -> bytes | None:
        """Wait for the next message."""
        end = time.monotonic() + timeout_s
        while True:
            try:
                session, message = self._waiting.get(timeout=max(end - time.monotonic(), 0.0))
            except queue.Empty:
                return None
            if session != self._session:
                continue  # the broker sends it again by the new connection
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
        self._client.subscribe(self._topic, _QOS)
        end = time.monotonic() + _CONNECT_S
        while self._client.is_connected() and time.monotonic() < end and not self._overdue():
            if self._settled.wait(SLICE_S):
                break
        _leave(self._client)


class MqttSink:
    """Publishes to a topic; sent again after a lost connection (see `ends.Sink`).

    Args:
        address: options `client`, `most` (messages on their way at a time).
        overdue: tells when the program is to end.

    Raises:
        JeatGraphError: nobody answers, or the broker refuses.
    """

    def __init__(self, address: Address, overdue: Overdue = never) -> None:
        self._topic = address.topic
        self._overdue = overdue
        self._most = address.number("most", MOST_OPEN, low=1)
        self._sent = self._confirmed = 0
        self._change = threading.Condition()
        self._refused = ""
        self._lost = False  # since the connection was lost nothing has been confirmed
        self._client = _client(address.option("client", ""), manual_ack=False)
        self._client.on_publish = self._on_publish
        self._client.on_disconnect = self._on_disconnect
        _connect(address, self._client, _properties(PacketTypes.CONNECT))

    def _on_publish(self, client: Any, data: Any, number: int, reason: Any, properties: Any) -> None:
        with self._change:
            self._confirmed += 1
            self._lost = False
            if reason.is_failure:
                self._refused = str(reason)
            self._change.notify_all()

    def _on_disconnect(self, client: Any, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        with self._change:
            self._lost = True

    def send(self, message: bytes) -> None:
        """Publish; waits while too many are on their way, or while those before a lost connection are."""
        # The client sends what was not confirmed again only once the broker has greeted it, and what is new
        # as soon as there is a connection: what is new would come first.
        self._wait(self._most - 1, in_order=True)
        self._client.publish(self._topic, message, _QOS)
        self._sent += 1

    def flush(self) -> None:
        """Wait until all are acknowledged."""
        self._wait(0)

    def _wait(self, most: int, in_order: bool = False) -> None:
        def enough() -> bool:
            return self._sent - self._confirmed <= (0 if in_order and self._lost else most)

        with self._change:
            while not self._change.wait_for(enough, SLICE_S):
                check(self._overdue, self._topic)
            if self._refused:
                raise JeatGraphError(f"{self._topic}: the broker refused tracks: {self._refused}")

    def close(self) -> None:
        """Flush and leave."""
        with contextlib.suppress(UnconfirmedError):
            self._wait(0)
        _leave(self._client)
