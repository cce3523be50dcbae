"""Identities that are decided with a lag, while the recording goes on."""

from __future__ import annotations

import io
import sys
from dataclasses import replace

import numpy as np
import pytest

from jeat_graph import Scan, Tracker, Trajectories, load_config, read_run
from jeat_graph.association.linking import Past, Pieces, join
from jeat_graph.association.path_cover import Links
from jeat_graph.cli.main import main
from jeat_graph.data.errors import ConfigError
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.service.checking import tracker_config
from jeat_graph.live.service.config import TrackedBy
from jeat_graph.tracking.identities.passes import camera_moved, took
from jeat_graph.tracking.identities.window_rows import WindowRows, continuing, one_piece_an_identity
from jeat_graph.tracking.identities.windows import LagDecider

SIZE = ("image.width=3840", "image.height=2160")
LAG = ("smoother.identities=lag", *SIZE)
RATE = 20.0


def boxes_of(*centres):
    return np.array([[x - 15.0, y - 20.0, 30.0, 40.0] for x, y in centres]).reshape(-1, 4)


def street(seconds=12.0, gap=(2.0, 4.6)):
    """One who is hidden for longer than a causal track lives, and two that are seen all the time."""
    rng = np.random.default_rng(2)
    scans = []
    for k in range(int(seconds * RATE)):
        t = k / RATE
        centres = [(300.0 + 20.0 * t, 900.0), (1500.0 - 40.0 * t, 1500.0)]
        if not gap[0] < t < gap[1]:
            centres.append((40.0 + 60.0 * t, 200.0))
        centres = np.array(centres) + rng.normal(scale=0.5, size=(len(centres), 2))
        scans.append(Scan(t, "rgb", boxes_of(*centres), np.full(len(centres), 0.9)))
    return scans


def online(scans, *changes, every=7):
    """The rows, and at which time of the stream each came."""
    tracker, parts, came = Tracker(load_config("default", changes)), [], []
    for k, scan in enumerate(scans):
        tracker.step(scan)
        if k % every == 0:
            parts.append(tracker.drain_smoothed())
            came.append(np.full(len(parts[-1]), scan.t))
    parts.append(tracker.finish())
    came.append(np.full(len(parts[-1]), scans[-1].t))
    return tracker, Trajectories.concatenate(parts), np.concatenate(came)


def test_who_was_hidden_has_one_identity_while_the_stream_goes_on():
    tracker, rows, came = online(street(), *LAG)
    high = rows.boxes[:, 1] < 400.0
    assert len(set(rows.track_id[high].tolist())) == 1
    assert len(set(rows.causal_id[high].tolist())) == 2
    assert len(set(rows.track_id.tolist())) == 3
    # Decided with a lag of a second, in steps of half of it; the smoother gives rows out after two more.
    assert (came - rows.t).max() <= 1.0 + 0.5 + 2.0 + 7 / RATE + 1e-6
    links = tracker.identity_links()
    joined = np.flatnonzero(links.tail != links.head)
    assert len(joined) == 1
    assert links.terms.sum(axis=1) == pytest.approx(links.log_ratio)
    assert (links.t_tail[joined], links.t_head[joined]) == (pytest.approx([2.0]), pytest.approx([4.6]))


@pytest.mark.parametrize("smoother", ["fixed-lag", "full"])
def test_where_nothing_is_to_be_joined_rows_are_those_of_causal_identities(smoother):
    scans, engine = street(gap=(99.0, 99.0)), f"smoother.engine={smoother}"
    rows = online(scans, *LAG, engine)[1]
    causal = online(scans, *SIZE, engine)[1]
    order, expected = (np.lexsort((one.t, one.track_id)) for one in (rows, causal))
    for name in ("t", "track_id", "boxes", "existence", "var"):
        assert np.array_equal(getattr(rows, name)[order], getattr(causal, name)[expected]), name
    assert np.array_equal(rows.causal_id, rows.track_id)


def test_rows_do_not_depend_on_when_they_are_fetched_and_none_is_there_twice():
    once, often = (online(street(), *LAG, every=every)[1] for every in (10**6, 1))
    assert len(once) == len(often) == len({*zip(often.t.tolist(), often.track_id.tolist(), strict=True)})
    order = [np.lexsort((one.t, one.track_id)) for one in (once, often)]
    assert np.array_equal(once.track_id[order[0]], often.track_id[order[1]])
    assert np.array_equal(once.boxes[order[0]], often.boxes[order[1]])


def test_what_is_decided_never_changes_and_what_comes_later_has_no_part_in_it():
    """Each prefix of a stream decides as the whole does, up to the last window that both have."""
    scans = street()
    whole = decided(scans)
    for end in (70, 130, 171):
        part = decided(scans[:end], final=False)
        assert len(part) > 0
        assert part == whole[: len(part)]


def decided(scans, final=True):
    tracker, decider, out = Tracker(load_config("default", SIZE)), LagDecider(1.0), []
    for scan in scans:
        tracker.step(scan)
        decider.add([scan], took(tracker, len(scan)), camera_moved(tracker))
        if decider.is_due():
            out += decider.decide(tracker)[0]
    out += decider.decide(tracker, final=True)[0] if final else []
    assert [step.t for step in out] == [scan.t for scan in scans[: len(out)]]
    return [tuple(step.owner.tolist()) for step in out]


def test_memory_is_bounded_by_what_is_in_view():
    """Of cars that pass for ever."""
    tracker, sizes = Tracker(load_config("default", (*LAG, "smoother.lag_s=.5"))), []
    for k in range(1200):
        t = k / 10.0
        x = np.array([20.0 * (t - 8.0 * car) for car in range(int(t / 8.0) - 1, int(t / 8.0) + 1)]) * 8.0
        scan = Scan(t, "rgb", boxes_of(*((one, 300.0) for one in x if one > 0)), np.full((x > 0).sum(), 0.9))
        tracker.step(scan)
        tracker.drain_smoothed()
        lag = tracker._lag
        kept = lag._decider
        held = [len(lag._whole.last), len(lag._whole.of_causal), len(lag._all_decided().t), len(lag._label)]
        sizes.append([*held, len(kept._steps), len(kept._kept.t), len(kept._named), len(kept._count)])
    early, late = np.array(sizes[300:600]).max(axis=0), np.array(sizes[900:]).max(axis=0)
    assert (late <= early + 2).all(), (early, late)


def test_scans_that_come_late_are_decided_as_if_they_had_not():
    scans = street(seconds=8.0)
    expected = online(scans, *LAG)[1]
    live = LiveTracker(Tracker(load_config("default", LAG)))
    late = [scans[k ^ 1] if 20 <= k < 60 else scans[k] for k in range(len(scans))]
    for scan in late:
        live.step(scan)
    rows = live.finish()
    assert sorted(rows.t.tolist()) == sorted(expected.t.tolist())
    high = rows.boxes[:, 1] < 400.0
    assert len(set(rows.track_id[high].tolist())) == 1
    assert len(set(rows.causal_id[high].tolist())) == 2


def test_rows_so_far_are_what_an_end_now_would_give():
    tracker = Tracker(load_config("default", LAG))
    for scan in street(seconds=3.0):
        tracker.step(scan)
    so_far = tracker.smoothed()
    assert np.array_equal(so_far.boxes, tracker.finish().boxes)
    assert len(so_far) > 0


def test_a_service_takes_it_and_the_engine_of_the_paper_does_not():
    asked = TrackedBy(set=("smoother.identities=lag",))
    assert tracker_config(asked, [], None, smoothed=True).smoother.identities == "lag"
    with pytest.raises(ConfigError, match="'lag' needs another engine"):
        load_config("paper", ["smoother.identities=lag"])


def test_track_and_stream_write_the_same_identities(tmp_path, monkeypatch):
    rows = ["t,sensor,left,top,width,height,score"]
    for scan in street(seconds=8.0):
        rows += [f"{scan.t},rgb,{','.join(f'{x:.3f}' for x in box)},.9" for box in scan.boxes]
    (tmp_path / "d.csv").write_text("\n".join(rows) + "\n")
    more = ["--image", "3840x2160", "--set", "smoother.identities=lag", "--set", "sensors.rgb.rate_hz=20"]
    assert main(["track", str(tmp_path / "d.csv"), *more, "--out", str(tmp_path / "run")]) == 0
    smoothed = read_run(tmp_path / "run").smoothed
    assert len(set(smoothed.track_id.tolist())) == 3
    assert (tmp_path / "run" / "links.csv").read_text().count("\n") > 1
    raw = (tmp_path / "d.csv").read_bytes()
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(raw)))
    assert main(["stream", "--smoothed", str(tmp_path / "s.csv"), *more]) == 0
    lines = [
        sorted(path.read_text().splitlines())
        for path in (tmp_path / "run" / "smoothed.csv", tmp_path / "s.csv")
    ]
    assert lines[0][-1].startswith("t,track_id,")
    assert lines[0][-1].endswith("causal_id,identity_probability")
    assert lines[0] == lines[1]


def test_a_track_goes_on_with_the_identity_whose_last_detection_it_has():
    """Tracks 1 and 2 changed places at the third detection; 3 is new; what was decided is one piece each."""
    causal = np.array([1, 2, 1, 2, 1, 2, 3])
    owner = np.array([10, 20, 20, 10, -1, -1, -1])
    n = len(causal)
    number, t, sensor = np.arange(n), np.arange(n) / 10.0, np.zeros(n, int)
    camera, std = np.zeros((n, 2)), np.full((n, 4), np.nan)
    rows = WindowRows(number, t, sensor, np.zeros((n, 4)), causal, np.zeros(n), owner, camera, std)
    assert continuing(rows, causal).tolist() == [-10, -20, -20, -10, -20, -10, 3]
    # A track whose identity went on with another one in the meantime continues nothing.
    rows = rows._replace(owner=np.array([10, 20, 10, 10, -1, -1, -1]))
    assert continuing(rows, causal).tolist() == [-10, -20, -10, -10, 1, -10, 3]
    piece = np.array([0, 1, 2, 3, 2, 3, 4])
    assert one_piece_an_identity(piece, rows.owner).tolist() == [0, 1, 0, 0, 0, 0, 2]


def test_of_a_recording_that_goes_on_births_and_exits_are_counted_from_its_beginning():
    pieces = Pieces(np.array([0.0, 5.0]), np.array([4.0, 9.0]), *np.zeros((2, 2), dtype=bool))
    possible = Links(np.array([0]), np.array([1]), np.array([2.0]))
    span, votes = (0.0, 10.0), np.zeros(1)
    gains = [
        join(pieces, possible, votes, span, 0.1, past).links.gain[0]
        for past in (None, Past(np.array([20.0, 0.0]), np.zeros(2), np.zeros(2), np.zeros(0)))
    ]
    # Twenty births more in the interior: the second piece is likelier to be another one.
    assert gains[0] - gains[1] > 2.0


def test_where_time_goes_on_from_another_moment_no_row_is_lost():
    scans, tables = street(seconds=4.0, gap=(99.0, 99.0)), []
    for changes in (LAG, SIZE):
        tracker, parts = Tracker(load_config("default", changes)), []
        for k, scan in enumerate(scans):
            if k == 50:
                tracker.reset(0.0)
            tracker.step(scan if k < 50 else replace(scan, t=scan.t - 2.4))
            if k % 9 == 0:
                parts.append(tracker.drain_smoothed())
        tables.append(Trajectories.concatenate([*parts, tracker.finish()]))
    rows, causal = (one.take(np.lexsort((one.t, one.track_id))) for one in tables)
    assert len(set(rows.track_id.tolist())) == 6
    assert np.array_equal(rows.track_id, causal.track_id)
    assert np.array_equal(rows.boxes, causal.boxes)
