"""`jeat-graph count`."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from jeat_graph.cli.main import main

HEADER = "t,track_id,left,top,width,height,existence,x,y,vx,vy,ax,ay," + ",".join(
    f"var_{name}" for name in ("x", "y", "vx", "vy", "ax", "ay")
)


@pytest.fixture
def run(tmp_path):
    """A table of two vehicles that drive down the picture and one that drives up."""
    rows = []
    for track, (x, start, speed) in enumerate([(20, 0, 100), (40, -30, 100), (70, 100, -100)], 1):
        for k in range(11):
            y = start + speed * 0.1 * k
            rows.append(f"{0.1 * k},{track},{x - 5},{y - 5},10,10,0.99,{x},{y},0,{speed},0,0,1,1,1,1,1,1,rgb")
    path = tmp_path / "causal.csv"
    path.write_text(HEADER + ",sensors\n" + "\n".join(rows) + "\n")
    return path


def test_counts_are_printed_and_written(run, tmp_path, capsys):
    out, single = tmp_path / "counts.csv", tmp_path / "crossings.csv"
    line = ["--line", "gate=0,50,100,50"]
    assert main(["count", str(run), *line]) == 0
    shown = capsys.readouterr().out
    assert "gate" in shown
    assert "right" in shown
    assert main(["count", str(run), *line, "--out", str(out), "--crossings", str(single)]) == 0
    counts = pd.read_csv(out)
    assert dict(zip(counts.direction, counts["count"], strict=True)) == {"left": 1, "right": 2}
    found = pd.read_csv(single)
    assert sorted(found.t.round(6)) == pytest.approx([0.5, 0.5, 0.8])


def test_intervals_split_the_counts(run, tmp_path):
    out = tmp_path / "counts.csv"
    assert main(["count", str(run), "--line", "0,50,100,50", "--interval", "0.6", "--out", str(out)]) == 0
    counts = pd.read_csv(out).query("direction == 'right'")
    assert counts["count"].tolist() == [1, 1]
    assert counts.line.tolist() == ["line-1", "line-1"]


@pytest.mark.parametrize("text", ["0,50,100", "a,b,c,d", "0,50,0,50", "gate=1,2,3,nan"])
def test_a_line_that_is_none_is_one_clear_line(run, text, capsys):
    assert main(["count", str(run), "--line", text]) == 2
    error = capsys.readouterr().err
    assert error.startswith("jeat-graph count: ")
    assert error.count("\n") == 1


def test_a_result_without_variances_has_no_interval(tmp_path, capsys):
    result, out = tmp_path / "result.txt", tmp_path / "counts.csv"
    result.write_text("".join(f"{k},1,{10 * k},40,10,20,1,-1,-1,-1\n" for k in range(1, 11)))
    command = ["count", str(result), "--rate", "10", "--line", "50,0,50,100"]
    assert main(command) == 0
    shown = capsys.readouterr()
    assert shown.out.rstrip().endswith("1     –")
    assert "no interval: the table has no variances" in shown.err
    assert main([*command, "--out", str(out)]) == 0
    (row,) = pd.read_csv(out).to_dict("records")
    assert (row["count"], row["low"], row["high"]) == (1, 0, 1)
    assert np.isnan(row["expected"])


def late_run(tmp_path, start=0.0, alone=False):
    """A recording of a minute: vehicles cross at 13.2 and 34.4 s; nothing is there before and after."""
    folder = tmp_path / "run"
    folder.mkdir()
    rows = []
    for track, crossing in enumerate((13.2, 34.4), 1):
        for k in range(11):
            t, y = crossing + 0.1 * (k - 5), 100.0 * (k - 5)
            rows.append(f"{start + t:.3f},{track},10,{y - 5},10,10,0.99,15,{y},0,1000,0,0,1,1,1,1,1,1,rgb")
    (folder / "causal.csv").write_text(HEADER + ",sensors\n" + "\n".join(rows) + "\n")
    if not alone:
        scans = "".join(f"{start + k / 25:.2f},rgb,0\n" for k in range(1500))
        (folder / "scans.csv").write_text("t,sensor,detections\n" + scans)
    return folder


def counted(folder, tmp_path, *more):
    out = tmp_path / "counts.csv"
    assert main(["count", str(folder), "--line", "0,0,100,0", *more, "--out", str(out)]) == 0
    return pd.read_csv(out)


@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_intervals_begin_at_multiples_and_include_those_without_anybody(tmp_path, start):
    begin = start // 15 * 15
    found = counted(late_run(tmp_path, start), tmp_path, "--interval", "15")
    first = found.t_from.tolist()
    assert first == [begin + 15.0 * k for k in range(len(first))]
    assert found["count"].sum() == 2
    if start == 0.0:
        assert found["count"].tolist() == [1, 0, 1, 0]
        assert found.t_to.tolist() == [15.0, 30.0, 45.0, 60.0]


def test_an_interval_that_the_recording_just_fills_has_no_empty_one_behind(tmp_path):
    found = counted(late_run(tmp_path), tmp_path, "--interval", "20")
    assert found["count"].tolist() == [1, 1, 0]


def test_of_a_table_alone_the_first_interval_is_that_of_its_first_row(tmp_path):
    found = counted(late_run(tmp_path, alone=True) / "causal.csv", tmp_path, "--interval", "10")
    assert found.t_from.tolist() == [10.0, 20.0, 30.0]
    assert found["count"].tolist() == [1, 0, 1]


def test_a_line_that_nobody_crosses_counts_none_in_both_directions(tmp_path):
    found = counted(late_run(tmp_path), tmp_path, "--interval", "30", "--line", "other=0,5000,100,5000")
    other = found[found.line == "other"]
    assert other.direction.tolist() == ["left", "left", "right", "right"]
    assert other["count"].tolist() == [0, 0, 0, 0]
