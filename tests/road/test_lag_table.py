"""Smoothed rows of the road from the command line: those of `RoadFixedLag`, live and of a recording."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from jeat_graph import Tracker, load_config, read_detections
from jeat_graph.cli.main import main
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.road.camera_file import read_camera
from jeat_graph.road.fixed_lag import RoadFixedLag, RoadLagConfig
from jeat_graph.road.lag_table import RoadFile
from jeat_graph.road.results import empty_road_columns

LAG_S, IMAGE = 0.75, "1280x720"
#: `track` reads what the simulator says of its sensors, a stream has to be told.
SETTINGS = (f"smoother.lag_s={LAG_S}", "sensors.evt.kind=event", "sensors.rgb.kind=camera")
COLUMNS = ("t", "x", "y", "speed_kmh", "length", "var_x", "var_y", "var_speed_kmh")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lag") / "scene"
    assert main(["simulate", "day-sparse", "--out", str(folder), "--duration", "2.5", "--seed", "5"]) == 0
    return folder


@pytest.fixture(scope="module")
def expected(scene: Path) -> dict[tuple[int, float], list[float]]:
    """What the class gives, fed step by step, of tracks that were reported by then."""
    config = load_config("default", SETTINGS)
    tracker, reported = Tracker(config, image=IMAGE, diagnostics=True), set()
    behind = RoadFixedLag(read_camera(scene / "camera.yaml"), RoadLagConfig(lag_s=LAG_S))
    found = []
    for batch in read_detections(scene / "detections.csv").batches():
        reported.update(tracker.step(batch).track_id.tolist())
        rows = behind.step(batch[0].t, tracker.last_measurements()[0])
        found += [row for row in rows if row["track_id"] in reported]
    found += [row for row in behind.finish() if row["track_id"] in reported]
    return {
        (int(row["track_id"]), round(float(row["t"]), 4)): [
            *(row["t"], row["mean"][0], row["mean"][1], row["mean"][2] * 3.6, row["mean"][5]),
            *(row["var"][0], row["var"][1], row["var"][2] * 3.6**2),
        ]
        for row in found
    }


def _rows(path: Path) -> dict[tuple[int, float], list[float]]:
    table = read_table(path, ("track_id", *COLUMNS))
    ids, values = table.number("track_id"), np.stack([table.number(name) for name in COLUMNS], axis=1)
    return {(int(k), round(float(row[0]), 4)): row.tolist() for k, row in zip(ids, values, strict=True)}


def _stream(scene: Path, monkeypatch: pytest.MonkeyPatch, *more: str) -> int:
    lines = []
    for batch in read_detections(scene / "detections.csv").batches():
        scans = [
            {"t": s.t, "sensor": s.sensor, "boxes": s.boxes.tolist(), "scores": s.scores.tolist()}
            for s in batch
        ]
        lines.append(json.dumps(scans) + "\n")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO("".join(lines).encode())))
    settings = [part for one in SETTINGS for part in ("--set", one)]
    return main(["stream", "--image", IMAGE, *settings, *more])


def test_a_stream_writes_what_the_class_gives(
    scene: Path,
    expected: dict[tuple[int, float], list[float]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    camera, out = str(scene / "camera.yaml"), tmp_path / "road.csv"
    assert _stream(scene, monkeypatch, "--camera", camera, "--road", str(out), "--late", "skip") == 0
    found = _rows(out)
    assert len(found) > 20
    assert found.keys() == expected.keys()
    for key, row in found.items():
        assert_allclose(row, expected[key], rtol=1e-5, atol=6e-4)  # as the tables are rounded


def test_a_run_writes_the_same(
    scene: Path, expected: dict[tuple[int, float], list[float]], tmp_path: Path
) -> None:
    settings = [part for one in (*SETTINGS, "smoother.road=fixed-lag") for part in ("--set", one)]
    given = [str(scene / "detections.csv"), "--image", IMAGE, *settings]
    assert main(["track", *given, "--camera", str(scene / "camera.yaml"), "--out", str(tmp_path)]) == 0
    found = _rows(tmp_path / "road_smoothed.csv")
    # Of a recording it is known from the beginning which tracks were to be reported.
    assert found.keys() >= expected.keys()
    for key, row in expected.items():
        assert_allclose(found[key], row, rtol=1e-5, atol=6e-4)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--road", "r.csv"), "go together"),
        (("--camera", "CAMERA", "--road", "r.csv"), "--late skip"),
        (("--camera", "CAMERA", "--road", "r.csv", "--late", "skip", "--checkpoint", "c"), "--checkpoint"),
    ],
)
def test_what_cannot_be_had_is_said(
    scene: Path,
    more: tuple[str, ...],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    camera = str(scene / "camera.yaml")
    assert _stream(scene, monkeypatch, *(camera if part == "CAMERA" else part for part in more)) == 2
    assert message in capsys.readouterr().err


def test_who_has_driven_by_is_not_remembered_for_ever(tmp_path) -> None:
    """A day has a million vehicles; rows of those that are still before the camera come all the same."""
    table = SimpleNamespace(
        step=lambda t, rows: empty_road_columns(), held=lambda: {1}, finish=empty_road_columns
    )
    with RoadFile(tmp_path / "road.csv", table) as file:
        for k in range(1, 5000):
            file.take(0.1 * k, np.zeros(0, dtype=MEASUREMENT), np.array([k, k + 1]))
            assert len(file._reported) <= 1002
    assert {1, 4999, 5000} <= file._reported
