"""`camera` and `road` on the command line: files in, files out, and one line where the input is wrong."""

from __future__ import annotations

import csv
import gzip
import json
from pathlib import Path

import numpy as np
import pytest
from road_scenes import HEIGHT, WIDTH, camera, drives, lengths, see

from jeat_graph.cli.main import main
from jeat_graph.road.camera_file import read_camera, write_camera
from jeat_graph.road.cuboid import sides

BRNO = Path(__file__).parents[3] / "shared" / "data" / "brno"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    folder, rng, cam = tmp_path_factory.mktemp("road"), np.random.default_rng(5), camera()
    t, track, pixels, true = drives(cam, rng, 40, 0.5)
    rows = [
        "t,track_id,x,y",
        *(f"{a:.4f},{b},{x:.2f},{y:.2f}" for a, b, (x, y) in zip(t, track, pixels, strict=True)),
    ]
    with gzip.open(folder / "points.csv.gz", "wt") as file:
        file.write("\n".join(rows) + "\n")
    measured = lengths(cam, rng, 1.0, 0.02)
    with (folder / "lengths.csv").open("w") as file:
        file.write("x1,y1,x2,y2,metres,direction\n")
        for a, b, m, along in zip(measured.start, measured.end, measured.metres, measured.along, strict=True):
            file.write(f"{a[0]},{a[1]},{b[0]},{b[1]},{m},{'along' if along else 'across'}\n")
    near, far = (see(cam, np.array([[-1.0, y], [9.0, y]])).ravel() for y in (24.0, 38.0))
    lines = "".join(
        f"  {name}: [{', '.join(f'{v:.1f}' for v in line)}]\n" for name, line in (("a", near), ("b", far))
    )
    (folder / "lines.yaml").write_text("lines:\n" + lines)
    return folder, true


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_from_points_to_speeds(
    recording: tuple[Path, np.ndarray], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, true = recording
    out, cam = folder / "out", folder / "camera.yaml"
    image = ["--image", f"{WIDTH}x{HEIGHT}", "--out", str(cam)]
    assert (
        main(
            [
                "camera",
                "calibrate",
                "--run",
                str(folder / "points.csv.gz"),
                "--lengths",
                str(folder / "lengths.csv"),
                *image,
            ]
        )
        == 0
    )
    assert main(["camera", "show", str(cam), "--picture", str(folder / "grid.png")]) == 0
    assert "by calibration" in capsys.readouterr().out
    assert (folder / "grid.png").read_bytes().startswith(b"\x89PNG")
    args = [
        "road",
        str(folder / "points.csv.gz"),
        "--camera",
        str(cam),
        "--contact-height",
        "0",
        "0",
        "--lines",
        str(folder / "lines.yaml"),
    ]
    assert main([*args, "--out", str(out)]) == 0
    speeds = _rows(out / "speeds.csv")
    assert list(speeds[0]) == [
        *("track_id", "t_first", "t_last", "lane", "class", "length"),
        *("speed_kmh", "low_kmh", "high_kmh", "sigma_noise_kmh", "sigma_calibration_kmh", "parked"),
        "sigma_length",
    ]
    errors = [float(row["speed_kmh"]) - 3.6 * true[int(row["track_id"])] for row in speeds]
    assert np.abs(errors).mean() < 0.9
    held = [float(r["low_kmh"]) <= 3.6 * true[int(r["track_id"])] <= float(r["high_kmh"]) for r in speeds]
    assert np.mean(held) > 0.85
    assert {row["lane"] for row in speeds} == {"1", "2"}
    crossings = _rows(out / "crossings.csv")
    assert {row["line"] for row in crossings} == {"a", "b"}
    assert all(0.0 < float(row["sigma_t"]) < 0.1 for row in crossings)
    states = _rows(out / "road.csv")
    assert all(float(row["var_x"]) > 0 and float(row["var_speed_kmh"]) > 0 for row in states[::50])
    main([*args, "--out", str(folder / "again")])
    for name in ("speeds.csv", "crossings.csv", "road.csv"):
        assert (out / name).read_bytes() == (folder / "again" / name).read_bytes()


def test_a_run_without_a_log_of_its_detections_has_places_by_its_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    t, rng = np.arange(0.0, 1.6, 0.05), np.random.default_rng(0)
    seen, _ = sides(
        camera(), np.c_[np.full(len(t), 3.0), 60.0 - 22.0 * t], np.zeros(len(t)), np.array([4.5, 1.8, 1.5])
    )
    left, top, right, bottom = (seen + 0.3 * rng.standard_normal(seen.shape)).T
    rows = np.c_[t, left, top, right - left, bottom - top]
    lines = ["t,sensor,left,top,width,height,score", *("{},rgb,{},{},{},{},0.9".format(*row) for row in rows)]
    (tmp_path / "detections.csv").write_text("\n".join(lines) + "\n")
    write_camera(camera(), tmp_path / "camera.yaml")
    run, out = tmp_path / "run", tmp_path / "out"
    track = ["track", str(tmp_path / "detections.csv"), "--config", "paper", "--image", f"{WIDTH}x{HEIGHT}"]
    assert main([*track, "--out", str(run)]) == 0
    capsys.readouterr()
    assert main(["road", str(run), "--camera", str(tmp_path / "camera.yaml"), "--out", str(out)]) == 0
    assert "the table's smoothed boxes are used instead, which are less sure" in capsys.readouterr().err
    (speed,) = _rows(out / "speeds.csv")
    assert float(speed["low_kmh"]) < 79.2 < float(speed["high_kmh"])


def test_the_camera_says_the_size_of_the_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No box reaches the picture's edge, so that boxes alone do not tell it."""
    rows = [f"{0.05 * k:.2f},rgb,{100 + 5 * k},200,60,40,0.9" for k in range(30)]
    (tmp_path / "d.csv").write_text("t,sensor,left,top,width,height,score\n" + "\n".join(rows) + "\n")
    write_camera(camera(), tmp_path / "camera.yaml")
    command = ["track", str(tmp_path / "d.csv"), "--camera", str(tmp_path / "camera.yaml")]
    assert main([*command, "--out", str(tmp_path / "run")]) == 0
    error = capsys.readouterr().err
    assert f"picture of {WIDTH} x {HEIGHT} px, as {tmp_path / 'camera.yaml'} says" in error
    assert "as far as the boxes reach" not in error
    image = json.loads((tmp_path / "run" / "run.json").read_text())["config"]["image"]
    assert image == {"width": WIDTH, "height": HEIGHT}
    assert main([*command, "--image", "640x480", "--out", str(tmp_path / "other")]) == 2
    assert f"is of a picture of {WIDTH} x {HEIGHT} px, not of 640 x 480" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        (
            "lengths.csv",
            "x1,y1,x2,y2,metres,direction\n1,2,3,4,5,sideways\n",
            ":2: direction must be along or across",
        ),
        ("lengths.csv", "x1,y1,x2,y2,metres,direction\n1,2,3,4,-5,along\n", ":2: metres must be positive"),
        ("lengths.csv", "x1,y1,x2,y2,metres,direction\n1,2,1,2,5,along\n", ":2: both ends are the same"),
    ],
)
def test_a_bad_length_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, text: str, says: str
) -> None:
    (tmp_path / name).write_text(text)
    out = tmp_path / "camera.yaml"
    assert (
        main(
            [
                "camera",
                "calibrate",
                "--lengths",
                str(tmp_path / name),
                "--image",
                "1920x1080",
                "--out",
                str(out),
            ]
        )
        == 2
    )
    message = capsys.readouterr().err
    assert f"{tmp_path / name}{says}" in message
    assert message.count("\n") == 1
    assert not out.exists()


def test_the_size_of_the_picture_comes_from_the_run_or_has_to_be_given(
    recording: tuple[Path, np.ndarray], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, _ = recording
    run, cam = tmp_path / "run", tmp_path / "camera.yaml"
    run.mkdir()
    command = ["camera", "calibrate", "--run", str(run), "--lengths", str(folder / "lengths.csv")]
    with gzip.open(folder / "points.csv.gz", "rt") as file:
        (run / "smoothed.csv").write_text(file.read())
    assert main([*command, "--out", str(cam)]) == 2
    assert "the size of the picture is not known: give --image WxH" in capsys.readouterr().err
    record = {"config": {"image": {"width": WIDTH, "height": HEIGHT}}}
    (run / "run.json").write_text(json.dumps(record))
    assert main([*command, "--out", str(cam)]) == 0
    assert f"picture of {WIDTH} x {HEIGHT} px, as {run} says" in capsys.readouterr().err
    camera = read_camera(cam)
    assert (camera.width, camera.height) == (WIDTH, HEIGHT)


def test_results_of_other_trackers_are_taken_in_every_format(tmp_path: Path, capsys) -> None:
    """A vehicle that drives away, in four formats: the same road, and the counts of `count`'s intervals."""
    cam, folder = tmp_path / "camera.yaml", tmp_path / "labels"
    write_camera(camera(), cam)
    k = np.arange(60)
    ground = see(camera(), np.stack([np.full(60, 4.0), 20.0 + 0.4 * k], axis=1))
    near = see(camera(), np.stack([np.full(60, 5.8), 20.0 + 0.4 * k], axis=1))
    width = np.abs(near[:, 0] - ground[:, 0])
    box = np.stack([ground[:, 0], ground[:, 1] - width, width, width], axis=1)
    (tmp_path / "mot.txt").write_text(
        "".join(
            f"{n + 1},7,{a:.3f},{b:.3f},{c:.3f},{d:.3f},1,-1,-1,-1\n" for n, (a, b, c, d) in enumerate(box)
        )
    )
    rows = [f"{n},7,{a:.3f},{b:.3f},{a + c:.3f},{b + d:.3f}" for n, (a, b, c, d) in enumerate(box)]
    (tmp_path / "frames.csv").write_text("frame,track_id,x1,y1,x2,y2\n" + "\n".join(rows) + "\n")
    folder.mkdir()
    size = np.array([WIDTH, HEIGHT])
    for n, one in enumerate(box):
        line = [*((one[:2] + one[2:] / 2) / size), *(one[2:] / size)]
        (folder / f"road_{n}.txt").write_text("0 " + " ".join(f"{v:.9f}" for v in line) + " 0.9 7\n")
    tables = []
    for source in ("mot.txt", "frames.csv", "labels"):
        command = ["road", str(tmp_path / source), "--camera", str(cam), "--out", str(tmp_path / "out")]
        assert main(command) == 2
        assert "--rate" in capsys.readouterr().err
        assert main([*command, "--rate", "20", "--interval", "1", "--contact", "bottom"]) == 0
        tables.append([row["speed_kmh"] for row in _rows(tmp_path / "out" / "speeds.csv")])
        counts = _rows(tmp_path / "out" / "counts.csv")
        starts = [
            row["t_start"] for row in counts if row["direction"] == row["lane"] == row["class"] == "all"
        ]
        assert list(map(float, starts)) == [0.0, 1.0, 2.0]
    assert len(tables[0]) == 1
    assert tables[0] == tables[1]
    assert float(tables[2][0]) == pytest.approx(float(tables[0][0]), abs=0.1)
    # A camera without covariance is not sharpened; by then the tracks have been read.
    calibrating = ["camera", "calibrate", "--run", str(folder), "--camera", str(cam)]
    assert main([*calibrating, "--rate", "20", "--out", str(tmp_path / "sharper.yaml")]) == 2
    assert "has no covariance" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(not BRNO.is_dir(), reason="needs ../shared/data/brno beside the checkout")
def test_real_vehicles_within_their_intervals(tmp_path: Path) -> None:
    """Two minutes of a real highway against laser gates: error, and how many intervals hold the truth."""
    source = BRNO / "session2_right"
    with gzip.open(source / "points.csv.gz", "rt") as file:
        head = next(file)
        few = [line for line in file if float(line.split(",", 1)[0]) < 480.0]
    points, cam = tmp_path / "points.csv", tmp_path / "camera.yaml"
    points.write_text(head + "".join(few))
    known = ["--lengths", str(source / "lengths.csv"), "--image", "1920x1080", "--out", str(cam)]
    assert main(["camera", "calibrate", "--run", str(points), *known]) == 0
    assert main(["road", str(points), "--camera", str(cam), "--out", str(tmp_path / "out")]) == 0
    errors, held = [], []
    vehicles = [
        row
        for row in _rows(tmp_path / "out" / "speeds.csv")
        if float(row["t_last"]) - float(row["t_first"]) > 0.8
    ]
    for truth in _rows(source / "speeds.csv"):
        start, end = sorted((float(truth["t_first_line"]), float(truth["t_last_line"])))
        near = [
            v
            for v in vehicles
            if abs(float(v["t_first"]) - start) < 0.25 and abs(float(v["t_last"]) - end) < 0.6
        ]
        if len(near) == 1:
            true = float(truth["speed_kmh"])
            errors.append(abs(float(near[0]["speed_kmh"]) - true))
            held.append(float(near[0]["low_kmh"]) <= true <= float(near[0]["high_kmh"]))
    assert len(errors) >= 20
    assert np.median(errors) < 0.9
    assert np.mean(held) >= 0.85


def test_a_simulated_run_in_metres(tmp_path: Path) -> None:
    """From detections to speeds with the scenario's exact camera, against the truth on the road."""
    sim, run, out = tmp_path / "sim", tmp_path / "run", tmp_path / "road"
    assert main(["simulate", "day-sparse", "--out", str(sim), "--duration", "4", "--seed", "2"]) == 0
    assert main(["track", str(sim / "detections.csv"), "--out", str(run)]) == 0
    assert main(["road", str(run), "--camera", str(sim / "camera.yaml"), "--out", str(out)]) == 0
    truth: dict[float, list[dict[str, str]]] = {}
    for row in _rows(sim / "gt_road.csv"):
        truth.setdefault(round(float(row["t"]), 6), []).append(row)
    errors = []
    for row in _rows(out / "road.csv"):
        x, y, t = float(row["x"]), float(row["y"]), round(float(row["t"]), 6)
        if 20.0 < y < 90.0:
            there = [g for g in truth.get(t, []) if abs(float(g["x"]) - x) < 1.5]
            near = min(there, key=lambda g: abs(float(g["y"]) - y), default=None)
            if near is not None and abs(float(near["y"]) - y) < 6.0:
                errors.append([float(near[k]) - float(row[k]) for k in ("x", "y", "speed_kmh")])
    assert len(errors) > 100
    across, along, speed = np.median(np.abs(errors), axis=0)
    assert across < 0.2
    assert along < 0.6
    assert speed < 1.5
