"""How the camera moved, against pictures that were moved by known similarities."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from jeat_graph.data.scan import Scan
from jeat_graph.detection import camera_flow
from jeat_graph.detection.camera_flow import CameraFlow, CameraSettings, similarity

WIDTH, HEIGHT, RATE = 640, 384, 20.0
NO_BOXES = np.zeros((0, 4))


def street(seed=0):
    """A picture full of edges and blobs, larger than what the camera sees of it."""
    rng = np.random.default_rng(seed)
    grey = cv2.GaussianBlur(rng.uniform(0, 255, (HEIGHT + 200, WIDTH + 200)).astype(np.float32), (0, 0), 2.5)
    for _ in range(60):
        x, y = rng.integers(0, WIDTH + 150), rng.integers(0, HEIGHT + 150)
        w, h = rng.integers(10, 60, 2)
        cv2.rectangle(grey, (int(x), int(y)), (int(x + w), int(y + h)), float(rng.uniform(60, 200)), -1)
    return grey


def seen(grey, pose=(0.0, 0.0, 0.0, 0.0), noise=2.0, seed=0):
    """The picture of a camera at a pose: shift right, down (px), growth, rotation (rad) about its middle."""
    turn = (1.0 + pose[2]) + 1j * pose[3]
    middle = WIDTH / 2 + 1j * HEIGHT / 2
    to = middle + complex(pose[0], pose[1]) - turn * (middle + 100 + 100j)
    M = np.array([[turn.real, -turn.imag, to.real], [turn.imag, turn.real, to.imag]])
    flat = cv2.warpAffine(grey, M, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC)
    flat = flat + np.random.default_rng(seed).normal(0, noise, flat.shape)
    return np.repeat(np.clip(flat, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def motions(frames, boxes=None):
    """The motions that are reported of pictures, one a picture or None."""
    flow = CameraFlow(CameraSettings())
    out = []
    for k, frame in enumerate(frames):
        one = NO_BOXES if boxes is None else boxes[k]
        out.append(flow(frame, Scan(k / RATE, "rgb", one, np.ones(len(one)))).camera_motion)
    return out


def at_middle(motion):
    """Shift of the picture's middle (px), growth and rotation of a motion."""
    x, y = WIDTH / 2 - motion[1], HEIGHT / 2 - motion[2]
    return np.array(
        [
            motion[3] + motion[5] * x - motion[6] * y,
            motion[4] + motion[5] * y + motion[6] * x,
            motion[5],
            motion[6],
        ]
    )


def between(before, after):
    """What takes a picture of one pose to another: the same four numbers."""
    turn = complex(1.0 + after[2], after[3]) / complex(1.0 + before[2], before[3])
    moved = complex(after[0], after[1]) - turn * complex(before[0], before[1])
    return np.array([moved.real, moved.imag, turn.real - 1.0, turn.imag])


@pytest.mark.parametrize("kind", ["sway", "pan", "zoom", "turn"])
def test_known_motions_are_found(kind):
    k = np.arange(40)
    swing = np.sin(k / 4.0)
    pose = np.zeros((40, 4))
    if kind == "sway":
        pose[:, 0], pose[:, 1] = 4.0 * swing, 2.0 * np.cos(k / 3.0)
    elif kind == "pan":  # begins suddenly, and rests again
        pose[:, 0] = np.cumsum(np.where((k > 5) & (k < 15), 9.0, np.where((k > 25) & (k < 35), -9.0, 0.0)))
    else:
        pose[:, 2 if kind == "zoom" else 3] = 0.05 * swing
    grey = street()
    found = motions([seen(grey, one, seed=number) for number, one in enumerate(pose)])
    moved = np.abs(np.diff(pose, axis=0)).sum(axis=1) > 0.003
    for number in np.flatnonzero(moved) + 1:
        assert found[number] is not None, number
        error = at_middle(found[number]) - between(pose[number - 1], pose[number])
        assert np.abs(error[:2]).max() < 0.2
        assert np.abs(error[2:]).max() < 1e-3
    told = [number for number in range(1, 40) if found[number] is not None]
    errors = np.array([at_middle(found[n]) - between(pose[n - 1], pose[n]) for n in told])
    variance = np.array([found[n][7:] for n in told])
    assert (errors**2 / variance).mean() < 2.0, "what it says of its errors holds"


def test_a_camera_that_stands_still_has_no_motion():
    """Pictures with noise, whose light changes: scans are the very same objects."""
    grey, flow = street(), CameraFlow(CameraSettings())
    for k in range(60):
        frame = seen(grey * (1.0 - 0.2 * np.sin(k / 9.0)), noise=4.0, seed=k)
        scan = Scan(k / RATE, "rgb", NO_BOXES, np.zeros(0))
        assert flow(frame, scan) is scan


def test_nothing_is_told_of_a_dark_picture():
    rng = np.random.default_rng(0)
    dark = [rng.poisson(2.0, (HEIGHT, WIDTH, 3)).astype(np.uint8) for _ in range(20)]
    assert motions(dark) == [None] * 20


def test_nothing_is_told_where_the_picture_says_too_little():
    flat = np.full((HEIGHT, WIDTH, 3), 90, dtype=np.uint8)
    assert motions([flat] * 5) == [None] * 5


@pytest.mark.parametrize("noise", [0.3, 1.0])
def test_headlights_that_sweep_a_dark_road_are_not_the_camera(monkeypatch, noise):
    """Two cones of light go over a road at rest; followed as it is, the picture goes along with them."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    road = 0.15 + 0.1 * np.random.default_rng(3).random((HEIGHT, WIDTH))

    def lit(k):
        at = [(80.0 + 6.0 * k, 180.0), (300.0 + 6.0 * k, 240.0)]
        cones = sum(np.exp(-((x - cx) ** 2 / 6000.0 + (y - cy) ** 2 / 1500.0)) for cx, cy in at)
        return seen_as_it_is(2.0 + 160.0 * road * cones, noise, k)

    frames = [lit(k) for k in range(20)]
    assert motions(frames) == [None] * 20
    monkeypatch.setattr(camera_flow, "_detail", lambda grey: grey)
    assert any(one is not None for one in motions(frames))


def seen_as_it_is(grey, noise, seed):
    flat = grey + np.random.default_rng(seed).normal(0, noise, grey.shape)
    return np.repeat(np.clip(flat, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


@pytest.mark.parametrize("boxed", [True, False])
def test_vehicles_that_drive_are_not_the_camera(boxed):
    """A lorry over a quarter of the picture drives through it, found by the detector or not."""
    grey, lorry = street(), street(5)[:170, :330]
    frames, boxes = [], []
    for k in range(40):
        frame = seen(grey, seed=k)
        x = 8 * k
        frame[150:320, x : x + 330] = lorry[:, : WIDTH - x, None].clip(0, 255)
        frames.append(frame)
        boxes.append(np.array([[x, 150.0, 330.0, 170.0]]) if boxed else NO_BOXES)
    assert motions(frames, boxes) == [None] * 40


def test_after_pictures_that_tell_nothing_it_goes_on():
    grey = street()
    frames = [seen(grey, (5.0 * k, 0, 0, 0), seed=k) for k in range(16)]
    frames[6:9] = [np.zeros_like(frames[0])] * 3
    found = motions(frames)
    assert [one is None for one in found] == [k in (0, 6, 7, 8, 9) for k in range(16)]
    for k in (3, 5, 10, 15):
        np.testing.assert_allclose(at_middle(found[k])[:2], [5.0, 0.0], atol=0.2)
        assert found[k][0] == pytest.approx(1 / RATE)


def test_it_can_be_switched_off():
    grey, flow = street(), CameraFlow(CameraSettings(follow=False))
    for k in range(3):
        scan = Scan(k / RATE, "rgb", NO_BOXES, np.zeros(0))
        assert flow(seen(grey, (9.0 * k, 0, 0, 0)), scan) is scan


def test_the_fit_is_that_of_least_squares_without_strays():
    """The robust fit of clean points is the closed form, of complex numbers; a stray hardly moves it."""
    rng = np.random.default_rng(0)
    before = rng.uniform(0, 400, 60) + 1j * rng.uniform(0, 300, 60)
    after = (1.01 + 0.02j) * before + (3.0 - 2.0j) + 0.1 * (rng.normal(size=60) + 1j * rng.normal(size=60))
    A = np.stack([before, np.ones(60)], axis=1)
    want = np.linalg.lstsq(A, after, rcond=None)[0]
    clean = similarity(before, after)
    assert abs(clean.turn - want[0]) < 2e-4
    after[7] += 40.0
    assert abs(similarity(before, after).turn - want[0]) < 3e-4
    assert abs(np.linalg.lstsq(A, after, rcond=None)[0][0] - want[0]) > 1e-3, (
        "which least squares is moved by"
    )
