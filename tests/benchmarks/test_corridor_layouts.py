"""Layouts of several cameras: made ones are read to the numbers that they were made of, and judged."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.corridor_layouts.registry import all_layouts, recognise
from benchmarks.handover import judge_folder
from jeat_graph.data.errors import DataError

FEET = 0.3048


def vehicles(count, seed):
    """Start (s) and speed (m/s) of vehicles that drive evenly."""
    rng = np.random.default_rng(seed)
    return 30.0 + np.cumsum(rng.uniform(2.0, 9.0, count)), 28.0 * np.exp(0.15 * rng.normal(size=count))


def motion_file(path, count=70):
    start, speed = vehicles(count, 1)
    rows = []
    for t0, v in zip(start, speed, strict=True):
        t = t0 + np.arange(0.0, 1600.0 / v, 0.1)
        row = {"timestamp": t, "x_position": -(v * (t - t0)) / FEET, "y_position": np.full(len(t), -18.0)}
        rows.append({name: values.round(4).tolist() for name, values in row.items()} | {"direction": -1})
    path.write_text(json.dumps(rows))
    return start, speed


def test_i24_gives_the_passages_that_were_driven(tmp_path):
    start, speed = motion_file(tmp_path / "day.json")
    layout = recognise(tmp_path)
    assert layout.name == "i24-motion"
    pairs = {pair.distance_m: pair for pair in layout.pairs(tmp_path)}
    assert set(pairs) == {200.0, 500.0, 1000.0}
    pair = pairs[500.0]
    middle = 0.5 * np.median(speed * ((1600.0 / speed) // 0.1) * 0.1)
    before, who = pair.before, pair.first[pair.before.track_id]
    np.testing.assert_allclose(before.t, start[who] + (middle - 250.0) / speed[who], atol=0.2)
    np.testing.assert_allclose(np.exp(before.log_speed), speed[who], rtol=1e-3)
    assert before.lanes == ("1",)
    after = pair.second[pair.after.track_id]
    travel = dict(zip(after, pair.after.t, strict=True))
    np.testing.assert_allclose(
        [travel[k] - t - 17.0 for k, t in zip(who, before.t, strict=True)], 500.0 / speed[who], rtol=1e-3
    )


def test_i24_is_judged(tmp_path):
    motion_file(tmp_path / "day.json")
    rows = {row["distance"]: row for row in judge_folder(tmp_path)}
    assert rows[200.0]["right"] > 0.95 * rows[200.0]["common"]
    assert abs(rows[200.0]["offset_error_s"]) < 0.5


CAMERAS = {"c001": (42.50, -90.70, 0.0), "c002": (42.5027, -90.70, 12.5)}  # 300 m further north


def city(root, count=60):
    """Two cameras over a road that leads north, each a picture of 1 px for 0.05 m."""
    start, speed = vehicles(count, 2)
    (root / "cam_timestamp").mkdir()
    (root / "cam_timestamp" / "S01.txt").write_text("".join(f"{k} {v[2]}\n" for k, v in CAMERAS.items()))
    for place, (name, (north, east, begun)) in enumerate(CAMERAS.items()):
        folder = root / "train" / "S01" / name
        (folder / "gt").mkdir(parents=True)
        metre = np.degrees(1.0 / 6_371_000.0)
        scale = 20.0 / metre
        matrix = [[0.0, scale, 960.0 - scale * east], [-scale, 0.0, 540.0 + scale * north], [0.0, 0.0, 1.0]]
        text = ";".join(" ".join(repr(float(x)) for x in row) for row in matrix)
        (folder / "calibration.txt").write_text(f"Homography matrix: {text}\nReprojection error: 1.0\n")
        rows = []
        for k, (t0, v) in enumerate(zip(start, speed, strict=True), 1):
            middle = t0 + 6_371_000.0 * np.radians(CAMERAS["c002"][0] - CAMERAS["c001"][0]) * place / v
            for frame in range(int((middle - begun - 0.8) * 10.0), int((middle - begun + 0.8) * 10.0)):
                y = 540.0 - 20.0 * v * (frame / 10.0 + begun - middle)
                rows.append(f"{frame + 1},{k},{940.0},{y - 30.0:.4f},40,30,1,-1,-1,-1\n")
        (folder / "gt" / "gt.txt").write_text("".join(rows))
    return start, speed


def test_ai_city_gives_distance_speeds_and_clocks(tmp_path):
    _, speed = city(tmp_path)
    layout = recognise(tmp_path)
    assert layout.name == "ai-city"
    (pair,) = layout.pairs(tmp_path)
    assert pair.name == "S01 c001-c002"
    assert pair.distance_m == pytest.approx(6_371_000.0 * np.radians(0.0027), abs=1.0)
    assert pair.offset_s == -12.5
    np.testing.assert_allclose(
        np.exp(pair.before.log_speed), speed[pair.first[pair.before.track_id] - 1], rtol=1e-2
    )
    (row,) = judge_folder(tmp_path)
    assert row["right"] > 0.9 * row["common"]
    assert abs(row["offset_error_s"]) < 0.8


def test_a_pair_with_too_few_vehicles_is_refused_not_left_out(tmp_path):
    city(tmp_path, 20)
    (row,) = judge_folder(tmp_path)
    assert "fewer than 40" in row["refused"]
    assert row["common"] == 20


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("day.json", '[{"x_position": [1]}]', "trajectory 1 must have timestamp"),
        ("day.json", '[{"x_position": [1,2], "timestamp"', "is not JSON"),
    ],
)
def test_damaged_trajectories_are_named(name, text, words, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(DataError, match=words):
        judge_folder(tmp_path)


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("train/S01/c001/calibration.txt", "Homography matrix: ", "Homography matrix: x ", "must begin with"),
        ("cam_timestamp/S01.txt", "c002 12.5", "c002", "S01.txt:2: must be a camera"),
        ("cam_timestamp/S01.txt", "c002", "c009", "says nothing of c002"),
        ("train/S01/c002/gt/gt.txt", ",40,30,", ",a,30,", "must have frame, ID"),
    ],
)
def test_damaged_cities_are_named(file, old, new, words, tmp_path):
    city(tmp_path, 12)
    path = tmp_path / file
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(DataError, match=words):
        judge_folder(tmp_path)


def test_what_is_of_no_layout_is_refused(tmp_path):
    with pytest.raises(DataError, match="none of the layouts that are known: BrnoCompSpeed; ai-city"):
        judge_folder(tmp_path)
    assert list(all_layouts()) == ["ai-city", "i24-motion"]
