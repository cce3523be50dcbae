"""`jeat-graph export` and `view`."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.tables.trajectories_io import write_trajectories


@pytest.fixture
def run(tmp_path):
    """Two vehicles over five frames at 10 Hz, one with a gap."""
    t, ids = np.tile(np.arange(5) * 0.1, 2), np.repeat([3, 8], 5)
    keep = ~((ids == 8) & (np.arange(10) == 7))
    t, ids = t[keep], ids[keep]
    mean = np.zeros((9, 6))
    mean[:, 0], mean[:, 1], mean[:, 2] = 100.0 + 50.0 * t, 10.0 * ids, 50.0
    boxes = np.column_stack([mean[:, :2] - 5.0, np.full((9, 2), 10.0)])
    table = Trajectories(
        t, ids, boxes, np.full(9, 0.9), mean, np.full((9, 6), 0.25), np.ones(9, dtype=np.int64), ("rgb",)
    )
    order = np.lexsort((ids, t))
    folder = tmp_path / "run"
    folder.mkdir()
    write_trajectories(table.take(order), folder / "causal.csv")
    return folder


def test_cvat_gets_frames_counted_from_one_and_its_labels(run, tmp_path):
    out = tmp_path / "tracks.zip"
    assert main(["export", str(run), "--to", "cvat", "--output-rate", "10", "--out", str(out)]) == 0
    with zipfile.ZipFile(out) as archive:
        assert sorted(archive.namelist()) == ["gt/gt.txt", "gt/labels.txt"]
        rows = [line.split(",") for line in archive.read("gt/gt.txt").decode().splitlines()]
        assert archive.read("gt/labels.txt") == b"vehicle\n"
    assert [row[:2] for row in rows] == [
        [str(k), track] for k in range(1, 6) for track in ("3", "8") if (k, track) != (3, "8")
    ]
    assert rows[0][2:] == ["95.000", "25.000", "10.000", "10.000", "1", "1", "0.900"]
    first = out.read_bytes()
    assert main(["export", str(run), "--to", "cvat", "--output-rate", "10", "--out", str(out)]) == 0
    assert out.read_bytes() == first


def test_a_result_that_counts_frames_has_its_rate_once(tmp_path, capsys):
    result, out = tmp_path / "smoothed.txt", tmp_path / "tracks.json"
    result.write_text("1,3,10,20,30,40,1,-1,-1,-1\n2,3,11,20,30,40,1,-1,-1,-1\n")
    command = ["export", str(result), "--to", "coco", "--out", str(out)]
    assert main(command) == 2
    assert "give the frame rate with --rate" in capsys.readouterr().err
    assert main([*command, "--rate", "25"]) == 0
    assert [round(a["bbox"][0]) for a in json.loads(out.read_text())["annotations"]] == [10, 11]


def test_the_rate_comes_by_itself_from_a_run_whose_input_counted_frames(tmp_path):
    rows = [f"{k},-1,{10 + k},20,30,40,0.9,-1,-1,-1\n" for k in range(1, 31)]
    (tmp_path / "det.txt").write_text("".join(rows))
    run, out = tmp_path / "run", tmp_path / "tracks.zip"
    assert main(["track", str(tmp_path / "det.txt"), "--rate", "10", "--out", str(run)]) == 0
    assert main(["export", str(run), "--to", "cvat", "--out", str(out)]) == 0
    with zipfile.ZipFile(out) as archive:
        frames = [int(line.split(",")[0]) for line in archive.read("gt/gt.txt").decode().splitlines()]
    assert frames[-1] == 30


def test_a_trajectory_of_the_tum_format_has_unit_quaternions(run, tmp_path):
    out = tmp_path / "track.txt"
    assert main(["export", str(run), "--to", "tum", "--track", "8", "--out", str(out)]) == 0
    poses = np.loadtxt(out)
    assert poses.shape == (4, 8)
    assert poses[:, 0] == pytest.approx([0.0, 0.1, 0.3, 0.4])
    assert np.linalg.norm(poses[:, 4:], axis=1) == pytest.approx(1.0)
    assert poses[:, 1] == pytest.approx(100.0 + 50.0 * poses[:, 0])


def test_rerun_gets_boxes_and_plots(run, tmp_path):
    pytest.importorskip("rerun", reason="the extra rerun is not installed")
    out = tmp_path / "run.rrd"
    assert main(["export", str(run), "--to", "rerun", "--out", str(out)]) == 0
    content = out.read_bytes()
    assert content[:4] in (b"RRF2", b"RRIO", b"RRF3")
    for name in (b"picture/causal/boxes", b"plots/causal"):
        assert name in content


@pytest.mark.parametrize(
    ("more", "what"),
    [
        (["--to", "tum"], "--track"),
        (["--to", "tum", "--track", "99"], "no track 99"),
        (["--to", "cvat"], "--output-rate HZ"),
        (["--to", "tum", "--track", "3", "--only", "smoothed"], "no smoothed"),
    ],
)
def test_what_is_missing_is_one_clear_line(run, tmp_path, capsys, more, what):
    out = tmp_path / "out.x"
    assert main(["export", str(run), *more, "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert what in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_a_viewer_that_is_not_there_is_one_line(run, monkeypatch, capsys):
    rerun = pytest.importorskip("rerun", reason="the extra rerun is not installed")

    def spawn(_):
        raise RuntimeError("Failed to find the viewer.\n\nMany lines of advice.\n")

    monkeypatch.setattr(rerun.RecordingStream, "spawn", spawn)
    assert main(["view", str(run)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "(Failed to find the viewer.); `export --to rerun` writes a file for it" in line
