"""jeat-graph: vehicles tracked from asynchronous event and RGB cameras on highways at night."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from jeat_graph.version import __version__

if TYPE_CHECKING:
    from jeat_graph.config.reading import load_config
    from jeat_graph.config.schema import Config
    from jeat_graph.data.detections import Detections, Scan
    from jeat_graph.data.errors import JeatGraphError
    from jeat_graph.data.trajectories import GroundTruth, Trajectories
    from jeat_graph.tracking.tracker import Tracker

__all__ = [
    "Config",
    "Detections",
    "GroundTruth",
    "JeatGraphError",
    "Scan",
    "Tracker",
    "Trajectories",
    "__version__",
    "load_config",
]

_HOMES = {
    "Config": "config.schema",
    "load_config": "config.reading",
    "Detections": "data.detections",
    "Scan": "data.detections",
    "JeatGraphError": "data.errors",
    "Tracker": "tracking.tracker",
    "GroundTruth": "data.trajectories",
    "Trajectories": "data.trajectories",
}


def __getattr__(name: str) -> Any:
    # Loaded on first use: the tracker brings the compiler along, which a reader of files does not need.
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(f"jeat_graph.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'jeat_graph' has no attribute {name!r}")
