"""Boxes of low scores are believed less, by what a sensor's curve says: in gates, filter and smoothers."""

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections
from jeat_graph.filters.noise import scored_noise
from jeat_graph.tracking.whole import both_tables, track

BASE = [
    "smoother.engine=rts",
    "output.min_fit=0",
    "noise.adaptation_rate=0",
    "image.edge_px=0",
    "birth.max_overlap=1",
    "sensors.rgb.score_precision=[[0, 0.9]]",
]
CURVE = "sensors.rgb.score_noise=[[0.2, 3.0], [0.8, 0.5]]"
WHITE = ["sensors.rgb.correlated_share=0"]
LASTING = ["sensors.rgb.correlated_share=0.6", "sensors.rgb.memory_s=0.5"]


def seen(scores, seed=0):
    """One vehicle at 20 Hz, with boxes of these scores whose places scatter."""
    rng = np.random.default_rng(seed)
    t = np.arange(len(scores)) / 20.0
    left = 200.0 + 40.0 * t + rng.normal(0.0, 1.0, len(t))
    top = 200.0 + rng.normal(0.0, 1.0, len(t))
    boxes = np.column_stack([left, top, np.full(len(t), 60.0), np.full(len(t), 50.0)])
    return Detections.from_rows(t, ["rgb"] * len(t), boxes, scores)


def config(*changes):
    return load_config("highway", [*BASE, *changes])


@pytest.mark.parametrize(
    ("lasting", "score", "factor"),
    [(WHITE, 0.1, 3.0), (WHITE, 0.5, 1.75), (WHITE, 0.9, 0.5), (LASTING, 0.9, 0.5)],
)
def test_boxes_of_one_score_are_those_of_a_sensor_of_that_noise(lasting, score, factor):
    """The oracle is a sensor without a curve whose four noises are the factor's multiples."""
    detections = seen(np.full(30, score))
    plain = config(*lasting)
    s = plain.sensors["rgb"]
    scaled = [
        f"sensors.rgb.{name}={factor * getattr(s, name)!r}"
        for name in ("sigma_px", "rho_x", "rho_y", "rho_size", "sigma_log_width", "sigma_log_height")
    ]
    found = both_tables(config(CURVE, *lasting), detections)
    expected = both_tables(config(*scaled, *lasting), detections)
    for a, b in zip(found, expected, strict=True):
        assert len(a) == len(b) > 0
        np.testing.assert_allclose(a.boxes, b.boxes, rtol=1e-7)
        np.testing.assert_allclose(a.var, b.var, rtol=1e-6)
        np.testing.assert_allclose(a.size_var, b.size_var, rtol=1e-6)


@pytest.mark.parametrize("spread", [0.3, 1.0, 2.5])
def test_the_whole_variance_goes_with_the_square_and_what_lasts_does_not_grow(spread):
    white, coloured_std = scored_noise(2.0, 1.5, spread)
    assert white + coloured_std**2 == pytest.approx(spread**2 * (2.0 + 1.5**2), rel=1e-12)
    assert coloured_std == pytest.approx(min(spread, 1.0) * 1.5, rel=1e-12)
    assert white > 0.0


def test_a_doubtful_box_that_is_off_draws_the_track_less():
    scores = np.full(30, 0.9)
    sure, doubtful = seen(scores), seen(np.where(np.arange(30) == 29, 0.2, scores))
    moved = []
    for detections in (sure, doubtful):
        off = detections.boxes.copy()
        off[-1, 1] += 1.5
        rows = Detections.from_rows(detections.scan_t, ["rgb"] * 30, off, detections.scores)
        pair = [track(config(CURVE), one) for one in (detections, rows)]
        moved.append(pair[1].boxes[-1, 1] - pair[0].boxes[-1, 1])
    assert 0.0 <= moved[1] < 0.2 * moved[0]
