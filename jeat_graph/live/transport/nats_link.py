"""A connection to NATS, kept up by an event loop in a thread of its own, since the client is asynchronous."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
import time
from collections.abc import Coroutine
from concurrent.futures import wait
from typing import Any, TypeVar

from nats.aio.client import Client
from nats.errors import AuthorizationError
from nats.errors import Error as NatsError
from nats.js.errors import NotFoundError

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.address import Address
from jeat_graph.live.transport.names import distinct_name
from jeat_graph.live.transport.notices import Notices
from jeat_graph.live.transport.patience import SLICE_S, Overdue

CONNECT_S, CALL_S = 10.0, 10.0
_AGAIN_S = 0.5
_FORBIDDEN = "permissions violation"
_T = TypeVar("_T")


class _NotOurs(logging.Filter):
    """Passes over what asyncio says of the client each time when an encrypted connection ends."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Tell whether a record is to be reported."""
        return "eof_received" not in record.getMessage()


_NOT_OURS = _NotOurs()


class NatsLink:
    """A connection that is mended for as long as it takes, and the stream that holds the topic.

    Args:
        address: the server and the subject.
        overdue: tells when the program is to end.
        notices: takes what the user is to know.
        patience_s: longest wait for the first connection to the server (s).

    Attributes:
        client: of the server.
        jet: its JetStream.
        stream: name of the stream that holds the topic; made if there is none.
        reconnects: how often the connection was mended.
        forbidden: what the server said of something that this user may not do, or empty.

    Raises:
        JeatGraphError: nobody answers, the server refuses, or it has no JetStream.
    """

    def __init__(
        self, address: Address, overdue: Overdue, notices: Notices, patience_s: float = CONNECT_S
    ) -> None:
        self.address, self.overdue, self.notices = address, overdue, notices
        self.reconnects = 0
        self.forbidden = ""
        self.client: Any = Client()
        self._connected = self._leaving = False
        logging.getLogger("asyncio").addFilter(_NOT_OURS)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        try:
            self.call(self._open(patience_s), patience_s + CALL_S)
            self.jet: Any = self.client.jetstream()
            self.stream = self._stream()
        except (NatsError, OSError, TimeoutError, ValueError) as error:
            self.stop()
            raise JeatGraphError(f"{address}: {why(error) or 'the server does not answer'}") from None

    async def _open(self, patience_s: float) -> None:
        """Connect; the first connection must succeed at once."""
        failed: asyncio.Future[Exception] = self._loop.create_future()

        async def reconnected() -> None:
            self.reconnects += 1
            self.notices.forget()
            self.notices.found(self.address)

        async def disconnected() -> None:
            if not self.client.is_closed and not self._leaving:
                self.notices.lost(self.address)

        async def complain(error: Exception) -> None:
            if not self._connected and not failed.done():
                failed.set_result(error)
            if _FORBIDDEN in str(error).lower():
                self.forbidden = why(error)
            if self._connected and isinstance(error, AuthorizationError):
                self.notices.once(f"warning: {self.address}: {why(error)}; trying again")

        user, password, tls = self.address.user, self.address.password, self.address.tls
        connecting = asyncio.ensure_future(
            self.client.connect(
                f"{'nats' if tls is None else 'tls'}://{self.address.server}",
                tls=None if tls is None else tls.context(),
                user=None if user is None else user.reveal(),
                password=None if password is None else password.reveal(),
                connect_timeout=patience_s,
                max_reconnect_attempts=-1,
                reconnect_time_wait=_AGAIN_S,
                allow_reconnect=True,
                reconnected_cb=reconnected,
                disconnected_cb=disconnected,
                error_cb=complain,
            )
        )
        waits: set[asyncio.Future[Any]] = {connecting, failed}
        await asyncio.wait(waits, timeout=patience_s, return_when=asyncio.FIRST_COMPLETED)
        if not connecting.done():
            connecting.cancel()
            raise failed.result() if failed.done() else TimeoutError
        connecting.result()
        self._connected = True
        self.notices.found(self.address)

    def _stream(self) -> str:
        wanted = self.address.options.get("stream")
        if wanted is not None:
            return wanted
        try:
            return str(self.call(self.jet.find_stream_name_by_subject(self.address.topic)))
        except NotFoundError:
            name = distinct_name(self.address.topic)
            self.call(self.jet.add_stream(name=name, subjects=[self.address.topic]))
            return name

    def call(self, work: Coroutine[Any, Any, _T], timeout_s: float = CALL_S) -> _T:
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
        self._leaving = True
        with contextlib.suppress(NatsError, OSError):
            self.call(self.client.close())
        self.stop()

    def stop(self) -> None:
        """End the thread."""

        def end() -> None:
            # What still waits for a server that is gone would complain of being left behind.
            for task in asyncio.all_tasks(self._loop):
                task.cancel()
            self._loop.call_soon(self._loop.stop)

        self._loop.call_soon_threadsafe(end)
        self._thread.join()


def why(error: Exception) -> str:
    """Return what an error of the client says, without its marks."""
    description = getattr(error, "description", None)
    return str(description or error).removeprefix("nats: ").strip("'")
