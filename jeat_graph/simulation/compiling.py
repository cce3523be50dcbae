"""Compile the renderer in two processes: the one that renders, and a helper that begins at the other end.

Run as a module by who needs help. The helper renders a picture of a few pixels. What comes first in that, and
is compiled by who renders, it interprets; so it comes soon to what is called last, and compiles that.
"""

from __future__ import annotations

import sys
from dataclasses import replace

from jeat_graph.simulation.imaging.config import ImagingConfig
from jeat_graph.simulation.imaging.event_run import run_physical
from jeat_graph.simulation.imaging.painter import paint_tile
from jeat_graph.simulation.imaging.source import RenderedSource
from jeat_graph.simulation.scenario import load_scenario
from jeat_graph.tracking.helpers import part_of, start_helpers
from jeat_graph.tracking.interim import Interim, begin
from jeat_graph.tracking.notice import notice_if_cold

_SIDE_PX = 16
_FIRST = tuple(
    f"jeat_graph.simulation.imaging.{name}"
    for name in ("trace", "projection", "plan", "background", "renderer")
)


def prepare_renderer(alone: bool) -> None:
    """Say that the renderer will be compiled, if it will, and have another processor help.

    Args:
        alone: whether this process is the only one that renders; several are enough.
    """
    # Whatever is rendered, pictures or events, is painted tile by tile.
    notice_if_cold(paint_tile, "the renderer")
    if alone:
        start_helpers("jeat_graph.simulation.compiling", run_physical, most=1)


def help_out() -> None:
    """Compile what pictures are exposed by and events are made by, and all that these call."""
    begin(Interim(lambda: False, parts=_FIRST))
    imaging = ImagingConfig()
    small = replace(imaging, render=replace(imaging.render, width=_SIDE_PX, height=_SIDE_PX))
    source = RenderedSource(load_scenario("night"), small, seed=0, frames=2)
    for _ in source.segment(0):
        pass


if __name__ == "__main__" and part_of(sys.argv[1:]) is not None:
    help_out()
