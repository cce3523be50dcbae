"""Simulated corridors, once for all tests."""

from __future__ import annotations

import pytest

pytest.importorskip("jeat_graph_sehn")

from jeat_graph.cli.main import main
from jeat_graph_sehn.simulation.corridor.traffic import CorridorTraffic
from jeat_graph_sehn.simulation.corridor.writing import write_corridor_world


@pytest.fixture(scope="session")
def road(tmp_path_factory):
    """Three cameras in 5 minutes of 1800 vehicles an hour: folders A, B, C, and what is true."""
    out = tmp_path_factory.mktemp("corridor")
    config = CorridorTraffic(300.0, 1800.0, places_m=(0.0, 300.0, 700.0), leave=0.05, join=0.05)
    write_corridor_world(config, 11, out)
    return out


@pytest.fixture(scope="session")
def through(road, tmp_path_factory):
    """What `handover` writes of the corridor, the cameras given in another order than traffic passes them."""
    out = tmp_path_factory.mktemp("through")
    cameras = [f"{name}={road / name}" for name in "CAB"]
    gaps = ["--distance", "A-B=300±3", "--distance", "B-C=400±4"]
    assert main(["handover", *cameras, *gaps, "--interval", "150", "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="session")
def other_road(tmp_path_factory):
    """Two cameras of another road."""
    out = tmp_path_factory.mktemp("other")
    write_corridor_world(CorridorTraffic(300.0, 1800.0, places_m=(0.0, 300.0)), 12, out)
    return out
