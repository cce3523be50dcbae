"""The state of the core's tracker: to a file and back, to an earlier moment; what is damaged is refused."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph import Scan, Tracker, load_config
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.io.files.packing import pack, unpack
from jeat_graph.io.files.state_file import read_state_file, write_state_file
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.checkpoint import _codecs, save_state
from jeat_graph.tracking.model_tracker import ModelTracker

_SIZE = (1280, 720)
_PICTURE = ["image.width=1280", "image.height=720", "input.picture=given"]
_SMOOTHERS = {
    "none": ["smoother.engine=none"],
    "lag": ["smoother.lag_s=.4"],
    "whole": ["smoother.engine=full"],
}


def traffic(seed=0, times=60, classes=False, embeddings=False):
    """Scans of a camera and an event camera, which begins to look later; objects come and go."""
    rng = np.random.default_rng(seed)
    place, speed = rng.uniform(200, 500, (12, 2)), rng.normal(0, 60, (12, 2))
    looks = rng.normal(size=(12, 8))
    for k in range(times):
        t = 0.05 * k
        there = np.flatnonzero((np.arange(12) * 3 <= k) & (k < np.arange(12) * 3 + 40))
        for sensor, every, first in (("cam", 2, 0), ("evt", 1, 15)):
            if k % every or k < first:
                continue
            seen = there[rng.random(len(there)) < 0.9]
            corner = (place + speed * t)[seen] + rng.normal(0, 1.0, (len(seen), 2))
            stray = rng.uniform(0, 600, (rng.poisson(0.5), 2))
            boxes = np.concatenate(
                [np.concatenate([corner, stray]), np.full((len(seen) + len(stray), 2), 40.0)], axis=1
            )
            more = []
            if classes or embeddings:
                more.append([("car", "van", "bus")[n % 3] for n in seen] + [""] * len(stray))
            if embeddings:
                one = np.concatenate([looks[seen], rng.normal(size=(len(stray), 8))])
                more.append(one / np.linalg.norm(one, axis=1, keepdims=True))
            yield (t, sensor, boxes, rng.uniform(0.3, 1, len(boxes)), *more)


def with_std(scan):
    """The scan of a camera that says how sure it is of each side; others as they are."""
    t, sensor, boxes, *rest = scan
    if sensor != "cam":
        return scan
    std = np.abs(np.sin(boxes)) * [4.0, 2.0, np.nan, 1.0]
    return Scan(t, sensor, boxes, *rest, box_std=std)


def bytes_of(table):
    """All columns of a table as bytes."""
    columns = (
        table.t,
        table.track_id,
        table.boxes,
        table.existence,
        table.mean,
        table.var,
        table.used,
        table.size_var,
    )
    classes = () if table.classes is None else (table.classes.tolist(), table.class_probability.tobytes())
    return (*(column.tobytes() for column in columns), *classes)


def tracker_with(smoother, **more):
    return Tracker(load_config("default", _SMOOTHERS[smoother]), image=_SIZE, **more)


def answers(tracker, scans, drains):
    out = []
    for scan in scans:
        out.append(bytes_of(tracker.step(scan)))
        if drains:
            out.append(bytes_of(tracker.drain_smoothed()))
    return out


@pytest.mark.parametrize("smoother", _SMOOTHERS)
@pytest.mark.parametrize("cut", [0, 1, 7, 30, 71])
def test_a_tracker_that_is_loaded_goes_on_with_the_same_bytes(smoother, cut, tmp_path):
    scans, drains = [with_std(one) for one in traffic(classes=True, embeddings=True)], smoother != "none"
    whole, first = tracker_with(smoother), tracker_with(smoother)
    expected = answers(whole, scans, drains)
    found = answers(first, scans[:cut], drains)
    first.save(tmp_path / "state.npz")
    second = Tracker.load(tmp_path / "state.npz")
    assert isinstance(second, ModelTracker)
    second.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "state.npz").read_bytes()
    assert second.num_tracks == first.num_tracks
    assert second.sensor_states() == first.sensor_states()
    assert bytes_of(second.causal()) == bytes_of(first.causal())
    found += answers(second, scans[cut:], drains)
    assert found == expected
    assert bytes_of(second.finish()) == bytes_of(whole.finish())


@pytest.mark.parametrize("both", [False, True])
def test_times_below_0_are_no_damage_though_two_sensors_have_not_been_compared_yet(both, tmp_path):
    """What has not been yet has the time 0: it lies ahead of such a tracker."""
    tracker = tracker_with("none")
    scans = [Scan(-50.0 + 0.05 * k, "rgb", [[100.0 + 2 * k, 80, 60, 40]], [0.9]) for k in range(20)]
    for scan in scans:
        tracker.step([scan, Scan(scan.t, "evt", scan.boxes if both else [], scan.scores if both else [])])
    tracker.save(tmp_path / "state.npz")
    assert bytes_of(Tracker.load(tmp_path / "state.npz").causal()) == bytes_of(tracker.causal())


@given(
    seed=st.integers(0, 10**6),
    cut=st.integers(0, 30),
    back=st.integers(0, 20),
    smoother=st.sampled_from([*_SMOOTHERS]),
)
def test_a_tracker_that_goes_back_is_where_it_was(seed, cut, back, smoother):
    scans = list(traffic(seed, 40))
    straight, tracker = tracker_with(smoother), tracker_with(smoother)
    for scan in scans[:cut]:
        straight.step(scan)
        tracker.step(scan)
    moment = tracker.snapshot()
    before = bytes_of(tracker.causal())
    for scan in reversed(scans[cut : cut + back]):  # others than those that will count
        tracker.take_in([_as_scan((9.0, *scan[1:]))])
    tracker.restore(moment)
    assert bytes_of(tracker.causal()) == before
    for scan in scans[cut:]:
        straight.step(scan)
        taken = tracker.take_in([_as_scan(scan)])
        assert bytes_of(tracker.causal()) == bytes_of(straight.causal())
        tracker.hand_over(taken)
    assert bytes_of(tracker.finish()) == bytes_of(straight.finish())


def _as_scan(scan):
    from jeat_graph.tracking.scans import as_scans

    return as_scans(scan)[0]


def test_the_reference_goes_back_too_and_says_that_it_is_not_saved(tmp_path):
    scans = list(traffic(times=20))
    straight, tracker = (Tracker("default", engine="reference", image=_SIZE) for _ in range(2))
    for scan in scans[:6]:
        straight.step(scan)
        tracker.step(scan)
    moment = tracker.snapshot()
    tracker.take_in([_as_scan(scans[7])])
    tracker.restore(moment)
    for scan in scans[6:]:
        straight.step(scan)
        tracker.hand_over(tracker.take_in([_as_scan(scan)]))
        assert bytes_of(tracker.causal()) == bytes_of(straight.causal())
    assert bytes_of(tracker.finish()) == bytes_of(straight.finish())
    with pytest.raises(JeatGraphError, match="reference is not saved"):
        tracker.save(tmp_path / "state.npz")


def test_steps_are_handed_over_once_and_in_order():
    tracker = tracker_with("lag")
    taken = [tracker.take_in([_as_scan(scan)]) for scan in traffic(times=20)]
    tracker.hand_over(taken[6])
    with pytest.raises(ValueError, match="in order of time"):
        tracker.hand_over(taken[0])


def test_a_long_silence_ends_all_tracks_and_identities_go_on():
    tracker = tracker_with("whole")
    for scan in traffic(times=30):
        tracker.step(scan)
    born = tracker.num_born
    tracker.step((1e4, "cam", [[10, 10, 40, 40]], [0.9]))
    assert tracker.num_tracks == 1
    assert tracker.num_born == born + 1
    assert np.isfinite(tracker.finish().mean).all()


def test_time_begins_anew_as_if_none_had_passed():
    tracker = tracker_with("lag")
    for scan in traffic(times=40):
        tracker.step(scan)
    born, learnt = tracker.num_born, tracker.sensor_states()
    tracker.reset(-50.0)
    assert tracker.num_tracks == 0
    assert tracker.time is None
    assert not len(tracker.causal())
    assert tracker.sensor_states() == learnt
    assert all(t < -50.0 for t in tracker.last_scans().values())
    tracker.step((-50.0, "cam", [[10, 10, 40, 40]], [0.9]))
    assert tracker.num_born == born + 1


@pytest.mark.parametrize("engine", ["core", "reference"])
@pytest.mark.parametrize("moments", [(-3600.0, -7199.9), (-3600.0,), (-9000.0, -3600.0)])
def test_of_several_resets_the_last_counts_and_a_step_before_it(tmp_path, engine, moments):
    def after(moments):
        tracker = ModelTracker(load_config("default"), engine=engine, image=(1280, 720))
        for scan in traffic(times=40):
            tracker.step(scan)
        for moment in moments:
            tracker.reset(moment)
        scans = [(-7199.9 + 0.1 * k, "cam", [[10 + k, 10, 40, 40]], [0.9]) for k in range(20)]
        return tracker, [tracker.step(scan) for scan in scans]

    tracker, tables = after(moments)
    one, expected = after((-7199.9,))
    assert tracker.last_scans() == pytest.approx(one.last_scans(), abs=1e-6)
    for table, other in zip(tables, expected, strict=True):
        np.testing.assert_allclose(table.mean, other.mean, atol=1e-6)
    if engine == "core":
        tracker.save(tmp_path / "state.npz")
        assert Tracker.load(tmp_path / "state.npz").last_scans() == tracker.last_scans()


# What is damaged.


def saved(tmp_path, smoother="lag", **more):
    tracker = tracker_with(smoother, diagnostics=True)
    for scan in traffic(times=30, **more):
        tracker.step(scan)
    path = tmp_path / "state.npz"
    tracker.save(path)
    return tracker, path


def refusal(path):
    """What is said of a file that is refused; None of one that is not."""
    try:
        Tracker.load(path)
    except JeatGraphError as error:
        return str(error)
    return None


def test_a_file_of_which_any_byte_was_changed_is_refused_in_one_line(tmp_path):
    _, path = saved(tmp_path)
    content, rng = path.read_bytes(), np.random.default_rng(1)
    for place in rng.integers(0, len(content), 300).tolist():
        broken = bytearray(content)
        broken[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(broken)
        said = refusal(path)
        assert said is None or (str(path) in said and "\n" not in said)
    for length in rng.integers(0, len(content), 40).tolist():
        path.write_bytes(content[:length])
        with pytest.raises(JeatGraphError):
            Tracker.load(path)


def drawn_damage(rng, state):
    """Change one array of a state in one of many ways; return its name."""
    name = sorted(state)[rng.integers(len(state))]
    array = state[name]
    how = rng.integers(7)
    if how == 0:
        del state[name]
    elif how == 1:
        state[name] = array[: len(array) // 2]
    elif how == 2:
        state[name] = array.astype(np.float32)
    elif how == 3:
        state[name] = np.concatenate([array, array])
    elif how == 4:
        state[name] = array.tolist()
    elif array.size:
        flat = array.reshape(-1).copy()
        place = rng.integers(len(flat))
        if array.dtype == np.float64:
            flat[place] = [np.nan, np.inf, -np.inf, -1.0, 1e300, -1e300, 1e60][rng.integers(7)]
        else:
            info = np.iinfo(array.dtype)
            flat[place] = [info.max, info.min, 0, info.max // 2][rng.integers(4)]
        state[name] = flat.reshape(array.shape)
    return name


@pytest.mark.parametrize("smoother", ["lag", "whole"])
def test_a_state_with_any_wrong_array_is_refused_or_harms_nobody(tmp_path, smoother):
    tracker, path = saved(tmp_path, smoother, classes=True, embeddings=True)
    rng, refused = np.random.default_rng(2), 0
    for _ in range(300):
        state = tracker.state()
        state["model"] = dict(state["model"])
        drawn_damage(rng, state["model"])
        save_state(path, tracker.config, state)
        said = refusal(path)
        if said is not None:
            refused += 1
            assert str(path) in said
            continue
        loaded = Tracker.load(path)
        # What could be goes on, whatever comes of it.
        try:
            for scan in traffic(5, 3):
                loaded.step((scan[0] + 10.0, *scan[1:4]))
            loaded.drain_smoothed()
            loaded.finish()
        except (JeatGraphError, ValueError, OverflowError):
            pass
    assert refused > 150


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("sensors", ["cam"]),
        ("sensors", ["cam", "cam"]),
        ("sensors", ["cam", 3]),
        ("called", [1]),
        ("called", []),
        ("order", np.zeros(3)),
        ("order", None),
        ("classes", 5),
        ("appearance", np.zeros(3)),
        ("model", {}),
        ("model", 3),
        ("boxes", None),
        ("class_ids", [1]),
    ],
)
def test_what_no_tracker_has_beside_its_model_is_refused(tmp_path, part, value):
    tracker, path = saved(tmp_path, classes=True, embeddings=True)
    save_state(path, tracker.config, tracker.state() | {part: value})
    with pytest.raises(DataError, match="damaged"):
        Tracker.load(path)


def test_a_file_of_other_settings_or_of_another_version_is_refused(tmp_path):
    _, path = saved(tmp_path)
    with pytest.raises(JeatGraphError, match="lag_s"):
        Tracker.load(path, load_config("default", ["smoother.lag_s=2", *_PICTURE]))
    text, block = read_state_file(path, "state")
    write_state_file(path, text.replace(b'"format": ', b'"format": 9'), block)
    with pytest.raises(JeatGraphError, match="start over"):
        Tracker.load(path)


def test_a_state_is_the_same_packed_and_unpacked(tmp_path):
    tracker, _ = saved(tmp_path, classes=True)
    codecs = _codecs()
    text, block = pack(tracker.state(), codecs)
    assert pack(unpack(text, block, codecs), codecs) == (text, block)


def test_a_tracker_of_late_scans_is_loaded_as_such(tmp_path):
    live = LiveTracker(tracker_with("lag"))
    for scan in traffic(times=10):
        live.step(scan)
    live.save(tmp_path / "state.npz")
    with pytest.raises(DataError, match="late scans"):
        Tracker.load(tmp_path / "state.npz")
    loaded, _ = LiveTracker.load(tmp_path / "state.npz")
    assert bytes_of(loaded.causal()) == bytes_of(live.causal())


def test_constants_of_one_s_own_are_saved_with_the_state(tmp_path):
    own = replace(ModelConstants(), report=0.7, jerk=3, walk_bounds=(0.2, 5))
    scans = list(traffic(3))
    tracker, usual = Tracker(image=_SIZE, constants=own), Tracker(image=_SIZE)
    for scan in scans[:40]:
        tracker.step(scan)
        usual.step(scan)
    tracker.save(tmp_path / "state.npz")
    loaded, copied = Tracker.load(tmp_path / "state.npz"), copy(tracker)
    assert loaded.constants == copied.constants == own
    for scan in scans[40:]:
        expected = bytes_of(tracker.step(scan))
        assert bytes_of(loaded.step(scan)) == expected == bytes_of(copied.step(scan))
        other = bytes_of(usual.step(scan))
    assert other != expected


@pytest.mark.parametrize("forged", [{"report": float("nan")}, {"walk_bounds": 1.0}, {"none": 1.0}, [1]])
def test_constants_that_are_none_are_refused(forged):
    tracker = Tracker(image=_SIZE)
    with pytest.raises(DataError, match=r"is damaged: .*constant"):
        Tracker.from_state(tracker.config, {**tracker.state(), "constants": forged})
