"""Compile what the tests call beside the tracker: the renderer, with a lens and without.

`make test` runs this while `jeat_graph.tracking.warm_up` compiles the tracker on the other core: each takes
about as long. What is left, the tests compile by themselves.
"""

from __future__ import annotations

import contextlib
import io
import tempfile

from jeat_graph.cli.main import main
from jeat_graph_sehn.simulation.imaging.config import load_imaging
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario

_SMALL = ("--sensors", "pictures", "--frames", "3", "--size", "64x48", "--workers", "1")


def compile_beside() -> None:
    """Render three pictures, and one through a lens."""
    said = io.StringIO()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stderr(said):
        with contextlib.redirect_stdout(said):
            main(["simulate", "night", "--out", f"{folder}/set", *_SMALL])
        tree = {"render": {"width": 160, "height": 96, "lamp_flicker": 0.5}, "lens": {"k1": -0.2}}
        for _ in RenderedSource(load_scenario("night"), load_imaging(tree), frames=1).segment(0):
            pass


if __name__ == "__main__":
    compile_beside()
