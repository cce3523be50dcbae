"""`register`: two cameras over one road brought together by what they saw, or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.rig_scenes import RigScene, draw_scene, judge, true_offset
from jeat_graph import load_config, read_detections
from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph.rig.clock_search import offset_of, rank_offsets
from jeat_graph.rig.common_picture import CommonPicture
from jeat_graph.rig.homography import fit_homography
from jeat_graph.rig.points import map_of_points
from jeat_graph.rig.registering import register_by_traffic
from jeat_graph.rig.sensor_tracks import STEP_S, SensorTracks
from jeat_graph.runs.own_tracks import own_tracks

from .drawn_tracks import moving_tracks

SEED = 14
NAMES = ("rgb", "evt")


class Recorded:
    """A rig's detections in two files, and its own tracks."""

    def __init__(self, folder: Path, seed: int, kind: str) -> None:
        self.scene: RigScene = draw_scene(seed, kind)
        self.files = [str(folder / f"{name}.csv") for name in NAMES]
        for camera, file in enumerate(self.files):
            write_detections(self.scene.detections(camera), file)

    @property
    def sizes(self) -> list[str]:
        (w, h), (wide, high) = self.scene.sizes
        return ["--image", f"{w}x{h}", "--sensor-image", f"evt={wide}x{high}"]

    def tracks(self) -> list[SensorTracks]:
        return [
            own_tracks(read_detections(file), size)
            for file, size in zip(self.files, self.scene.sizes, strict=True)
        ]


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return Recorded(tmp_path_factory.mktemp("road"), SEED, "road")


@pytest.fixture(scope="module")
def rig(road: Recorded, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("rig") / "rig.yaml"
    assert main(["register", *road.files, *road.sizes, "--out", str(out)]) == 0
    return out


def test_true_boxes_of_other_vehicles_go_where_they_are_seen(road: Recorded, rig: Path) -> None:
    config = load_config(rig=rig)
    way = CommonPicture.of(config).ways["evt"]
    assert way.picture is not None
    errors = judge(road.scene, way.picture)
    for kind, found in errors.items():
        assert np.sqrt(np.mean(found**2)) < 2.0, kind
    std = way.picture.std_px(road.scene.sizes[1])
    assert 0.1 < std < 3.0


def test_the_clock_is_found_to_milliseconds(road: Recorded, rig: Path) -> None:
    clock = load_config(rig=rig).sensors["evt"].clock
    assert clock is not None
    error = clock.offset_s - true_offset(road.scene, clock.at_s)
    assert abs(error) < 3.0 * clock.offset_std_s
    assert clock.offset_std_s < 0.004


def test_an_earlier_rig_is_sharpened(road: Recorded, rig: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "again.yaml"
    assert main(["register", *road.files, *road.sizes, "--rig", str(rig), "--out", str(out)]) == 0
    before, after = (load_config(rig=one).sensors["evt"] for one in (rig, out))
    np.testing.assert_allclose(before.to_picture[:3], after.to_picture[:3], rtol=0.01)
    assert before.clock is not None
    assert after.clock is not None
    assert after.clock.offset_s == pytest.approx(before.clock.offset_s, abs=1e-3)


@pytest.mark.parametrize(
    ("kind", "seed", "why"),
    [
        ("lane", 100, "does not tell"),
        ("lane", 301, "one lane"),
        ("apart", 101, "look at different roads, or did not record at one time"),
    ],
)
def test_traffic_that_does_not_tell_is_refused_and_no_file_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, seed: int, why: str
) -> None:
    recorded = Recorded(tmp_path, seed, kind)
    out = tmp_path / "rig.yaml"
    out.write_text("was here\n")
    assert main(["register", *recorded.files, *recorded.sizes, "--out", str(out)]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert "the traffic does not tell how sensors 'rgb' and 'evt' lie to each other" in line
    assert why in line
    assert out.read_text() == "was here\n"


def test_traffic_that_repeats_itself_tells_no_clock() -> None:
    # Equal vehicles every 3 s: with the clock wrong by 3 s each matches the vehicle before it just as well.
    lanes = [(100.0, 160.0), (180.0, 200.0), (260.0, 240.0)]
    t = np.arange(0.0, 60.0, STEP_S)
    centres = [
        np.column_stack([(speed + 15.0 * (t - begin)) * (t - begin), y + 0.0 * t])
        for k, (y, speed) in enumerate(lanes)
        for begin in np.arange(-12.0 + 0.7 * k, 60.0, 3.0)
    ]
    centre = np.stack(centres)
    centre[(centre[:, :, 0] < 0.0) | (centre[:, :, 0] > 600.0)] = np.nan
    centre = centre[np.isfinite(centre[:, :, 0]).sum(axis=1) > 10]
    size = np.full_like(centre, 40.0)
    first, second = (moving_tracks(at, centre, size) for at in (0.0, 5.0))
    with pytest.raises(DataError, match="another one at quite another difference: record longer"):
        register_by_traffic(first, second, NAMES, ((640.0, 480.0), (640.0, 480.0)))


def test_cameras_that_face_each_other_are_said_to_and_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded = Recorded(tmp_path, 102, "facing")
    out = tmp_path / "rig.yaml"
    assert main(["register", *recorded.files, *recorded.sizes, "--out", str(out)]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert "sensors 'rgb' and 'evt' face each other" in line
    assert "`handover` follows vehicles" in line
    said = float(line.partition("ahead by about ")[2].partition(" s)")[0])
    assert said == pytest.approx(true_offset(recorded.scene, 50.0), abs=0.5)
    assert not out.exists()


def test_cameras_over_a_short_stretch_are_brought_together_to_what_is_said(tmp_path: Path) -> None:
    # Vehicles are wholly in view for 2 s, and match at clocks half a second apart.
    recorded = Recorded(tmp_path, 600, "stretch")
    out = tmp_path / "rig.yaml"
    assert main(["register", *recorded.files, *recorded.sizes, "--out", str(out)]) == 0
    config = load_config(rig=out)
    way, clock = CommonPicture.of(config).ways["evt"].picture, config.sensors["evt"].clock
    assert way is not None
    assert clock is not None
    assert abs(clock.offset_s - true_offset(recorded.scene, clock.at_s)) < 3.0 * clock.offset_std_s < 0.06
    errors = np.concatenate(list(judge(recorded.scene, way).values()))
    assert np.sqrt(np.mean(errors**2)) < way.std_px(recorded.scene.sizes[1])


def test_vehicles_that_grow_alike_tell_the_clocks_difference_without_any_picture(road: Recorded) -> None:
    first, second = road.tracks()
    best, other = rank_offsets(first, second, 2)
    assert offset_of(best.shift, first, second) == pytest.approx(true_offset(road.scene, 50.0), abs=0.15)
    assert best.score > 1.5 * other.score


def test_points_tell_the_picture_and_traffic_the_clock(road: Recorded, tmp_path: Path, capsys) -> None:
    rng = np.random.default_rng(0)
    places = np.column_stack([rng.uniform(-8, 8, 12), rng.uniform(15, 80, 12), np.full(12, 0.7)])
    pixels = [camera.project(places)[0] for camera in road.scene.cameras]
    table = np.round(np.concatenate(pixels, axis=1), 1)
    points = tmp_path / "points.csv"
    points.write_text("rgb_x,rgb_y,evt_x,evt_y\n" + "\n".join(",".join(map(str, row)) for row in table))
    out = tmp_path / "rig.yaml"
    command = ["register", *road.files, *road.sizes, "--points", str(points), "--out", str(out)]
    assert main(command) == 0
    sensor = load_config(rig=out).sensors["evt"]
    assert len(sensor.to_picture) == 9
    assert sensor.clock is not None
    assert abs(sensor.clock.offset_s - true_offset(road.scene, sensor.clock.at_s)) < 0.02
    errors = judge(road.scene, PictureMap.of_numbers(np.array(sensor.to_picture)))
    assert np.sqrt(np.mean(errors["car"] ** 2)) < 2.0


@given(st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=8))
def test_a_homography_is_recovered_from_exact_points(values: list[float]) -> None:
    H = np.eye(3) + np.array([*values, 0.0]).reshape(3, 3) * [[0.2, 0.2, 90], [0.2, 0.2, 90], [2e-4, 2e-4, 0]]
    points = np.random.default_rng(1).uniform(0, [1280, 720], (9, 2))
    right = PictureMap.of_numbers(H.ravel())
    there = right.points(points)
    found = fit_homography(points, there)
    np.testing.assert_allclose(found.points(points), there, atol=1e-5)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (np.array([[0.0, 0], [10, 10], [20, 20], [30, 30], [40, 40]]), "lie on one line"),
        (np.array([[0.0, 0], [10, 10], [20, 5]]), "3 points: a homography needs 4"),
    ],
)
def test_points_that_tell_no_map_are_refused(points: np.ndarray, said: str) -> None:
    with pytest.raises(DataError, match=f"points.csv: .*{said}"):
        map_of_points(points, points, (640.0, 480.0), "points.csv")


def test_a_point_that_does_not_fit_is_named() -> None:
    points = np.random.default_rng(2).uniform(0, 600, (8, 2))
    wrong = points.copy()
    wrong[5] += 150.0
    with pytest.raises(DataError, match="do not fit together"):
        map_of_points(points, wrong, (640.0, 480.0), "points.csv")


def test_the_same_boxes_twice_are_one_picture_and_one_clock(road: Recorded, tmp_path: Path, capsys) -> None:
    out = tmp_path / "rig.yaml"
    twice = [f"{name}={road.files[0]}" for name in ("a", "b")]
    size = "x".join(map(str, road.scene.sizes[0]))
    assert main(["register", *twice, "--image", size, "--sensor-image", f"b={size}", "--out", str(out)]) == 0
    sensor = load_config(rig=out).sensors["b"]
    assert sensor.clock is not None
    assert abs(sensor.clock.offset_s) < 1e-4
    points = np.array([[100.0, 100.0], [600.0, 400.0]])
    moved = PictureMap.of_numbers(np.array(sensor.to_picture)).points(points, 30.0)
    np.testing.assert_allclose(moved, points, atol=0.1)


def test_one_sensor_is_no_rig(road: Recorded, tmp_path: Path, capsys) -> None:
    assert main(["register", road.files[0], "--out", str(tmp_path / "r.yaml")]) == 2
    assert "there is one sensor, 'rgb': a rig has two or more" in capsys.readouterr().err
