"""The protocols that there are."""

from __future__ import annotations

from functools import cache

from jeat_graph.data.errors import DataError
from jeat_graph.data.records import records_in
from jeat_graph.eval.protocols.record import JudgingProtocol

_PACKAGE = "jeat_graph.eval.protocols"


@cache
def protocols() -> tuple[JudgingProtocol, ...]:
    """Return the records of all protocols, by name."""
    found: list[JudgingProtocol] = records_in(_PACKAGE, "PROTOCOL")
    return tuple(sorted(found, key=lambda one: one.name))


def protocol_named(name: str) -> JudgingProtocol:
    """Return a protocol by its name.

    Raises:
        DataError: there is none of that name.
    """
    found = {one.name: one for one in protocols()}
    if name not in found:
        raise DataError(f"unknown protocol {name!r}; known: {', '.join(found)}")
    return found[name]
