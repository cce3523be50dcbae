"""A drawn road: boxes that cross a small picture one after the other, as detections, events and pictures."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.detections import Detections
from jeat_graph.data.events import EventArray
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.tables.detections_io import write_detections

SIZE = (96, 64)
#: A vehicle comes each so many seconds, goes so fast (px/s), and has so many px.
EACH_S, SPEED, BOX = 1.5, 30.0, (16.0, 12.0)
LANES = (8.0, 36.0)


def vehicles_at(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Ids (G,) and boxes (G, 4) of the vehicles that are wholly in view at a time (s)."""
    number = np.arange(int(t / EACH_S) + 1)
    left = (t - number * EACH_S) * SPEED
    there = left + BOX[0] <= SIZE[0]
    top = np.array([LANES[k % 2] for k in number.tolist()])
    boxes = np.stack([left, top, *(np.full(len(number), side) for side in BOX)], axis=1)
    return number[there], boxes[there]


def truth_of(begin: float, end: float) -> GroundTruth:
    """True boxes each 50 ms."""
    times = np.arange(begin, end + 1e-9, 0.05)
    found = [vehicles_at(t) for t in times.tolist()]
    return GroundTruth(
        t=np.repeat(times, [len(ids) for ids, _ in found]),
        object_id=np.concatenate([ids for ids, _ in found]),
        boxes=np.concatenate([boxes for _, boxes in found]),
        motion=None,
        ignore=np.zeros(sum(len(ids) for ids, _ in found), dtype=bool),
        frames=times,
    )


def detections_of(sensors: tuple[str, ...], duration: float, seed: int = 0) -> Detections:
    """What good detectors report each 0.1 s: true boxes with a little noise."""
    rng = np.random.default_rng(seed)
    parts = []
    for t in np.arange(0.1, duration, 0.1).tolist():
        _, boxes = vehicles_at(t)
        for sensor in sensors:
            noisy = boxes + rng.normal(0.0, 0.2, boxes.shape)
            n = len(boxes)
            parts.append((np.full(n, t), [sensor] * n, noisy, rng.uniform(0.7, 0.95, n)))
    return Detections.from_rows(
        np.concatenate([one[0] for one in parts]),
        [name for one in parts for name in one[1]],
        np.concatenate([one[2] for one in parts]),
        np.concatenate([one[3] for one in parts]),
    )


def write_recording(folder, duration: float, sensors: tuple[str, ...] = ("evt", "rgb")) -> None:
    """Write `detections.csv` and `events.h5`."""
    folder.mkdir(parents=True, exist_ok=True)
    write_detections(detections_of(sensors, duration), folder / "detections.csv")
    write_events(folder / "events.h5", duration)


def write_events(path, duration: float, seed: int = 1) -> None:
    """Write events along the left and right sides of the vehicles."""
    rng = np.random.default_rng(seed)
    per, rows = 12, []
    for start in range(0, round(duration * 1e6), 5000):
        _, boxes = vehicles_at(start / 1e6)
        for left, top, width, height in boxes.tolist():
            right = rng.random(per) < 0.5
            x = np.where(right, left + width - 1.0, left).astype(int)
            y = rng.integers(int(top), int(top + height), per)
            rows.append(np.column_stack([rng.integers(start, start + 5000, per), x, y, right]))
    table = np.concatenate(rows)
    table = table[np.argsort(table[:, 0], kind="stable")]
    events = EventArray(
        table[:, 0], *(table[:, k].astype(kind) for k, kind in ((1, "u2"), (2, "u2"), (3, "u1")))
    )
    with EventWriter(path, SIZE, "none") as writer:
        writer.append(events, round(duration * 1e6))


def write_pictures(folder, duration: float, each_s: float = 0.1) -> None:
    """Write pictures of bright vehicles on a dark road, and when they were taken."""
    import cv2

    (folder / "frames").mkdir(parents=True)
    times = np.arange(0.1, duration, each_s)
    for k, t in enumerate(times.tolist()):
        picture = np.full((SIZE[1], SIZE[0], 3), 20, dtype=np.uint8)
        for left, top, width, height in vehicles_at(t)[1].round().astype(int).tolist():
            picture[top : top + height, left : left + width] = 200
        cv2.imwrite(str(folder / "frames" / f"{k:06d}.png"), picture)
    rows = "".join(f"{k},{round(t * 1e6)}\n" for k, t in enumerate(times.tolist()))
    (folder / "frames.csv").write_text("index,t_us\n" + rows, encoding="utf-8")
