"""Sensors that nobody has declared are met: any name will do, in Python and in `stream`."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from jeat_graph import Scan, Tracker, Trajectories, load_config
from jeat_graph.cli.main import main
from jeat_graph.data.errors import UnknownSensorError
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking import first_sight

IMAGE = (1280, 720)


def scan(k: int, sensor: str, off: float = 0.0) -> Scan:
    boxes = [[100.0 + 4 * k + off, 200.0, 60.0, 40.0], [900.0 - 5 * k + off, 400.0, 80.0, 50.0]]
    return Scan(k / 20.0, sensor, np.array(boxes), np.array([0.9, 0.8]))


def scans(count: int = 60, late: int = 20) -> list[list[Scan]]:
    """`cam1` from the beginning, `thermal` from some scan on."""
    return [[scan(k, "cam1")] + [scan(k, "thermal", 1.0)] * (k >= late) for k in range(count)]


def assert_same(one: Trajectories, other: Trajectories):
    for name in ("t", "track_id", "boxes", "existence", "mean", "var", "size_var"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.sensor_text() == other.sensor_text()


def test_a_tracker_that_meets_a_sensor_is_as_if_it_had_been_declared():
    known = Tracker(first_sight.wider(load_config("default"), ["cam1", "thermal"]), image=IMAGE)
    meets = Tracker(image=IMAGE)
    assert_same(
        Trajectories.concatenate([meets.step(one) for one in scans()]),
        Trajectories.concatenate([known.step(one) for one in scans()]),
    )
    assert meets.config.sensor_names == known.config.sensor_names == ("cam1", "thermal")
    assert_same(meets.finish(), known.finish())


def test_rows_that_were_drained_before_do_not_come_again():
    def smoothed(tracker):
        rows = []
        for k, one in enumerate(scans(120, late=80)):
            tracker.step(one)
            if k % 20 == 0:
                rows.append(tracker.drain_smoothed())
        return Trajectories.concatenate([*rows, tracker.finish()])

    known = Tracker(first_sight.wider(load_config("default"), ["cam1", "thermal"]), image=IMAGE)
    assert_same(smoothed(Tracker(image=IMAGE)), smoothed(known))


def test_seven_sensors_of_any_names():
    names = ["cam1", "Kamera Süd", "lidar/2", "a", "b", "c", "d"]
    tracker = Tracker(image=IMAGE)
    for k in range(30):
        for j, name in enumerate(names):
            table = tracker.update(scan(k, name).boxes, t=k / 20.0 + j / 200.0, sensor=name)
    assert len(table) == 2
    assert set(names) == set(tracker.sensor_names)


def test_who_comes_late_ends_no_track():
    tracker = Tracker(image=IMAGE)
    told = [tracker.step(one) for one in scans(400, late=300)]
    assert told[299].track_id.tolist() == told[-1].track_id.tolist() == [1, 2]


def test_a_configuration_that_declares_nobody_refuses_as_before():
    settings = ["sensors.rgb={}", "input.undeclared=refuse"]
    tracker = Tracker(load_config("default", settings), image=IMAGE)
    with pytest.raises(UnknownSensorError, match="cam1"):
        tracker.step(scan(0, "cam1"))
    with pytest.raises(UnknownSensorError, match="cannot be a name"):
        Tracker(image=IMAGE).step((0.0, "a|b", [], []))


def test_it_goes_on_from_a_file(tmp_path):
    whole, first = Tracker(image=IMAGE), Tracker(image=IMAGE)
    everything = [whole.step(one) for one in scans()]
    for one in scans()[:40]:
        first.step(one)
    first.save(tmp_path / "state.npz")
    given = Tracker(image=IMAGE).config
    for config in (None, given):
        second = Tracker.load(tmp_path / "state.npz", config)
        assert_same(
            Trajectories.concatenate([second.step(one) for one in scans()[40:]]),
            Trajectories.concatenate(everything[40:]),
        )


@pytest.mark.parametrize("policy", ["rewind", "skip"])
def test_a_live_tracker_meets_sensors_too(policy):
    known = LiveTracker(
        Tracker(first_sight.wider(load_config("default"), ["cam1", "thermal"]), image=IMAGE), policy
    )
    meets = LiveTracker(Tracker(image=IMAGE), policy)
    for one in scans():
        for part in one:
            first, second = meets.step(part), known.step(part)
            assert_same(first.table, second.table)
    assert_same(meets.finish(), known.finish())


def test_stream_takes_any_name_and_says_so_once(monkeypatch, capsys, tmp_path):
    lines = []
    for k in range(40):
        boxes = scan(k, "x").boxes.tolist()
        name = "gantry 7" if k % 2 else "cam1"
        lines.append(json.dumps({"t": k / 20.0, "sensor": name, "boxes": boxes, "scores": [0.9, 0.8]}))
    state = tmp_path / "state.npz"
    command = ["stream", "--image", "1280x720", "--checkpoint", str(state), "--every", "0.5"]
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO("\n".join(lines[:30]).encode())))
    assert main(command) == 0
    out, err = capsys.readouterr()
    assert len(out.splitlines()) == 30
    assert err.count("'cam1' is not declared") == err.count("'gantry 7' is not declared") == 1
    assert err.count("taken for a detector; without a scan for 1 s it counts as silent") == 2
    assert " Hz" not in err, "nobody has measured a rate yet"
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO("\n".join(lines[30:]).encode())))
    assert main(command) == 0
    out, err = capsys.readouterr()
    assert len(out.splitlines()) == 10
    assert "declared" not in err
    assert len(json.loads(out.splitlines()[-1])["tracks"]) == 2
