"""Identities that are given, and those that are decided with the whole recording in view."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph import Detections, Scan, Tracker, Trajectories, load_config, read_run, track
from jeat_graph.cli.main import main
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.data.errors import ConfigError, DataError, InputWarning, JeatGraphError
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.checkpoint import save_state
from jeat_graph.tracking.engine import StepInput
from jeat_graph.tracking.engines import make_engine
from jeat_graph.tracking.identities.deciding import LEAST_DETECTIONS, IdentityDecision, with_weak
from jeat_graph.tracking.identities.retracking import _more_to_come, changed_tracks, retrack

BOTH = ("core", "reference")
SIZE = ("image.width=3840", "image.height=2160")
WHOLE = ("smoother.identities=whole", *SIZE)


def boxes_of(*centres):
    return np.array([[x - 15.0, y - 20.0, 30.0, 40.0] for x, y in centres]).reshape(-1, 4)


def hidden(gap=(2.0, 4.6), until=8.0, rate=20.0):
    """One object that walks to the right, and is hidden for longer than a causal track lives."""
    rng = np.random.default_rng(2)
    scans = []
    for k in range(int(until * rate)):
        t = k / rate
        seen = not gap[0] < t < gap[1]
        centre = np.array([40.0 + 60.0 * t, 200.0]) + rng.normal(scale=0.5, size=2)
        scans.append(Scan(t, "rgb", boxes_of(centre) if seen else np.zeros((0, 4)), np.full(int(seen), 0.9)))
    return scans


def tracked(scans, *changes):
    tracker = Tracker(load_config("default", changes))
    for scan in scans:
        tracker.step(scan)
    return tracker, tracker.finish()


@pytest.fixture(scope="module", params=[(0, "full"), (1, "full"), (2, "fixed-lag"), (3, "fixed-lag")])
def given(request):
    """The core and the reference that were given who is who, with what each handed over."""
    seed, smoother = request.param
    rng = np.random.default_rng(seed)
    sensors = 1 + seed % 2
    models = models_of(f"smoother.engine={smoother}", "smoother.lag_s=.4")
    for model in models:
        for number in range(sensors):
            model.declare_sensor(f"sensor{number}", SensorConfig())
    t, place, records = 0.0, rng.uniform(50, 400, (6, 2)), []
    for _ in range(30):
        t += float(rng.choice([0.05, 0.3], p=[0.8, 0.2]))
        place += rng.normal(0, 3, place.shape)
        looked = owned_step(rng, t, place, sensors)
        for model in models:
            model.take(looked)
        assert np.array_equal(*(model.assigned() for model in models))
        assert np.array_equal(*(model.identities() for model in models))
        taken = [model.record() for model in models]
        records.append([model.step_record(one) for model, one in zip(models, taken, strict=True)])
        for model, one in zip(models, taken, strict=True):
            model.hand_over(one)
    return models, records


def models_of(*changes):
    return [make_engine(load_config("default", [*SIZE, *changes, f"tracker.engine={name}"])) for name in BOTH]


def owned_step(rng, t, place, sensors):
    """Boxes of some of six objects, most of them with their owner, many with what is known by later."""
    boxes, owners = [], []
    for _ in range(sensors):
        seen = rng.permutation(6)[: rng.integers(0, 7)]
        corner = place[seen] + rng.normal(0, 1, (len(seen), 2))
        boxes.append(np.concatenate([corner, np.full_like(corner, 30.0)], axis=1))
        owner = np.where(rng.random(6) < 0.7, np.arange(6), -1)[seen]
        later = np.where(rng.random(len(seen)) < 0.5, rng.random(len(seen)), -1.0)
        owners.append(np.stack([owner, rng.random(len(seen)) < 0.8, later], axis=1))
    numbers = np.array([len(one) for one in boxes])
    scores = 1.0 / (1.0 + np.exp(-rng.normal(1.5, 1.5, numbers.sum())))
    every = np.concatenate(owners).astype(np.float64)
    return StepInput(t, np.arange(sensors), numbers, np.concatenate(boxes), scores, owners=every)


def test_the_core_follows_given_identities_as_the_reference_does(given):
    models, records = given
    for core, reference in records:
        assert np.array_equal(core.later, reference.later)
    assert any((core.later >= 0.0).any() for core, _ in records)
    state = models[0].state()
    # Rounding differs by the order of operations, times the condition of the covariances.
    core, reference = (sorted_rows(model.finish()) for model in models)
    assert len(core) > 20
    assert core.keys() == reference.keys()
    assert list(core.values()) == pytest.approx([reference[key] for key in core], abs=1e-8)
    models[0].set_state(state)  # what is known by later is kept, too
    assert sorted_rows(models[0].finish()) == core


def sorted_rows(rows):
    """Existence of smoothed rows with a detection, by time and identity."""
    t, ids, _, _, real, used, *_ = rows
    return {(round(a, 6), int(b)): float(r) for a, b, r, u in zip(t, ids, real, used, strict=True) if u}


@pytest.mark.parametrize("engine", BOTH)
def test_a_track_of_a_given_identity_lives_until_its_last_box(engine):
    model = make_engine(load_config("default", [f"tracker.engine={engine}", "smoother.engine=none"]))
    model.declare_sensor("rgb", SensorConfig())
    box, one, no = np.array([[100.0, 100.0, 30.0, 40.0]]), np.array([1]), np.zeros((0, 4))
    nothing = np.array([0]), no, np.zeros(0), None, None, np.zeros((0, 3))
    for t, more in ((0.0, 1.0), (9.0, 0.0)):
        given = np.array([[3.0, more, -1.0]])
        model.take(StepInput(t, np.array([0]), one, box, np.array([0.7]), owners=given))
        model.take(StepInput(t + 4.0, np.array([0]), *nothing))
        assert model.size() == int(more)
    assert model.born() == 1


def test_the_paper_says_that_it_is_not_given_who_is_who():
    model = make_engine(load_config("paper"))
    assert not model.takes_owners
    model.declare_sensor("rgb", SensorConfig())
    looked = StepInput(0.0, np.array([0]), np.array([0]), np.zeros((0, 4)), np.zeros(0))
    model.take(looked)
    with pytest.raises(JeatGraphError, match="engine paper is not given who is who"):
        model.take(looked._replace(t=1.0, owners=np.zeros((0, 3))))


def test_who_was_hidden_for_long_has_one_identity():
    scans = hidden()
    tracker, smoothed = tracked(scans, *WHOLE)
    assert set(smoothed.track_id.tolist()) == {1}
    assert set(smoothed.causal_id.tolist()) == {1, 2}
    links = tracker.identity_links()
    joined = np.flatnonzero(links.t_head - links.t_tail > 2.0)
    assert links.tail[joined].tolist() == [1]
    assert links.head[joined].tolist() == [2]
    # Gains are twice too sure; of 200 covers the share of one link has a standard deviation of .02.
    assert links.probability[joined] == pytest.approx(
        1.0 / (1.0 + np.exp(-links.log_ratio[joined] / 2.0)), abs=0.06
    )
    causal = tracked(scans, *WHOLE, "smoother.identities=causal")[1]
    assert set(causal.track_id.tolist()) == {1, 2}
    assert causal.causal_id is None


def test_an_identity_that_nothing_speaks_against_stays():
    smoothed = tracked(hidden(gap=(9.0, 9.0)), *WHOLE)[1]
    causal = tracked(hidden(gap=(9.0, 9.0)), *WHOLE, "smoother.identities=causal")[1]
    assert_same_rows(smoothed, causal)
    assert (smoothed.identity_probability == 1.0).all()


def assert_same_rows(one, other):
    assert len(one) == len(other) > 0
    for name in ("track_id", "t", "boxes", "existence", "var", "used"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_tracks_that_no_decision_changes_keep_their_rows_to_the_byte():
    """Beside one that is joined over a gap."""
    scans = []
    for scan in hidden():
        beside = [[300.0 + 20 * scan.t, 50.0, 30.0, 40.0]]
        scans.append(Scan(scan.t, "rgb", np.vstack([scan.boxes, beside]), np.r_[scan.scores, 0.8]))
    smoothed, causal = (
        tracked(scans, *WHOLE, f"smoother.identities={way}")[1] for way in ("whole", "causal")
    )
    assert len(np.unique(smoothed.track_id)) + 1 == len(np.unique(causal.track_id)) == 3
    high, causally_high = (table.take(table.boxes[:, 1] < 100.0) for table in (smoothed, causal))
    assert_same_rows(high, causally_high)


def test_a_track_is_as_it_was_only_whole_and_alone():
    causal = np.array([1, 1, 2, 2, 3, 4, 4, 5, 6])
    owner = np.array([1, 1, 2, 9, 3, 3, 3, 0, 6])
    decision = IdentityDecision.without_links(owner, causal)
    assert changed_tracks(decision).tolist() == [False, False, True, True, True, True, True, False, False]


@pytest.mark.parametrize("number", [9, 10])
def test_what_has_few_detections_is_joined_to_nothing(number):
    end = 4.2 + number / 20
    smoothed = tracked(hidden(gap=(2.0, 4.2), until=end), *WHOLE)[1]
    assert len(set(smoothed.track_id.tolist())) == (2 if number < LEAST_DETECTIONS else 1)


def test_the_reference_and_the_core_decide_alike():
    core, reference = (
        tracked(hidden(rate=8.0), *WHOLE, "smoother.engine=full", f"tracker.engine={e}")[1]
        for e in ("core", "reference")
    )
    assert np.array_equal(core.track_id, reference.track_id)
    assert core.boxes == pytest.approx(reference.boxes, abs=1e-5)


def test_two_sensors_that_see_one_object_give_it_one_identity():
    scans = []
    for scan in hidden(gap=(2.0, 4.0), until=5.0):
        scans += [[scan, Scan(scan.t, "lidar", scan.boxes + 0.5, scan.scores)]]
    smoothed = tracked(scans, *WHOLE)[1]
    assert set(smoothed.track_id.tolist()) == {1}
    assert len(np.unique(smoothed.t)) == len(smoothed)


@pytest.mark.parametrize("smoother", ["fixed-lag", "full", "gtsam-full"])
def test_a_track_of_two_sensors_ends_after_the_last_detection_of_its_identity(smoother):
    """It is awaited after neither of the last two; else it would go on until nothing of it is finite."""
    scans = [
        [Scan(scan.t, name, scan.boxes, scan.scores) for name in ("lidar", "rgb")]
        for scan in hidden(gap=(2.0, 60.0), until=50.0, rate=10.0)
    ]
    smoothed = tracked(scans, *WHOLE, f"smoother.engine={smoother}")[1]
    assert smoothed.t.tolist() == pytest.approx(np.arange(21) / 10)


def test_of_two_last_detections_of_one_time_none_has_more_to_come():
    owner, t = np.array([3, 0, 3, 3, 5, 3]), np.array([0.0, 0.0, 1.0, 2.0, 2.0, 2.0])
    assert _more_to_come(owner, t).tolist() == [1, 0, 1, 0, 0, 0]


def test_nothing_at_all_is_decided_too():
    tracker, smoothed = tracked([Scan(0.0, "rgb", np.zeros((0, 4)), np.zeros(0))], *WHOLE)
    assert len(smoothed) == 0
    assert len(tracker.identity_links().tail) == 0
    assert len(Tracker(load_config("default", WHOLE)).finish()) == 0


def test_a_tracker_that_was_saved_decides_the_same(tmp_path):
    scans = hidden()
    expected = tracked(scans, *WHOLE)[1]
    tracker = Tracker(load_config("default", WHOLE))
    for scan in scans[:70]:
        tracker.step(scan)
    tracker.save(tmp_path / "state.npz")
    loaded = Tracker.load(tmp_path / "state.npz")
    for scan in scans[70:]:
        loaded.step(scan)
    found = loaded.finish()
    assert np.array_equal(found.track_id, expected.track_id)
    assert np.array_equal(found.boxes, expected.boxes)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("assigned", -1),
        ("real", 2.0),
        ("real", np.nan),
        ("boxes", np.nan),
        ("scan_t", np.inf),
        ("assigned", None),
    ],
)
def test_a_log_that_no_tracker_keeps_is_refused(tmp_path, name, value):
    tracker = Tracker(load_config("default", WHOLE))
    for scan in hidden()[:5]:
        tracker.step(scan)
    state = tracker.state()
    holder = state["log"] if name in state["log"] else vars(state["log"]["detections"])
    holder[name] = holder[name][:-1] if value is None else holder[name].copy()
    if value is not None:
        holder[name].reshape(-1)[0] = value
    save_state(tmp_path / "state.npz", tracker.config, state)
    with pytest.raises(DataError, match=r"state\.npz"):
        Tracker.load(tmp_path / "state.npz")
    save_state(tmp_path / "state.npz", tracker.config, state | {"log": None})
    with pytest.raises(DataError, match="detections of the recording are missing"):
        Tracker.load(tmp_path / "state.npz")


def test_smoothed_before_the_end_is_what_finish_gives():
    tracker = Tracker(load_config("default", WHOLE))
    for scan in hidden():
        tracker.step(scan)
    assert len(tracker.drain_smoothed()) == 0
    assert np.array_equal(tracker.smoothed().boxes, tracker.finish().boxes)


def test_weak_detections_go_with_their_causal_track_where_its_chain_is_free():
    from jeat_graph.smoothers.joining import MeasuredBoxes

    t = np.arange(6.0)
    edges, camera = np.zeros((6, 2, 2), dtype=bool), np.zeros((6, 2))
    seen = MeasuredBoxes(t, np.zeros(6, dtype=int), np.zeros((6, 4)), edges, camera)
    causal = np.array([1, 1, 1, 2, 1, 1])
    # Weak ones first, in between, and last; that of track 2 is nobody's.
    assert with_weak(seen, causal, np.arange(6), np.array([-1, 4, -1, -1, 4, -1])).tolist() == [
        4,
        4,
        4,
        -1,
        4,
        4,
    ]
    # The chain goes on without it.
    piece = np.array([0, 1, 2, 3, 1, 4])
    assert with_weak(seen, causal, piece, np.array([-1, 4, -1, -1, 4, -1])).tolist() == [4, 4, -1, -1, 4, 4]


def test_track_decides_unless_told_otherwise_and_says_what_it_joined(tmp_path):
    rows = ["t,sensor,left,top,width,height,score"]
    for scan in hidden():
        box = ",".join(f"{x:.3f}" for x in scan.boxes[0]) if len(scan) else ",,,"
        rows.append(f"{scan.t},rgb,{box},{'.9' if len(scan) else ''}")
    (tmp_path / "d.csv").write_text("\n".join(rows) + "\n")
    command = ["track", str(tmp_path / "d.csv"), "--image", "3840x2160", "--out"]
    main([*command, str(tmp_path / "run")])
    smoothed = read_run(tmp_path / "run").smoothed
    assert set(smoothed.track_id.tolist()) == {1}
    assert set(smoothed.causal_id.tolist()) == {1, 2}
    header, *links = (tmp_path / "run" / "links.csv").read_text().splitlines()
    assert header.startswith("from,to,gap,log_ratio,probability")
    assert any(line.startswith("1,2,2.6") for line in links)
    found = track(tmp_path / "d.csv", load_config("default", SIZE)).smoothed
    assert np.array_equal(found.track_id, smoothed.track_id)
    main([*command, str(tmp_path / "causal"), "--set", "smoother.identities=causal"])
    whole, causally = ((tmp_path / name / "causal.csv").read_bytes() for name in ("run", "causal"))
    assert whole == causally
    assert not (tmp_path / "causal" / "links.csv").exists()
    causal = read_run(tmp_path / "causal").smoothed
    assert causal.causal_id is None
    assert set(causal.track_id.tolist()) == {1, 2}


def test_the_paper_and_streams_refuse_what_they_cannot():
    with pytest.raises(ConfigError, match="another engine"):
        load_config("paper", ["smoother.identities=whole"])
    with pytest.raises(ConfigError, match="auto, causal, lag, whole"):
        load_config("default", ["smoother.identities=all"])
    with pytest.raises(ConfigError, match="in order of time"):
        LiveTracker(Tracker(load_config("default", WHOLE)))


def test_rows_of_a_recording_come_in_any_order_of_sensors():
    scans = [
        [Scan(k / 20, name, boxes_of((50.0 + k, 100.0)), np.array([0.9])) for name in ("b", "a")]
        for k in range(40)
    ]
    other = Detections.from_scans([scan for batch in scans for scan in batch])
    one = tracked(scans, *WHOLE)[1]
    again = tracked(list(other.batches()), *WHOLE)[1]
    assert np.array_equal(one.track_id, again.track_id)
    assert np.array_equal(one.used, again.used)


def test_boxes_that_do_not_count_are_nobodys():
    rng = np.random.default_rng(5)
    scans = []
    for k in range(4):
        heap = boxes_of(*(np.array([100.0 + 2.0 * k, 100.0]) + rng.normal(0, 0.1, (34, 2))))
        scans.append(Scan(k / 10, "rgb", heap, rng.uniform(0.5, 0.9, 34)))
    with pytest.warns(InputWarning, match="do not count") as told:
        smoothed = tracked(scans, *WHOLE)[1]
    assert len(told) == 1
    with pytest.warns(InputWarning, match="do not count"):
        causal = tracked(scans, *WHOLE, "smoother.identities=causal")[1]
    assert len(smoothed)
    assert set(smoothed.causal_id.tolist()) <= set(causal.track_id.tolist())


def test_what_is_cut_off_keeps_the_rows_of_the_track_that_it_was_of():
    """Of a weak object: what begins again in its midst is not believed for a while."""
    rng = np.random.default_rng(3)
    scans = []
    for k in range(80):
        centre = np.array([40.0 + 3.0 * k, 200.0]) + rng.normal(scale=0.5, size=2)
        scans.append(Scan(k / 20, "rgb", boxes_of(centre), np.array([0.9 if k < 20 else 0.3])))
    detections = Detections.from_scans(scans)
    tracker, causal = tracked(scans, *SIZE)
    assert set(causal.track_id.tolist()) == {1}
    owner = np.where(np.arange(80) < 40, 1, 2)
    decision = IdentityDecision.without_links(owner, np.ones(80, dtype=np.int64))
    rows = Trajectories.concatenate(list(retrack(detections, decision, np.full(80, 0.5), tracker)))
    assert sorted(rows.t.tolist()) == causal.t.tolist()
    assert (rows.track_id == np.where(rows.t < 2.0, 1, 2)).all()
    followed = Trajectories.concatenate(
        list(retrack(detections, decision, np.full(80, 0.5), tracker, from_scratch=True))
    )
    assert len(followed) < len(rows)  # what the model alone believes
