"""With nothing measured at all vehicles' own sizes tell a scale, roughly, and it is said how roughly."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from road_scenes import HEIGHT, WIDTH, camera

from jeat_graph.cli.main import main
from jeat_graph.io.tables.trajectories_io import COLUMNS
from jeat_graph.road.camera_file import read_camera
from jeat_graph.road.cuboid import sides
from jeat_graph.road.evidence import CalibrationConfig, TrackNodes, thin
from jeat_graph.road.fleet import CLASSES
from jeat_graph.road.size_evidence import size_ratios

CONFIG = CalibrationConfig(most_tracks=24)


def _drive(seed: int, count: int, spread: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vehicles of all kinds, anywhere across the road, so that it has no lanes: t, track, sides of boxes."""
    cam, rng = camera(), np.random.default_rng(seed)
    times, ids, boxes = [], [], []
    for k in range(count):
        one = CLASSES[rng.choice(len(CLASSES), p=[c.share for c in CLASSES])] if spread else CLASSES[1]
        size = np.array(one.mean) + spread * rng.standard_normal(3) * one.spread
        v = 22.0 + 3.0 * rng.standard_normal()
        t = np.arange(0.0, 40.0 / v, 0.04)
        xy = np.c_[np.full(len(t), rng.uniform(-1.0, 9.0)), 62.0 - v * t]
        made, _ = sides(cam, xy, np.zeros(len(t)), size)
        made = made + 0.5 * spread * rng.standard_normal(made.shape)
        times.append(10.0 * k + t)
        ids.append(np.full(len(t), k))
        boxes.append(made)
    return np.concatenate(times), np.concatenate(ids), np.concatenate(boxes)


def _boxes(seed: int, count: int, spread: float = 1.0) -> TrackNodes:
    t, ids, made = _drive(seed, count, spread)
    contact = np.stack([(made[:, 0] + made[:, 2]) / 2.0, made[:, 3]], axis=1)
    return thin(t, ids, contact, CONFIG, (WIDTH, HEIGHT), made)


def test_average_vehicles_look_as_they_should_through_the_true_camera() -> None:
    tracks = _boxes(0, 6, spread=0.0)
    log = size_ratios(camera(), tracks).log[:, 1]
    assert np.isfinite(log).any()
    assert_allclose(np.nan_to_num(log), 0.0, atol=5e-3)


def test_through_a_camera_half_as_high_they_look_half_as_large() -> None:
    half = replace(camera(), position=0.5 * camera().position)
    log = size_ratios(half, _boxes(0, 6, spread=0.0)).log[:, 1]
    # Nearly: an average vehicle half as far away fills twice as much, and a little more.
    assert_allclose(log[np.isfinite(log)], np.log(0.5), atol=0.15)


def test_a_box_cut_by_the_edge_does_not_count() -> None:
    tracks = _boxes(1, 12)
    assert tracks.sides is not None
    whole = np.isfinite(tracks.sides).all(axis=-1)
    assert whole.any()
    assert (tracks.sides[whole] > 0.0).all()
    assert (tracks.sides[whole][:, 2] < WIDTH).all()


@pytest.mark.slow
def test_sizes_alone_calibrate_a_camera_as_well_as_they_say(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nearly all of what it leaves open is the focal length."""
    t, ids, made = _drive(2, 14)
    boxes, middle = tmp_path / "boxes.csv", (made[:, :2] + made[:, 2:]) / 2.0
    values = [t, ids, made[:, :2], made[:, 2:] - made[:, :2], np.ones(len(t)), middle, np.zeros((len(t), 10))]
    lines = [",".join(f"{value:.9g}" for value in row) + ",rgb\n" for row in np.column_stack(values)]
    boxes.write_text(",".join(COLUMNS) + "\n" + "".join(lines))
    out = str(tmp_path / "camera.yaml")
    given = ["--run", str(boxes), "--image", f"{WIDTH}x{HEIGHT}", "--out", out]
    assert main(["camera", "calibrate", *given]) == 0
    assert "nothing was measured" in capsys.readouterr().out
    found = read_camera(out)
    pixels = camera().project(np.array([[3.0, 25.0, 0.0], [3.0, 50.0, 0.0]]))[0]
    seen, J = found.to_road(pixels), found.calibration_jacobian(pixels)
    length, slope = seen[1, 1] - seen[0, 1], J[1, 1] - J[0, 1]
    spread = np.sqrt(slope @ found.covariance @ slope) / length
    assert abs(np.log(length / 25.0)) < min(0.2, 2.0 * spread)
    assert 0.04 < spread < 0.5
