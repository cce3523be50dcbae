"""The rows of the ablation lead from the paper's tracker to the default."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.steps import STEPS, rows, start, without
from jeat_graph.config.reading import load_config
from jeat_graph.tracking.whole import track
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.simulate import simulate


@pytest.mark.parametrize("target", ["highway", "kitti"])
def test_the_last_row_is_the_target_exactly(target):
    goal = load_config(target)
    assert rows(load_config("paper"), goal)[-1][1] == goal


def test_the_first_row_is_the_paper_preset():
    paper, default = load_config("paper"), load_config("highway")
    assert rows(paper, default)[0] == ("paper", start(paper, default))
    assert start(paper, default) == paper


def test_sensors_that_the_paper_does_not_know_get_its_rgb_constants():
    kitti = load_config("kitti")
    first = start(load_config("paper"), kitti)
    assert first.image == kitti.image
    assert first.sensors["lidar"] == replace(load_config("paper").sensors["rgb"], rate_hz=10.0)


def test_every_step_changes_something():
    configs = [config for _, config in rows(load_config("paper"), load_config("highway"))]
    assert len(configs) == len(STEPS) + 1
    assert all(a != b for a, b in pairwise(configs))


def test_before_the_last_step_all_that_it_takes_is_still_to_come():
    # Nothing is left over for the last row to take silently: its own keys make the whole difference.
    paper, goal = load_config("paper"), load_config("highway")
    before = rows(paper, goal)[-2][1]
    assert replace(before, motion=goal.motion) == goal


def test_all_rows_track():
    detections, _ = simulate(load_scenario("day"), seed=0, duration_s=1.0)
    for _, config in rows(load_config("paper"), load_config("highway")):
        assert np.isfinite(track(config, detections).boxes).all()


def test_each_row_without_a_part_differs_in_that_part_alone():
    target = load_config("highway")
    named = dict(without(target))
    calm = named["all, without NIS adaptation"]
    assert calm.noise.adaptation_rate == 0.0
    assert replace(calm, noise=target.noise) == target
    white = named["all, without errors with memory"]
    assert {s.correlated_share for s in white.sensors.values()} == {0.0}
    assert replace(white, sensors=target.sensors) == target
    independent = named["all, misses of one scan independent"]
    assert not independent.lifecycle.judges_sight
    assert replace(independent, lifecycle=target.lifecycle) == target
