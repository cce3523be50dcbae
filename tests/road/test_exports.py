"""Vehicles for other programs, each read back: by its own reader if that is installed, else by its rules."""

from __future__ import annotations

import bz2
import csv
import json
import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from jsonschema import validate
from road_scenes import camera

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.exporting.ottrk import OttrkVideo, write_ottrk
from jeat_graph.road.camera import Georeference
from jeat_graph.road.camera_file import write_camera
from jeat_graph.road.exports.frames import read_road_frames
from jeat_graph.road.exports.utm import to_wgs84

HIGHD = [
    "frame",
    "id",
    "x",
    "y",
    "width",
    "height",
    "xVelocity",
    "yVelocity",
    "xAcceleration",
    "yAcceleration",
    "frontSightDistance",
    "backSightDistance",
    "dhw",
    "thw",
    "ttc",
    "precedingXVelocity",
    "precedingId",
    "followingId",
    "leftPrecedingId",
    "leftAlongsideId",
    "leftFollowingId",
    "rightPrecedingId",
    "rightAlongsideId",
    "rightFollowingId",
    "laneId",
]


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cars in one lane, 30 m apart, and a faster lorry on their right; all drive away."""
    folder = tmp_path_factory.mktemp("exported")
    t = np.arange(0.0, 2.0, 0.03)
    lines = ["t,track_id,x,y,speed_kmh,heading_deg,acceleration,length,width,height"]
    for k, (x, y, v, length) in enumerate(
        [(0.0, 50.0, 20.0, 4.0), (0.0, 20.0, 22.0, 4.0), (3.5, 20.0, 25.0, 12.0)]
    ):
        lines += [f"{a},{k + 1},{x},{y + v * a},{3.6 * v},0,0,{length},1.8,1.5" for a in t]
    (folder / "road.csv").write_text("\n".join(lines) + "\n")
    (folder / "speeds.csv").write_text("track_id,lane,class\n1,a,car\n2,a,car\n3,b,truck\n")
    place = Georeference(500_000.0, 5_400_000.0, math.radians(90.0), "33N")
    from dataclasses import replace

    write_camera(replace(camera(), georeference=place), folder / "camera.yaml")
    return folder


def _export(road: Path, target: str, name: str, *more: str) -> Path:
    out = road / name
    assert main(["export", str(road), "--to", target, "--out", str(out), *more]) == 0
    return out


def test_sumo_gets_front_bumpers_at_even_steps(road: Path) -> None:
    tree = ElementTree.parse(_export(road, "sumo", "fcd.xml", "--output-rate", "10")).getroot()
    assert tree.tag == "fcd-export"
    steps = list(tree)
    times = [float(step.attrib["time"]) for step in steps]
    np.testing.assert_allclose(np.diff(times), 0.1, atol=1e-9)
    first = {one.attrib["id"]: one.attrib for one in steps[0]}
    assert float(first["1"]["y"]) == pytest.approx(50.0 + 2.0)
    assert float(first["3"]["y"]) == pytest.approx(20.0 + 6.0)
    assert first["3"]["type"] == "truck"
    assert float(first["2"]["speed"]) == pytest.approx(22.0, abs=1e-3)
    needed = {"id", "x", "y", "angle", "type", "speed", "pos", "lane", "slope"}
    assert all(needed <= set(one.attrib) for step in steps for one in step)


def test_sumos_own_reader_reads_it(road: Path) -> None:
    sumolib = pytest.importorskip("sumolib")
    out = _export(road, "sumo", "again.xml", "--output-rate", "10")
    seen = [
        (float(step.time), one.id, float(one.x))
        for step in sumolib.xml.parse(str(out), "timestep")
        for one in step.vehicle
    ]
    assert len(seen) == 3 * 20
    assert seen[0][1:] == ("1", 0.0)


def test_on_the_map_sumo_gets_easting_and_northing(road: Path) -> None:
    out = _export(road, "sumo", "map.xml", "--camera", str(road / "camera.yaml"))
    first = next(iter(next(iter(ElementTree.parse(out).getroot())))).attrib
    # The road runs east: 52 m along it are 52 m of easting.
    assert float(first["x"]) == pytest.approx(500_052.0)
    assert float(first["y"]) == pytest.approx(5_400_000.0)
    assert float(first["angle"]) == pytest.approx(90.0)


def test_highd_has_its_columns_and_who_is_around_whom(road: Path) -> None:
    folder = _export(road, "highd", "highd", "--output-rate", "25")
    with (folder / "01_tracks.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == HIGHD
    second = next(r for r in rows if r["id"] == "2" and r["frame"] == "1")
    assert second["precedingId"] == "1"
    assert float(second["dhw"]) == pytest.approx(30.0 - 4.0)
    assert float(second["thw"]) == pytest.approx(26.0 / 22.0, abs=1e-3)
    assert float(second["ttc"]) == pytest.approx(26.0 / 2.0, abs=1e-2)
    assert second["rightAlongsideId"] == "3"
    lorry = next(r for r in rows if r["id"] == "3" and r["frame"] == "1")
    assert lorry["leftAlongsideId"] == "2"
    assert lorry["leftPrecedingId"] == "1"
    assert float(lorry["x"]) == pytest.approx(20.0 - 6.0)
    assert (second["laneId"], lorry["laneId"]) == ("1", "2")
    with (folder / "01_tracksMeta.csv").open() as file:
        meta = {r["id"]: r for r in csv.DictReader(file)}
    for one, row in meta.items():
        own = [int(r["frame"]) for r in rows if r["id"] == one]
        assert own == list(range(int(row["initialFrame"]), int(row["finalFrame"]) + 1))
    assert meta["3"]["class"] == "Truck"
    assert {row["drivingDirection"] for row in meta.values()} == {"2"}
    with (folder / "01_recordingMeta.csv").open() as file:
        record = next(csv.DictReader(file))
    assert (record["numVehicles"], record["numTrucks"], float(record["frameRate"])) == ("3", "1", 25.0)


def test_geojson_is_on_the_globe(road: Path) -> None:
    out = _export(road, "geojson", "ways.geojson", "--camera", str(road / "camera.yaml"))
    content = json.loads(out.read_text())
    position = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
    line = {
        "type": "object",
        "required": ["type", "coordinates"],
        "properties": {
            "type": {"const": "LineString"},
            "coordinates": {"type": "array", "minItems": 2, "items": position},
        },
    }
    feature = {
        "type": "object",
        "required": ["type", "geometry", "properties"],
        "properties": {"type": {"const": "Feature"}, "geometry": line, "properties": {"type": "object"}},
    }
    validate(
        content,
        {
            "type": "object",
            "required": ["type", "features"],
            "properties": {
                "type": {"const": "FeatureCollection"},
                "features": {"type": "array", "items": feature},
            },
        },
    )
    longitude, latitude = content["features"][0]["geometry"]["coordinates"][0]
    assert longitude == pytest.approx(15.0007, abs=1e-3)
    assert 48.7 < latitude < 48.8


def test_utm_agrees_with_proj() -> None:
    pyproj = pytest.importorskip("pyproj")
    rng = np.random.default_rng(0)
    for zone, code in (("33N", 32633), ("56S", 32756)):
        places = np.c_[rng.uniform(2e5, 8e5, 50), rng.uniform(1e6, 9e6, 50)]
        back = pyproj.Transformer.from_crs(code, 4326, always_xy=True)
        np.testing.assert_allclose(to_wgs84(places, zone), np.c_[back.transform(*places.T)], atol=1e-9)


def test_utm_of_known_places() -> None:
    # On the central meridian the easting is 500 km; the length of the meridian arc from the equator to 45° is
    # 4984944.378 m on WGS84, times the scale .9996.
    found = to_wgs84(np.array([[500_000.0, 0.9996 * 4_984_944.378]]), "33N")
    np.testing.assert_allclose(found, [[15.0, 45.0]], atol=1e-8)
    with pytest.raises(DataError, match="zone"):
        to_wgs84(np.zeros((1, 2)), "99Q")


def test_a_camera_on_no_map_is_said(road: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_camera(camera(), tmp_path / "camera.yaml")
    out = tmp_path / "x.geojson"
    more = ["--out", str(out), "--camera", str(tmp_path / "camera.yaml")]
    assert main(["export", str(road), "--to", "geojson", *more]) == 2
    assert "--zone" in capsys.readouterr().err
    assert not out.exists()
    with pytest.raises(DataError, match="no table of a road"):
        read_road_frames(tmp_path, 10.0)


def test_ottrk_is_compressed_json_of_detections_by_frame(tmp_path: Path) -> None:
    t = np.array([0.0, 0.05, 0.1, 0.05, 0.1])
    ids = np.array([7, 7, 7, 9, 9])
    boxes = np.tile([10.0, 20.0, 30.0, 40.0], (5, 1))
    nothing = np.zeros((5, 6))
    table = Trajectories(
        t, ids, boxes, np.full(5, 0.9), nothing, nothing, np.array([1, 0, 1, 1, 1]), ("rgb",)
    )
    video = OttrkVideo("cam_2026-05-01_12-00-00.mp4", 1280, 720, 20.0, 1_777_636_800.0)
    write_ottrk(table, tmp_path / "a.ottrk", video)
    content = json.loads(bz2.decompress((tmp_path / "a.ottrk").read_bytes()))
    number, text, flag = {"type": "number"}, {"type": "string"}, {"type": "boolean"}
    row = {
        "class": text,
        "confidence": number,
        "x": number,
        "y": number,
        "w": number,
        "h": number,
        "frame": {"type": "integer", "minimum": 1},
        "occurrence": number,
        "input_file_path": text,
        "interpolated-detection": flag,
        "first": flag,
        "finished": flag,
        "track-id": {"type": "integer"},
    }
    validate(
        content["data"]["detections"],
        {
            "type": "array",
            "items": {
                "type": "object",
                "required": list(row),
                "properties": row,
                "additionalProperties": False,
            },
        },
    )
    rows = content["data"]["detections"]
    assert [(r["track-id"], r["frame"]) for r in rows] == [(7, 1), (7, 2), (9, 2), (7, 3), (9, 3)]
    assert [r["first"] for r in rows] == [True, False, True, False, False]
    assert [r["finished"] for r in rows] == [False, False, False, True, True]
    # Since version 1.1 of detections: the top left corner, not the centre.
    assert (rows[0]["x"], rows[0]["y"], rows[0]["w"], rows[0]["h"]) == (10.0, 20.0, 30.0, 40.0)
    assert rows[1]["interpolated-detection"]
    assert rows[1]["occurrence"] == pytest.approx(1_777_636_800.05)


def test_ottrk_says_what_otanalytics_asks_for_of_the_video_the_detector_and_the_tracker(
    tmp_path: Path,
) -> None:
    nothing, boxes = np.zeros((3, 6)), np.tile([10.0, 20.0, 30.0, 40.0], (3, 1))
    kinds, share = np.array(["truck", "", "bus"]), np.ones(3)
    table = Trajectories(
        *(np.array([0.0, 0.05, 0.1]), np.array([7, 8, 9]), boxes, np.full(3, 0.9), nothing, nothing),
        *(np.ones(3, dtype=np.int64), ("rgb",)),
        classes=kinds,
        class_probability=share,
    )
    write_ottrk(table, tmp_path / "a.ottrk", OttrkVideo("cam.mp4", 1280, 720, 20.0, 1_777_636_800.0))
    said = json.loads(bz2.decompress((tmp_path / "a.ottrk").read_bytes()))["metadata"]
    assert (said["otdet_version"], said["ottrk_version"]) == ("1.2", "1.1")
    video = said["video"]
    assert video["filename"] + video["filetype"] == "cam.mp4"
    assert float(video["recorded_start_date"]) == 1_777_636_800.0
    assert (video["width"], video["height"], video["number_of_frames"]) == (1280, 720, 3)
    assert (float(video["recorded_fps"]), float(video["actual_fps"])) == (20.0, 20.0)
    assert video["expected_duration"] == 1
    # The classes that it offers as filters: all that occur in the detections.
    assert set(said["detection"]["model"]["classes"].values()) == {"truck", "bus", "car"}
    assert {"tracking_run_id", "frame_group"} <= set(said["tracking"])
