"""Whether a consumer of NATS is in use: each stream answers, while it runs, whoever asks for its own."""

from __future__ import annotations

import time
import uuid
from typing import TYPE_CHECKING, Any, NoReturn

from nats.errors import Error as NatsError

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.transport.names import distinct_name

if TYPE_CHECKING:
    from jeat_graph.live.transport.nats_link import NatsLink

#: So long answers are waited for (s); the server is in the same network.
_ASK_S = 0.5
#: So long what a client that is gone had asked for may still be noted by the server (s).
_PULLS_FADE_S = 1.5
_CHECK_S = 0.1


class Presence:
    """One stream's claim to a consumer, heard by others that ask for it.

    A pull consumer gives its messages to all that ask, some to each, and the server does not say who they
    are. So whoever uses one listens at a subject made of its name.

    Args:
        link: the connection.
        durable: name of the consumer.

    Attributes:
        settled: the consumer is ours.
    """

    def __init__(self, link: NatsLink, durable: str) -> None:
        self.settled = False
        self._asked_for = self._beaten = False
        self._created: Any = None
        self._link, self._durable = link, durable
        self._subject = distinct_name("in-use", link.stream, durable)
        self._me = uuid.uuid4().hex.encode()
        link.call(link.client.subscribe(self._subject, cb=self._asked))

    async def _asked(self, question: Any) -> None:
        # Of two that ask at the same time at least one hears the other, and the lower number has it.
        if question.data == self._me:
            return
        if self.settled or self._me < question.data:
            self._asked_for = self.settled
            await question.respond(self._me)
        else:
            self._beaten = True

    def claim(self) -> None:
        """Ask whether another uses the consumer.

        Raises:
            JeatGraphError: one does.
        """
        if not self._link.call(self._ask()):
            self._refuse("is in use by another stream")

    def _refuse(self, why: str) -> NoReturn:
        raise JeatGraphError(
            f"{self._link.address}: the consumer {self._durable!r} of stream {self._link.stream!r} {why}; "
            "give this one a name of its own (?durable=NAME)"
        )

    async def _ask(self) -> bool:
        """Whether nobody else has the consumer."""
        try:
            await self._link.client.request(self._subject, self._me, timeout=_ASK_S)
        except (NatsError, TimeoutError):
            self.settled = not self._beaten
            return self.settled
        return False

    def made(self, created: Any) -> None:
        """Keep when, by the server's clock, the consumer was made again."""
        self._created = created

    def check(self) -> None:
        """See that the consumer was not taken over while this program could not answer.

        Raises:
            JeatGraphError: it was.
        """
        if not self._asked_for:
            return
        link = self._link
        known = link.call(link.jet.consumer_info(link.stream, self._durable))
        self._asked_for = False
        if known.created != self._created:
            self._refuse("was taken over by another stream, which got no answer from this one")

    def pulled(self, known: Any) -> bool:
        """Tell whether somebody who does not answer asks for the consumer's messages again and again.

        Args:
            known: what the server says of the consumer.
        """
        link = self._link
        end = time.monotonic() + _PULLS_FADE_S
        while known.num_waiting:
            if time.monotonic() > end:
                return True
            time.sleep(_CHECK_S)
            known = link.call(link.jet.consumer_info(link.stream, self._durable))
        return False
