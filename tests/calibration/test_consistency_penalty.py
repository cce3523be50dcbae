"""Variances that are not true cost a configuration something, and the noise is scaled to make them so."""

import math

import numpy as np
import pytest

from jeat_graph import load_config
from jeat_graph.calibration.consistency_penalty import CONSISTENT, consistency_penalty
from jeat_graph.calibration.noise_scale import FACTORS, scale_noise, with_noise
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.position_nees import position_nees
from jeat_graph.tracking.whole import both_tables


def test_within_the_bounds_nothing_is_charged_and_outside_by_the_logarithm():
    low, high = CONSISTENT
    assert [consistency_penalty(a) for a in (low, 1.0, high, math.nan)] == [0.0] * 4
    assert consistency_penalty(high * math.e) == pytest.approx(consistency_penalty(low / math.e))
    assert consistency_penalty(high * math.e**2) == pytest.approx(2.0 * consistency_penalty(high * math.e))


@pytest.fixture(scope="module")
def recording():
    """Six vehicles that drive past; their boxes are off by 6 px, white."""
    rng = np.random.default_rng(1)
    t = np.repeat(np.arange(60) / 20.0, 6)
    number = np.tile(np.arange(6), 60)
    left = 50.0 + 60.0 * t + 5.0 * number
    boxes = np.column_stack([left, 20.0 + 110.0 * number, np.full(360, 80.0), np.full(360, 60.0)])
    seen = boxes.copy()
    seen[:, :2] += rng.normal(0.0, 6.0, (360, 2))
    truth = GroundTruth(t=t, object_id=number, boxes=boxes, motion=None, ignore=np.zeros(360, dtype=bool))
    return Detections.from_rows(t, np.full(360, "rgb"), seen, np.full(360, 0.9)), truth


def test_a_configuration_that_believes_its_detector_too_much_is_widened(recording):
    white = {"sigma_px": 4.0, "rho_x": 0.0, "rho_y": 0.0, "rho_size": 0.0, "correlated_share": 0.0}
    text = ", ".join(f"{k}: {v}" for k, v in white.items())
    config = load_config("default", (f"sensors.rgb={{{text}}}", "noise.adaptation_rate=0"))
    before = position_nees([(recording[1], both_tables(config, recording[0])[0])]).anees
    found, factor, _ = scale_noise(config, [[recording]])
    after = position_nees([(recording[1], both_tables(found, recording[0])[0])]).anees
    assert factor in FACTORS
    assert factor > 1.0
    assert abs(math.log(after)) < abs(math.log(before))
    assert found == with_noise(config, factor)
    assert found.sensors["rgb"].sigma_px == pytest.approx(4.0 * factor)
