"""What is decided with a lag, to a file and back: nothing shows that it was, and damage is refused."""

from __future__ import annotations

import os
from copy import deepcopy
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph import Scan, Tracker, load_config
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.io.files.packing import pack
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.checkpoint import _codecs, save_state
from jeat_graph.tracking.identities.saved_parts import whole_number

TIMES = 20 if os.environ.get("JEAT_GRAPH_FULL", "") not in ("", "0") else 1
RATE_HZ = 20.0
HIDDEN_S = (2.0, 4.6)
ROWS = ("t", "track_id", "boxes", "existence", "mean", "var", "used", "size_var")


def config(lag_s=0.6, *more):
    picture = ("image.width=1280", "image.height=720", "input.picture=given")
    return load_config("default", [f"smoother.lag_s={lag_s}", "smoother.identities=lag", *picture, *more])


def scene(seed=0, sensors=1, seconds=7.0, embeddings=False):
    """Two who meet, and one who is hidden for longer than a causal track lives; sensors take turns."""
    rng = np.random.default_rng(seed)
    height, speed = rng.uniform(60, 260), rng.uniform(30, 60)
    looks = rng.normal(size=(3, 4))
    for k in range(round(seconds * RATE_HZ)):
        t = k / RATE_HZ
        left = [(300.0 + 25.0 * t, 400.0), (600.0 - 25.0 * t, 420.0), (40.0 + speed * t, height)]
        seen = [place for place in range(3) if place < 2 or not HIDDEN_S[0] < t < HIDDEN_S[1]]
        seen = [place for place in seen if rng.random() < 0.95]
        corner = np.array([left[place] for place in seen]).reshape(-1, 2) + rng.normal(0, 0.6, (len(seen), 2))
        boxes, classes = np.column_stack([corner, np.full((len(seen), 2), 36.0)]), ["car"] * len(seen)
        look = looks[seen] / np.linalg.norm(looks[seen], axis=1, keepdims=True) if embeddings else None
        name = ("evt", "rgb")[k % sensors]
        yield Scan(t, name, boxes, np.full(len(seen), 0.9), np.array(classes, dtype=np.str_), look)


def bytes_of(table):
    """All columns of a table."""
    columns = [*ROWS, *(() if table.causal_id is None else ("causal_id", "identity_probability"))]
    classes = None if table.classes is None else (table.classes.tolist(), table.class_probability.tobytes())
    return (*(getattr(table, name).tobytes() for name in columns), table.sensors, classes)


def gone_on(tracker, folder):
    """The tracker of a file, after it was looked whether that says the same again."""
    path, again = Path(folder, "state.npz"), Path(folder, "again.npz")
    tracker.save(path)
    loaded = type(tracker).load(path)
    loaded = loaded[0] if isinstance(tracker, LiveTracker) else loaded
    loaded.save(again)
    assert again.read_bytes() == path.read_bytes()
    return loaded


def told(tracker, scans, every, stops=()):
    """All that a tracker says of scans, where it is saved and loaded at some of them."""
    out = []
    with TemporaryDirectory() as folder:
        for k, scan in enumerate(scans):
            if k in stops:
                tracker = gone_on(tracker, folder)
            out.append(bytes_of(tracker.step(scan)))
            if k % every == 0:
                out.append(bytes_of(tracker.drain_smoothed()))
    return [*out, bytes_of(tracker.finish())], tracker.identity_links()


@settings(max_examples=5 * TIMES)
@given(
    seed=st.integers(0, 10**6),
    sensors=st.sampled_from([1, 2]),
    lag_s=st.sampled_from([0.25, 0.6, 1.5]),
    every=st.integers(1, 30),
    stops=st.sets(st.integers(0, 139), min_size=1, max_size=4),
    embeddings=st.booleans(),
)
def test_stopped_anywhere_and_gone_on_with_it_says_the_same(seed, sensors, lag_s, every, stops, embeddings):
    scans = list(scene(seed, sensors, embeddings=embeddings))
    stops = {stop % len(scans) for stop in stops}
    once, links = told(Tracker(config(lag_s)), scans, every)
    again, links_again = told(Tracker(config(lag_s)), scans, every, stops)
    assert again == once
    assert all(np.array_equal(one, other) for one, other in zip(links_again, links, strict=True))


@pytest.mark.parametrize(("smoother", "sensors"), [("fixed-lag", 1), ("full", 2)])
def test_stopped_again_and_again_while_who_was_hidden_is_joined(smoother, sensors):
    """The one that was hidden is two causal tracks and one identity, whose rows the second smoother gives."""
    more, scans = (f"smoother.engine={smoother}",), list(scene(1, sensors))
    once, links = told(Tracker(config(0.6, *more)), scans, 7)
    again, links_again = told(Tracker(config(0.6, *more)), scans, 7, range(0, len(scans), 3))
    assert again == once
    joined = links.tail != links.head
    assert joined.any()
    assert all(np.array_equal(one, other) for one, other in zip(links_again, links, strict=True))


@settings(max_examples=3 * TIMES)
@given(
    seed=st.integers(0, 10**6),
    stops=st.sets(st.integers(0, 139), min_size=1, max_size=4),
    policy=st.sampled_from(["rewind", "skip"]),
)
def test_a_live_tracker_of_two_sensors_is_stopped_anywhere(seed, stops, policy):
    """The scans of one sensor come late."""
    scans = list(scene(seed, 2))
    order = np.argsort([scan.t + (0.18 if scan.sensor == "evt" else 0.0) for scan in scans], kind="stable")
    outcomes = []
    for wanted in ((), stops):
        live, out = LiveTracker(Tracker(config())), []
        with TemporaryDirectory() as folder:
            for k, place in enumerate(order.tolist()):
                if k in wanted:
                    live = gone_on(live, folder)
                out.append(bytes_of(live.step(scans[place]).table))
                out.append(bytes_of(live.drain_smoothed()) if k % 9 == 0 else ())
        outcomes.append([*out, bytes_of(live.finish())])
    assert outcomes[0] == outcomes[1]


def test_a_sensor_that_joins_later_and_another_moment_are_saved_as_well(tmp_path):
    """`evt` is met after the second tracker was made; then the time goes back."""
    scans = [scan for scan in scene(3, 2) if scan.sensor == "rgb" or scan.t > 3.0]
    outcomes = []
    for stops in ((), range(0, len(scans), 5)):
        tracker, out = Tracker(config()), []
        for k, scan in enumerate(scans):
            if k == 60:
                tracker.reset(0.0)
            if k in stops:
                tracker = gone_on(tracker, tmp_path)
            shifted = scan.t if k < 60 else scan.t - scans[60].t
            out.append(bytes_of(tracker.step(Scan(shifted, scan.sensor, scan.boxes, scan.scores))))
            out.append(bytes_of(tracker.drain_smoothed()) if k % 13 == 12 else ())
        outcomes.append([*out, bytes_of(tracker.finish())])
    assert outcomes[0] == outcomes[1]


def test_links_are_not_saved_for_months(tmp_path):
    tracker = Tracker(config())
    for scan in scene(1):
        tracker.step(scan)
    assert len(gone_on(tracker, tmp_path).identity_links().tail) == len(tracker.identity_links().tail) > 0
    live = LiveTracker(Tracker(config()))
    for scan in scene(1):
        live.step(scan)
    assert not len(gone_on(live, tmp_path).tracker.identity_links().tail)


def test_what_is_saved_does_not_grow_with_time():
    """Of cars that pass for ever; how tracks ended the model remembers of some thousands of them."""
    tracker, sizes = Tracker(config(0.5)), []
    for k in range(1000):
        t = k / 10.0
        x = np.array([160.0 * (t - 6.0 * car) for car in range(int(t / 6.0) - 1, int(t / 6.0) + 1)])
        x = x[(x > 0.0) & (x < 1200.0)]
        boxes = np.column_stack([x, np.full(len(x), 300.0), np.full((len(x), 2), 40.0)])
        tracker.step(Scan(t, "rgb", boxes, np.full(len(x), 0.9)))
        tracker.drain_smoothed()
        if k >= 200 and k % 10 == 0:
            state = tracker.state()["lag"] | {"links": None}
            for one in (state["follower"], state["decider"]["back"]):
                model = one["state"]["model"]
                one["state"]["model"] = {name: model[name] for name in model if "ended" not in name}
            text, block = pack(state, _codecs())
            sizes.append(len(text) + len(block))
    assert max(sizes[40:]) <= 1.05 * max(sizes[:40])


def test_the_second_smoother_keeps_the_states_of_rows_that_it_may_give_alone():
    """An identity that is one causal track has them since its last detection."""
    tracker = Tracker(config())
    for scan in scene(1, seconds=HIDDEN_S[0]):
        tracker.step(scan)
    state = tracker.state()
    models = state["model"], state["lag"]["follower"]["state"]["model"]
    entries = [len(model["histories.t"]) for model in models]
    assert len(models[1]["histories.track_id"]) == 3
    assert entries[1] < 0.1 * entries[0]


# What is damaged.


@pytest.fixture(scope="module")
def tracker():
    """One that has joined who was hidden, and has rows that wait: of now, and of before another moment."""
    tracker = Tracker(config(), diagnostics=True)
    scans = list(scene(1, 2, embeddings=True))
    for scan in scans:
        tracker.step(scan)
    tracker.reset(0.0)
    for scan in scans[:110]:
        tracker.step(scan)
        if scan.t == 3.0:
            tracker.drain_smoothed()
    return tracker


def parts_of(state, where=()):
    """The places of all arrays and plain values of a state, but for what is in a tracker's own model."""
    inner = state.items() if isinstance(state, dict) else enumerate(state)
    for key, value in inner:
        if key == "model":
            continue
        if isinstance(value, dict) or (isinstance(value, list | tuple) and value):
            yield from parts_of(value, (*where, key))
        yield (*where, key)


WRONG = (None, 3, -1, 1 << 63, float("nan"), float("inf"), "x", [], {}, [None], np.zeros(3), np.zeros((2, 2)))


def damage(rng, state, where):
    """Make another thing of what stands at a place; in arrays mostly of one number."""
    *way, key = where
    for step in way:
        if isinstance(state[step], tuple):
            state[step] = list(state[step])
        state = state[step]
    value = state[key]
    how = rng.integers(6)
    if how == 0 and isinstance(state, dict):
        del state[key]
    elif how == 1 and hasattr(value, "__len__") and not isinstance(value, Scan | str | dict):
        state[key] = value[: len(value) // 2] if len(value) else [7]
    elif how > 2 and isinstance(value, np.ndarray) and value.size and value.dtype.kind in "if":
        changed = value.reshape(-1).copy()
        whole = (np.iinfo(np.int64).max, -1, -(1 << 62), 0, 1 << 40)
        broken = (np.nan, np.inf, -np.inf, -1.0, 1e300, 0.0)
        changed[rng.integers(value.size)] = rng.choice(whole if value.dtype.kind == "i" else broken)
        state[key] = changed.reshape(value.shape)
    else:
        state[key] = WRONG[rng.integers(len(WRONG))]


def test_a_state_of_which_any_part_is_wrong_is_refused_or_harms_nobody(tracker, tmp_path):
    path, rng, said = tmp_path / "state.npz", np.random.default_rng(3), []
    places = list(parts_of(tracker.state()["lag"]))
    assert len(places) > 150
    for where in rng.permutation(len(places) * min(TIMES, 4)).tolist():
        state = {**tracker.state()}
        state["lag"] = deepcopy(state["lag"])
        damage(rng, state["lag"], places[where % len(places)])
        try:
            save_state(path, tracker.config, state)
        except (TypeError, OverflowError):
            continue  # no file can hold it
        try:
            loaded = Tracker.load(path)
        except DataError as error:
            said.append(str(error))
            continue
        # What could be goes on, whatever comes of it.
        try:
            for scan in list(scene(5))[:14]:
                loaded.step(Scan(scan.t + 60.0, scan.sensor, scan.boxes, scan.scores))
            loaded.drain_smoothed()
            loaded.finish()
        except (JeatGraphError, ValueError, OverflowError):
            pass
    assert len(said) > 0.5 * len(places)
    assert all(one.startswith(f"{path}: ") and "\n" not in one for one in said)


@pytest.mark.parametrize("missing", [True, False])
def test_what_is_of_other_identities_is_refused(missing, tracker, tmp_path):
    causal = Tracker(load_config("default", ["smoother.identities=causal"]), image=(1280, 720))
    one, other = (tracker, {"lag": None}) if missing else (causal, {"lag": tracker.state()["lag"]})
    save_state(tmp_path / "state.npz", one.config, one.state() | other)
    with pytest.raises(DataError, match="is damaged: what was decided with a lag is missing"):
        Tracker.load(tmp_path / "state.npz")


@pytest.mark.parametrize("value", [-1, 8, True, 3.0, "3", None])
def test_what_is_no_whole_number_within_bounds_is_refused(value):
    with pytest.raises(DataError, match="is damaged"):
        whole_number(value, 7)
    assert [whole_number(good, 7) for good in (0, 7)] == [0, 7]
