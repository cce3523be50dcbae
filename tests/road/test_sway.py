"""Vehicles that stand, before a camera on a gantry that sways: they stand on the road, too."""

from __future__ import annotations

import numpy as np
import pandas as pd
from road_scenes import camera

from jeat_graph.cli.main import main
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.road.camera_file import write_camera
from jeat_graph.road.cuboid import sides
from jeat_graph.road.sway import steadied

RATE, SECONDS, RMS_PX = 20.0, 12.0, 2.0
PLACES = [(x, y) for y in (22.0, 32.0) for x in (-1.5, 2.0, 5.5)]


def sway(t, rng):
    """A common signal (N,) of 0.3 to 2 Hz, in px."""
    rate, phase = rng.uniform(0.3, 2.0, 30), rng.uniform(0.0, 2.0 * np.pi, 30)
    return RMS_PX * np.sqrt(2.0 / 30.0) * np.sin(2.0 * np.pi * np.outer(t, rate) + phase).sum(axis=1)


def seen(path, creeping_kmh=0.0):
    """Write boxes of six cars, all shifted by the same, with the noise of a good detector."""
    rng, t = np.random.default_rng(4), np.arange(0.0, SECONDS, 1.0 / RATE)
    shift = np.stack([sway(t, rng), sway(t, rng)], axis=1)
    assert np.sqrt((shift**2).mean()) > 1.5
    rows = []
    for x, y in PLACES:
        xy = np.stack([np.full_like(t, x), y - creeping_kmh / 3.6 * t], axis=1)
        box, _ = sides(camera(), xy, np.zeros(len(t)), np.array([4.4, 1.8, 1.5]))
        extent = np.sqrt((box[:, 2] - box[:, 0]) * (box[:, 3] - box[:, 1]))
        box = box + np.tile(shift, 2) + 0.01 * extent[:, None] * rng.normal(size=box.shape)
        for k in np.flatnonzero(rng.random(len(t)) < 0.95):
            left, top, right, bottom = box[k]
            rows.append((t[k], "rgb", left, top, right - left, bottom - top, 0.8))
    columns = ["t", "sensor", "left", "top", "width", "height", "score"]
    pd.DataFrame(rows, columns=columns).to_csv(path, index=False)


def measured(folder, creeping_kmh=0.0):
    """Speeds (km/h) of the vehicles, and of the rows of both tables of the road after 2 s."""
    folder.mkdir()
    seen(folder / "boxes.csv", creeping_kmh)
    write_camera(camera(), folder / "camera.yaml")
    words = ["--camera", str(folder / "camera.yaml"), "--out"]
    run = str(folder / "run")
    assert main(["track", str(folder / "boxes.csv"), "--image", "1920x1080", *words, run]) == 0
    assert main(["road", run, *words, str(folder / "speeds")]) == 0
    rows = [pd.read_csv(folder / "run" / f"road_{kind}.csv") for kind in ("causal", "smoothed")]
    # Rows after 2 s: before that nobody can know a speed.
    return (
        pd.read_csv(folder / "speeds" / "speeds.csv").speed_kmh,
        *(one[one.t > 2.0].speed_kmh.dropna() for one in rows),
    )


def test_vehicles_that_stand_have_no_speed(tmp_path):
    speeds, causal, smoothed = measured(tmp_path / "standing")
    assert len(speeds) == len(PLACES)
    assert speeds.abs().max() < 0.1
    assert np.sqrt((smoothed**2).mean()) < 0.1, "0.25 with the sway in it"
    assert smoothed.max() < 0.5
    assert causal.quantile(0.95) < 0.5
    creeping, _, _ = measured(tmp_path / "creeping", 1.5)
    np.testing.assert_allclose(creeping, 1.5, atol=0.3)


def logged(shift, standing=6, driving=3, stated_px=8.0):
    """A log of vehicles that stand or drive, with noise of 1.5 px; all boxes are shifted by the same."""
    rng, t = np.random.default_rng(1), np.arange(len(shift)) / RATE
    parts = []
    for k in range(standing + driving):
        seen = rng.random(len(t)) < 0.9
        part = np.zeros(int(seen.sum()), dtype=MEASUREMENT)
        part["t"], part["track_id"] = t[seen], k + 1
        place = rng.uniform(200, 900, 2) + np.outer(t[seen], [0.0, 60.0 if k >= standing else 0.0])
        part["z"] = part["side"] = place + shift[seen] + rng.normal(0, 1.5, (len(part), 2))
        part["r"], part["log_size"] = (
            stated_px**2,
            np.log(80.0),
        )  # the tracker's first guess, which is far off
        parts.append(part)
    log = np.concatenate(parts)
    return log[np.argsort(log["t"], kind="stable")]


def test_the_common_shift_is_taken_out_of_all_boxes():
    t, rng = np.arange(0.0, 20.0, 1.0 / RATE), np.random.default_rng(0)
    shift = np.stack([sway(t, rng), sway(t, rng)], axis=1)
    log = logged(shift)
    taken = log["z"] - steadied(log)["z"]
    true = shift[np.round(log["t"] * RATE).astype(int)]
    error = taken - true - (taken - true).mean(axis=0)
    # Six vehicles tell it to 1.5 px / √6; those that drive are steadied by the others.
    assert np.sqrt((error**2).mean()) < 0.8 < 1.5 < np.sqrt((true**2).mean())
    np.testing.assert_array_equal(steadied(log)["t"], log["t"])


def test_a_camera_that_stands_still_changes_nothing():
    log = logged(np.zeros((400, 2)))
    assert steadied(log) is log


def test_vehicles_that_drive_alike_are_no_sway():
    log = logged(np.outer(np.arange(400) / RATE, [0.0, 6.0]))
    assert steadied(log) is log
    assert steadied(log[:0]).size == 0
