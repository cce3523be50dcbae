"""Rows before and after the truth are false; in its gaps nothing is judged; Python and `eval` agree."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest

from jeat_graph import Trajectories, evaluate, read_run, read_truth, track
from jeat_graph.cli.main import main
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError, InputWarning


def mot(frames) -> str:
    return "".join(f"{k},1,{100 + k},100,50,50,1,-1,-1,-1\n" for k in frames)


def table(t) -> Trajectories:
    t = np.asarray(t, dtype=float)
    n = len(t)
    boxes = np.tile([100.0, 100.0, 50.0, 50.0], (n, 1))
    mean = np.zeros((n, 6))
    mean[:, :2] = 125.0
    return Trajectories(
        t, np.ones(n, dtype=np.int64), boxes, np.ones(n), mean, np.ones((n, 6)), np.zeros(n, int)
    )


def truth(tmp_path, t):
    path = tmp_path / "truth.csv"
    path.write_text(
        "t,object_id,left,top,width,height\n" + "".join(f"{one:.6f},1,100,100,50,50\n" for one in t)
    )
    return path


def judged(capsys, *arguments) -> tuple[dict, str]:
    assert main(["eval", *map(str, arguments), "--json", "-"]) == 0
    out, err = capsys.readouterr()
    return json.loads(out)["causal"], err


def test_two_hundred_frames_against_truth_of_twenty(tmp_path, capsys):
    result, short = tmp_path / "result.txt", tmp_path / "gt.txt"
    result.write_text(mot(range(1, 201)))
    short.write_text(mot(range(1, 21)))
    scores, err = judged(capsys, result, "--gt", short)
    assert (scores["FP"], scores["FN"], scores["MOTA"]) == (180, 0, -800.0)
    assert err.count("\n") == 1
    assert "180 rows" in err
    assert "result.txt" in err
    scores, err = judged(capsys, result, "--gt", short, "--outside", "ignored")
    assert (scores["FP"], scores["MOTA"], err) == (0, 100.0, "")
    with pytest.warns(InputWarning, match="180 rows"):
        assert evaluate(result, short)["causal"]["FP"] == 180
    assert evaluate(result, short, outside="ignored")["causal"]["FP"] == 0
    with pytest.raises(DataError, match="outside"):
        evaluate(result, short, outside="no")


@pytest.mark.parametrize(("frames", "false"), [(range(6, 21), 5), (range(1, 16), 5), (range(6, 16), 10)])
def test_before_and_after(tmp_path, capsys, frames, false):
    result, short = tmp_path / "result.txt", tmp_path / "gt.txt"
    result.write_text(mot(range(1, 21)))
    short.write_text(mot(frames))
    assert judged(capsys, result, "--gt", short)[0]["FP"] == false


def test_half_a_frame_beyond_is_none_of_it_and_more_is(tmp_path):
    at = np.arange(20) / 10.0
    path = truth(tmp_path, at)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert evaluate(table([*at, 1.949]), read_truth(path))["causal"]["FP"] == 0
    with pytest.warns(InputWarning, match="1 rows"):
        assert evaluate(table([*at, 2.0]), read_truth(path))["causal"]["FP"] == 1


def test_a_tracker_that_runs_more_often_may_end_within_the_last_frame(tmp_path):
    path = truth(tmp_path, np.arange(20) / 20.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert evaluate(table(np.arange(100) / 100.0), read_truth(path))["causal"]["FP"] == 0
    with pytest.warns(InputWarning, match="10 rows"):
        assert evaluate(table(np.arange(110) / 100.0), read_truth(path))["causal"]["FP"] == 10


def test_between_labelled_frames_nothing_is_judged(tmp_path):
    path = truth(tmp_path, np.arange(0, 20, 4) / 20.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert evaluate(table(np.arange(17) / 20.0), read_truth(path))["causal"]["FP"] == 0


def test_a_gap_of_a_result_is_a_gap_in_python_too(tmp_path, capsys):
    result, whole = tmp_path / "result.txt", tmp_path / "gt.txt"
    frames = [k for k in range(1, 31) if k not in (10, 11, 20)]
    result.write_text(mot(frames))
    whole.write_text(mot(range(1, 31)))
    (tmp_path / "seqinfo.ini").write_text("[Sequence]\nframeRate=25\n")
    scores, _ = judged(capsys, result, "--gt", whole)
    assert scores["FN"] == 3
    bare = read_run(result).causal
    assert bare is not None
    truth = read_truth(whole)
    for tracks in (read_run(result), bare, Trajectories.from_pandas(bare.to_pandas())):
        assert evaluate(tracks, truth)["causal"] == scores


def test_what_track_returns_is_judged_as_its_run_is(tmp_path, capsys):
    rows = [k for k in range(60) if k not in (40, 41)]
    t = np.arange(60) / 20.0
    boxes = np.full((60, 4), np.nan)
    boxes[rows] = [[100.0 + 5 * k, 100.0, 50.0, 50.0] for k in rows]
    found = Detections.from_rows(t, ["rgb"] * 60, boxes, np.full(60, 0.9), np.isnan(boxes[:, 0]))
    path = tmp_path / "detections.csv"
    found.to_pandas().to_csv(path, index=False)
    gt = tmp_path / "gt.csv"
    # Truth at other times than the scans: nothing but the run itself says when it ran.
    at = t[:-1] + 0.02
    gt.write_text(
        "t,object_id,left,top,width,height\n"
        + "".join(f"{one:.6f},1,{100 + 100 * one:.6f},100,50,50\n" for one in at)
    )
    assert main(["track", str(path), "--out", str(tmp_path / "run"), "--image", "1280x720"]) == 0
    capsys.readouterr()
    scores, _ = judged(capsys, tmp_path / "run", "--gt", gt, "--outside", "ignored")
    tracks = track(path, image=(1280, 720))
    for one in (tracks, tracks.causal, read_run(tmp_path / "run"), read_run(tmp_path / "run").causal):
        assert one is not None
        found_scores = evaluate(one, read_truth(gt), outside="ignored")["causal"]
        assert (found_scores["FN"], found_scores["FP"]) == (scores["FN"], scores["FP"])
