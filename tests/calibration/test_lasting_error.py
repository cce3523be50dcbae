"""What boxes are off by as long as a vehicle is seen stands in the variances, and changes nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph import load_config
from jeat_graph.calibration.lasting_error import lasting_share, measure_lasting_error, with_lasting_error
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.position_nees import PositionErrors, position_nees
from jeat_graph.tracking.tracker import Tracker
from jeat_graph.tracking.whole import both_tables

SHARE = 0.08


@pytest.fixture(scope="module")
def recording():
    """Forty vehicles; the boxes of each are off by .08 of sqrt(width height) as long as it is seen."""
    rng = np.random.default_rng(2)
    t, ids, boxes, seen = [], [], [], []
    for number in range(40):
        when = 2.0 * (number // 6) + np.arange(36) / 20.0
        width, height = rng.uniform(60.0, 120.0), rng.uniform(50.0, 80.0)
        left = 50.0 + 300.0 * (when - when[0])
        one = np.column_stack(
            [left, np.full(36, 20.0 + 110.0 * (number % 6)), *np.full((2, 36), [[width], [height]])]
        )
        off = one.copy()
        off[:, :2] += SHARE * np.sqrt(width * height) * rng.standard_normal(2) + rng.standard_normal((36, 2))
        t.append(when), ids.append(np.full(36, number)), boxes.append(one), seen.append(off)
    t, ids, boxes, seen = (np.concatenate(part) for part in (t, ids, boxes, seen))
    truth = GroundTruth(t=t, object_id=ids, boxes=boxes, motion=None, ignore=np.zeros(len(t), dtype=bool))
    return Detections.from_rows(t, np.full(len(t), "rgb"), seen, np.full(len(t), 0.9)), truth


CONFIG = (
    "image.width=1280",
    "image.height=720",
    "sensors.rgb={sigma_px: 1.0, rho_size: 0.0, correlated_share: 0.0}",
)


def test_the_share_is_that_of_drawn_errors():
    rng = np.random.default_rng(0)
    area = rng.uniform(400.0, 40_000.0, 20_000)
    var = rng.uniform(0.5, 4.0, (20_000, 2))
    error = np.sqrt(var + 0.05**2 * area[:, None]) * rng.standard_normal(var.shape)
    # The mean of 40,000 squares of unit variance is known to 0.7 %; b² to little more, b to half of that.
    assert lasting_share([PositionErrors(error, var, area)]) == pytest.approx(0.05, rel=0.02)


def test_variances_that_are_large_enough_stay_and_nothing_is_no_reason_to_widen():
    few = PositionErrors(np.ones((5, 2)), np.full((5, 2), 1.5), np.full(5, 2500.0))
    none = PositionErrors(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    assert (
        lasting_share([few])
        == lasting_share([few, none])
        == lasting_share([none])
        == lasting_share([])
        == 0.0
    )


def test_of_two_tables_the_ratios_are_one_in_the_geometric_mean():
    tables = [
        PositionErrors(np.full((4, 2), error), np.ones((4, 2)), np.full(4, 100.0)) for error in (2.0, 4.0)
    ]
    added = (10.0 * lasting_share(tables)) ** 2
    # 4 / (1 + d) and 16 / (1 + d): their product is one at d = 7.
    assert added == pytest.approx(7.0, rel=1e-3)


def test_what_recordings_are_off_by_is_measured_and_makes_both_tables_true(recording):
    detections, truth = recording
    config = load_config("default", CONFIG)
    share = measure_lasting_error(config, [recording])
    # Of 40 vehicles a variance is known to a sixth; the filter's own variance holds a part of it.
    assert share == pytest.approx(SHARE, rel=0.3)
    before, after = (both_tables(one, detections) for one in (config, with_lasting_error(config, share)))
    for k, kind in enumerate(("causal", "smoothed")):
        assert position_nees([(truth, before[k])], kind).anees > 2.0
        assert 0.7 < position_nees([(truth, after[k])], kind).anees < 1.5


@pytest.mark.parametrize("engine", ["rts", "fixed-lag"])
def test_it_adds_to_the_variances_of_positions_and_changes_nothing_else(recording, engine):
    detections, _ = recording
    tables = []
    for share in (0.0, SHARE):
        tracker = Tracker(
            load_config("default", (*CONFIG, f"smoother.engine={engine}", f"output.lasting_error={share}"))
        )
        causal = [table for table in tracker.run(detections) if len(table)]
        tables.append((*causal, tracker.finish()))
    for plain, wide in zip(*tables, strict=True):
        assert len(plain)
        np.testing.assert_array_equal(plain.boxes, wide.boxes)
        np.testing.assert_array_equal(plain.var[:, 2:], wide.var[:, 2:])
        np.testing.assert_array_equal(plain.size_var, wide.size_var)
        inside = (wide.boxes[:, :2] > 1.0).all(axis=1) & (wide.boxes[:, 0] + wide.boxes[:, 2] < 1279.0)
        added = (wide.var - plain.var)[inside, :2]
        np.testing.assert_allclose(
            added, SHARE**2 * wide.boxes[inside, 2:].prod(axis=1)[:, None] * np.ones(2), rtol=1e-9
        )
        same = replace(wide, var=plain.var)
        for name in ("t", "track_id", "existence", "mean", "used"):
            np.testing.assert_array_equal(getattr(plain, name), getattr(same, name))


def test_a_prediction_says_it_too_and_its_covariance_has_its_variances(recording):
    detections, _ = recording
    found = []
    for share in (0.0, SHARE):
        tracker = Tracker(
            load_config("default", (*CONFIG, "smoother.engine=none", f"output.lasting_error={share}"))
        )
        for k in range(20):
            tracker.step(detections.scan(k))
        found.append(tracker.predict(1.0))
    plain, wide = found
    assert len(plain)
    for one in found:
        np.testing.assert_array_equal(np.diagonal(one.cov, axis1=1, axis2=2), one.var)
        np.linalg.cholesky(one.cov)  # raises where one is not positive definite
    added = SHARE**2 * wide.boxes[:, 2:].prod(axis=1)
    np.testing.assert_allclose(
        wide.cov[:, :2, :2] - plain.cov[:, :2, :2], added[:, None, None] * np.eye(2), rtol=1e-9
    )
