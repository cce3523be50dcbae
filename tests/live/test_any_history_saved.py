"""Whatever came before, what was saved loads, and both trackers go on with the same bytes."""

from __future__ import annotations

import os
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import JeatGraphError
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.tracker import Tracker

TIMES = 50 if os.environ.get("JEAT_GRAPH_FULL", "") not in ("", "0") else 1
COLUMNS = ("t", "track_id", "boxes", "existence", "mean", "var")
CONFIGS = {
    "lag": load_config("default", ["smoother.lag_s=0.3"]),
    "whole": load_config("default", ["smoother.engine=rts"]),
    "decided": load_config("default", ["smoother.lag_s=0.3", "smoother.identities=lag"]),
    "none": load_config("default", ["smoother.engine=none"]),
    # The clock of one sensor is known to be behind.
    "apart": load_config("default", ["smoother.lag_s=0.3", "sensors.evt.latency_s=0.4", "live.late_s=0.5"]),
}


def table_bytes(table):
    classes = () if table.classes is None else (table.classes.tolist(), table.class_probability.tobytes())
    decided = (
        () if table.causal_id is None else (table.causal_id.tobytes(), table.identity_probability.tobytes())
    )
    return (*(getattr(table, name).tobytes() for name in COLUMNS), sensors_of(table), *classes, *decided)


def sensors_of(table):
    """The names of the sensors of each row: their bits differ where one was refused and is declared later."""
    names = table.sensors
    return [{name for k, name in enumerate(names) if used >> k & 1} for used in table.used.tolist()]


def scan_at(t, sensor, count):
    """So many vehicles, which move with time."""
    boxes = [[100.0 + 150.0 * k + 20.0 * (t % 8.0), 100.0 + 90.0 * k, 60.0, 40.0] for k in range(count)]
    return (t, sensor, boxes, [0.9] * count, [("car", "bus")[k % 2] for k in range(count)])


# Seconds from message to message: in order, late, ahead of time, a clock that is set back or forward.
STEP_S = st.one_of(
    st.sampled_from([0.05, 0.05, 0.05, 0.0, 0.1]),
    st.sampled_from([-0.05, -0.2, -1.0, -4.0, -6.0, 6.0, 30.0, -30.0, 310.0, -3600.0, 1e9]),
)
MESSAGE = st.tuples(STEP_S, st.sampled_from(["rgb", "evt", "both"]), st.integers(0, 3))


def told(live, message, drains):
    """What is said to one message."""
    t, sensor, count = message
    names = ("evt", "rgb") if sensor == "both" else (sensor,)
    try:
        arrival = live.step([scan_at(t, name, count) for name in names])
    except JeatGraphError as error:
        return str(error)
    said = (arrival.t, arrival.late_s, arrival.reset, arrival.leapt)
    scans = [
        [(scan.t, scan.sensor) for scan in some]
        for some in (arrival.dropped, arrival.repeated, arrival.held, arrival.refuted, arrival.taken)
    ]
    smoothed = table_bytes(live.drain_smoothed()) if drains else ()
    return said, scans, table_bytes(arrival.table), smoothed


BACK = [(20.18, "evt", 2), (-2.65, "rgb", 2), (2.26, "rgb", 2), (-3.95, "evt", 2)]


@settings(max_examples=20 * TIMES)
@given(
    before=st.lists(MESSAGE, max_size=25),
    after=st.lists(MESSAGE, max_size=12),
    name=st.sampled_from([*CONFIGS]),
    policy=st.sampled_from(["rewind", "skip", "refuse"]),
    diagnostics=st.booleans(),
)
@example(before=BACK, after=[], name="lag", policy="rewind", diagnostics=False)
@example(before=BACK, after=BACK, name="decided", policy="rewind", diagnostics=False)
@example(before=BACK, after=[(0.0, "rgb", 2)], name="none", policy="rewind", diagnostics=True)
def test_after_any_history_a_live_tracker_is_saved_and_goes_on(before, after, name, policy, diagnostics):
    drains, t = name != "none", 0.0
    live = LiveTracker(Tracker(CONFIGS[name], image=(1280, 720), diagnostics=diagnostics), policy)
    for step_s, *rest in before:
        t += step_s
        told(live, (t, *rest), drains)
    with TemporaryDirectory() as folder:
        first, second = Path(folder, "first.npz"), Path(folder, "second.npz")
        live.save(first)
        loaded, _ = LiveTracker.load(first)
        loaded.save(second)
        assert second.read_bytes() == first.read_bytes()
    assert table_bytes(loaded.causal()) == table_bytes(live.causal())
    # That messages may come again after a restart is tested elsewhere (test_checkpoint).
    loaded._repetition.begins()
    for step_s, *rest in after:
        t += step_s
        assert told(loaded, (t, *rest), drains) == told(live, (t, *rest), drains)
    if drains:
        assert table_bytes(loaded.finish()) == table_bytes(live.finish())


ACT = st.one_of(
    st.tuples(st.just("step"), st.sampled_from([0.05, 0.1, 1.0, 310.0]), st.integers(0, 3)),
    st.tuples(st.just("anew"), st.sampled_from([-3600.0, -1.0, 0.0, 5.0]), st.just(0)),
    st.tuples(st.just("number"), st.just(0.0), st.integers(0, 50)),
    st.tuples(st.just("finish"), st.just(0.0), st.just(0)),
)


@settings(max_examples=15 * TIMES)
@given(
    acts=st.lists(ACT, max_size=20),
    cut=st.integers(0, 20),
    name=st.sampled_from(["lag", "decided", "whole", "none"]),
)
@pytest.mark.parametrize("diagnostics", [False, True])
def test_after_any_calls_a_tracker_is_saved_and_goes_on(acts, cut, name, diagnostics):
    tracker, t = Tracker(CONFIGS[name], image=(1280, 720), diagnostics=diagnostics), 0.0
    both = [tracker]
    for k, (what, seconds, count) in enumerate([*acts, ("step", 0.05, 2)]):
        t += seconds
        if k == min(cut, len(acts)):
            with TemporaryDirectory() as folder:
                tracker.save(Path(folder, "state.npz"))
                both.append(Tracker.load(Path(folder, "state.npz")))
        said = [act(one, what, t, count, name != "none") for one in both]
        assert said[-1] == said[0]


def act(tracker, what, t, count, smooths):
    """Do one thing with a tracker; what it says then."""
    if what == "anew":
        tracker.reset(t)
    elif what == "number":
        tracker.number_on_from(count)
    elif what == "finish":
        return table_bytes(tracker.finish())
    else:
        try:
            tracker.step(scan_at(t, "rgb", count))
        except JeatGraphError as error:
            return str(error)
    updates = table_bytes_of_updates(tracker) if tracker.has_diagnostics else ()
    smoothed = table_bytes(tracker.smoothed()) if smooths else ()
    return table_bytes(tracker.causal()), tracker.assigned(count).tolist(), updates, smoothed


def table_bytes_of_updates(tracker):
    told = tracker.last_updates()
    return told.track_id.tobytes(), told.nis.tobytes(), told.existence.tobytes(), told.noise_scale.tobytes()
