"""Which engine a `Tracker` runs on, chosen where it is made."""

from __future__ import annotations

from typing import Any, Self, cast

from jeat_graph.data.errors import ConfigError

#: Today's, and the reference model in NumPy.
ENGINES = ("compiled", "reference")


class ChosenEngine:
    """Makes the tracker of the engine that is asked for."""

    def __new__(cls, *args: Any, engine: str = "compiled", **settings: Any) -> Self:
        """Return a tracker of an engine.

        Raises:
            ConfigError: no such engine.
        """
        if engine not in ENGINES:
            raise ConfigError(f"engine is one of {', '.join(ENGINES)}, not {engine!r}")
        if engine == "reference":
            from jeat_graph.tracking.reference_tracker import ReferenceTracker

            # It has the methods of a tracker, or says that it lacks one: for callers' types it is one.
            return cast(Self, ReferenceTracker(*args, **settings))
        return super().__new__(cls)
