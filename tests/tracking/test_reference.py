"""The model as a tracker: what its user sees, cut boxes, and what must not change its answers."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jeat_graph import Tracker, Trajectories, load_config
from jeat_graph.data.errors import ConfigError, DataError, JeatGraphError, TimeOrderError
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.model_tracker import ModelTracker

IMAGE = (1920, 1080)
ENGINE = "core"  # of the test that runs


@pytest.fixture(autouse=True, params=["core", "reference"])
def _engine(request, monkeypatch):
    """Every test here is of both engines: they are one model."""
    monkeypatch.setattr(sys.modules[__name__], "ENGINE", request.param)


def tracker(**settings):
    return Tracker(engine=ENGINE, image=IMAGE, **settings)


def covariances(made):
    """Covariances (N, 2, 7, 7) of the living tracks."""
    model = made._model
    state = model.tracks()["covariance"] if ENGINE == "core" else model._state.tracks.covariance
    return state.reshape(-1, 2, 7, 7)


def scene(seed=0, times=50, period=0.1, vehicles=4):
    """Scans of two sensors at the same times: vehicles, boxes with noise, clutter, misses."""
    rng = np.random.default_rng(seed)
    start, velocity = rng.uniform(300, 1500, (vehicles, 2)) * [1.0, 0.5], rng.uniform(-60, 60, (vehicles, 2))
    batches = []
    for k in range(times):
        t, batch = k * period, []
        for sensor, noise in (("a", 2.0), ("b", 5.0)):
            seen = rng.random(vehicles) < 0.85
            centre = (start + velocity * t + rng.normal(0, noise, (vehicles, 2)))[seen]
            size = np.array([90.0, 60.0]) + rng.normal(0, noise, (len(centre), 2))
            stray = np.concatenate([rng.uniform(0, 900, (1, 2)), [[40.0, 40.0]]], axis=1)
            boxes = np.concatenate([np.concatenate([centre - size / 2, size], axis=1), stray])
            scores = np.append(rng.uniform(0.6, 0.95, len(centre)), 0.2)
            batch.append((t, sensor, boxes, scores))
        batches.append(batch)
    return batches


def run(batches, **settings):
    made = tracker(**settings)
    return made, [made.step(batch) for batch in batches]


def assert_same(one, other, map_boxes=lambda b: b, atol=1e-5):
    """Assert that two runs report the same tracks with the same boxes and the same posterior."""
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.track_id, b.track_id)
        np.testing.assert_allclose(map_boxes(a.boxes), b.boxes, atol=atol)
        np.testing.assert_allclose(a.existence, b.existence, atol=1e-7)


# What a user sees.


def test_any_sensor_is_tracked_and_named():
    made = tracker()
    for k in range(10):
        table = made.step((0.05 * k, "cam7", [[100 + 3 * k, 100, 40, 30]], [0.9]))
    assert isinstance(table, Trajectories)
    assert table.sensor_text() == ["cam7"]
    np.testing.assert_allclose(table.boxes, [[127, 100, 40, 30]], atol=1.0)
    np.testing.assert_allclose(table.mean[0, 2:4], [60.0, 0.0], atol=5.0)
    assert (table.var > 0).all()
    assert (table.size_var > 0).all()
    assert 0.5 < table.existence[0] < 1.0


def test_it_takes_a_preset_a_configuration_and_a_size_as_text():
    for config in ("default", load_config("default")):
        made = Tracker(config, engine=ENGINE, image="640x480")
        assert isinstance(made, ModelTracker)
        assert made.time is None
        assert made.num_tracks == made.num_born == 0


def test_update_takes_boxes_as_detectors_give_them():
    made = tracker()
    table = made.update(np.array([[10.0, 10.0, 50.0, 40.0]]), t=0.0, sensor="rgb", scores=[0.99])
    assert made.num_tracks == 1
    assert len(table) <= 1
    assert len(made.update(np.zeros((0, 4)), t=0.04, sensor="rgb")) <= 1


def test_classes_survive():
    made = tracker()
    for k in range(8):
        table = made.step((0.1 * k, "rgb", [[100, 100, 40, 30]], [0.9], ["van"]))
    assert table.classes is not None
    assert table.classes.tolist() == ["van"]
    smoothed = made.finish()
    assert set(smoothed.classes.tolist()) == {"van"}


def test_an_unknown_engine_is_named():
    with pytest.raises(ConfigError, match=r"engine: 'fast' is not one of core, reference, paper"):
        Tracker(engine="fast")


def test_embeddings_are_taken():
    made = tracker()
    made.update([[0, 0, 4, 4]], t=0.0, sensor="rgb", embeddings=[[1.0, 0.0]])
    with pytest.raises(DataError, match="2 numbers as those before"):
        made.update([[0, 0, 4, 4]], t=0.1, sensor="rgb", embeddings=[[1.0, 0.0, 0.0]])
    assert made.time == 0.0


def test_late_scans_go_where_they_belong():
    live = LiveTracker(tracker())
    for t in (0.0, 0.1, 0.05):
        live.step((t, "rgb", [[100, 100, 40, 40]], [0.5]))
    assert live.replayed == 1
    assert live.tracker.num_tracks == 1


def test_time_goes_forward_and_ends():
    made = tracker()
    made.step((1.0, "rgb", np.zeros((0, 4)), []))
    with pytest.raises(TimeOrderError, match="older than the last one"):
        made.step((0.5, "rgb", np.zeros((0, 4)), []))
    made.finish()
    assert len(made.finish()) == 0
    with pytest.raises(JeatGraphError, match="finished"):
        made.step((2.0, "rgb", np.zeros((0, 4)), []))


def test_a_refused_step_changes_nothing():
    made = tracker()
    with pytest.raises(DataError):
        made.step((0.0, "rgb", [[0, 0, -4, 4]], [0.5]))
    assert made.num_born == 0
    assert made.time is None


def test_without_a_smoother_there_is_nothing_smoothed():
    made = Tracker(load_config("default", ["smoother.engine=none"]), engine=ENGINE)
    with pytest.raises(JeatGraphError, match="no smoother"):
        made.smoothed()


def test_scans_of_one_sensor_at_one_time_are_one():
    boxes, scores = np.array([[100.0, 100, 40, 30], [400, 100, 40, 30]]), np.array([0.9, 0.8])
    one, two = tracker(), tracker()
    for k in range(5):
        a = one.step((0.1 * k, "x", boxes, scores))
        b = two.step([(0.1 * k, "x", boxes[:1], scores[:1]), (0.1 * k, "x", boxes[1:], scores[1:])])
    assert_same([a], [b])


# Smoothed trajectories.


def test_smoothed_rows_are_nearer_to_the_truth_and_surer():
    made, tables = run(scene(seed=5, vehicles=1, times=80))
    smoothed = made.finish()
    rng = np.random.default_rng(5)
    start, velocity = rng.uniform(300, 1500, (1, 2)) * [1.0, 0.5], rng.uniform(-60, 60, (1, 2))
    causal = Trajectories.concatenate(tables[5:])
    rows = smoothed.take(smoothed.t >= causal.t[0])

    def error(table):
        return np.sqrt(np.mean((table.mean[:, :2] - start - velocity * table.t[:, None]) ** 2))

    assert len(np.unique(rows.track_id)) == 1
    assert error(rows) < error(causal)
    assert rows.var[:, :4].mean() < causal.var[:, :4].mean()
    assert (np.diff(smoothed.t) >= 0).all()


def test_smoothing_changes_no_causal_table_and_may_be_asked_for_at_any_time():
    batches = scene(times=20)
    asked, quiet = tracker(), tracker()
    for batch in batches:
        a, b = asked.step(batch), quiet.step(batch)
        asked.smoothed()
        assert_same([a], [b], atol=0.0)


# Partial occlusion.


CUTS = [
    pytest.param(side, share, id=f"{name}-{share}")
    for side, name in enumerate(("left", "top", "right", "bottom"))
    for share in (0.6, 0.5, 0.4, 0.3)
]


@pytest.mark.parametrize(("side", "left_over"), CUTS)
def test_a_vehicle_whose_box_is_cut_for_a_second_keeps_its_track(side, left_over):
    rng = np.random.default_rng(1)
    made, ids = tracker(), set()
    for k in range(125):
        t = 0.04 * k
        box = np.array([100.0 + 170.0 * t, 400.0, 210.0 + 170.0 * t, 470.0]) + rng.normal(0, 1.5, 4)
        if 2.0 <= t < 3.0:
            extent = box[2 + side % 2] - box[side % 2]
            box[side] += (1.0 if side < 2 else -1.0) * (1.0 - left_over) * extent
        table = made.step((t, "rgb", [[*box[:2], *(box[2:] - box[:2])]], [rng.uniform(0.7, 0.95)]))
        assert len(table) <= 1, t
        ids |= set(table.track_id.tolist())
    assert len(ids) == 1


@pytest.mark.parametrize("rate_hz", [10.0, 20.0, 100.0])
@pytest.mark.parametrize("speed", [40.0, 120.0])
def test_a_vehicle_that_nobody_sees_for_two_seconds_keeps_its_identity_if_it_goes_straight_on(rate_hz, speed):
    rng = np.random.default_rng(2)
    made, ids = tracker(), set()
    for k in range(int(10 * rate_hz)):
        t = k / rate_hz
        hidden = 5.0 <= t < 7.0
        found = [
            [100.0 + speed * t + rng.normal(0, 1.5), y + rng.normal(0, 1.5), 60.0, 40.0]
            for y in (100.0, 400.0)
            if not (hidden and y == 100.0)
        ]
        table = made.step((t, "rgb", found, rng.uniform(0.6, 0.95, len(found))))
        ids |= set(table.track_id.tolist())
        # It is no longer reported where it is not seen, and reported again at once.
        if t >= 2.0 and not 5.0 <= t < 7.3:
            assert len(table) == 2, t
        if 6.0 <= t < 6.9:
            assert len(table) == 1, t
    assert ids == {1, 2}


# What must change nothing.


@pytest.mark.parametrize("overlaps", [True, False])
def test_a_poor_box_upon_a_better_one_keeps_no_track_reported(overlaps):
    """Two vehicles are seen well; then one has poor boxes, of use only where no better one covers them."""
    config = load_config("default", ["sensors.rgb.even_score=0.5"])
    made = Tracker(config, engine=ENGINE, image=IMAGE)
    told = []
    for k in range(60):
        t, late = 0.05 * k, k >= 40
        x = 700.0 - (60.0 if overlaps else 0.0) * t
        boxes = np.array([[500.0, 400.0, 100.0, 60.0], [x, 410.0, 90.0, 60.0]])
        told.append(len(made.step([(t, "rgb", boxes, np.array([0.9, 0.22 if late else 0.9]))])))
    assert min(told[10:40]) == 2
    assert told[-1] == (1 if overlaps else 2)
    smoothed = made.finish()
    assert int((smoothed.t > 2.82).sum()) == (3 if overlaps else 6)


def test_a_vehicle_that_stands_has_rows_at_the_times_of_the_sensor_that_does_not_see_it():
    made, causal = tracker(), {}
    times = {round(0.02 * k, 6): "evt" for k in range(200)} | {
        round(0.05 * k + 0.003, 6): "rgb" for k in range(80)
    }
    for t in sorted(times):
        moving = [[500.0 + 80.0 * min(t, 1.5), 400.0, 100.0, 60.0], [900.0 - 70.0 * t, 600.0, 90.0, 60.0]]
        seen = moving[1:] if times[t] == "evt" and t > 1.5 else moving
        causal[t] = len(made.step([(t, times[t], np.array(seen), np.full(len(seen), 0.8))]))
    late = [t for t in sorted(times) if 2.5 < t < 3.9]
    assert [causal[t] for t in late] == [2] * len(late)
    smoothed = made.finish()
    assert [int((np.abs(smoothed.t - t) < 1e-6).sum()) for t in late] == [2] * len(late)


def test_names_of_sensors_and_their_order_mean_nothing():
    batches = scene()
    _, base = run(batches)
    renamed = [[(t, {"a": "zebra", "b": "rgb"}[s], b, z) for t, s, b, z in batch] for batch in batches]
    _, other = run(renamed)
    assert_same(base, other)
    _, permuted = run([batch[::-1] for batch in batches])
    assert_same(base, permuted)


def test_a_mirrored_picture_gives_mirrored_tracks():
    batches = scene()

    def mirrored(boxes):
        boxes = np.asarray(boxes).copy()
        boxes[:, 0] = IMAGE[0] - boxes[:, 0] - boxes[:, 2]
        return boxes

    _, base = run(batches)
    _, other = run([[(t, s, mirrored(b), z) for t, s, b, z in batch] for batch in batches])
    assert_same(base, other, mirrored)


def test_the_clocks_origin_means_nothing():
    batches = scene(period=0.125)  # such times, and this shift, have no rounding
    _, base = run(batches)
    _, other = run([[(t + 2.0**20, s, b, z) for t, s, b, z in batch] for batch in batches])
    assert_same(base, other, atol=0.0)


def test_twice_the_same_input_gives_the_same_bytes():
    made, base = run(scene())
    again, other = run(scene())
    assert_same(base, other, atol=0.0)
    assert made.finish().mean.tobytes() == again.finish().mean.tobytes()


@pytest.mark.filterwarnings("ignore::jeat_graph.data.errors.InputWarning")  # whatever comes may look wrong
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 1000),
    gaps=st.lists(st.sampled_from([0.0, 1e-4, 0.02, 0.3, 2.0, 50.0]), min_size=5, max_size=20),
)
def test_covariances_stay_positive_definite_whatever_comes(seed, gaps):
    rng = np.random.default_rng(seed)
    made, t = tracker(), 0.0
    for gap in gaps:
        t += gap
        count = int(rng.integers(0, 5))
        boxes = np.concatenate(
            [rng.uniform(-50, 1900, (count, 2)), rng.uniform(0.5, 400, (count, 2))], axis=1
        )
        boxes[: count // 2, :2] = 100.0
        table = made.step((t, rng.choice(["a", "b"]), boxes, rng.random(count)))
        covariance = covariances(made)
        scale = np.sqrt(np.diagonal(covariance, axis1=2, axis2=3))
        unit = covariance / (scale[..., :, None] * scale[..., None, :])
        assert np.isfinite(table.mean).all()
        assert not len(unit) or np.linalg.eigvalsh(unit).min() > -1e-9
        assert ((table.existence >= 0) & (table.existence <= 1)).all()
    smoothed = made.finish()
    assert np.isfinite(smoothed.mean).all()
    assert not len(smoothed) or smoothed.var.min() > 0.0


# Detectors that differ.


@pytest.mark.parametrize("wider", [1.25, 0.8])
def test_what_the_boxes_of_two_detectors_differ_by_is_learnt(wider):
    """One draws its boxes a quarter wider, or narrower: tracks do not breathe from scan to scan."""
    made = tracker()
    rng = np.random.default_rng(1)
    breath = []
    for k in range(100):
        left = np.array([100.0, 500.0, 900.0, 1300.0]) + 2.0 * k
        boxes = np.stack([left, np.full(4, 300.0), np.full(4, 80.0), np.full(4, 60.0)], axis=1)
        other = boxes.copy()
        other[:, 0] += (1.0 - wider) * 40.0
        other[:, 2] *= wider
        noise = rng.normal(0.0, 1.0, (2, 4, 4))
        one = made.step((0.1 * k, "one", boxes + noise[0], [0.9] * 4))
        two = made.step((0.1 * k + 0.005, "two", other + noise[1], [0.9] * 4))
        breath.append(np.mean(two.boxes[:, 2] - one.boxes[:, 2]) if len(one) == len(two) == 4 else np.nan)
    assert made.num_tracks == made.num_born == 4
    assert abs(np.nanmean(breath[50:])) < 0.01 * 80.0


# The edge of the picture.


def leaving(beyond, times=40):
    """A vehicle that leaves the picture on the right; its detector's boxes end there, or reach beyond."""
    width, batches = float(IMAGE[0]), []
    for k in range(times):
        left, right = width - 400.0 + 12.0 * k, width - 280.0 + 12.0 * k
        right = right if beyond else min(right, width)
        if min(right, width) - left < 12.0:
            break
        batches.append([(0.1 * k, "cam", [[left, 300.0, right - left, 80.0]], [0.95])])
    return batches


def test_a_vehicle_that_leaves_the_picture_keeps_one_identity_and_ends_at_the_edge():
    batches = leaving(beyond=False)
    _, tables = run(batches)
    assert {int(i) for table in tables[1:] for i in table.track_id} == {1}
    for batch, table in zip(batches[5:], tables[5:], strict=True):
        np.testing.assert_allclose(table.boxes[0], batch[0][2][0], atol=6.0)
    # The centre goes on, beyond the middle of the part that shows.
    box = tables[-1].boxes[0]
    assert tables[-1].mean[0, 0] > box[0] + box[2] / 2.0 + 30.0


def test_boxes_that_reach_beyond_the_picture_are_written_as_they_are():
    _, tables = run(leaving(beyond=True))
    far = [table.boxes[0, 0] + table.boxes[0, 2] for table in tables if len(table)]
    assert far[-1] > IMAGE[0] + 30.0
