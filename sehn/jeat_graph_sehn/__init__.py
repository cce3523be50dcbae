"""jeat-graph-sehn: simulated highways for jeat-graph, their data sets, and training of its networks."""

from __future__ import annotations

from jeat_graph import JeatGraphError
from jeat_graph import __version__ as _theirs
from jeat_graph_sehn.kernel_cache import choose_cache
from jeat_graph_sehn.version import __version__

__all__ = ["__version__"]

if _theirs != __version__:
    raise JeatGraphError(
        f"jeat-graph-sehn {__version__} does not belong to jeat-graph {_theirs}: "
        "`pip install . ./sehn` in a checkout brings both"
    )

# Before any kernel is loaded.
choose_cache()
