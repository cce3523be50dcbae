"""Cameras, tracks and lengths made from them, for the tests of the road."""

from __future__ import annotations

import numpy as np

from jeat_graph.road.camera import RoadCamera, mounted
from jeat_graph.road.evidence import Lengths

WIDTH, HEIGHT = 1920, 1080


def camera(**changes: float) -> RoadCamera:
    """A camera as they stand over highways: 8 m up, tilted 18° down, turned and rolled a little."""
    f = changes.get("f", 2600.0)
    return RoadCamera(
        WIDTH,
        HEIGHT,
        f,
        f * changes.get("aspect", 1.0),
        changes.get("cx", 960.0),
        changes.get("cy", 540.0),
        changes.get("k1", -0.05),
        changes.get("k2", 0.0),
        mounted(
            np.radians(18.0),
            np.radians(changes.get("yaw_deg", 9.0)),
            np.radians(changes.get("roll_deg", 1.5)),
        ),
        np.array([0.0, 0.0, 8.0]),
    )


def see(camera: RoadCamera, xy: np.ndarray, height_m: float = 0.0) -> np.ndarray:
    """Pixels of points (..., 2) of the road at a height."""
    return camera.project(np.concatenate([xy, np.full((*xy.shape[:-1], 1), height_m)], axis=-1))[0]


def lengths(camera: RoadCamera, rng: np.random.Generator, click_px: float, tape_m: float) -> Lengths:
    """Four lengths along and three across, clicked and taped with errors."""
    ends = np.array(
        [
            [[0.5, 18.0], [0.5, 26.0]],
            [[0.5, 26.0], [0.5, 44.0]],
            [[8.0, 17.0], [8.0, 45.0]],
            [[4.0, 18.0], [4.0, 45.0]],
            [[0.5, 18.0], [8.0, 18.0]],
            [[0.5, 26.0], [8.0, 26.0]],
            [[0.5, 44.0], [8.0, 44.0]],
        ]
    )
    pixels = see(camera, ends) + click_px * rng.standard_normal((7, 2, 2))
    metres = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) + tape_m * rng.standard_normal(7)
    return Lengths(pixels[:, 0], pixels[:, 1], metres, np.arange(7) < 4)


def drives(
    camera: RoadCamera, rng: np.random.Generator, count: int, noise_px: float, drift: float = 0.1
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Vehicles coming towards the camera in two lanes: t, track, pixels, true mean speed of each (m/s)."""
    times, ids, places, speeds = [], [], [], []
    for k in range(count):
        lane = 2.5 if k % 2 else 6.0
        v, a = 22.0 + 3.0 * rng.standard_normal(), 0.2 * rng.standard_normal()
        t = np.arange(0.0, 28.0 / v, 0.02)
        y = 45.0 - v * t + 0.5 * a * t**2
        x = lane + 0.2 * rng.standard_normal() + drift * rng.standard_normal() * t
        pixels = see(camera, np.stack([x, y], axis=1)) + noise_px * rng.standard_normal((len(t), 2))
        inside = ((pixels > 12) & (pixels < [WIDTH - 12, HEIGHT - 12])).all(axis=1)
        if inside.sum() < 20:
            speeds.append(np.nan)
            continue
        times.append(10.0 * k + t[inside])
        ids.append(np.full(inside.sum(), k))
        places.append(pixels[inside])
        ends = np.flatnonzero(inside)[[0, -1]]
        speeds.append(
            float(
                np.hypot(*(np.array([x[ends[1]], y[ends[1]]]) - [x[ends[0]], y[ends[0]]]))
                / np.diff(t[ends])[0]
            )
        )
    return np.concatenate(times), np.concatenate(ids), np.concatenate(places), np.array(speeds)
