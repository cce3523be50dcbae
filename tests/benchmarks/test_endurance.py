"""`benchmarks endurance`: the same input each time, late and out of order, and nothing that grows."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.endurance import PERIODS, Load, run_endurance
from benchmarks.endurance_input import RATES_HZ, messages
from benchmarks.latency_counts import LatencyCounts


def told(message):
    (scan,) = message.batch.scans
    return message.seq, scan.t, scan.sensor, scan.boxes.tolist()


def test_the_input_is_both_sensors_whole_late_and_the_same_from_any_second_on():
    all_of_it = [told(message) for message in messages(4, 3, 1)]
    times = {name: sorted(t for _, t, sensor, _ in all_of_it if sensor == name) for name in RATES_HZ}
    # What is still on its way at the end has not arrived.
    assert len(times["evt"]) >= 4 * 100 - 3
    assert len(times["rgb"]) >= 4 * 20 - 3
    by_arrival = [t for _, t, _, _ in all_of_it]
    assert by_arrival != sorted(by_arrival)
    numbers = [seq for seq, *_ in all_of_it]
    assert numbers == sorted(set(numbers))
    later = [told(message) for message in messages(4, 3, 1, first=2)]
    assert later == all_of_it[-len(later) :]
    assert len(later) == pytest.approx(240, abs=5)


def test_durations_are_counted_to_one_per_cent():
    rng = np.random.default_rng(0)
    took, counts = rng.lognormal(-7.0, 1.0, 5000), LatencyCounts()
    for seconds in took.tolist():
        counts.add(seconds)
    assert len(counts) == 5000
    assert counts.max_s == took.max()
    for share in (0.01, 0.5, 0.99, 1.0):
        assert counts.quantile(share) == pytest.approx(
            np.quantile(took, share, method="inverted_cdf"), rel=0.01
        )
    counts.clear()
    assert np.isnan(counts.quantile(0.5))


def test_a_short_day_keeps_its_vehicles_its_memory_and_its_temper(tmp_path, capsys):
    out = tmp_path / "periods.json"
    code = main(["endurance", "--hours", "0.003", "--vehicles", "3", "--out", str(out)])
    assert code == 0
    assert "0 warnings" in capsys.readouterr().out
    periods = json.loads(out.read_text())
    assert len(periods) == PERIODS
    assert sum(one["scans"] for one in periods) > 1200
    later = periods[6:]
    assert {one["reported"] for one in later} == {3}
    assert periods[-1]["rows"] > 1800
    # No more is kept at the end than after a quarter, but for what an allocator does.
    assert periods[-1]["memory_mb"] < later[0]["memory_mb"] + 20.0


@pytest.mark.slow
def test_a_day_that_was_broken_off_goes_on_and_counts_what_an_unbroken_one_counts(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.endurance._CHECKPOINT_S", 3.0)
    load, file = Load(12.0 / 3600.0, 3), tmp_path / "state.npz"

    class BrokenOffError(Exception):
        pass

    def break_off(periods):
        if len(periods) == 13:
            raise BrokenOffError

    with pytest.raises(BrokenOffError):
        run_endurance(load, break_off, file)
    resumed, warnings = run_endurance(load, checkpoint=file)
    whole, _ = run_endurance(load)
    assert warnings == []
    outcome = [
        [(one.end_s, one.reported, one.born, one.rows) for one in periods] for periods in (resumed, whole)
    ]
    assert outcome[0] == outcome[1]
    with pytest.raises(Exception, match="another endurance test"):
        run_endurance(Load(1.0, 3), checkpoint=file)
