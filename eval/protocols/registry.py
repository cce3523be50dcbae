"""The protocols that there are."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from jeat_graph.data.errors import DataError
from jeat_graph.eval.protocols.record import JudgingProtocol

_PACKAGE = "jeat_graph.eval.protocols"


@cache
def protocols() -> tuple[JudgingProtocol, ...]:
    """Return the records of all protocols, by name."""
    package = importlib.import_module(_PACKAGE)
    names = [one.name for one in pkgutil.iter_modules(package.__path__)]
    modules = [importlib.import_module(f"{_PACKAGE}.{name}") for name in names]
    found: list[JudgingProtocol] = [module.PROTOCOL for module in modules if hasattr(module, "PROTOCOL")]
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
