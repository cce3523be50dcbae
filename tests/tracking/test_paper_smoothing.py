"""The smoothed tables of the engine `paper`: what each engine of `smoother.engine` gives, and when."""

from functools import cache

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.data.errors import InputWarning, JeatGraphError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.smoothers.gtsam.solvers import GtsamError, LagChain


@cache
def run(scene, engine, *settings, drain=None, **arguments):
    """Track a scene; returns the tracker, its causal tables, the smoothed rows in the order they came."""
    tracker = Tracker(load_config("paper", [f"smoother.engine={engine}", *settings]))
    causal, rows = [], []
    for k, (t, scans) in enumerate(scene(**arguments)):
        causal.append(tracker.step([(t, *scan) for scan in scans]))
        if drain and k % drain == 0:
            rows.append(tracker.drain_smoothed())
    rows.append(tracker.finish())
    return tracker, Trajectories.concatenate(causal), Trajectories.concatenate(rows)


def same(one, other, position=1e-6):
    assert np.array_equal(one.t, other.t)
    assert np.array_equal(one.track_id, other.track_id)
    assert np.array_equal(one.used, other.used)
    units = np.array([1, 1, 20, 20, 400, 400])
    assert np.abs((one.mean - other.mean) / units).max() < position
    assert np.allclose(one.var, other.var, rtol=1e-6)
    assert np.allclose(one.size_var, other.size_var, rtol=1e-6)


SCENE = {"seed": 3, "duration": 2.5, "vehicles": 8}


@pytest.mark.parametrize("engine", ["full", "gtsam-full"])
def test_a_lag_as_long_as_the_recording_is_the_whole_track(scene, engine):
    _, _, whole = run(scene, engine, **SCENE)
    for lagged in ("fixed-lag", "gtsam"):
        _, _, rows = run(scene, lagged, "smoother.lag_s=100", **SCENE)
        same(rows, whole)


def test_gtsam_with_a_lag_is_our_own_pass_with_that_lag(scene):
    for lag in (0.01, 0.3):
        _, _, gtsam = run(scene, "gtsam", f"smoother.lag_s={lag}", **SCENE)
        _, _, own = run(scene, "fixed-lag", f"smoother.lag_s={lag}", **SCENE)
        same(gtsam, own)


def test_a_longer_lag_is_nearer_to_the_whole_track(scene):
    _, _, whole = run(scene, "full", **SCENE)
    apart = []
    for lag in (0.05, 0.3, 1.0):
        _, _, rows = run(scene, "fixed-lag", f"smoother.lag_s={lag}", **SCENE)
        # Tracks that end within a short lag before they are confirmed have no rows by it.
        there = {key: k for k, key in enumerate(zip(whole.t, whole.track_id, strict=True))}
        common = [there[key] for key in zip(rows.t, rows.track_id, strict=True)]
        assert len(common) > 0.99 * len(whole)
        apart.append(np.abs(rows.mean[:, :2] - whole.mean[common, :2]).mean())
    assert apart[0] > 2 * apart[1] > 4 * apart[2]


@pytest.mark.parametrize("engine", ["fixed-lag", "gtsam", "full", "gtsam-full"])
def test_a_track_has_a_row_at_each_step_from_its_first_to_its_last_detection(scene, engine):
    _, causal, rows = run(scene, engine, **SCENE)
    assert set(rows.track_id) == set(causal.track_id)
    times = np.array([t for t, _ in scene(**SCENE)])
    for identity in np.unique(rows.track_id):
        mine = rows.take(rows.track_id == identity)
        assert np.array_equal(mine.t, times[(times >= mine.t[0]) & (times <= mine.t[-1])])
        assert mine.used[0] != 0
        assert mine.used[-1] != 0
        seen = causal.take((causal.track_id == identity) & (causal.used != 0))
        assert mine.t[-1] == seen.t[-1]
    assert (rows.existence == 1.0).all()


def test_the_last_state_is_the_filters(scene):
    _, causal, rows = run(scene, "full", **SCENE)
    for identity in np.unique(rows.track_id):
        last = rows.take(rows.track_id == identity).take([-1])
        here = causal.take((causal.track_id == identity) & (causal.t == last.t[0]))
        assert np.allclose(last.mean, here.mean, atol=1e-6)
        assert np.allclose(last.var, here.var)
        assert np.allclose(last.boxes, here.boxes, atol=1e-6)


@pytest.mark.parametrize("engine", ["fixed-lag", "full"])
def test_what_is_drained_is_all_there_is(scene, engine):
    _, _, at_once = run(scene, engine, **SCENE)
    _, _, parts = run(scene, engine, drain=7, **SCENE)
    same(parts.take(np.lexsort((parts.track_id, parts.t))), at_once, 1e-9)


def test_with_a_lag_rows_come_while_the_tracks_live(scene):
    tracker = Tracker(load_config("paper", ["smoother.engine=fixed-lag", "smoother.lag_s=0.3"]))
    for t, scans in scene(**SCENE):
        tracker.step([(t, *scan) for scan in scans])
    rows = tracker.drain_smoothed()
    assert rows.t.max() > 1.0
    assert t - 0.3 >= rows.t.max()


def test_all_so_far_is_what_the_end_would_give(scene):
    tracker = Tracker(load_config("paper", ["smoother.engine=full"]))
    for t, scans in scene(**SCENE):
        tracker.step([(t, *scan) for scan in scans])
    same(tracker.smoothed(), tracker.finish(), 1e-9)
    assert len(tracker.finish()) == 0
    with pytest.raises(JeatGraphError, match="finished"):
        tracker.step((99.0, "rgb", [], []))


def in_two_steps(scene, engine):
    """Smoothed rows where each scan is a step of its own, also of one time."""
    tracker = Tracker(load_config("paper", [f"smoother.engine={engine}"]))
    for t, scans in scene(**SCENE):
        for scan in scans:
            tracker.step((t, *scan))
    return tracker.finish()


@pytest.mark.parametrize("engine", ["full", "gtsam-full"])
def test_scans_of_one_time_in_two_steps_give_one_row(scene, engine):
    rows = in_two_steps(scene, engine)
    for identity in np.unique(rows.track_id):
        assert (np.diff(rows.t[rows.track_id == identity]) > 0).all()


@pytest.mark.xfail(strict=True, reason="docs/limits.md: GTSAM and scans of one time in steps of their own")
def test_scans_of_one_time_in_two_steps_share_a_state(scene):
    same(in_two_steps(scene, "gtsam-full"), in_two_steps(scene, "full"))


def test_an_output_rate_keeps_the_first_row_of_each_interval(scene):
    _, _, every = run(scene, "full", **SCENE)
    _, _, some = run(scene, "full", "smoother.output_rate_hz=10", **SCENE)
    times = np.array([t for t, _ in scene(**SCENE)])
    wanted = times[np.unique(np.floor(times * 10 + 1e-9), return_index=True)[1]]
    same(some, every.take(np.isin(every.t, wanted)), 1e-9)


def test_where_gtsam_fails_our_own_pass_goes_on_and_says_so(scene, monkeypatch):
    _, _, expected = run(scene, "fixed-lag", **SCENE)
    extend, calls = LagChain.extend, []

    def fails(chain, window):
        calls.append(0)
        if len(calls) % 5 == 0:
            raise GtsamError("on purpose")
        extend(chain, window)

    monkeypatch.setattr(LagChain, "extend", fails)
    with pytest.warns(InputWarning, match="could not smooth track"):
        tracker, _, rows = run.__wrapped__(scene, "gtsam", **SCENE)
    same(rows, expected)
    assert tracker.smoother_counts["fallbacks"] > 0


def test_no_smoother_has_no_rows(scene):
    tracker, _, rows = run(scene, "none", **SCENE)
    assert len(rows) == 0
    assert tracker.smoother_counts == {}
    with pytest.raises(JeatGraphError, match="no smoother"):
        tracker.smoothed()


def test_identities_may_be_given_by_whoever_hands_steps_over(scene):
    tracker = Tracker(load_config("paper", ["smoother.engine=full"]))
    for t, scans in scene(**SCENE):
        taken = tracker.take_in(tracker_scans(t, scans))
        tracker.hand_over(taken._replace(given=taken.ids + 100))
    assert tracker.finish().track_id.min() > 100


def tracker_scans(t, scans):
    from jeat_graph.data.detections import Scan

    return [Scan(t, name, boxes, scores) for name, boxes, scores in scans]


def test_a_track_of_one_detection_has_its_row(scene):
    settings = ["paper.confirm_age_s=0", "paper.confirm_hits=1", "smoother.engine=full"]
    tracker = Tracker(load_config("paper", settings))
    tracker.step((0.0, "rgb", [[10, 20, 30, 40]], [1.0]))
    rows = tracker.finish()
    assert rows.boxes.tolist() == [pytest.approx([10, 20, 30, 40])]


def test_time_may_begin_anew_and_the_rows_before_are_kept(scene):
    tracker = Tracker(load_config("paper", ["smoother.engine=fixed-lag"]))
    batches = [tracker_scans(t, scans) for t, scans in scene(**SCENE)]
    for batch in batches:
        tracker.step(batch)
    born, reported = tracker.num_born, len(tracker.causal())
    tracker.reset(0.0)
    assert tracker.num_tracks == 0
    for batch in batches:
        tracker.step(batch)
    assert tracker.living()[1] == tracker.num_born + 1 == 2 * born + 1
    assert tracker.last_scans() == {"evt": batches[-1][0].t, "rgb": 2.45}
    rows = tracker.finish()
    assert reported > 0
    assert (rows.track_id <= born).sum() == (rows.track_id > born).sum()
