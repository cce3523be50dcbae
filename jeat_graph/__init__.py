"""jeat-graph: vehicles tracked from asynchronous event and RGB cameras on highways at night."""

from __future__ import annotations

from jeat_graph.version import __version__

__all__ = ["__version__"]
