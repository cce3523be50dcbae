"""What holds whatever the detectors say: arbitrary scans, sane or not. `make fuzz` tries more of them."""

import os

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jeat_graph import Tracker, load_config
from jeat_graph.data.boxes import LARGEST_PX, SMALLEST_PX
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError, TimeOrderError, UnknownSensorError
from jeat_graph.tracking.whole import track

PRESETS = ("default", "paper")
# Most of this is about the filter; one test below lets the presets' smoothers run as well.
PUBLISHED = {name: load_config(name) for name in PRESETS}
CONFIGS = {name: load_config(name, ["smoother.engine=none"]) for name in PRESETS}
# Whatever is drawn may look like a mistake, and be warned of.
pytestmark = pytest.mark.filterwarnings("ignore::jeat_graph.data.errors.InputWarning")
SENSORS = ("evt", "rgb")
TIMES = 10 if os.environ.get("JEAT_GRAPH_FULL", "") not in ("", "0") else 1

# Steps of time from none at all to eleven days, and boxes from a hair to a planet, near each other or far.
STEP = st.sampled_from([0.0, 0.0, 1e-6, 0.01, 0.01, 0.05, 0.05, 0.3, 5.0, 299.0, 1e6])
NEAR = st.tuples(st.floats(0, 60), st.floats(0, 60), st.floats(5, 60), st.floats(5, 60))
WILD = st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.floats(1e-6, 1e6))
BOX = st.one_of(NEAR, NEAR, st.just((10.0, 10.0, 30.0, 20.0)), WILD)
DETECTION = st.tuples(BOX, st.one_of(st.floats(0, 1), st.sampled_from([0.0, 1.0])))
SCAN = st.tuples(st.sampled_from(SENSORS), st.lists(DETECTION, max_size=5))


@st.composite
def recordings(draw):
    """Lists of batches (t, [Scan, …]) in time order, with empty scans, duplicates and repeated times."""
    t, out = draw(st.sampled_from([0.0, -5.0, 1.7e9])), []
    # A vehicle that stands there for long enough to be confirmed, so that what follows meets a track.
    for _ in range(draw(st.sampled_from([0, 0, 8, 20]))):
        t += 0.05
        out.append([Scan(t, "rgb", [[10.0, 10.0, 30.0, 20.0]], [0.95])])
    for step, scans in draw(st.lists(st.tuples(STEP, st.lists(SCAN, min_size=1, max_size=2)), max_size=15)):
        t += step
        out.append(
            [
                Scan(t, sensor, np.array([d[0] for d in found]).reshape(-1, 4), [d[1] for d in found])
                for sensor, found in scans
            ]
        )
    return out


def positive_definite(cov):
    """Whether blocks (…, D, D) are symmetric positive definite; judged as correlations, free of units."""
    if cov.size == 0:
        return True
    spread = np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))
    if not (np.isfinite(cov).all() and (spread > 0).all()):
        return False
    correlation = cov / (spread[..., :, None] * spread[..., None, :])
    return np.array_equal(cov, np.swapaxes(cov, -1, -2)) and np.linalg.eigvalsh(correlation).min() > -1e-9


@pytest.mark.parametrize("examples", [30, pytest.param(100 * TIMES, marks=pytest.mark.slow)])
@pytest.mark.parametrize("preset", PRESETS)
def test_any_scans_give_finite_tables_and_sane_states(preset, examples):
    @given(recording=recordings())
    @settings(max_examples=examples, suppress_health_check=[HealthCheck.too_slow])
    def holds(recording):
        born, rows = assert_sane(CONFIGS[preset], recording)
        seen["born"] += born
        seen["rows"] += rows

    seen = {"born": 0, "rows": 0}
    holds()
    # All of it would hold for a tracker that never reports anything. How many rows there are depends on the
    # recordings, and which are drawn on the version of Hypothesis.
    assert seen["born"] > 0
    assert seen["rows"] > 0


def assert_sane(config, recording):
    """Number of tracks born and of rows reported, after every state and table has been looked at."""
    tracker, reported = Tracker(config), 0
    seen, newest = set(), 0
    for batch in recording:
        table = tracker.step(batch)
        reported += len(table)
        for column in (table.boxes, table.mean, table.var, table.existence):
            assert np.isfinite(column).all()
        assert (table.boxes[:, 2:] >= 0).all()
        assert ((table.existence >= 0) & (table.existence <= 1)).all()
        assert (table.t == batch[0].t).all()

        assert (table.var > 0).all()
        ids, _ = tracker.living()
        ids = ids.tolist()
        assert ids == sorted(set(ids)), "identities ascend and are unique"
        assert all(i in seen or i > newest for i in ids), "an identity came back"
        seen, newest = set(ids), max([newest, *ids])
        if config.tracker.engine == "core":
            columns = tracker._model.tracks()
            assert positive_definite(columns["covariance"].reshape(-1, 2, 7, 7))
            presence = columns["presence"]
            assert ((presence >= 0) & (presence <= 1)).all()
            assert np.isfinite(columns["log_odds"]).all()
    assert tracker.num_born >= newest
    return tracker.num_born, reported


@pytest.mark.parametrize("preset", PRESETS)
@given(recording=recordings())
@settings(max_examples=25 * TIMES, suppress_health_check=[HealthCheck.too_slow])
def test_the_same_input_gives_the_same_bytes(preset, recording):
    detections = Detections.from_scans([scan for batch in recording for scan in batch])
    first, second = (track(CONFIGS[preset], detections) for _ in range(2))
    for name in ("t", "track_id", "boxes", "existence", "mean", "var", "used"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


@pytest.mark.parametrize("preset", PRESETS)
@given(recording=recordings())
@settings(max_examples=25 * TIMES, suppress_health_check=[HealthCheck.too_slow])
def test_the_presets_smoothers_take_any_scans_too(preset, recording):
    tracker = Tracker(PUBLISHED[preset])
    reported = set()
    for batch in recording:
        reported |= set(tracker.step(batch).track_id.tolist())
    table = tracker.finish()
    for column in (table.boxes, table.mean, table.var, table.existence):
        assert np.isfinite(column).all()
    assert (table.var > 0).all()
    assert ((table.existence >= 0) & (table.existence <= 1)).all()
    assert len(set(zip(table.track_id.tolist(), table.t.tolist(), strict=True))) == len(table), "a row twice"
    if recording:
        assert (table.t >= recording[0][0].t).all()
        assert (table.t <= recording[-1][0].t).all()
    # A table of a certain rate may pass over a track that lived between two of its rows, but it invents none.
    assert set(table.track_id.tolist()) <= set(range(1, tracker.num_born + 1))
    assert reported <= set(range(1, tracker.num_born + 1))


@pytest.mark.parametrize("epoch", [0.0, 2001000.46, 1.7e9])
def test_scans_a_microsecond_apart_reach_the_smoother_at_any_epoch(epoch):
    tracker, t = Tracker(load_config("default")), epoch
    for k in range(60):
        t += 0.01 if k % 3 else 1e-6
        tracker.step((t, "rgb", [[100, 100, 40, 30]], [0.95]))
    table = tracker.finish()
    assert len(table) > 0
    assert np.allclose(table.mean[:, :2], [120, 115], atol=0.1)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # powers of a thousand million seconds overflow
@pytest.mark.parametrize("preset", PRESETS)
def test_one_batch_of_the_largest_and_smallest_numbers_does_no_harm(preset):
    tracker = Tracker(CONFIGS[preset])
    big, small = LARGEST_PX, SMALLEST_PX
    for t in (-1e308, 0.0, 0.05, 0.1, 1e9, 1e60, 1e120, 1e300, 1.7e308):
        wild = [[-big, 0, 1, 1], [0, 0, big, big], [0, 0, small, small], [5, 5, 20, 20]]
        table = tracker.step((t, "rgb", wild, [1.0, 0.5, 0.2, 0.9]))
        assert np.isfinite(table.mean).all()
        assert np.isfinite(table.var).all()
        assert np.isfinite(table.boxes).all()


@pytest.mark.parametrize("preset", PRESETS)
def test_after_minutes_without_any_scan_all_vehicles_are_new_ones(preset):
    tracker = Tracker(CONFIGS[preset])
    for k in range(30):
        before = tracker.step((0.05 * k, "rgb", [[100, 100, 40, 30]], [0.95]))
    for k in range(30):
        after = tracker.step((3600.0 + 0.05 * k, "rgb", [[100, 100, 40, 30]], [0.95]))
    assert len(before) == len(after) == 1
    assert after.track_id[0] > before.track_id[0]


REFUSED = {
    "a sensor that is not declared": ((1.0, "rbg", [[0, 0, 9, 9]], [0.5]), UnknownSensorError, "rgb"),
    "a time before the last": ((0.4, "rgb", [[0, 0, 9, 9]], [0.5]), TimeOrderError, "older"),
    "a time that is no number": ((np.nan, "rgb", [[0, 0, 9, 9]], [0.5]), DataError, "finite"),
    "a box that is no number": ((1.0, "rgb", [[np.nan, 0, 9, 9]], [0.5]), DataError, "finite"),
    "a box without size": ((1.0, "rgb", [[0, 0, 0, 9]], [0.5]), DataError, "positive"),
    "a score above one": ((1.0, "rgb", [[0, 0, 9, 9]], [1.5]), DataError, "score"),
    "scores of another number": ((1.0, "rgb", [[0, 0, 9, 9]], [0.5, 0.5]), DataError, "shape"),
    "scans of two times": ([(1.0, "rgb", [], []), (1.1, "evt", [], [])], TimeOrderError, "one and the same"),
    "a good scan beside a bad one": ([(1.0, "rgb", [], []), (1.0, "cam", [], [])], UnknownSensorError, "cam"),
}


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("what", REFUSED)
def test_a_refused_scan_leaves_the_state_as_it_was(preset, what):
    scan, error, words = REFUSED[what]
    declared = load_config(
        preset,
        [
            "smoother.engine=none",
            "input.undeclared=refuse",
            "sensors.rgb.rate_hz=20",
            "sensors.evt.rate_hz=100",
        ],
    )
    tracker, untouched = Tracker(declared), Tracker(declared)
    for k in range(11):
        scan_before = (0.05 * k, "rgb", [[100 + k, 100, 40, 30], [300, 200, 40, 30]], [0.9, 0.8])
        tracker.step(scan_before)
        untouched.step(scan_before)
    with pytest.raises(error, match=words):
        tracker.step(scan)
    assert tracker.time == pytest.approx(0.5)
    after, expected = (one.step((0.55, "rgb", [[111, 100, 40, 30]], [0.9])) for one in (tracker, untouched))
    for name in ("track_id", "boxes", "mean", "var", "existence"):
        np.testing.assert_array_equal(getattr(after, name), getattr(expected, name))


@pytest.mark.parametrize("nonsense", [3, None, [], "scan"])
def test_what_is_no_scan_at_all_is_refused(nonsense):
    with pytest.raises(DataError, match="step"):
        Tracker(CONFIGS["default"]).step(nonsense)


@pytest.mark.parametrize("preset", PRESETS)
def test_scans_of_one_time_may_come_in_calls_of_their_own(preset):
    tracker = Tracker(CONFIGS[preset])
    for k in range(40):
        box = [[100 + 2.0 * k, 100, 40, 30]]
        tracker.step((0.05 * k, "rgb", box, [0.9]))
        table = tracker.step((0.05 * k, "evt", box, [0.9]))
    assert tracker.num_tracks == 1
    assert len(table) == 1
    assert table.mean[0, 2] == pytest.approx(40.0, abs=4.0)  # 2 px in 0.05 s


@pytest.mark.parametrize("preset", PRESETS)
def test_the_order_of_scans_in_a_batch_does_not_matter(preset, scene):
    tables = []
    for direction in (1, -1):
        tracker = Tracker(CONFIGS[preset])
        for t, scans in scene(3, duration=1.0):
            table = tracker.step([(t, *scan) for scan in scans[::direction]])
        tables.append(table)
    assert len(tables[0]) > 0
    assert np.allclose(tables[0].mean, tables[1].mean, atol=1e-6)


def test_the_paper_keeps_two_tracks_on_a_vehicle_that_two_sensors_see_and_the_default_one():
    box = ([[100, 100, 40, 30]], [0.95])
    reported = {}
    for preset in PRESETS:
        tracker = Tracker(CONFIGS[preset])
        for k in range(30):
            table = tracker.step([(0.05 * k, "rgb", *box), (0.05 * k, "evt", *box)])
        reported[preset] = len(table)
    assert reported == {"paper": 2, "default": 1}


def test_the_table_says_which_sensors_were_used():
    tracker = Tracker(CONFIGS["default"])
    box = ([[100, 100, 40, 30]], [0.95])
    for k in range(30):
        both = tracker.step([(0.05 * k, "rgb", *box), (0.05 * k, "evt", *box)])
    assert both.sensor_text() == ["evt|rgb"]
    assert tracker.step((1.5, "rgb", *box)).sensor_text() == ["rgb"]
    assert tracker.step((1.51, "evt", [], [])).sensor_text() == [""]
