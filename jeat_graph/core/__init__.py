"""The compiled core: C++20, bound by nanobind, in folders that have the names of the package's own.

`jeat_graph.core.events` is in `events/`, and so on; each file there has the name of the Python file whose
loops it holds. Arrays go in and out without a copy, and must be of the type and layout that the core expects.
"""

from __future__ import annotations

import sys
from pathlib import Path

from jeat_graph.data.errors import CoreMissingError

try:
    from jeat_graph.core._core import association, detection, events, io, road, tracking
except ModuleNotFoundError:
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    raise CoreMissingError(
        f"jeat-graph's compiled core for Python {version} is not in {Path(__file__).parent}: build it in "
        "that checkout with `make core` or `pip install --editable .`, which need a C++20 compiler; if "
        "jeat-graph is installed, run Python in another folder: in a checkout it takes the sources there"
    ) from None

__all__ = ["association", "detection", "events", "io", "road", "tracking"]
