"""A connection to an MQTT 5 broker that paho keeps up, and what must end it: a second client of its name."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from typing import Any

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.address import Address
from jeat_graph.live.transport.notices import Notices

#: A connection that is lost within this time (s), so often one after another, is not mended once more.
QUICK_S, MOST_QUICK = 5.0, 5
#: Bounds of the time between two attempts to connect (s).
_AGAIN_S = (1, 10)
#: Reasons of MQTT 5 for an end: by the broker's own stop, since another came, since a packet was too large.
_SHUTS_DOWN, _TAKEN_OVER, _TOO_LARGE = 0x8B, 0x8E, 0x95
_REMEDY = "; give each stream a name of its own (?client=NAME)"
#: The specification's own bound of a packet (bytes).
PACKET_MOST = 268_435_455

#: paho declares no types for it.
_properties: Any = Properties


class MqttLink:
    """Connects, and keeps the connection up from a thread of paho's own.

    A broker has one client of a name at a time and throws out the older one. It then must not come back, or
    the two would throw each other out without end: the connection is given up, `trouble` says why.

    Args:
        address: the broker.
        name: of the client; empty lets the broker choose one.
        manual_ack: acknowledge what is received by hand.
        notices: takes what the user is to know.

    Attributes:
        client: paho's.
        properties: what is said when connecting.
        packet_most: the largest packet that the broker takes (bytes).
        trouble: why the connection was given up, or empty.
        on_connected: called when the broker has greeted.
        on_lost: called when the connection is lost, or given up.
        suspicion: says what may be the cause where connections are lost one after another.
    """

    def __init__(self, address: Address, name: str, manual_ack: bool, notices: Notices) -> None:
        self._address, self._name, self._notices = address, name, notices
        self.client: Any = paho.Client(
            CallbackAPIVersion.VERSION2, client_id=name, protocol=paho.MQTTv5, manual_ack=manual_ack
        )
        self.properties = _properties(PacketTypes.CONNECT)
        self.packet_most = PACKET_MOST
        self.trouble = ""
        self.on_connected: Callable[[], object] = lambda: None
        self.on_lost: Callable[[], object] = lambda: None
        self.suspicion: Callable[[], str] = lambda: f"another client is called {name!r}, too{_REMEDY}"
        self._answered = threading.Event()
        self._refusal = ""
        self._since: float | None = None  # when the broker greeted; None without a connection
        self._quick = 0
        self.client.on_connect = self._on_connect
        self.client.on_disconnect = self._on_disconnect
        self.client.on_pre_connect = self._on_pre_connect
        self.client.on_socket_open = _send_at_once
        self.client.reconnect_delay_set(*_AGAIN_S)
        if address.tls is not None:
            self.client.tls_set_context(address.tls.context())
        if address.user is not None:
            secret = address.password
            self.client.username_pw_set(address.user.reveal(), None if secret is None else secret.reveal())

    def open(self, patience_s: float) -> None:
        """Connect.

        Args:
            patience_s: longest wait for the broker (s).

        Raises:
            JeatGraphError: nobody answers, or the broker refuses.
        """
        try:
            host, port = self._address.host, self._address.port
            self.client.connect(host, port, clean_start=False, properties=self.properties)
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else None
            raise JeatGraphError(f"{self._address}: {why or error}") from None
        self.client.loop_start()
        if not self._answered.wait(patience_s) or self._refusal:
            self.client.loop_stop()
            raise JeatGraphError(f"{self._address}: {self._refusal or 'the broker does not answer'}")

    def check(self) -> None:
        """See that the connection is there or being mended.

        Raises:
            JeatGraphError: it was given up.
        """
        if self.trouble:
            raise JeatGraphError(f"{self._address}: {self.trouble}")

    def leave(self) -> None:
        """Take leave of a broker that is there; for one that is not the client's thread may go on waiting."""
        there = self.client.is_connected()
        self._since = None
        self.client.disconnect()
        if there:
            self.client.loop_stop()

    def _on_pre_connect(self, client: Any, data: Any) -> None:
        if self.trouble:
            raise OSError(self.trouble)  # the only way to keep paho's thread from it

    def _on_connect(self, client: Any, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        if reason.is_failure:
            if self._answered.is_set():  # it did greet before, so it may be set right
                self._notices.once(f"warning: {self._address}: the broker refuses: {reason}; trying again")
            self._refusal = str(reason)
        else:
            self._since = time.monotonic()
            self._notices.forget()
            self._notices.found(self._address)
            self.packet_most = getattr(properties, "MaximumPacketSize", PACKET_MOST)
            self.on_connected()
        self._answered.set()

    def _on_disconnect(self, client: Any, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        since, self._since = self._since, None
        if since is not None:
            self._notices.lost(self._address)
        if reason.value == _TAKEN_OVER:
            self.trouble = (
                f"another client is called {self._name!r}, too, and has taken this one's place{_REMEDY}"
            )
        elif reason.value == _TOO_LARGE:
            self.trouble = f"the broker refuses what is sent; most likely {self.suspicion()}"
        elif since is not None and reason.value != _SHUTS_DOWN:
            self._quick = self._quick + 1 if time.monotonic() - since < QUICK_S else 0
            if self._quick >= MOST_QUICK:
                self.trouble = (
                    f"the broker ended the connection {MOST_QUICK} times, each time within {QUICK_S:g} s; "
                    f"most likely {self.suspicion()}"
                )
        self.on_lost()


def _send_at_once(client: Any, data: Any, connection: Any) -> None:
    """Let no acknowledgement wait for the one before it to arrive (Nagle's algorithm)."""
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
