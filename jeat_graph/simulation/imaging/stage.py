"""What a tile of the picture is painted from, put together for the kernels."""

from __future__ import annotations

from typing import NamedTuple

from jeat_graph.simulation.imaging.background import Background
from jeat_graph.simulation.imaging.layers import Layers
from jeat_graph.simulation.imaging.lighting import Lights
from jeat_graph.simulation.imaging.moments import Look, Moments
from jeat_graph.simulation.imaging.optics import Optics
from jeat_graph.simulation.imaging.tiles import View


class Stage(NamedTuple):
    """All that a tile is painted from: static picture, vehicles, lights, lens, camera, room to work."""

    ground: Background
    moments: Moments
    look: Look
    lights: Lights
    optics: Optics
    camera: View
    layers: Layers
