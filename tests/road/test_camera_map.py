"""Two calibrated cameras tell the way of boxes from one picture into the other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import DataError
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.camera_file import write_camera
from jeat_graph.road.camera_map import map_between


def camera(x: float, width: int, height: int, focal: float, k1: float = 0.0) -> RoadCamera:
    tilt = math.radians(14.0)
    turn = np.array([[1, 0, 0], [0, -math.sin(tilt), -math.cos(tilt)], [0, math.cos(tilt), -math.sin(tilt)]])
    place = np.array([x, 0.0, 8.0])
    return RoadCamera(width, height, focal, focal, width / 2, height / 2, k1, 0.0, turn, place)


OWN, COMMON = camera(0.8, 640, 480, 600.0), camera(0.0, 1280, 720, 1100.0)


def boxes(one: RoadCamera) -> np.ndarray:
    """Boxes (N, 4) around cars and lorries that drive along the road, corner by corner."""
    out = []
    for x in (-5.0, 0.0, 5.0):
        for y in (25.0, 40.0, 90.0):
            for length, width, height in ((4.2, 1.8, 1.5), (12.0, 2.5, 3.5)):
                corners = [
                    (x + a * width / 2, y + b * length / 2, c * height)
                    for a in (-1, 1)
                    for b in (-1, 1)
                    for c in (0, 1)
                ]
                pixels = np.array([one.project(np.array(corner))[0] for corner in corners])
                low, high = pixels.min(axis=0), pixels.max(axis=0)
                out.append([*low, *(high - low)])
    return np.array(out)


def test_boxes_go_where_the_other_camera_sees_them() -> None:
    way, left = map_between(OWN, COMMON)
    there, seen = way.boxes(boxes(OWN))
    assert seen.all()
    assert left < 1.5
    right = boxes(COMMON)
    centre = (there - right)[:, :2] + 0.5 * (there - right)[:, 2:]
    assert np.abs(centre[::2]).max() < 2.5  # cars
    assert (np.abs(centre[1::2]).max(axis=1) / right[1::2, 3]).max() < 0.04  # lorries, 12 m long
    assert np.abs(there[:, 3] / right[:, 3] - 1.0).max() < 0.03


def test_cameras_over_other_roads_are_refused() -> None:
    with pytest.raises(DataError, match="do not see the same road"):
        map_between(OWN, replace(COMMON, position=COMMON.position + np.array([500.0, 0, 0])))


def test_register_takes_cameras(tmp_path, capsys) -> None:
    write_camera(OWN, tmp_path / "evt.yaml")
    write_camera(COMMON, tmp_path / "rgb.yaml")
    rows = ["t,sensor,left,top,width,height,score"]
    rows += [f"{k / 20},{name},100,100,30,20,.9" for k in range(40) for name in ("rgb", "evt")]
    (tmp_path / "d.csv").write_text("\n".join(rows) + "\n")
    out = tmp_path / "rig.yaml"
    cameras = [f"--camera={name}={tmp_path / name}.yaml" for name in ("rgb", "evt")]
    assert main(["register", str(tmp_path / "d.csv"), *cameras, "--out", str(out)]) == 0
    assert "the traffic does not tell the clock of evt" in capsys.readouterr().err
    sensor = load_config(rig=out).sensors["evt"]
    assert sensor.image == (640.0, 480.0)
    # Where an optimum lies is known to about the root of a rounding of what is minimised there: thousandths
    # of a px. Some of the nine numbers of the matrix are less sure, and differ from machine to machine.
    right = map_between(OWN, COMMON)[0]
    written = replace(right, matrix=np.reshape(sensor.to_picture, right.matrix.shape))
    np.testing.assert_allclose(written.boxes(boxes(OWN))[0], right.boxes(boxes(OWN))[0], atol=0.01)
