"""Says that the first step will take a while, where the tracker has not been compiled for this machine."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from jeat_graph.data.progress import write_line

NOTICE = "compiling {what} for this machine, once (two to five minutes) …"
_said: set[str] = set()


def is_compiled(function: Any) -> bool:
    """Tell whether machine code of a compiled function is there for this version of Python.

    Args:
        function: decorated with `njit(cache=True)`.
    """
    if not hasattr(function, "stats"):
        return True  # compilation is switched off (NUMBA_DISABLE_JIT)
    version = f"py{sys.version_info.major}{sys.version_info.minor}"
    module = function.__module__.rpartition(".")[2]
    folder = Path(str(function.stats.cache_path))
    return any(folder.glob(f"{module}.{function.__name__}-*.{version}.nbi"))


def notice_if_cold(function: Any = None, what: str = "the tracker") -> None:
    """Say on stderr that the first step will take a while, if it will; once in a process for each thing.

    Args:
        function: compiled function that stands for all that is compiled with it; the tracker's step if None.
        what: what is compiled.
    """
    if what in _said:
        return
    _said.add(what)
    if function is None:
        from jeat_graph.tracking.step import step as function
    if not is_compiled(function):
        write_line(f"jeat-graph: {NOTICE.format(what=what)}")
