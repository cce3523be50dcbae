"""A tracker that was saved and loaded goes on as if nothing had happened, to the last byte."""

from __future__ import annotations

import time

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.repetition import Repetition
from jeat_graph.live.time_base import TimeBase
from jeat_graph.tracking.tracker import Tracker
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.simulate import record

COLUMNS = ("t", "track_id", "boxes", "existence", "mean", "var", "used")
PICTURE = ["image.width=1280", "image.height=720", "input.picture=given"]
OVERRIDES = [*PICTURE, "smoother.lag_s=0.3"]
ENGINES = ("fixed-lag", "full", "gtsam", "none")


@pytest.fixture(scope="module")
def batches():
    return list(record(load_scenario("night"), 5, 1.25).detections.batches())


def assert_equal(one, other, rounding=0.0):
    """Equal to the last byte, or to so many px where GTSAM sums the same in another order."""
    assert len(one) == len(other)
    for name in COLUMNS:
        a, b = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(a, b, rtol=rounding, atol=rounding, err_msg=name)


def run(batches, config, save_at=(), folder=None, resume=False):
    """Causal and smoothed rows of a tracker that is saved at some steps, and there replaced if `resume`."""
    tracker = Tracker(config)
    causal, smoothed = [], []
    for k, batch in enumerate(batches):
        if k in save_at:
            tracker.save(folder / "state.npz")
            if resume:
                tracker = Tracker.load(folder / "state.npz", config)
        causal.append(tracker.step(batch))
        if k % 20 == 0 and config.smoother.engine != "none":
            smoothed.append(tracker.drain_smoothed())
    smoothed.append(tracker.finish())
    return Trajectories.concatenate(causal), Trajectories.concatenate(smoothed)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_loaded_tracker_goes_on_with_the_same_bytes(engine, batches, tmp_path):
    config = load_config("default", [*OVERRIDES, f"smoother.engine={engine}"])
    moments = (0, 1, 17, 60, 61, 100, 141)
    batches = batches[:70] if engine == "gtsam" else batches
    causal, smoothed = run(batches, config, moments, tmp_path)
    again_causal, again_smoothed = run(batches, config, moments, tmp_path, resume=True)
    assert len(causal) > 200
    assert_equal(again_causal, causal)
    assert_equal(again_smoothed, smoothed)
    plain_causal, plain_smoothed = run(batches, config)
    assert_equal(causal, plain_causal)
    assert_equal(smoothed, plain_smoothed, 1e-7 if engine == "gtsam" else 0.0)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_tracker_of_an_empty_road_is_saved_and_goes_on(engine, batches, tmp_path):
    config = load_config("default", [*OVERRIDES, f"smoother.engine={engine}"])
    empty = [[Scan(scan.t, scan.sensor, scan.boxes[:0], scan.scores[:0]) for scan in b] for b in batches]
    # Nobody has come yet; vehicles have come and gone; and nobody ever comes.
    for some in (batches[:20], [*batches[:30], *empty[30:90]], empty[:10]):
        road = [*empty[:3], *some[3:]]
        moments = (0, 2, len(road) - 1)
        again = run(road, config, moments, tmp_path, resume=True)
        for one, other in zip(again, run(road, config, moments, tmp_path), strict=True):
            assert_equal(one, other)


def test_a_live_tracker_is_saved_with_the_scans_that_may_be_taken_again(batches, tmp_path):
    config = load_config("default", OVERRIDES)
    scans = [scan for batch in batches for scan in batch]
    rng = np.random.default_rng(2)
    order = np.argsort([scan.t for scan in scans] + rng.uniform(0.0, 0.2, len(scans)))
    outcomes = []
    for resume in (False, True):
        live = LiveTracker(Tracker(config))
        for k, place in enumerate(order.tolist()):
            if k % 37 == 5:
                live.save(tmp_path / "live.npz", {"taken": k})
                if resume:
                    live, more = LiveTracker.load(tmp_path / "live.npz", config)
                    assert more == {"taken": k}
            live.step(scans[place])
        outcomes.append((live.tracker.causal(), live.finish(), live.lateness.summary()))
    assert_equal(outcomes[0][0], outcomes[1][0])
    assert_equal(outcomes[0][1], outcomes[1][1])
    assert outcomes[0][2] == outcomes[1][2]


@pytest.mark.parametrize("policy", ["rewind", "skip", "refuse"])
@pytest.mark.parametrize("from_the_start", [True, False])
def test_what_comes_again_after_a_restart_is_recognised_and_not_counted_twice(
    policy, from_the_start, batches, tmp_path
):
    config = load_config("default", [*PICTURE, "smoother.engine=none"])
    scans = [scan for batch in batches for scan in batch]
    if policy != "refuse":
        delay = np.random.default_rng(1).uniform(0.0, 0.1, len(scans))
        scans = [scans[k] for k in np.argsort([s.t for s in scans] + delay).tolist()]
    whole = LiveTracker(Tracker(config), policy)
    for scan in scans:
        whole.step(scan)
    live = LiveTracker(Tracker(config), policy)
    for scan in scans[:120]:
        live.step(scan)
    live.save(tmp_path / "live.npz")
    again, _ = LiveTracker.load(tmp_path / "live.npz")
    first = 0 if from_the_start else 100
    arrivals = [again.step(scan) for scan in scans[first:]]
    assert sum(len(one.repeated) for one in arrivals) == 120 - first
    assert again.lateness.summary() == whole.lateness.summary()
    assert_equal(again.tracker.causal(), whole.tracker.causal())


def test_a_tracker_that_was_finished_stays_so(batches, tmp_path):
    tracker = Tracker(load_config("default", OVERRIDES))
    for batch in batches[:20]:
        tracker.step(batch)
    tracker.finish()
    tracker.save(tmp_path / "state.npz")
    loaded = Tracker.load(tmp_path / "state.npz")
    with pytest.raises(JeatGraphError, match="has been finished"):
        loaded.step(batches[20])
    assert len(loaded.finish()) == 0


@pytest.mark.parametrize("policy", ["rewind", "skip"])
def test_a_live_tracker_that_was_finished_takes_no_scans_before_or_after_it_was_saved(
    policy, batches, tmp_path
):
    live = LiveTracker(Tracker(load_config("default", OVERRIDES)), policy)
    for batch in batches[:20]:
        live.step(batch)
    live.finish()
    live.save(tmp_path / "state.npz")
    for one in (live, LiveTracker.load(tmp_path / "state.npz")[0]):
        with pytest.raises(JeatGraphError, match="has been finished"):
            one.step(batches[20])


@pytest.mark.parametrize("late", [False, True])
def test_what_the_last_step_gave_to_the_tracks_is_there_after_loading(late, batches, tmp_path):
    config = load_config("default", [*PICTURE, "smoother.engine=none"])
    tracker = Tracker(config, diagnostics=True)
    live = LiveTracker(tracker) if late else tracker
    for batch in batches[:40]:
        live.step(batch)
    live.save(tmp_path / "state.npz")
    path = tmp_path / "state.npz"
    loaded = LiveTracker.load(path)[0].tracker if late else Tracker.load(path)
    rows, ids, confirmed = tracker.last_measurements()
    again = loaded.last_measurements()
    assert len(rows) > 0
    assert again[0].tobytes() == rows.tobytes()
    np.testing.assert_array_equal(again[1], ids)
    np.testing.assert_array_equal(again[2], confirmed)
    np.testing.assert_array_equal(loaded.last_updates().nis, tracker.last_updates().nis)
    assert_equal(loaded.step(batches[40]), tracker.step(batches[40]))
    assert loaded.last_measurements()[0].tobytes() == tracker.last_measurements()[0].tobytes()


def test_a_live_trackers_file_is_none_for_a_plain_tracker_nor_the_other_way_round(batches, tmp_path):
    """The newest scans are apart in it, and would be missing."""
    path = tmp_path / "state.npz"
    live = LiveTracker(Tracker(load_config("default", PICTURE)))
    for batch in batches[:20]:
        live.step(batch)
    live.save(path)
    with pytest.raises(DataError, match=r"takes late scans.*LiveTracker\.load"):
        Tracker.load(path)
    live.tracker.save(path)
    with pytest.raises(DataError, match="not one that takes late scans"):
        LiveTracker.load(path)
    assert Tracker.load(path).time == live.time


def test_a_file_of_other_settings_or_of_another_version_is_refused_with_a_sentence(tmp_path, monkeypatch):
    path = tmp_path / "state.npz"
    Tracker(load_config("default", PICTURE)).save(path)
    other = load_config("default", [*PICTURE, "smoother.lag_s=7"])
    with pytest.raises(JeatGraphError, match=r"other settings: smoother\.lag_s was .*, not 7"):
        Tracker.load(path, other)
    monkeypatch.setattr("jeat_graph.tracking.checkpoint.__version__", "99.0")
    with pytest.raises(JeatGraphError, match=r"and this is 99\.0"):
        Tracker.load(path)


def test_a_file_that_is_none_is_refused(tmp_path):
    path = tmp_path / "state.npz"
    with pytest.raises(DataError, match="cannot be read"):
        Tracker.load(path)
    path.write_bytes(b"not a tracker")
    with pytest.raises(DataError, match="no saved tracker"):
        Tracker.load(path)
    np.savez(path, text=np.array([{"a": 1}], dtype=object))
    with pytest.raises(DataError, match="no saved tracker"):
        Tracker.load(path)


def crowd(count, steps):
    """Scans of so many vehicles that stay, seen by both sensors at 120 Hz in all."""
    rng = np.random.default_rng(1)
    start = rng.uniform((50, 50), (1100, 600), (count, 2))
    for k in range(steps):
        boxes = np.column_stack([start + 0.1 * k + rng.normal(0, 0.5, (count, 2)), np.full((count, 2), 30.0)])
        yield k / 120.0, "rgb" if k % 6 == 0 else "evt", boxes, np.full(count, 0.9)


@pytest.mark.parametrize("late", [False, True])
def test_a_checkpoint_of_twenty_vehicles_costs_little(late, tmp_path, full, capsys):
    """At every moment: what waits for the smoothers grows and shrinks by packets of steps."""
    tracker = Tracker(load_config("default", PICTURE))
    live = LiveTracker(tracker) if late else tracker
    took, adding, sizes = [], [], []
    for k, scan in enumerate(crowd(20, 460)):
        live.step(scan)
        if k % 32 == 0:
            live.drain_smoothed()  # as a live caller does now and then
        if k >= 380 and k % (1 if full else 5) == 0:
            begin = time.thread_time()
            live.save(tmp_path / "state.npz")
            took.append(time.thread_time() - begin)
            begin = time.thread_time()
            sum(range(100_000))
            adding.append(time.thread_time() - begin)
            sizes.append((tmp_path / "state.npz").stat().st_size)
    with capsys.disabled():
        if full:
            ms = 1e3 * np.quantile(took, (0.0, 0.5))
            print(f"\n{max(sizes) / 1e6:.2f} MB at most, {ms[0]:.1f} ms at least, {ms[1]:.1f} ms median")
    assert len(tracker.causal()) == 20
    # Each update of a track in the last two lags of the smoother, and since it was asked, takes 1,153 bytes.
    assert max(sizes) <= 20 * (2 * 120 + 32) * 1_153 + 200_000
    # 20 ms where Python adds up so many numbers in one; a slower or busier machine gets as much more. With
    # others at work the caches are cold, which arrays feel and a sum does not: the short form allows twice.
    most_s = 0.02 if full else 0.04
    assert min(took) <= most_s * max(1.0, min(adding) / 0.001)


def test_after_a_restart_three_scans_that_never_came_say_that_the_input_is_another():
    def scan(t, left):
        return Scan(t, "rgb", np.array([[left, 100.0, 40.0, 30.0]]), np.array([0.9]))

    before = Repetition(TimeBase(5.0), whole=True)
    before.note([scan(0.05 * k, 100.0 + k) for k in range(21)])
    again = Repetition(TimeBase(5.0), whole=False)
    again.set_state(before.state(), 1.0)
    known = scan(0.05, 101.0)
    assert again.sort([known], [known], lambda _: True) == ([known], [], [])
    strange = [[scan(0.3 + 0.05 * k, 900.0)] for k in range(4)]
    sorted_ = [again.sort(scans, scans, lambda _: True) for scans in strange]
    assert [[len(one) for one in lists] for lists in sorted_] == [[0, 1, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]]
