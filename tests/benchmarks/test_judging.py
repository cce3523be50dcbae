"""Jobs and their summary."""

import operator

import numpy as np
import pytest

from benchmarks import peer_search
from benchmarks.association_table import SYNCHRONOUS, association_table
from benchmarks.baselines.search import SEARCH_GRIDS, grid
from benchmarks.common import scenario_table
from benchmarks.contenders import (
    NAMES,
    key,
    ours,
    peers,
    streams,
)
from benchmarks.judging import in_processes, spread, summarise
from benchmarks.peer_search import peers_here, recorded_best, search_parameters, search_table
from benchmarks.recordings import find_kitti, kitti, simulated
from jeat_graph.config.reading import load_config


def entry(row, scenario, mota):
    scores = {"MOTA": mota, "MOTP": 1.0, "HOTA": 2.0, "IDF1": 3.0, "FP": 4, "FN": 5, "IDSW": 6}
    return {"row": row, "scenario": scenario, "scores": scores}


def test_mean_and_sample_deviation_over_seeds():
    assert spread([1.0, 3.0, 5.0]) == pytest.approx((3.0, 2.0))
    assert spread([4.0]) == (4.0, 0.0)


def test_rows_and_scenarios_are_summarised_apart():
    found = summarise([entry("a", "day", 90.0), entry("a", "night", 70.0), entry("a", "day", 94.0)])
    assert [(e["row"], e["scenario"], e["MOTA"], e["seeds"]) for e in found] == [
        ("a", "day", 92.0, 2),
        ("a", "night", 70.0, 1),
    ]


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_jobs(workers):
    assert in_processes(operator.neg, list(range(20)), workers, "") == [-k for k in range(20)]


def test_sequential_association_serves_the_slower_sensor_first():
    default, paper = load_config("highway"), load_config("paper")
    rows = ours(default, paper, "default", ("rgb", "evt"))
    assert len({r.row for r in rows}) == len(rows)
    assert rows[0].config == default
    sequential = next(r for r in rows if r.row.startswith("default") and r.row.endswith("sequential"))
    assert sequential.config.association.method == "sequential"
    assert sequential.config.association.priority == ("rgb", "evt")


def test_peers_run_on_each_sensor_and_on_both_with_defaults_and_with_what_was_found():
    found = {key("sort", ("rgb",)): {"min_score": 0.5}}
    rows = peers(("rgb", "evt"), found)
    assert len(rows) == 5 * 3 + 1
    assert {r.sensors for r in rows} == {("rgb",), ("evt",), ("rgb", "evt")}
    assert [dict(r.parameters) for r in rows if r.row.endswith("tuned")] == [{"min_score": 0.5}]


def test_peers_that_are_not_installed_have_no_rows():
    rows = peers(("rgb", "evt"), {key("sort", ("rgb",)): {"min_score": 0.5}}, ["norfair"])
    assert [r.row for r in rows] == ["Norfair, rgb", "Norfair, evt", "Norfair, rgb + evt"]


def test_a_missing_package_is_said_and_its_trackers_are_left_out(monkeypatch, capsys):
    missing = {"norfair": ["norfair"]}
    monkeypatch.setattr("benchmarks.baselines.missing_packages", lambda name: missing.get(name, []))
    assert peers_here() == ["sort", "bytetrack", "ocsort", "botsort"]
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "Norfair left out (pip install rich filterpy && pip install --no-deps norfair)" in said


@pytest.mark.slow
def test_a_search_says_what_it_gained_on_each_stream(monkeypatch):
    pytest.importorskip("trackers", reason="needs the package trackers (extra baselines)")
    monkeypatch.setitem(SEARCH_GRIDS, "sort", {"minimum_consecutive_frames": (1, 20)})
    monkeypatch.setattr(peer_search, "SEARCH_DURATION_S", 1.0)
    found = search_parameters(["sort"], ("rgb", "evt"), None, 1)
    assert list(found) == ["sort/rgb", "sort/evt", "sort/rgb+evt"]
    for one in found.values():
        # One second is short: who waits for a third frame, or for 20, loses.
        assert one["parameters"] == {"minimum_consecutive_frames": 1}
        assert one["best"]["MOTA"] > one["default"]["MOTA"]
        assert one["tried"] == 3
    before, after = (found["sort/evt"][when]["HOTA"] for when in ("default", "best"))
    table = search_table(found, "searched")
    row = dict(zip(table.columns, table.rows[1], strict=True))
    assert row[""] == "sort/evt"
    assert row["HOTA"] == f"{before:.1f} → {after:.1f}"
    assert row["best"] == "minimum_consecutive_frames 1"


def test_every_parameter_that_was_found_belongs_to_a_grid():
    for recordings, sensors in (("simulated", ("rgb", "evt")), ("kitti", ("rgb", "lidar"))):
        best = recorded_best(recordings)
        assert set(best) == {key(name, stream) for name in NAMES for stream in streams(sensors)}
        for where, parameters in best.items():
            assert parameters in list(grid(where.partition("/")[0]))


def test_each_metric_has_its_spread_where_there_are_several_seeds():
    several = summarise([entry("a", "day", 90.0), entry("a", "day", 94.0)])
    assert scenario_table(several, "").rows == (("a", "92.0±2.8 / 1.0±0.0 / 2.0±0.0 / 3.0±0.0"),)
    assert scenario_table(summarise([entry("a", "day", 90.0)]), "").rows[0][1] == "90.0 / 1.0 / 2.0 / 3.0"


def test_ways_of_association_are_taken_from_the_rows_that_stand_for_them():
    names = {"d, both": "one slot", "c, both": "one slot", "d, both, sequential": "in turn"}
    result = {
        "settings": {"seeds": [0]},
        "summary": summarise(
            [entry(row, "day", 90.0) for row in ("d, both", "d, rgb", "d, both, sequential")]
        ),
        "association": {"names": names, "records": [entry("d, both", "synchronous", 80.0)]},
        "kitti": [entry("c, both", "", 70.0), entry("c, rgb", "", 60.0)],
    }
    table = association_table(result)
    assert table.columns == ("", "day", "synchronous", "KITTI")
    assert table.rows == (
        ("one slot", "90.0 / 2.0 / 3.0", "80.0 / 2.0 / 3.0", "70.0 / 2.0 / 3.0"),
        ("in turn", "90.0 / 2.0 / 3.0", None, None),
    )
    del result["association"]
    assert association_table(result) is None


def test_where_both_sensors_run_by_one_clock_every_rgb_scan_shares_its_time_with_an_event_scan():
    found = simulated(SYNCHRONOUS, 0, 2.0).detections
    rgb, evt = (found.scan_t[found.scan_sensor == found.sensors.index(name)] for name in ("rgb", "evt"))
    assert len(rgb) == 40
    assert np.isin(rgb, evt).mean() > 0.9
    jittered = simulated("night", 0, 2.0).detections
    assert len(np.unique(jittered.scan_t)) == len(jittered.scan_t)


def test_a_tracker_of_one_sensor_is_judged_at_the_times_of_that_sensor():
    recording = simulated("day", 0, 1.0)
    detections = recording.detections
    rgb = detections.scan_t[detections.scan_sensor == detections.sensors.index("rgb")]
    assert recording.instants(("rgb",)).tolist() == rgb.tolist()
    assert len(recording.instants()) > len(rgb)


def test_missing_data_are_found_missing(tmp_path):
    assert find_kitti(tmp_path) is None


@pytest.mark.skipif(find_kitti() is None, reason="../shared/data/kitti is missing")
def test_kitti_frames_without_vehicles_are_frames():
    folder = find_kitti()
    assert folder is not None
    for recording in kitti(folder):
        assert set(recording.detections.scan_t) <= set(recording.truth.frame_times())
