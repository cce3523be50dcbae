"""The engines by name."""

from __future__ import annotations

from jeat_graph.config.schema import Config
from jeat_graph.config.tracker import ENGINES
from jeat_graph.data.errors import ConfigError
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.tracking.engine import TrackEngine


def make_engine(config: Config, constants: ModelConstants | None = None) -> TrackEngine:
    """Return a new engine, the one that `tracker.engine` names.

    Args:
        config: the configuration.
        constants: of the model, if not the usual ones; not for `paper`.

    Raises:
        ConfigError: no such engine, or constants for one that has none.
    """
    name = config.tracker.engine
    if name == "paper":
        from jeat_graph.tracking.paper.model import PaperModel

        if constants is not None:
            raise ConfigError("engine paper takes no constants of the model: it has the section paper")
        return PaperModel(config)
    known = constants or ModelConstants()
    if name == "core":
        from jeat_graph.tracking.core_model import CoreModel

        return CoreModel(known, config)
    if name == "reference":
        from jeat_graph.tracking.reference_model import ReferenceModel

        return ReferenceModel(known, config)
    raise ConfigError(f"engine is one of {', '.join(ENGINES)}, not {name!r}")
