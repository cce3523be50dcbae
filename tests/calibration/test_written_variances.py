"""What positions are off by stands in the variances that are written, and changes nothing else."""

import numpy as np
import pytest

from jeat_graph import load_config
from jeat_graph.calibration.written_variances import (
    measure_written_variances,
    truest,
    with_written_variances,
)
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.position_nees import PositionErrors, position_nees
from jeat_graph.tracking.tracker import Tracker
from jeat_graph.tracking.whole import both_tables

SCALE, SHARE = 0.4, 0.08


@pytest.fixture(scope="module")
def recording():
    """Forty vehicles; the boxes of each are off by .08 of its height as long as it is seen."""
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
        off[:, :2] += SHARE * height * rng.standard_normal(2) + rng.standard_normal((36, 2))
        t.append(when), ids.append(np.full(36, number)), boxes.append(one), seen.append(off)
    t, ids, boxes, seen = (np.concatenate(part) for part in (t, ids, boxes, seen))
    truth = GroundTruth(t=t, object_id=ids, boxes=boxes, motion=None, ignore=np.zeros(len(t), dtype=bool))
    return Detections.from_rows(t, np.full(len(t), "rgb"), seen, np.full(len(t), 0.9)), truth


CONFIG = (
    "image.width=1280",
    "image.height=720",
    "output.position_scale=1",
    "output.lasting_error=0",
    "sensors.rgb={sigma_px: 1.0, rho_size: 0.0, correlated_share: 0.0}",
)


def drawn(rng, objects, looks=100, scale=0.5, share=0.04, recordings=10):
    """Errors of two tables with the variances scale P + (share height)²; the second has a fifth of the P."""
    count = objects * looks
    height, of = rng.uniform(20.0, 200.0, count), np.repeat(np.arange(objects), looks)
    tables = []
    for most in (30.0, 6.0):
        var = rng.uniform(0.02 * most, most, (count, 2))
        error = np.sqrt(scale * var + (share * height[:, None]) ** 2) * rng.standard_normal(var.shape)
        tables.append(PositionErrors(error, var, height, of, of % recordings))
    return tables


def anees(one, scale, share):
    return np.mean(one.error**2 / (scale * one.var + (share * one.height[:, None]) ** 2))


def test_scale_and_share_are_those_of_drawn_errors():
    scale, share = truest(drawn(np.random.default_rng(0), 400, share=0.01), 0.6, 0.0)
    # What was held beforehand weighs a little, and of twice 80,000 squares both are known to some per cent.
    assert scale == pytest.approx(0.5, rel=0.1)
    assert share == pytest.approx(0.01, rel=0.1)


def test_a_few_objects_leave_what_was_held_before_nearly_as_it_was():
    off = []
    for objects in (1, 4, 400):
        tables = drawn(np.random.default_rng(1), objects)
        off.append(abs(np.log(anees(tables[0], *truest(tables, 2.0, 0.0)))))
    assert off[0] > off[1] > off[2]
    none = np.zeros(0, dtype=np.int64)
    nothing = PositionErrors(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), none, none)
    assert truest([nothing], 0.4, 0.035) == truest([], 0.4, 0.035) == (0.4, 0.035)


def test_one_recording_says_less_than_its_objects_do():
    """Another may be off by as much to the other side, however many vehicles this one shows."""
    off = []
    for recordings in (1, 40):
        tables = drawn(np.random.default_rng(3), 40, recordings=recordings)
        off.append(abs(np.log(anees(tables[0], *truest(tables, 2.0, 0.0)))))
    assert off[0] > 2.0 * off[1]


def test_both_tables_are_true_although_a_normal_likelihood_would_have_one_of_them_false():
    """Of real cars: errors go with P and have long tails, and P is twice too large in one table alone.

    The likeliest factor for both then is right for neither: .75, with 1.33 and .67.
    """
    rng = np.random.default_rng(4)
    objects, looks = 150, 20
    of = np.repeat(np.arange(objects), looks)
    height = np.repeat(rng.uniform(30.0, 60.0, objects), looks)
    size = (0.04 * height * np.exp(rng.normal(0.0, 0.7, len(of))))[:, None]
    tail = np.sqrt(1.5 / rng.chisquare(5.0, (len(of), 2)) * 2.0)
    error = size * tail * rng.standard_normal((len(of), 2))
    tables = [
        PositionErrors(error, more * np.broadcast_to(size**2, error.shape), height, of, of % 10)
        for more in (2.0, 1.0)
    ]
    assert [round(anees(one, 1.0, 0.0), 1) for one in tables] == [0.5, 1.0]
    found = truest(tables, 0.4, 0.035)
    for one in tables:
        assert 0.8 < anees(one, *found) < 1.2


def test_what_recordings_are_off_by_is_measured_and_makes_both_tables_true(recording):
    detections, truth = recording
    plain = load_config("default", CONFIG)
    found = measure_written_variances(plain, [recording], plain.output)
    # Of 40 vehicles a variance is known to a sixth.
    assert found.output.lasting_error == pytest.approx(SHARE, rel=0.3)
    before, after = (both_tables(one, detections) for one in (plain, found))
    for k, kind in enumerate(("causal", "smoothed")):
        assert position_nees([(truth, before[k])], kind).anees > 2.0
        assert 0.7 < position_nees([(truth, after[k])], kind).anees < 1.5


@pytest.mark.parametrize("engine", ["rts", "fixed-lag"])
def test_the_variances_of_positions_are_written_so_and_nothing_else_changes(recording, engine):
    detections, _ = recording
    tables = []
    for scale, share in ((1.0, 0.0), (SCALE, SHARE)):
        config = with_written_variances(
            load_config("default", (*CONFIG, f"smoother.engine={engine}")), scale, share
        )
        tracker = Tracker(config)
        causal = [table for table in tracker.run(detections) if len(table)]
        tables.append((*causal, tracker.finish()))
    for plain, wide in zip(*tables, strict=True):
        assert len(plain)
        for name in ("t", "track_id", "boxes", "existence", "mean", "used", "size_var"):
            np.testing.assert_array_equal(getattr(plain, name), getattr(wide, name))
        np.testing.assert_array_equal(plain.var[:, 2:], wide.var[:, 2:])
        low, high = plain.boxes[:, :2], plain.boxes[:, :2] + plain.boxes[:, 2:]
        inside = ((low > 5.0) & (high < np.array([1280.0, 720.0]) - 5.0)).all(axis=1)
        lasting = (SHARE * plain.boxes[:, 3:]) ** 2
        np.testing.assert_allclose(
            wide.var[inside, :2], (SCALE * plain.var[:, :2] + lasting)[inside], rtol=1e-9
        )
        # Where the edge cuts a box its size is not known, which is not noise.
        assert (wide.var[:, :2] >= SCALE * plain.var[:, :2]).all()


def test_at_the_edge_the_tables_do_not_become_surer():
    found = []
    for scale in (1.0, SCALE):
        config = with_written_variances(load_config("default", CONFIG), scale, 0.0)
        tracker = Tracker(config)
        for k in range(12):  # it drives in from the left; the first boxes are cut
            table = tracker.step((0.05 * k, "rgb", [[0.0, 300.0, 20.0 + 9.0 * k, 60.0]], [0.9]))
        found.append((table, tracker.predict(0.6), tracker.finish()))
    for plain, narrow in zip(*found, strict=True):
        assert len(plain)
        np.testing.assert_array_equal(plain.var[:, 0], narrow.var[:, 0])
        np.testing.assert_allclose(SCALE * plain.var[:, 1], narrow.var[:, 1], rtol=1e-12)


def test_a_prediction_says_it_too_and_its_covariance_has_its_variances(recording):
    detections, _ = recording
    found = []
    for scale, share in ((1.0, 0.0), (SCALE, SHARE)):
        config = with_written_variances(
            load_config("default", (*CONFIG, "smoother.engine=none")), scale, share
        )
        tracker = Tracker(config)
        for k in range(20):
            tracker.step(detections.scan(k))
        found.append(tracker.predict(1.0))
    plain, wide = found
    assert len(plain)
    for one in found:
        np.testing.assert_allclose(np.diagonal(one.cov, axis1=1, axis2=2), one.var, rtol=1e-12)
        np.linalg.cholesky(one.cov)  # raises where one is not positive definite
    np.testing.assert_array_equal(wide.cov[:, 2:, 2:], plain.cov[:, 2:, 2:])
    np.testing.assert_allclose(wide.cov[:, 0, 2], np.sqrt(SCALE) * plain.cov[:, 0, 2], rtol=1e-12)
