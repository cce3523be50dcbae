"""`benchmark endurance`: the same input each time, late and out of order, and nothing that grows."""

from __future__ import annotations

import json

from jeat_graph.benchmark.endurance import RATES_HZ, arrivals
from jeat_graph.cli.main import main


def test_the_input_is_both_sensors_whole_late_and_the_same_each_time():
    scans = list(arrivals(4.0, 3, 1))
    times = {name: sorted(scan.t for scan in scans if scan.sensor == name) for name in RATES_HZ}
    # What is still on its way at the end has not arrived.
    assert len(times["evt"]) >= 4 * 100 - 3
    assert len(times["rgb"]) >= 4 * 20 - 3
    assert [scan.t for scan in scans] != sorted(scan.t for scan in scans)
    again = list(arrivals(4.0, 3, 1))
    assert [(a.t, a.boxes.tolist()) for a in scans] == [(b.t, b.boxes.tolist()) for b in again]


def test_a_short_day_keeps_its_vehicles_its_memory_and_its_temper(tmp_path, capsys):
    out = tmp_path / "periods.json"
    code = main(["benchmark", "endurance", "--hours", "0.005", "--vehicles", "3", "--out", str(out)])
    assert code == 0
    assert "0 warnings" in capsys.readouterr().out
    periods = json.loads(out.read_text())
    assert len(periods) >= 24
    assert sum(one["scans"] for one in periods) > 2000
    later = periods[6:]
    assert {one["reported"] for one in later} == {3}
    assert periods[-1]["rows"] > 3000
    # No more is kept at the end than after a quarter, but for what an allocator does.
    assert periods[-1]["memory_mb"] < later[0]["memory_mb"] + 20.0
