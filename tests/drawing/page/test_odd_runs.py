"""The page of a run of which something is missing, odd, hostile or very long."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.tables.trajectories_io import read_trajectories, write_trajectories


def test_a_run_without_diagnostics_says_which_option_makes_them(copy_of, report):
    html = report(copy_of("diagnostics.csv"))
    assert "track --diagnostics" in html.said
    assert "Consistency by sensor" not in html.tables
    tracks = html.data["tracks"]
    assert tracks
    assert all(one["nis"] is None and one["scale"] is None for one in tracks)


def test_a_run_without_smoothed_table_is_shown_and_says_so(full_run, copy_of, report):
    causal = read_trajectories(full_run.run / "causal.csv")
    html = report(copy_of("smoothed.csv"))
    assert "There is no smoothed table" in html.said
    assert [row["table"] for row in html.tables["Tracks"]] == ["causal"]
    assert len(html.data["tracks"]) == len(np.unique(causal.track_id))
    assert "dx" not in html.data["tracks"][0]["motion"]


def test_a_run_without_record_is_shown_and_says_so(copy_of, report):
    assert "There is no run.json" in report(copy_of("run.json")).said


def test_inputs_that_are_gone_leave_out_the_comparison_with_the_reason(copy_of, tmp_path):
    run = copy_of()
    record = json.loads((run / "run.json").read_text())
    record["reading"]["detections"] = [str(tmp_path / "gone.csv")]
    record["inputs"][0]["absolute"] = str(tmp_path / "gone.csv")
    (run / "run.json").write_text(json.dumps(record))
    assert main(["report", str(run), "--out", str(tmp_path / "page.html")]) == 0
    text = (tmp_path / "page.html").read_text()
    assert "Filter against smoother is not shown" in text
    assert "--detections" in text


def test_a_single_table_is_shown_and_named_as_one(full_run, report):
    html = report(full_run.run / "smoothed.csv")
    assert "This is a single table, not a run directory" in html.said
    assert [row["table"] for row in html.tables["Tracks"]] == ["smoothed"]


def test_an_empty_run_is_a_page_without_script(tmp_path, report):
    run = tmp_path / "run"
    run.mkdir()
    write_trajectories(Trajectories.empty(("rgb",)), run / "causal.csv")
    write_trajectories(Trajectories.empty(("rgb",)), run / "smoothed.csv")
    html = report(run)
    assert "This run has no tracks." in html.said
    assert html.attributes("script") == []


def test_a_single_row_is_enough(tmp_path, report):
    run = tmp_path / "run"
    run.mkdir()
    one = Trajectories(
        t=np.array([1.5]),
        track_id=np.array([7]),
        boxes=np.array([[10.0, 20.0, 30.0, 40.0]]),
        existence=np.array([0.9]),
        mean=np.array([[25.0, 40.0, 0, 0, 0, 0]]),
        var=np.ones((1, 6)),
        used=np.array([1]),
        sensors=("rgb",),
    )
    write_trajectories(one, run / "causal.csv")
    data = report(run).data
    assert data["tracks"][0]["id"] == 7
    assert data["start_ms"] == 1500


HOSTILE = "</script><script>alert(1)</script>\"'&"


def test_hostile_names_of_sensors_and_files_stay_text(tmp_path, report):
    run = tmp_path / "run<b>&amp;"
    run.mkdir()
    n = 5
    table = Trajectories(
        t=np.arange(n) * 0.1,
        track_id=np.ones(n, dtype=np.int64),
        boxes=np.tile([10.0, 20.0, 30.0, 40.0], (n, 1)),
        existence=np.ones(n),
        mean=np.tile([25.0, 40.0, 0, 0, 0, 0], (n, 1)),
        var=np.ones((n, 6)),
        used=np.ones(n, dtype=np.int64),
        sensors=(HOSTILE,),
    )
    write_trajectories(table, run / "causal.csv")
    (run / "run.json").write_text(
        json.dumps(
            {
                "inputs": [{"path": HOSTILE, "bytes": 1, "sha256": HOSTILE}],
                "warnings": [HOSTILE],
                "config": {"sensors": {HOSTILE: {}}},
                "config_name": HOSTILE,
                "version": HOSTILE,
                "timings": {HOSTILE: 1.0},
            }
        )
    )
    html = report(run)
    assert len(html.attributes("script")) == 2
    assert html.attributes("b") == []
    assert html.data["sensors"] == [HOSTILE]
    assert html.tables["Inputs"][0]["file"] == HOSTILE
    assert html.tables["Timings"][0]["what"] == HOSTILE
    assert f"Warning of the run: {HOSTILE}" in html.said
    assert "run<b>&amp; 1 tracks" in html.said


@pytest.mark.slow
def test_many_long_tracks_stay_below_five_megabytes(tmp_path, report):
    tracks, steps = 50, 3000
    rng = np.random.default_rng(1)
    t = np.repeat(np.arange(steps) * 0.01, tracks)
    n = len(t)
    table = Trajectories(
        t=t,
        track_id=np.tile(np.arange(1, tracks + 1), steps),
        boxes=rng.uniform(1, 500, (n, 4)),
        existence=rng.uniform(0, 1, n),
        mean=rng.normal(300, 100, (n, 6)),
        var=rng.uniform(1, 100, (n, 6)),
        used=rng.integers(0, 4, n),
        sensors=("evt", "rgb"),
    )
    run = tmp_path / "run"
    run.mkdir()
    write_trajectories(table, run / "causal.csv")
    shutil.copy(run / "causal.csv", run / "smoothed.csv")
    assert len(report(run).text) < 5e6


def test_what_is_no_run_is_refused(tmp_path, capsys):
    assert main(["report", str(tmp_path), "--out", str(tmp_path / "x.html")]) == 2
    assert "neither causal.csv nor smoothed.csv" in capsys.readouterr().err
    assert not (tmp_path / "x.html").exists()


@pytest.mark.parametrize("text", ["{", "[1]"])
def test_a_record_that_is_no_record_is_refused(copy_of, tmp_path, capsys, text):
    run = copy_of()
    (run / "run.json").write_text(text)
    assert main(["report", str(run), "--out", str(tmp_path / "x.html")]) == 2
    caught = capsys.readouterr().err
    assert "run.json" in caught
    assert caught.count("\n") == 1
