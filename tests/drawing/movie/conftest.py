"""A run of one vehicle, a segment with frames and events, and pictures as arrays."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.events import EventArray
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.media.video_writer import FrameWriter
from jeat_graph.io.tables.trajectories_io import write_trajectories
from jeat_graph.io.tables.truth_io import write_truth

WIDTH, HEIGHT = 160, 96


def vehicle(times, track_id=1, start=(30.0, 40.0), velocity=(50.0, 10.0), size=(24.0, 16.0), sigma=2.0):
    """A track that moves in a straight line."""
    t = np.asarray(times, dtype=float)
    centre = np.array(start) + t[:, None] * np.array(velocity)
    n = len(t)
    mean = np.concatenate([centre, np.tile(velocity, (n, 1)), np.zeros((n, 2))], axis=1)
    return Trajectories(
        t=t,
        track_id=np.full(n, track_id, dtype=np.int64),
        boxes=np.concatenate([centre - np.array(size) / 2, np.tile(size, (n, 1))], axis=1),
        existence=np.ones(n),
        mean=mean,
        var=np.full((n, 6), sigma**2),
        used=np.ones(n, dtype=np.int64),
        sensors=("rgb",),
    )


def truth_of(table):
    return GroundTruth(
        t=table.t,
        object_id=table.track_id,
        boxes=table.boxes,
        motion=None,
        ignore=np.zeros(len(table), dtype=bool),
    )


@pytest.fixture
def run(tmp_path):
    """A run of one second, causal rows at 20 Hz and smoothed rows at 5 Hz."""
    folder = tmp_path / "run"
    folder.mkdir()
    write_trajectories(vehicle(np.arange(21) * 0.05), folder / "causal.csv")
    write_trajectories(vehicle(np.arange(6) * 0.2), folder / "smoothed.csv")
    return folder


def grey_frame(k):
    return np.full((HEIGHT, WIDTH, 3), 20 + 10 * k, dtype=np.uint8)


@pytest.fixture(scope="session")
def events():
    rng = np.random.default_rng(4)
    n = 5000
    return EventArray(
        t_us=np.sort(rng.integers(0, 1_000_000, n)),
        x=rng.integers(0, WIDTH, n).astype(np.uint16),
        y=rng.integers(0, HEIGHT, n).astype(np.uint16),
        polarity=rng.integers(0, 2, n).astype(np.uint8),
    )


@pytest.fixture
def segment(tmp_path, events):
    """A simulated segment as `simulate --sensors pictures` lays it out: 10 frames from 0.05 s on."""
    folder = tmp_path / "000000"
    folder.mkdir()
    with FrameWriter(folder, "png", (WIDTH, HEIGHT), 20.0) as frames:
        for k in range(10):
            frames.append(50_000 * (k + 1), grey_frame(k))
    with EventWriter(folder / "events.h5", (WIDTH, HEIGHT)) as file:
        file.append(events)
    write_truth(truth_of(vehicle(np.arange(1, 11) * 0.05)), folder / "gt.csv")
    return folder


@pytest.fixture
def picture(tmp_path):
    """Render one time to PNG and return it as (H, W, 3), red first."""

    def make(run, at, *arguments):
        out = tmp_path / "picture.png"
        assert main(["render", str(run), "--at", str(at), "--out", str(out), *map(str, arguments)]) == 0
        return cv2.imread(str(out))[..., ::-1]

    return make


def read_movie(path):
    """Frames (N, H, W, 3) and rate of a video."""
    capture = cv2.VideoCapture(str(path))
    frames = []
    while True:
        good, frame = capture.read()
        if not good:
            return np.array(frames)[..., ::-1], capture.get(cv2.CAP_PROP_FPS)
        frames.append(frame)
