"""Says that the first step will take a while, where the tracker has not been compiled for this machine."""

from __future__ import annotations

import sys
from pathlib import Path

NOTICE = "compiling the tracker for this machine, once (one to two minutes; on a busy machine more) …"
_said = False


def is_compiled() -> bool:
    """Tell whether machine code of the tracker's step is there for this version of Python."""
    from jeat_graph.tracking.step import step

    if not hasattr(step, "stats"):
        return True  # compilation is switched off (NUMBA_DISABLE_JIT)
    version = f"py{sys.version_info.major}{sys.version_info.minor}"
    folder = Path(str(step.stats.cache_path))
    return any(folder.glob(f"step.step-*.{version}.nbi"))


def notice_if_cold() -> None:
    """Say on stderr that the first step will take a while, if it will; once in a process."""
    global _said
    if not _said and not is_compiled():
        print(f"jeat-graph: {NOTICE}", file=sys.stderr, flush=True)
    _said = True
