"""Two lenses and two clocks: projections worked out independently, clocks exact, nothing changed without."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jeat_graph import load_config
from jeat_graph.cli.main import main
from jeat_graph.data.errors import ConfigError
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.truth_io import read_truth
from jeat_graph.rig.common_picture import CommonPicture, common_time
from jeat_graph_sehn.simulation.scenario import Scenario, load_scenario
from jeat_graph_sehn.simulation.simulate import SimulatedRecording, record
from jeat_graph_sehn.simulation.world.camera import Camera, CameraConfig
from jeat_graph_sehn.simulation.world.rig import DRAWN, Rig, RigConfig, draw_rig

CONFIG = RigConfig(
    width=1024,
    height=768,
    focal_px=900.0,
    right_m=0.6,
    down_m=-0.2,
    forward_m=0.1,
    pitch_deg=1.5,
    yaw_deg=-2.0,
    roll_deg=1.0,
    offset_s=-12.345678,
    drift_ppm=37.5,
    at_s=3.0,
)


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("day")


@pytest.fixture(scope="module")
def recording(scenario: Scenario) -> SimulatedRecording:
    return record(scenario, 7, 4.0, CONFIG)


def about(axis: int, degrees: float) -> np.ndarray:
    """Right-handed turn about an axis."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    a, b = [(1, 2), (2, 0), (0, 1)][axis]
    R = np.eye(3)
    R[a, a], R[a, b], R[b, a], R[b, b] = c, -s, s, c
    return R


def pinhole(camera: CameraConfig, rig: RigConfig) -> np.ndarray:
    """The event camera's 3 x 4 matrix, from turns about the cameras' own axes X right, Y down, Z forward."""
    # Level and facing along the road, then turned, tilted, rolled, each about the axes as they are by then.
    level = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])

    def mounted(pitch: float, yaw: float, roll: float) -> np.ndarray:
        return about(2, -roll) @ about(0, pitch) @ about(1, -yaw)

    first = mounted(camera.pitch_deg, camera.yaw_deg, camera.roll_deg) @ level
    place = np.array([camera.offset_m, 0.0, camera.mount_height_m])
    place = place + first.T @ [rig.right_m, rig.down_m, rig.forward_m]
    R = mounted(rig.pitch_deg, rig.yaw_deg, rig.roll_deg) @ first
    K = np.array([[rig.focal_px, 0, rig.width / 2], [0, rig.focal_px, rig.height / 2], [0, 0, 1.0]])
    return np.asarray(K @ np.column_stack([R, -R @ place]))


def test_boxes_are_those_of_an_independent_pinhole(scenario: Scenario, recording: SimulatedRecording) -> None:
    P, truth = pinhole(scenario.camera, CONFIG), recording.own_truth
    assert truth is not None
    assert recording.rig is not None
    states = recording.scene.states_at(recording.truth.frame_times(), far_m=170.0)
    compared = 0
    for k in range(0, len(states), 17):
        t = recording.rig.reading(recording.truth.frame_times()[states.frame[k : k + 1]])[0]
        row = np.flatnonzero((truth.t == t) & (truth.object_id == states.object_id[k]))
        x, y, heading = states.pose[k]
        length, width, height = states.size[k]
        ahead, right = (
            np.array([np.sin(heading), np.cos(heading)]),
            np.array([np.cos(heading), -np.sin(heading)]),
        )
        corners = [
            [*(np.array([x, y]) + a * length * ahead + b * width * right), c * height, 1.0]
            for a in (-0.5, 0.5)
            for b in (-0.5, 0.5)
            for c in (0.0, 1.0)
        ]
        shown = np.array(corners) @ P.T
        if not len(row) or (shown[:, 2] < 1.0).any():
            continue
        pixels = np.clip(shown[:, :2] / shown[:, 2:], 0.0, [CONFIG.width, CONFIG.height])
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        np.testing.assert_allclose(truth.boxes[row[0]], [*low, *(high - low)], atol=1e-5)
        compared += 1
    assert compared > 40


def test_the_first_cameras_truth_is_that_of_a_recording_without_rig(scenario: Scenario) -> None:
    """The ring is longer with a rig, so the same long ring is compared."""
    with_rig = record(scenario, 7, 2.0, CONFIG)
    alone = record(with_rig.scenario, 7, 2.0)
    np.testing.assert_array_equal(with_rig.truth.boxes, alone.truth.boxes)
    np.testing.assert_array_equal(with_rig.truth.t, alone.truth.t)
    assert alone.rig is None
    ours, theirs = with_rig.detections.select(["rgb"]), alone.detections.select(["rgb"])
    np.testing.assert_array_equal(ours.boxes, theirs.boxes)


def test_offset_and_drift_are_exact_to_the_microsecond(
    scenario: Scenario, recording: SimulatedRecording, tmp_path: Path
) -> None:
    alone = record(recording.scenario, 7, 4.0).detections.sensor_times("evt")
    own = recording.detections.sensor_times("evt")
    assert recording.rig is not None
    (tmp_path / "rig.yaml").write_text(recording.rig.text(("rgb", "evt")))
    clock = load_config(rig=tmp_path / "rig.yaml").sensors["evt"].clock
    assert clock is not None
    assert (clock.offset_s, clock.drift_ppm, clock.at_s) == (-12.345678, 37.5, 3.0)
    np.testing.assert_allclose(common_time(own, clock), alone, rtol=0.0, atol=0.6e-6)
    # By hand: at its 3 s it is 12.345678 s behind, and 2 s of the common clock later it has gained 75 µs.
    at_three = recording.rig.reading(np.array([15.345678, 17.345678]))
    np.testing.assert_allclose(at_three, [3.0, 5.000075], rtol=0.0, atol=1.1e-6)


def test_true_boxes_go_by_the_true_rig_to_where_the_first_camera_sees_them(
    recording: SimulatedRecording, tmp_path: Path
) -> None:
    assert recording.rig is not None
    assert recording.own_truth is not None
    (tmp_path / "rig.yaml").write_text(recording.rig.text(("rgb", "evt")))
    way = CommonPicture.of(load_config(rig=tmp_path / "rig.yaml")).ways["evt"].picture
    assert way is not None
    first, own = recording.truth, recording.own_truth
    ours = {(round(float(recording.rig.reading(t[None])[0]), 6), i): k
            for k, (t, i) in enumerate(zip(first.t, first.object_id.tolist(), strict=True))}  # fmt: skip
    errors = []
    for k, (t, i) in enumerate(zip(own.t, own.object_id.tolist(), strict=True)):
        j = ours.get((round(float(t), 6), i))
        if (
            j is None
            or own.ignore[k]
            or not (whole(own.boxes[k], (1024, 768)) and whole(first.boxes[j], (1280, 720)))
        ):
            continue
        moved, good = way.boxes(own.boxes[k : k + 1])
        assert good[0]
        errors.append(moved[0, :2] + moved[0, 2:] / 2 - first.boxes[j, :2] - first.boxes[j, 2:] / 2)
    assert len(errors) > 200
    assert np.sqrt(np.mean(np.square(errors))) < 0.6


def whole(box: np.ndarray, size: tuple[int, int]) -> bool:
    return bool((box[:2] > 0).all() and (box[:2] + box[2:] < size).all())


def test_detections_lie_in_their_own_pictures(recording: SimulatedRecording) -> None:
    for name, size in (("rgb", (1280, 720)), ("evt", (1024, 768))):
        boxes = recording.detections.select([name]).boxes
        assert (boxes[:, :2] >= 0).all()
        assert (boxes[:, :2] + boxes[:, 2:] <= np.array(size) + 1e-3).all()
        assert (boxes[:, 1] + boxes[:, 3]).max() > size[1] - 20


def test_who_begins_late_ends_late(scenario: Scenario) -> None:
    found = record(scenario, 3, 6.0, replace(CONFIG, offset_s=0.0, drift_ppm=0.0, late_s=2.0)).detections
    rgb, evt = found.sensor_times("rgb"), found.sensor_times("evt")
    assert (rgb.min(), rgb.max()) == (pytest.approx(0.0, abs=0.1), pytest.approx(4.0, abs=0.1))
    assert (evt.min(), evt.max()) == (pytest.approx(2.0, abs=0.1), pytest.approx(6.0, abs=0.1))


def test_nobody_comes_round_in_a_recording_with_a_rig(recording: SimulatedRecording) -> None:
    states = recording.scene.states_at(np.array([0.0, 4.0]), far_m=1e4)
    vehicles = len(recording.scene.fleet) + len(recording.scene.parked_fleet)
    assert states.object_id.max() <= 2 * vehicles
    assert recording.scenario.traffic.ring_m >= 4.0 * 45.0


def test_drawn_rigs_are_within_their_bounds_and_follow_the_seed() -> None:
    camera = Camera.mounted(CameraConfig())
    rigs = [draw_rig(np.random.default_rng(seed), camera) for seed in range(200)]
    apart = np.array([np.hypot(one.right_m, one.down_m) for one in rigs])
    assert apart.min() < 0.2
    assert apart.max() > 0.9
    assert ((apart > 0.0999) & (apart < 1.0001)).all()
    offsets, drifts = (np.array([getattr(one, name) for one in rigs]) for name in ("offset_s", "drift_ppm"))
    assert np.abs(offsets).max() <= 30.0 < np.ptp(offsets)
    assert np.abs(drifts).max() <= 50.0 < np.ptp(drifts)
    assert len({(one.width, one.height) for one in rigs}) == 4
    assert draw_rig(np.random.default_rng(5), camera) == rigs[5]


def test_a_camera_below_the_road_is_refused() -> None:
    with pytest.raises(ConfigError, match="below the road"):
        Rig.beside(Camera.mounted(CameraConfig()), RigConfig(down_m=20.0))


def fingerprints(folder: Path) -> dict[str, str]:
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in sorted(folder.iterdir())}


def test_the_command_writes_the_true_rig_and_the_same_bytes_again(tmp_path: Path) -> None:
    for name in ("one", "two"):
        command = [
            "simulate",
            "night",
            "--duration",
            "3",
            "--seed",
            "9",
            "--rig",
            DRAWN,
            "--out",
            str(tmp_path / name),
        ]
        assert main(command) == 0
    assert fingerprints(tmp_path / "one") == fingerprints(tmp_path / "two")
    assert {"rig.yaml", "camera.yaml", "camera_evt.yaml", "gt.csv", "gt_evt.csv"} <= set(
        fingerprints(tmp_path / "one")
    )
    assert main(["simulate", "--verify", str(tmp_path / "one")]) == 0
    config = load_config(rig=tmp_path / "one" / "rig.yaml")
    found = CommonPicture.of(config).detections(read_detections(tmp_path / "one" / "detections.csv"))
    assert found.sensor_times("evt").min() == pytest.approx(0.0, abs=0.05)
    first, own = read_truth(tmp_path / "one" / "gt.csv"), read_truth(tmp_path / "one" / "gt_evt.csv")
    assert len(first.frame_times()) == len(own.frame_times())


def test_a_recording_without_rig_leaves_no_file_of_an_earlier_one(tmp_path: Path) -> None:
    command = ["simulate", "night", "--duration", "2", "--out", str(tmp_path / "sim")]
    assert main([*command, "--rig", DRAWN]) == 0
    assert main(command) == 0
    assert main(["simulate", "--verify", str(tmp_path / "sim")]) == 0
    assert "rig.yaml" not in fingerprints(tmp_path / "sim")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{offset: 3}", "unknown key offset"),
        ("{width: 4}", "width: 4 is not in"),
        ("{late_s: 8}", "leave nothing that both cameras see"),
        ("{right_m: 300}", "do not see the same road"),
    ],
)
def test_a_rig_that_cannot_be_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, said: str
) -> None:
    (tmp_path / "mine.yaml").write_text(text)
    command = ["simulate", "night", "--duration", "3", "--rig", str(tmp_path / "mine.yaml")]
    assert main([*command, "--out", str(tmp_path / "sim")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error
    assert not (tmp_path / "sim").exists()
