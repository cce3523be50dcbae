"""jeat-graph: vehicles tracked from asynchronous event and RGB cameras on highways at night."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

# In a checkout `filters`, `association` and so on lie beside this folder, and links lead to them; installed,
# they lie in it. Where Git makes no links (Windows without the right to), they are found beside it.
if not (_FOLDER := Path(__file__).parent).joinpath("filters").is_dir():
    __path__.append(str(_FOLDER.parent))

from jeat_graph.version import __version__

if TYPE_CHECKING:
    from jeat_graph.api.functions import calibrate, compare, evaluate, read_run, simulate, track
    from jeat_graph.api.graphs import factor_graph
    from jeat_graph.config.reading import load_config
    from jeat_graph.config.schema import Config
    from jeat_graph.data.detections import Detections, Scan
    from jeat_graph.data.errors import JeatGraphError
    from jeat_graph.data.trajectories import GroundTruth, Trajectories
    from jeat_graph.io.files.config_io import save_config
    from jeat_graph.io.tables.detections_io import read_detections
    from jeat_graph.io.tables.truth_io import read_truth
    from jeat_graph.tracking.tracker import Tracker

_HOMES = {
    "Config": "config.schema",
    "Detections": "data.detections",
    "GroundTruth": "data.trajectories",
    "JeatGraphError": "data.errors",
    "Scan": "data.detections",
    "Tracker": "tracking.tracker",
    "Trajectories": "data.trajectories",
    "calibrate": "api.functions",
    "compare": "api.functions",
    "evaluate": "api.functions",
    "factor_graph": "api.graphs",
    "load_config": "config.reading",
    "read_detections": "io.tables.detections_io",
    "read_run": "api.functions",
    "read_truth": "io.tables.truth_io",
    "save_config": "io.files.config_io",
    "simulate": "api.functions",
    "track": "api.functions",
}

__all__ = [
    "Config",
    "Detections",
    "GroundTruth",
    "JeatGraphError",
    "Scan",
    "Tracker",
    "Trajectories",
    "__version__",
    "calibrate",
    "compare",
    "evaluate",
    "factor_graph",
    "load_config",
    "read_detections",
    "read_run",
    "read_truth",
    "save_config",
    "simulate",
    "track",
]


def __getattr__(name: str) -> Any:
    # Loaded on first use: a reader of files needs no tracker.
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(f"jeat_graph.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'jeat_graph' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
