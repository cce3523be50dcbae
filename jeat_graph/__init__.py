"""jeat-graph: vehicles tracked from asynchronous event and RGB cameras on highways at night."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from jeat_graph.version import __version__

if TYPE_CHECKING:
    from jeat_graph.config import Config
    from jeat_graph.config_io import load_config
    from jeat_graph.detections import Detections, Scan
    from jeat_graph.errors import JeatGraphError
    from jeat_graph.tracker import Tracker
    from jeat_graph.trajectories import GroundTruth, Trajectories

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
    "Config": "config",
    "load_config": "config_io",
    "Detections": "detections",
    "Scan": "detections",
    "JeatGraphError": "errors",
    "Tracker": "tracker",
    "GroundTruth": "trajectories",
    "Trajectories": "trajectories",
}


def __getattr__(name: str) -> Any:
    # Loaded on first use: the tracker brings the compiler along, which a reader of files does not need.
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(f"jeat_graph.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'jeat_graph' has no attribute {name!r}")
