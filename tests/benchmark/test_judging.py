"""Jobs and their summary."""

import operator

import pytest

from jeat_graph.benchmark.contenders import key, ours, peers
from jeat_graph.benchmark.judging import in_processes, spread, summarise
from jeat_graph.benchmark.recordings import find_kitti, kitti, simulated
from jeat_graph.config_io import load_config


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
    default, paper = load_config("default"), load_config("paper")
    rows = ours(default, paper, "default", ("rgb", "evt"))
    assert len({r.row for r in rows}) == len(rows)
    assert rows[0].config == default
    sequential = next(r for r in rows if r.row.startswith("default") and r.row.endswith("sequential"))
    assert sequential.config.association.method == "sequential"
    assert sequential.config.association.priority == ("rgb", "evt")


def test_peers_run_on_each_sensor_and_on_both_with_defaults_and_with_what_was_found():
    found = {key("sort", ("rgb",)): {"min_score": 0.5}}
    rows = peers(("rgb", "evt"), found)
    assert len(rows) == 4 * 3 + 1
    assert {r.sensors for r in rows} == {("rgb",), ("evt",), ("rgb", "evt")}
    assert [dict(r.parameters) for r in rows if r.row.endswith("tuned")] == [{"min_score": 0.5}]


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
