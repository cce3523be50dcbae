"""A source on a fake server, with the fake's own types or those of the client package."""

from __future__ import annotations

from typing import Any

import pytest

from jeat_graph_sehn.simulation.carla.config import CarlaConfig
from jeat_graph_sehn.simulation.carla.source import CarlaSource
from jeat_graph_sehn.simulation.scenario import load_scenario

from .fake_carla import FAKE_TYPES, make_api

SMALL = {"width": 64, "height": 48, "ticks_per_frame": 4, "warm_up_s": 0.05, "timeout_s": 0.2}


@pytest.fixture(params=["fake", "real"])
def types(request) -> Any:
    """Types of geometry: the fake's, and the client package's where it is installed."""
    return FAKE_TYPES if request.param == "fake" else pytest.importorskip("carla")


@pytest.fixture
def make_source():
    """Make a source and its fake module; keywords of the fake's behaviour."""

    def make(
        scenario: str = "night", types: Any = FAKE_TYPES, seed: int = 0, frames: int = 3, **behaviour: Any
    ) -> tuple[CarlaSource, Any]:
        api = make_api(types, **behaviour)
        config = CarlaConfig(**SMALL)
        return CarlaSource(load_scenario(scenario), config, seed, frames, api=api), api

    return make
