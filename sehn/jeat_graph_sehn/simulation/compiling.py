"""The renderer is compiled once for each machine; it is said before, and done once though several render."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from jeat_graph.data.progress import write_line
from jeat_graph_sehn import kernel_cache
from jeat_graph_sehn.simulation.imaging.config import ImagingConfig
from jeat_graph_sehn.simulation.imaging.painter import paint_tile
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario

NOTICE = "compiling the renderer for this machine, once (a minute or two) …"
_SIDE_PX = 16


def prepare_renderer(workers: int) -> None:
    """Say that the renderer will be compiled, if it will, and compile it first where several would.

    Args:
        workers: processes that render; the kernels of lenses are left to them.
    """
    # Whatever is rendered, pictures or events, is painted tile by tile.
    if is_compiled(paint_tile):
        return
    if kernel_cache.notice:
        write_line(f"jeat-graph simulate: {kernel_cache.notice}")
    write_line(f"jeat-graph simulate: {NOTICE}")
    if workers > 1 and _keeper(paint_tile) is not None:
        # Two processes that compile one kernel for different arguments at the same moment would take the
        # same free name on disk.
        render_little()


def render_little() -> None:
    """Render a few pixels and their events: it takes all kernels but those of lenses."""
    imaging = ImagingConfig()
    small = replace(imaging, render=replace(imaging.render, width=_SIDE_PX, height=_SIDE_PX))
    for _ in RenderedSource(load_scenario("night"), small, seed=0, frames=1).segment(0):
        pass


def is_compiled(kernel: Any) -> bool:
    """Tell whether machine code of a kernel is kept for this processor, source, compiler and Python.

    Args:
        kernel: decorated with `njit(cache=True)`.
    """
    if not hasattr(kernel, "stats"):
        return True  # compilation is switched off (NUMBA_DISABLE_JIT)
    kept = _keeper(kernel)
    machine = kernel.targetctx.codegen().magic_tuple()
    return kept is not None and any(key[1] == machine for key in kept._load_index())


def _keeper(kernel: Any) -> Any:
    """Return what keeps the machine code of a kernel on disk; None where nothing does."""
    return getattr(getattr(kernel, "_cache", None), "_cache_file", None)
