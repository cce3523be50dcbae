"""Which engine a `Tracker` runs on: the configuration says it, or whoever makes the tracker."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self, cast

from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.config.tracker import ENGINES
from jeat_graph.data.errors import ConfigError


class ChosenEngine:
    """Makes the tracker of the engine that is asked for."""

    #: Whether a run that was broken off can go on.
    can_save = True
    #: Whether a sensor that is met late changes nothing of what was before.
    meets_as_it_goes = False
    _chosen: Config  # loaded once

    def __new__(
        cls, config: Config | str | Path = "default", *, engine: str | None = None, **settings: Any
    ) -> Self:
        """Return a tracker of an engine.

        Raises:
            ConfigError: no such engine.
        """
        config = as_config(config)
        engine = config.tracker.engine if engine is None else engine
        if engine not in ENGINES:
            raise ConfigError(f"engine is one of {', '.join(ENGINES)}, not {engine!r}")
        if engine != "compiled":
            from jeat_graph.tracking.model_tracker import ModelTracker

            # It has the methods of a tracker, or says that it lacks one: for callers' types it is one.
            return cast(Self, ModelTracker(config, engine=engine, **settings))
        made = super().__new__(cls)
        made._chosen = config
        return made
