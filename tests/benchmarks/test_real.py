"""`benchmarks real`, in small, and what it is made of."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import real
from benchmarks.__main__ import main
from benchmarks.peer_cache import PeerCache, cache_key
from benchmarks.real_copies import LEFT_OUT, MOVED, altered
from benchmarks.recordings import JudgedRecording, simulated
from benchmarks.robustness import judge_variation, variations, varied
from jeat_graph.data.errors import DataError
from jeat_graph.io.detections_io import write_detections
from jeat_graph.io.truth_io import write_truth


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Two short simulated recordings, laid out as the real ones are."""
    folder = tmp_path_factory.mktemp("data")
    for seed in (5, 6):
        one = simulated("day-sparse", seed, 0.5)
        renamed = replace(one.detections, sensors=("lidar", "rgb"))
        path = folder / "kitti" / f"{seed:04d}"
        path.mkdir(parents=True)
        write_detections(renamed, path / "detections.csv")
        write_truth(one.truth, path / "gt.csv")
    return folder


def test_every_stream_is_judged_and_the_tables_come_back_from_the_file(data, tmp_path, capsys):
    out = tmp_path / "out"
    small = ["--no-peers", "--no-calibrate", "--no-worlds", "--no-robustness", "--jobs", "1"]
    assert main(["real", "--data", str(data), "--out", str(out), *small]) == 0
    shown = capsys.readouterr().out
    result = json.loads((out / "real.json").read_text())
    assert result["settings"]["data"] == {"KITTI cars": ["0005", "0006"]}
    streams = {tuple(one["sensors"]) for one in result["ours"]}
    assert streams == {("rgb",), ("lidar",), ("rgb", "lidar")}
    for one in result["ours"]:
        assert one["causal"]["sequences"] == one["smoothed"]["sequences"] == 2
        assert set(one["by_recording"]) == {"0005", "0006"}
    assert main(["real", "--from", str(out / "real.json")]) == 0
    assert capsys.readouterr().out == shown


def test_copies_are_altered_a_little_and_judged_with_their_spread(data, tmp_path, capsys):
    few = [
        "--no-peers",
        "--no-calibrate",
        "--no-worlds",
        "--no-robustness",
        "--quick",
        "--copies",
        "2",
        "--jobs",
        "1",
    ]
    assert main(["real", "--data", str(data), "--out", str(tmp_path), *few]) == 0
    assert "mean of 2 altered copies" in capsys.readouterr().out
    found = json.loads((tmp_path / "real.json").read_text())["copies"]
    assert len(found) == 2 * 3 * 2  # copies, streams, tables
    mine = [e for e in found if e["row"] == "default, rgb + lidar" and e["kind"] == "causal"]
    mota = [e["scores"]["MOTA"] for e in mine]
    assert len(mota) == 2
    assert mota[0] != mota[1]
    lines = (tmp_path / "real.md").read_text().splitlines()
    cells = [line.split("|") for line in lines if line.startswith("| default, rgb + lidar") and "±" in line]
    assert cells[0][2].startswith(f" {np.mean(mota):.1f}±{np.std(mota, ddof=1):.1f} /")


def test_an_altered_copy_has_the_scans_of_the_original_and_boxes_near_its():
    original = simulated("day", 5, 4.0).detections
    copy = altered(original, np.random.default_rng(0))
    np.testing.assert_array_equal(copy.scan_t, original.scan_t)
    left = 1.0 - len(copy.scores) / len(original.scores)
    assert abs(left - LEFT_OUT) < 4.0 * np.sqrt(LEFT_OUT / len(original.scores))
    for k in range(len(original.scan_t)):
        before = slice(*original.scan_start[k : k + 2])
        after = slice(*copy.scan_start[k : k + 2])
        kept = np.isin(original.scores[before], copy.scores[after])
        assert kept.sum() == len(copy.scores[after])
        was, now = original.boxes[before][kept], copy.boxes[after]
        assert np.all(np.abs(now - was) < 6.0 * MOVED * was[:, [2, 3, 2, 3]])
        assert np.any(now != was) or len(now) == 0


def test_a_folder_without_recordings_is_said(tmp_path, capsys):
    small = ["--no-peers", "--no-worlds", "--no-robustness"]
    assert main(["real", "--data", str(tmp_path), *small]) == 0
    assert "no real recordings" in capsys.readouterr().err


def test_a_result_is_computed_once_and_again_when_its_recording_changes(tmp_path):
    one = simulated("day", 5, 2.0)
    calls = []

    def compute():
        calls.append(1)
        return {"scores": {"MOTA": 1.0}}

    key = cache_key("sort", ("rgb",), {}, [one])
    for _ in range(2):
        assert PeerCache(tmp_path / "peers.json").get(key, compute) == {"scores": {"MOTA": 1.0}}
    assert len(calls) == 1
    other = JudgedRecording(one.name, replace(one.detections, scores=one.detections.scores * 0.5), one.truth)
    assert cache_key("sort", ("rgb",), {}, [other]) != key
    assert cache_key("sort", ("rgb",), {"min_score": 0.5}, [one]) != key


def test_a_file_that_is_no_cache_is_refused(tmp_path):
    path = tmp_path / "peers.json"
    path.write_text("[1]")
    with pytest.raises(DataError, match="no file of cached results"):
        PeerCache(path)


@pytest.fixture(scope="module")
def plain():
    return varied("as it is", 0, 1.0)


@pytest.mark.parametrize("name", [v.name for v in variations()])
def test_each_variation_changes_the_recording(name, plain):
    odd = varied(name, 0, 1.0)
    same = np.array_equal(plain.detections.boxes, odd.detections.boxes) and np.array_equal(
        plain.detections.scores, odd.detections.scores
    )
    same = same and np.array_equal(plain.detections.scan_t, odd.detections.scan_t)
    assert same == (name == "as it is")


def test_a_variation_is_judged_with_sensors_that_the_preset_does_not_know():
    record = judge_variation(("default", "with a third, poor detector", 0, 2.0))
    assert record["scores"]["truth_boxes"] > 0
    assert record["scenario"] == "with a third, poor detector"


def test_other_worlds_are_judged_without_any_recording(tmp_path, capsys, monkeypatch):
    few = [one for one in real.worlds() if one.name in ("roundabout", "square")]
    monkeypatch.setattr(real, "worlds", lambda: few)
    small = ["--no-peers", "--no-robustness", "--seeds", "3", "4", "--duration", "2", "--jobs", "1"]
    assert main(["real", "--data", str(tmp_path), "--out", str(tmp_path), *small]) == 0
    shown = capsys.readouterr().out
    found = json.loads((tmp_path / "real.json").read_text())["worlds"]
    assert {(r["world"], r["seed"], r["kind"]) for r in found} == {
        (w.name, s, k) for w in few for s in (3, 4) for k in ("causal", "smoothed")
    }
    mota = [r["scores"]["MOTA"] for r in found if r["world"] == "square" and r["kind"] == "causal"]
    assert f"{np.mean(mota):.1f}±{np.std(mota, ddof=1):.1f} /" in shown
    assert main(["real", "--from", str(tmp_path / "real.json")]) == 0
    assert capsys.readouterr().out == shown
