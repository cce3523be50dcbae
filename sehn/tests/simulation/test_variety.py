"""Drawn worlds keep what a scenario asks for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.variety import _traffic


def test_at_least_as_many_stop_as_the_scenario_says() -> None:
    """Nothing else changes: the same random numbers are drawn."""
    plain = load_scenario("day")
    halting = replace(plain.traffic, stopped=3)
    for seed in range(20):
        drawn = _traffic(np.random.default_rng(seed), plain.traffic, plain.road)
        asked = _traffic(np.random.default_rng(seed), halting, plain.road)
        assert asked.stopped == max(drawn.stopped, 3)
        assert replace(asked, stopped=drawn.stopped) == drawn
