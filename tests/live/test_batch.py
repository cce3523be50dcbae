"""`jeat-graph batch`: every recording once, whatever happens to the others or to the workers."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.live.engines import run_local
from jeat_graph.live.manifest import read_manifest

TABLES = ("causal.csv", "smoothed.csv")
# But for the last, on Ray, whose workers are its own.
pytestmark = pytest.mark.usefixtures("forked_workers")


@pytest.fixture
def manifest(tmp_path, simulated):
    """Write a manifest of `count` recordings with truth, and further lines; the path."""

    def write(count: int, *more: str) -> Path:
        lines = ["name,detections,gt,set"]
        for k in range(count):
            folder = simulated(k % 3, scenario="night-sparse")
            lines.append(
                f"r{k:02},{folder / 'detections.csv'},{folder / 'gt.csv'},output.min_existence=0.{k:02}"
            )
        path = tmp_path / "manifest.csv"
        path.write_text("\n".join([*lines, *more]) + "\n")
        return path

    return write


def rows_of(out: Path) -> list[dict[str, str]]:
    with (out / "recordings.csv").open() as file:
        return list(csv.DictReader(file))


def in_series(path: Path, out: Path) -> None:
    """Each recording of a manifest by `track`, one after the other."""
    for one in read_manifest(path):
        options = [text for setting in one.overrides for text in ("--set", setting)]
        assert main(["track", *one.detections, "--out", str(out / one.name), *options]) == 0


def assert_same_tables(path: Path, runs: Path, series: Path) -> None:
    for one in read_manifest(path):
        for name in TABLES:
            assert (runs / one.name / name).read_bytes() == (series / one.name / name).read_bytes()


def test_a_batch_makes_the_runs_of_track_and_pools_their_scores(manifest, tmp_path, capsys):
    path, out = manifest(2), tmp_path / "out"
    assert main(["batch", str(path), "--out", str(out), "--workers", "2"]) == 0
    said = capsys.readouterr().out
    assert "2 recordings: 2 tracked, 0 kept, 0 failed" in said
    in_series(path, tmp_path / "series")
    assert_same_tables(path, out / "runs", tmp_path / "series")
    truths = [one.truth for one in read_manifest(path)]
    runs = [str(tmp_path / "series" / one.name) for one in read_manifest(path)]
    assert main(["eval", *runs, "--gt", *truths, "--json", str(tmp_path / "pooled.json")]) == 0
    assert json.loads((out / "scores.json").read_text()) == json.loads((tmp_path / "pooled.json").read_text())
    assert [row["status"] for row in rows_of(out)] == ["done"] * 2


def test_with_a_camera_each_run_has_its_speeds_on_the_road(tmp_path, simulated):
    folder, path, out = simulated(0, scenario="night-sparse"), tmp_path / "m.csv", tmp_path / "out"
    path.write_text(
        "name,detections,camera\n"
        + "".join(
            f"{name},{folder / 'detections.csv'},{camera}\n"
            for name, camera in (
                ("with", folder / "camera.yaml"),
                ("without", ""),
                ("wrong", folder / "gt.csv"),
            )
        )
    )
    assert main(["batch", str(path), "--out", str(out), "--workers", "1"]) == 1
    rows = {row["name"]: row for row in rows_of(out)}
    assert [rows[name]["status"] for name in ("with", "without", "wrong")] == ["done", "done", "failed"]
    assert "gt.csv" in rows["wrong"]["error"]
    assert int(rows["with"]["vehicles"]) > 3
    road = out / "runs" / "with" / "road"
    camera = ["--camera", str(folder / "camera.yaml")]
    assert main(["road", str(road.parent), *camera, "--out", str(tmp_path / "road")]) == 0
    for file in (tmp_path / "road").iterdir():
        assert (road / file.name).read_bytes() == file.read_bytes(), file.name
    track = ["track", str(folder / "detections.csv"), *camera, "--out", str(tmp_path / "track")]
    assert main(track) == 0
    for name in ("causal.csv", "smoothed.csv", "road_causal.csv", "road_smoothed.csv"):
        assert (road.parent / name).read_bytes() == (tmp_path / "track" / name).read_bytes()
    made = {file: file.stat().st_mtime_ns for file in road.iterdir()}
    assert main(["batch", str(path), "--out", str(out), "--workers", "1"]) == 1
    assert {file: file.stat().st_mtime_ns for file in road.iterdir()} == made
    assert rows_of(out)[0]["vehicles"] == rows["with"]["vehicles"]


def test_a_second_call_keeps_what_is_there_and_makes_what_changed(manifest, tmp_path):
    path, out = manifest(2), tmp_path / "out"
    call = ["batch", str(path), "--out", str(out), "--workers", "1"]
    assert main(call) == 0
    times = {name: (out / "runs" / name / "run.json").stat().st_mtime_ns for name in ("r00", "r01")}
    (out / "runs" / "r01" / "causal.csv").write_text("damaged\n")
    assert main(call) == 0
    assert [row["status"] for row in rows_of(out)] == ["kept", "done"]
    assert (out / "runs" / "r00" / "run.json").stat().st_mtime_ns == times["r00"]
    assert (out / "runs" / "r01" / "run.json").stat().st_mtime_ns > times["r01"]
    assert main([*call, "--set", "smoother.lag_s=2"]) == 0
    assert [row["status"] for row in rows_of(out)] == ["done", "done"]


def test_what_fails_is_in_the_table_and_stops_nobody(manifest, tmp_path, capsys):
    (tmp_path / "bad.csv").write_text("t,sensor,left,top,width,height,score\n0,rgb,1,2,-3,4,1\n")
    path, out = manifest(1, "bad,bad.csv,,", "missing,nowhere.csv,,"), tmp_path / "out"
    assert main(["batch", str(path), "--out", str(out), "--workers", "1"]) == 1
    assert "1 tracked, 0 kept, 2 failed" in capsys.readouterr().out
    rows = {row["name"]: row for row in rows_of(out)}
    assert (rows["r00"]["status"], rows["bad"]["status"]) == ("done", "failed")
    assert "bad.csv:2" in rows["bad"]["error"]
    assert "no such file" in rows["missing"]["error"]
    assert not (out / "runs" / "bad").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,detections\n", "names no recording"),
        ("name,detection\na,b.csv\n", "detections"),
        ("detections,camra\na.csv,b\n", "unknown column 'camra'"),
        ("name,detections\na,b.csv\na,c.csv\n", ":3: name 'a' is taken"),
        ("name,detections\n../a,b.csv\n", ":2: name '../a' must be"),
        ("name,detections,rate\na,b.csv,-1\n", "rate must be positive"),
    ],
)
def test_a_bad_manifest_is_refused_before_anything_is_tracked(text, message, tmp_path, capsys):
    path = tmp_path / "m.csv"
    path.write_text(text)
    assert main(["batch", str(path), "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_several_files_and_a_sensors_name_are_found_beside_the_manifest(tmp_path):
    (tmp_path / "m.csv").write_text("detections,config\nrgb=a/det.csv; evt=b.csv,paper\n")
    (one,) = read_manifest(tmp_path / "m.csv")
    assert one.detections == (f"rgb={tmp_path}/a/det.csv", f"evt={tmp_path}/b.csv")
    assert (one.name, one.config) == ("det", "paper")


def test_two_batches_never_work_in_one_folder(manifest, tmp_path, capsys):
    fcntl = pytest.importorskip("fcntl")
    out = tmp_path / "out"
    out.mkdir()
    with (out / ".batch.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert main(["batch", str(manifest(1)), "--out", str(out)]) == 2
    assert "another batch is at work here" in capsys.readouterr().err


WORK = """
import os, signal, time
from pathlib import Path

def work(job):
    folder, name, deaths = job
    with open(Path(folder) / name, "a") as file:
        file.write("x")
    if len((Path(folder) / name).read_text()) <= deaths:
        os.kill(os.getpid(), signal.SIGKILL)
    return name, "done"
"""


def lost(job):
    return job[1], "lost"


def test_a_worker_that_dies_costs_no_other_job_and_a_deadly_job_only_itself(tmp_path, monkeypatch):
    (tmp_path / "deadly_work.py").write_text(WORK)
    monkeypatch.syspath_prepend(tmp_path)
    from deadly_work import work

    jobs = [(str(tmp_path), f"j{k}", {2: 1, 4: 99}.get(k, 0)) for k in range(7)]
    results = dict(run_local(work, jobs, lost, workers=2, retries=1))
    assert results == {f"j{k}": "lost" if k == 4 else "done" for k in range(7)}
    tries = {f"j{k}": len((tmp_path / f"j{k}").read_text()) for k in range(7)}
    assert tries == {f"j{k}": 2 if k in (2, 4) else 1 for k in range(7)}


@pytest.mark.slow
def test_on_ray_a_killed_worker_costs_nothing_and_the_bytes_are_those_of_a_series(
    manifest, tmp_path, full, monkeypatch, dying
):
    pytest.importorskip("ray", reason="Ray is not installed")
    path, out = manifest(64 if full else 3), tmp_path / "out"
    killed = tmp_path / "killed"
    # The first worker that has something of a run in its folder is killed.
    for name, value in dying(out / "runs", at=2, once=killed, name=".unfinished-").items():
        monkeypatch.setenv(name, value)
    assert main(["batch", str(path), "--out", str(out), "--engine", "ray", "--workers", "2"]) == 0
    assert killed.exists(), "no worker was killed, so nothing was shown"
    assert all(row["status"] in ("done", "kept") for row in rows_of(out))
    assert not list((out / "runs").glob("*/.unfinished-*"))
    in_series(path, tmp_path / "series")
    assert_same_tables(path, out / "runs", tmp_path / "series")


def street(folder, count=30):
    """A video's pictures in which a dark block moves; returns the folder."""
    import cv2
    import numpy as np

    rng = np.random.default_rng(0)
    background = rng.normal(110, 2, (96, 128, 3)).clip(0, 255).astype(np.uint8)
    folder.mkdir()
    for k in range(count):
        picture = background.copy()
        picture[40:60, 10 + 2 * k : 40 + 2 * k] = 20
        cv2.imwrite(str(folder / f"{k:03d}.png"), picture)
    return folder


def test_a_batch_over_videos_makes_the_runs_of_track(tmp_path, capsys):
    street(tmp_path / "a")
    street(tmp_path / "b", 20)
    path, out = tmp_path / "m.csv", tmp_path / "out"
    path.write_text(
        'name,frames,rate,detector_frames,mask\none,a,20,motion,\ntwo,b,20,motion,"0,0,128,0,128,96,0,96"\n'
    )
    assert main(["batch", str(path), "--out", str(out), "--workers", "1"]) == 0
    assert "2 recordings: 2 tracked, 0 kept, 0 failed" in capsys.readouterr().out
    words = ["--frames", str(tmp_path / "a"), "--rate", "20", "--detector-frames", "motion"]
    assert main(["track", *words, "--out", str(tmp_path / "alone")]) == 0
    for name in ("detections.csv", *TABLES):
        assert (out / "runs" / "one" / name).read_bytes() == (tmp_path / "alone" / name).read_bytes()
    assert [row["detections"] == "0" for row in rows_of(out)] == [False, True]  # the second is all masked
    capsys.readouterr()
    assert main(["batch", str(path), "--out", str(out), "--workers", "1"]) == 0
    assert "0 tracked, 2 kept" in capsys.readouterr().out


def test_pictures_are_looked_at_again_only_where_something_has_changed(tmp_path):
    street(tmp_path / "a")
    path, out = tmp_path / "m.csv", tmp_path / "out"
    path.write_text("name,frames,rate,detector_frames\none,a,20,motion\n")
    command = ["batch", str(path), "--out", str(out), "--workers", "1"]
    found = out / "runs" / "one" / "detections.csv"

    def looked_at():
        before = found.stat().st_mtime_ns
        assert main(command) == 0
        return found.stat().st_mtime_ns != before

    assert main(command) == 0
    assert not looked_at()
    path.write_text("name,frames,rate,detector_frames,set\none,a,20,motion,output.min_existence=0.3\n")
    assert not looked_at()  # another tracker, the same detections
    path.write_text('name,frames,rate,detector_frames,mask\none,a,20,motion,"0,0,9,0,9,9"\n')
    assert looked_at()
    (tmp_path / "a" / "029.png").unlink()
    assert looked_at()


def test_a_video_that_is_not_there_fails_alone(tmp_path, capsys):
    street(tmp_path / "a")
    path, out = tmp_path / "m.csv", tmp_path / "out"
    path.write_text("frames,rate,detector_frames\na,20,motion\nabsent.mp4,20,motion\n")
    assert main(["batch", str(path), "--out", str(out), "--workers", "1"]) == 1
    assert "absent: " in capsys.readouterr().err
    assert [row["status"] for row in rows_of(out)] == ["done", "failed"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,rate\na,20\n", "has none of the columns detections, frames, events"),
        ("name,detections,frames\na,,\n", ":2: detections, frames is missing"),
        ("name,detections,mask\na,b.csv,m.yaml\n", ":2: mask is for recordings without detections"),
        ("name,frames,time_unit\na,b.mp4,ms\n", ":2: time_unit is for recordings with detections"),
        ("name,detections,events\na,b.csv,e.raw\n", ":2: events is for recordings without detections"),
    ],
)
def test_what_a_row_begins_with_is_plain(text, message, tmp_path, capsys):
    (tmp_path / "m.csv").write_text(text)
    assert main(["batch", str(tmp_path / "m.csv"), "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err


def test_how_files_are_read_is_said_by_columns_called_as_the_options_of_track(tmp_path, capsys):
    rows = "".join(
        f"{video},{k},{100 + 4 * k + 300 * (video == 'b')},200,60,40,{90 - k},{k % 2}\n"
        for video in "ab"
        for k in range(30)
    )
    (tmp_path / "det.csv").write_text("video,frame,left,top,width,height,score,class\n" + rows)
    (tmp_path / "names.txt").write_text("car\nbus\n")
    said = {"rate": "20", "only_video": "b", "classes": "names.txt", "class": "car;bus", "first_frame": "0"}
    said |= {"score_scale": "percent", "input_format": "csv", "image": "1280x720"}
    manifest, out = tmp_path / "m.csv", tmp_path / "out"
    manifest.write_text(f"detections,{','.join(said)}\ndet.csv,{','.join(said.values())}\n")
    assert main(["batch", str(manifest), "--out", str(out), "--workers", "1"]) == 0
    said |= {"classes": str(tmp_path / "names.txt")}
    options = [w for name, value in said.items() for w in (f"--{name.replace('_', '-')}", *value.split(";"))]
    assert main(["track", str(tmp_path / "det.csv"), "--out", str(tmp_path / "run"), *options]) == 0
    for name in TABLES:
        assert (out / "runs" / "det" / name).read_bytes() == (tmp_path / "run" / name).read_bytes()
    assert b"car" in (out / "runs" / "det" / "causal.csv").read_bytes()
    assert main(["batch", str(manifest), "--out", str(out), "--workers", "1"]) == 0
    assert "0 tracked, 1 kept" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("column", "value", "what"),
    [
        ("first_frame", "2", "first_frame must be 0, 1, got '2'"),
        ("time_unit", "h", "time_unit must be s, ms, us, ns, got 'h'"),
        ("score_scale", "of ten", "score_scale must be unit"),
        ("input_format", "xml", "input_format must be csv"),
        ("image", "large", "image must read WIDTHxHEIGHT"),
        ("video", "a", "unknown column 'video'"),
    ],
)
def test_a_column_of_reading_that_is_wrong_is_named_with_its_line(column, value, what, tmp_path):
    (tmp_path / "m.csv").write_text(f"detections,{column}\na.csv,{value}\n")
    with pytest.raises(DataError, match=rf"m\.csv:[12]: {what}"):
        read_manifest(tmp_path / "m.csv")


def test_paths_of_a_manifest_are_seen_from_its_folder(tmp_path):
    folder = tmp_path / "lists"
    folder.mkdir()
    (folder / "m.csv").write_text(
        "detections,config,gt,camera,classes,images\n"
        "cam=a.csv;b.csv,my.yaml,gt.csv,camera.yaml,names.txt,images.json\n"
        "c.csv,paper,,,,\n"
    )
    first, second = read_manifest(folder / "m.csv")
    assert first.detections == (f"cam={folder / 'a.csv'}", str(folder / "b.csv"))
    assert (first.config, first.truth, first.camera) == tuple(
        str(folder / name) for name in ("my.yaml", "gt.csv", "camera.yaml")
    )
    assert first.reading == {
        "class_names": str(folder / "names.txt"),
        "images": str(folder / "images.json"),
    }
    assert (second.config, second.reading) == ("paper", {})
